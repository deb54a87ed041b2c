"""Which further measurement would make smaller damage detectable."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed
from numpy.typing import ArrayLike
from scipy.stats import t as student
from sklearn.base import clone

from skthermo._core.arrays import Array, as_floats, as_random_state, check_noise, integer_row, real_array
from skthermo._core.frames import check_same_rows
from skthermo._core.parallel import run_jobs, single_blas_thread
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import ResultWarning
from skthermo.fem import FEModel, linearise
from skthermo.studies._pod_curve import FamilyRates, families_of, fitted_curve
from skthermo.studies._scenarios import BaseScenario, Scenario
from skthermo.studies._simulation import Candidate, Simulation, scatter_of, sensors_of
from skthermo.studies._study import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM


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
        on parameters that the measured modes hardly determine, so that the chain does not know how it moves.

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
    >>> options = {"n_repeats": 2, "uncertainty": "noise", "random_state": 0}
    >>> study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, **options)
    >>> results = study.run(weather)
    >>> table = compare_extensions(study, weather, modes=[8])
    >>> table["candidate"][0]
    'mode 9'
    >>> bool(table["ci_low"][0] < table["gain"][0] < table["mdd_now"][0])
    True
    """
    if not isinstance(study, DetectabilityStudy):
        raise ValueError(f"study is {study!r:.200}; expected a DetectabilityStudy that has been run")
    name, fem = study.detector_name(detector), study.fem
    present = study.candidates_[name]
    factors = np.ravel(real_array(baseline_factors, "baseline_factors")).tolist()
    if np.ndim(baseline_factors) != 1 or not all(1 < factor < np.inf for factor in factors):
        raise ValueError(f"baseline_factors is {baseline_factors!r:.200}; expected numbers above 1, such as [2.0]")
    ranks = _further_modes(fem.model, modes)
    names = [mode_name(rank) for rank in ranks]
    candidates = {("mode", one): _with_mode(present, one) for one in names}
    for factor in factors:
        longer = replace(present, n_baseline=int(np.ceil(present.n_baseline * factor)))
        candidates["baseline", f"baseline x {factor:g}"] = longer
    n_repeats = int(study.results_["n_repeats"].max())
    seeds = as_random_state(study.random_state).randint(np.iinfo(np.int32).max, size=n_repeats)
    measurement = scatter_of(fem, study.noise, study.gaps, study.outliers)
    scenarios, rows = scenarios_of(study, name), []
    with collected() as findings, single_blas_thread():
        findings += fem.thermal_.doubts(fem.weather(T)) + (_doubtful_modes(fem, ranks) if ranks else [])
        scatter = check_noise(_scatter(study) if noise is None else noise, len(ranks), names)
        compared = [(fem, T, candidates, dict(zip(ranks, scatter, strict=True)))] if candidates else []
        for chain, weather, others, further in compared + _with_sensors(fem, present, sensors):
            healthy = Simulation.solved(chain, [Scenario("healthy")], chain.records_.temperatures, measurement)
            changed = Simulation.solved(chain, scenarios, weather, measurement)
            repeat = trial(healthy, changed, {None: present} | others, further)
            jobs = (delayed(repeat)(int(seed)) for seed in seeds)
            repeats = run_jobs(jobs, len(seeds), unit="repeats", n_jobs=study.n_jobs)
            rows += [
                _row(*key, family, np.array([[one[None][family], one[key][family]] for one in repeats]))
                for key in others
                for family in repeats[0][None]
            ]
    if not rows:
        raise ValueError("there is no candidate; expected modes, baseline_factors or sensors")
    warn_each(findings)
    return pd.DataFrame(rows).sort_values("gain", ascending=False, kind="stable", ignore_index=True)


def trial(
    healthy: Simulation, changed: Simulation, candidates: Mapping[Any, Candidate], modes: Mapping[int, float]
) -> Callable[[int], dict[Any, dict[str, float]]]:
    """A function of a seed that compares candidates in the same simulated campaigns of a chain: of every one the
    smallest detectable severity of each family.

    The weather of healthy records begins again where a baseline is longer. ``modes`` are further ones, with their
    relative scatter by rank.
    """
    fem, names, scatter = healthy.fem, [mode_name(rank) for rank in modes], list(modes.values())
    further = {
        one.name: fem.thermal_.simulated(simulation.weather, [*modes], **one.changes(simulation.T))
        for simulation in ((healthy, changed) if modes else ())
        for one in simulation.scenarios
    }
    n_periods = -(-max(one.n_baseline for one in candidates.values()) // len(healthy.T))

    def tables(simulation: Simulation, seeds: Sequence[int]) -> list[tuple[BaseScenario, pd.DataFrame]]:
        """Records of each scenario, all with the same noise; further modes are missing where all others are."""
        found, noise = [], np.random.RandomState(seeds[1]).standard_normal((len(names), len(simulation.T))).T * scatter
        for scenario, table in zip(simulation.scenarios, simulation.records(0, seeds).values(), strict=True):
            missing = table[list(fem.mode_names_)].isna().all(axis=1).to_numpy()[:, np.newaxis]
            values = further[scenario.name] * np.where(missing, np.nan, 1 + noise) if names else noise
            found.append((scenario, table.assign(**dict(zip(names, values.T, strict=True)))))
        return found

    def repeat(seed: int) -> dict[Any, dict[str, float]]:
        first, *others = np.random.RandomState(seed).randint(np.iinfo(np.int32).max, size=(1 + n_periods, 2))
        with collected(drop_others=True), single_blas_thread():
            periods = [later(tables(healthy, seeds)[0][1], number) for number, seeds in enumerate(others)]
            records = tables(changed, first)
            return {key: smallest(one, pd.concat(periods), records) for key, one in candidates.items()}

    return repeat


def later(table: pd.DataFrame, period: int) -> pd.DataFrame:
    """A table whose times are so many periods later."""
    if not isinstance(table.index, pd.DatetimeIndex):
        return table.set_axis(table.index + period * len(table))
    length = table.index[-1] - table.index[0]
    return table.set_axis(table.index + period * (length + length / max(len(table) - 1, 1)))


def smallest(
    candidate: Candidate, baseline: pd.DataFrame, tables: Sequence[tuple[BaseScenario, pd.DataFrame]]
) -> dict[str, float]:
    """Severity at which the curve of a detector, once it has learned, reaches a POD of 0.9, by family.

    Without a finite slope, the middle of its bracket; infinite where damage is not found.
    """
    detector = clone(candidate.detector).fit(candidate.seen(baseline.iloc[: candidate.n_baseline]))
    counts: dict[str, list[tuple[float, int, int]]] = {}
    for scenario, table in tables:
        decisions = np.asarray(detector.decision_function(candidate.seen(table)), dtype=float)
        alarms = abs(scenario.severity), int((decisions < 0).sum()), int((~np.isnan(decisions)).sum())
        counts.setdefault(scenario.family, []).append(alarms)
    found = dict.fromkeys(counts, np.inf)
    for family, rows in counts.items():
        try:
            curve = fitted_curve(*np.transpose(rows))[0]
        except ValueError:  # the rate does not increase with severity, or nothing could be evaluated
            continue
        middle = float(np.nan_to_num(np.mean(curve.bracket), nan=np.inf))
        found[family] = curve.a90 if np.isfinite(curve.a90) else middle
    return found


def scenarios_of(study: DetectabilityStudy, detector: str) -> list[Scenario]:
    """Scenarios of all families: 13 around the present a90 where a family is damage of one group, else those of the
    study."""
    scenarios = []
    for (name, family, source), rates in families_of(study.results_, study.confidence_).items():
        if name != detector or source != "simulated" or not len(rates.tested):
            continue
        members = [one for one in study.scenarios_ if isinstance(one, Scenario) and one.family == family]
        losses = {(group, member.kind) for member in members for group in member.damage or {}}
        if len(losses) != 1 or not all(member.changes(None).keys() <= {"damage", "kind"} for member in members):
            scenarios += members
            continue
        group, kind = losses.pop()
        severities = np.clip(_around(rates) * np.linspace(0.3, 1.5, 13), -0.95, 0.95).tolist()
        scenarios += [Scenario(f"{family} {one}", {group: one}, family=family, kind=kind) for one in severities]
    if not scenarios:
        raise ValueError("no scenario belongs to a family with a severity; expected some, as `sweep` makes them")
    return scenarios


def _around(rates: FamilyRates) -> float:
    """The present a90, the middle of its bracket, or the largest severity."""
    tested = rates.tested["severity"].to_numpy(dtype=float)
    a90, lowest, highest = rates.on_curve(0.9)[0]
    found = a90 if np.isfinite(a90) else (lowest + highest) / 2
    return float(np.sign(tested[0]) * abs(found if np.isfinite(found) else np.abs(tested).max()))


def mode_name(rank: int) -> str:
    """Name of a mode that was not measured, counted from 1."""
    return f"mode {rank + 1}"


def _with_mode(candidate: Candidate, name: str) -> Candidate:
    """The detector with one more measured mode, which is a target where a part of it has targets."""
    detector, added = clone(candidate.detector), name if candidate.is_frame else len(candidate.columns)
    targets = {key: value for key, value in detector.get_params().items() if key.rsplit("__", 1)[-1] == "targets"}
    detector.set_params(**{key: [*value, added] for key, value in targets.items()})
    return replace(candidate, detector=detector, columns=[*candidate.columns, name])


def _further_modes(model: FEModel, modes: Sequence[int] | None) -> list[int]:
    """Ranks of modes that are not measured yet."""
    if not hasattr(model, "with_modes"):
        if modes is None:
            return []
        raise ValueError(f"{model!r} has no method 'with_modes'; expected a model with one, such as AffineModel")
    measured = model.mode_ranks
    if modes is None:
        return list(range(max(measured) + 1, min(max(measured) + 4, model.n_available)))
    modes = integer_row(modes, "modes").tolist() if np.size(modes) else []
    again = [mode for mode in modes if mode in measured]
    if again:
        raise ValueError(f"modes {again} are measured already; expected others than {list(measured)}")
    return modes


def _doubtful_modes(fem: DataInformedFEM, ranks: Sequence[int], *, most: float = 2.0) -> list[ResultWarning]:
    """Modes whose frequencies, predicted from one record, scatter more than ``most`` times as much as the measured."""
    theta = np.nanmean(as_floats(fem.parameters_), axis=0, keepdims=True)
    models = fem.model, fem.model.with_modes(ranks)
    measured, further = (linearise(model, theta, relative=True)[1][0] for model in models)
    weights = further @ np.linalg.pinv(measured)
    is_known = np.isclose(weights @ measured, further, atol=1e-6).all(axis=1)
    ratios = dict(zip(ranks, np.where(is_known, np.linalg.norm(weights, axis=1), np.inf), strict=True))
    doubtful = [f"{mode_name(rank)} ({ratio:.1f} times)" for rank, ratio in ratios.items() if ratio > most]
    text = (
        f"frequencies of further modes, predicted from one record, scatter more than {most:g} times as much as those "
        f"of the measured modes: {', '.join(doubtful)}. Their gain is doubtful. Measure such a mode once before its "
        "sensors are bought"
    )
    return [ResultWarning(text, "undetermined")] if doubtful else []


def _with_sensors(fem: DataInformedFEM, present: Candidate, sensors: pd.DataFrame | None) -> list[tuple[Any, ...]]:
    """A chain that was fitted with each further sensor, its weather, a detector that sees the sensor, and no modes."""
    if sensors is None:
        return []
    T, F, known = fem.records_.temperatures, fem.records_.frequencies, sensors_of(fem)
    if not isinstance(sensors, pd.DataFrame) or not sensors.shape[1]:
        raise ValueError(f"sensors is {sensors!r:.200}; expected a frame with a column for each candidate")
    if not set(known) & set(present.columns):
        raise ValueError("the detector sees no temperatures; expected one that does, or sensors=None")
    check_same_rows(T, sensors, ("the temperatures of the training", "sensors"))
    found = []
    for name in sensors.columns:
        if name in known:
            raise ValueError(f"sensor {name!r} has the name of a measured temperature; expected another name")
        beside = pd.DataFrame(as_floats(T), getattr(T, "index", None), known)
        beside[name] = as_floats(sensors[name])
        seeing = {("sensor", str(name)): replace(present, columns=[*present.columns, name])}
        found.append((clone(fem).fit(beside, F), beside, seeing, {}))
    return found


def _row(kind: str, name: str, family: str, mdd: Array) -> dict[str, Any]:
    """Means over the repeats, and bounds for one more of them; mdd has shape (n_repeats, 2), now and then."""
    finite = mdd[np.isfinite(mdd).all(axis=1)]
    gains = finite[:, 0] - finite[:, 1] if len(finite) else np.array([np.nan])
    margin = np.inf
    if len(gains) > 1:
        margin = student.ppf(0.975, len(gains) - 1) * gains.std(ddof=1) * np.sqrt(1 + 1 / len(gains))
    now, then = finite.mean(axis=0) if len(finite) else mdd.mean(axis=0)
    gain = {"gain": gains.mean(), "ci_low": gains.mean() - margin, "ci_high": gains.mean() + margin}
    return {"candidate": name, "kind": kind, "family": family, "mdd_now": now, "mdd_then": then, **gain}


def _scatter(study: DetectabilityStudy) -> float:
    """Median relative scatter of the measured modes."""
    if isinstance(study.noise, str):
        return float(np.median(np.sqrt(np.nanmean(study.fem.recorder_.residuals.values**2, axis=0))))
    return float(np.median(check_noise(study.noise, len(study.fem.mode_names_), study.fem.mode_names_)))
