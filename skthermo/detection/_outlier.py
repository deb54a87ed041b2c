"""Damage index and alarm by any of scikit-learn's outlier detectors."""

from __future__ import annotations

from datetime import timedelta
from numbers import Integral
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, DensityMixin, clone
from sklearn.neighbors import KernelDensity

from skthermo._core.arrays import Array, as_floats, spread_evenly
from skthermo._core.estimators import HasMethods, Interval, StrOptions
from skthermo._core.frames import column_names
from skthermo._core.text import listed
from skthermo.detection._base import DamageDetector, conformal_threshold
from skthermo.preprocessing.folds import BlockedKFold, Rows, out_of_fold


class OutlierDetector(DamageDetector):
    """Alarm where an outlier detector scores frequencies lower than nearly all of a healthy baseline.

    The damage index is minus the estimator's ``score_samples`` (or the ``decision_function`` of PyOD's detectors, where
    higher is more abnormal).

    Parameters
    ----------
    estimator : outlier detector
        With ``fit`` and ``score_samples``, such as ``IsolationForest()``, ``OneClassSVM()``,
        ``LocalOutlierFactor(novelty=True)`` or ``EllipticEnvelope()``, a pipeline that ends with one, or a detector of
        PyOD. Its own threshold and ``contamination`` are not used.
    contamination : float, default=0.02
        Share of healthy records above the threshold.
    threshold : {"conformal", "quantile"}, default="conformal"
        How the threshold is set:

        - ``"conformal"``: the ceil((n + 1)(1 - contamination))-th smallest of the indices that the n baseline records
          have by clones fitted on others: five more fits, each without a fifth of the blocks of time.
        - ``"quantile"``: the (1 - contamination) quantile of the indices of the records that the estimator was fitted
          on, in one fit. Estimators that score such records better than new ones, as ``LocalOutlierFactor`` does, then
          raise more false alarms than asked for.
    block : int or duration, optional
        Length of the blocks of time of the conformal threshold, as in `~skthermo.preprocessing.BlockedKFold`. By
        default a fiftieth of the records.

    Attributes
    ----------
    estimator_ : outlier detector
        Fitted clone.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline, with the conformal threshold by clones that were not fitted on the record; NaN
        where a mode is missing.
    n_independent_ : float
        Number of independent records that the residuals of the baseline are worth, or its indices where columns are
        frequencies.
    report_ : DataFrame
        As what each column was read, and in how many rows a value was set aside, as `DamageDetector` has it.
    findings_ : list of SkthermoWarning
        What `fit` has warned of.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    See Also
    --------
    MahalanobisDetector : Distance from the mean, for a baseline that is close to normally distributed.

    Notes
    -----
    The scale of the damage index is the estimator's: ``EllipticEnvelope`` gives the *squared* Mahalanobis distance,
    ``IsolationForest`` a number between 0 and 1. Indices of different estimators cannot be compared, but their alarms
    can. The estimator gets relative frequencies. One that measures distances, such as ``OneClassSVM``, gives modes that
    scatter more a larger weight; ``make_pipeline(StandardScaler(), OneClassSVM())`` weights all modes alike.

    Rows with a missing mode are left out of the baseline and cannot be evaluated: their damage index is NaN, and
    ``predict`` gives 0. :doc:`/guide/detectors_theory` says when to set ``block``.

    Examples
    --------
    >>> from sklearn.pipeline import make_pipeline
    >>> from sklearn.preprocessing import StandardScaler
    >>> from sklearn.svm import OneClassSVM
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import OutlierDetector
    >>> healthy = make_truss_campaign(random_state=0).frequencies
    >>> damaged = make_truss_campaign(damage={"bottom": 0.3}, random_state=1).frequencies
    >>> detector = OutlierDetector(make_pipeline(StandardScaler(), OneClassSVM())).fit(healthy)
    >>> float((detector.predict(damaged) == -1).mean())
    1.0
    """

    _parameter_constraints: dict = {
        **DamageDetector._parameter_constraints,
        "estimator": [HasMethods("fit")],
        "threshold": [StrOptions({"conformal", "quantile"})],
        "block": [Interval(Integral, 1, None, closed="left"), str, timedelta, np.timedelta64, None],
    }

    def __init__(
        self,
        estimator: BaseEstimator,
        contamination: float = 0.02,
        *,
        threshold: Literal["conformal", "quantile"] = "conformal",
        block: Any = None,
    ):
        self.estimator = estimator
        self.contamination = contamination
        self.threshold = threshold
        self.block = block

    def _learn(self, F: Array, times: Array) -> Array:
        complete = ~np.isnan(F).any(axis=1)
        if complete.sum() < 2:
            raise ValueError(f"{complete.sum()} of {len(F)} rows have every mode; expected at least 2")
        scores = hasattr(self.estimator, "score_samples") or hasattr(self.estimator, "decision_function")
        self.estimator_ = clone(self.estimator).fit(F[complete]) if scores else None
        if not hasattr(self.estimator_, "score_samples") and not _is_pyod(self.estimator_):
            raise ValueError(
                f"estimator is {self.estimator!r}, which has no score_samples; expected an outlier detector that "
                "scores new records, such as IsolationForest() or LocalOutlierFactor(novelty=True)"
            )
        if self.threshold == "quantile":
            return self._index(F)
        known, index = F[complete], np.full(len(F), np.nan)
        folds = self._folds(times[complete], known)
        index[complete] = out_of_fold(lambda train: lambda test: self._index_from(known[train], known[test]), folds)
        return index

    def _folds(self, times: Array, F: Array) -> Rows | list[tuple[Rows, Rows]]:
        """The fold of each complete row, or training and test rows of each fold."""
        if self.block is None:
            return self._other_blocks(times)
        is_timed = np.ptp(times) > 1e12  # numbers of rows are smaller, and nanoseconds larger
        index = pd.DatetimeIndex(times.astype("datetime64[ns]")) if is_timed else pd.Index(times)
        return BlockedKFold(min(5, len(times)), block=self.block).fold_of(pd.DataFrame(index=index))

    def _limit(self, index: Array) -> float:
        if self.threshold == "quantile":
            return float(np.nanquantile(index, 1 - self.contamination))
        return conformal_threshold(index, self.contamination)

    def _index(self, F: Array) -> Array:
        index, complete = np.full(len(F), np.nan), ~np.isnan(F).any(axis=1)
        if complete.any():
            index[complete] = _index_of(self.estimator_, F[complete])
        return index

    def _has_likelihood(self) -> bool:
        return isinstance(self.estimator, DensityMixin | KernelDensity)

    def _log_densities(self, F: Array) -> Array:
        return -self._index(F)

    def _index_from(self, others: Array, rows: Array) -> Array:
        """Damage index of rows by a clone fitted on others, on the scale that the estimator itself gives those.

        The score of a support vector machine, as an example, grows with the number of records that it was fitted on.
        """
        fitted, some = clone(self.estimator).fit(others), spread_evenly(others, 1000)  # which tell quartiles
        own, ours = (np.quantile(_index_of(one, some), [0.25, 0.5, 0.75]) for one in (fitted, self.estimator_))
        scale = (ours[2] - ours[0]) / (own[2] - own[0]) if own[2] > own[0] else 1.0
        return ours[1] + scale * (_index_of(fitted, rows) - own[1])

    def _cause(self, X: Any, rows: NDArray[np.bool_]) -> str:
        lacking = np.isnan(as_floats(X)[rows]).sum(axis=0)
        modes = [f"{name} in {n}" for name, n in zip(column_names(X, "x"), lacking, strict=True) if n]
        return f"this detector needs every column, and {listed(modes)} of them are missing"


def _index_of(fitted: Any, rows: Array) -> Array:
    """Damage index of complete rows by a fitted outlier detector."""
    return fitted.decision_function(rows) if _is_pyod(fitted) else -fitted.score_samples(rows)


def _is_pyod(estimator: Any) -> bool:
    """Whether a fitted detector scores as PyOD's do: higher is more abnormal."""
    return hasattr(estimator, "decision_scores_")
