"""DetectabilityStudy: which damage a detector would find in this structure's weather."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Literal, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import Pipeline

from skthermo._arrays import as_random_state, positive_integer
from skthermo._threads import single_blas_thread
from skthermo._validation import _num_samples, seed_parts, seeded
from skthermo._warnings import warn_user
from skthermo._warnings_once import warnings_once
from skthermo.studies._candidate import Arrangement
from skthermo.studies._chain import check_chain
from skthermo.studies._curves import StudyCurves
from skthermo.studies._intervals import INTERVALS
from skthermo.studies._pod_fit import check_probability
from skthermo.studies._simulate import SIMULATED, Trial, clean_frequencies, judge
from skthermo.studies._state import State, check_groups
from skthermo.studies._summary import damage_index, summary
from skthermo.studies._view import read_baseline

MANY_FALSE_ALARMS = 0.5
"""Rate of false alarms from which a warning is given: the baseline and the simulation are not of one structure."""

Reference: TypeAlias = Mapping[str, Any] | Callable[[Any, int], Any]


class DetectabilityStudy(StudyCurves, BaseEstimator):
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
    correlation times in different repeats, to that of independent records. With it, Clopper-Pearson bounds are honest
    also for rates of 0 and 1 [KG98]_. Measured records are one repeat only; their variance between
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
        scenarios: Sequence[State],
        *,
        n_repeats: int = 20,
        noise: ArrayLike | Literal["fitted"] = "fitted",
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.fem = fem
        self.detector = detector
        self.scenarios = scenarios
        self.n_repeats = n_repeats
        self.noise = noise
        self.n_jobs = n_jobs
        self.random_state = random_state

    def run(
        self,
        T: ArrayLike,
        baseline: ArrayLike | None = None,
        *,
        reference: Reference | None = None,
        interval: Literal["clopper-pearson", "block-bootstrap"] = "clopper-pearson",
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
        interval : {"clopper-pearson", "block-bootstrap"}, default="clopper-pearson"
            How bounds of the rates are found: from the effective number of records, or by resampling the repeats of
            each block of time (of a single repeat, the blocks). The bootstrap gives no width to rates of 0 and 1, and
            bounds that are too narrow where there are few blocks.
        confidence : float, default=0.95
            Of the interval, two-sided.

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
            - ``time_to_detection``: from the onset or the first record to the first alarm, in records or, for frames on
              a ``DatetimeIndex``, in time; the mean over those repeats that have an alarm.

        Raises
        ------
        ValueError
            If names of scenarios repeat, a damage group is unknown, columns do not fit, or no record can be judged.

        Warns
        -----
        UserWarning
            Once for each kind of doubt about the simulations, such as foreign weather; if most records of the healthy
            structure raise an alarm.
        """
        check_chain(self.fem)
        check_detector(self.detector)
        n_repeats = positive_integer(self.n_repeats, "n_repeats")
        if interval not in INTERVALS:
            raise ValueError(f"interval is {interval!r}; expected one of {list(INTERVALS)}")
        check_probability(confidence, "confidence")
        scenarios = {scenario.name: scenario for scenario in self._checked_scenarios(reference)}
        view, healthy = read_baseline(self.fem, self.detector, baseline)
        seeds = as_random_state(self.random_state).randint(np.iinfo(np.int32).max, size=(n_repeats, 2))
        self.detector_ = clone(self.detector)
        seed_parts(self.detector_, seeded(self.random_state))
        self.detector_.fit(healthy)
        truth = reference if callable(reference) else None
        measured = {} if reference is None or callable(reference) else reference
        with warnings_once("in the simulations of this study") as self.warnings_, single_blas_thread():
            clean = clean_frequencies(self.fem, list(scenarios.values()), T, n_repeats)
            trial = Trial(self.fem, self.detector_, view, list(scenarios.values()), T, clean, self.noise, truth)
            tables, rows = trial.first(measured, seeds[0])
            decisions = {key: [judge(self.detector_, table)] for key, table in tables.items()}
            self.indices_ = {key: damage_index(self.detector_, tables[key], rows[key]) for key in tables}
        for repeat in trial.repeated(seeds, self.n_jobs):
            for key, values in repeat.items():
                decisions[key].append(values)
        self.threshold_ = threshold_of(self.detector_)
        options = {"interval": interval, "confidence": confidence, "seed": int(seeds[0, 0])}
        ordered = sorted(tables, key=lambda key: list(scenarios).index(key[0]))  # both sources side by side
        self.results_ = pd.DataFrame(
            [summary(scenarios[key[0]], key[1], np.array(decisions[key]), rows[key], **options) for key in ordered]
        )
        self._warn_of_many_false_alarms()
        self._confidence = confidence
        columns = [view.names[i] for i in view.positions]
        self.arrangement_ = Arrangement(clone(self.detector_), columns, _num_samples(healthy), view.is_frame)
        return self.results_

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

    def _checked_scenarios(self, reference: Any) -> list[State]:
        """The scenarios; an error if they or the names of the reference are wrong."""
        scenarios, groups = list(self.scenarios), getattr(self.fem.model, "groups", None)
        wrong = [scenario for scenario in scenarios if not isinstance(scenario, State)]
        names = [scenario.name for scenario in scenarios if isinstance(scenario, State)]
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

    def __sklearn_clone__(self) -> "DetectabilityStudy":
        parameters = self.get_params(deep=False) | {"detector": clone(self.detector)}
        return type(self)(**parameters)  # the chain is fitted, and shared


def check_detector(detector: Any) -> None:
    """Raise an error for what is no outlier detector."""
    needed = ("get_params", "fit", "decision_function", "score_samples")
    lacking = [name for name in needed if not hasattr(detector, name)]
    if isinstance(detector, type) or lacking:
        without = f", without {lacking}" if lacking else ", a class"
        raise ValueError(f"the detector is {detector!r:.200}{without}; expected an outlier detector")


def threshold_of(detector: Any) -> float | None:
    """Damage index above which a fitted detector, or a pipeline that ends with it, raises an alarm."""
    last = detector[-1] if isinstance(detector, Pipeline) else detector
    offset = getattr(last, "offset_", None)
    return None if offset is None else -float(np.squeeze(offset))
