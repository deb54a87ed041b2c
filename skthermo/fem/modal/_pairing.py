"""Mode shapes compared and paired: MAC, computed modes with reference and with measured ones."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._tables.arrays import (
    Array,
    check_dofs,
    check_model,
    check_names,
    check_theta,
    real_array,
    shape_array,
    without_mask,
)
from skthermo.fem._protocol import FEModel, ModalModel
from skthermo.fem._terms import nominal_theta

if TYPE_CHECKING:
    import pandas as pd


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
    cross = np.abs(a.conj().T @ b) ** 2
    return cross / np.outer(_squared_norms(a), _squared_norms(b))


def _columns(phi: ArrayLike, name: str) -> NDArray:
    array = shape_array(phi, name, any_size=True)
    array = array[:, np.newaxis] if array.ndim == 1 else array
    if array.ndim != 2:
        raise ValueError(f"{name} has shape {array.shape}; expected (n_dof, n_modes)")
    if np.isinf(array).any():
        raise ValueError(f"{name} holds infinite values; expected finite ones")
    empty = np.flatnonzero(~array.any(axis=0))
    if empty.size:
        raise ValueError(f"{name}: shape {empty[0]} is zero at every degree of freedom")
    return _scaled(array)


def _scaled(phi: NDArray) -> NDArray:
    """Shapes times powers of two, which change no digit, so that squares neither overflow nor vanish."""
    largest = np.maximum(abs(phi.real), abs(phi.imag)).max(axis=0)
    exponents = np.where(np.isfinite(largest), np.frexp(largest)[1], 0)
    half = exponents // 2
    return phi * np.ldexp(1.0, -half) * np.ldexp(1.0, half - exponents)


def _squared_norms(phi: NDArray) -> NDArray[np.float64]:
    return np.einsum("im,im->m", phi.conj(), phi).real


REPEATED = 1e-6
"""Relative distance of eigenvalues below which they count as repeated: rounding then decides their shapes."""


def pair_modes(mac: NDArray[np.float64], repeated: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """The candidate of each reference mode, (n_samples, n_modes), so that the sum of MACs is highest.

    ``mac`` is (n_samples, n_modes, n_candidates). Reference modes that share a ``repeated`` frequency, (n_modes,
    n_modes), have an arbitrary basis of the space they span as their shapes: candidates are compared with that space,
    and those assigned to it are sorted by frequency.
    """
    spans = np.nan_to_num(mac if repeated is None else repeated @ mac)
    best = spans.argmax(axis=2)
    distinct = (np.diff(np.sort(best, axis=1), axis=1) > 0).all(axis=1)
    for sample in np.flatnonzero(~distinct):
        best[sample] = linear_sum_assignment(spans[sample], maximize=True)[1]
    for cluster in () if repeated is None else np.unique(repeated, axis=0):
        best[:, cluster] = np.sort(best[:, cluster], axis=1)
    return best


def may_be_missed(
    mac: NDArray[np.float64], order: NDArray[np.intp], repeated: NDArray[np.bool_], spread: ArrayLike = 1.0
) -> NDArray[np.bool_]:
    """Samples in which a mode beyond the candidates could have a higher MAC with a reference than the one assigned.

    Modes are orthogonal, so the MACs of a reference with all modes add up to 1 (with repeated references, to their
    number). No mode beyond the candidates can have a higher MAC than what the candidates leave of that sum. Where the
    mass M is not the M_0 of the references, but a M_0 <= M <= b M_0, the sum is at most the ``spread`` b / a: squares
    (phi_0' M_0 phi)^2 add up to phi_0' M_0 M^-1 M_0 phi_0 <= 1 / a, and phi' M_0 phi >= 1 / b.
    """
    spans = repeated @ mac
    assigned = np.take_along_axis(spans, order[:, :, np.newaxis], axis=2)[:, :, 0]
    left = np.multiply.outer(spread, repeated.sum(axis=1)) - spans.sum(axis=2)
    return (assigned < left).any(axis=1)


def may_differ(
    mac: NDArray[np.float64], order: NDArray[np.intp], repeated: NDArray[np.bool_], spread: ArrayLike = 1.0
) -> NDArray[np.bool_]:
    """Samples in which the assignment could be another one if more candidates were examined.

    It is final where every reference is assigned its best candidate, which no mode beyond these can surpass.
    """
    spans = repeated @ mac
    assigned = np.take_along_axis(spans, order[:, :, np.newaxis], axis=2)[:, :, 0]
    return (assigned < spans.max(axis=2)).any(axis=1) | may_be_missed(mac, order, repeated, spread)


def repeated_modes(eigenvalues: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of some ascending eigenvalues equal each other up to rounding, (n_modes, n_modes)."""
    cluster = np.cumsum(np.diff(eigenvalues, prepend=0) > REPEATED * eigenvalues)
    return cluster[:, np.newaxis] == cluster


SAME_MODE = 0.5
"""MAC above which no other mode has a higher one with the same reference: its MACs add up to 1 with its mass."""

ROWS_AT_ONCE = 64  # samples whose shapes, at all degrees of freedom, are held at once


def share_reordered(model: ModalModel, theta: ArrayLike) -> float:
    """Share of some samples in which modes are not in their nominal order.

    Parameters
    ----------
    model : FE model
        With a method ``modes``.
    theta : array-like of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters.

    Returns
    -------
    float
        Between 0 and 1. A sample counts if some column of ``model.modes(theta)`` is not the nominal mode of the same
        number: another column has the higher MAC with that mode, or the column's own MAC with it is below 0.5.

    Raises
    ------
    ValueError
        If the model is none or has no method ``modes``, or theta has no rows, the wrong width, or a value that is
        not finite and positive.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import sample, share_reordered
    >>> truss = make_truss()
    >>> drawn = sample(truss, bounds=0.3, n_samples=200, random_state=0)
    >>> share_reordered(truss, drawn.theta)
    0.065
    """
    check_model(model)
    if not hasattr(model, "modes"):
        raise ValueError(f"{model!r} has no method 'modes'; expected a model with one, such as AffineModel")
    rows = check_theta(theta, model.parameter_names)
    if not len(rows):
        raise ValueError(f"theta has shape {rows.shape}; expected at least one row")
    pieces = range(ROWS_AT_ONCE, len(rows), ROWS_AT_ONCE)
    return float(np.concatenate([_reordered(model, piece) for piece in np.split(rows, pieces)]).mean())


def _reordered(model: ModalModel, theta: Array) -> NDArray[np.bool_]:
    shapes = model.modes(theta)[1]
    if hasattr(model, "nominal_mac"):
        macs = model.nominal_mac(shapes)
    else:
        nominal = model.modes(np.ones((1, theta.shape[1])))[1][0]
        macs = np.stack([mac(nominal, phi) for phi in shapes])
    swapped = pair_modes(macs) != np.arange(macs.shape[1])
    replaced = np.diagonal(macs, axis1=1, axis2=2) < SAME_MODE
    return (swapped | replaced).any(axis=1)


OFFSET_LIKE_MAC_0 = 0.15
"""Relative distance of two frequencies that weighs as much as a MAC of 0."""


def match_modes(
    model: FEModel, frequencies: ArrayLike, *, shapes: ArrayLike | None = None, dofs: ArrayLike | None = None
) -> pd.DataFrame:
    """Propose which of the model's modes each measured mode is.

    Parameters
    ----------
    model : FE model
        With a method ``local_modes``, more modes than ``n_modes`` are searched.
    frequencies : array-like or DataFrame of shape (n_records, n_measured) or (n_measured,)
        Measured frequencies in Hz, of which the mean over records counts. NaN is allowed.
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
        If a mode was never measured or a frequency is not positive, there are more measured modes than the model has,
        or just one of ``shapes`` and ``dofs`` is given.

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

    names = check_names([str(name) for name in getattr(frequencies, "columns", ())], "columns of the frequencies")
    measured = _mean_frequencies(frequencies)
    names = names or [f"f{i + 1}" for i in range(len(measured))]
    check_model(model)
    if (shapes is None) != (dofs is None):
        raise ValueError("expected both shapes and dofs, or neither")
    nominal = nominal_theta(len(model.parameter_names))
    local = model.local_modes(nominal) if hasattr(model, "local_modes") else None
    candidates = np.asarray(model.frequencies(nominal))[0] if local is None else local.frequencies
    if len(measured) > len(candidates):
        raise ValueError(f"{len(measured)} modes were measured; expected at most {len(candidates)}, as the model has")
    cost = (np.log(candidates / measured[:, np.newaxis]) / np.log1p(OFFSET_LIKE_MAC_0)) ** 2
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
    table["offset"] = 100 * (table["model"] / table["measured"] - 1)
    if macs is not None:
        table["mac"] = macs[np.arange(len(ranks)), ranks]
    return table


def _mean_frequencies(frequencies: ArrayLike) -> Array:
    F = np.atleast_2d(real_array(frequencies, "frequencies"))
    known = ~np.isnan(F)
    if F.ndim != 2 or not known.any(axis=0).all() or not (F[known] > 0).all() or not np.isfinite(F[known]).all():
        raise ValueError(
            f"frequencies have shape {F.shape}; expected (n_records, n_measured), positive numbers in Hz or NaN, and "
            "at least one in every column"
        )
    return np.nanmean(F, axis=0)


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
        All components of the first mode, then those of the second, and so on. Each shape is turned by the phase that
        makes its scalar product with the reference real and positive, its imaginary part is left out, and it is scaled
        to a root mean square of 1. All components of a mode are NaN where one of them is missing, or where its shape is
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
