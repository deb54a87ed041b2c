"""The detector in charge: damage indices of records, the modes that drive them, and why there is none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.sparse.csgraph import connected_components
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import BaseSearchCV, last_step
from skthermo._core.frames import DAY, check_duration, usual_step
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import warn_user, without_kinds, without_warnings
from skthermo.detection import (
    CompensatedDetector,
    DirectionalDetector,
    OutlierDetector,
    TemperatureCompensator,
)
from skthermo.exceptions import ResultWarning
from skthermo.monitoring._corrections import Corrections
from skthermo.monitoring._events import DAMAGE, MEASUREMENT, WATCH, EventRule, leading
from skthermo.monitoring._records import Memory
from skthermo.monitoring._threshold import (
    FalseAlarmEstimate,
    SmallestChanges,
    estimate_false_alarms,
    lowered,
    smallest_by_threshold,
)
from skthermo.residuals.weather import BEYOND, TrainingRange

DECIMALS, LARGEST = 6, 1e300  # of a damage index below 10; a larger one has as many digits, up to the largest
CLOSE = 1e-9  # relative distance to where rounding changes, within which an index is computed once more, alone
EXPLAINED = 0.5  # share of a squared departure from which losses of stiffness explain it
KINDS_OF_ESTIMATE = "missing-seasons", "extrapolated-threshold", "undetected-changes", "baseline-peak"
SET_ASIDE = 3  # of the last five records with a response that is set aside open an event
N_CHECKED = 5  # baseline records that are evaluated alone and among others
N_AROUND = 100  # records before their memory, and after them
BLIND, LEAST_BLIND = 3.0, 0.05  # smallest changes seen in the baseline's weather, and share, beyond which a record
# of other weather has to raise an alarm to count as healthy without one
PROBED = (5.0, 20.0, 80.0)  # standard deviations by which each response is lowered to see whether there is an alarm


@dataclass(frozen=True)
class DetectorParts:
    """A detector, the steps before it, and the compensator among these; without one, the detector alone."""

    steps: list[Any]
    compensator: TemperatureCompensator | None
    last: Any

    @classmethod
    def read(cls, detector: Any) -> DetectorParts:
        """Those of a fitted detector, in the last step of its pipeline or search."""
        *steps, last = [*_steps(detector)]
        compensators = [step for step in steps if isinstance(step, TemperatureCompensator)]
        return cls(steps, compensators[0] if compensators else None, last)

    @property
    def directional(self) -> DirectionalDetector | None:
        """The fitted detector that has directions of damage groups."""
        one = self.last.detectors_[0] if isinstance(self.last, CompensatedDetector) else self.last
        return one if isinstance(one, DirectionalDetector) and not isinstance(one.directions, str) else None

    @property
    def needs_every_mode(self) -> bool:
        one = self.last.detectors_[0] if isinstance(self.last, CompensatedDetector) else self.last
        return isinstance(one, OutlierDetector)

    @property
    def has_window(self) -> bool:
        return getattr(self.last, "window", None) is not None

    @property
    def compensates(self) -> bool:
        return self.compensator is not None or isinstance(self.last, CompensatedDetector)

    def explanations(self, records: pd.DataFrame) -> tuple[pd.DataFrame, Array] | None:
        """Effects of losses of the damage groups in standard deviations, and the share of departures that they explain.

        None without a detector that has such directions.
        """
        directional = self.directional
        if directional is None:
            return None
        table: Any = records
        for step in self.steps:
            table = step.transform(table)
        effects = self.last.severities(table) * directional.sensitivities_
        return effects.T.groupby(_names_together(directional)).sum().T, self.last.explained(table)

    def standard(self, records: pd.DataFrame, usual: tuple[Array, Array], targets: list[Any]) -> Array:
        """Residuals of records in standard deviations, or responses without a compensator; NaN for other targets."""
        if not self.compensates:
            mean, deviation = usual
            return (as_floats(records[targets]) - mean) / deviation
        table, whole = records, isinstance(self.last, CompensatedDetector)
        for step in self.steps if whole else self.steps[: self.steps.index(self.compensator)]:
            table = step.transform(table)
        part: Any = self.last.compensator_ if whole else self.compensator
        residuals = as_floats(self.last.residuals(table) if whole else part.transform(table))
        scale = self.last.scale_ if whole else part.scale_
        residuals = residuals / np.where(scale > 0, scale, 1.0)
        names = list(part.get_feature_names_out())
        if not set(names) <= set(targets):  # a step before has made arrays of the records
            return residuals[:, np.argsort(part.targets_)]
        return pd.DataFrame(residuals, columns=names).reindex(columns=targets).to_numpy()


def _steps(detector: Any) -> Iterator[Any]:
    if isinstance(detector, BaseSearchCV):
        yield from _steps(detector.best_estimator_)
    elif isinstance(detector, Pipeline):
        for _, step in detector.steps:
            yield from _steps(step)
    elif detector is not None and detector != "passthrough":
        yield detector


@dataclass(frozen=True)
class ActiveDetector(SavesFrames):
    """A fitted detector, and all by which it evaluates. It does not change: another one takes its place.

    ``trained`` is what it was fitted on, ``columns`` are those that it sees, ``usual`` means and standard deviations of
    the responses; records go through ``corrections`` before. ``smallest`` are the falls of the responses that raise an
    alarm in the weather of the baseline; there is an estimate of false alarms for each kind of event that has a damage
    index. After a new baseline, ``prior`` are records from before the intervention, which was
    complete ``since`` then.
    """

    detector: Any
    trained: pd.DataFrame
    memory: Memory
    columns: list[Any]
    temperatures: list[Any]
    targets: list[Any]
    usual: tuple[Array, Array]
    weather: TrainingRange
    corrections: Corrections
    smallest: SmallestChanges
    estimates: dict[str, FalseAlarmEstimate]
    prior: pd.DataFrame | None = None
    since: pd.Timestamp | None = None

    @classmethod
    def of(
        cls, monitor: Any, detector: Any, trained: pd.DataFrame, columns: list[Any], corrections: Corrections
    ) -> ActiveDetector:
        """Learned from what the detector was fitted on, with the parameters and the responses of its monitor."""
        targets, persistence = monitor.targets_, monitor.persistence
        memory = Memory.of(detector)
        if monitor.lookback is not None:
            memory = Memory.of_time(check_duration(monitor.lookback, "lookback"))
        temperatures = [name for name in trained.columns if name not in targets]
        frequencies = as_floats(trained[targets])
        deviation = np.nanstd(frequencies, axis=0)
        usual = np.nanmean(frequencies, axis=0), np.where(deviation > 0, deviation, 1.0)
        weather = TrainingRange.spanned(trained[temperatures], ~np.isnan(frequencies).all(axis=1))
        index = pd.Series(last_step(detector).baseline_index_, trained.index)
        step = usual_step(trained.index)
        within = memory.duration(step) + (2 * persistence - 1) * step
        index_of = partial(_index_of, detector, columns)
        smallest_at = smallest_by_threshold(index_of, trained, targets, usual[1], within, _losses_of(detector))
        options = {"hold": DAY, "persistence": persistence}
        damage = estimate_false_alarms(index, monitor.false_alarms_per_year, smallest_at=smallest_at, **options)
        estimates = {DAMAGE: damage}
        if monitor.watch_per_year is not None:
            with without_kinds(KINDS_OF_ESTIMATE):  # for the higher threshold
                per_year = monitor.watch_per_year
                watch = estimate_false_alarms(index, per_year, **options, name="watch_per_year")
            lower = min(watch.rule.threshold, damage.rule.threshold)
            estimates[WATCH] = replace(
                watch, rule=replace(watch.rule, threshold=lower, release=min(lower, watch.rule.release))
            )
        smallest = smallest_at(damage.rule.threshold)
        parts = (memory, columns, temperatures, targets, usual, weather, corrections, smallest, estimates)
        return cls(detector, trained, *parts)

    @property
    def parts(self) -> DetectorParts:
        """Detector, steps before it and compensator."""
        return DetectorParts.read(self.detector)

    @property
    def rules(self) -> dict[str, EventRule]:
        """By which events of each kind open and close."""
        rules = {MEASUREMENT: EventRule(threshold=0.5, release=0.5, hold=DAY, persistence=SET_ASIDE)}
        for kind, estimate in self.estimates.items():
            rules[kind] = estimate.rule
        return rules

    @property
    def estimate(self) -> FalseAlarmEstimate:
        """That of damage events."""
        return self.estimates[DAMAGE]

    @property
    def threshold(self) -> float:
        return self.estimates[DAMAGE].rule.threshold

    @property
    def watch_threshold(self) -> float | None:
        """An event of a raised index opens above it; None if these are not asked for."""
        return self.estimates[WATCH].rule.threshold if WATCH in self.estimates else None

    @property
    def baseline_index(self) -> pd.Series:
        """Damage indices of what it was fitted on, each record evaluated by others."""
        return pd.Series(last_step(self.detector).baseline_index_, self.trained.index)

    def ratio(self, records: pd.DataFrame) -> Array:
        return self._exact(records) / self.threshold

    def own_ratio(self, times: pd.DatetimeIndex) -> Array:
        """The same of records that it was fitted on, each evaluated by the others."""
        return (self.baseline_index / self.threshold).reindex(times).to_numpy()

    def index(self, records: pd.DataFrame, first: int) -> Array:
        """Damage index of the records from a position on, in order of time, rounded; those before are their memory.

        The number of records in a call moves the last bits of an index. Where they decide how it is rounded, the one
        of the record alone with its memory counts.
        """
        times = records.index.asi8
        start = self.memory.start(times, first)
        exact = self._exact(records.iloc[start:])[first - start :]
        size = np.clip(np.abs(exact), 1.0, LARGEST)
        scale = 10.0 ** (DECIMALS - np.floor(np.log10(size)))
        from_edge = np.abs(exact * scale - np.floor(exact * scale) - 0.5)
        close = np.flatnonzero(from_edge <= CLOSE * size * scale)
        for row in close:
            exact[row] = self.alone(records, times, first + row)
        return np.round(exact * scale) / scale

    def alone(self, records: pd.DataFrame, times: NDArray[np.int64], row: int) -> float:
        """Damage index of one record by a call with just its memory."""
        return self._exact(records.iloc[self.memory.start(times, row) : row + 1])[-1]

    def check(self) -> None:
        """Refuse a detector that evaluates batches differently from all records at once, or large changes as none."""
        self._check_memory()
        self._check_monotone()

    def _check_monotone(self) -> None:
        """Refuse a detector by which a response that changes more is in alarm less; warn where no change is seen."""
        times, blind = self.trained.index.asi8, []
        row = (
            int(self.trained[self.targets].notna().sum(axis=1).to_numpy()[len(times) // 2 :].argmax()) + len(times) // 2
        )
        part = self.trained.iloc[self.memory.start(times, row) : row + 1]
        for target, deviation in zip(self.targets, self.usual[1], strict=True):
            changed = (part.assign(**{target: part[target] - size * deviation}) for size in PROBED)
            seen = np.array([self._exact(records)[-1] > self.threshold for records in changed])
            if (seen[:-1] & ~seen[1:]).any():
                lost = int(np.flatnonzero(seen[:-1] & ~seen[1:])[0])
                raise ValueError(
                    f"the detector is in alarm where {target} falls by {PROBED[lost]:g} standard deviations of the "
                    f"baseline, and not where it falls by {PROBED[lost + 1]:g}. One of its steps drops or fills large "
                    "changes; expected an alarm for larger changes, too. Filter the baseline before fit"
                )
            blind += [] if seen[-1] else [str(target)]
        if blind:
            warn_user(
                f"a fall by {PROBED[-1]:g} standard deviations of the baseline stays at or below the threshold "
                f"{self.threshold:.3g} for {', '.join(blind)}. The detector does not see damage there. Use another "
                "detector, or allow more false alarms a year",
                ResultWarning,
                "blind-detector",
            )

    def _check_memory(self) -> None:
        baseline, times = self.trained, self.trained.index.asi8
        rows = np.linspace(len(times) // 2, min(len(times) // 2 + N_AROUND, len(times) - 1), N_CHECKED).astype(np.intp)
        start = max(self.memory.start(times, int(rows[0])) - N_AROUND, 0)
        whole = self._exact(baseline.iloc[start : rows[-1] + N_AROUND])[rows - start]
        alone = np.array([self.alone(baseline, times, int(row)) for row in rows])
        same = np.isclose(whole, alone, rtol=1e-6, atol=1e-9, equal_nan=True)
        if not same.all():
            row = int(np.argmin(same))
            raise ValueError(
                f"the damage index of {baseline.index[rows[row]]} is {whole[row]:.6g} among all records and "
                f"{alone[row]:.6g} with the records of {self.memory} before it. The detector uses later records, or "
                "earlier ones; expected steps that look back only, and lookback='48h' if that is how far"
            )

    def _exact(self, records: pd.DataFrame) -> Array:
        return _index_of(self.detector, self.columns, records)

    def explained(
        self, records: pd.DataFrame, first: int, rows: NDArray[np.intp]
    ) -> tuple[NDArray[np.object_], list[dict[str, float]]]:
        """Names of the modes that drive the index of some records from a position on, the worst first, and groups.

        Groups are those whose losses explain most of the departure, by how many standard deviations, those that cannot
        be distinguished together; none where no losses explain it, and nothing of the other records.
        """
        modes, effects = np.full(len(records) - first, "", dtype=object), [{}] * (len(records) - first)
        if not len(rows):
            return modes, effects
        start = self.memory.start(records.index.asi8, first + rows[0])
        part, places = records.iloc[start : first + rows[-1] + 1][self.columns], first + rows - start
        with without_warnings():
            standard = self.parts.standard(part, self.usual, self.targets)[places]
            found = self.parts.explanations(part)
        sizes = np.nan_to_num(np.abs(standard))
        names = list(map(str, self.targets))
        for row, size in zip(rows, np.round(sizes, 2), strict=True):
            modes[row] = ", ".join(leading(dict(zip(names, size, strict=True))))
        if found is not None:
            table, shares = np.round(found[0].iloc[places], 2), np.round(found[1][places], 4)
            for row, one, share in zip(rows, table.to_dict("records"), shares, strict=True):
                if share >= EXPLAINED:
                    effects[row] = {name: size for name, size in one.items() if size > 0}
        return modes, effects

    def causes(self, records: pd.DataFrame, rows: NDArray[np.intp]) -> list[str]:
        if not len(rows):
            return []
        start = self.memory.start(records.index.asi8, rows[0])
        part, places = records.iloc[start : rows[-1] + 1], rows - start
        with without_warnings():
            standard = self.parts.standard(part[self.columns], self.usual, self.targets)[places]
        F, T = (as_floats(part[names])[places] for names in (self.targets, self.temperatures))
        unknown = np.isnan(standard).all(axis=1)
        causes = []
        for n in range(len(rows)):
            missing = [str(name) for name, value in zip(self.targets, F[n], strict=True) if np.isnan(value)]
            if len(missing) == len(self.targets):
                causes.append("no mode has a value")
            elif self.parts.compensates and np.isnan(T[n]).all():
                causes.append("no temperature has a value")
            elif self.parts.has_window:
                causes.append("its window holds too few records with a value")
            elif unknown[n]:
                causes.append("lags find no record, or a value before it is missing")
            elif missing and self.parts.needs_every_mode:
                causes.append(f"{', '.join(missing)} missing, and the detector needs every mode")
            else:
                causes.append("the detector gives no damage index")
        return causes

    def reasons(
        self, records: pd.DataFrame, first: int, index: Array, marks: Sequence[str], outside: NDArray[np.bool_]
    ) -> list[str]:
        """Why records from a position on are not evaluated, and what else is worth saying of them, beside their marks.

        ``outside`` says which of them are extrapolated.
        """
        unknown = np.flatnonzero(np.isnan(index))
        causes = self._without_values(records, first)
        causes |= dict(zip(unknown.tolist(), self.causes(records, unknown + first), strict=True))
        said = []
        for n, (mark, is_far) in enumerate(zip(marks, outside, strict=True)):
            far = "extrapolated: temperatures outside those of the baseline" if is_far else ""
            said.append("; ".join(filter(None, [causes.get(n, ""), mark, far])))
        return said

    def _without_values(self, records: pd.DataFrame, first: int) -> dict[int, str]:
        """Which records from a position on say nothing themselves, so that others of their windows are evaluated."""
        if not self.parts.has_window:
            return {}
        lacking = {"mode": self.targets}
        if self.parts.compensates:
            lacking["temperature"] = self.temperatures
        found = {}
        for what, names in lacking.items():
            for row in np.flatnonzero(records[names].iloc[first:].isna().all(axis=1)).tolist() if names else ():
                found.setdefault(row, f"no {what} has a value: others of its window are evaluated")
        return found

    @property
    def fall_to_detect(self) -> float:
        """Fall of all responses below which a record that raises no alarm says too little; NaN if there is none."""
        return max(BLIND * self.smallest.common, LEAST_BLIND)

    def is_blind(self, records: pd.DataFrame, first: int, outside: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Which records from a position on are in weather in which the detector would not detect even a large fall."""
        if not outside.any() or np.isnan(self.smallest.common):
            return np.zeros(len(outside), dtype=bool)
        fallen = lowered(records, {name: self.fall_to_detect * records[name] for name in self.targets})
        return outside & (self.index(fallen, first) <= self.threshold)

    def extrapolated(self, records: pd.DataFrame) -> NDArray[np.bool_]:
        """Which records have a temperature outside those of the baseline, by more than a twentieth of their range."""
        if not self.temperatures:
            return np.zeros(len(records), dtype=bool)
        excess = self.weather.excess(records[self.temperatures])
        return (np.nan_to_num(excess) > BEYOND).any(axis=1)


def _index_of(detector: Any, columns: list[Any], records: pd.DataFrame) -> Array:
    with without_warnings():
        return -np.asarray(detector.score_samples(records[columns]), dtype=float)


def _losses_of(detector: Any) -> pd.DataFrame | None:
    """Loss of each damage group that moves a record by one standard deviation, and the relative changes by it."""
    directional = DetectorParts.read(detector).directional
    if directional is None:
        return None
    seen = directional.sensitivities_[directional.sensitivities_ > 0]
    return directional.directions_.loc[seen.index].div(seen, axis=0).assign(loss=1 / seen)


def _names_together(detector: DirectionalDetector) -> dict[str, str]:
    """Names of the groups of a detector, joined for those that cannot be distinguished from each other."""
    names = detector.directions_.index
    alike = pd.DataFrame(np.eye(len(names)), names, names)
    for one, other in detector.indistinguishable_:
        alike.loc[one, other] = 1.0
    together = pd.Series(connected_components(alike.to_numpy(), directed=False)[1], names)
    return {name: " or ".join(names[together == together[name]]) for name in names}
