"""Galerkin models on a basis of mode shapes."""

import warnings
from collections.abc import Mapping

import numpy as np
import scipy.linalg
import scipy.sparse.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array
from sklearn.utils import check_random_state

from skthermo.fem._affine import GUARD_MODES, AffineModel
from skthermo.fem._eigen import dense_form
from skthermo.fem._sampling import check_bounds
from skthermo.fem._shift_invert import factorise
from skthermo.fem._theta import check_one_theta, nominal_theta
from skthermo.fem._tracking import may_be_missed, pair_modes

Array = NDArray[np.float64]
RandomState = int | np.random.RandomState | None

SNAPSHOTS_PER_ROUND = 8
CANDIDATES_PER_ROUND = 96
CHECKS = 20
MOST_ROUNDS = 40

LEAST_ENERGY = 1e-13
"""Share of strain energy below which a direction is made of rounding."""

SHARPEST = 1e13
"""Spectrum, times the relative error allowed, up to which the standard form has the digits."""


class ReducedModel(AffineModel):
    """An affine FE model on a small basis of its own mode shapes, to a stated error.

    Modes at random points of the box, and then where an error estimate is largest, span a basis V;
    every term is projected once, V' K_t V, so that a solve is a small dense eigenproblem. Made by
    `AffineModel.reduced`.

    Parameters
    ----------
    full : AffineModel
        The model to reduce.
    bounds : float or array-like of shape (n_parameters, 2), default=0.3
        Box of multipliers in which the error is controlled. Outside it a warning is given.
    tol : float, default=1e-5
        Largest relative error of a frequency. The basis grows until the errors at fresh
        random points of the box are below tol / 2.
    random_state : int, RandomState or None, default=None
        Seed of those points.

    Attributes
    ----------
    basis_size_ : int
        Number of basis vectors.
    error_ : float
        Largest relative error of a frequency at the check points.
    check_points_ : ndarray of shape (20, n_parameters)
        Uniform random theta at which the full model was solved for ``error_``.
    snapshot_points_ : ndarray of shape (n_snapshots, n_parameters)
        Theta whose modes span the basis.

    Raises
    ------
    ValueError
        If the bounds are infeasible or ``tol`` is not between 0 and 1.
    RuntimeError
        If no basis reaches ``tol``.

    Notes
    -----
    A frequency of rank j is never below the full model's of that rank (Rayleigh-Ritz). The
    estimate of a relative error is r' K_0^-1 r / (2 lambda), with the residual r = K phi - lambda M phi
    of a mode of unit modal mass and the nominal stiffness K_0. Shapes are given at all degrees of
    freedom. A damaged model is checked anew, and its basis grows if it must.

    References
    ----------
    Machiels, Maday, Oliveira, Patera & Rovas, Output bounds for reduced-basis approximations of symmetric
    positive definite eigenvalue problems, C. R. Acad. Sci. Paris I 331 (2000) 153-158.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.datasets import make_truss
    >>> truss = make_truss()
    >>> reduced = truss.reduced(bounds=0.2, random_state=0)
    >>> reduced.error_ < 5e-6
    True
    >>> theta = [[0.9, 1.1, 1.0, 0.85]]
    >>> bool(np.abs(reduced.frequencies(theta) / truss.frequencies(theta) - 1).max() < 1e-5)
    True
    """

    def __init__(
        self,
        full: AffineModel,
        bounds: ArrayLike = 0.3,
        *,
        tol: float = 1e-5,
        random_state: RandomState = None,
    ):
        if not 0 < tol < 1:
            raise ValueError(f"tol is {tol!r}; expected a relative error between 0 and 1, such as 1e-5")
        vars(self).update(vars(full))
        self._full = full
        self._bounds = check_bounds(bounds, full.parameter_names)
        self._tol = tol
        self._grow(np.empty((full.n_dof, 0)), check_random_state(random_state))

    @property
    def basis_size_(self) -> int:
        """Number of basis vectors."""
        return self._basis.shape[1]

    @property
    def _unreduced(self) -> AffineModel:
        return self._full

    def damaged(self, damage: Mapping[str, float]) -> "ReducedModel":
        """A new model with less stiffness (or more) in some groups, on a basis that represents it.

        Parameters
        ----------
        damage : mapping of str to float
            Group -> severity s, which multiplies the group's stiffness by 1 - s.

        Returns
        -------
        ReducedModel
            Checked against the damaged full model, to the same tolerance.
        """
        full = self._full.damaged(damage)
        twin = ReducedModel.__new__(ReducedModel)
        vars(twin).update(vars(self) | {"_full": full})
        twin._grow(self._basis, check_random_state(0))
        return twin

    def rescaled(self, theta: ArrayLike) -> "ReducedModel":
        """A new model on the same basis whose nominal state, theta = 1, is this model at a given theta.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,) or (1, n_parameters)
            Multipliers that become the new nominal values.

        Returns
        -------
        ReducedModel
            For the same box, which its multipliers now measure from theta.
        """
        row = check_one_theta(theta, self.parameter_names)
        twin = ReducedModel.__new__(ReducedModel)
        vars(twin).update(vars(self) | {"_full": self._full.rescaled(row), "_bounds": self._bounds / row.T})
        twin.check_points_, twin.snapshot_points_ = self.check_points_ / row, self.snapshot_points_ / row
        twin._project(self._basis)
        return twin

    def __repr__(self) -> str:
        return f"ReducedModel({self._full!r}, {self.basis_size_} basis vectors, error {self.error_:.1e})"

    def _grow(self, snapshots: Array, random: np.random.RandomState) -> None:
        """Add modes where the estimated error is largest until it is small, and the true error at fresh points too."""
        nominal = nominal_theta(len(self.parameter_names))
        stiffness = self._full.matrices(nominal)[0]
        factors = factorise(stiffness)
        points = nominal[:0] if snapshots.size else np.vstack([nominal, self._draw(random, SNAPSHOTS_PER_ROUND)])
        used = [points]
        for _ in range(MOST_ROUNDS):
            snapshots = np.hstack([snapshots, self._snapshots(points)])
            self._project(orthonormal(snapshots, stiffness, drop=max(self._tol / 100, LEAST_ENERGY)))
            candidates = self._draw(random, CANDIDATES_PER_ROUND)
            errors = self._estimated_errors(candidates, factors)
            if errors.max() < self._tol / 4:
                candidates = self.check_points_ = self._draw(random, CHECKS)
                errors = self._errors(candidates)
                self.error_ = float(errors.max())
                if self.error_ < self._tol / 2:
                    break
            points = candidates[np.argsort(-errors)[:SNAPSHOTS_PER_ROUND]]
            used.append(points)
        else:
            raise RuntimeError(
                f"after {MOST_ROUNDS} rounds {self.basis_size_} basis vectors do not give frequencies to "
                f"{self._tol:g}; expected a larger tol, or narrower bounds"
            )
        self.snapshot_points_ = np.vstack(used)

    def _at_dofs(self, dofs: NDArray[np.intp], shapes: Array) -> Array:
        return np.tensordot(self._basis[dofs], shapes, axes=1)

    def _draw(self, random: np.random.RandomState, n_points: int) -> Array:
        lowest, highest = self._bounds.T
        return random.uniform(lowest, highest, size=(n_points, len(self._bounds)))

    def _snapshots(self, theta: Array) -> Array:
        """Shapes of the full model's lowest modes, and of its own where these are others, side by side."""
        if not len(theta):
            return np.empty((self.n_dof, 0))
        n_snapshots = min(self.n_modes + GUARD_MODES, self._full._most_candidates)
        lowest = self._full._form.modes(theta, n_snapshots)[1]
        shapes = [*lowest]
        if self.track:
            likeness = self._full._likeness(lowest)
            elsewhere = may_be_missed(likeness, pair_modes(likeness, self._together), self._together)
            shapes += [*self._full._modes(theta[elsewhere])[1]] if elsewhere.any() else []
        together = np.hstack(shapes)
        return together[:, np.isfinite(together).all(axis=0)]

    def _expanded(self, shapes: Array) -> Array:
        return self._basis @ shapes

    def _project(self, basis: Array) -> None:
        self._basis = basis
        self._stiffness = self._full._stiffness.congruent(basis)
        self._mass = self._full._mass.congruent(basis)
        self._form = dense_form(self._stiffness, self._mass, widest=self._tol * SHARPEST)
        self._weighted_shapes = basis.T @ self._full._weighted_shapes
        self._most_candidates = min(self._full._most_candidates, self.basis_size_)

    def _estimated_errors(self, theta: Array, factors: scipy.sparse.linalg.SuperLU) -> Array:
        """Largest r' K_0^-1 r / (2 lambda) over the modes of every row."""
        errors = []
        for rows in np.split(theta, range(self._full.rows_per_chunk, len(theta), self._full.rows_per_chunk)):
            frequencies, shapes = self._modes(rows)
            eigenvalues, phi = (2 * np.pi * frequencies) ** 2, self._basis @ shapes
            inertia = eigenvalues[:, np.newaxis] * self._full._mass.product(rows, phi)
            residuals = self._full._stiffness.product(rows, phi) - inertia
            norms = [np.einsum("im,im->m", residual, factors.solve(residual)) for residual in residuals]
            errors.append((np.array(norms) / (2 * eigenvalues)).max(axis=1))
        return np.nan_to_num(np.concatenate(errors))

    def _errors(self, theta: Array) -> Array:
        """Largest relative error of a frequency in every row."""
        full = self._full.frequencies(theta)
        errors = np.where(np.isnan(full), 0.0, np.abs(self.frequencies(theta) / full - 1))
        return np.nan_to_num(errors, nan=np.inf).max(axis=1)

    def _warn_of_bounds(self, theta: Array) -> None:
        lowest, highest = self._bounds.T * [[1 - 1e-9], [1 + 1e-9]]
        outside = ((theta < lowest) | (theta > highest)).any(axis=1)
        if outside.any():
            warnings.warn(
                f"{outside.sum()} of {len(theta)} theta are outside the bounds for which the model was reduced, row "
                f"{np.flatnonzero(outside)[0]} the first: frequencies there may be wrong by more than {self._tol:g}",
                UserWarning,
                stacklevel=5,
            )


def orthonormal(vectors: Array, stiffness: csc_array, *, drop: float) -> Array:
    """The directions of vectors of equal strain energy, orthonormal in a stiffness, without the share ``drop``."""
    scaled = vectors / np.sqrt(np.einsum("im,im->m", vectors, stiffness @ vectors))
    energies, directions = scipy.linalg.eigh(scaled.T @ (stiffness @ scaled))
    kept = energies > drop * energies[-1]
    return scaled @ (directions[:, kept] / np.sqrt(energies[kept]))
