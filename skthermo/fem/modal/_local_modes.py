"""Modes at one theta and their derivatives."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import Array, Matrix, check_dofs, check_model, check_theta, integer_row
from skthermo.fem._protocol import LocalModel
from skthermo.fem._terms import AffineTerms
from skthermo.fem.modal._dense import hertz
from skthermo.fem.modal._pairing import REPEATED

CONVERGED = 1e-5
"""Residual, as a share of the derivative, at which the iteration stops. The error of the result is smaller."""

MAX_ITERATIONS = 200


def solve_beside_modes(
    solve: Callable[[Array], Array], mass: Matrix, shapes: Array, forces: Array, shifts: Array, known: Array
) -> Array:
    """Solve (K - shift M) x = force for x M-orthogonal to the lowest modes, for many columns at once.

    Multiplied by K^-1 it reads (I - shift K^-1 M) x = K^-1 force, which is positive definite on the complement of all
    modes up to the shift. It is solved by conjugate gradients in the inner product of M; the lower the ratio of the
    shift to the next eigenvalue, the fewer iterations. The last residual is added to x, which is one step of
    x = K^-1 (force + shift M x): it corrects the massless degrees of freedom, which the inner product of M cannot see.

    ``solve`` solves K x = b for columns b, ``shifts`` are below the eigenvalue of the first mode that is missing in
    ``shapes``, and the residual is measured by ``known``, the squared length of the derivative's part along these.
    """
    weighted = mass @ shapes

    def beside(vectors: Array) -> Array:
        return vectors - shapes @ (weighted.T @ vectors)

    residuals = beside(solve(forces))
    x, searches, found = np.zeros_like(residuals), np.zeros_like(residuals), np.empty_like(residuals)
    inertia = mass @ residuals
    squares, previous = np.einsum("ic,ic->c", residuals, inertia), np.full(len(shifts), np.inf)
    enough, columns = CONVERGED**2 * (known + squares), np.arange(len(shifts))
    for _ in range(MAX_ITERATIONS):
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


class LocalModes:
    """The lowest modes of a model at one theta, in ascending order, with their derivatives.

    The method ``local_modes`` of a model returns it, such as `AffineModel.local_modes`.

    Parameters
    ----------
    eigenvalues : ndarray of shape (n_candidates,)
        In ascending order; NaN where the stiffness is not positive definite.
    shapes : ndarray of shape (n, n_candidates)
        Of unit modal mass, in the coordinates in which the model is solved.
    nominal_mac : ndarray of shape (n_modes, n_candidates)
        Mass-weighted MAC of the nominal modes with these.
    ranks : ndarray of int of shape (n_modes,)
        Position, among these modes, of each nominal mode.
    stiffness, mass : parametrised matrix
        In the same coordinates.
    theta : ndarray of shape (1, n_parameters)
        Multipliers of the nominal parameters.
    solve : callable
        Solves K x = b at theta for columns b.
    basis : ndarray of shape (n_dof, n), optional
        Its columns are these coordinates' shapes at the degrees of freedom, where a model is solved on a basis of
        shapes.

    Attributes
    ----------
    frequencies : ndarray of shape (n_candidates,)
        In Hz. There are more than the model's ``n_modes``, so that its modes are among them.
    n_dof : int
        Number of degrees of freedom.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> make_truss().local_modes([1.0, 1.0, 1.0, 1.0]).frequencies[:6].round(2)
    array([ 7.48, 27.5 , 37.84, 62.61, 67.17, 95.41])
    """

    def __init__(
        self,
        eigenvalues: Array,
        shapes: Array,
        nominal_mac: Array,
        ranks: NDArray[np.intp],
        *,
        stiffness: AffineTerms,
        mass: AffineTerms,
        theta: Array,
        solve: Callable[[Array], Array],
        basis: Array | None = None,
    ):
        self.frequencies = hertz(eigenvalues)
        self.nominal_mac = nominal_mac
        self.ranks = ranks
        self._eigenvalues = eigenvalues
        self._shapes = shapes
        self._stiffness = stiffness
        self._mass = mass
        self._theta = theta
        self._solve = solve
        self._basis = basis
        self.n_dof = len(shapes if basis is None else basis)

    def shapes(self, dofs: ArrayLike) -> Array:
        """Mode shapes at some degrees of freedom.

        Parameters
        ----------
        dofs : array-like of int of shape (n_dofs,)
            The first is 0.

        Returns
        -------
        ndarray of shape (n_dofs, n_candidates)
            Of unit modal mass.
        """
        return self._at_dofs(check_dofs(dofs, self.n_dof), self._shapes)

    def derivatives(self, columns: ArrayLike, dofs: ArrayLike) -> tuple[Array, Array]:
        """Derivatives of some modes with respect to the parameters.

        Parameters
        ----------
        columns : array-like of int of shape (n_columns,)
            Which of the modes, the lowest being 0.
        dofs : array-like of int of shape (n_dofs,)
            Degrees of freedom at which derivatives of shapes are wanted. An empty list saves most of the time.

        Returns
        -------
        d_frequencies : ndarray of shape (n_columns, n_parameters)
            In Hz.
        d_shapes : ndarray of shape (n_dofs, n_columns, n_parameters)
            Derivatives of the shapes with unit modal mass.

        Notes
        -----
        With b = -(dK - lambda_j dM) phi_j, the derivative of phi_j is a sum of M-orthogonal parts:
        (phi_k' b) / (lambda_k - lambda_j) along every other computed mode k, -1/2 phi_j' dM phi_j along phi_j itself,
        and a remainder, the solution of (K - lambda_j M) x = b beside these modes, found by iteration. Where
        eigenvalues repeat, the parts along each other's modes are left out.
        """
        columns = integer_row(columns, "columns").astype(np.intp)
        if ((columns < 0) | (columns >= len(self._eigenvalues))).any():
            raise ValueError(f"columns holds {columns.tolist()}; expected 0 to {len(self._eigenvalues) - 1}, the modes")
        dofs = check_dofs(dofs, self.n_dof) if dofs is None or np.size(dofs) else np.empty(0, dtype=np.intp)
        stiffness, mass = self._stiffness, self._mass
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
        return d_frequencies, self._at_dofs(dofs, d_shapes)

    def _remainder(self, forces: Array, eigenvalues: Array, known: Array) -> Array:
        """The part of the derivatives beside the computed modes; ``known`` is the squared length along these."""
        mass = self._mass.assemble(self._theta)[0]
        columns = forces.reshape(len(forces), -1)
        shifts = np.repeat(eigenvalues, forces.shape[2])
        return solve_beside_modes(self._solve, mass, self._shapes, columns, shifts, known.ravel()).reshape(forces.shape)

    def _at_dofs(self, dofs: NDArray[np.intp], shapes: Array) -> Array:
        return shapes[dofs] if self._basis is None else np.tensordot(self._basis[dofs], shapes, axes=1)


def shape_jacobian(model: LocalModel, theta: ArrayLike, dofs: ArrayLike | None = None) -> tuple[Array, Array]:
    """Mode shapes at one theta and their exact derivatives.

    Parameters
    ----------
    model : FE model
        With a method ``local_modes``, such as `AffineModel`. Columns of the result are the nominal modes if it has
        ``track=True``, else the lowest modes.
    theta : array-like of shape (n_parameters,) or (1, n_parameters)
        Multipliers of the nominal parameters. Where eigenvalues repeat, derivatives of single shapes do not
        exist and the part within the repeated space is left out.
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction), optional
        Degrees of freedom, by position, the first being 0, or by label, as in ``model.dofs``. All by default.

    Returns
    -------
    shapes : ndarray of shape (n_dofs, n_modes)
        With unit modal mass; signs are arbitrary.
    derivatives : ndarray of shape (n_dofs, n_modes, n_parameters)
        Derivatives d phi / d theta of these shapes.

    Raises
    ------
    ValueError
        If the model has no method ``local_modes``, or theta or ``dofs`` are not valid.

    Notes
    -----
    `LocalModes.derivatives` explains the method, which needs no factorisation of its own for each mode as [Nel76]_
    does.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import shape_jacobian
    >>> shapes, derivatives = shape_jacobian(make_truss(), [1.0, 1.0, 1.0, 1.0], dofs=[0, 3])
    >>> shapes.shape, derivatives.shape
    ((2, 6), (2, 6, 4))
    """
    if not hasattr(model, "local_modes"):
        raise ValueError(f"{model!r} has no method 'local_modes'; expected a model with one, such as AffineModel")
    check_model(model)
    row = check_theta(theta, model.parameter_names, one_row=True)
    modes = model.local_modes(row, follow=True)
    columns = modes.ranks if model.track else np.arange(model.n_modes)
    places = np.arange(model.n_dof) if dofs is None else check_dofs(dofs, model.n_dof, getattr(model, "dofs", ()))
    return modes.shapes(places)[:, columns], modes.derivatives(columns, places)[1]
