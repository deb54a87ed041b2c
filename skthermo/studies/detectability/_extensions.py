"""Which further measurement would make smaller damage detectable."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from joblib import delayed
from numpy.typing import ArrayLike
from scipy.stats import t as student
from sklearn.base import BaseEstimator, clone

from skthermo._core.arrays import (
    Array,
    as_floats,
    as_random_state,
    check_noise,
    integer_row,
    real_array,
)
from skthermo._core.frames import Table, check_same_rows, column_names
from skthermo._core.parallel import run_jobs, single_blas_thread
from skthermo._core.warnings import warn_user, warnings_once, without_kinds, without_warnings
from skthermo.exceptions import ResultWarning
from skthermo.fem import FEModel, linearise
from skthermo.studies._scenarios import Scenario
from skthermo.studies.detectability._pod_curve import pod_curve
from skthermo.studies.detectability._simulation import LARGEST_SEED, Candidate, Measurement, SeenColumns
from skthermo.studies.detectability._study import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM

ChangesBySeverity: TypeAlias = Mapping[tuple[str, float], Mapping[str, Any]]
"""What is changed, as arguments of `DataInformedFEM.simulate`, by family and severity."""


@dataclass(frozen=True)
class CampaignSimulator:
    """A chain that stands for the true structure: healthy records to learn from, and records of every severity.

    The weather of the training begins again where ``n_baseline`` is longer. ``modes`` are the ranks of further modes of
    the model, and ``scatter`` the relative standard deviations of their noise; they are missing where all others are.
    """

    fem: DataInformedFEM
    T: Table
    changes: ChangesBySeverity
    measurement: Measurement
    n_baseline: int
    modes: Sequence[int] = ()
    scatter: Array = field(default_factory=lambda: np.empty(0))

    @property
    def names(self) -> list[Hashable]:
        """Columns of the tables: temperatures, measured modes, further modes."""
        return [*SeenColumns.all_of(self.fem).names, *(mode_name(mode) for mode in self.modes)]

    def clean(self) -> tuple[Array, dict[tuple[str, float], Array]]:
        """Frequencies without noise: healthy in the weather of the training, and by family and severity in the new."""
        weather = self.fem.records_.temperatures
        return self._clean(weather, {}), {key: self._clean(self.T, changes) for key, changes in self.changes.items()}

    def draw(self, clean: tuple[Array, Mapping[Any, Array]], seed: int) -> tuple[pd.DataFrame, dict]:
        """Records with noise: a baseline, and frames by family and severity, all of which have the same noise."""
        (healthy, changed), weather = clean, self.fem.records_.temperatures
        seeds = np.random.RandomState(seed).randint(LARGEST_SEED, size=(1 + -(-self.n_baseline // len(weather)), 2))
        factors, seen = self._measured(self.T, seeds[0])
        periods = []
        for period, pair in enumerate(seeds[1:]):
            noise, T = self._measured(weather, pair)
            periods.append(self._table(T, healthy * noise, period))
        tables = {key: self._table(seen, frequencies * factors) for key, frequencies in changed.items()}
        return pd.concat(periods).iloc[: self.n_baseline], tables

    def _clean(self, T: Table, changes: Mapping[str, Any]) -> Array:
        measured = as_floats(self.fem.simulate(T, **changes))
        if not self.modes:
            return measured
        return np.hstack([measured, self.fem.thermal_.simulated(self.fem.weather(T), self.modes, **changes)])

    def _measured(self, T: Table, seeds: Sequence[int]) -> tuple[Array, Table]:
        """Factors by which noise, gaps and outliers change frequencies, and temperatures with gaps."""
        measured, seen = self.measurement.of(self.fem, self.fem.weather(T), int(seeds[0]))
        further = np.random.RandomState(seeds[1]).standard_normal((len(self.modes), len(measured))).T * self.scatter
        further[np.isnan(measured).all(axis=1)] = np.nan
        return 1 + np.hstack([measured, further]), seen

    def _table(self, T: Table, frequencies: Array, period: int = 0) -> pd.DataFrame:
        """Temperatures and frequencies side by side; a later period repeats the weather of the first."""
        table = pd.DataFrame(np.hstack([as_floats(T), frequencies]), columns=self.names)
        index = getattr(T, "index", None)
        if not isinstance(index, pd.DatetimeIndex):
            return table.set_index(table.index + period * len(table))
        step = (index[-1] - index[0]) / max(len(index) - 1, 1)
        return table.set_index(index + period * (index[-1] - index[0] + step))


def mode_name(rank: int) -> str:
    """Name of a mode that was not measured, counted from 1."""
    return f"mode {rank + 1}"


SEVERITY_FACTORS = np.linspace(0.3, 1.5, 13)  # severities at which a family is simulated, in units of its present a90
HIGHEST_SEVERITY = 0.95  # of those that are simulated
N_MODES = 3  # number of further modes that are candidates by default
CONFIDENCE = 0.95  # of the bounds of a gain
DOUBTFUL_RATIO = 2.0  # scatter of a mode predicted from one record, over that of measured modes, that makes it doubtful


@dataclass(frozen=True)
class Arrangement:
    """An unfitted detector, the names of the columns that it sees, in order, as a frame or an array, and the number of
    healthy records that it learns from."""

    detector: BaseEstimator
    columns: Sequence[Hashable]
    n_baseline: int
    is_frame: bool

    @classmethod
    def of(cls, candidate: Candidate) -> Arrangement:
        """What a detector of a study measures and has learned."""
        return cls(clone(candidate.detector), candidate.columns, candidate.n_baseline, candidate.view.is_frame)

    def with_mode(self, name: str) -> Arrangement:
        """The arrangement with one more measured mode, which is a target where a part of the detector has targets."""
        detector, added = clone(self.detector), name if self.is_frame else len(self.columns)
        targets = {key: value for key, value in detector.get_params().items() if key.rsplit("__", 1)[-1] == "targets"}
        detector.set_params(**{key: [*value, added] for key, value in targets.items()})
        return replace(self, detector=detector, columns=[*self.columns, name])

    def smallest(self, baseline: pd.DataFrame, tables: Mapping[tuple[str, float], pd.DataFrame]) -> dict[str, float]:
        """Severity at which the curve of the probability of detection reaches 0.9, by family."""
        detector = clone(self.detector).fit(self._seen(baseline.iloc[: self.n_baseline]))
        counts: dict[str, list[tuple[float, int, int]]] = {}
        for (family, severity), table in tables.items():
            decisions = np.asarray(detector.decision_function(self._seen(table)), dtype=float)
            evaluated = int((~np.isnan(decisions)).sum())
            counts.setdefault(family, []).append((abs(severity), int((decisions < 0).sum()), evaluated))
        return {family: _a90(*np.transpose(rows)) for family, rows in counts.items()}

    def _seen(self, table: pd.DataFrame) -> Table:
        seen = table[list(self.columns)]
        return seen if self.is_frame else seen.to_numpy()


def _a90(severities: Any, n_detected: Any, n_records: Any) -> float:
    """a90 of the curve; without a finite slope, the middle of its bracket; infinite where damage is not found."""
    try:
        with without_kinds({"separated-severities", "poor-curve-fit"}):
            curve = pod_curve(severities, n_detected, n_records)
    except ValueError:  # the rate does not increase with severity, or nothing could be evaluated
        return np.inf
    return curve.a90 if np.isfinite(curve.a90) else float(np.nan_to_num(np.mean(curve.bracket), nan=np.inf))


@dataclass(frozen=True)
class Trials:
    """Candidates that are compared with the present arrangement in the same simulated campaigns."""

    simulator: CampaignSimulator
    present: Arrangement
    candidates: dict[tuple[str, str], Arrangement]

    def repeats(
        self, seeds: Sequence[int], n_jobs: int | None
    ) -> dict[tuple[str, str], list[dict[str, tuple[float, float]]]]:
        """For each candidate and repeat, the smallest detectable severity of each family now and then."""
        with single_blas_thread():
            clean = self.simulator.clean()
        with without_warnings():
            jobs = (delayed(self._repeat)(clean, int(seed)) for seed in seeds)
            found = run_jobs(jobs, len(seeds), unit="repeats", n_jobs=n_jobs)
        return {candidate: [repeat[candidate] for repeat in found] for candidate in self.candidates}

    def _repeat(self, clean: Any, seed: int) -> dict[tuple[str, str], dict[str, tuple[float, float]]]:
        with without_warnings(), single_blas_thread():
            baseline, tables = self.simulator.draw(clean, seed)
            now = self.present.smallest(baseline, tables)
            then = {key: arrangement.smallest(baseline, tables) for key, arrangement in self.candidates.items()}
        return {candidate: {family: (now[family], mdd[family]) for family in now} for candidate, mdd in then.items()}


def compare_extensions(
    study: DetectabilityStudy,
    T: ArrayLike,
    *,
    modes: Sequence[int] | None = None,
    noise: ArrayLike | None = None,
    baseline_factors: Sequence[float] = (2.0,),
    sensors: pd.DataFrame | None = None,
    detector: str | None = None,
) -> pd.DataFrame:
    """Compare further modes, longer baselines and further temperature sensors by the damage that they make detectable.

    Parameters
    ----------
    study : DetectabilityStudy
        That has been run; its chain, detector, families of scenarios, noise, gaps, outliers and seed are used.
    T : array-like or DataFrame of shape (n_records, n_sensors)
        Temperatures in degrees Celsius of the new records.
    modes : sequence of int, optional
        Ranks of modes of the model (the lowest is 0) that could be measured, too, one of them at a time. By default
        the next three above the measured ones, if the model has a method ``with_modes``.
    noise : float or array-like of shape (n_modes,), optional
        Relative standard deviation of the frequencies of these modes. By default the median of the measured ones.
    baseline_factors : sequence of float, default=(2.0,)
        How many times as many healthy records the detector could learn from.
    sensors : DataFrame of shape (n_training_records, n_candidates), optional
        Further temperatures for the records that the chain was fitted on. The chain is fitted again with each.
    detector : str, optional
        Name of the detector, where the study has several.

    Returns
    -------
    DataFrame
        One row for each candidate and family of scenarios, the largest gain first:

        - ``candidate``, such as "mode 7" (counted from 1), "baseline x 2" or the sensor's name; ``kind``: "mode",
          "baseline" or "sensor"; ``family``;
        - ``mdd_now``, ``mdd_then``: minimum detectable damage, the magnitude of the severity with a probability of
          detection of 0.9 on the curve, without and with the candidate: means over the repeats, infinite where
          damage is not found;
        - ``gain``: their difference; ``ci_low``, ``ci_high``: bounds that hold, with a probability of 95 %, the gain
          of one baseline and one new period.

    Raises
    ------
    ValueError
        If the study has not been run or has no family of two severities, a mode is measured already or does not
        exist, a factor is not above 1, or sensors do not have the rows of the training records or would not be seen.

    Warns
    -----
    UserWarning
        Once for each kind of doubt about the simulations, such as weather outside the training range; if a mode depends
        on parameters that the measured modes hardly determine, so that the chain does not know how it moves; if damage
        of a family is not found.

    Notes
    -----
    Detectors are fitted anew with each candidate, to the same noise. The bounds hold the scatter of the noise in the
    repeats, but no error of the model (:ref:`how-extensions-are-compared`).

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.detection import MahalanobisDetector
    >>> from skthermo.studies import DetectabilityStudy, sweep, compare_extensions
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> scenarios = sweep(fem, (0.1, 0.2, 0.3), groups=["top"])
    >>> options = {"n_repeats": 5, "uncertainty": "noise", "random_state": 0}
    >>> study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, **options)
    >>> results = study.run(weather)
    >>> table = compare_extensions(study, weather, modes=[6, 8])
    >>> table["candidate"][0]
    'mode 9'
    >>> bool(table["ci_low"][0] < table["gain"][0] < table["mdd_now"][0])
    True
    """
    if not isinstance(study, DetectabilityStudy):
        raise ValueError(f"study is {study!r:.200}; expected a DetectabilityStudy that has been run")
    name = study.detector_name(detector)
    present = Arrangement.of(study.findings_.candidates[name])
    changes, fem = changes_by_severity(study, name), study.fem
    factors = _checked_factors(baseline_factors)
    ranks = _further_modes(fem.model, modes)
    scatter = _scatter(study) if noise is None else noise
    candidates = {("mode", mode_name(rank)): present.with_mode(mode_name(rank)) for rank in ranks}
    for factor in factors:
        n_baseline = int(np.ceil(present.n_baseline * factor))
        candidates["baseline", f"baseline x {factor:g}"] = replace(present, n_baseline=n_baseline)
    longest = max([present.n_baseline, *(candidate.n_baseline for candidate in candidates.values())])
    measurement = Measurement.asked(study.fem, study.noise, study.gaps, study.outliers)
    simulator = CampaignSimulator(
        fem,
        T,
        changes,
        measurement,
        longest,
        ranks,
        check_noise(scatter, len(ranks), [mode_name(rank) for rank in ranks]),
    )
    n_repeats = int(study.results_["n_repeats"].max())
    seeds = as_random_state(study.random_state).randint(LARGEST_SEED, size=n_repeats)
    rows: list[dict[str, Any]] = []
    with warnings_once("in the simulations of this study"):
        if ranks:
            _warn_of_unknown_modes(fem, ranks)
        trials = [Trials(simulator, present, candidates)] if candidates else []
        trials += _with_sensors(study, present, changes, measurement, sensors)
        for trial in trials:
            for (kind, name), found in trial.repeats(seeds, study.n_jobs).items():
                rows += [
                    _row(name, kind, family, np.array([repeat[family] for repeat in found])) for family in found[0]
                ]
    if not rows:
        raise ValueError("there is no candidate; expected modes, baseline_factors or sensors")
    _warn_of_undetected(list(dict.fromkeys(row["family"] for row in rows if np.isnan(row["gain"]))))
    return pd.DataFrame(rows).sort_values("gain", ascending=False, kind="stable", ignore_index=True)


def _checked_factors(baseline_factors: Any) -> list[float]:
    """Factors of the length of the baseline, all above 1."""
    factors = np.ravel(real_array(baseline_factors, "baseline_factors")).tolist()
    if np.ndim(baseline_factors) != 1 or not all(1 < factor < np.inf for factor in factors):
        raise ValueError(f"baseline_factors is {baseline_factors!r:.200}; expected numbers above 1, such as [2.0]")
    return factors


def _warn_of_undetected(families: Sequence[str]) -> None:
    """Warn of families of damage that is not detected, so that no gain is known."""
    if families:
        warn_user(
            f"families {families} have candidates without a gain: damage is not detected at the severities around "
            "those of the study. Repeat the study with larger severities",
            ResultWarning,
            "undetected-families",
        )


def changes_by_severity(study: DetectabilityStudy, detector: str | None = None) -> ChangesBySeverity:
    """Changes of the structure by family and severity: around the present a90 where a family is damage of one group."""
    with without_warnings():
        minimum = study.minimum_detectable_damage(method="curve", detector=detector)
    changes: dict[tuple[str, float], Any] = {}
    for family in dict.fromkeys(name for name, _ in minimum.index):
        members = [s for s in study.scenarios_ if isinstance(s, Scenario) and s.family == family]
        tested = np.array([member.severity for member in members], dtype=float)
        groups = {group for member in members for group in member.damage or {}}
        if len(groups) == 1 and all(list(member.changes(None)) == ["damage"] for member in members):
            (group,) = groups
            centre = minimum.loc[(family, "simulated")]
            found = centre["mdd"] if np.isfinite(centre["mdd"]) else np.abs(centre[["ci_low", "ci_high"]]).mean()
            found = found if np.isfinite(found) else np.abs(tested).max()
            severities = np.sign(tested[0]) * np.minimum(np.abs(found) * SEVERITY_FACTORS, HIGHEST_SEVERITY)
            changes |= {(family, float(s)): {"damage": {group: float(s)}} for s in severities}
        else:
            changes |= {(family, float(s)): member.changes(None) for s, member in zip(tested, members, strict=True)}
    return changes


def _further_modes(model: FEModel, modes: Sequence[int] | None) -> list[int]:
    """Ranks of modes that are not measured yet."""
    if not hasattr(model, "with_modes"):
        if modes is None:
            return []
        raise ValueError(f"{model!r} has no method 'with_modes'; expected a model with one, such as AffineModel")
    measured = model.mode_ranks
    if modes is None:
        return list(range(max(measured) + 1, min(max(measured) + 1 + N_MODES, model.n_available)))
    modes = integer_row(modes, "modes").tolist() if np.size(modes) else []
    again = [mode for mode in modes if mode in measured]
    if again:
        raise ValueError(f"modes {again} are measured already; expected others than {list(measured)}")
    return [int(mode) for mode in modes]


def _warn_of_unknown_modes(fem: DataInformedFEM, ranks: Sequence[int]) -> None:
    """Warn of modes whose frequencies the parameters of the chain predict badly."""
    theta = np.nanmean(as_floats(fem.parameters_), axis=0, keepdims=True)
    measured, further = (
        linearise(model, theta, relative=True)[1][0] for model in (fem.model, fem.model.with_modes(ranks))
    )
    doubtful = []
    for rank, slope in zip(ranks, further, strict=True):
        weights = slope @ np.linalg.pinv(measured)
        ratio = np.linalg.norm(weights) if np.allclose(weights @ measured, slope, atol=1e-6) else np.inf
        if ratio > DOUBTFUL_RATIO:
            doubtful.append(f"{mode_name(rank)} ({ratio:.1f} times)")
    if doubtful:
        warn_user(
            "frequencies of further modes, predicted from one record, scatter more than "
            f"{DOUBTFUL_RATIO:g} times as much as those of the measured modes: {', '.join(doubtful)}. Their gain is "
            "doubtful. Measure such a mode once before its sensors are bought",
            ResultWarning,
            "undetermined-mode",
        )


def _scatter(study: DetectabilityStudy) -> float:
    """Median relative scatter of the measured modes."""
    if isinstance(study.noise, str):
        return float(np.median(np.sqrt(np.nanmean(study.fem.recorder_.residuals.values**2, axis=0))))
    return float(np.median(check_noise(study.noise, len(study.fem.mode_names_), study.fem.mode_names_)))


def _with_sensors(
    study: DetectabilityStudy,
    present: Arrangement,
    changes: ChangesBySeverity,
    measurement: Measurement,
    sensors: pd.DataFrame | None,
) -> list[Trials]:
    """Trials for each further sensor, simulated by a chain that was fitted with it."""
    if sensors is None:
        return []
    T, F = study.fem.records_.temperatures, study.fem.records_.frequencies
    if not isinstance(sensors, pd.DataFrame) or not sensors.shape[1]:
        raise ValueError(f"sensors is {sensors!r:.200}; expected a frame with a column for each candidate")
    if not set(column_names(T, "T")) & set(present.columns):
        raise ValueError(
            "the detector sees no temperatures, so that no sensor changes what it detects; expected sensors=None, or a "
            "detector that sees them, such as a pipeline with TemperatureCompensator"
        )
    check_same_rows(T, sensors, ("the temperatures of the training", "sensors"))
    trials = []
    for name in sensors.columns:
        beside = _beside(T, name, as_floats(sensors[name]))
        fem = clone(study.fem).fit(beside, F)
        seen = name if isinstance(T, pd.DataFrame) else f"T{T.shape[1] + 1}"
        simulator = CampaignSimulator(fem, beside, changes, measurement, present.n_baseline)
        beside_present = replace(present, columns=[*present.columns, seen])
        trials.append(Trials(simulator, present, {("sensor", str(name)): beside_present}))
    return trials


def _beside(T: Table, name: Hashable, values: Array) -> Table:
    if isinstance(T, pd.DataFrame):
        if name in T.columns:
            raise ValueError(f"sensor {name!r} has the name of a measured temperature; expected another name")
        beside = T.copy()
        beside[name] = values
        return beside
    return np.column_stack([T, values])


def _row(name: str, kind: str, family: str, mdd: Array) -> dict[str, Any]:
    """Means over the repeats, and bounds for one more of them; mdd has shape (n_repeats, 2), now and then."""
    finite = mdd[np.isfinite(mdd).all(axis=1)]
    gains = finite[:, 0] - finite[:, 1] if len(finite) else np.array([np.nan])
    margin = np.inf
    if len(gains) > 1:
        quantile = student.ppf((1 + CONFIDENCE) / 2, len(gains) - 1)
        margin = quantile * gains.std(ddof=1) * np.sqrt(1 + 1 / len(gains))
    now, then = finite.mean(axis=0) if len(finite) else mdd.mean(axis=0)
    return {
        "candidate": name,
        "kind": kind,
        "family": family,
        "mdd_now": now,
        "mdd_then": then,
        "gain": gains.mean(),
        "ci_low": gains.mean() - margin,
        "ci_high": gains.mean() + margin,
    }
