"""DetectabilityStudy: which damage a detector would find in this structure's weather."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Literal, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import NotFittedError

from skthermo._arguments import check_jobs
from skthermo._arrays import as_random_state, positive_integer
from skthermo._threads import single_blas_thread
from skthermo._validation import Stages, _num_samples, last_step, seed_parts, seeded
from skthermo._warnings import warn_user, warnings_once
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies.detectability._arrangement import Arrangement
from skthermo.studies.detectability._pod_curve import PODCurve, bracket_of, check_probability, pod_curve
from skthermo.studies.detectability._simulation import SIMULATED, Simulation, clean_frequencies
from skthermo.studies.detectability._view import read_baseline
from skthermo.studies.scenarios import BaseScenario, check_chain, check_groups

MANY_FALSE_ALARMS = 0.5  # rate above which baseline and simulation seem to be of different structures

Reference: TypeAlias = Mapping[str, Any] | Callable[[Any, int], Any]


class DetectabilityStudy(BaseEstimator):
    """Simulated test of a detector: which damage it would find, and how often it would raise false alarms.

    A fitted chain simulates the structure in every scenario under the same weather, and a detector that has learned the
    healthy structure judges the records.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted.
    detector : detector
        `~skthermo.detection.MahalanobisDetector`, another detector of this package, or a pipeline that ends with one or
        with any of scikit-learn's outlier detectors; a clone is fitted.
    scenarios : sequence of Scenario, ProgressiveDamage or UncertainDamage
        With different names; `sweep` makes them for all damage groups and severities.
    n_repeats : int, default=20
        How often the records are simulated, each time with other noise.
    noise : float, array-like of shape (n_modes,) or "fitted", default="fitted"
        Of the simulated frequencies, as in `~skthermo.surrogate.DataInformedFEM.simulate`.
    n_jobs : int, optional
        Number of parallel jobs (joblib), which share the repeats.
    random_state : int, RandomState or None, default=None
        Seed of the noise, and of parts of the detector without a seed of their own.
    verbose : bool or int, default=0
        Whether `run` prints a line with the time of each of its stages; from 2, joblib prints how many repeats are
        done.

    Attributes
    ----------
    results_ : DataFrame
        What `run` returned.
    detector_ : detector
        The fitted clone.
    indices_ : dict of (str, str) to Series
        Damage index of the records of the first repeat, by scenario and source.
    arrangement_ : object
        Columns that the detector sees, and the number of healthy records that it has learned.
    threshold_ : float or None
        Damage index above which there is an alarm, where the detector has one.
    confidence_ : float
        Of the bounds in ``results_``.
    warnings_ : list of str
        Texts of the warnings that the simulations gave.

    See Also
    --------
    pod_curve : The curve over severity.
    what_to_add : What would make smaller damage detectable.

    Notes
    -----
    All scenarios and sources have the same weather, and repeat r has the same noise in all scenarios (common random
    numbers), so that differences between scenarios are more certain than each rate.

    The intervals are those of a rate over noise, for this weather, this baseline and this model: another year, another
    baseline or an error of the model is not in them. Records are serially dependent: the effective number of records is
    their number over the design effect, the ratio of the variance of the rate, estimated from sums over blocks of ten
    correlation times in different repeats, to that of independent records. With it, Clopper-Pearson bounds keep
    their confidence also for rates of 0 and 1 [KG98]_. Measured records are one repeat only; their variance between
    blocks of time holds that of the weather, too.

    References
    ----------
    Korn & Graubard, Confidence intervals for proportions with small expected number of positive counts estimated from
    survey data, Survey Methodology 24 (1998) 193-201 [KG98]_.

    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519 [KCM26]_.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> from skthermo.studies import DetectabilityStudy, sweep
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> scenarios = sweep(fem, (0.1, 0.2, 0.3), groups=["bottom"])
    >>> study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=5, random_state=0)
    >>> results = study.run(weather)
    >>> results[["scenario", "measure", "rate"]].round(1)
          scenario measure  rate
    0      healthy     PFA   0.0
    1  bottom 10 %     POD   0.2
    2  bottom 20 %     POD   0.9
    3  bottom 30 %     POD   1.0
    >>> float(study.minimum_detectable_damage().loc[("bottom", "data-informed"), "mdd"])
    0.2
    """

    def __init__(
        self,
        fem: Any,
        detector: Any,
        scenarios: Sequence[BaseScenario],
        *,
        n_repeats: int = 20,
        noise: ArrayLike | Literal["fitted"] = "fitted",
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
        verbose: bool | int = 0,
    ):
        self.fem = fem
        self.detector = detector
        self.scenarios = scenarios
        self.n_repeats = n_repeats
        self.noise = noise
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose

    def run(
        self,
        T: ArrayLike,
        baseline: ArrayLike | None = None,
        *,
        reference: Reference | None = None,
        confidence: float = 0.95,
    ) -> pd.DataFrame:
        """Simulate all scenarios, and count alarms.

        Parameters
        ----------
        T : array-like or DataFrame of shape (n_records, n_sensors)
            Temperatures in degrees Celsius under which the structure is simulated, in order of time.
        baseline : array-like or DataFrame, optional
            Measured frequencies of the healthy structure, or temperatures and frequencies side by side, which the
            detector learns. It sees the same columns of simulated records. By default the records that the chain was
            fitted on: their frequencies, beside temperatures if a part of the detector has ``targets``, as
            `~skthermo.detection.TemperatureCompensator`.
        reference : mapping or callable, optional
            Truth to compare with: by name of the scenario, measured frequencies, which may have other rows than T, and
            then temperatures of their own beside them where the detector sees temperatures; or a function of a
            scenario and an integer seed, which returns frequencies for the rows of T, or None, and is called in every
            repeat.
        confidence : float, default=0.95
            Of the bounds of the rates, two-sided.

        Returns
        -------
        DataFrame
            One row for each scenario and source:

            - ``scenario``, ``family``, ``severity``;
            - ``source``: "data-informed" (simulated) or "reference";
            - ``measure``: "PFA", the probability of false alarm, of a healthy structure, else "POD", the probability of
              detection, from the onset of the damage on;
            - ``rate``, ``lowest``, ``highest``: share of records in alarm, and its bounds;
            - ``band_lowest``, ``band_highest``: range of the rates of single repeats, which a measured campaign of this
              length and state should lie in with the probability ``confidence``. Fewer than 39 repeats are too few for
              95 %: the range of all n holds it with (n - 1) / (n + 1), and a single one has none (NaN);
            - ``n_alarms``, ``n_records``, ``n_effective``, ``n_repeats``: counts over all repeats, of records that the
              detector can judge;
            - ``n_not_judged``: number of records that it cannot judge, which count neither as healthy nor as alarms;
            - ``time_to_detection``: from the onset or the first record to the first alarm, in records or, for frames on
              a ``DatetimeIndex``, in time; the mean over those repeats that have an alarm.

        Raises
        ------
        ValueError
            If names of scenarios repeat, a damage group is unknown, columns do not fit, or no record can be judged.

        Warns
        -----
        UserWarning
            Once for each kind of doubt about the simulations, such as weather outside the training range; if most
            records of the healthy structure raise an alarm.
        """
        check_chain(self.fem)
        check_detector(self.detector)
        n_repeats = positive_integer(self.n_repeats, "n_repeats")
        check_probability(confidence, "confidence")
        check_jobs(self.n_jobs)
        scenarios = self._checked_scenarios(reference)
        view, healthy = read_baseline(self.fem, self.detector, baseline)
        seeds = as_random_state(self.random_state).randint(np.iinfo(np.int32).max, size=(n_repeats, 2))
        self.detector_ = clone(self.detector)
        seed_parts(self.detector_, seeded(self.random_state))
        stages = Stages(self, 4)
        with stages.stage("detector"):
            self.detector_.fit(healthy)
        function, measured = (reference, {}) if callable(reference) else (None, reference or {})
        with warnings_once("in the simulations of this study") as self.warnings_, single_blas_thread():
            with stages.stage("frequencies"):
                clean = clean_frequencies(self.fem, scenarios, T, n_repeats)
            simulation = Simulation(self.fem, self.detector_, view, scenarios, T, clean, self.noise, function)
            with stages.stage("first repeat"):
                records = simulation.first_repeat(measured, seeds[0])
        with stages.stage(f"other {n_repeats - 1} repeats"):
            simulation.repeat(records, seeds, self.n_jobs, verbose=max(self.verbose - 1, 0))
        offset = getattr(last_step(self.detector_), "offset_", None)
        self.threshold_ = None if offset is None else -float(np.squeeze(offset))
        self.indices_ = {(one.scenario.name, one.source): one.damage_index for one in records}
        self.results_ = pd.DataFrame([one.summary(confidence) for one in records])
        self._warn_of_many_false_alarms()
        self.confidence_ = confidence
        columns = [view.names[i] for i in view.positions]
        self.arrangement_ = Arrangement(clone(self.detector_), columns, _num_samples(healthy), view.is_frame)
        return self.results_

    def pod_curve(self, family: str, source: str = "data-informed", *, log: bool = False) -> PODCurve:
        """Probability of detection over severity for one family of scenarios.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="data-informed"
            "data-informed" or "reference".
        log : bool, default=False
            Whether the logit is linear in the logarithm of the severity.

        Returns
        -------
        PODCurve
            Records count as their effective numbers, so that serial correlation is in its bounds.

        Raises
        ------
        ValueError
            If there is no such family, or the curve cannot be fitted.

        Warns
        -----
        UserWarning
            If the curve has no finite slope, or lies outside the bounds of some tested severities.
        """
        is_known = isinstance(family, str) and isinstance(source, str)
        rows = self._families().get((family, source)) if is_known else None
        if rows is None:
            known = [f"{f!r} ({s})" for f, s in self._families()]
            raise ValueError(f"family {family!r}, source {source!r} is not in the results; expected one of {known}")
        detected = rows["rate"] * rows["n_effective"]
        with _naming(family):
            return pod_curve(rows["severity"], detected, rows["n_effective"], log=log, confidence=self.confidence_)

    def minimum_detectable_damage(self, level: float = 0.9, method: Literal["grid", "curve"] = "grid") -> pd.DataFrame:
        """Smallest severity that is detected reliably, for every family and source.

        Parameters
        ----------
        level : float, default=0.9
            Probability of detection that counts as reliable.
        method : {"grid", "curve"}, default="grid"
            Of the tested severities the smallest from which the rate stays at or above the level (bounds: the same for
            the upper and the lower bounds of the rates); or where the fitted curve and its two-sided bounds reach it.

        Returns
        -------
        DataFrame
            Indexed by family and source, with ``mdd``, ``lowest`` and ``highest``: NaN or infinite where the level is
            not reached. Where a curve has no finite slope, the POD does not increase, or a family has one severity
            only, ``mdd`` is NaN and the bounds are the two tested severities between which it lies.

        Raises
        ------
        ValueError
            If there is no family, the level is not between 0 and 1, or a family has both damage and strengthening.

        Warns
        -----
        UserWarning
            If a curve has no finite slope or lies outside the bounds of some tested severities, or there is none
            because the POD does not increase. Of texts that differ in their numbers only, the first is given.
        """
        check_probability(level, "level")
        if method not in ("grid", "curve"):
            raise ValueError(f"method is {method!r}; expected 'grid' or 'curve'")
        find = self._on_grid if method == "grid" else self._on_curve
        with warnings_once("for other families or sources"):
            found = {key: find(key, rows, level) for key, rows in self._families().items()}
        if not found:
            raise ValueError("no scenario belongs to a family with a severity; expected some, as `sweep` makes them")
        index = pd.MultiIndex.from_tuples(list(found), names=["family", "source"])
        return pd.DataFrame(list(found.values()), index=index, columns=["mdd", "lowest", "highest"])

    def is_undetected(self, family: str, source: str = "data-informed") -> bool:
        """Whether no severity of a family raises clearly more alarms than the healthy structure does.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="data-informed"
            "data-informed" or "reference".

        Returns
        -------
        bool
            True if no rate is above the highest upper bound of the rates of false alarms.

        Raises
        ------
        NotFittedError
            If the study has no results.
        """
        rows = self._results()
        for what, name, known in (("family", family, rows["family"]), ("source", source, rows["source"])):
            if not isinstance(name, str) or name not in set(known):
                raise ValueError(f"{what} is {name!r:.100}; expected one of {known.dropna().unique().tolist()}")
        rows = rows[rows["source"] == source]
        healthy = rows.loc[rows["measure"] == "PFA", "highest"].max()
        rates = rows.loc[(rows["measure"] == "POD") & (rows["family"] == family), "rate"]
        return bool((rates <= healthy).all())

    def _results(self) -> pd.DataFrame:
        if not hasattr(self, "results_"):
            raise NotFittedError("the study has no results yet; expected a call of run before")
        return self.results_

    def _families(self) -> dict[tuple[Any, Any], pd.DataFrame]:
        """Rows of the results by family and source."""
        rows = self._results()
        rows = rows[(rows["measure"] == "POD") & rows["family"].notna() & rows["severity"].notna()]
        return dict(iter(rows.groupby(["family", "source"], sort=False)))  # type: ignore[arg-type]

    def _on_grid(self, key: Any, rows: pd.DataFrame, level: float) -> tuple[float, float, float]:
        with _naming(key[0]):
            mdd, lowest, highest = (
                minimum_detectable_damage(rows["severity"], rows[rate], level) for rate in ("rate", "highest", "lowest")
            )
        return mdd, lowest, highest

    def _on_curve(self, key: Any, rows: pd.DataFrame, level: float) -> tuple[float, float, float]:
        bracket = float("nan"), *bracket_of(rows["severity"].abs().to_numpy(), rows["rate"].to_numpy(), level)
        if len(rows) < 2:
            return bracket
        try:
            curve = self.pod_curve(*key)
        except ValueError as error:
            if rows["severity"].min() < 0 < rows["severity"].max():
                raise
            rare = "; alarms are as rare as for the healthy structure: severities are small, or outliers of the "
            cause = f"{rare}baseline raise the threshold" if self.is_undetected(*key) else ""
            warn_user(f"no curve of source {key[1]!r} for {error}{cause}", "family without a curve")
            return bracket
        if np.isnan(curve.slope):
            return float("nan"), *bracket_of(curve.severities, curve.n_detected / curve.n_records, level)
        tail = (1 - self.confidence_) / 2
        return curve.severity_at(level), curve.severity_at(level, tail), curve.severity_at(level, 1 - tail)

    def _warn_of_many_false_alarms(self) -> None:
        """Warn if the detector takes most simulated records of the healthy structure for damaged."""
        rows = self.results_[(self.results_["measure"] == "PFA") & (self.results_["source"] == SIMULATED)]
        many = rows[rows["lowest"] > MANY_FALSE_ALARMS]
        if len(many):
            text = (
                f"{many['rate'].iloc[0]:.0%} of the simulated records of scenario {many['scenario'].iloc[0]!r}, where "
                "nothing is changed, raise an alarm; expected a baseline in Hz of the structure that the chain has "
                "learned, and weather in degrees Celsius as in the baseline"
            )
            self.warnings_.append(text)
            warn_user(text, "many false alarms")

    def _checked_scenarios(self, reference: Any) -> list[BaseScenario]:
        """The scenarios; an error if they or the names of the reference are wrong."""
        if isinstance(self.scenarios, type) or not isinstance(self.scenarios, Iterable):
            raise ValueError(f"scenarios is {self.scenarios!r:.200}; expected a list of scenarios, as sweep makes it")
        scenarios, groups = list(self.scenarios), getattr(self.fem.model, "groups", None)
        wrong = [scenario for scenario in scenarios if not isinstance(scenario, BaseScenario)]
        names = [scenario.name for scenario in scenarios if isinstance(scenario, BaseScenario)]
        if wrong or not names or len(set(names)) < len(names):
            raise ValueError(f"scenarios are {scenarios!r:.500}; expected one or more, each with a name of its own")
        for scenario in scenarios:
            if groups is not None:
                check_groups(scenario.groups, groups)
        if reference is not None and not callable(reference) and not isinstance(reference, Mapping):
            raise ValueError(
                f"reference is {reference!r:.200}; expected {{name of scenario: frequencies}} or a function"
            )
        unknown = [name for name in reference if name not in names] if isinstance(reference, Mapping) else []
        if unknown:
            raise ValueError(f"reference has the scenarios {unknown}; expected some of {names}")
        return scenarios

    def __sklearn_clone__(self) -> DetectabilityStudy:
        parameters = self.get_params(deep=False) | {"detector": clone(self.detector)}
        return type(self)(**parameters)  # the chain is fitted, and shared


def check_detector(detector: Any) -> None:
    """Raise an error for what is not an outlier detector."""
    needed = ("get_params", "fit", "decision_function", "score_samples")
    lacking = [name for name in needed if not hasattr(detector, name)]
    if isinstance(detector, type) or lacking:
        without = f", without {lacking}" if lacking else ", a class"
        raise ValueError(f"the detector is {detector!r:.200}{without}; expected an outlier detector")


@contextmanager
def _naming(family: Any) -> Iterator[None]:
    """Begin the text of errors with the family's name."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"family {family!r}: {error}") from error
