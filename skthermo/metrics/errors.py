"""Errors of predicted frequencies, by mode and by scenario."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.metrics import r2_score

from skthermo._core.arrays import as_columns, real_array
from skthermo._core.frames import MISSING_CODES, check_same_rows, column_names, row_weights


def mape(y_true: ArrayLike, y_pred: ArrayLike) -> NDArray[np.float64]:
    """Mean absolute percentage error of every mode, equation (19).

    Parameters
    ----------
    y_true : array-like or DataFrame of shape (n_samples, n_modes)
        Measured frequencies in Hz.
    y_pred : array-like or DataFrame of shape (n_samples, n_modes)
        Predicted frequencies in Hz. A pair in which either is NaN is ignored. Columns of two frames are paired
        by their names.

    Returns
    -------
    ndarray of shape (n_modes,)
        In percent; NaN for a mode without any pair of values.

    Raises
    ------
    ValueError
        If the shapes, the indices or the names of the columns differ; if a frequency is infinite, or a measured
        one not positive, or a predicted one stands for a missing value, such as -999.

    Examples
    --------
    >>> from skthermo.metrics import mape
    >>> mape([[2.0, 4.0], [2.0, 4.0]], [[2.02, 4.0], [1.98, float("nan")]])
    array([1., 0.])
    """
    return _percentages(*_paired(y_true, y_pred))


def error_table(y_true: ArrayLike, y_pred: ArrayLike, *, scenarios: Sequence[Any] | None = None) -> pd.DataFrame:
    """Mean absolute percentage errors by scenario and mode, as in Table 2 of [KCM26]_.

    Parameters
    ----------
    y_true : array-like or DataFrame of shape (n_samples, n_modes)
        Measured frequencies in Hz.
    y_pred : array-like or DataFrame of shape (n_samples, n_modes)
        Predicted frequencies in Hz. A pair in which either is NaN is ignored. Columns of two frames are paired
        by their names.
    scenarios : sequence of length n_samples, optional
        Scenario of every row, such as "SH-0" or "SB-50". By default all rows belong to one, "all".

    Returns
    -------
    DataFrame of shape (n_scenarios + 1, n_modes + 1)
        In percent; the last row and the last column are averages over scenarios and modes.

    Raises
    ------
    ValueError
        If the shapes, the indices or the names of the columns differ; if a frequency is infinite, or a measured
        one not positive, or a predicted one stands for a missing value, such as -999; if there is not one
        scenario for each row, or one is called "Average".

    Examples
    --------
    >>> from skthermo.metrics import error_table
    >>> error_table([[2.0], [4.0]], [[2.02], [4.12]], scenarios=["healthy", "damaged"]).round(2)
              f1  Average
    healthy  1.0      1.0
    damaged  3.0      3.0
    Average  2.0      2.0
    """
    measured, predicted = _paired(y_true, y_pred)
    labels = np.full(len(measured), "all") if scenarios is None else np.asarray(scenarios, dtype=object)
    if labels.shape != (len(measured),):
        raise ValueError(f"scenarios has shape {labels.shape}; expected ({len(measured)},), one for each row")
    if pd.isna(labels).any():
        raise ValueError(f"the scenario of row {np.flatnonzero(pd.isna(labels))[0]} is missing; expected one")
    if "Average" in labels:
        raise ValueError("a scenario is called 'Average'; expected another name: the averages have it")
    table = pd.DataFrame(
        {label: _percentages(measured[labels == label], predicted[labels == label]) for label in dict.fromkeys(labels)},
        index=column_names(y_true, "f"),
    ).T
    table.loc["Average"] = table.mean()
    table["Average"] = table.mean(axis=1)
    return table


def complete_r2(y_true: ArrayLike, y_pred: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
    """Coefficient of determination R2 over complete rows, averaged over columns.

    Parameters
    ----------
    y_true : array-like or DataFrame of shape (n_samples, n_columns)
        Measured values.
    y_pred : array-like or DataFrame of shape (n_samples, n_columns)
        Predicted values. Rows in which either holds NaN are ignored. Columns of two frames are paired by their
        names.
    sample_weight : array-like of shape (n_samples,), optional
        Weight of each row; a series is matched to the rows of a frame by index.

    Returns
    -------
    float
        At most 1; NaN with fewer than two complete rows.

    Raises
    ------
    ValueError
        If the shapes, the indices or the names of the columns differ, or a value is infinite; if weights are
        negative, NaN or infinite, all 0, or not one for each row.

    Examples
    --------
    >>> from skthermo.metrics.errors import complete_r2
    >>> complete_r2([[4.0], [4.2], [4.4]], [[4.0], [4.2], [float("nan")]])
    1.0
    """
    measured, predicted = _paired(y_true, y_pred, are_frequencies=False)
    complete, weights = ~np.isnan(measured + predicted).any(axis=1), row_weights(sample_weight, y_true)
    if weights is not None:
        complete &= weights > 0
        weights = weights[complete]
    if complete.sum() < 2:
        return float("nan")
    return float(r2_score(measured[complete], predicted[complete], sample_weight=weights))


def frequency_scorer(estimator: Any, X: ArrayLike, y: ArrayLike) -> dict[str, float]:
    """Scores for ``cross_validate`` and ``GridSearchCV`` from rows without NaN, and the share of these rows.

    Parameters
    ----------
    estimator : estimator
        Fitted estimator that predicts frequencies.
    X : array-like or DataFrame of shape (n_samples, n_sensors)
        Temperatures in degrees Celsius.
    y : array-like or DataFrame of shape (n_samples, n_modes)
        Measured frequencies in Hz.

    Returns
    -------
    dict
        ``neg_mape`` in percent, negative so that higher is better; ``r2``; ``share_scored``, the
        share of rows in which every mode is both measured and predicted.

    Raises
    ------
    ValueError
        If the estimator is none that is fitted; as in `mape`.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.dummy import DummyRegressor
    >>> from skthermo.metrics import frequency_scorer
    >>> T, F = np.zeros((4, 1)), np.array([[1.0], [3.0], [2.0], [2.0]])
    >>> scores = frequency_scorer(DummyRegressor().fit(T, F), T, [[2.5], [1.6], [2.0], [np.nan]])
    >>> {name: round(score, 2) for name, score in scores.items()}
    {'neg_mape': -15.0, 'r2': -0.01, 'share_scored': 0.75}
    """
    if isinstance(estimator, type) or not hasattr(estimator, "predict"):
        raise ValueError(f"estimator is {estimator!r:.200}; expected a fitted estimator with a method predict")
    measured, predicted = _paired(y, estimator.predict(X))
    complete = ~np.isnan(measured + predicted).any(axis=1)
    return {
        "neg_mape": -float(_percentages(measured[complete], predicted[complete]).mean()),
        "r2": complete_r2(measured, predicted),
        "share_scored": float(complete.mean()),
    }


def _paired(
    y_true: Any, y_pred: Any, *, are_frequencies: bool = True
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Both tables as arrays, the columns of two frames paired by name.

    Measured frequencies are positive, and no predicted one stands for a missing value.
    """
    if hasattr(y_true, "columns") and hasattr(y_pred, "columns"):
        names, others = list(y_true.columns), list(y_pred.columns)
        if names != others:
            if len(set(names)) < len(names) or set(names) != set(others) or len(names) != len(others):
                raise ValueError(f"y_true has the columns {names} and y_pred {others}; expected the same, each once")
            y_pred = y_pred[names]
    measured, predicted = as_columns(real_array(y_true, "y_true")), as_columns(real_array(y_pred, "y_pred"))
    if measured.ndim != 2 or measured.shape != predicted.shape:
        raise ValueError(
            f"y_true has shape {measured.shape} and y_pred {predicted.shape}; expected the same (n_samples, n_modes)"
        )
    check_same_rows(y_true, y_pred, ("y_true", "y_pred"))
    for name, values, table in (("y_true", measured, y_true), ("y_pred", predicted, y_pred)):
        _refuse(np.isinf(values), table, name, "a finite number, or NaN where a value is missing")
    if are_frequencies:
        _refuse(measured <= 0, y_true, "y_true", "a positive frequency, or NaN where it is missing")
        _refuse(np.isin(predicted, MISSING_CODES), y_pred, "y_pred", "a frequency, or NaN where it is missing")
    return measured, predicted


def _percentages(measured: NDArray[np.float64], predicted: NDArray[np.float64]) -> NDArray[np.float64]:
    return 100 * pd.DataFrame(np.abs((measured - predicted) / measured)).mean().to_numpy()


def _refuse(wrong: NDArray[np.bool_], table: Any, name: str, expected: str) -> None:
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        value = as_columns(table)[row, column]
        columns = column_names(table if np.ndim(table) == 2 else wrong, "f")
        raise ValueError(f"row {row} of {columns[column]!r} in {name} is {value:g}; expected {expected}")
