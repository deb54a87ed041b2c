"""Damage index and alarm by the directions in which damage moves frequencies, and which damage they find."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from numbers import Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone

from skthermo._core.arrays import Array, as_floats, check_probability, is_model, means_of_known, patterns, real_array
from skthermo._core.estimators import Interval, StrOptions, check_is_fitted
from skthermo._core.origins import Changes, origin_of
from skthermo.detection._mahalanobis import ROWS_AT_ONCE, MahalanobisDetector, PatternScale, as_if_complete
from skthermo.residuals.cones import project_on_cones
from skthermo.residuals.gaussian import precisions, whitenings

UNCORRELATED = 1e-8  # correlation below which all columns of a baseline are components, not frequencies
FAR_OFF = 2.0  # factor between means of columns and a model's frequencies, beyond which they are no frequencies
ALIKE = 0.95  # cosine of the effects of two groups from which they cannot be distinguished
N_DRAWS = 2000  # normal records, by which rates of detection are estimated
N_DRAWS_OF_PATTERN = 400  # by which the mean squared length of projections is
TAIL, FEWEST_IN_TAIL = 0.1, 20  # share of the baseline that shows how rare large indices are, and least number of it
BEYOND = 5.0  # standard deviations above the threshold at which every record is found
STEPS = np.linspace(0.0, 1.0, 21)  # shares of the largest amount that are tried


@dataclass(frozen=True)
class Records:
    """Rows of values, and what relative changes of the frequencies make of them."""

    values: Array
    changes: Changes

    def of(self, rows: Any) -> Records:
        return Records(self.values[rows], self.changes.of(rows))


class DirectionalDetector(MahalanobisDetector):
    """Alarm where frequencies, or their residuals, have moved in the directions in which damage moves them.

    The one-sided likelihood-ratio test against the cone of all non-negative combinations of the directions [Kud63]_,
    [Per69]_. The damage index is the length of the projection of a whitened record on that cone, in standard
    deviations, or an *unsquared* Mahalanobis distance (omnibus), expressed as the length that is exceeded so much more
    often that the distance gives its share of the false alarms.

    Parameters
    ----------
    directions : "softening", FE model, fitted chain, DataFrame or array, default="softening"
        Relative changes of the frequencies:

        - ``"softening"``: each frequency can only fall.
        - An FE model, or a fitted `~skthermo.surrogate.DataInformedFEM`: those by a loss of stiffness of each of its
          damage groups.
        - (n_directions, n_modes): relative changes by one unit of each direction, in any unit. The columns of a frame
          are matched by name where both have names, and its index names the directions.
    contamination : float, default=0.02
        Share of healthy records above the threshold.
    omnibus : float, default=0.2
        Share of the false alarms that goes to the Mahalanobis distance, for what lies outside the cone, such as a
        gain of stiffness: from 0 (none of it) to 1 (nothing else).
    covariance : covariance estimator, optional
        As in `MahalanobisDetector`.
    threshold : {"conformal", "quantile"}, default="conformal"
        As in `MahalanobisDetector`. With the conformal one, the index of the cone grows
        for each baseline record by the factor by which its distance from the others exceeds that from all.

    Attributes
    ----------
    directions_ : DataFrame of shape (n_directions, n_modes)
        Relative changes of the frequencies, by name of the direction and of the mode.
    indistinguishable_ : list of tuple of str
        Pairs of directions that move the frequencies alike, with a cosine of more than 0.95 in standard deviations: an
        alarm by one may be by the other.
    sensitivities_ : Series of shape (n_directions,)
        By how many standard deviations one unit of each direction moves a record that has all modes.
    covariance_ : estimator
        Fitted: mean (``location_``) and covariance of the baseline.
    tests_ : object
        How the cone's index and the Mahalanobis distance are joined.
    pattern_scale_, cone_scale_ : object
        Factors for patterns of missing modes, of the Mahalanobis distance and of the cone's index.
    levels_ : ndarray of shape (n_columns,)
        Mean frequencies, or ones; only where no step before says what it has made of frequencies.
    typical_changes_ : ndarray of shape (n_columns, n_modes)
        What relative changes of the frequencies make of the columns, on average over the baseline.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline; with the conformal threshold, by other records.
    n_independent_ : float
        How many independent records the baseline counts as.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    See Also
    --------
    MahalanobisDetector : Finds changes in any direction alike.

    Notes
    -----
    Records are frequencies, all of them positive, or residuals of a `TemperatureCompensator` directly before, which
    says what it makes of a relative change: residuals in Hz or whitened, also by weather. Other steps in between do not
    say so. Behind them, "softening" holds for columns that grow with their frequency, such as logarithms, but amounts
    are not shares of frequencies; columns that are components (exactly uncorrelated) are refused. Other directions are
    refused where values are not positive, and those of a model also where the columns are far from its frequencies.

    The test is one-sided: a change outside the cone is left to the omnibus. A cone that spans nearly everything gains
    nothing. :doc:`/guide/detectors_theory` has the joint calibration and records with missing modes.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import DirectionalDetector, MahalanobisDetector, TemperatureCompensator
    >>> from skthermo.surrogate import TemperatureMapper
    >>> from sklearn.pipeline import make_pipeline
    >>> healthy, damaged = (make_truss_campaign(damage=damage, random_state=0) for damage in (None, {"bottom": 0.08}))
    >>> baseline, later = (campaign.temperatures.join(campaign.frequencies) for campaign in (healthy, damaged))
    >>> regression = TemperatureCompensator(TemperatureMapper(), targets=list(healthy.frequencies))
    >>> for detector in (MahalanobisDetector(), DirectionalDetector(), DirectionalDetector(make_truss())):
    ...     detector = make_pipeline(regression, detector).fit(baseline)
    ...     print(f"{(detector.predict(later) == -1).mean():.0%}")
    47%
    70%
    86%
    >>> detector[-1].minimum_detectable_damage().round(2)
    direction
    bottom      0.09
    top         0.11
    diagonal    0.06
    vertical     inf
    dtype: float64
    """

    _parameter_constraints: dict = {
        **MahalanobisDetector._parameter_constraints,
        "directions": "no_validation",
        "omnibus": [Interval(Real, 0, 1, closed="both")],
        "threshold": [StrOptions({"quantile", "conformal"})],
    }

    def __init__(
        self,
        directions: Any = "softening",
        *,
        contamination: float = 0.02,
        omnibus: float = 0.2,
        covariance: BaseEstimator | None = None,
        threshold: Literal["quantile", "conformal"] = "conformal",
    ):
        self.directions = directions
        self.contamination = contamination
        self.omnibus = omnibus
        self.covariance = covariance
        self.threshold = threshold

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        # those of a chain that gives the directions are its own
        return {name: value for name, value in super().get_params(deep).items() if not name.startswith("directions__")}

    def __sklearn_clone__(self) -> DirectionalDetector:
        own = self.get_params(deep=False)
        return type(self)(**own | {"covariance": clone(self.covariance, safe=False)})  # a fitted chain is shared

    def _records(self, X: Any, F: Array, is_baseline: bool = False) -> Records:
        origin = origin_of(X)
        if is_baseline:
            vars(self).pop("levels_", None)  # of an earlier fit
            if origin is None:
                self.levels_ = self._levels(F)
        if origin is not None:
            return Records(F, origin.changes())
        matrix = np.diag(self.levels_) if hasattr(self, "levels_") else self.typical_changes_
        return Records(F, Changes.of_all(matrix, len(F)))

    def _learn(self, records: Records, times: Array) -> Array:
        names = getattr(self, "feature_names_in_", None)
        n_modes = records.changes.matrices.shape[2]
        self.directions_ = read_directions(self.directions, names, n_modes)
        omnibus = super()._learn(records.values, times)
        self.typical_changes_ = records.changes.typical()
        white = self._white_effects()
        self.sensitivities_ = pd.Series(np.linalg.norm(white, axis=0), self.directions_.index)
        self.indistinguishable_ = _alike(white, self.directions_.index)
        present = ~np.isnan(records.values)
        cone = self._projected(records)[2]
        if self.threshold == "conformal":  # new records are farther in the cone by the factor by which they are at all
            own = super()._index(records.values)
            cone = cone * np.divide(omnibus, own, out=np.ones_like(own), where=own > 0)
        self.cone_scale_ = PatternScale.of(np.maximum(cone, np.finfo(float).tiny), present, self.contamination)
        cone = cone * self.cone_scale_(present)
        self.tests_ = JoinedTests.of(cone, omnibus, self.omnibus)
        return self.tests_(cone, omnibus)

    def _index(self, records: Records) -> Array:
        return np.concatenate([self._joined(part) for part in _parts(records)])

    def _joined(self, records: Records) -> Array:
        omnibus, present = super()._index(records.values), ~np.isnan(records.values)
        cone = self._projected(records)[2]
        return self.tests_(cone if present.all() else cone * self.cone_scale_(present), omnibus)

    def _seen_at(self, threshold: float) -> str:
        smallest = self._detectability(threshold).smallest(0.5)
        sizes = ", ".join(f"{name} {loss:.2g}" for name, loss in smallest.items())
        return f". Half of the records raise an alarm at these losses: {sizes}"

    def severities(self, X: ArrayLike) -> pd.DataFrame:
        """Losses by which the test explains each record.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz, or residuals, in the columns of `fit`.

        Returns
        -------
        DataFrame of shape (n_samples, n_directions)
            The amounts of the directions, none of them negative, that are most likely: with an FE model the loss of
            stiffness of each group, with "softening" the fall of each frequency, from 0 to 1, by effects in proportion
            to it; else in the unit of the given directions. NaN where a record has no mode. Directions of
            ``indistinguishable_`` share what either could explain.
        """
        check_is_fitted(self)
        F = self._validated(X, reset=False, order="C")
        amounts = [self._projected(part)[0] for part in _parts(self._records(X, F))]
        index = X.index if isinstance(X, pd.DataFrame) else None
        limited = np.minimum(np.concatenate(amounts), largest_amount(self.directions))
        return pd.DataFrame(limited, index, self.directions_.index)

    def explained(self, X: ArrayLike) -> Array:
        """Share of the departure of each record from the baseline that the directions explain.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz, or residuals, in the columns of `fit`.

        Returns
        -------
        ndarray of shape (n_samples,)
            Of the squared Mahalanobis distance, from 0 to 1; small where something else has changed than a loss of
            stiffness of the groups, such as a bearing or a mass. NaN where a record has no mode.
        """
        check_is_fitted(self)
        F = self._validated(X, reset=False, order="C")
        lengths = np.concatenate([self._projected(part)[1] for part in _parts(self._records(X, F))])
        return explained_share(lengths, self._normal.distances(F))

    def pod(self, severities: ArrayLike) -> pd.DataFrame:
        """Probability of detection of single records, by drawing normal ones from the learned covariance.

        Parameters
        ----------
        severities : array-like of shape (n_severities,)
            Amounts of each direction: losses of stiffness of each group, or falls of each frequency, from 0 to 1, or
            amounts in the unit of the given directions.

        Returns
        -------
        DataFrame of shape (n_severities, n_directions)
            Share of such records above the threshold; at 0 the false alarms.

        Raises
        ------
        ValueError
            If a severity is negative, or a loss larger than 1.
        """
        check_is_fitted(self)
        return self._detectability(self.threshold_).pod(severities)

    def minimum_detectable_damage(self, level: float = 0.9) -> pd.Series:
        """Smallest amount of each direction alone that is found in a share of the records.

        Parameters
        ----------
        level : float, default=0.9
            That share, between 0 and 1.

        Returns
        -------
        Series of shape (n_directions,)
            Loss of stiffness by group, or fall of each frequency, infinite where not even a whole loss is found; else
            in the unit of the given directions.
        """
        check_is_fitted(self)
        return self._detectability(self.threshold_).smallest(check_probability(level, "level"))

    def _detectability(self, threshold: float) -> Detectability:
        names = list(self.directions_.index)
        return Detectability(self.tests_, self._white_effects(), names, threshold, largest_amount(self.directions))

    def _white_effects(self) -> Array:
        """What a unit of each direction makes of whitened columns, (n_columns, n_directions)."""
        normal = self._normal
        root = whitenings(normal.covariance[np.newaxis], np.ones((1, len(normal.mean)), dtype=bool))[0][0]
        return root @ self.typical_changes_ @ self.directions_.to_numpy().T

    def _levels(self, F: Array) -> Array:
        """What a relative change of each frequency makes of its column, in records of which no step says it."""
        if (F[~np.isnan(F)] > 0).all():
            levels = means_of_known(F)
            if _is_fem(self.directions):
                self._check_frequencies(levels)
            return levels
        softens = isinstance(self.directions, str)
        complete = F[~np.isnan(F).any(axis=1)]
        spread = complete.std(axis=0) if len(complete) > F.shape[1] else np.zeros(F.shape[1])
        if F.shape[1] > 1 and (spread > 0).all():
            correlation = np.corrcoef(complete.T) - np.eye(F.shape[1])
            softens &= not (np.abs(correlation) < UNCORRELATED).all()
        if not softens:
            raise ValueError(
                "the records are neither frequencies (some are not positive) nor residuals of a TemperatureCompensator "
                "directly before, so that it is not known by how much a relative change of a frequency moves each "
                "column; expected frequencies in Hz, or a pipeline without a memory of its own, in which the detector "
                "follows the compensator"
            )
        return np.ones(F.shape[1])

    def _check_frequencies(self, levels: Array) -> None:
        """Refuse columns that are no frequencies of the model that gives the directions, but something else of them."""
        expected = usual_frequencies(self.directions)
        if len(expected) == len(levels) and np.nanmedian(np.abs(np.log(levels / expected))) > np.log(FAR_OFF):
            raise ValueError(
                f"the means of the columns are {np.round(levels, 3).tolist()}, the frequencies of the model "
                f"{np.round(expected, 3).tolist()} Hz; expected frequencies in Hz, most within a factor of {FAR_OFF:g} "
                "of the model's, or a pipeline without a memory of its own, in which the detector follows the "
                "compensator"
            )

    def _projected(self, records: Records) -> tuple[Array, Array, Array]:
        """Amounts of the directions, length of the projection on their cone, and that as if no mode were missing."""
        normal = self._normal
        scale = np.sqrt(np.diag(normal.covariance))
        present = ~np.isnan(records.values)
        masks, pattern = patterns(present)
        correlation = normal.covariance / np.outer(scale, scale)
        weights = precisions(correlation, masks)
        matrices = records.changes.matrices / scale[:, np.newaxis]
        effects = matrices @ self.directions_.to_numpy().T
        cases, case = np.unique(records.changes.which * len(masks) + pattern, return_inverse=True)
        of_case, mask_of_case = effects[cases // len(masks)], cases % len(masks)
        weighted = weights[mask_of_case] @ of_case
        standard = np.nan_to_num(records.values - normal.mean) / scale
        along = standard @ weighted[0] if len(cases) == 1 else np.einsum("ij,ijk->ik", standard, weighted[case])
        amounts, lengths = project_on_cones(of_case.swapaxes(1, 2) @ weighted, along, case)
        amounts[~present.any(axis=1)] = np.nan
        if present.all():
            return amounts, lengths, lengths
        effects = self.typical_changes_ / scale[:, np.newaxis] @ self.directions_.to_numpy().T
        whole, *sizes = mean_squares(
            whitenings(correlation, np.vstack([np.ones(len(scale), bool), masks]))[0] @ effects
        )
        size = np.array(sizes)
        nothing = size <= 0
        mapped = as_if_complete(lengths, np.where(nothing, whole, size)[pattern], whole)
        mapped = np.where(nothing[pattern], 0.0, np.nan_to_num(mapped))
        return amounts, lengths, np.where(present.any(axis=1), mapped, np.nan)


def read_directions(directions: Any, names: Any, n_modes: int) -> pd.DataFrame:
    """Relative changes of the frequencies by direction, in the order of the modes, which may have names."""
    modes = [f"mode {n + 1}" for n in range(n_modes)] if names is None or len(names) != n_modes else list(names)
    if isinstance(directions, str):
        if directions != "softening":
            raise ValueError(
                f"directions is {directions!r}; expected 'softening', an FE model, a fitted DataInformedFEM, or "
                "relative changes (n_directions, n_modes)"
            )
        return pd.DataFrame(-np.eye(n_modes), modes, modes)
    if _is_fem(directions):
        has_own = hasattr(directions, "damage_directions")
        directions = directions.damage_directions() if has_own else differences(directions)
    is_frame = isinstance(directions, pd.DataFrame)
    if is_frame and names is not None and all(isinstance(one, str) for one in [*directions.columns, *modes]):
        if set(directions.columns) != set(modes):
            raise ValueError(f"directions have the columns {list(directions.columns)}; expected the modes {modes}")
        directions = directions[modes]
    values = as_floats(directions) if is_frame else real_array(directions, "directions")
    if values.ndim != 2 or values.shape[1] != n_modes or not len(values):
        raise ValueError(
            f"directions have the shape {values.shape}; expected (n_directions, {n_modes}): a relative change of each "
            f"of the modes {modes}"
        )
    own = list(map(str, directions.index)) if is_frame else [f"direction {n + 1}" for n in range(len(values))]
    wrong = ~np.isfinite(values).all(axis=1) | ~values.any(axis=1)
    if wrong.any():
        raise ValueError(
            f"{own[wrong.argmax()]!r} is zero or not finite; expected finite relative changes, one of them not 0"
        )
    return pd.DataFrame(values, own, modes)


def _alike(white: Array, names: pd.Index) -> list[tuple[str, str]]:
    """Pairs of directions with nearly the same whitened effects."""
    unit = white / np.maximum(np.linalg.norm(white, axis=0), np.finfo(float).tiny)
    first, second = np.triu_indices(unit.shape[1], 1)
    alike = (unit.T @ unit)[first, second] > ALIKE
    return [(names[i], names[k]) for i, k in zip(first[alike], second[alike], strict=True)]


def differences(model: Any, step: float = 1e-3) -> pd.DataFrame:
    """Central differences of the ln frequencies of a model that has no directions of its own, by group."""
    nominal = np.ones((1, len(model.parameter_names)))

    def logarithms(group: str, severity: float) -> Array:
        return np.log(as_floats(model.damaged({group: severity}).frequencies(nominal)))[0]

    rows = [(logarithms(group, step) - logarithms(group, -step)) / (2 * step) for group in model.groups]
    return pd.DataFrame(rows, list(model.groups), range(model.n_modes))


def usual_frequencies(fem: Any) -> Array:
    """Frequencies in Hz of a model at its nominal state, or of a fitted chain at the mean of its parameters."""
    if is_model(fem):
        return as_floats(fem.frequencies(np.ones((1, len(fem.parameter_names)))))[0]
    check_is_fitted(fem)
    theta = np.nanmean(as_floats(fem.parameters_), axis=0, keepdims=True)
    return as_floats(fem.aligner_.inverse_transform(fem.simulator_.frequencies(theta, fem.n_jobs, warn=False)))[0]


def largest_amount(directions: Any) -> float:
    """That of each direction: a whole loss; without limit where directions are given in a unit of their own."""
    return 1.0 if isinstance(directions, str) or _is_fem(directions) else np.inf


def _is_fem(directions: Any) -> bool:
    """Whether an FE model or a chain gives the directions."""
    return is_model(directions) or is_model(getattr(directions, "model", None))


def _parts(records: Records) -> list[Records]:
    """Some records after others, which bounds memory."""
    return [records.of(slice(i, i + ROWS_AT_ONCE)) for i in range(0, len(records.values), ROWS_AT_ONCE)]


@dataclass(frozen=True)
class Tail:
    """Squared indices of a baseline above a level, and by how much they exceed it on average, outliers apart."""

    level: float
    excess: float

    @classmethod
    def of(cls, index: Array) -> Tail:
        """Of the highest tenth of the indices, or more of a short baseline; by their median, because of outliers."""
        squares = index[np.isfinite(index)] ** 2
        share = min(max(TAIL, FEWEST_IN_TAIL / max(len(squares), 1)), 0.5)
        level = float(np.quantile(squares, 1 - share))
        above = squares[squares > level]
        return cls(level, float(np.median(above) - level) / np.log(2) if len(above) else 0.0)


@dataclass(frozen=True)
class JoinedTests:
    """The index of the cone and that of the omnibus, joined so that the latter gives a share of the false alarms.

    Squares of either index exceed their tails exponentially. The omnibus index is expressed as the index of the cone
    that is exceeded as often, times what the shares of both are to each other; the larger of the two counts.
    """

    cone: Tail
    omnibus: Tail
    share: float

    @classmethod
    def of(cls, cone: Array, omnibus: Array, share: float) -> JoinedTests:
        """Learned from the indices of a baseline."""
        return cls(Tail.of(cone), Tail.of(omnibus), share)

    def __call__(self, cone: Array, omnibus: Array) -> Array:
        if self.share in (0, 1):
            return omnibus if self.share else cone
        ratio = self.cone.excess / self.omnibus.excess if self.omnibus.excess > 0 else 1.0
        rarer = np.log((1 - self.share) / self.share)
        squared = self.cone.level + ratio * (omnibus**2 - self.omnibus.level) - self.cone.excess * rarer
        return np.maximum(cone, np.sqrt(np.maximum(squared, 0.0)))


@dataclass(frozen=True)
class Detectability:
    """Which amounts of each direction normal records let a threshold find, none above the ``largest``.

    ``white`` are the effects of the directions on what is tested, whitened, (n_modes, n_directions).
    """

    tests: JoinedTests
    white: Array
    names: Sequence[Any]
    threshold: float
    largest: float

    def pod(self, severities: ArrayLike) -> pd.DataFrame:
        """Share of records above the threshold, by severity and direction."""
        amounts = np.ravel(real_array(severities, "severities"))
        if not ((amounts >= 0) & (amounts <= self.largest)).all():
            expected = "losses from 0 to 1" if self.largest == 1 else "amounts that are not negative"
            raise ValueError(f"severities is {severities!r:.200}; expected {expected}")
        rates = [self._rates_of(direction, amounts) for direction in range(len(self.names))]
        return pd.DataFrame(np.transpose(rates), pd.Index(amounts, name="severity"), list(self.names))

    def smallest(self, level: float) -> pd.Series:
        """Smallest amount that is found in a share of the records; infinite where not even the largest is."""
        found = [self._smallest(effect, level) for effect in range(len(self.names))]
        return pd.Series(found, pd.Index(list(self.names), name="direction"), dtype=float)

    def _smallest(self, direction: int, level: float) -> float:
        """The first of some steps that is found often enough, and again of finer ones before it."""
        length = max(float(np.linalg.norm(self.white[:, direction])), np.finfo(float).tiny)
        low, high = 0.0, min((self.threshold + BEYOND) / length, self.largest)
        for _ in range(2):
            steps = low + STEPS * (high - low)
            reached = np.flatnonzero(self._rates_of(direction, steps) >= level)
            if not len(reached):
                return np.inf
            last = max(reached[0], 1)
            low, high = float(steps[last - 1]), float(steps[last])
        return high

    def _rates_of(self, direction: int, amounts: Array) -> Array:
        """Shares of normal rows with each amount above the threshold."""
        draws = np.random.RandomState(0).standard_normal((N_DRAWS, len(self.white)))
        moved = draws + np.outer(amounts, self.white[:, direction])[:, np.newaxis]
        moved = moved.reshape(-1, len(self.white))
        products, all_alike = (self.white.T @ self.white)[np.newaxis], np.zeros(len(moved), dtype=np.intp)
        lengths = project_on_cones(products, moved @ self.white, all_alike)[1]
        above = self.tests(lengths, np.linalg.norm(moved, axis=1)) > self.threshold
        return above.reshape(len(amounts), -1).mean(axis=1)


def mean_squares(white: Array) -> Array:
    """Mean squared length of the projections of normal rows on the cones of some effects, (n_cones, n_modes, n_dir)."""
    draws = np.random.RandomState(0).standard_normal((N_DRAWS_OF_PATTERN, white.shape[1]))
    which: NDArray[np.intp] = np.repeat(np.arange(len(white)), N_DRAWS_OF_PATTERN)
    lengths = project_on_cones(white.swapaxes(1, 2) @ white, (draws @ white).reshape(len(which), -1), which)[1]
    return (lengths.reshape(len(white), -1) ** 2).mean(axis=1)


def explained_share(lengths: Array, distances: Array) -> Array:
    """Share of squared distances that lies in a cone, from the lengths of the projections on it."""
    known = distances > 0
    return np.divide(np.minimum(lengths, distances) ** 2, distances**2, out=np.full(len(lengths), np.nan), where=known)
