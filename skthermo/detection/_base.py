"""The part that all damage detectors share: threshold, scores and alarms, and where their columns come from."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from numbers import Real
from typing import Any, Self, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import OutlierMixin
from sklearn.utils.metaestimators import available_if

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import Estimator, Interval, _fit_context, check_is_fitted
from skthermo._core.frames import Table, frame_like, row_times
from skthermo._core.origins import origin_of
from skthermo._core.warnings import explain_rows, explained_rows, warn_each, warn_user
from skthermo.exceptions import FewRecordsWarning, UnevaluatedRowsWarning
from skthermo.preprocessing import set_aside

OF_ORDER = {"repeated-stamps", "unsorted-stamps"}  # which only what looks at earlier records depends on
FEWEST_INDEPENDENT = 50  # baseline records, from which one baseline's rate of false alarms is close to the mean
FAR_ABOVE = 2.5  # times as far from the median of a baseline's own indices as their quantile is


class DamageDetector(OutlierMixin, Estimator, ABC):
    """Base of detectors that learn a healthy baseline and give every record a damage index.

    It reads tables, gives alarms and keeps to scikit-learn's rules. A detector of one's own has three methods:
    ``_learn(F, times)`` fits to the baseline, NaN where a mode is missing, and returns the damage index that sets the
    threshold; ``_limit(index)`` is that threshold; ``_index(F)`` is the index of any rows, NaN where there is none.

    Parameters
    ----------
    contamination : float, default=0.02
        Share of healthy records above the threshold.

    Attributes
    ----------
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline, as ``_learn`` returns it.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.

    Notes
    -----
    A detector, or a step before it, that looks at earlier records says how far by ``lookback_``: a number of rows, or a
    time, as `WindowedAlarm` and `~skthermo.preprocessing.LagFeatures` have it. `~skthermo.monitoring.Monitor` keeps
    that many records; those of steps in a row add up. ``_cause(X, rows)`` says why rows have no index. A detector that
    learns a distribution has ``_has_likelihood()`` True and ``_log_densities(F)``, and with them a ``score``.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import DamageDetector
    >>> class LargestDeviation(DamageDetector):
    ...     def _learn(self, F, times):
    ...         self.mean_, self.std_ = np.nanmean(F, axis=0), np.nanstd(F, axis=0)
    ...         return self._index(F)
    ...     def _limit(self, index):
    ...         return np.quantile(index, 1 - self.contamination)
    ...     def _index(self, F):
    ...         return np.fmax.reduce(np.abs(F - self.mean_) / self.std_, axis=1)
    >>> year = make_truss_campaign(random_state=0)
    >>> detector = LargestDeviation().fit(year.frequencies)
    >>> print(f"{(detector.predict(year.frequencies) == -1).mean():.0%} alarms")
    2% alarms
    """

    _parameter_constraints: dict = {"contamination": [Interval(Real, 0, 0.5, closed="right")]}
    _seen_at: Callable[[float], str] | None = None
    """Hook: text that says which shift has a threshold as its damage index; with it, `fit` checks its threshold."""

    def __init__(self, contamination: float = 0.02):
        self.contamination = contamination

    def _measurements(self, F: Table) -> Array:
        """Hook: a baseline without values that cannot be, with warnings; what is meaningless is refused."""
        found = set_aside(frequencies=F, unit=f"(the input of {type(self).__name__})", needs_all=True)
        warn_each(found.others.warnings(exclude=OF_ORDER))
        return as_floats(found.frequencies)

    def _records(self, X: Any, F: Array, is_baseline: bool = False) -> Any:
        """Hook: preprocess validated rows, also those of a baseline before `_learn` sees them."""
        return F

    @abstractmethod
    def _learn(self, F: Any, times: Array) -> Array:
        """Fit on records at some times; return calibration scores."""

    @abstractmethod
    def _limit(self, index: Array) -> float:
        """The threshold, from the baseline's damage index."""

    @abstractmethod
    def _index(self, F: Any) -> Array:
        """Damage index of rows; higher is more damaged, NaN where there is none."""

    def _cause(self, X: Any, rows: NDArray[np.bool_]) -> str:
        """Why some rows have no damage index."""
        return "no column has a value there, or what the steps before need for it is missing"

    def _has_likelihood(self) -> bool:
        """Whether the detector has learned a distribution: `_log_densities` gives the logarithm of that of each row."""
        return False

    def _log_densities(self, F: Array) -> Array:
        """Hook: logarithm of the density of each row in the modes that it has; NaN where it has none."""
        raise NotImplementedError

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: None = None) -> Self:
        """Learn a healthy baseline and set the threshold.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz, or residuals; NaN where a mode is missing.
        y : None
            Ignored.

        Returns
        -------
        object
            The fitted detector.

        Raises
        ------
        ValueError
            If the baseline has gross errors, all of which are listed, such as numbers that stand for a missing value,
            infinite values, columns that are constant or missing, or fewer than two rows with a value; or the detector
            cannot learn from it.

        Warns
        -----
        UserWarning
            If there are implausible values far from the others, equal columns, or columns with few different values;
            if there are too few records for the rate of false alarms that is asked for; if the threshold is far above
            the indices that the fitted detector gives the baseline, with the shift that it still sees.
        """
        F = self._validated(X, reset=True, order="C", ensure_min_samples=2, allow_infinite=True)
        records = self._records(X, self._measurements(frame_like(X, F)), is_baseline=True)
        self.baseline_index_ = self._learn(records, row_times(X))
        self.threshold_ = self._limit(self.baseline_index_)
        self.offset_ = -self.threshold_
        if self._seen_at is not None:
            self._warn_of_blindness(self._index(records))
        return self

    @overload
    def damage_index(self, X: pd.DataFrame) -> pd.Series: ...
    @overload
    def damage_index(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def damage_index(self, X: ArrayLike) -> NDArray[np.float64] | pd.Series:
        """Damage index of every record: higher is more damaged.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray or Series of shape (n_samples,)
            Dimensionless; NaN where nothing can be evaluated. A frame gives a series on its index.

        Warns
        -----
        UserWarning
            If no record at all can be evaluated.
        """
        check_is_fitted(self)
        F = self._validated(X, reset=False, order="C")
        index = self._index(self._records(X, F))
        explained = explained_rows(X) | explained_rows(index)
        unexplained = np.isnan(index) & ~explained
        if np.isnan(index).all() and unexplained.any():
            self._warn_of_not_evaluated(X, unexplained)
        if isinstance(X, pd.DataFrame):
            return explain_rows(pd.Series(index, index=X.index, name="damage_index"), explained)
        return explain_rows(index, explained)

    def score_samples(self, X: ArrayLike) -> NDArray[np.float64]:
        """Negative damage index: higher is healthier.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray of shape (n_samples,)
            NaN where there is no damage index.
        """
        index = self.damage_index(X)
        return explain_rows(-np.asarray(index), explained_rows(index))

    def decision_function(self, X: ArrayLike) -> NDArray[np.float64]:
        """Threshold minus damage index: negative is an alarm.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray of shape (n_samples,)
            NaN where there is no damage index.
        """
        scores = self.score_samples(X)
        return explain_rows(scores - self.offset_, explained_rows(scores))

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """Whether each record raises an alarm: +1 healthy, -1 alarm, 0 not evaluated.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray of shape (n_samples,)
            -1 where the damage index exceeds the threshold, +1 where it does not, and 0 where there is none.

        Warns
        -----
        UserWarning
            If some rows cannot be evaluated: how many, the first of them, and what they lack. Rows of which a
            `TemperatureCompensator` before has said so are not counted again.
        """
        decision = self.decision_function(X)
        unknown = np.isnan(decision)
        unexplained = unknown & ~explained_rows(decision)
        if unexplained.any() and not unknown.all():  # where all are, `damage_index` has said so
            self._warn_of_not_evaluated(X, unexplained)
        return np.where(unknown, 0, np.where(decision < 0, -1, 1))

    @available_if(lambda detector: detector._has_likelihood())
    def score(self, X: ArrayLike, y: None = None) -> float:
        """Mean log-likelihood of healthy records that `fit` has not seen, per value.

        A `MahalanobisDetector` has this method, and an `OutlierDetector` of a density, such as ``GaussianMixture()`` or
        ``KernelDensity()``. The score depends neither on ``contamination`` nor on ``threshold``.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz, or residuals, of the healthy structure.
        y : None
            Ignored.

        Returns
        -------
        float
            Natural logarithm of a density per unit of X, averaged over the values that are there: higher is better.
            Behind a `TemperatureCompensator`, the density is per Hz of the measured frequencies, whatever ``whiten``
            is, so that all its settings can be compared. NaN if no row has a value; a warning counts the rows scored if
            they are fewer than half.
        """
        check_is_fitted(self)
        F = self._validated(X, reset=False, order="C")
        origin = origin_of(X)
        densities = self._log_densities(F) + (0.0 if origin is None else origin.log_volumes())
        return mean_log_density(densities, ~np.isnan(F) & ~np.isnan(densities)[:, np.newaxis])

    def _warn_of_blindness(self, own: Array) -> None:
        """Warn if the threshold is far above the indices that the detector gives its own baseline."""
        own = own[~np.isnan(own)]
        if not own.size:
            return
        middle, suggested = np.quantile(own, [0.5, 1 - self.contamination])
        if self.threshold_ - middle > FAR_ABOVE * (suggested - middle):
            warn_user(
                f"the threshold is {self.threshold_:.3g}. It is more than {FAR_ABOVE:g} times as far from the median "
                f"of the baseline's own indices as {suggested:.3g}, which {self.contamination:.2g} of them exceed. The "
                "baseline has few records, records that depend on each other, or outliers"
                f"{self._seen_at(self.threshold_)}. Give a longer baseline, or one without outliers; "
                "threshold='quantile' takes the lower value, with more false alarms",
                FewRecordsWarning,
                "high-threshold",
            )

    def _warn_of_not_evaluated(self, X: Any, rows: NDArray[np.bool_]) -> None:
        first = int(rows.argmax())
        stamp = f" ({X.index[first]})" if isinstance(X, pd.DataFrame) else ""
        warn_user(
            f"{rows.sum()} of {len(rows)} rows are not evaluated (predict gives 0), the first row {first}{stamp}: "
            f"{self._cause(X, rows)}",
            UnevaluatedRowsWarning,
            "not-evaluated",
        )


def conformal_threshold(
    index: Array, contamination: float, share: float = 1.0, what: str = "records", n_independent: float | None = None
) -> float:
    """The ceil((n + 1)(1 - contamination))-th smallest index, which a new one exceeds with that probability at most.

    Each index comes from a detector that was not fitted on its record; NaN is left out. ``share`` is the number of
    independent records for each record by which the rank is chosen, where they depend on their neighbours in time;
    ``n_independent`` the number of which warnings speak (by default that of the rank).
    """
    ordered = np.sort(index[~np.isnan(index)])
    n_independent = share * len(ordered) if n_independent is None else n_independent
    rank = int(np.ceil((len(ordered) + 1 / share) * (1 - contamination) - 1e-9))
    threshold = float(ordered[min(rank, len(ordered)) - 1])
    if threshold == np.inf:
        raise ValueError(
            f"{len(ordered)} baseline rows are too few for their number of modes: some single row decides alone "
            "about a direction; expected more rows"
        )
    if rank > len(ordered):
        warn_user(
            f"{np.floor(n_independent):.0f} independent baseline {what} are too few for a false-alarm rate of "
            f"{contamination:.2g} (expected {np.ceil(1 / contamination - 1):.0f} or more). The threshold is the "
            f"largest index, which later {what} exceed at a rate of about {1 / (n_independent + 1):.2g}. Give a longer "
            "baseline, or a higher contamination",
            FewRecordsWarning,
            "few-baseline-records",
        )
    elif n_independent < min(FEWEST_INDEPENDENT, share * len(ordered)):
        warn_user(
            f"the {len(ordered)} baseline {what} depend on each other in time and count as {n_independent:.0f} "
            f"independent ones (expected {FEWEST_INDEPENDENT} or more). On average over such baselines, false alarms "
            f"are {contamination:.2g} of the records; after this one, they may be several times as many. Give a longer "
            "baseline, or a regression whose residuals depend less on each other",
            FewRecordsWarning,
            "few-baseline-records",
        )
    return threshold


def mean_log_density(densities: Array, present: NDArray[np.bool_]) -> float:
    """Mean over the values that are there, from the logarithm of the density of each row; NaN without any value.

    A warning says so where most rows have none.
    """
    known = present.any(axis=1)
    if 2 * known.sum() < len(known):
        warn_user(
            f"the score is of {known.sum()} of {len(known)} rows: the others have no value. Compare scores of the same "
            "rows only",
            UnevaluatedRowsWarning,
            "rows-not-scored",
        )
    return float(densities[known].sum() / present.sum()) if known.any() else float("nan")
