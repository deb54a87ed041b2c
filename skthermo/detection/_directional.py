"""Damage index and alarm by the directions in which damage moves frequencies, and which damage they find."""

from __future__ import annotations

from collections.abc import Callable
from numbers import Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone

from skthermo._core.arrays import Array, as_floats, check_probability, patterns, real_array, spread_evenly
from skthermo._core.estimators import Interval, StrOptions, check_is_fitted
from skthermo.detection._mahalanobis import MahalanobisDetector, normal_of
from skthermo.residuals.cones import project_on_cones
from skthermo.residuals.gaussian import Gaussian, precisions


class DirectionalDetector(MahalanobisDetector):
    """Alarm where frequencies, or their residuals, have moved in the directions in which damage moves them.

    The one-sided likelihood-ratio test against the cone of all non-negative combinations of the directions [Kud63]_,
    [Per69]_. The damage index is the length of the projection of a whitened record on that cone, in standard
    deviations, or the *unsquared* Mahalanobis distance (omnibus) times ``omnibus_scale_``, whichever is larger. Losses
    of section have a cone of their own, and its length counts times ``section_scale_``.

    Parameters
    ----------
    directions : "softening", FE model, fitted chain, DataFrame or array, default="softening"
        Relative changes of the frequencies:

        - ``"softening"``: each frequency only falls, as by any loss of stiffness; a loss of section raises some.
        - An FE model, or a fitted `~skthermo.surrogate.DataInformedFEM`: those by a loss of stiffness of each of its
          damage groups and, where it knows their mass, by a loss of section, named as in "bottom, section". Nobody
          knows beforehand which comes.
        - (n_directions, n_modes): relative changes by one unit of each direction, in any unit. The columns of a frame
          are matched by name where both have names, and its index names the directions.
    contamination : float, default=0.02
        Share of healthy records above the threshold.
    omnibus : float, default=0.2
        Share of the false alarms that goes to the Mahalanobis distance, for changes outside the cone, such as a gain of
        stiffness: from 0 (none of it) to 1 (nothing else).
    covariance : covariance estimator, optional
        As in `MahalanobisDetector`.
    threshold : {"conformal", "quantile"}, default="conformal"
        As in `MahalanobisDetector`.

    Attributes
    ----------
    directions_ : DataFrame of shape (n_directions, n_modes)
        Relative changes of the frequencies, by name of the direction and of the mode.
    indistinguishable_ : list of tuple of str
        Pairs of directions that move the frequencies alike, with a cosine of more than 0.95 in standard deviations: an
        alarm by one may be by the other.
    sensitivities_ : Series of shape (n_directions,)
        By how many standard deviations one unit of each direction moves a record that has all modes.
    omnibus_scale_, section_scale_ : float
        Factors of the Mahalanobis distance, and of the length in the cone of losses of section, beside the length in
        the cone of the other directions: with them, the tests share the false alarms as ``omnibus`` says, and both
        cones alike. 0 without the test, and 1 for the only one.
    healthy_ : ndarray of shape (n_kept, n_modes)
        Up to 2000 records of the baseline, evenly spaced, as `fit` read them; `pod` moves them.
    covariance_ : estimator
        Fitted: mean (``location_``) and covariance of the baseline.
    baseline_index_ : ndarray of shape (n_samples,)
        Damage index of the baseline; with the conformal threshold, each record's index from records of other folds.
    n_independent_ : float
        Number of independent records that the residuals of the baseline are worth, or its indices where columns are
        frequencies.
    threshold_, offset_ : float
        A damage index above the threshold is an alarm; ``decision_function`` is ``score_samples - offset_``.
    report_ : DataFrame
        As what each column was read, and in how many rows a value was set aside, as `DamageDetector` has it.
    findings_ : list of SkthermoWarning
        What `fit` has warned of.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    See Also
    --------
    MahalanobisDetector : Finds changes in any direction alike.
    CompensatedDetector : Removes the effect of temperature before.

    Notes
    -----
    Records are frequencies, or relative residuals ln f - ln f expected, as `TemperatureCompensator` gives them. Columns
    that cannot be either, because they scatter by more than a third or are exactly uncorrelated, as standardised
    columns or principal components are, are refused.

    The test is one-sided: a change outside the cone is left to the omnibus. A cone that spans nearly everything gains
    nothing. A record with missing modes gets its length in the cone of the modes that it has, times the square root of
    the ratio of the numbers of modes.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import DirectionalDetector, MahalanobisDetector, TemperatureCompensator
    >>> from skthermo.surrogate import TemperatureMapper
    >>> healthy, damaged = (make_truss_campaign(damage=damage, random_state=0) for damage in (None, {"bottom": 0.08}))
    >>> baseline, later = (campaign.temperatures.join(campaign.frequencies) for campaign in (healthy, damaged))
    >>> regression = TemperatureCompensator(TemperatureMapper(), targets=list(healthy.frequencies))
    >>> residuals, later = regression.fit_transform(baseline), regression.transform(later)
    >>> of_stiffness = make_truss().damage_directions(kind="stiffness")
    >>> for directions in (None, "softening", make_truss(), of_stiffness):
    ...     detector = MahalanobisDetector() if directions is None else DirectionalDetector(directions)
    ...     print(f"{(detector.fit(residuals).predict(later) == -1).mean():.0%}")
    46%
    65%
    70%
    85%

    Who looks for losses of section too finds losses of stiffness less often. The smallest ones of the last detector:

    >>> detector.minimum_detectable_damage()[["bottom", "top", "diagonal"]].round(2)
    direction
    bottom      0.09
    top         0.11
    diagonal    0.06
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
        # a chain that gives the directions keeps its own
        return {name: value for name, value in super().get_params(deep).items() if not name.startswith("directions__")}

    def __sklearn_clone__(self) -> DirectionalDetector:
        own = self.get_params(deep=False)
        return type(self)(**own | {"covariance": clone(self.covariance, safe=False)})  # a fitted chain is shared

    def _learn(self, F: Array, times: Array) -> Array:
        refuse_no_residuals(F, (self.report_["read_as"] == "residual").to_numpy())
        self.directions_ = read_directions(self.directions, getattr(self, "feature_names_in_", None), F.shape[1])
        self.covariance_ = self._fitted(F, self.findings_)
        self.healthy_ = F[spread_evenly(np.flatnonzero(~np.isnan(F).all(axis=1)), 2000)]
        white = self._white_effects()
        self.sensitivities_ = pd.Series(np.linalg.norm(white, axis=0), self.directions_.index)
        self.indistinguishable_ = alike(white, self.directions_.index)
        is_conformal = self.threshold == "conformal"
        tests = self._by_others(self._tests, F, times) if is_conformal else self._tests(normal_of(self.covariance_), F)
        scales = self._learned_scales(tests)
        self.omnibus_scale_, self.section_scale_ = float(scales[0]), float(scales[-1] * ("section" in self._cones))
        return self._joined(tests)

    def _index(self, F: Array) -> Array:
        return self._joined(self._tests(normal_of(self.covariance_), F))

    def _joined(self, tests: Array) -> Array:
        of_cones = [float(self.omnibus < 1), self.section_scale_][: tests.shape[1] - 1]
        return (tests * [self.omnibus_scale_, *of_cones]).max(axis=1)

    def _learned_scales(self, tests: Array) -> Array:
        """Ratios of the thresholds that each test would have by itself, with its share of the false alarms."""
        n_cones = tests.shape[1] - 1
        shares = np.array([self.omnibus, *n_cones * [(1 - self.omnibus) / n_cones]])
        rates = shares * self.contamination
        levels = [rare_level(own, rate) if rate else np.inf for own, rate in zip(tests.T, rates, strict=True)]
        return (levels[0] if self.omnibus == 1 else levels[1]) / np.array(levels)

    def _tests(self, normal: Gaussian, F: Array) -> Array:
        """Mahalanobis distance of each row and its length in each cone, as if no mode were missing."""
        present = ~np.isnan(F)
        cones = [self.directions_.to_numpy()[numbers] for numbers in self._cones.values()]
        lengths = np.column_stack([project(normal, cone, F)[1] for cone in cones])
        lengths[~present.any(axis=1)] = np.nan
        lengths *= np.sqrt(F.shape[1] / np.maximum(present.sum(axis=1), 1))[:, np.newaxis]
        return np.column_stack([self._indices(normal, F), lengths])

    @property
    def _cones(self) -> dict[str, NDArray[np.intp]]:
        """Numbers of the directions of each kind of loss that has some, losses of section last."""
        are_section = self.directions_.index.str.endswith(", section")
        numbers = {"stiffness": np.flatnonzero(~are_section), "section": np.flatnonzero(are_section)}
        return {kind: own for kind, own in numbers.items() if len(own)}

    def severities(self, X: ArrayLike, *, kind: Literal["stiffness", "section"] = "stiffness") -> pd.DataFrame:
        """Losses by which the test explains each record.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz, or residuals, in the columns of `fit`.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions, as in `pod`.

        Returns
        -------
        DataFrame of shape (n_samples, n_directions)
            The amounts of the directions, none of them negative, that are most likely: with an FE model the loss of
            each group, with "softening" the fall of each frequency, from 0 to 1, by effects in proportion to it; else
            in the unit of the given directions. NaN where a record has no mode. Directions of ``indistinguishable_``
            share what either could explain.
        """
        check_is_fitted(self)
        directions = self.directions_.loc[[*self._directions_of(kind)]]
        amounts = project(normal_of(self.covariance_), directions.to_numpy(), self._relative(X))[0]
        index = X.index if isinstance(X, pd.DataFrame) else None
        return pd.DataFrame(np.minimum(amounts, self._largest), index, directions.index)

    def explained(self, X: ArrayLike, *, kind: Literal["stiffness", "section"] = "stiffness") -> Array:
        """Share of the departure of each record from the baseline that the directions explain.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz, or residuals, in the columns of `fit`.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions, as in `pod`.

        Returns
        -------
        ndarray of shape (n_samples,)
            Of the squared Mahalanobis distance, from 0 to 1; small where another change than a loss of the groups has
            happened, such as of a bearing or a mass. NaN where a record has no mode.
        """
        F = self._relative(X)
        directions = self.directions_.to_numpy()[[*self._directions_of(kind).values()]]
        lengths = project(normal_of(self.covariance_), directions, F)[1]
        distances = normal_of(self.covariance_).distances(F)
        shares = np.full(len(F), np.nan)
        return np.divide(np.minimum(lengths, distances) ** 2, distances**2, out=shares, where=distances > 0)

    def pod(self, severities: ArrayLike, *, kind: Literal["stiffness", "section"] = "stiffness") -> pd.DataFrame:
        """Probability of detection of single records: records of the baseline, with its gaps, moved by a loss.

        Parameters
        ----------
        severities : array-like of shape (n_severities,)
            Amounts of each direction: losses of each group, or falls of each frequency, from 0 to 1, or amounts in the
            unit of the given directions.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions: losses of section, named as in "bottom, section", or all others.

        Returns
        -------
        DataFrame of shape (n_severities, n_directions)
            Share of such records above the threshold; at 0 the false alarms.

        Raises
        ------
        ValueError
            If a severity is negative, a loss larger than 1, or there is no direction of the kind.
        """
        check_is_fitted(self)
        amounts = np.ravel(real_array(severities, "severities"))
        if not ((amounts >= 0) & (amounts <= self._largest)).all():
            expected = "losses from 0 to 1" if self._largest == 1 else "amounts that are not negative"
            raise ValueError(f"severities is {severities!r:.200}; expected {expected}")
        rates = {name: self._rates(n, amounts) for name, n in self._directions_of(kind).items()}
        return pd.DataFrame(rates, pd.Index(amounts, name="severity"))

    def minimum_detectable_damage(
        self, level: float = 0.9, *, kind: Literal["stiffness", "section"] = "stiffness"
    ) -> pd.Series:
        """Smallest amount of each direction alone that is found in a share of the records.

        Parameters
        ----------
        level : float, default=0.9
            That share, between 0 and 1.
        kind : {"stiffness", "section"}, default="stiffness"
            Which directions, as in `pod`.

        Returns
        -------
        Series of shape (n_directions,)
            Loss by group, or fall of each frequency, infinite where not even a whole loss is found; else
            in the unit of the given directions.
        """
        check_is_fitted(self)
        level, found = check_probability(level, "level"), {}
        lengths = self.sensitivities_.to_numpy()
        threshold = self.threshold_ / (self.section_scale_ or 1.0 if kind == "section" else 1.0)
        for name, direction in self._directions_of(kind).items():
            # a complete record is found five standard deviations above the threshold, one with gaps later
            highest = min(4 * (threshold + 5) / max(lengths[direction], np.finfo(float).tiny), self._largest)
            found[name] = smallest_amount(lambda sizes, k=direction: self._rates(k, sizes), highest, level)
        return pd.Series(found, dtype=float).rename_axis("direction")

    def _directions_of(self, kind: str) -> dict[str, int]:
        """Names and numbers of the directions of one kind of loss."""
        if kind not in ("stiffness", "section"):
            raise ValueError(f"kind is {kind!r}; expected 'stiffness' or 'section'")
        if kind not in self._cones:
            raise ValueError(
                f"directions are {list(self.directions_.index)}, none of a loss of {kind}; expected the other kind, or "
                "an FE model that knows the mass of its groups, as Structure.assemble or group_mass gives it"
            )
        return {self.directions_.index[number]: int(number) for number in self._cones[kind]}

    def _rates(self, direction: int, amounts: Array) -> Array:
        """Shares of the records of the baseline that are above the threshold with each amount of a direction."""
        change = self.directions_.to_numpy()[direction]
        return np.array([(self._index(self.healthy_ + amount * change) > self.threshold_).mean() for amount in amounts])

    def _white_effects(self) -> Array:
        """Changes of whitened records by a unit of each direction, (n_modes, n_directions)."""
        return np.linalg.solve(np.linalg.cholesky(self.covariance_.covariance_), self.directions_.to_numpy().T)

    @property
    def _largest(self) -> float:
        """Largest amount of a direction: a whole loss; without limit where directions have a unit of their own."""
        return np.inf if isinstance(self.directions, pd.DataFrame) or np.ndim(self.directions) else 1.0


def project(normal: Gaussian, directions: Array, F: Array, n_rows: int = 20_000) -> tuple[Array, Array]:
    """Amounts of the directions that explain each row best, and the length of its projection on their cone.

    So many rows are solved at once, which bounds memory.
    """
    scale = np.sqrt(np.diag(normal.covariance))
    correlation, effects = normal.covariance / np.outer(scale, scale), directions.T / scale[:, np.newaxis]
    amounts, lengths = np.empty((len(F), len(directions))), np.empty(len(F))
    for start in range(0, len(F), n_rows):
        rows = slice(start, start + n_rows)
        masks, pattern = patterns(~np.isnan(F[rows]))
        weighted = precisions(correlation, masks) @ effects
        standard = np.nan_to_num(F[rows] - normal.mean) / scale
        along = np.einsum("ij,ijk->ik", standard, weighted[pattern]) if len(masks) > 1 else standard @ weighted[0]
        amounts[rows], lengths[rows] = project_on_cones(effects.T @ weighted, along, pattern)
    amounts[np.isnan(F).all(axis=1)] = np.nan
    return amounts, lengths


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
    if hasattr(directions, "damage_directions"):
        directions = directions.damage_directions()
    elif hasattr(directions, "damaged"):
        directions = directions_by_differences(directions)
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


def directions_by_differences(model: Any, step: float = 1e-3) -> pd.DataFrame:
    """Relative change of each frequency of a model for a loss of stiffness of each group, by central differences."""
    nominal = np.ones((1, len(model.parameter_names)))

    def logarithms(damage: dict[str, float]) -> Array:
        return np.log(as_floats(model.damaged(damage).frequencies(nominal)))[0]

    slopes = {name: (logarithms({name: step}) - logarithms({name: -step})) / (2 * step) for name in model.groups}
    return pd.DataFrame.from_dict(slopes, orient="index")


def refuse_no_residuals(F: Array, are_residuals: NDArray[np.bool_]) -> None:
    """Refuse columns, read as residuals, that cannot be relative: standardised ones, or principal components."""
    if not are_residuals.any():
        return
    deviations = np.nanstd(F[:, are_residuals], axis=0)
    complete = F[~np.isnan(F).any(axis=1)]
    are_components = False
    if F.shape[1] > 1 and len(complete) > F.shape[1] and (complete.std(axis=0) > 0).all():
        correlation = np.corrcoef(complete.T) - np.eye(F.shape[1])
        are_components = bool((np.abs(correlation) < 1e-8).all())
    if (deviations > 1 / 3).any() or are_components:
        raise ValueError(
            f"columns are neither frequencies nor relative residuals: they have standard deviations up to "
            f"{deviations.max():.3g}{' and are exactly uncorrelated' if are_components else ''}, so that nobody knows "
            "how a relative change of a frequency moves them; expected frequencies in Hz, or residuals ln f - ln f "
            "expected, as TemperatureCompensator gives"
        )


def alike(white: Array, names: pd.Index, cosine: float = 0.95) -> list[tuple[str, str]]:
    """Pairs of directions with nearly the same whitened effects."""
    unit = white / np.maximum(np.linalg.norm(white, axis=0), np.finfo(float).tiny)
    first, second = np.triu_indices(unit.shape[1], 1)
    are_alike = (unit.T @ unit)[first, second] > cosine
    return [(names[i], names[k]) for i, k in zip(first[are_alike], second[are_alike], strict=True)]


def rare_level(index: Array, rate: float, tail: float = 0.1) -> float:
    """The level that indices exceed at a rate: squares above the level of the tail exceed it exponentially.

    Their median tells by how much, so that outliers do not.
    """
    squares = index[np.isfinite(index)] ** 2
    if len(squares) < 2:
        raise ValueError(f"{len(squares)} of {len(index)} baseline records have an index; expected more records")
    level = np.quantile(squares, 1 - tail)
    excess = (np.median(squares[squares > level]) - level) / np.log(2)
    return float(np.sqrt(level + excess * np.log(tail / rate)))


def smallest_amount(rates: Callable[[Array], Array], highest: float, level: float, n_halvings: int = 12) -> float:
    """The smallest amount up to the highest that is found often enough, by bisection; infinite if none is."""
    if rates(np.array([highest]))[0] < level:
        return np.inf
    low, high = 0.0, highest
    for _ in range(n_halvings):
        middle = (low + high) / 2
        low, high = (low, middle) if rates(np.array([middle]))[0] >= level else (middle, high)
    return high
