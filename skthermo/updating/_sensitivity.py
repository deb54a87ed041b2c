"""How strongly parameters change frequencies."""

from __future__ import annotations

from functools import partial
from typing import Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._estimators.arguments import check_model, check_theta
from skthermo._tables.arrays import HUGE, Array, central_differences, is_real, real_array
from skthermo.fem import FEModel, evaluate

SMALLEST_STEP = float(np.sqrt(np.finfo(float).eps))
"""Relative step of central differences at which rounding takes half of the digits of a frequency."""


def sensitivity(
    model: FEModel,
    theta: ArrayLike | None = None,
    *,
    method: Literal["exact", "central"] = "exact",
    step: float = 0.01,
) -> pd.DataFrame:
    """Normalised sensitivities of frequencies to parameters, equation (A.1).

    Parameters
    ----------
    model : FE model
        With ``method="exact"`` it needs a ``jacobian``.
    theta : array-like of shape (n_parameters,), optional
        Multipliers at which to differentiate; 1 by default.
    method : {"exact", "central"}, default="exact"
        Exact derivatives, or central differences, eq. (A.2), of any model.
    step : float, default=0.01
        Relative step of central differences, at least 1.5e-8.

    Returns
    -------
    DataFrame of shape (n_modes, n_parameters)
        S_ij = (theta_j / f_i) d f_i / d theta_j, in rows f1, f2, ... and the parameters' columns.

    Raises
    ------
    ValueError
        If the model is none, has no ``jacobian``, has no frequencies at theta, or method, theta or step is not valid.

    See Also
    --------
    select_parameters : Parameters that change some mode enough.
    identifiability : Parameters that measured modes can identify.

    Notes
    -----
    Eq. (A.2) is S_ij = (f_i(theta_j + h) - f_i(theta_j - h)) / (2 step f_i) with h = step theta_j. Where the model has
    no frequencies on one side, the difference to theta itself takes its place.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519, Appendix A [KCM26]_.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.updating import sensitivity
    >>> sensitivity(make_truss()).loc["f1"].round(3)
    bottom      0.233
    top         0.212
    diagonal    0.054
    vertical    0.001
    Name: f1, dtype: float64
    """
    row = theta_or_nominal(model, theta)
    frequencies = evaluate(model, row)
    if not np.isfinite(frequencies).all():
        raise ValueError(
            f"the model has the frequencies {frequencies[0]} at theta = {row[0].tolist()}; expected numbers"
        )
    if method == "exact":
        if not hasattr(model, "jacobian"):
            raise ValueError(f"{model!r} has no method 'jacobian'; expected one that has, or method='central'")
        jacobian = model.jacobian(row)
    elif method == "central":
        if not is_real(step) or not SMALLEST_STEP <= step < 1:
            raise ValueError(
                f"step is {step!r}; expected a relative step from {SMALLEST_STEP:.1e}, below which rounding takes "
                "more than half of the digits, to 1, such as 0.01"
            )
        jacobian = central_differences(partial(evaluate, model), row, frequencies, step)
    else:
        raise ValueError(f"method is {method!r}; expected 'exact' or 'central'")
    names = [f"f{i + 1}" for i in range(model.n_modes)]
    return pd.DataFrame(jacobian[0] * row / frequencies.T, names, list(model.parameter_names))


def select_parameters(S: pd.DataFrame, threshold: float = 0.1) -> list[str]:
    """Parameters that change at least one frequency enough.

    Parameters
    ----------
    S : DataFrame of shape (n_modes, n_parameters)
        Normalised sensitivities.
    threshold : float, default=0.1
        Smallest \\|S\\| that must be reached in some mode.

    Returns
    -------
    list of str
        Names in the order of the columns.

    Raises
    ------
    ValueError
        If S is not a frame of numbers, or the threshold not a number of zero or more.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.updating import select_parameters, sensitivity
    >>> select_parameters(sensitivity(make_truss()))
    ['bottom', 'top', 'diagonal']
    """
    if not isinstance(S, pd.DataFrame):
        raise ValueError(f"S is a {type(S).__name__}; expected a DataFrame whose columns are parameters")
    values = real_array(S, "S")
    if not values.size or not np.isfinite(values).all() or S.columns.has_duplicates:
        raise ValueError(
            f"S has shape {values.shape} and the columns {list(S.columns)}; expected finite sensitivities of different "
            "parameters"
        )
    if not is_real(threshold) or not 0 <= threshold < HUGE:
        raise ValueError(f"threshold is {threshold!r}; expected a number of zero or more, such as 0.1")
    return [*S.columns[(np.abs(values) >= threshold).any(axis=0)]]


def theta_or_nominal(model: FEModel, theta: ArrayLike | None) -> Array:
    """One checked row of multipliers, all 1 by default."""
    check_model(model)
    names = model.parameter_names
    return check_theta(np.ones(len(names)) if theta is None else theta, names, one_row=True)
