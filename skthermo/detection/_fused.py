"""Several detectors as one."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import _BaseComposition, last_step
from skthermo._core.warnings import checked_once, explain_rows, explained_rows, warnings_once
from skthermo.detection._base import DamageDetector, conformal_threshold


class FusedDetector(DamageDetector, _BaseComposition):
    """Alarm where several detectors together find records far from a healthy baseline.

    The damage index is the mean of theirs, each divided by its own threshold. Compensators differ in how well they
    remove the effect of temperature; the mean index is nearly as good as the best of them, or better, without a choice.

    Parameters
    ----------
    detectors : list of (str, detector)
        Names and detectors, or pipelines that end with one, such as ``make_pipeline(TemperatureCompensator(...),
        MahalanobisDetector())``. All get the same columns.
    contamination : float, default=0.02
        Share of healthy records above the threshold.

    Attributes
    ----------
    detectors_ : list of detector
        Fitted clones.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline, from the indices by which the detectors set their own thresholds.
    threshold_, offset_ : float
        The ceil((n + 1)(1 - contamination))-th smallest of them; ``decision_function`` is ``score_samples - offset_``.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns and, where `fit` saw a frame with such, their names.

    See Also
    --------
    MahalanobisDetector : The detector at the end of most pipelines.

    Notes
    -----
    A record that some of the detectors cannot evaluate gets the mean of the others; one that none can evaluate has the
    index NaN, and ``predict`` gives 0.

    Examples
    --------
    >>> from sklearn.linear_model import LinearRegression
    >>> from sklearn.neighbors import KNeighborsRegressor
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import FusedDetector, MahalanobisDetector, TemperatureCompensator
    >>> healthy, damaged = (make_truss_campaign(damage=damage, random_state=0) for damage in (None, {"top": 0.1}))
    >>> baseline, later = (campaign.temperatures.join(campaign.frequencies) for campaign in (healthy, damaged))
    >>> def detector(regressor):
    ...     compensator = TemperatureCompensator(regressor, targets=list(healthy.frequencies))
    ...     return make_pipeline(compensator, MahalanobisDetector())
    >>> detectors = [("lines", detector(LinearRegression())), ("neighbours", detector(KNeighborsRegressor()))]
    >>> fused = FusedDetector(detectors).fit(baseline)
    >>> print(f"{(fused.predict(later) == -1).mean():.0%} alarms")
    35% alarms
    """

    _parameter_constraints: dict = {**DamageDetector._parameter_constraints, "detectors": [list]}

    def __init__(self, detectors: Sequence[tuple[str, Any]], contamination: float = 0.02):
        self.detectors = detectors
        self.contamination = contamination

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        return self._get_params("detectors", deep=deep)

    def set_params(self, **params: Any) -> FusedDetector:  # also of the detectors, by their names
        return self._set_params("detectors", **params)

    def _measurements(self, F: Any) -> Array:
        """Its detectors check what they are given, which may hold temperatures, too."""
        return as_floats(F)

    def _records(self, X: ArrayLike, F: Array, is_baseline: bool = False) -> ArrayLike:
        return X

    def _learn(self, X: ArrayLike, times: Array) -> Array:
        if not self.detectors:
            raise ValueError("detectors is an empty list; expected one or more (name, detector)")
        pairs = [pair for pair in self.detectors if isinstance(pair, tuple) and len(pair) == 2]
        wrong = [p for p in pairs if not isinstance(p[0], str) or isinstance(p[1], type) or not hasattr(p[1], "fit")]
        if len(pairs) < len(self.detectors) or wrong or len({name for name, _ in pairs}) < len(pairs):
            raise ValueError(
                f"detectors is {self.detectors!r:.200}; expected pairs (name, detector) with names of their own"
            )
        self._validate_names([name for name, _ in self.detectors])
        with warnings_once("for other detectors"), checked_once():
            self.detectors_ = [clone(detector).fit(X) for _, detector in self.detectors]
        lasts = [last_step(detector) for detector in self.detectors_]
        for (name, _), last in zip(self.detectors, lasts, strict=True):
            if not isinstance(last, DamageDetector) or last.threshold_ <= 0:
                raise ValueError(
                    f"detector {name!r} ends with {last!r:.200}; expected a detector of this package with a positive "
                    "threshold, such as MahalanobisDetector()"
                )
        return _mean([last.baseline_index_ / last.threshold_ for last in lasts])

    def _limit(self, index: Array) -> float:
        return conformal_threshold(index, self.contamination)

    def _index(self, X: ArrayLike) -> Array:
        with warnings_once("for other detectors"):
            scores = [fitted.score_samples(X) for fitted in self.detectors_]
        thresholds = [last_step(fitted).threshold_ for fitted in self.detectors_]
        index = _mean([-score / limit for score, limit in zip(scores, thresholds, strict=True)])
        explained = [explained_rows(score) for score in scores]
        return explain_rows(index, np.logical_and.reduce(np.broadcast_arrays(np.isnan(index), *explained)))

    def _cause(self, X: Any, rows: NDArray[np.bool_]) -> str:
        return f"none of the {len(self.detectors_)} detectors can evaluate them"


def _mean(indices: list[Array]) -> Array:
    """Mean index of every record, NaN left out; NaN where all are."""
    known = [~np.isnan(index) for index in indices]
    count = np.sum(known, axis=0)
    total = np.sum([np.nan_to_num(index) for index in indices], axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
