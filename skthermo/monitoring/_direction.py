"""Whether records depart from a healthy baseline as by a loss of stiffness, or as by a gain."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.stats import chi2
from sklearn.pipeline import Pipeline

from skthermo._estimators.warnings import without_warnings
from skthermo._tables.arrays import Array, patterns
from skthermo._validation import last_step
from skthermo.residuals.cones import Cones
from skthermo.residuals.gaussian import Gaussian, whitenings

LOWERED = 1e-3  # share by which a frequency is lowered to see what the detector gets
MIXED = 0.02  # share of a squared departure that raised frequencies may leave where it counts as stiffening
NOISE = 0.001  # probability of more than noise
MOST_ROWS = 500  # of the baseline, the last ones, on which that is tried


@dataclass(frozen=True)
class Direction:
    """Tells softening from stiffening, by Rayleigh's principle.

    A loss of stiffness lowers some natural frequencies and raises none, whatever the structure. A record, or the mean
    of a window, counts as stiffening if frequencies that are raised, each by as much as suits best, explain more of its
    departure from the baseline than lowered ones do, and leave no more than noise or a fiftieth of its square: least
    squares in standard deviations of the baseline. A mixed change, as by a retrofit that adds mass, is no stiffening.

    ``steps`` are those of the detector before its last one, ``lowered`` what they make of one that is lowered by a
    share of itself, (n_features, n_modes), ``baseline`` the distribution of (means of) what the last step gets.
    """

    steps: Any
    columns: list
    window: int | pd.Timedelta
    lowered: Array
    baseline: Gaussian

    @classmethod
    def of(cls, detector: Any, baseline: pd.DataFrame, targets: Sequence) -> Direction:
        """Learned from a fitted detector and its baseline, whose frequencies are the columns ``targets``."""
        while hasattr(last_step(detector), "detectors_"):  # several that are fused: the first speaks for all
            detector = last_step(detector).detectors_[0]
        steps = detector[:-1] if isinstance(detector, Pipeline) and len(detector) > 1 else None
        columns, lookback = list(targets), getattr(last_step(detector), "lookback_", 0)
        window = pd.Timedelta(lookback) if isinstance(lookback, np.timedelta64) else lookback + 1
        some = baseline.iloc[-MOST_ROWS:]
        before, lowered = _features(steps, columns, some), []
        for mode in columns:
            changed = _features(steps, columns, some.assign(**{mode: some[mode] * (1 - LOWERED)}))
            lowered.append(((changed - before) / LOWERED).median().fillna(0.0))
        means = _means(_features(steps, columns, baseline), window)
        return cls(steps, columns, window, np.array(lowered).T, Gaussian.of(means))

    def of_rows(self, X: pd.DataFrame, rows: NDArray[np.bool_] | None = None) -> NDArray[np.int64]:
        """+1 (softening) or -1 (stiffening) for some of the rows in order of time, 0 for others and where no mode is.

        The rows have to begin with those that lags and windows need.
        """
        means = _means(_features(self.steps, self.columns, X), self.window)
        wanted = np.flatnonzero(~np.isnan(means).all(axis=1) & (True if rows is None else rows))
        signs = np.zeros(len(means), dtype=np.int64)
        signs[wanted] = self._signs(means[wanted])
        return signs

    def _signs(self, departures: Array) -> NDArray[np.int64]:
        present = ~np.isnan(departures)
        masks, pattern = patterns(present)
        roots = whitenings(self.baseline.covariance, masks)[0]
        white = np.einsum("ij,ijk->ik", self.baseline.centred(departures), roots[pattern])
        effects, squares = roots @ self.lowered, (white**2).sum(axis=1)
        along = np.einsum("ij,ijk->ik", white, effects[pattern])
        softer, stiffer = (Cones.of(effects).project(sign * along, pattern)[1] for sign in (1, -1))
        left = squares - stiffer**2
        explained = left <= np.maximum(MIXED * squares, chi2.isf(NOISE, present.sum(axis=1)))
        return np.where(explained & (stiffer > softer), -1, 1)


def _features(steps: Any, columns: list, X: pd.DataFrame) -> pd.DataFrame:
    """What the last step gets of records; of a detector without steps before it, the frequencies."""
    with without_warnings():
        features = X[columns] if steps is None else steps.transform(X)
    return pd.DataFrame(np.asarray(features, dtype=float), X.index)


def _means(features: pd.DataFrame, window: int | pd.Timedelta) -> Array:
    """Mean of what is there in the window that ends with each row."""
    return features.rolling(window, min_periods=1).mean().to_numpy()
