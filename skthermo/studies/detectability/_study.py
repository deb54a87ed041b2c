"""DetectabilityStudy: which damage detectors would find in this structure's weather."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial, wraps
from time import process_time
from typing import Any, Concatenate, Literal, ParamSpec, TypeAlias, TypeVar

import numpy as np
import pandas as pd
from joblib import Memory
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import NotFittedError

from skthermo._core.arrays import as_random_state, check_jobs, check_probability, is_auto, positive_integer
from skthermo._core.estimators import Stages, held, last_step, seeded
from skthermo._core.parallel import single_blas_thread
from skthermo._core.warnings import warn_each, warnings_once
from skthermo.exceptions import ResultWarning
from skthermo.fem import FEModel
from skthermo.studies._scenarios import BaseScenario, check_chain, read_scenarios
from skthermo.studies.detectability._findings import StudyFindings
from skthermo.studies.detectability._replicates import ReplicateRates, Replicates
from skthermo.studies.detectability._simulation import (
    LARGEST_SEED,
    Candidate,
    Evaluation,
    Measurement,
    Simulation,
    ask_each,
    clean_frequencies,
)
from skthermo.surrogate import DataInformedFEM

LEAST_REPEATS, MOST_REPEATS = 3, 20

Reference: TypeAlias = Mapping[str, Any] | Callable[[Any, int], Any]
P, Answer = ParamSpec("P"), TypeVar("Answer")


def _of_findings(method: Callable[Concatenate[StudyFindings, P], Answer]) -> Callable[Concatenate[Any, P], Answer]:
    """A method of a study that its last run's findings answer, with their docstring and signature."""

    @wraps(method)
    def answer(study: Any, *args: P.args, **options: P.kwargs) -> Answer:
        return method(study._found, *args, **options)

    return answer


class DetectabilityStudy(BaseEstimator):
    """Simulated test of detectors: which damage each would find, and how often it would raise false alarms.

    A fitted chain simulates the structure in every scenario under the same weather, and detectors that have learned the
    healthy structure evaluate the records, all of them the same.

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
    n_repeats : int or "auto", default="auto"
        How often the records are simulated, each time with other noise. "auto" takes 3 repeats, and as many more, up to
        20 in all, as it takes until the bounds of each rate are within ``tol``. With the noise alone, whose bands are
        the range of the repeats, it takes 20.
    tol : float, default=0.02
        Half of the distance between ``ci_low`` and ``ci_high`` that is small enough, as a share of the records; for
        "auto" alone.
    noise : float, array-like of shape (n_modes,) or "fitted", default="fitted"
        Of the simulated frequencies, as in `~skthermo.surrogate.DataInformedFEM.simulate`.
    gaps : float, "fitted" or None, default="fitted"
        Values that are missing in the simulated records, as in `~skthermo.surrogate.DataInformedFEM.simulate`. With
        "fitted", detectors that see temperatures also see them with the gaps of the training records.
    outliers : float, "fitted", None or array-like of shape (n_training_records, n_modes), default="fitted"
        Values that are far off, as in `~skthermo.surrogate.DataInformedFEM.simulate`.
    uncertainty : {"auto", "all", "noise", "baseline", "weather", "model"} or sequence of them, default="auto"
        What the prediction intervals include, in which the rate of a measured campaign should lie:

        - "noise": another draw of the noise;
        - "baseline": the training records could have been others (`~skthermo.surrogate.resampled`), so
          that the structure is another one than the chain, and have had other gaps and outliers; the detectors stay as
          they are, as they would in service;
        - "weather": other days of the same season, whole weeks in a row, or the other years of T;
        - "model": another FE model of ``models`` in the chain;
        - "auto": "noise", "baseline" and "weather", and "model" if ``models`` are given;
        - "all": all of these, without "model" if there are no ``models`` and none can be drawn.

        In each of ``n_replicates`` replicates, all of it is drawn at once. The noise alone is enough to compare
        detectors; "model" takes longest, since a chain is refitted for each replicate.
    models : sequence of FE models, optional
        Which the structure may have, with parameters, damage groups and modes like the chain's. By default
        `~skthermo.updating.ModelUpdater.sample_models` draws ``n_replicates`` from the mean of the training records,
        as it was measured, to which a perfect model would come within 0.5 %; stiffnesses are known to 15 % before.
    n_replicates : int, default=10
        How many replicates the bands are computed from.
    n_jobs : int, optional
        Number of parallel jobs (joblib), which share the repeats and the replicates. Results do not depend on it.
    random_state : int, RandomState or None, default=None
        Seed of noise, gaps and outliers, of replicates, and of parts of detectors without a seed of their own.
    memory : str or joblib.Memory, optional
        Folder that keeps what detectors have learned, so that other studies in which they learn the same baseline do
        not fit them again.
    verbose : bool or int, default=0
        Whether `run` prints a line with the time of each of its stages, and after the second repeat how long the others
        and the replicates will take; from 2, joblib prints how many of them are done.

    Attributes
    ----------
    findings_ : StudyFindings
        All that the last `run` found, which nothing changes afterwards; the attributes below are its, and so are all
        methods but `run`, which raise a ``NotFittedError`` before.
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
    calibration_ : dict of (str, str) to ndarray of shape (n_repeats, n_records)
        Such decisions on healthy records with noise of other seeds, by detector and source, if a scenario is healthy.
        `ranking` moves thresholds by them; nothing else is evaluated by them. Measured records have none.
    columns_ : dict of str to list
        Names of the columns that each detector sees.
    uncertainty_ : DataFrame or None
        Indexed by detector and scenario: standard deviation of the rate due to each part of ``uncertainty`` ("noise",
        "weather", "baseline", "model") and to all ("together"), and the share of each in the variance ("model share").
        None where the bands include the noise alone.
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
    Repeat r has the same weather, noise, gaps and outliers in all scenarios (common random numbers), and all detectors
    evaluate the same records, so that differences between scenarios or detectors are more certain than each rate. A
    detector's rates do not depend on which others are in the study.

    The bounds ``ci_low`` and ``ci_high`` are of a rate over noise [KG98]_, the bands ``pi_low`` and ``pi_high`` of one
    measured campaign: :ref:`how-rates-are-bounded`.

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
        fem: DataInformedFEM,
        detectors: Any,
        scenarios: Sequence[BaseScenario | Mapping[str, float]],
        *,
        n_repeats: int | Literal["auto"] = "auto",
        tol: float = 0.02,
        noise: ArrayLike | Literal["fitted"] = "fitted",
        gaps: float | Literal["fitted"] | None = "fitted",
        outliers: ArrayLike | Literal["fitted"] | None = "fitted",
        uncertainty: Literal["auto", "all"] | Sequence[str] = "auto",
        models: Sequence[FEModel] | None = None,
        n_replicates: int = 10,
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
        memory: str | Memory | None = None,
        verbose: bool | int = 0,
    ):
        self.fem = fem
        self.detectors = detectors
        self.scenarios = scenarios
        self.n_repeats = n_repeats
        self.tol = tol
        self.noise = noise
        self.gaps = gaps
        self.outliers = outliers
        self.uncertainty = uncertainty
        self.models = models
        self.n_replicates = n_replicates
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.memory = memory
        self.verbose = verbose

    results_ = held("_found.table")
    detectors_ = held("_found.detectors")
    thresholds_ = held("_found.thresholds")
    indices_ = held("_found.evaluation.indices")
    decisions_ = held("_found.evaluation.decisions")
    calibration_ = held("_found.evaluation.calibration")
    columns_ = held("_found.columns")
    uncertainty_ = held("_found.uncertainty")
    replicates_ = held("_found.replicates")
    scenarios_ = held("_found.scenarios")
    errors_ = held("_found.errors")
    confidence_ = held("_found.confidence")
    warnings_ = held("_found.warnings")

    pod_curve = _of_findings(StudyFindings.pod_curve)
    minimum_detectable_damage = _of_findings(StudyFindings.minimum_detectable_damage)
    is_undetected = _of_findings(StudyFindings.is_undetected)
    ranking = _of_findings(StudyFindings.ranking)
    labelled_scores = _of_findings(StudyFindings.labelled_scores)
    summary = _of_findings(StudyFindings.summary)
    uncertainty_summary = _of_findings(StudyFindings.uncertainty_summary)
    detector_name = _of_findings(StudyFindings.detector_name)

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
              records includes their noise alone;
            - ``n_alarms``, ``n_records``, ``n_effective``, ``n_repeats``: counts over all repeats, of records that the
              detector can evaluate;
            - ``n_not_evaluated``: number of the other records, which count neither as healthy nor as alarms;
            - ``time_to_detection``: from the onset or the first record to the first alarm, in records or, for frames on
              a ``DatetimeIndex``, in time; the mean over those repeats that have an alarm;
            - ``error``: "" where all is well. A detector that fails has one row with its error, and NaN elsewhere.

        Raises
        ------
        ValueError
            If names of scenarios repeat, a damage group is unknown, columns do not fit, or no record can be evaluated;
            if most replicates fail, or "model" is asked for and no models can be drawn. An error of a detector is
            raised if it is the only one, or if all fail.

        Warns
        -----
        UserWarning
            Once for each kind of doubt about the simulations, such as weather outside the training range; if most
            records of the healthy structure raise an alarm; if some replicates fail, or no models can be drawn.
            Detectors are named where there are several.
        """
        check_chain(self.fem)
        detectors = self._checked_detectors()
        most_repeats = MOST_REPEATS if is_auto(self.n_repeats) else positive_integer(self.n_repeats, "n_repeats")
        tol = check_probability(self.tol, "tol")
        check_probability(confidence, "confidence")
        check_jobs(self.n_jobs)
        scenarios = self._checked_scenarios(reference)
        seeds = as_random_state(self.random_state).randint(LARGEST_SEED, size=(most_repeats, 2))
        function, measured = (reference, {}) if callable(reference) else (None, reference or {})
        replicates = Replicates.of(self.fem, self.uncertainty, T, self.models, self.n_replicates, seeds[0])
        T = replicates.years[0]
        stages = Stages(self, 5 + bool(replicates.parts))
        with stages.stage("detectors"), warnings_once("in the fits of the detectors"):
            learned = partial(Candidate.learned, self.fem, baseline, seeded(self.random_state), self.memory)
            candidates, errors = ask_each(detectors, lambda name: learned(detectors[name]), {})
        with warnings_once("in the simulations of this study") as texts, single_blas_thread():
            with stages.stage("frequencies"):
                warn_each(self.fem.thermal_.doubts(self.fem.weather(T)))
                clean = clean_frequencies(self.fem, scenarios, T, most_repeats)
            measurement = Measurement.asked(self.fem, self.noise, self.gaps, self.outliers)
            simulation = Simulation(self.fem, candidates, scenarios, T, clean, measurement, function)
            with stages.stage("first repeat"):
                first = simulation.evaluated([(0, seeds[0])], errors, measured)
        evaluation = self._with_repeats(simulation, first, replicates, seeds, stages, (tol, confidence))
        rates = None
        if replicates.parts:
            with stages.stage(f"{len(replicates.seeds)} replicates"):
                left = simulation.without(evaluation.errors)
                rates = ReplicateRates.of(left, evaluation, replicates, self.n_jobs, max(self.verbose - 1, 0))
        found = StudyFindings.of(evaluation, candidates, scenarios, list(detectors), rates, confidence, texts)
        doubt = found.many_false_alarms()
        doubts = [ResultWarning(doubt, "many-false-alarms")] if doubt else []
        self.findings_ = replace(found, warnings=[*texts, *map(str, doubts)])
        warn_each(doubts)
        return self.findings_.table

    def _with_repeats(
        self,
        simulation: Simulation,
        first: Evaluation,
        replicates: Replicates,
        seeds: Any,
        stages: Stages,
        bounds: tuple[float, float],
    ) -> Evaluation:
        """The evaluation of the first repeat with all others: as many as asked for or, for "auto", as bounds need."""
        left, progress = simulation.without(first.errors), max(self.verbose - 1, 0)
        with stages.stage("second repeat"):
            began = process_time()
            evaluation = first.with_repeats(left.repeats(range(1, min(len(seeds), 2)), seeds, None))
            seconds = process_time() - began
        if self.verbose and len(seeds) > 1:
            text = replicates.predicted_time(seconds, len(seeds) - 2, left.share_in_replicates)
            print(f"[{type(self).__name__}] {text}")
        with stages.stage("other repeats"):
            grows = is_auto(self.n_repeats) and bool(replicates.parts)  # bands of the noise alone are of the repeats
            n_repeats = LEAST_REPEATS if grows else len(seeds)
            evaluation = evaluation.with_repeats(left.repeats(range(2, n_repeats), seeds, self.n_jobs, progress))
            if grows:
                wanted = min(evaluation.n_repeats_for(*bounds, simulation.scenarios), len(seeds))
                more = range(n_repeats, max(wanted, n_repeats))
                evaluation = evaluation.with_repeats(left.repeats(more, seeds, self.n_jobs, progress))
        return evaluation

    @property
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


def check_detector(detector: BaseEstimator, what: str) -> None:
    """Raise an error for what is not an outlier detector."""
    needed = ("get_params", "fit", "decision_function", "score_samples")
    lacking = [name for name in needed if not hasattr(detector, name)]
    if isinstance(detector, type) or lacking:
        without = f", without {lacking}" if lacking else ", a class"
        raise ValueError(f"{what} is {detector!r:.200}{without}; expected an outlier detector")
