"""Modes at one theta, and their derivatives."""

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arrays import Array
from skthermo.fem._protocol import LocalModel
from skthermo.fem._theta import check_theta
from skthermo.fem.modal._beside_modes import solve_beside_modes
from skthermo.fem.modal._dense import hertz
from skthermo.fem.modal._matrices import ParametrisedMatrix
from skthermo.fem.modal._tracking import REPEATED


class LocalModes:
    """The lowest modes of a model at one theta, in ascending order, with their derivatives.

    Models make it: `AffineModel.local_modes`.

    Parameters
    ----------
    eigenvalues : ndarray of shape (n_candidates,)
        In ascending order; NaN where the stiffness is not positive definite.
    shapes : ndarray of shape (n, n_candidates)
        Of unit modal mass, in the coordinates in which the model is solved.
    nominal_mac : ndarray of shape (n_modes, n_candidates)
        Mass-weighted MAC of the nominal modes with these.
    ranks : ndarray of int of shape (n_modes,)
        Which of these modes each nominal mode has become.
    stiffness, mass : parametrised matrix
        In the same coordinates.
    theta : ndarray of shape (1, n_parameters)
        Where.
    solve : callable
        Solves K x = b at theta for columns b.
    basis : ndarray of shape (n_dof, n), optional
        From these coordinates to degrees of freedom. By default they are the same.

    Attributes
    ----------
    frequencies : ndarray of shape (n_candidates,)
        In Hz; more than the model has, to choose its modes from.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> modes = make_truss().local_modes([1.0, 1.0, 1.0, 1.0])
    >>> modes.frequencies[:6].round(2)
    array([ 7.48, 27.5 , 37.84, 62.61, 67.17, 95.41])
    >>> modes.ranks
    array([0, 1, 2, 3, 4, 5])
    >>> modes.shapes([0, 3]).shape
    (2, 10)
    """

    def __init__(
        self,
        eigenvalues: Array,
        shapes: Array,
        nominal_mac: Array,
        ranks: NDArray[np.intp],
        *,
        stiffness: ParametrisedMatrix,
        mass: ParametrisedMatrix,
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
        return self._at_dofs(np.asarray(dofs, dtype=np.intp), self._shapes)

    def derivatives(self, columns: ArrayLike, dofs: ArrayLike) -> tuple[Array, Array]:
        """Derivatives of some modes by the parameters.

        Parameters
        ----------
        columns : array-like of int of shape (n_columns,)
            Which of the modes, the lowest being 0.
        dofs : array-like of int of shape (n_dofs,)
            Degrees of freedom at which shapes are wanted; none are much cheaper.

        Returns
        -------
        d_frequencies : ndarray of shape (n_columns, n_parameters)
            In Hz.
        d_shapes : ndarray of shape (n_dofs, n_columns, n_parameters)
            Of the shapes with unit modal mass.

        Notes
        -----
        With b = -(dK - lambda_j dM) phi_j, the derivative of phi_j is x of (K - lambda_j M) x = b in M-orthogonal
        parts: (phi_k' b) / (lambda_k - lambda_j) along every other mode at hand, -1/2 phi_j' dM phi_j along phi_j
        itself, and a remainder that is found by iteration.
        """
        columns, dofs = np.asarray(columns, dtype=np.intp), np.asarray(dofs, dtype=np.intp)
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
        """The part of x that is M-orthogonal to the modes at hand, along which its squared length is known."""
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
        With a method ``local_modes``, such as `AffineModel`. Its columns are the nominal modes with ``track=True``,
        else the lowest modes.
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

    Raises
    ------
    ValueError
        If the model has no method ``local_modes``, or theta is not one row of positive multipliers.

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
    if not hasattr(model, "local_modes"):
        raise ValueError(f"{model!r} has no method 'local_modes'; expected a model with one, such as AffineModel")
    row = check_theta(theta, model.parameter_names, one_row=True)
    modes = model.local_modes(row, follow=True)
    columns = modes.ranks if model.track else np.arange(model.n_modes)
    places = np.arange(model.n_dof) if dofs is None else np.asarray(dofs)
    return modes.shapes(places)[:, columns], modes.derivatives(columns, places)[1]
