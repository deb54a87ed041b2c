"""The whole of detection in one estimator: regression on the weather, regimes, windows, a detector for each regime."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterable, Sequence
from datetime import timedelta
from numbers import Integral, Real
from typing import Any, Literal, Self, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.model_selection import BaseCrossValidator
from sklearn.utils.metaestimators import available_if

from skthermo._core.arrays import Array, as_floats, check_probability, median, robust_deviation
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    Interval,
    StrOptions,
    _fit_context,
    _safe_indexing,
    check_is_fitted,
)
from skthermo._core.frames import first_disorder, frame_like, has_stamps, row_times
from skthermo._core.warnings import collected, warn_each
from skthermo.detection._base import DamageDetector, DamageIndexMixin, labelled_damaged, mean_log_density
from skthermo.detection._compensator import TemperatureCompensator
from skthermo.detection._directional import DirectionalDetector, smallest_amount
from skthermo.detection._outlier import OutlierDetector
from skthermo.exceptions import SkthermoWarning
from skthermo.preprocessing.folds import Rows
from skthermo.residuals.numbers import independent_records
from skthermo.residuals.regimes import change_of_scatter
from skthermo.residuals.windows import Regimes, WindowMeans


def _detector_has(name: str) -> Callable[[CompensatedDetector], bool]:
    """Whether the detector of the regimes has a method."""
    return lambda own: hasattr(own._default_part("detector") if own.detector is None else own.detector, name)


class CompensatedDetector(DamageIndexMixin, Estimator):
    """Alarm where frequencies depart from what the weather explains: regression, regimes, windows and a detector.

    Parameters
    ----------
    detector : detector, optional
        Learns the residuals of the baseline: a `DamageDetector`, or any of scikit-learn's outlier detectors, which
        becomes an `OutlierDetector`. By default `DirectionalDetector`.
    regressor : regressor, optional
        Predicts the targets from all other columns, as in `TemperatureCompensator`. By default
        `~skthermo.surrogate.TemperatureMapper`.
    targets : sequence of str or sequence of int
        Names of the response columns in a frame, or their positions counted from 0.
    window : int or duration, optional
        Residuals are trailing means over that many records or that time, such as "1D". A single record cannot dominate
        a mean: residuals count as no farther from the median than four robust standard deviations, and what more than
        half of the window lies beyond that is added.
    regimes : "auto", None or tuple, default="auto"
        Whether records are divided in two where, at one value of one input, the scatter of residuals changes, as when
        bearings freeze. Each regime has a detector of its own, and means are taken within a regime.

        - ``"auto"``: at the value by which held-out weeks are clearly likelier, if there is one; with a window, only if
          two regimes of the first two thirds of the baseline have at most 4 % false alarms in the last third.
        - ``None``: no division.
        - A tuple of the name or position of an input, and the highest value of the first regime.
    cv : "contiguous", int, cross-validation splitter or iterable, default=None
        Folds by which the baseline is predicted, as in `TemperatureCompensator`.
    window_share : float, default=0.5
        A mean has a value where the window holds at least this share of the values that it usually holds.

    Attributes
    ----------
    compensator_ : TemperatureCompensator
        Fitted: residuals of the targets, ``compensator_.estimator_`` is the regressor.
    regime_ : tuple or None
        The input and its highest value in the first regime; None where records are not divided.
    detectors_ : list of detectors
        The fitted detector of each regime, on residuals or their means.
    shares_ : ndarray of shape (n_regimes,)
        Share of the baseline in each regime.
    scale_ : ndarray of shape (n_targets,)
        Robust standard deviations of the residuals of the baseline, or of their means.
    means_ : object or None
        Trailing means of the residuals; None without a window.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline, each record predicted and evaluated by others.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.
    n_independent_ : float
        Number of independent records that the indices of the baseline are worth.
    lookback_ : int or timedelta64
        How long before a record its window begins.
    report_ : DataFrame
        A row for each target, as `DamageDetector` has it.
    findings_ : list of SkthermoWarning
        What `fit` has warned of.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns, targets included, and, where `fit` saw a frame with such, their names.

    See Also
    --------
    TemperatureCompensator : The residuals alone, for a pipeline of one's own.
    MahalanobisDetector, DirectionalDetector, OutlierDetector : Detectors of residuals.

    Notes
    -----
    The regime's detector gives the damage index. In the second regime it is multiplied by the ratio of both
    thresholds, so that one threshold holds for all records. Records of `fit` are the history of the windows of later
    records. Rows have to be in order of time where a window is asked for.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import CompensatedDetector, DirectionalDetector
    >>> year, damaged = (make_truss_campaign(damage=damage, random_state=0) for damage in (None, {"bottom": 0.05}))
    >>> baseline, later = (campaign.temperatures.join(campaign.frequencies) for campaign in (year, damaged))
    >>> directional = DirectionalDetector(make_truss().damage_directions(kind="stiffness"))
    >>> detector = CompensatedDetector(directional, targets=list(year.frequencies), window=7).fit(baseline)
    >>> print(f"{(detector.score_samples(later) < detector.offset_).mean():.0%}")
    99%
    """

    _parameter_constraints: dict = {
        "detector": [HasMethods(["fit"]), None],
        "regressor": [HasMethods(["fit", "predict"]), None],
        "targets": "no_validation",
        "window": [Interval(Integral, 1, None, closed="left"), str, timedelta, np.timedelta64, None],
        "regimes": [StrOptions({"auto"}), tuple, None],
        "cv": ["cv_object", StrOptions({"contiguous"})],
        "window_share": [Interval(Real, 0, 1, closed="right")],
    }

    def __init__(
        self,
        detector: BaseEstimator | None = None,
        regressor: BaseEstimator | None = None,
        *,
        targets: Sequence[Hashable],
        window: Any = None,
        regimes: Literal["auto"] | tuple[Hashable, float] | None = "auto",
        cv: int | BaseCrossValidator | Iterable | Literal["contiguous"] | None = None,
        window_share: float = 0.5,
    ):
        self.detector = detector
        self.regressor = regressor
        self.targets = targets
        self.window = window
        self.regimes = regimes
        self.cv = cv
        self.window_share = window_share

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: ArrayLike | None = None) -> Self:
        """Learn a healthy baseline.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures in degrees Celsius, or other inputs, and frequencies in Hz of the healthy structure, side by
            side.
        y : array-like of shape (n_samples,), optional
            Labels +1 and -1: what is labelled -1, as damaged, is not learned. Other values are ignored.

        Returns
        -------
        CompensatedDetector
            The fitted detector.

        Raises
        ------
        ValueError
            As `TemperatureCompensator` and the detector; if a window is a time and rows have no stamps, or rows are not
            in order of time.

        Warns
        -----
        UserWarning
            As `TemperatureCompensator` and the detector, once of each kind.
        """
        self.compensator_ = TemperatureCompensator(self.regressor, targets=self.targets, cv=self.cv)
        with collected() as findings:
            residuals = self.compensator_.fit_transform(X, y)
        self.n_features_in_ = self.compensator_.n_features_in_
        if hasattr(self.compensator_, "feature_names_in_"):
            self.feature_names_in_ = self.compensator_.feature_names_in_
        T, R = self.compensator_.inputs(X)[0], as_floats(residuals)
        self.regime_ = self._chosen_regime(X, T, R, np.flatnonzero(~labelled_damaged(y, len(R))))
        regime = self._regimes(T, self.regime_)
        self.means_ = None
        Z = as_frame(X, residuals)
        if self.window is not None:
            self._check_order(X)
            self.means_ = WindowMeans.fitted(Z, regime, self.window, self.window_share)
            Z = frame_like(Z, self.means_(Z, regime, is_baseline=True))
        self.detectors_, self.baseline_index_ = [], np.full(len(R), np.nan)
        for number in range(regime.max() + 1):
            own = regime == number
            with collected() as found:
                self.detectors_.append(self._part().fit(Z[own]))
            findings += found
            self.baseline_index_[own] = self._ratio(number) * self.detectors_[number].baseline_index_
        self.shares_, self.scale_ = np.bincount(regime) / len(regime), robust_deviation(Z.to_numpy())
        self.threshold_, self.report_ = self.detectors_[0].threshold_, self.detectors_[0].report_
        self.offset_ = -self.threshold_
        self.n_independent_ = independent_records(self.baseline_index_[np.argsort(row_times(X), kind="stable")])
        self.findings_ = findings
        warn_each(findings)
        return self

    @overload
    def residuals(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def residuals(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def residuals(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Residuals of records, or their means over the window, as the detector of their regime gets them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_targets)
            Relative, or in the unit of a response that may be zero; NaN where nothing can be evaluated.
        """
        Z, _, findings = self._evaluated(X)
        warn_each(findings)
        return Z if isinstance(X, pd.DataFrame) else Z.to_numpy()

    @available_if(_detector_has("severities"))
    def severities(self, X: ArrayLike, *, kind: Literal["stiffness", "section"] = "stiffness") -> pd.DataFrame:
        """Amounts of the directions by which the test explains each record, as `DirectionalDetector.severities`.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions, as in `DirectionalDetector.pod`.

        Returns
        -------
        DataFrame of shape (n_samples, n_directions)
            NaN where a record, or its window, has no mode.
        """
        options = of_other_kind(kind)
        amounts = self._by_regime(X, lambda detector, Z: detector.severities(Z, **options).to_numpy())
        index = X.index if isinstance(X, pd.DataFrame) else None
        names = self.detectors_[0].directions_.index
        return pd.DataFrame(amounts, index, names[names.str.endswith(", section") == (kind == "section")])

    @available_if(_detector_has("explained"))
    def explained(self, X: ArrayLike, *, kind: Literal["stiffness", "section"] = "stiffness") -> Array:
        """Share of the departure of each record that the directions explain, as `DirectionalDetector.explained`.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies, in the columns of `fit`.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions, as in `DirectionalDetector.pod`.

        Returns
        -------
        ndarray of shape (n_samples,)
            From 0 to 1; NaN where a record, or its window, has no mode.
        """
        options = of_other_kind(kind)
        return self._by_regime(X, lambda detector, Z: detector.explained(Z, **options))

    @available_if(_detector_has("pod"))
    def pod(self, severities: ArrayLike, *, kind: Literal["stiffness", "section"] = "stiffness") -> pd.DataFrame:
        """Probability of detection of records, or of full windows all of whose records have the loss.

        Parameters
        ----------
        severities : array-like of shape (n_severities,)
            Amounts of each direction, as `DirectionalDetector.pod` has them.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions, as in `DirectionalDetector.pod`.

        Returns
        -------
        DataFrame of shape (n_severities, n_directions)
            Share of records above the threshold, in the regimes as often as in the baseline.
        """
        check_is_fitted(self)
        options = of_other_kind(kind)
        rates = (one.pod(severities, **options) for one in self.detectors_)
        return sum(share * rate for share, rate in zip(self.shares_, rates, strict=True))

    @available_if(_detector_has("minimum_detectable_damage"))
    def minimum_detectable_damage(
        self, level: float = 0.9, *, kind: Literal["stiffness", "section"] = "stiffness"
    ) -> pd.Series:
        """Smallest amount of each direction alone that is found in a share of the records or full windows.

        Parameters
        ----------
        level : float, default=0.9
            That share, between 0 and 1.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions, as in `DirectionalDetector.pod`.

        Returns
        -------
        Series of shape (n_directions,)
            As `DirectionalDetector.minimum_detectable_damage`, in the regimes as often as in the baseline.
        """
        check_is_fitted(self)
        level, options = check_probability(level, "level"), of_other_kind(kind)
        alone = [one.minimum_detectable_damage(level, **options) for one in self.detectors_]
        if len(alone) == 1:
            return alone[0]
        highest = pd.concat(alone, axis=1).max(axis=1)
        found = {
            name: smallest_amount(
                lambda sizes, k=name: self.pod(sizes, kind=kind)[k].to_numpy(),
                most if np.isfinite(most) else 1.0,
                level,
            )
            for name, most in highest.items()
        }
        return pd.Series(found, alone[0].index)

    @available_if(_detector_has("score"))
    def score(self, X: ArrayLike, y: None = None) -> float:
        """Mean log-likelihood of the residuals of healthy records that `fit` has not seen, per value.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Temperatures and frequencies of the healthy structure, in the columns of `fit`.
        y : None
            Ignored.

        Returns
        -------
        float
            As `DamageDetector.score`, of residuals or of their means over the window.
        """
        R = self._evaluated(X)[0].to_numpy()
        densities = self._by_regime(X, lambda detector, Z: detector._log_densities(detector._relative(Z)))
        score, findings = mean_log_density(densities, ~np.isnan(R) & ~np.isnan(densities)[:, np.newaxis])
        warn_each(findings)
        return score

    def _index_of(self, X: Any) -> Array:
        def index(detector: Any, Z: pd.DataFrame) -> Array:
            with collected():  # records without an index are counted once, over all regimes
                return -np.asarray(detector.score_samples(Z))

        return self._by_regime(X, index, are_indices=True)

    def _by_regime(self, X: Any, value: Callable[[Any, pd.DataFrame], Array], *, are_indices: bool = False) -> Array:
        """Values that the detector of the regime of each record gives."""
        Z, regime, findings = self._evaluated(X)
        parts = {number: value(self.detectors_[number], Z[regime == number]) for number in np.unique(regime).tolist()}
        values = np.empty((len(Z), *next(iter(parts.values())).shape[1:])) if parts else np.empty(0)
        for number, part in parts.items():
            values[regime == number] = self._ratio(number) * part if are_indices else part
        warn_each(findings)
        return values

    def _evaluated(self, X: Any) -> tuple[pd.DataFrame, Regimes, list[SkthermoWarning]]:
        """Residuals of records or their means, the regime of each record, and findings."""
        check_is_fitted(self)
        residuals, T, findings = self.compensator_.evaluated(X)
        Z, regime = as_frame(X, residuals), self._regimes(T, self.regime_)
        if self.means_ is None:
            return Z, regime, findings
        self._check_order(X)
        return frame_like(Z, self.means_(Z, regime)), regime, findings

    def _ratio(self, number: int) -> float:
        """Threshold of the first regime's detector over the threshold of another regime's."""
        return self.detectors_[0].threshold_ / self.detectors_[number].threshold_

    def _chosen_regime(self, X: Any, T: Any, R: Array, healthy: Rows) -> tuple[Any, float] | None:
        """The input, by name or position, and the value at which records are divided."""
        names = self._input_names(T)
        if isinstance(self.regimes, tuple):
            if len(self.regimes) != 2 or self.regimes[0] not in names or not isinstance(self.regimes[1], Real):
                raise ValueError(f"regimes is {self.regimes!r}; expected an input among {names}, and a value")
            return self.regimes[0], float(self.regimes[1])
        if self.regimes is None:
            return None
        far = np.abs(R - median(R)) > 8 * robust_deviation(R)
        found = change_of_scatter(as_floats(T), np.where(far, np.nan, R), self.compensator_.folds_)
        if found is None:
            return None
        regime = names[found[0]], found[1]
        healthy_X, healthy_T = (_safe_indexing(table, healthy) for table in (X, T))
        return regime if self.window is None or self._holds_later(healthy_X, healthy_T, *regime) else None

    def _holds_later(
        self, X: Any, T: Any, name: Any, value: float, *, most: float = 0.04, least_rows: int = 40
    ) -> bool:
        """Whether two regimes of the first two thirds have few false alarms in the last third.

        Means over a window scatter so little that a slow change counts as damage in the narrower regime.
        """
        n_first = 2 * len(T) // 3
        if np.bincount(self._regimes(T, (name, value))[:n_first], minlength=2).min() < least_rows:
            return False
        with collected():
            earlier = clone(self).set_params(regimes=(name, value), cv=None).fit(X[:n_first])
            return bool(np.mean(earlier.predict(X[n_first:]) == -1) <= most)

    def _input_names(self, T: Any) -> list[Any]:
        """Names of the inputs, or their positions where `fit` saw no names."""
        names = getattr(self, "feature_names_in_", None)
        return list(range(T.shape[1])) if names is None else list(np.delete(names, self.compensator_.targets_))

    def _regimes(self, T: Any, regime: tuple[Any, float] | None) -> Regimes:
        """The number of the regime of each record: 0 up to the value, 1 above; a missing input counts as above."""
        if regime is None:
            return np.zeros(len(T), dtype=np.intp)
        name, value = regime
        return (~(as_floats(T)[:, self._input_names(T).index(name)] <= value)).astype(np.intp)

    def _check_order(self, X: Any) -> None:
        """Refuse records whose windows are not defined."""
        if not isinstance(self.window, Integral) and not has_stamps(X):
            raise ValueError(
                f"window is {self.window!r}, a time, but the records are not a frame with a stamp for each; expected a "
                "DatetimeIndex, or a number of records as the window"
            )
        row = first_disorder(X)
        if row:
            raise ValueError(
                f"row {row} ({X.index[row]}) is earlier than the row before it; expected records in order of time, as "
                "X.sort_index() gives"
            )

    def _cause(self, X: Any, rows: NDArray[np.bool_]) -> str:
        if self.window is None:
            return super()._cause(X, rows)
        own = "" if self.regime_ is None else " in their own regime (regime_)"
        return f"windows hold too few records with a value{own}; the first rows of a call need the records before them"

    def _part(self) -> DamageDetector:
        """A new detector of a regime."""
        part = self._default_part("detector") if self.detector is None else clone(self.detector)
        return part if isinstance(part, DamageDetector) else OutlierDetector(part)

    def _default_part(self, name: str) -> BaseEstimator | None:
        if name == "regressor":
            return TemperatureCompensator(targets=self.targets)._default_part("estimator")
        return DirectionalDetector() if name == "detector" else None


def of_other_kind(kind: str) -> dict[str, str]:
    """The argument for a kind of loss; none for stiffness, since a detector of your own may have no kinds."""
    return {} if kind == "stiffness" else {"kind": kind}


def as_frame(X: Any, values: Any) -> pd.DataFrame:
    """Values of records as a frame on their index."""
    index = X.index if isinstance(X, pd.DataFrame) else None
    return values if isinstance(values, pd.DataFrame) else pd.DataFrame(values, index)
