"""Which of a model's modes were measured."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._estimators.arguments import check_model
from skthermo._tables.arrays import Array, real_array, shape_array
from skthermo.fem._protocol import FEModel
from skthermo.fem._theta import nominal_theta
from skthermo.fem.modal._mac import mac

if TYPE_CHECKING:
    import pandas as pd

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
    dofs : array-like of int of shape (n_dofs,), optional
        The model's degrees of freedom that their rows are, the first being 0.

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

    names = [str(name) for name in getattr(frequencies, "columns", ())]
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
        expected = (np.size(dofs), len(measured))
        if np.shape(shapes) != expected:
            raise ValueError(
                f"shapes have shape {np.shape(shapes)}; expected {expected}: a row for each of dofs and a column for "
                "each measured mode"
            )
        if not np.isfinite(shapes).all():
            raise ValueError("shapes hold values that are not finite; expected a measured shape in each column")
        macs = mac(shapes, local.shapes(dofs))
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
