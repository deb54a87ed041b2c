"""The part that all damage detectors share: how columns are read, threshold, scores and alarms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from numbers import Real
from typing import Any, Self, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import maximum_filter1d
from sklearn.base import OutlierMixin
from sklearn.utils.metaestimators import available_if

from skthermo._core.arrays import NORMAL, Array, spread_evenly
from skthermo._core.estimators import Estimator, Interval, _fit_context, check_is_fitted, validate_data
from skthermo._core.frames import row_times
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import warn_each
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, SkthermoWarning, UnevaluatedRowsWarning
from skthermo.preprocessing.checks import stuck_runs
from skthermo.preprocessing.folds import Rows
from skthermo.residuals.numbers import independent_records


class DamageIndexMixin(SavesFrames, OutlierMixin):
    """Alarms of a detector that has a threshold, from the damage index that ``_index_of(X)`` gives each record."""

    offset_: float

    @abstractmethod
    def _index_of(self, X: Any) -> Array:
        """Damage index of records; higher is more damaged, NaN where there is none."""

    def _cause(self, X: Any, rows: NDArray[np.bool_]) -> str:
        """Hook: why some rows have no damage index."""
        return "no column has a value there, or an input of a step before is missing"

    @overload
    def damage_index(self, X: pd.DataFrame) -> pd.Series: ...
    @overload
    def damage_index(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def damage_index(self, X: ArrayLike) -> NDArray[np.float64] | pd.Series:
        """Damage index of every record: higher is more damaged.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            In the columns and units of `fit`.

        Returns
        -------
        ndarray or Series of shape (n_samples,)
            Dimensionless; NaN where nothing can be evaluated. A frame gives a series on its index.

        Warns
        -----
        UserWarning
            If no record at all can be evaluated.
        """
        index = self._index_of(X)
        unknown = np.isnan(index)
        warn_each(self._not_evaluated(X, unknown) if unknown.all() else ())
        return pd.Series(index, X.index, name="damage_index") if isinstance(X, pd.DataFrame) else index

    def score_samples(self, X: ArrayLike) -> NDArray[np.float64]:
        """Negative damage index: higher is healthier.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            In the columns and units of `fit`.

        Returns
        -------
        ndarray of shape (n_samples,)
            NaN where there is no damage index.
        """
        return -np.asarray(self.damage_index(X))

    def decision_function(self, X: ArrayLike) -> NDArray[np.float64]:
        """Threshold minus damage index: negative is an alarm.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            In the columns and units of `fit`.

        Returns
        -------
        ndarray of shape (n_samples,)
            NaN where there is no damage index.
        """
        return self.score_samples(X) - self.offset_

    def predict(self, X: ArrayLike) -> NDArray[np.int64]:
        """Whether each record raises an alarm: +1 healthy, -1 alarm, 0 not evaluated.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            In the columns and units of `fit`.

        Returns
        -------
        ndarray of shape (n_samples,)
            -1 where the damage index exceeds the threshold, +1 where it does not, and 0 where there is none.

        Warns
        -----
        UserWarning
            If some rows cannot be evaluated, with the first of them and the cause.
        """
        check_is_fitted(self)
        decision = -self._index_of(X) - self.offset_
        unknown = np.isnan(decision)
        warn_each(self._not_evaluated(X, unknown))
        return np.where(unknown, 0, np.where(decision < 0, -1, 1))

    def _not_evaluated(self, X: Any, rows: NDArray[np.bool_]) -> list[SkthermoWarning]:
        if not rows.any():
            return []
        first = int(rows.argmax())
        stamp = f" ({X.index[first]})" if isinstance(X, pd.DataFrame) else ""
        return [
            UnevaluatedRowsWarning(
                f"{rows.sum()} of {len(rows)} rows are not evaluated (predict gives 0), the first row {first}{stamp}: "
                f"{self._cause(X, rows)}",
                "not-evaluated",
            )
        ]


class DamageDetector(DamageIndexMixin, Estimator, ABC):
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
    n_independent_ : float
        Number of independent records that the residuals of the baseline are worth, or its indices where columns are
        frequencies.
    report_ : DataFrame
        A row for each column: as what it was read (``read_as``, "frequency" or "residual"), what it was divided by
        (``level``), and in how many rows a value was set aside (``n_set_aside``).
    findings_ : list of SkthermoWarning
        What `fit` has warned of.

    Notes
    -----
    Columns are frequencies or residuals. A column whose values are positive, with a standard deviation below a third of
    their mean, is read as a frequency, and is divided by its mean; the methods above get relative frequencies and
    residuals as they are. Frequencies that a scaler has standardised are read as residuals: their seasons count as
    noise that lasts, and the threshold is high. `fit` sets aside, as if they were missing, frequencies that are farther
    from the median than half of it, residuals that are farther than a hundred robust standard deviations, infinite
    values, and those of a sensor that is stuck.

    ``_cause(X, rows)`` says why rows have no index. A detector that learns a distribution has ``_has_likelihood()``
    True and ``_log_densities(F)``, and with them a ``score``. A detector, or a step before it, that looks at earlier
    records says how far by ``lookback_``: a number of rows, or a time.

    Examples
    --------
    >>> import numpy as np
    >>> from sklearn.linear_model import LinearRegression
    >>> from sklearn.pipeline import make_pipeline
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.detection import DamageDetector, TemperatureCompensator
    >>> class LargestDeviation(DamageDetector):
    ...     def _learn(self, F, times):
    ...         self.mean_, self.std_ = np.nanmean(F, axis=0), np.nanstd(F, axis=0)
    ...         return self._index(F)
    ...     def _limit(self, index):
    ...         return np.quantile(index, 1 - self.contamination)
    ...     def _index(self, F):
    ...         return np.fmax.reduce(np.abs(F - self.mean_) / self.std_, axis=1)
    >>> year = make_truss_campaign(random_state=0)
    >>> baseline = year.temperatures.join(year.frequencies)
    >>> residuals = TemperatureCompensator(LinearRegression(), targets=list(year.frequencies))
    >>> detector = make_pipeline(residuals, LargestDeviation()).fit(baseline)
    >>> print(f"{(detector.predict(baseline) == -1).mean():.0%} alarms")
    2% alarms
    """

    _parameter_constraints: dict = {"contamination": [Interval(Real, 0, 0.5, closed="right")]}

    def __init__(self, contamination: float = 0.02):
        self.contamination = contamination

    @abstractmethod
    def _learn(self, F: Array, times: Array) -> Array:
        """Fit on a baseline at some times; return the damage index that sets the threshold."""

    @abstractmethod
    def _limit(self, index: Array) -> float:
        """The threshold, from the baseline's damage index."""

    @abstractmethod
    def _index(self, F: Array) -> Array:
        """Damage index of rows; higher is more damaged, NaN where there is none."""

    def _has_likelihood(self) -> bool:
        """Hook: whether the detector has learned a distribution."""
        return False

    def _log_densities(self, F: Array) -> Array:
        """Hook: logarithm of the density of each row in the modes that it has; NaN where it has none."""
        raise NotImplementedError

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> Self:
        """Learn a healthy baseline and set the threshold.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz, or residuals; NaN where a mode is missing.
        y : array-like of shape (n_samples,), optional
            Labels +1 and -1: what is labelled -1, as damaged, is not learned. Other values are ignored.

        Returns
        -------
        object
            The fitted detector.

        Raises
        ------
        ValueError
            If a column has no value or is constant, or there are fewer than two rows; or if the detector cannot learn
            from the baseline.

        Warns
        -----
        UserWarning
            If values were set aside, or the baseline has too few independent records for the rate of false alarms.
        """
        F = validate_data(self, X, ensure_min_samples=2, allow_infinite=True)
        F = np.where(labelled_damaged(y, len(F))[:, np.newaxis], np.nan, F)
        times = row_times(X)
        self.findings_: list[SkthermoWarning] = []
        order, names = np.argsort(times, kind="stable"), getattr(X, "columns", range(F.shape[1]))
        F, self.report_ = read_columns(F, order, names, self.findings_)
        are_residuals = (self.report_["read_as"] == "residual").to_numpy()
        residuals = F[np.ix_(order, are_residuals)]
        self.n_independent_ = independent_records(residuals) if are_residuals.any() else float(len(F))
        self.baseline_index_ = self._learn(F, times)
        self.threshold_ = self._limit(self.baseline_index_)
        self.offset_ = -self.threshold_
        if not are_residuals.any():  # the seasons of frequencies come again
            self.n_independent_ = independent_records(self.baseline_index_[order])
        # the parts tell the number within a factor of three
        if min(3 * self.n_independent_, len(F)) < 1 / self.contamination - 1:
            self.findings_.append(
                FewRecordsWarning(
                    "the baseline, or one of its regimes (detectors_), has far too few independent records "
                    f"(n_independent_) for a false-alarm rate of {self.contamination:.2g}, which "
                    f"{np.ceil(1 / self.contamination - 1):.0f} or more tell. Later records may raise several times as "
                    "many alarms, or none. Give a longer baseline, a higher contamination, and frequencies in Hz: "
                    "standardised ones are read as residuals, which have no seasons",
                    "few-records",
                )
            )
        warn_each(self.findings_)
        return self

    def _other_blocks(self, times: Array) -> list[tuple[Rows, Rows]]:
        """Training and test rows of five folds, or of up to twenty of few rows: blocks of time dealt in turn.

        There are fifty blocks, so that each fold has all seasons; of residuals, which have none, as many as they are
        worth fours of independent rows, but at least five. Rows beside a block that remember it train nothing.
        """
        n_rows, order = len(times), np.argsort(times, kind="stable")
        number = min(self.n_independent_, n_rows)
        n_blocks = np.clip(number / 4, 5, 50)
        remembered = max(min(int(n_rows / number), n_rows // 6) - 1, 0)
        folds = np.arange(n_rows) // max(int(n_rows / n_blocks), 1) % (5 if n_rows > 100 else min(n_rows, 20))
        splits = []
        for fold in np.unique(folds):
            beside = maximum_filter1d((folds == fold).astype(np.uint8), 2 * remembered + 1)
            splits.append((order[beside == 0], order[folds == fold]))
        return splits

    def _relative(self, X: ArrayLike) -> Array:
        """Rows of X as `fit` read them: frequencies divided by their level, residuals as they are."""
        check_is_fitted(self)
        return validate_data(self, X, reset=False) / self.report_["level"].to_numpy()

    def _index_of(self, X: Any) -> Array:
        return self._index(self._relative(X))

    @available_if(lambda detector: detector._has_likelihood())
    def score(self, X: ArrayLike, y: None = None) -> float:
        """Mean log-likelihood of healthy records that `fit` has not seen, per value.

        A `MahalanobisDetector` has this method, and an `OutlierDetector` of a density, such as ``GaussianMixture()`` or
        ``KernelDensity()``. The score depends neither on ``contamination`` nor on ``threshold``.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Of the healthy structure, in the columns and units of `fit`.
        y : None
            Ignored.

        Returns
        -------
        float
            Natural logarithm of a density of relative frequencies or of residuals, averaged over the values that are
            there: higher is better. NaN if no row has a value; a warning says so if fewer than half of them have.
        """
        F = self._relative(X)
        densities = self._log_densities(F)
        score, findings = mean_log_density(densities, ~np.isnan(F) & ~np.isnan(densities)[:, np.newaxis])
        warn_each(findings)
        return score


def labelled_damaged(y: Any, n_rows: int) -> NDArray[np.bool_]:
    """Which rows labels of +1 and -1 tell as damaged; none without such labels."""
    labels = np.ones(n_rows) if y is None else np.asarray(y)
    if labels.shape != (n_rows,) or not np.isin(labels, (-1, 1)).all():
        return np.zeros(n_rows, dtype=bool)
    if (labels == -1).all():
        raise ValueError(f"y labels all {n_rows} rows as damaged (-1); expected healthy rows (+1) to learn from")
    return labels == -1


def read_columns(F: Array, order: Rows, names: Any, findings: list[SkthermoWarning]) -> tuple[Array, pd.DataFrame]:
    """A baseline as detectors learn it, and how each column was read; what was set aside is added to the findings.

    ``order`` are the rows in order of time.
    """
    read = [read_column(values, order, name) for values, name in zip(F.T, names, strict=True)]
    table = pd.DataFrame([row for row, _ in read], index=pd.Index(names))
    far = np.column_stack([rows for _, rows in read])
    if far.any():
        F = np.where(far, np.nan, F)
        findings.append(
            RecordsWarning(
                f"values of {', '.join(map(repr, table.index[far.any(axis=0)]))} are far from all others there, or "
                "repeat one for long. They count as missing (report_ has their number). Put NaN where a value is "
                "missing",
                "set-aside",
            )
        )
    return F / table["level"].to_numpy(), table


def read_column(values: Array, order: Rows, name: Any) -> tuple[dict[str, Any], NDArray[np.bool_]]:
    """As what a column was read, and which of its values are far from all others, or of a sensor that is stuck."""
    is_stuck = np.zeros(len(values), dtype=bool)
    for rows in stuck_runs(values[order]):
        is_stuck[order[rows]] = True
    known = values[np.isfinite(values) & ~is_stuck]
    if not len(known):
        raise ValueError(f"column {name!r} has no value in {len(values)} rows; expected some in each")
    if known.min() == known.max():
        raise ValueError(f"column {name!r} has a single value; expected values that vary")
    some = spread_evenly(known, 10_000)  # which tell enough
    middle = np.median(some)
    scatter = NORMAL * np.median(np.abs(some - middle))
    is_frequency = middle > 0 and scatter < middle / 3
    farthest = middle / 2 if is_frequency else 100 * scatter or np.inf
    far = np.abs(values - middle) > farthest
    far |= np.isinf(values) | is_stuck
    if far.any():
        known = known[np.abs(known - middle) <= farthest]
    mean = known.mean()
    is_frequency = is_frequency and known.min() > 0 and known.std() < mean / 3
    kind, level = ("frequency", mean) if is_frequency else ("residual", 1.0)
    return {"read_as": kind, "level": level, "n_set_aside": int(far.sum())}, far


def conformal_threshold(index: Array, contamination: float) -> float:
    """The ceil((n + 1)(1 - contamination))-th smallest of n indices, which a new one exceeds with that probability.

    Each index comes from a detector that has not learned its record; NaN is left out.
    """
    known = index[~np.isnan(index)]
    rank = min(int(np.ceil((len(known) + 1) * (1 - contamination) - 1e-9)), len(known)) - 1
    threshold = float(np.partition(known, rank)[rank]) if len(known) else np.inf
    if threshold == np.inf:
        raise ValueError(
            f"{len(known)} baseline rows are too few for their number of modes: without a fifth of them, the others "
            "do not determine the covariance; expected more rows"
        )
    return threshold


def mean_log_density(densities: Array, present: NDArray[np.bool_]) -> tuple[float, list[SkthermoWarning]]:
    """Mean over the values that are there of the density of rows, and a finding where most rows have none."""
    known = present.any(axis=1)
    findings: list[SkthermoWarning] = []
    if 2 * known.sum() < len(known):
        text = (
            "more than half of the rows have no score: a value is missing there. Compare scores of the same rows only"
        )
        findings.append(UnevaluatedRowsWarning(text, "not-evaluated"))
    return float(densities[known].sum() / present.sum()) if known.any() else float("nan"), findings
