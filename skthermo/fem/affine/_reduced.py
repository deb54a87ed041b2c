"""FE models on a small basis of their own mode shapes."""

from __future__ import annotations

from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from skthermo._estimators.arguments import check_bounds, check_theta
from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, Bounds, RandomState
from skthermo.exceptions import ModelWarning
from skthermo.fem.affine._base import AffineBase, Change, Groups, Names
from skthermo.fem.affine._basis import Basis, grow_basis
from skthermo.fem.affine._core import AffineCore


class ReducedModel(AffineBase):
    """An affine FE model projected on a small basis of its own mode shapes, accurate to a stated error.

    The basis V is spanned by modes at random points and corners of the box, and then at points where an error estimate
    is largest. Every term is projected once, V' K_t V, so that each solve is a small dense eigenproblem.
    `AffineModel.reduced` makes such a model.

    Parameters
    ----------
    full : AffineModel
        The model to reduce.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        Box of multipliers in which the error is controlled. Outside it a warning is given.
    tol : float, default=1e-5
        Largest relative error of a frequency. The basis grows until the errors at fresh random
        points and corners of the box are below tol / 2.
    random_state : int, RandomState or None, default=None
        Seed of those points, which are never those of a sample drawn with the same seed.

    Attributes
    ----------
    basis_size_ : int
        Number of basis vectors.
    error_ : float
        Largest relative error of a frequency at the check points.
    check_points_ : ndarray of shape (n_checks, n_parameters)
        Theta at which the full model was solved to compute ``error_``: ten or more uniform in the box, and up to
        ten of its corners, none of them a snapshot point.
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
    The j-th lowest frequency is never below the full model's j-th (Rayleigh-Ritz). The
    estimate of a relative error is r' K_0^-1 r / (2 lambda), with the residual r = K phi - lambda M phi
    of a mode of unit modal mass and the nominal stiffness K_0. Within 30 % of K_0 it was found to be 0.64 to
    1.3 times the error. Shapes are given at all degrees of freedom. A damaged model is checked anew, and its basis is
    enlarged if necessary.

    On the basis, the few lowest modes are found by iteration from the nominal ones. A bound certifies that none is
    missed and that the error of iteration is at most a hundredth of ``tol``; LAPACK solves the rows that it does not
    certify.

    References
    ----------
    Machiels, Maday, Oliveira, Patera & Rovas, Output bounds for reduced-basis approximations of symmetric
    positive definite eigenvalue problems, C. R. Acad. Sci. Paris I 331 (2000) 153-158 [MMO00]_.

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

    _basis: Array

    def __init__(self, full: AffineBase, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None):
        if not isinstance(full, AffineBase):
            raise ValueError(f"full is {full!r:.200}; expected an AffineModel, or a ReducedModel")
        if not isinstance(tol, int | float | np.floating) or not 0 < tol < 1:
            raise ValueError(f"tol is {tol!r}; expected a relative error between 0 and 1, such as 1e-5")
        self._parameter_names, self._groups, self._contents = full.parameter_names, full._groups, full._contents
        self._full = full
        self._bounds = check_bounds(bounds, full.parameter_names)
        self._tol = tol
        self._use(grow_basis(full._core, self._bounds, tol, random_state))

    @property
    def full(self) -> AffineBase:
        """The model that was reduced."""
        return self._full

    @property
    def basis_size_(self) -> int:
        """Number of basis vectors."""
        return self._core.stiffness.n_dof

    def rescaled(self, theta: ArrayLike) -> Self:
        row = check_theta(theta, self.parameter_names, one_row=True)
        full = self._full.rescaled(row)
        return self._twin(
            _full=full,
            _bounds=self._bounds / row.T,
            _core=full._core.projected(self._basis, self._tol),
            check_points_=self.check_points_ / row,
            snapshot_points_=self.snapshot_points_ / row,
        )

    def reduced(self, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None) -> ReducedModel:
        return ReducedModel(self._full, bounds, tol=tol, random_state=random_state)

    def __repr__(self) -> str:
        return f"ReducedModel({self._full!r}, {self.basis_size_} basis vectors, error {self.error_:.1e})"

    @property
    def _full_core(self) -> AffineCore:
        return self._full._core

    def _changed(self, change: Change, names: Names = None, bounds: Array | None = None, groups: Groups = None) -> Self:
        full = self._full._changed(change, names, groups=groups)
        known = dict(zip(self._parameter_names, self._bounds, strict=True))
        new = () if bounds is None else bounds
        known |= dict(zip([name for name in full.parameter_names if name not in known], new, strict=True))
        return self._regrown(full, np.array([known[name] for name in full.parameter_names]))

    def _regrown(self, full: AffineBase, bounds: Array) -> Self:
        """A reduced model of another full model; its basis starts from the present one."""
        twin = self._twin(_full=full, _bounds=bounds, _parameter_names=full.parameter_names, _groups=full._groups)
        twin._use(grow_basis(full._core, bounds, self._tol, 0, start=self._basis))
        return twin

    def _use(self, basis: Basis) -> None:
        self._core, self._basis = basis.core, basis.vectors
        self.error_, self.check_points_, self.snapshot_points_ = basis.error, basis.check_points, basis.snapshot_points

    def _warn_of_bounds(self, theta: Array) -> None:
        lowest, highest = self._bounds.T * [[1 - 1e-9], [1 + 1e-9]]
        outside = ((theta < lowest) | (theta > highest)).any(axis=1)
        if outside.any():
            warn_user(
                f"{outside.sum()} of {len(theta)} theta are outside the bounds for which the model was reduced, row "
                f"{np.flatnonzero(outside)[0]} the first: frequencies there may be wrong by more than {self._tol:g}",
                ModelWarning,
                "outside the reduced box",
            )
