"""Means of earlier temperatures, chosen where they predict responses in periods held out."""

from __future__ import annotations

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, robust_deviation, spread_evenly
from skthermo.preprocessing import ExponentialMeans

N_PERIODS = 5  # contiguous ones, so that a season is predicted from others


def chosen_means(T: pd.DataFrame, Y: Array) -> ExponentialMeans | None:
    """Means of one sensor that explain responses, with a half-life or with all of them; None where nothing is gained.

    A ridge regression on piecewise-linear functions of the temperatures predicts each response in five contiguous
    periods from the others. Means are chosen if they lower the mean absolute error of a response by a tenth, in four of
    the periods at least, and raise that of no other by half as much. The error has to fall half as far, or by a tenth,
    beside a straight line and a step in time, which would pass for memory of weeks. Nothing is chosen from fewer than
    270 days, which lack a season.
    """
    order = np.argsort(T.index, kind="stable")
    T, Y = T.iloc[order], Y[order]
    values, times = T.to_numpy(dtype=float), T.index
    rows = spread_evenly(np.flatnonzero(~np.isnan(values).any(axis=1) & ~np.isnan(Y).all(axis=1)), 2000)
    sensors = T.columns[spread_evenly(np.flatnonzero(np.ptp(values[rows], axis=0) > 0), 8)]
    ages = times[rows] - times[0]
    if len(rows) < 20 * N_PERIODS or ages[-1] < pd.Timedelta(days=270):  # to other seasons means extrapolate wildly
        return None
    lives = pd.Series(["6h", "1D", "5D", "30D"])
    tried = lives[pd.to_timedelta(lives).between(pd.Timedelta(np.median(np.diff(times))), ages[-1] / 8)].tolist()
    if not tried or not len(sensors):
        return None
    means = [T[sensors]] + [T[sensors].ewm(halflife=pd.Timedelta(one), times=times).mean() for one in tried]
    columns = np.hstack(means)[rows]
    standard = (columns - columns.mean(axis=0)) / columns.std(axis=0)
    knots = np.quantile(standard, (0.25, 0.5, 0.75), axis=0)
    lines = np.stack([standard, *np.maximum(standard - knots[:, np.newaxis], 0.0)], axis=2)  # of each column
    X = np.hstack([np.ones((len(rows), 1)), lines.reshape(len(rows), -1)])
    places = 1 + np.arange(lines[0].size).reshape(1 + len(tried), len(sensors), -1)  # of the lines among X
    base = np.append(0, places[0])
    candidates, sets, has_past = [], [base], []
    for sensor in range(len(sensors)):
        for some in (*(slice(k, k + 1) for k in range(len(tried))), slice(None)):
            lives = tried[some]
            candidates.append(ExponentialMeans(half_lives=lives, sensors=[sensors[sensor]]))
            sets.append(np.append(base, places[1:][some, sensor]))
            has_past.append(ages >= 2 * pd.Timedelta(lives[-1]))  # others lack the weather before
    falls = np.array([falls_of(X, y, sets, np.array(has_past)) for y in Y[rows].T])
    score = np.where((falls > 0.1).any(axis=0) & (falls > -0.05).all(axis=0), falls.mean(axis=0), 0)
    return candidates[score.argmax()] if score.max() > 0 else None


def falls_of(X: Array, y: Array, sets: list[NDArray[np.intp]], has_past: NDArray[np.bool_]) -> Array:
    """Share by which each set of columns lowers the error of a response below that of the first set, (n_sets - 1,).

    It is 0 where it is less than half of it, and than a tenth, beside a line and a step in time, or where the error
    falls in fewer than four periods.
    """
    nothing, known = np.zeros(len(sets) - 1), ~np.isnan(y)
    for _ in range(2):  # once more without what is far off
        if known.sum() < 20 * N_PERIODS:
            return nothing
        residual = np.full(len(y), np.nan)
        residual[known] = y[known] - predicted_by_others(X[known], y[known], sets[:1])[0]
        scale = robust_deviation(residual[:, np.newaxis])[0]
        known &= np.abs(np.nan_to_num(residual)) <= 5 * scale
    if not scale > 0:
        return nothing
    X, y, has_past = X[known], y[known], has_past[:, known]
    place = np.arange(len(y)) / len(y)
    shapes = np.column_stack([place, place[:, np.newaxis] >= np.arange(1, 24) / 24]) - 0.5
    columns = np.column_stack([y, shapes])
    left, *own = (columns - X[:, sets[0]] @ np.linalg.lstsq(X[:, sets[0]], columns, rcond=None)[0]).T
    misfits = [np.linalg.lstsq(np.column_stack([own[0], step]), left, rcond=None)[1].sum() for step in own[1:]]
    beside = shapes[:, [0, 1 + int(np.argmin(misfits))]]  # a line, and the step that explains most beside the weather
    with_time = [np.append(columns, X.shape[1] + np.arange(2)) for columns in sets]
    errors = np.abs(y - predicted_by_others(np.hstack([X, beside]), y, [*sets, *with_time])).reshape(2, len(sets), -1)
    period = np.arange(len(y)) * N_PERIODS // len(y)
    falls = np.empty(len(sets) - 1)
    for number, rows in enumerate(has_past):
        fall, fall_beside = 1 - errors[:, 1 + number, rows].mean(axis=1) / errors[:, 0, rows].mean(axis=1)
        differences = np.bincount(period[rows], (errors[0, 1 + number] - errors[0, 0])[rows], N_PERIODS)
        is_steady = (differences < 0).sum() >= min(4, len(np.unique(period[rows])))
        falls[number] = fall if is_steady and fall_beside >= min(0.5 * fall, 0.1) else min(fall, 0.0)
    return falls


def predicted_by_others(X: Array, Y: Array, sets: list[NDArray[np.intp]]) -> Array:
    """Responses of each period predicted from the others by ridge regressions on sets of columns, (n_sets, *Y.shape).

    The first column is a constant. All sets share the products of the columns.
    """
    parts = np.array_split(np.arange(len(Y)), N_PERIODS)
    gram, targets = X.T @ X, X.T @ Y
    ridge = 1e-3 * len(X) * np.diag(np.arange(X.shape[1]) > 0)
    predicted = np.empty((len(sets), *Y.shape))
    for rows in parts:
        others, of_others = gram - X[rows].T @ X[rows] + ridge, targets - X[rows].T @ Y[rows]
        for found, columns in zip(predicted, sets, strict=True):
            slopes = np.linalg.solve(others[np.ix_(columns, columns)], of_others[columns])
            found[rows] = X[np.ix_(rows, columns)] @ slopes
    return predicted
