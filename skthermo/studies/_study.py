"""DetectabilityStudy: which damage detectors would find in this structure's weather."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from joblib import Memory, delayed
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.exceptions import NotFittedError

from skthermo._core.arrays import as_random_state, check_jobs, check_probability, is_auto, mapping_of, positive_integer
from skthermo._core.estimators import Stages, last_step
from skthermo._core.frames import Table, has_stamps, usual_step
from skthermo._core.parallel import run_jobs, single_blas_thread
from skthermo._core.text import duration_text
from skthermo._core.warnings import collected, one_of_each_kind, warn_each
from skthermo.exceptions import ModelWarning, ResultWarning, SkthermoWarning
from skthermo.fem import FEModel
from skthermo.studies._pod_curve import FamilyRates, PODCurve, families_of
from skthermo.studies._rates import EvaluatedRecords, evaluated, in_words, rank
from skthermo.studies._replicates import ReplicateRates, drawn_replicates, in_sentences, replicated
from skthermo.studies._scenarios import BaseScenario, check_chain, read_scenarios
from skthermo.studies._simulation import Candidate, Simulation, by_detector, joined, scatter_of
from skthermo.surrogate import DataInformedFEM


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
        - "baseline": the training records could have been others (`~skthermo.surrogate.resampled`), so that the
          structure is another one than the chain; the detectors stay as they are, as they would in service;
        - "weather": other days of the same season, whole weeks in a row, or the other years of T;
        - "model": another FE model of ``models`` in the chain;
        - "auto": "noise", "baseline" and "weather", and "model" if ``models`` are given;
        - "all": all of these.

        Each of ``n_replicates`` replicates is a campaign for which all of it is drawn at once; the bands are about the
        study's own rate. The noise alone is enough to compare
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
        Whether `run` prints a line with the time of each of its stages; from 2, joblib prints how many repeats and
        replicates are done.

    Attributes
    ----------
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
    candidates_ : dict of str to object
        Each fitted detector with its columns and the number of records that it has learned.
    columns_ : dict of str to list
        Names of the columns that each detector sees.
    uncertainty_ : DataFrame or None
        Indexed by detector and scenario: standard deviation of the rate due to each part of ``uncertainty`` ("noise",
        "weather", "baseline", "model") and to all ("together"), and the share of each in the variance ("model share").
        None where the bands include the noise alone.
    replicates_ : ReplicateRates or None
        Rates of alarms in every replicate, ``replicates_.rates[detector, scenario]`` of shape (n_replicates, n_parts),
        where each of ``replicates_.parts`` is added to those before it.
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

    def get_params(self, deep: bool = True) -> dict[str, Any]:
        """Parameters by name, also of detectors in a mapping, as ``detectors__name__parameter``.

        Parameters
        ----------
        deep : bool, default=True
            Whether parameters of parts are among them.

        Returns
        -------
        dict
            Names and values.
        """
        parameters = super().get_params(deep)
        if deep and isinstance(self.detectors, Mapping):
            for name, detector in self.detectors.items():
                own = detector.get_params() if hasattr(detector, "get_params") else {}
                parameters |= {f"detectors__{name}": detector}
                parameters |= {f"detectors__{name}__{key}": value for key, value in own.items()}
        return parameters

    def set_params(self, **params: Any) -> DetectabilityStudy:
        """Set parameters, also of detectors in a mapping, as ``detectors__name__parameter``.

        Parameters
        ----------
        **params : dict
            Names and values.

        Returns
        -------
        DetectabilityStudy
            This study.

        Raises
        ------
        ValueError
            If there is no such parameter.
        """
        if "detectors" in params:
            super().set_params(detectors=params.pop("detectors"))
        for key, value in params.items():
            part, _, rest = key.partition("__")
            name, _, parameter = rest.partition("__")
            if part != "detectors" or not isinstance(self.detectors, Mapping):
                super().set_params(**{key: value})
            elif name not in self.detectors:
                raise ValueError(f"there is no detector {name!r}; expected one of {list(self.detectors)}")
            elif parameter:
                self.detectors[name].set_params(**{parameter: value})
            else:
                self.detectors = {**self.detectors, name: value}
        return self

    def run(
        self,
        T: ArrayLike | Sequence[ArrayLike],
        baseline: ArrayLike | None = None,
        *,
        reference: Mapping[str, Any] | Callable[[Any, int], Any] | None = None,
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
        detectors, scenarios = self._checked_detectors(), read_scenarios(self.scenarios, self.fem.model)
        function, given = (reference, {}) if callable(reference) else (None, checked_reference(reference, scenarios))
        most_repeats = 20 if is_auto(self.n_repeats) else positive_integer(self.n_repeats, "n_repeats")
        tol = check_probability(self.tol, "tol")
        check_probability(confidence, "confidence")
        check_jobs(self.n_jobs)
        seeds = as_random_state(self.random_state).randint(np.iinfo(np.int32).max, size=(most_repeats, 2))
        asked = self.fem, self.uncertainty, T, self.models, self.n_replicates, seeds[0]
        parts, years, models, others = drawn_replicates(*asked)
        varies_more, T = parts != ["noise"], years[0]
        stages = Stages(self, 3 + varies_more)
        with collected() as findings, single_blas_thread():
            with stages.stage("detectors"):
                learned = self._learned(detectors, baseline, findings)
            with stages.stage("frequencies"):
                findings += self.fem.thermal_.doubts(self.fem.weather(T))
                measurement = scatter_of(self.fem, self.noise, self.gaps, self.outliers)
                simulation = Simulation.solved(self.fem, scenarios, T, measurement, most_repeats)
                simulation = replace(simulation, reference=function, given=given)
            with stages.stage("repeats"):
                grows = tol if is_auto(self.n_repeats) and varies_more else None
                outcomes = self._repeats(simulation, learned, seeds, grows, confidence)
        rows = {}
        for name, one in without_errors(outcomes).items():
            findings += by_detector(one.findings, name, detectors)
            try:
                records = evaluated(name, one.decisions, one.indices, scenarios)
                rows[name] = [some.summary(confidence) for some in records]
            except ValueError as error:
                outcomes[name] = ValueError(f"{error}{longer_step(T, self.fem.records_.temperatures)}")
        found = without_errors(outcomes)
        left = {name: learned[name] for name in found}
        texts = {name: f"{type(one).__name__}: {one}" for name, one in outcomes.items() if isinstance(one, Exception)}
        lines = [row for name in detectors for row in rows.get(name, [{"detector": name, "error": texts.get(name)}])]
        results, rates = pd.DataFrame(lines, columns=list(next(iter(rows.values()))[0])), None
        if varies_more:
            with stages.stage(f"{len(others)} replicates"):
                drawn = simulation, left, parts, years, models
                campaigns = self._in_parallel("replicates", replicated, [(*drawn, *one) for one in enumerate(others)])
            findings += failures([one for one in campaigns if isinstance(one, str)], len(others))
            rates = ReplicateRates.joined([one for one in campaigns if not isinstance(one, str)], results, parts)
            results = rates.banded(results, confidence)
        findings += many_false_alarms(results)
        self.results_, self.scenarios_, self.confidence_, self.errors_ = results, scenarios, confidence, texts
        self.candidates_ = left
        self.detectors_ = {name: one.detector for name, one in left.items()}
        self.thresholds_ = {name: one.threshold for name, one in left.items()}
        self.columns_ = {name: one.columns for name, one in left.items()}
        decisions = {key: one for some in found.values() for key, one in some.decisions.items()}
        self.decisions_ = {key: one for key, one in decisions.items() if key[1] is not None}
        self.calibration_ = {(name, source): one for (name, of, source), one in decisions.items() if of is None}
        self.indices_ = {key: one for some in found.values() for key, one in some.indices.items()}
        self.replicates_, self.uncertainty_ = rates, None if rates is None else rates.table()
        self.warnings_ = list(map(str, one_of_each_kind(findings)))
        warn_each(findings)
        return results

    def _learned(self, detectors: Mapping[str, Any], baseline: Any, findings: list[SkthermoWarning]) -> dict[str, Any]:
        """Each fitted detector, or its error."""
        found: dict[str, Any] = {}
        for name, detector in detectors.items():
            with collected() as doubts:
                try:
                    found[name] = Candidate.learned(self.fem, detector, baseline, self.random_state, self.memory)
                except Exception as error:
                    found[name] = error
            findings += by_detector(doubts, name, detectors)
        return found

    def _in_parallel(self, unit: str, function: Callable[..., Any], arguments: Sequence[tuple[Any, ...]]) -> list[Any]:
        """What a function gives, in joblib's jobs."""
        options = {"unit": unit, "n_jobs": self.n_jobs, "verbose": max(self.verbose - 1, 0)}
        return run_jobs((delayed(function)(*some) for some in arguments), len(arguments), **options)

    def _repeats(
        self, simulation: Simulation, learned: Mapping[str, Any], seeds: Any, tol: float | None, confidence: float
    ) -> dict[str, Any]:
        """What each detector decides in all repeats, or its first error: one for each of the seeds or, with ``tol``, as
        many of them as the bounds need. Detectors that fail are left out from then on."""
        repeats = [simulation.repeat(without_errors(learned), 0, seeds[0])]  # here, where warnings are collected
        outcomes = {**learned, **repeats[0]}

        def add(n_repeats: int) -> None:
            left, numbers = {name: learned[name] for name in without_errors(outcomes)}, range(len(repeats), n_repeats)
            repeats.extend(self._in_parallel("repeats", simulation.repeat, [(left, n, seeds[n]) for n in numbers]))
            outcomes.update({name: joined([one[name] for one in repeats]) for name in left})

        add(len(seeds) if tol is None else 3)
        if tol is not None:
            rows = [
                some.summary(confidence)
                for name, one in without_errors(outcomes).items()
                for some in evaluated(name, one.decisions, one.indices, simulation.scenarios)
                if some.source == "simulated" and np.isfinite(some.decisions).any()
            ]
            widest = max((row["ci_high"] - row["ci_low"] for row in rows), default=0.0) / 2
            add(min(int(np.ceil(3 * (widest / tol) ** 2)), len(seeds)))
        return outcomes

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
        ValueError
            If there are several detectors and none is named, or the one that is named has no results.
        """
        known = self._results.loc[self._results["error"] == "", "detector"].unique().tolist()
        if detector is None and self._results["detector"].nunique() == 1:
            return known[0]
        if not isinstance(detector, str) or detector not in known:
            raise ValueError(f"detector is {detector!r:.100}; expected the name of one of {known}")
        return detector

    def pod_curve(
        self,
        family: str,
        source: str = "simulated",
        *,
        log: bool | Literal["auto"] = "auto",
        detector: str | None = None,
    ) -> PODCurve:
        """Probability of detection over severity for one family of scenarios.

        Parameters
        ----------
        family : str
            Of the scenarios.
        source : str, default="simulated"
            "simulated" or "reference".
        log : bool or "auto", default="auto"
            Whether the logit is linear in the logarithm of the severity, or in the severity; "auto" takes the likelier
            law of the two.
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        PODCurve
            Records count as their effective numbers, so that serial correlation is in its bounds. Its
            ``prediction_interval`` and ``a90_prediction_interval`` hold all that ``uncertainty`` names.

        Raises
        ------
        ValueError
            If there is no such family, the curve cannot be fitted, or there are several detectors and none is named.

        Warns
        -----
        UserWarning
            If the curve has no finite slope, or lies outside the bounds of some tested severities.
        """
        found = self._family(family, source, detector)
        curve, findings = found.curve(log)
        warn_each(findings)
        curves = () if self.replicates_ is None else self.replicates_.curves(found, curve.log)
        return replace(curve, replicates=tuple(curves))

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
            because the POD does not increase.
        """
        check_probability(level, "level")
        if method not in ("grid", "curve"):
            raise ValueError(f"method is {method!r}; expected 'grid' or 'curve'")
        families = {k: one for k, one in families_of(self._results, self.confidence_).items() if len(one.tested)}
        if detector is not None or self._results["detector"].nunique() == 1:
            name = self.detector_name(detector)
            families = {key[1:]: one for key, one in families.items() if key[0] == name}
        if not families:
            raise ValueError("no scenario belongs to a family with a severity; expected some, as `sweep` makes them")
        is_grid = method == "grid"
        found = [(one.on_grid(level), []) if is_grid else one.on_curve(level) for one in families.values()]
        warn_each([doubt for _, doubts in found for doubt in doubts])
        names = ["detector", "family", "source"][-len(next(iter(families))) :]
        index = pd.MultiIndex.from_tuples(list(families), names=names)
        table = pd.DataFrame([ends for ends, _ in found], index=index, columns=["mdd", "ci_low", "ci_high"])
        if self.replicates_ is None:
            return table
        bands = [self.replicates_.smallest(one, level, method, self.confidence_) for one in families.values()]
        return table.assign(**dict(zip(["pi_low", "pi_high"], np.transpose(bands), strict=True)))

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
        ValueError
            If there is no such family or source, or there are several detectors and none is named.
        """
        return self._family(family, source, detector).is_undetected

    def ranking(
        self,
        max_false_alarms: float = 0.02,
        source: str = "simulated",
        confidence: float | None = None,
        *,
        by: Literal["pod", "pod_at_equal_pfa"] = "pod",
    ) -> pd.DataFrame:
        """Detectors in the order of what they find, with what is not significant.

        First come those that keep the limit of false alarms, by their probability of detection (POD), then the others,
        those with the fewest false alarms first.

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
              limit (less where indices are tied); NaN for measured records, which have no calibration;
            - ``pod_deficit``, ``pod_deficit_ci_low``, ``pod_deficit_ci_high``: POD of the first row less that of this
              one, by the measure of the order; the bounds hold for all rows together, and need two repeats;
            - ``significantly_worse``: whether the lower bound is above 0;
            - ``auc``: area under the ROC curve, the mean over the damaged scenarios; 0.5 is chance;
            - ``time_to_detection``: mean over the damaged scenarios; NaN where one of them raises no alarm;
            - ``not_evaluated``: share of the records that the detector cannot evaluate, which count nowhere else;
            - for each family ``pod FAMILY``, ``pod FAMILY ci_low``, ``pod FAMILY ci_high`` and ``mdd FAMILY``, the
              minimum detectable damage at a POD of 0.9 (NaN: not reached, or the severities have no order);
            - ``error``: "", or the error of a detector that failed.

        Raises
        ------
        ValueError
            If no scenario of this source is healthy, or none is damaged, or ``by="pod_at_equal_pfa"`` and there are no
            healthy records to move thresholds by.

        Notes
        -----
        Differences are paired, as all detectors evaluate the same records. Their bounds include noise alone
        (:ref:`how-detectors-are-ranked`). Limits of a ranking: :ref:`which-detector`.

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
        Mahalanobis          0.02  0.22              0.22                False
        forest               0.01  0.18              0.17                 True
        >>> print(study.summary())
        'Mahalanobis' detects 21.8% of the damaged records at a false-alarm rate of 1.8%.
        Significantly worse at 95% confidence: 'forest' (18.4% at 1.2%).
        These comparisons include noise only: another year, baseline or FE model may change the order.
        """
        results, limit = self._results, check_probability(max_false_alarms, "max_false_alarms")
        asked = self.confidence_ if confidence is None else check_probability(confidence, "confidence")
        if by not in ("pod", "pod_at_equal_pfa"):
            raise ValueError(f"by is {by!r:.100}; expected 'pod' or 'pod_at_equal_pfa'")
        known = results["source"].dropna().unique().tolist()
        if source not in known:
            raise ValueError(f"source is {source!r:.100}; expected one of {known}")
        rows = results[results["source"] == source]
        for measure, kind in (("PFA", "healthy"), ("POD", "damaged")):
            if not (rows["measure"] == measure).any():
                raise ValueError(
                    f"source {source!r} has the scenarios {rows['scenario'].unique().tolist()}, none of them {kind}; "
                    "expected healthy and damaged ones"
                )
        calibration = {name: decisions for (name, of), decisions in self.calibration_.items() if of == source}
        if by == "pod_at_equal_pfa" and not calibration:
            raise ValueError(f"source {source!r} has no healthy records to move thresholds by; expected by='pod'")
        records = self._records(source)
        if asked != self.confidence_:
            rows = pd.DataFrame([one.summary(asked) for one in records])
        families = {key[:2]: family for key, family in families_of(rows, asked).items()}
        return rank(records, rows, families, calibration, self.errors_, limit, asked, by)

    def labelled_scores(
        self, detector: str | None = None, source: str = "simulated", scenarios: Sequence[str] | None = None
    ) -> tuple[NDArray[np.bool_], NDArray[np.float32]]:
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
        ValueError
            If the detector is not known, or it has evaluated no healthy or no damaged records of these scenarios.

        Examples
        --------
        Found damage over false alarms, for all thresholds, is ``RocCurveDisplay.from_predictions(
        *study.labelled_scores("raw"), name="raw")`` of scikit-learn.
        """
        name = self.detector_name(detector)
        parts: dict[bool, list[Any]] = {False: [], True: []}
        for one in self._records(source):
            is_healthy = one.scenario.is_healthy
            if one.detector == name and (is_healthy or scenarios is None or one.scenario.name in scenarios):
                kept = one.from_onset()[0]
                parts[not is_healthy].append(-kept[~np.isnan(kept)])
        healthy, damaged = (np.concatenate([*some, []]) for some in parts.values())
        if not len(healthy) or not len(damaged):
            raise ValueError(
                f"detector {name!r} has evaluated {len(healthy)} healthy and {len(damaged)} damaged records of source "
                f"{source!r} and scenarios {scenarios}; expected some of both"
            )
        return np.repeat([False, True], [len(healthy), len(damaged)]), np.r_[healthy, damaged]

    def summary(self, max_false_alarms: float = 0.02, source: str = "simulated") -> str:
        """Which detector detects most, and which are not significantly worse, in sentences.

        Parameters
        ----------
        max_false_alarms : float, default=0.02
            Limit of the share of healthy records in alarm.
        source : str, default="simulated"
            "simulated" or "reference".

        Returns
        -------
        str
            What `ranking` says, a line for each group of detectors, and what the bands of the first one include.

        Raises
        ------
        ValueError
            As `ranking`.
        """
        ranking = self.ranking(max_false_alarms, source)
        lines = [in_words(ranking, max_false_alarms, self.confidence_)]
        if self.replicates_ is not None and source == "simulated":
            lines.append(self.uncertainty_summary(ranking.index[0]))
        return "\n".join(lines)

    def uncertainty_summary(self, detector: str | None = None) -> str:
        """Which uncertainties the prediction intervals include, and which dominates the widest one, in sentences.

        Parameters
        ----------
        detector : str, optional
            Name of the detector, where there are several.

        Returns
        -------
        str
            A line on what the intervals include, and one on the scenario with the widest.

        Raises
        ------
        ValueError
            If there are several detectors and none is named, or the one that is named has no results.
        """
        name = self.detector_name(detector)
        return in_sentences(self._results, self.replicates_, name, self.confidence_)

    def _records(self, source: str) -> list[EvaluatedRecords]:
        """What the detectors evaluated of one source."""
        tables = self.decisions_, self.indices_, self.scenarios_
        return [one for name in self.detectors_ for one in evaluated(name, *tables) if one.source == source]

    def _family(self, family: str, source: str, detector: str | None) -> FamilyRates:
        name = self.detector_name(detector)
        found = {key: one for key, one in families_of(self._results, self.confidence_).items() if key[0] == name}
        is_known = isinstance(family, str) and isinstance(source, str)
        if not is_known or (name, family, source) not in found:
            known = [f"{f!r} ({s})" for _, f, s in found]
            raise ValueError(f"family {family!r}, source {source!r} is not in the results; expected one of {known}")
        return found[name, family, source]

    @property
    def _results(self) -> pd.DataFrame:
        if not hasattr(self, "results_"):
            raise NotFittedError("the study has no results yet; expected a call of run before")
        return self.results_

    def _checked_detectors(self) -> dict[str, Any]:
        """Detectors by name; an error for what is none."""
        is_one = not isinstance(self.detectors, Mapping)
        named = {type(last_step(self.detectors)).__name__: self.detectors} if is_one else dict(self.detectors)
        if not named or not all(isinstance(name, str) and name for name in named):
            raise ValueError(f"detectors is {named!r:.200}; expected a detector, or a mapping of names to detectors")
        for name, detector in named.items():
            check_detector(detector, f"detector {name!r}")
        return named

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


def checked_reference(reference: Any, scenarios: Sequence[BaseScenario]) -> Mapping[str, Any]:
    """Measured frequencies by the name of the scenario."""
    expected, names = "{name of scenario: frequencies} or a function", [scenario.name for scenario in scenarios]
    given = mapping_of({} if reference is None else reference, "reference", expected)
    unknown = [name for name in given if name not in names]
    if unknown:
        raise ValueError(f"reference has the scenarios {unknown}; expected some of {names}")
    return given


def without_errors(outcomes: Mapping[str, Any]) -> dict[str, Any]:
    """What detectors gave that have not failed; the first error if all have."""
    left = {name: one for name, one in outcomes.items() if not isinstance(one, Exception)}
    if not left:
        raise next(iter(outcomes.values()))
    return left


def longer_step(T: Table, baseline: Table) -> str:
    """What an error says where the weather comes less often than the records of the baseline did; else nothing."""
    if not (has_stamps(T) and has_stamps(baseline)):
        return ""
    step, usual = (usual_step(table.index.sort_values()) for table in (T, baseline))
    if step <= usual:
        return ""
    return (
        f". The weather comes every {duration_text(step)}, records of the baseline every {duration_text(usual)}: a "
        "window has a value where it holds at least half of the records that it usually has. Give weather by the step "
        "of the baseline"
    )


def failures(failed: Sequence[str], n_replicates: int) -> list[ModelWarning]:
    """Replicates that have failed are a finding, and an error where they are most."""
    text = f"{len(failed)} of {n_replicates} replicates failed, the first with {failed[:1]}"
    if 2 * len(failed) > n_replicates:
        raise ValueError(f"{text}; expected chains that can be refitted, or uncertainty='noise'")
    return [ModelWarning(f"{text}. Bands are of the others", "no-solution")] if failed else []


def many_false_alarms(results: pd.DataFrame) -> list[ResultWarning]:
    """A detector that takes most simulated records of the healthy structure for damaged is a finding."""
    many = results[(results["measure"] == "PFA") & (results["source"] == "simulated") & (results["ci_low"] > 0.5)]
    if not len(many):
        return []
    by = f" (detectors {many['detector'].unique().tolist()})" if results["detector"].nunique() > 1 else ""
    text = (
        f"{many['rate'].iloc[0]:.0%} of the simulated records of scenario {many['scenario'].iloc[0]!r}, where nothing "
        f"is changed, raise an alarm{by}. No rate of the study is meaningful. Give a baseline in Hz of the structure "
        "that the chain has learned, and weather in degrees Celsius"
    )
    return [ResultWarning(text, "many-false-alarms")]
