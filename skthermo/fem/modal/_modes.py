"""Modes at one theta with their derivatives, and mode shapes compared with measured ones."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._core.arrays import (
    Array,
    Matrix,
    check_dofs,
    check_model,
    check_names,
    integer_row,
    means_of_usual,
    real_array,
    shape_array,
    without_mask,
)
from skthermo._core.warnings import warn_each
from skthermo.exceptions import RecordsWarning
from skthermo.fem._protocol import FEModel
from skthermo.fem._terms import AffineTerms

if TYPE_CHECKING:
    import pandas as pd

REPEATED = 1e-6
"""Relative distance of eigenvalues below which they count as repeated: rounding then decides their shapes."""


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
    enough, columns = 1e-5**2 * (known + squares), np.arange(len(shifts))  # the errors of the results are smaller
    for _ in range(200):
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
        self.frequencies = np.sqrt(eigenvalues) / (2 * np.pi)
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
        and a remainder, the solution of (K - lambda_j M) x = b beside these modes, found by iteration, without a
        factorisation of its own for each mode as in [Nel76]_. Where eigenvalues repeat, the parts along each other's
        modes are left out.
        """
        columns = integer_row(columns, "columns").astype(np.intp)
        if ((columns < 0) | (columns >= len(self._eigenvalues))).any():
            raise ValueError(f"columns holds {columns.tolist()}; expected 0 to {len(self._eigenvalues) - 1}, the modes")
        dofs = check_dofs(dofs, self.n_dof) if dofs is None or np.size(dofs) else np.empty(0, dtype=np.intp)
        stiffness, mass = self._stiffness, self._mass
        phi, eigenvalues = self._shapes[:, columns], self._eigenvalues[columns]
        forces = -stiffness.derivatives(self._theta, phi[np.newaxis])[0]
        d_masses = np.zeros((len(columns), forces.shape[2]))
        if not mass.is_constant:
            inertia = mass.derivatives(self._theta, phi[np.newaxis])[0]
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
        matrix, known = mass.assemble(self._theta)[0], (amplitudes**2).sum(axis=0).ravel()
        loads, shifts = forces.reshape(len(forces), -1), np.repeat(eigenvalues, forces.shape[2])
        remainder = solve_beside_modes(self._solve, matrix, self._shapes, loads, shifts, known).reshape(forces.shape)
        d_shapes = np.tensordot(self._shapes, amplitudes, axes=1) + remainder
        return d_frequencies, self._at_dofs(dofs, d_shapes)

    def _at_dofs(self, dofs: NDArray[np.intp], shapes: Array) -> Array:
        return shapes[dofs] if self._basis is None else np.tensordot(self._basis[dofs], shapes, axes=1)


def linearised_by_row(
    local_modes: Callable[[Array], LocalModes], theta: Array, dofs: NDArray[np.intp], ranks: NDArray[np.intp] | None
) -> tuple[Array, Array, Array, Array]:
    """Frequencies and shapes at some degrees of freedom, and the derivatives of both, one row of theta after the other.

    The columns are the modes of these ranks, or the nominal modes where ``ranks`` is None.
    """
    parts = []
    for row in theta[:, np.newaxis]:
        modes = local_modes(row)
        columns = modes.ranks if ranks is None else ranks
        d_frequencies, d_shapes = modes.derivatives(columns, dofs)
        parts.append((modes.frequencies[columns], d_frequencies, modes.shapes(dofs)[:, columns], d_shapes))
    frequencies, jacobian, shapes, slopes = (np.stack(arrays) for arrays in zip(*parts, strict=True))
    return frequencies, jacobian, shapes, slopes


def mac(phi_a: ArrayLike, phi_b: ArrayLike) -> NDArray[np.float64]:
    """Modal assurance criterion of every pair of mode shapes.

    ``|phi_a^H phi_b|^2 / (phi_a^H phi_a * phi_b^H phi_b)``: 1 for the same shape whatever its
    scale, sign or phase, 0 for orthogonal ones [AB82]_.

    Parameters
    ----------
    phi_a : array-like of shape (n_dof, n_a) or (n_dof,)
        Mode shapes in columns, real or complex.
    phi_b : array-like of shape (n_dof, n_b) or (n_dof,)
        Mode shapes at the same degrees of freedom.

    Returns
    -------
    ndarray of shape (n_a, n_b)
        Between 0 and 1.

    Raises
    ------
    ValueError
        If the numbers of degrees of freedom differ, a shape is zero throughout, or a value is not a number.

    Examples
    --------
    >>> mac([[1.0, 1.0], [2.0, -0.5]], [2.0, 4.0]).round(12)
    array([[1.],
           [0.]])
    """
    a, b = (_columns(phi, name) for phi, name in ((phi_a, "phi_a"), (phi_b, "phi_b")))
    if len(a) != len(b):
        raise ValueError(f"phi_a has {len(a)} degrees of freedom and phi_b {len(b)}; expected the same")
    squared_lengths = (np.einsum("im,im->m", phi.conj(), phi).real for phi in (a, b))
    return np.abs(a.conj().T @ b) ** 2 / np.outer(*squared_lengths)


def _columns(phi: ArrayLike, name: str) -> NDArray:
    """Shapes of a largest component of 1, so that squares neither overflow nor vanish."""
    array = shape_array(phi, name, any_size=True)
    array = array[:, np.newaxis] if array.ndim == 1 else array
    if array.ndim != 2:
        raise ValueError(f"{name} has shape {array.shape}; expected (n_dof, n_modes)")
    if np.isinf(array).any():
        raise ValueError(f"{name} holds infinite values; expected finite ones")
    empty = np.flatnonzero(~array.any(axis=0))
    if empty.size:
        raise ValueError(f"{name}: shape {empty[0]} is zero at every degree of freedom")
    return array / np.abs(array).max(axis=0)


def match_modes(
    model: FEModel, frequencies: ArrayLike, *, shapes: ArrayLike | None = None, dofs: ArrayLike | None = None
) -> pd.DataFrame:
    """Propose which of the model's modes each measured mode is.

    Parameters
    ----------
    model : FE model
        With a method ``local_modes``, more modes than ``n_modes`` are searched.
    frequencies : array-like or DataFrame of shape (n_records, n_measured) or (n_measured,)
        Measured frequencies in Hz; their mean over records counts. NaN is allowed. Values that are not positive, or
        farther than half of it from the median of their column, count as missing.
    shapes : array-like of shape (n_dofs, n_measured), optional
        Measured mode shapes, real or complex, scaled in any way. The model needs a method ``local_modes``.
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction), optional
        The model's degrees of freedom that their rows are, by position, the first being 0, or by label, as in
        ``model.dofs``.

    Returns
    -------
    DataFrame
        One row for each measured mode: ``mode`` (rank among the model's modes, the lowest being 0), ``measured`` and
        ``model`` (frequencies in Hz), ``offset`` (model minus measured, in percent of the measured frequency) and, with
        shapes, ``mac``. ``model.with_modes(table["mode"])`` has these modes as its columns.

    Raises
    ------
    ValueError
        If a mode was never measured, there are more measured modes than the model has,
        or just one of ``shapes`` and ``dofs`` is given.

    Warns
    -----
    UserWarning
        If values count as missing; if, without shapes, another pairing is as good.

    Notes
    -----
    Modes are paired one to one so that the sum of squared differences of ln f is smallest. With shapes, the sum of
    1 - MAC is added, in which a MAC of 0 weighs as much as a frequency that is 15 % off.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import match_modes
    >>> match_modes(make_truss(), [7.6, 27.1, 62.0, 38.0]).round(2)
        mode  measured  model  offset
    f1     0       7.6   7.48   -1.52
    f2     1      27.1  27.50    1.48
    f3     3      62.0  62.61    0.99
    f4     2      38.0  37.84   -0.42
    """
    import pandas as pd  # imported here because fem does without it

    names = check_names([*map(str, getattr(frequencies, "columns", ()))], "columns of the frequencies")
    F = np.atleast_2d(real_array(frequencies, "frequencies"))
    if F.ndim != 2:
        raise ValueError(f"frequencies have shape {F.shape}; expected (n_records, n_measured)")
    names = names or [f"f{i + 1}" for i in range(F.shape[1])]
    measured, findings = means_of_usual(F, names)
    if np.isnan(measured).any():
        never = [name for name, mean in zip(names, measured, strict=True) if np.isnan(mean)]
        raise ValueError(f"frequencies {never} have no value above 0; expected at least one in Hz in every column")
    check_model(model)
    if (shapes is None) != (dofs is None):
        raise ValueError("expected both shapes and dofs, or neither")
    nominal = np.ones((1, len(model.parameter_names)))
    local = model.local_modes(nominal) if hasattr(model, "local_modes") else None
    candidates = np.asarray(model.frequencies(nominal))[0] if local is None else local.frequencies
    if len(measured) > len(candidates):
        raise ValueError(f"{len(measured)} modes were measured; expected at most {len(candidates)}, as the model has")
    # A distance of 15 % weighs as much as a MAC of 0.
    cost = (np.log(candidates / measured[:, np.newaxis]) / np.log1p(0.15)) ** 2
    macs = None
    if shapes is not None and dofs is not None:
        if local is None:
            raise ValueError(f"{model!r} has no method 'local_modes'; expected one where shapes are given")
        shapes = shape_array(shapes, "shapes")
        places = check_dofs(dofs, local.n_dof, getattr(model, "dofs", ()))
        expected = (len(places), len(measured))
        if np.shape(shapes) != expected:
            raise ValueError(
                f"shapes have shape {np.shape(shapes)}; expected {expected}: a row for each of dofs and a column for "
                "each measured mode"
            )
        if not np.isfinite(shapes).all():
            raise ValueError("shapes hold values that are not finite; expected a measured shape in each column")
        macs = mac(shapes, local.shapes(places))
        cost += 1 - macs
    ranks: NDArray[np.intp] = linear_sum_assignment(cost)[1]
    table = pd.DataFrame({"mode": ranks, "measured": measured, "model": candidates[ranks]}, index=names)
    if macs is None and (others := _other_pairing(cost, ranks)) is not None:
        changed = ", ".join(f"{names[i]!r} mode {others[i]}" for i in np.flatnonzero(others != ranks))
        text = (
            f"another pairing of modes is as good, by frequencies alone: {changed}. Both may be right. Give the "
            "measured shapes and dofs, or compare the shapes"
        )
        findings.append(RecordsWarning(text, "mode-order"))
    warn_each(findings)
    table["offset"] = 100 * (table["model"] / table["measured"] - 1)
    if macs is not None:
        table["mac"] = macs[np.arange(len(ranks)), ranks]
    return table


def _other_pairing(cost: Array, ranks: NDArray[np.intp]) -> NDArray[np.intp] | None:
    """The next best pairing, if it is as good: if its sum of squares is less than .05 more, as where two modes and
    their candidates are about 2 % apart each."""
    rivals = []
    for row, rank in enumerate(ranks):
        without = cost.copy()
        without[row, rank] = 1e6
        other: NDArray[np.intp] = linear_sum_assignment(without)[1]
        if other[row] != rank:
            rivals.append((float(cost[np.arange(len(ranks)), other].sum()), other.tolist()))
    least, nearest = min(rivals, default=(np.inf, []))
    return np.array(nearest) if least < float(cost[np.arange(len(ranks)), ranks].sum()) + 0.05 else None


def shape_components(shapes: ArrayLike, reference: ArrayLike) -> Array:
    """Real components of mode shapes, with the scale, sign and phase of the shapes taken out.

    Parameters
    ----------
    shapes : array-like of shape (n_samples, n_modes, n_sensors)
        Mode shapes, real or complex, of any scale, sign and phase. For the shapes (n_samples, n_dofs, n_modes) of an
        FE model, swap the last two axes.
    reference : array-like of shape (n_sensors, n_modes)
        Shapes that set the signs, such as the nominal ones of an FE model.

    Returns
    -------
    ndarray of shape (n_samples, n_modes * n_sensors)
        All components of the first mode, then of the second, and so on. Each shape is turned by the phase that makes
        its scalar product with the reference real and positive, its imaginary part is left out, and it is scaled to a
        root mean square of 1. All components of a mode are NaN where one of them is missing, or where its shape is
        zero.

    Raises
    ------
    ValueError
        If the numbers of modes or sensors differ, or a reference is zero at all sensors.

    Examples
    --------
    >>> from skthermo.fem import shape_components
    >>> shape_components([[[2.0, 4.0]], [[-1j, -2j]], [[1.0, float("nan")]]], [[1.0], [1.0]]).round(3)
    array([[0.632, 1.265],
           [0.632, 1.265],
           [  nan,   nan]])
    """
    shapes = without_mask(shapes)
    measured, expected = shape_array(shapes, "shapes"), real_array(reference, "reference")
    if measured.ndim != 3 or measured.shape[:0:-1] != expected.shape:
        raise ValueError(
            f"shapes are {measured.shape} and reference {expected.shape}; expected (n_samples, n_modes, n_sensors) and "
            "(n_sensors, n_modes)"
        )
    if np.isinf(measured).any() or np.isinf(expected).any():
        raise ValueError("shapes or reference hold infinite values; expected finite ones, or NaN")
    if not expected.any(axis=0).all():
        mode = np.flatnonzero(~expected.any(axis=0))[0]
        raise ValueError(f"reference is zero at all sensors in mode {mode}; expected a mode that moves them")
    along = np.einsum("smd,dm->sm", measured, expected)
    length = np.abs(along)
    turns = np.where(length > 0, along.conj() / np.where(length > 0, length, 1.0), 1.0)
    real = (measured * turns[:, :, np.newaxis]).real
    size = np.sqrt((real**2).mean(axis=2, keepdims=True))
    return (real / np.where(size > 0, size, np.nan)).reshape(len(real), -1)
