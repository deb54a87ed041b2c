"""DetectabilityStudy: which damage detectors would find in this structure's weather."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import NotFittedError

from skthermo._estimators.arguments import check_jobs
from skthermo._estimators.threads import single_blas_thread
from skthermo._estimators.warnings import checked_once, warn_user, warnings_once
from skthermo._tables.arrays import Array, as_random_state, positive_integer
from skthermo._validation import Stages, last_step, seeded
from skthermo.studies.detectability._candidates import Candidate
from skthermo.studies.detectability._findings import StudyFindings
from skthermo.studies.detectability._judged import Judgement
from skthermo.studies.detectability._pod_curve import PODCurve, check_probability
from skthermo.studies.detectability._replicate_rates import ReplicateRates
from skthermo.studies.detectability._simulation import (
    LARGEST_SEED,
    Measurement,
    Simulation,
    clean_frequencies,
)
from skthermo.studies.replicates import Replicates
from skthermo.studies.scenarios import BaseScenario, check_chain, read_scenarios

Reference: TypeAlias = Mapping[str, Any] | Callable[[Any, int], Any]


def _found_attribute(name: str) -> Any:
    """A property of a study: what its last run found, under this name."""
    return property(
        lambda study: getattr(study._found(), name), doc=f"``findings_.{name}``, as the class describes it."
    )


class DetectabilityStudy(BaseEstimator):
    """Simulated test of detectors: which damage each would find, and how often it would raise false alarms.

    A fitted chain simulates the structure in every scenario under the same weather, and detectors that have learned the
    healthy structure judge the records, all of them the same.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted.
    detectors : detector or mapping of str to detector
        `~skthermo.detection.MahalanobisDetector`, another detector of this package, or a pipeline that ends with one or
        with any of scikit-learn's outlier detectors; several by name. Clones are fitted. A single one is named by the
        class of its last step, such as "MahalanobisDetector".
    scenarios : sequence of Scenario, ProgressiveDamage, UncertainDamage or mapping
        With different names; `sweep` makes them for all damage groups and severities. A mapping of damage groups to
        severities is a `Scenario` with a name such as "soil 18 %, piers 5 %"; an empty one is "healthy".
    n_repeats : int, default=20
        How often the records are simulated, each time with other noise.
    noise : float, array-like of shape (n_modes,) or "fitted", default="fitted"
        Of the simulated frequencies, as in `~skthermo.surrogate.DataInformedFEM.simulate`.
    gaps : float, "fitted" or None, default="fitted"
        Values that are missing in the simulated records, as in `~skthermo.surrogate.DataInformedFEM.simulate`. With
        "fitted", detectors that see temperatures also see them with the gaps of the training records.
    outliers : float, "fitted", None or array-like of shape (n_training_records, n_modes), default="fitted"
        Values that are far off, as in `~skthermo.surrogate.DataInformedFEM.simulate`.
    uncertainty : {"all", "noise", "baseline", "weather", "model"} or sequence of them, default="all"
        What the bands hold, in which the rate of a measured campaign should lie:

        - "noise": another draw of the noise;
        - "baseline": the training records could have been others (`~skthermo.surrogate.DataInformedFEM.resampled`), so
          that the structure is another one than the chain; the detectors stay as they are, as they would in service;
        - "weather": other days of the same season, whole weeks in a row, or the other years of T;
        - "model": another FE model of ``models`` in the chain;
        - "all": all of these, without "model" if there are no ``models`` and none can be drawn.

        Beside the repeats, this takes ``n_replicates`` replicates, in each of which all of it is drawn at once. On one
        core, a year of days of the truss in 13 scenarios with one detector takes 2 s with the noise alone, which is
        enough to compare detectors, 19 s with "baseline" and "weather", and 42 s with "all", where 20 chains are
        refitted.
    models : sequence of FE models, optional
        Which the structure may have, with parameters, damage groups and modes like the chain's. By default
        `~skthermo.updating.ModelUpdater.sample_models` draws ``n_replicates`` from the mean of the training records,
        as it was measured, to which a perfect model would come within 0.5 %; stiffnesses are known to 15 % before.
    n_replicates : int, default=20
        How many replicates the bands stand on.
    n_jobs : int, optional
        Number of parallel jobs (joblib), which share the repeats and the replicates. Results do not depend on it.
    random_state : int, RandomState or None, default=None
        Seed of noise, gaps and outliers, of replicates, and of parts of detectors without a seed of their own.
    verbose : bool or int, default=0
        Whether `run` prints a line with the time of each of its stages; from 2, joblib prints how many repeats
        and replicates are done.

    Attributes
    ----------
    findings_ : StudyFindings
        All that the last `run` found, which nothing changes afterwards; the attributes and methods below read it.
    results_ : DataFrame
        What `run` returned.
    detectors_ : dict of str to detector
        The fitted clones by name, without those that failed.
    thresholds_ : dict of str to (float or None)
        Damage index above which there is an alarm, where the detector has one.
    indices_ : dict of (str, str, str) to Series
        Damage index of the records of the first repeat, by detector, scenario and source.
    decisions_ : dict of (str, str, str) to ndarray of shape (n_repeats, n_records)
        Threshold less damage index in every repeat, by detector, scenario and source: negative is an alarm, and NaN is
        not evaluated. As float32: eight detectors, 13 scenarios, 20 repeats and 365 records are 3 MB; 17 detectors and
        a year of hours 155 MB.
    transitions_ : dict of (str, str, str) to ndarray of shape (n_repeats, n_onsets, n_window)
        Such decisions of detectors with windows, such as `~skthermo.detection.WindowedAlarm`, after onsets of damage
        with two windows from one to the next, while a window still holds healthy records; for `time_to_detection`.
    calibration_ : dict of (str, str) to ndarray of shape (n_repeats, n_records)
        Such decisions on healthy records with noise of other seeds, by detector and source, if a scenario is healthy.
        `ranking` moves thresholds by them; nothing else is judged by them. Measured records have none.
    arrangements_ : dict of str to object
        Columns that each detector sees, and the number of healthy records that it has learned.
    uncertainty_ : DataFrame or None
        Indexed by detector and scenario: standard deviation of the rate due to each part of ``uncertainty`` ("noise",
        "weather", "baseline", "model") and to all ("together"), and the share of each in the variance ("model share").
        None where the bands hold the noise alone.
    replicates_ : ReplicateRates or None
        Rates of alarms in every replicate, ``replicates_.rates[detector, scenario]`` of shape (n_replicates, n_parts,
        n_draws), where each of ``replicates_.parts`` is added to those before it.
    scenarios_ : list of scenarios
        With those that were given as mappings.
    errors_ : dict of str to str
        Error of each detector that failed.
    confidence_ : float
        Of the bounds in ``results_``.
    warnings_ : list of str
        Texts of the warnings that the simulations gave.

    See Also
    --------
    pod_curve : The curve over severity.
    compare_extensions : What would make smaller damage detectable.

    Notes
    -----
    All scenarios and sources have the same weather, and repeat r has the same noise, gaps and outliers in all scenarios
    (common random numbers), and all detectors judge the same records, so that differences between scenarios or
    detectors are more certain than each rate. A detector's rates do not depend on which others are in the study.

    The bounds ``ci_low`` and ``ci_high`` are those of a rate over noise, for this weather, this baseline and this
    model: another year, another baseline or an error of the model is not in them, but in the bands, as far as
    ``uncertainty`` says so. Records are serially dependent: the effective number of records is their number over the
    design effect, the ratio of the variance of the rate, estimated from sums over blocks of ten correlation times in
    different repeats, to that of independent records. With it, Clopper-Pearson bounds keep their confidence also for
    rates of 0 and 1 [KG98]_. Measured records are one repeat only; their variance between blocks of time holds that of
    the weather, too.

    A replicate is a structure that could have given the training records. The detectors have learned measured records,
    and stay: what a chain does not know of the structure moves records away from what they have learned. Bands are
    those of Student's law on the scale of the logit, with the variances between and within replicates (three draws of
    the noise in each), about the study's own rate, moved by the mean effect of other weather and models.
    ``tests/benchmarks/study_bands.py`` measures how often they hold what a measured campaign shows.

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
    >>> options = {"n_repeats": 5, "uncertainty": "noise", "random_state": 0}
    >>> study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, **options)
    >>> results = study.run(weather)
    >>> results[["scenario", "measure", "rate"]].round(1)
          scenario measure  rate
    0      healthy     PFA   0.0
    1  bottom 10 %     POD   0.2
    2  bottom 20 %     POD   0.9
    3  bottom 30 %     POD   1.0
    >>> float(study.minimum_detectable_damage().loc[("bottom", "simulated"), "mdd"])
    0.2
    """

    def __init__(
        self,
        fem: Any,
        detectors: Any,
        scenarios: Sequence[BaseScenario | Mapping[str, float]],
        *,
        n_repeats: int = 20,
        noise: ArrayLike | Literal["fitted"] = "fitted",
        gaps: float | Literal["fitted"] | None = "fitted",
        outliers: ArrayLike | Literal["fitted"] | None = "fitted",
        uncertainty: Literal["all"] | Sequence[str] = "all",
        models: Sequence[Any] | None = None,
        n_replicates: int = 20,
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
        verbose: bool | int = 0,
    ):
        self.fem = fem
        self.detectors = detectors
        self.scenarios = scenarios
        self.n_repeats = n_repeats
        self.noise = noise
        self.gaps = gaps
        self.outliers = outliers
        self.uncertainty = uncertainty
        self.models = models
        self.n_replicates = n_replicates
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose

    results_ = _found_attribute("table")
    detectors_ = _found_attribute("detectors")
    thresholds_ = _found_attribute("thresholds")
    indices_ = _found_attribute("indices")
    decisions_ = _found_attribute("decisions")
    transitions_ = _found_attribute("transitions")
    calibration_ = _found_attribute("calibration")
    arrangements_ = _found_attribute("arrangements")
    uncertainty_ = _found_attribute("uncertainty")
    replicates_ = _found_attribute("replicates")
    scenarios_ = _found_attribute("scenarios")
    errors_ = _found_attribute("errors")
    confidence_ = _found_attribute("confidence")
    warnings_ = _found_attribute("warnings")

    def run(
        self,
        T: ArrayLike | Sequence[ArrayLike],
        baseline: ArrayLike | None = None,
        *,
        reference: Reference | None = None,
        confidence: float = 0.95,
    ) -> pd.DataFrame:
        """Simulate all scenarios, and count alarms.

        Parameters
        ----------
        T : array-like or DataFrame of shape (n_records, n_sensors), or sequence of them
            Temperatures in degrees Celsius under which the structure is simulated, in order of time. Of several years,
            the first is simulated in all repeats, and replicates take one after the other, on the stamps of the first.
            Of one, replicates resample days: give a year or more, without stamps a whole number of years.
        baseline : array-like or DataFrame, optional
            Measured frequencies of the healthy structure, or temperatures and frequencies side by side, which the
            detectors learn. They see the same columns of simulated records; detectors of which no part has ``targets``,
            as `~skthermo.detection.TemperatureCompensator` has, see the frequencies alone. By default the records that
            the chain was fitted on.
        reference : mapping or callable, optional
            Truth to compare with: by name of the scenario, measured frequencies, which may have other rows than T, and
            then temperatures of their own beside them where a detector sees temperatures; or a function of a
            scenario and an integer seed, which returns frequencies for the rows of T, or None, and is called once in
            every repeat for each scenario, and once more for the healthy one, by which thresholds are moved.
        confidence : float, default=0.95
            Of the bounds of the rates, two-sided.

        Returns
        -------
        DataFrame
            One row for each detector, scenario and source:

            - ``detector``;
            - ``scenario``, ``family``, ``severity``;
            - ``source``: "simulated" (simulated) or "reference";
            - ``measure``: "PFA", the probability of false alarm, of a healthy structure, else "POD", the probability of
              detection, from the onset of the damage on;
            - ``rate``, ``ci_low``, ``ci_high``: share of records in alarm, and its bounds;
            - ``pi_low``, ``pi_high``: band of single campaigns, in which the rate of a measured one of this
              length and state should lie with the probability ``confidence``, with all that ``uncertainty`` names. With
              the noise alone, it is the range of the rates of single repeats: fewer than 39 are too few for 95 %, as
              the range of all n holds it with (n - 1) / (n + 1), and a single one has none (NaN). That of reference
              records holds their noise alone;
            - ``n_alarms``, ``n_records``, ``n_effective``, ``n_repeats``: counts over all repeats, of records that the
              detector can judge;
            - ``n_not_evaluated``: number of records that it cannot judge, which count neither as healthy nor as alarms;
            - ``time_to_detection``: from the onset or the first record to the first alarm, in records or, for frames on
              a ``DatetimeIndex``, in time; the mean over those repeats that have an alarm;
            - ``error``: "" where all is well. A detector that fails has one row with its error, and NaN elsewhere.

        Raises
        ------
        ValueError
            If names of scenarios repeat, a damage group is unknown, columns do not fit, or no record can be judged; if
            most replicates fail, or "model" is asked for and no models can be drawn. An error of a detector is raised
            if it is the only one, or if all fail.

        Warns
        -----
        UserWarning
            Once for each kind of doubt about the simulations, such as weather outside the training range; if most
            records of the healthy structure raise an alarm; if some replicates fail, or no models can be drawn.
            Detectors are named where there are several.
        """
        check_chain(self.fem)
        detectors = self._checked_detectors()
        n_repeats = positive_integer(self.n_repeats, "n_repeats")
        check_probability(confidence, "confidence")
        check_jobs(self.n_jobs)
        scenarios = self._checked_scenarios(reference)
        seeds = as_random_state(self.random_state).randint(LARGEST_SEED, size=(n_repeats, 2))
        function, measured = (reference, {}) if callable(reference) else (None, reference or {})
        replicates = Replicates.of(self.fem, self.uncertainty, T, self.models, self.n_replicates, seeds[0])
        T = replicates.years[0]
        judgement, stages = Judgement(), Stages(self, 4 + bool(replicates.parts))
        with stages.stage("detectors"), warnings_once("in the fits of the detectors"), checked_once():
            parts = seeded(self.random_state)
            candidates = judgement.ask(
                detectors, lambda name: Candidate.learned(name, detectors[name], self.fem, baseline, parts)
            )
        with warnings_once("in the simulations of this study") as texts, single_blas_thread():
            with stages.stage("frequencies"):
                clean = clean_frequencies(self.fem, scenarios, T, n_repeats)
            measurement = Measurement.asked(self.fem, self.noise, self.gaps, self.outliers)
            simulation = Simulation(self.fem, candidates, scenarios, T, clean, measurement, function)
            with stages.stage("first repeat"):
                simulation.first_repeat(judgement, measured, seeds[0])
        with stages.stage(f"other {n_repeats - 1} repeats"):
            simulation.other_repeats(judgement, seeds, self.n_jobs, verbose=max(self.verbose - 1, 0))
        rates = None
        if replicates.parts:
            with stages.stage(f"{len(replicates.seeds)} replicates"):
                left = simulation.without(judgement.errors)
                rates = ReplicateRates.of(left, judgement, replicates, self.n_jobs, max(self.verbose - 1, 0))
        self.findings_ = StudyFindings.of(judgement, candidates, scenarios, list(detectors), rates, confidence, texts)
        doubt = self.findings_.many_false_alarms()
        if doubt:
            self.findings_ = replace(self.findings_, warnings=[*texts, doubt])
            warn_user(doubt, "many false alarms")
        return self.findings_.table

    def pod_curve(
        self, family: str, source: str = "simulated", *, log: bool = False, detector: str | None = None
    ) -> PODCurve:
        """Probability of detection over severity for one family of scenarios.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="simulated"
            "simulated" or "reference".
        log : bool, default=False
            Whether the logit is linear in the logarithm of the severity.
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        PODCurve
            Records count as their effective numbers, so that serial correlation is in its bounds. Its `PODCurve.band`
            and ``a90_band`` hold all that ``uncertainty`` names.

        Raises
        ------
        ValueError
            If there is no such family, the curve cannot be fitted, or there are several detectors and none is named.

        Warns
        -----
        UserWarning
            If the curve has no finite slope, or lies outside the bounds of some tested severities.
        """
        return self._found().pod_curve(family, source, log=log, detector=detector)

    def minimum_detectable_damage(
        self, level: float = 0.9, method: Literal["grid", "curve"] = "grid", detector: str | None = None
    ) -> pd.DataFrame:
        """Smallest severity that is detected reliably, for every family and source.

        Parameters
        ----------
        level : float, default=0.9
            Probability of detection that counts as reliable.
        method : {"grid", "curve"}, default="grid"
            Of the tested severities the smallest from which the rate stays at or above the level (bounds: the same for
            the upper and the lower bounds of the rates); or where the fitted curve and its two-sided bounds reach it.
        detector : str, optional
            Name of one of several detectors; by default all.

        Returns
        -------
        DataFrame
            Indexed by family and source, and first by detector where there are several, with ``mdd``, ``ci_low`` and
            ``ci_high``: NaN or infinite where the level is not reached. Where a curve has no finite slope, the POD does
            not increase, or a family has one severity only, ``mdd`` is NaN and the bounds are the two tested severities
            between which it lies. Detectors that failed are left out. With replicates, also ``pi_low`` and
            ``pi_high``, between which that of a measured campaign should lie: quantiles over the replicates, infinite
            if the level may not be reached.

        Raises
        ------
        ValueError
            If there is no family, the level is not between 0 and 1, a family has both damage and strengthening, or
            there is no such detector.

        Warns
        -----
        UserWarning
            If a curve has no finite slope or lies outside the bounds of some tested severities, or there is none
            because the POD does not increase. Of texts that differ in their numbers only, the first is given.
        """
        return self._found().minimum_detectable_damage(level, method, detector)

    def time_to_detection(
        self,
        within: Sequence[str | int] | None = None,
        level: float = 0.95,
        *,
        source: str = "simulated",
        confidence: float | None = None,
        detector: str | None = None,
        smallest: bool = False,
    ) -> pd.DataFrame:
        """How soon damage is found: the chance to find it within some times, and the time within which it is found.

        Damage may begin at any time of the records, so that each season counts with its own weather: all onsets count
        alike, and after the last record comes the first one again. The damage of a scenario with an onset of its own
        begins there. It is found with the first alarm.

        Parameters
        ----------
        within : sequence of str or int, optional
            Times such as "7D", or numbers of records where the weather has no ``DatetimeIndex``. By default a day, a
            week and 30 days, or 1, 7 and 30 records.
        level : float, default=0.95
            Share of the cases in which damage is found reliably.
        source : str, default="simulated"
            "simulated" or "reference".
        confidence : float, optional
            Of the bounds, two-sided; by default that of the study.
        detector : str, optional
            Name of one of several detectors; by default all.
        smallest : bool, default=False
            Whether to give only one row for each detector and family: the smallest severity that is found reliably
            within the longest of the times, or the largest one where none is.

        Returns
        -------
        DataFrame
            One row for each detector and scenario:

            - ``detector``, ``scenario``, ``family``, ``severity``, ``source``;
            - for each time such as "7D": ``7D``, the probability of an alarm within it; ``7D ci_low`` and
              ``7D ci_high``, its bounds; ``7D healthy``, the probability that the healthy structure raises an alarm
              within the same time, which would have come without damage, too (NaN without a healthy scenario). NaN
              where the time is shorter than that between two records, or longer than all of them;
            - ``median``: time within which half of the cases are found;
            - ``reliable``: the same for the share ``level``, and ``reliable highest``: time from which the lower
              bound of the probability is as high. NaT (NaN) where that takes longer than the records;
            - ``not_judged``: share of the time without a record that is judged, which delays what is found;
            - ``text``: in words, after the name of the scenario.

            Times are counted in the usual time between records, from the one before the onset on. They are numbers of
            records where there are no stamps.

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If a time is none, the level is not between 0 and 1, or there is no such source or detector.

        Notes
        -----
        A probability is the share of onsets in all repeats. Those next to each other wait for the same alarm: bounds
        allow for this dependence as those of rates do. They hold the noise alone, as all of the study's.

        An alarm within the time may be a false one: compare the two probabilities. With a probability h of the
        healthy structure, damage that changes nothing is "found" in the share h of the cases.

        Windows that begin before the damage and end in it are judged as such, at the onsets of ``transitions_``, which
        are fewer.

        Examples
        --------
        >>> from skthermo.datasets import make_truss, make_truss_campaign
        >>> from skthermo.detection import MahalanobisDetector
        >>> from skthermo.studies import DetectabilityStudy, sweep
        >>> from skthermo.surrogate import DataInformedFEM
        >>> year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
        >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
        >>> scenarios = sweep(fem, (0.1, 0.2), groups=["bottom"])
        >>> options = {"n_repeats": 5, "uncertainty": "noise", "random_state": 0}
        >>> study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, **options)
        >>> results = study.run(weather)
        >>> waits = study.time_to_detection(["1D", "7D"]).set_index("scenario")
        >>> waits[["1D", "7D", "7D ci_low", "7D ci_high", "7D healthy"]].round(2)
                       1D    7D  7D ci_low  7D ci_high  7D healthy
        scenario
        healthy      0.02  0.10       0.07        0.16         0.1
        bottom 10 %  0.22  0.83       0.79        0.86         0.1
        bottom 20 %  0.93  1.00       0.99        1.00         0.1
        >>> waits[["median", "reliable"]]
                     median reliable
        scenario
        healthy     50 days 274 days
        bottom 10 %  3 days  13 days
        bottom 20 %  1 days   2 days
        """
        return self._found().time_to_detection(
            within, level, source=source, confidence=confidence, detector=detector, smallest=smallest
        )

    def is_undetected(self, family: str, source: str = "simulated", detector: str | None = None) -> bool:
        """Whether no severity of a family raises clearly more alarms than the healthy structure does.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="simulated"
            "simulated" or "reference".
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        bool
            True if no rate is above the highest upper bound of the rates of false alarms.

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If there is no such family or source, or there are several detectors and none is named.
        """
        return self._found().is_undetected(family, source, detector)

    def ranking(
        self,
        max_false_alarms: float = 0.02,
        source: str = "simulated",
        confidence: float | None = None,
        *,
        by: Literal["pod", "pod_at_equal_pfa"] = "pod",
    ) -> pd.DataFrame:
        """Detectors in the order of what they find, with what is not significant.

        First stand those that keep the limit of false alarms, in the order of their probability of detection (POD),
        then the others, those with the fewest false alarms first.

        Parameters
        ----------
        max_false_alarms : float, default=0.02
            Limit of the share of healthy records in alarm.
        source : str, default="simulated"
            "simulated" or "reference".
        confidence : float, optional
            Of the bounds, two-sided; by default that of the study.
        by : {"pod", "pod_at_equal_pfa"}, default="pod"
            What is compared: detectors as they are, or with thresholds moved to equal false alarms.

        Returns
        -------
        DataFrame
            One row for each detector, indexed by ``detector``, best first, those that failed last:

            - ``false_alarms``, ``false_alarms_ci_low``, ``false_alarms_ci_high``: rate and bounds, means over the
              healthy scenarios;
            - ``within_limit``: False only where the lower bound is above the limit;
            - ``pod``, ``pod_ci_low``, ``pod_ci_high``: the same of the damaged scenarios;
            - ``pod_at_equal_pfa``: POD with the threshold moved so that the share of ``calibration_`` in alarm is the
              limit
              (less where indices are tied); NaN for measured records, which have no calibration;
            - ``pod_deficit``, ``pod_deficit_ci_low``, ``pod_deficit_ci_high``: POD of the first row less that of this
              one, by the
              measure of the order; the bounds hold for all rows together, and are NaN where there is one repeat;
            - ``significantly_worse``: whether the lower bound is above 0. The choice among the others is not
              significant;
            - ``auc``: area under the ROC curve, the mean over the damaged scenarios; 0.5 is chance;
            - ``time_to_detection``: mean over the damaged scenarios; NaN where one of them raises no alarm;
            - ``not_judged``: share of the records that the detector cannot judge, which count nowhere else;
            - for each family ``pod FAMILY``, ``pod FAMILY ci_low``, ``pod FAMILY ci_high`` and ``mdd FAMILY``, the
              minimum detectable damage at a POD of 0.9 (NaN: not reached, or the severities have no order);
            - ``error``: "", or the error of a detector that failed.

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If no scenario of this source is healthy, or none is damaged, or ``by="pod_at_equal_pfa"`` and there are no
            healthy records to move thresholds by.

        Notes
        -----
        The default order is by detectors as they will be used. On the truss, simulation and truth agree on it better
        than on the order at equal false alarms: simulated noise is resampled from the records that the detectors have
        learned, so that those that overfit them need too low a threshold in the simulation.

        Differences are paired: all detectors judge the same records in every repeat (common random numbers). Their
        bounds are t intervals of jackknife pseudo-values over the repeats, which hold the error of the moved threshold,
        too, with Bonferroni's correction for all comparisons with the first row. They hold the noise alone: neither
        another baseline nor an error of the model is in them. A threshold learned from n independent records at 2 %
        has itself a true rate with a standard deviation of sqrt(0.02 * 0.98 / n), 0.7 points for a year of days.

        Examples
        --------
        >>> from sklearn.ensemble import IsolationForest
        >>> from skthermo.datasets import make_truss, make_truss_campaign
        >>> from skthermo.detection import MahalanobisDetector, OutlierDetector
        >>> from skthermo.studies import DetectabilityStudy
        >>> from skthermo.surrogate import DataInformedFEM
        >>> year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
        >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
        >>> detectors = {"forest": OutlierDetector(IsolationForest()), "Mahalanobis": MahalanobisDetector()}
        >>> options = {"n_repeats": 5, "uncertainty": "noise", "random_state": 0}
        >>> study = DetectabilityStudy(fem, detectors, [{}, {"bottom": 0.1}], **options)
        >>> results = study.run(weather)
        >>> study.ranking()[["false_alarms", "pod", "pod_at_equal_pfa", "significantly_worse"]].round(2)
                     false_alarms   pod  pod_at_equal_pfa  significantly_worse
        detector
        Mahalanobis          0.02  0.22              0.21                False
        forest               0.02  0.18              0.17                False
        >>> print(study.summary())
        'Mahalanobis' finds 21.9% of the damaged records at 1.6% false alarms.
        Not clearly worse: 'forest' (17.8% at 1.6%).
        This holds the noise alone: other weather, another baseline or an error of the model may change the order.
        'healthy' raises a false alarm within 1 day in 2, within 7 days in 10, within 30 days in 37 of 100 cases.
        'bottom 10 %' is found within 13 days in 95 of 100 cases; a healthy structure alarms by then in 18 of 100.
        """
        return self._found().ranking(max_false_alarms, source, confidence, by=by)

    def labelled_scores(
        self, detector: str | None = None, source: str = "simulated", scenarios: Sequence[str] | None = None
    ) -> tuple[NDArray[np.bool_], Array]:
        """Which records are damaged, and how suspicious a detector finds them, as scikit-learn's curves take them.

        Parameters
        ----------
        detector : str, optional
            Name of the detector, where there are several.
        source : str, default="simulated"
            "simulated" or "reference".
        scenarios : sequence of str, optional
            Damaged states whose records are put together, from the onset of damage on; by default all.

        Returns
        -------
        is_damaged : ndarray of shape (n_records,)
            Records of all repeats; those that are not evaluated are left out.
        scores : ndarray of shape (n_records,)
            Minus the decision function: positive is an alarm.

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If the detector is not known, or it has judged no healthy or no damaged records of these scenarios.

        Examples
        --------
        Found damage over false alarms, for all thresholds, is ``RocCurveDisplay.from_predictions(
        *study.labelled_scores("raw"), name="raw")`` of scikit-learn.
        """
        return self._found().labelled_scores(detector, source, scenarios)

    def summary(self, max_false_alarms: float = 0.02, source: str = "simulated") -> str:
        """Which detector finds most, and which are not clearly worse, in plain sentences.

        Parameters
        ----------
        max_false_alarms : float, default=0.02
            Limit of the share of healthy records in alarm.
        source : str, default="simulated"
            "simulated" or "reference".

        Returns
        -------
        str
            What `ranking` says, a line for each group of detectors, and what `time_to_detection` says of the first
            one: of the healthy structure, and of each family the smallest severity that is found reliably.

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            As `ranking`.
        """
        return self._found().summary(max_false_alarms, source)

    def uncertainty_summary(self, detector: str | None = None) -> str:
        """What the bands hold, and which part of the widest one is the largest, in plain sentences.

        Parameters
        ----------
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        str
            A line on what the bands hold, one on the scenario with the widest band, and one on rates that are outside
            their bands, as those of a model that the training records contradict are.

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If there are several detectors and none is named, or the one that is named has no results.
        """
        return self._found().uncertainty_summary(detector)

    def detector_name(self, detector: str | None = None) -> str:
        """Name of the only detector, or a name that is known.

        Parameters
        ----------
        detector : str, optional
            Needed where there are several.

        Returns
        -------
        str
            Of a detector that has results.

        Raises
        ------
        NotFittedError
            If the study has no results.
        ValueError
            If there are several detectors and none is named, or the one that is named has no results.
        """
        return self._found().detector_name(detector)

    def _found(self) -> StudyFindings:
        if not hasattr(self, "findings_"):
            raise NotFittedError("the study has no results yet; expected a call of run before")
        return self.findings_

    def _checked_detectors(self) -> dict[str, Any]:
        """Detectors by name; an error for what is none."""
        if not isinstance(self.detectors, Mapping):
            check_detector(self.detectors, "the detector")
            return {type(last_step(self.detectors)).__name__: self.detectors}
        if not self.detectors or not all(isinstance(name, str) and name for name in self.detectors):
            raise ValueError(
                f"detectors is {self.detectors!r:.200}; expected a detector, or a mapping of names to detectors"
            )
        for name, detector in self.detectors.items():
            check_detector(detector, f"detector {name!r}")
        return dict(self.detectors)

    def _checked_scenarios(self, reference: Any) -> list[BaseScenario]:
        """The scenarios; an error if they or the names of the reference are wrong."""
        scenarios = read_scenarios(self.scenarios, self.fem.model)
        names = [scenario.name for scenario in scenarios]
        if reference is not None and not callable(reference) and not isinstance(reference, Mapping):
            raise ValueError(
                f"reference is {reference!r:.200}; expected {{name of scenario: frequencies}} or a function"
            )
        unknown = [name for name in reference if name not in names] if isinstance(reference, Mapping) else []
        if unknown:
            raise ValueError(f"reference has the scenarios {unknown}; expected some of {names}")
        return scenarios

    def __sklearn_clone__(self) -> DetectabilityStudy:
        many = isinstance(self.detectors, Mapping)
        twins = {k: clone(one) for k, one in self.detectors.items()} if many else clone(self.detectors)
        return type(self)(**self.get_params(deep=False) | {"detectors": twins})  # the chain is fitted, and shared


def check_detector(detector: Any, what: str) -> None:
    """Raise an error for what is not an outlier detector."""
    needed = ("get_params", "fit", "decision_function", "score_samples")
    lacking = [name for name in needed if not hasattr(detector, name)]
    if isinstance(detector, type) or lacking:
        without = f", without {lacking}" if lacking else ", a class"
        raise ValueError(f"{what} is {detector!r:.200}{without}; expected an outlier detector")
