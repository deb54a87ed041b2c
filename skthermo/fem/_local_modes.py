"""Modes at one theta, and their derivatives."""

from collections.abc import Callable

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray

from skthermo.fem._affine import GUARD_MODES, AffineModel
from skthermo.fem._eigen import hertz
from skthermo.fem._shift_invert import ShiftInvertForm
from skthermo.fem._terms import Matrix
from skthermo.fem._theta import check_one_theta
from skthermo.fem._tracking import REPEATED, may_be_missed, pair_modes

Array = NDArray[np.float64]

CONVERGED = 1e-5
"""Residual, as a share of the derivative, at which the iteration for shape derivatives stops; its error is smaller."""

MOST_ITERATIONS = 200


class LocalModes:
    """The lowest modes of an affine model at one theta, in ascending order.

    Attributes
    ----------
    frequencies : ndarray of shape (n_candidates,)
        In Hz; more than the model has, to choose its modes from.
    likeness : ndarray of shape (n_modes, n_candidates)
        Mass-weighted MAC with the model's nominal modes.
    """

    def __init__(self, model: AffineModel, theta: ArrayLike, n_candidates: int | None = None):
        self._model = model
        self._theta = check_one_theta(theta, model.parameter_names)
        model._warn_of_bounds(self._theta)
        self._wanted = min(n_candidates or model.n_modes + GUARD_MODES, model._most_candidates)
        if isinstance(model._form, ShiftInvertForm):
            self._eigenvalues, self._shapes, self._factors = model._form.factored_modes(self._theta, self._wanted)
        else:
            eigenvalues, shapes = model._form.modes(self._theta, self._wanted)
            self._eigenvalues, self._shapes, self._factors = eigenvalues[0], shapes[0], None
        self.frequencies = hertz(self._eigenvalues)
        self.likeness = model._likeness(self._shapes[np.newaxis])[0]

    @classmethod
    def followed(cls, model: AffineModel, theta: ArrayLike) -> tuple["LocalModes", NDArray[np.intp]]:
        """Modes at theta, and which of them each nominal mode has become."""
        n_candidates = model.n_modes + GUARD_MODES
        while True:
            modes = cls(model, theta, n_candidates)
            likeness = modes.likeness[np.newaxis]
            order = pair_modes(likeness, model._together)
            if modes._wanted < n_candidates or not may_be_missed(likeness, order, model._together).any():
                return modes, order[0]
            n_candidates *= 2

    def shapes(self, dofs: NDArray[np.intp]) -> Array:
        """Shapes of unit modal mass at degrees of freedom, (n_dofs, n_candidates)."""
        return self._model._at_dofs(dofs, self._shapes)

    def derivatives(self, columns: NDArray[np.intp], dofs: NDArray[np.intp]) -> tuple[Array, Array]:
        """Derivatives of modes' frequencies (n_columns, n_parameters) and shapes (n_dofs, n_columns, n_parameters).

        With b = -(dK - lambda_j dM) phi_j, the derivative of phi_j is x of (K - lambda_j M) x = b in M-orthogonal
        parts: (phi_k' b) / (lambda_k - lambda_j) along every other mode at hand, -1/2 phi_j' dM phi_j along phi_j
        itself, and a remainder that is found by iteration.
        """
        stiffness, mass = self._model._stiffness, self._model._mass
        phi, eigenvalues = self._shapes[:, columns], self._eigenvalues[columns]
        forces = -stiffness.derivatives(self._theta, phi)
        d_masses = np.zeros((len(columns), forces.shape[2]))
        if not mass.is_constant:
            inertia = mass.derivatives(self._theta, phi)
            d_masses = np.einsum("ij,ijp->jp", phi, inertia)
            forces += eigenvalues[:, np.newaxis] * inertia
        along = np.tensordot(self._shapes.T, forces, axes=1)
        own = (columns, np.arange(len(columns)))
        d_frequencies = -along[own] / (8 * np.pi**2 * self.frequencies[columns, np.newaxis])
        if not len(dofs):
            return d_frequencies, np.empty((0, *d_frequencies.shape))

        gaps = self._eigenvalues[:, np.newaxis] - eigenvalues
        apart = np.abs(gaps) > REPEATED * eigenvalues
        amplitudes = along / np.where(apart, gaps, np.inf)[:, :, np.newaxis]
        amplitudes[own] = -d_masses / 2
        remainder = self._remainder(forces, eigenvalues, (amplitudes**2).sum(axis=0))
        d_shapes = np.tensordot(self._shapes, amplitudes, axes=1) + remainder
        return d_frequencies, self._model._at_dofs(dofs, d_shapes)

    def _remainder(self, forces: Array, eigenvalues: Array, known: Array) -> Array:
        """The part of x that is M-orthogonal to the modes at hand, along which its squared length is known."""
        mass = self._model._mass.assemble(self._theta)[0]
        solve = self._factors.solve if self._factors else dense_solver(self._model._stiffness.assemble(self._theta)[0])
        columns = forces.reshape(len(forces), -1)
        shifts = np.repeat(eigenvalues, forces.shape[2])
        return solve_beside_modes(solve, mass, self._shapes, columns, shifts, known.ravel()).reshape(forces.shape)


def shape_jacobian(model: AffineModel, theta: ArrayLike, dofs: ArrayLike | None = None) -> tuple[Array, Array]:
    """Mode shapes at one theta and their exact derivatives.

    Parameters
    ----------
    model : AffineModel
        Its columns: nominal modes with ``track=True``, else the lowest modes.
    theta : array-like of shape (n_parameters,) or (1, n_parameters)
        Multipliers of the nominal parameters. Where eigenvalues repeat, derivatives of single shapes do not
        exist and the part within the repeated space is left out.
    dofs : array-like of int of shape (n_dofs,), optional
        Degrees of freedom, the first being 0. All by default.

    Returns
    -------
    shapes : ndarray of shape (n_dofs, n_modes)
        With unit modal mass; signs are arbitrary.
    derivatives : ndarray of shape (n_dofs, n_modes, n_parameters)
        d phi / d theta of these shapes.

    Notes
    -----
    The derivative solves (K - lambda M) d phi = -(dK - lambda dM - d lambda M) phi with phi' M d phi =
    -1/2 phi' dM phi: by superposition of the modes at hand, and conjugate gradients for what is beside them.

    References
    ----------
    Nelson, Simplified calculation of eigenvector derivatives, AIAA Journal 14 (1976) 1201-1205.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import shape_jacobian
    >>> shapes, derivatives = shape_jacobian(make_truss(), [1.0, 1.0, 1.0, 1.0], dofs=[0, 3])
    >>> shapes.shape, derivatives.shape
    ((2, 6), (2, 6, 4))
    """
    modes, order = LocalModes.followed(model, theta)
    columns = order if model.track else np.arange(model.n_modes)
    places = np.arange(model.n_dof) if dofs is None else np.asarray(dofs)
    return modes.shapes(places)[:, columns], modes.derivatives(columns, places)[1]


def solve_beside_modes(
    solve: Callable[[Array], Array], mass: Matrix, shapes: Array, forces: Array, shifts: Array, known: Array
) -> Array:
    """x of (K - shift M) x = force, M-orthogonal to the lowest modes, for many columns at once.

    K^-1 turns it into (I - shift K^-1 M) x = K^-1 force, which is positive definite beside all modes up to the shift:
    conjugate gradients in the inner product of M, whose rate the ratio of the shift to the next eigenvalue sets.
    The last residual is added, which makes it a step of x = K^-1 (force + shift M x) and reaches massless degrees of
    freedom too.
    """
    weighted = mass @ shapes

    def beside(vectors: Array) -> Array:
        return vectors - shapes @ (weighted.T @ vectors)

    residuals = beside(solve(forces))
    x, searches, found = np.zeros_like(residuals), np.zeros_like(residuals), np.empty_like(residuals)
    inertia = mass @ residuals
    squares, previous = np.einsum("ic,ic->c", residuals, inertia), np.full(len(shifts), np.inf)
    enough, columns = CONVERGED**2 * (known + squares), np.arange(len(shifts))
    for _ in range(MOST_ITERATIONS):
        going = squares > enough
        if not going.all():
            found[:, columns[~going]] = (x + residuals)[:, ~going]
            x, searches, residuals = x[:, going], searches[:, going], residuals[:, going]
            columns, squares, previous, enough, shifts = (
                v[going] for v in (columns, squares, previous, enough, shifts)
            )
            if not columns.size:
                break
        searches = residuals + squares / previous * searches
        inertia = mass @ searches
        images = beside(searches - shifts * solve(inertia))
        steps = squares / np.einsum("ic,ic->c", inertia, images)
        x, residuals, previous = x + steps * searches, residuals - steps * images, squares
        squares = np.einsum("ic,ic->c", residuals, mass @ residuals)
    found[:, columns] = x + residuals
    return found


def dense_solver(stiffness: Array) -> Callable[[Array], Array]:
    """What multiplies columns by the inverse of a positive definite stiffness."""
    factors = scipy.linalg.cho_factor(stiffness)
    return lambda columns: scipy.linalg.cho_solve(factors, columns)
