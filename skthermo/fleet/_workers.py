"""What workers do for one bridge, what comes back from there, and joblib's processes, which may be killed."""

from __future__ import annotations

import pickle
import sys
import threading
import time
import traceback
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Generator, Hashable, Iterable, Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass, field, replace
from hashlib import sha256
from itertools import islice
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np
import pandas as pd
import sklearn
from joblib import Parallel, delayed, effective_n_jobs, parallel_config, wrap_non_picklable_objects
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, clone

import skthermo
from skthermo._core.estimators import seed_parts
from skthermo._core.parallel import single_blas_thread
from skthermo.metrics import mape
from skthermo.monitoring import Monitor, MonitorStatus

SPEED = 1  # fastest compression of zlib, which adds a checksum
LIBRARIES = {"numpy", "scipy", "pandas", "sklearn", "joblib", "threadpoolctl", "dask", "distributed"}
NOT_WATCHED = {
    "state": "",
    "last": pd.NaT,
    "n_evaluated": 0,
    "not_evaluated": np.nan,
    "alarm_rate": np.nan,
    "n_events": 0,
    "n_open": 0,
    "drift": np.nan,
    "drift_group": "",
}
"""What is said of a bridge without a monitor."""
MOST_LOST = 2  # processes that were killed while a task may have run in them, before it is run alone
KILLED = ("TerminatedWorkerError", "BrokenProcessPool", "KilledWorker", "WorkerCrashedError", "OutOfMemoryError")
WAVE = 4  # tasks for each worker of a back end that gives all results at the end


@dataclass(frozen=True)
class Failure:
    """An error of one bridge: in which stage, its type and text, and the last line of the package's or user's code."""

    stage: str
    type: str
    message: str
    where: str

    @classmethod
    def of(cls, stage: str, error: BaseException) -> Failure:
        return cls(stage, type(error).__name__, str(error), _place(error))

    def __str__(self) -> str:
        return f"{self.type}: {self.message}"


Table = ArrayLike | pd.DataFrame
Warned = tuple[str, str, int]  # kind and text of a warning, and how often it came


@dataclass(frozen=True)
class BridgeOutcome:
    """All that is known of a bridge, fitted or not, beside its fitted objects, which are bytes.

    ``content`` identifies the records, estimator and versions by which it was fitted.
    """

    name: Hashable
    content: str = ""
    is_fitted: bool = False
    facts: dict[str, float] = field(default_factory=dict)
    standing: dict[str, Any] = field(default_factory=lambda: dict(NOT_WATCHED))
    events: pd.DataFrame | None = None
    status: MonitorStatus | None = None  # at the time of the newest record
    warnings: tuple[Warned, ...] = ()
    late_warnings: tuple[Warned, ...] = ()  # of the last update
    failures: tuple[Failure, ...] = ()
    seconds: float = 0.0
    n_bytes: float = 0

    def status_at(self, now: Any, max_age: Any) -> MonitorStatus:
        """How the bridge is at a time; after an error nothing is known of its newest records."""
        error = "; ".join(str(failure) for failure in self.failures)
        if self.status is None or not self.is_fitted:
            return MonitorStatus("not evaluated", error or "there is no monitor").at(now)
        status = self.status.at(now, max_age=max_age)
        if not error:
            return status
        return replace(status, state="alarm" if status.state == "alarm" else "not evaluated", reason=error)

    @property
    def is_watched(self) -> bool:
        return self.events is not None


class Result(NamedTuple):
    """What a worker sends back: fitted objects as bytes where they are new, and evaluations of new records."""

    outcome: BridgeOutcome
    fitted: bytes | None = None
    answers: pd.DataFrame | None = None
    is_as_before: bool = False


@dataclass(frozen=True)
class BridgeFit:
    """A bridge to be fitted, unless that has been done with the same content before (``known``)."""

    name: Hashable
    maker: BaseEstimator | Callable[[], BaseEstimator]
    records: Any
    monitor: Callable[[BaseEstimator], Monitor] | None
    seed: int
    known: BridgeOutcome | None

    def __call__(self) -> Result:
        """What was found, and fitted objects as bytes; those of what is known stay as they were."""
        start, stage, outcome = time.perf_counter(), "records", BridgeOutcome(self.name)
        with _on_its_own() as caught:
            try:
                T, F = pair(call(self.records), self.name)
                outcome = replace(outcome, facts=_facts(T, F))
                stage = "maker"
                estimator = clone(call(self.maker))
                seed_parts(estimator, np.random.RandomState(self.seed))
                versions = skthermo.__version__, sklearn.__version__, joblib.__version__
                content = content_of(*versions, *map(content_or_code, (estimator, T, F, self.monitor)))
                if self.known is not None and self.known.content == content:
                    return Result(self.known, is_as_before=True)
                outcome, stage = replace(outcome, content=content), "fit"
                chain = estimator.fit(T, F)
                outcome = replace(outcome, facts=outcome.facts | {"mape": _error(chain, T, F)})
                outcome, watch = self._watched(outcome, chain, T, F)
                stage = "saving"
                fitted = pickled((chain, watch))
                outcome = replace(outcome, is_fitted=True, n_bytes=len(fitted))
            except (Exception, SystemExit) as error:
                failure, fitted = Failure.of(stage, error), None
                if not outcome.content:
                    return self.lost(failure, outcome.facts, warned(caught))
                outcome = BridgeOutcome(self.name, facts=outcome.facts, failures=(failure,))
        return Result(replace(outcome, warnings=warned(caught), seconds=time.perf_counter() - start), fitted)

    def _watched(
        self, outcome: BridgeOutcome, chain: BaseEstimator, T: Table, F: Table
    ) -> tuple[BridgeOutcome, Monitor | None]:
        """The monitor of a fitted chain; where it fails, it is tried again in the next call."""
        if self.monitor is None:
            return outcome, None
        try:
            monitor = _watching(self.monitor(chain), self.seed, T, F)
            return replace(outcome, **known_of(monitor)), monitor
        except (Exception, SystemExit) as error:
            return replace(outcome, content="", failures=(Failure.of("monitor", error),)), None

    def lost(
        self, failure: Failure, facts: dict[str, float] | None = None, warnings: tuple[Warned, ...] = ()
    ) -> Result:
        """What is known if the records or the estimator cannot be had: what was fitted before, not evaluated any
        more."""
        if self.known is not None and self.known.is_fitted:
            return Result(not_evaluated(self.known, failure, warnings))
        return Result(BridgeOutcome(self.name, facts=facts or {}, failures=(failure,), warnings=warnings))


@dataclass(frozen=True)
class BridgeUpdate:
    """New records for the monitor of a bridge."""

    name: Hashable
    outcome: BridgeOutcome
    records: Any
    storage: Any
    fitted: bytes = b""

    def __getstate__(self) -> dict[str, Any]:
        """What travels to a worker: fitted objects are read when it is its turn, and once if it travels on."""
        fitted = self.fitted if self.storage is None else self.storage.fitted(self.name)
        return vars(self) | {"storage": None, "fitted": fitted}

    def __call__(self) -> Result:
        """What is known now, fitted objects as bytes, and evaluations."""
        stage = "new records"
        with _on_its_own() as caught:
            try:
                new = call(self.records)
                new = joined(*new) if isinstance(new, tuple) else new
                stage = "update"
                chain, monitor = unpickled(self.fitted or self.storage.fitted(self.name))
                if monitor is None:
                    raise ValueError("the bridge has no monitor; expected fit_fleet(..., monitor=function of a chain)")
                answers = monitor.update(new)
                fitted = pickled((chain, monitor))
                known = known_of(monitor)
            except (Exception, SystemExit) as error:
                return self.lost(Failure.of(stage, error), warned(caught))
        known |= {"failures": (), "late_warnings": warned(caught), "n_bytes": len(fitted)}
        return Result(replace(self.outcome, **known), fitted, _answers(self.name, answers))

    def lost(self, failure: Failure, warnings: tuple[Warned, ...] = ()) -> Result:
        """The bridge as it was, with one row that says why no new record is evaluated."""
        failure = replace(failure, stage="new records" if failure.stage == "new records" else "update")
        return Result(not_evaluated(self.outcome, failure, warnings), None, _no_answer(self.name, failure))


def not_evaluated(outcome: BridgeOutcome, failure: Failure, warnings: tuple[Warned, ...] = ()) -> BridgeOutcome:
    """The bridge as it was; it is not healthy, because nothing is known of it."""
    standing = dict(outcome.standing)
    if outcome.is_watched:
        standing["state"] = "alarm" if standing["state"] == "alarm" else "not evaluated"
    return replace(outcome, standing=standing, failures=(failure,), late_warnings=warnings)


_turn = threading.RLock()  # held by the job of this process whose warnings are counted


@contextmanager
def _on_its_own() -> Iterator[list[warnings.WarningMessage]]:
    """Work of one bridge: one core, its own warnings; jobs of one process take turns, as filters belong to it."""
    with parallel_config("sequential"), single_blas_thread(), _turn, warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("ignore")
        for category in (UserWarning, RuntimeWarning, FutureWarning):  # others are for developers
            warnings.simplefilter("always", category)
        yield caught


def call(given: Any) -> Any:
    """What a function or a class gives; anything else is given as it is. Estimators are no functions."""
    is_function = callable(given) and (isinstance(given, type) or not hasattr(given, "get_params"))
    return given() if is_function else given


def pair(records: Any, name: Hashable) -> tuple[Table, Table]:
    """Temperatures and frequencies."""
    if not isinstance(records, tuple | list) or len(records) != 2:
        raise ValueError(f"records of {name!r} are {type(records).__name__!r}; expected a pair (T, F)")
    shapes = [np.shape(table) for table in records]
    if not all(shape and shape[0] for shape in shapes):
        raise ValueError(
            f"records of {name!r} have the shapes {shapes[0]} and {shapes[1]}; expected tables of temperatures and "
            "frequencies, a row for each record"
        )
    return records[0], records[1]


def joined(T: Table, F: Table) -> pd.DataFrame:
    """Temperatures and frequencies side by side, as monitors want them."""
    if not (isinstance(T, pd.DataFrame) and isinstance(F, pd.DataFrame) and T.index.equals(F.index)):
        raise ValueError(
            f"records for a monitor are {type(T).__name__} and {type(F).__name__}; expected two frames with the same "
            "stamps"
        )
    return T.join(F)


def _watching(monitor: Monitor, seed: int, T: Table, F: Table) -> Monitor:
    if not hasattr(monitor, "update") or not hasattr(monitor, "fit"):
        raise ValueError(f"monitor gave {type(monitor).__name__!r}; expected an unfitted Monitor")
    seed_parts(monitor, np.random.RandomState(seed))
    return monitor.fit(joined(T, F))


def _facts(T: Table, F: Table) -> dict[str, float]:
    missing = np.concatenate([pd.isna(np.asarray(table)).ravel() for table in (T, F)])
    return {"n_records": len(F), "gaps": float(missing.mean()) if missing.size else np.nan}


def _error(chain: BaseEstimator, T: Table, F: Table) -> float:
    report = getattr(chain, "report_", None)
    errors = report.modes["MAPE"] if report is not None else mape(np.asarray(F), np.asarray(chain.predict(T)))
    return float(np.mean(errors))


def known_of(monitor: Monitor) -> dict[str, Any]:
    """What an outcome holds of a monitor."""
    status = monitor.status(monitor.last_)
    return {"standing": standing_of(monitor), "events": monitor.events_, "status": status}


def standing_of(monitor: Monitor) -> dict[str, Any]:
    """What a monitor says of its bridge."""
    days, events, drift = monitor.days_, monitor.events_, monitor.drift_
    damage = events[events["kind"] == "damage"]
    n_evaluated, n_records = int(days["n_evaluated"].sum()), monitor.counts_["n_records"]
    standing = NOT_WATCHED | {
        "state": monitor.status(monitor.last_).state,
        "last": monitor.last_ if len(monitor.records_) else pd.NaT,
        "n_evaluated": n_evaluated,
        "not_evaluated": 1 - n_evaluated / n_records if n_records else np.nan,
        "alarm_rate": days["n_alarms"].sum() / n_evaluated if n_evaluated else np.nan,
        "n_events": len(damage),
        "n_open": int(damage["end"].isna().sum()),
    }
    certain = drift[drift["significant"]] if drift is not None else []
    if len(certain):
        group = certain["change"].abs().idxmax()
        standing |= {"drift": float(certain.loc[group, "change"]), "drift_group": str(group)}
    return standing


def _answers(name: Hashable, evaluations: pd.DataFrame) -> pd.DataFrame:
    table = evaluations.rename_axis("time").reset_index()
    table.insert(0, "bridge", pd.Series([name] * len(table), dtype=object))
    return table


def _no_answer(name: Hashable, failure: Failure) -> pd.DataFrame:
    row = {
        "bridge": name,
        "time": pd.NaT,
        "state": "not evaluated",
        "index": np.nan,
        "reason": str(failure),
        "event": 0,
    }
    return pd.DataFrame([row | {"revised": False}])


def warned(caught: list[warnings.WarningMessage]) -> tuple[Warned, ...]:
    """Kind, text and number of warnings, in the order in which they first came; of other packages, the class."""
    counts: Counter[tuple[str, str]] = Counter()
    for one in caught:
        kind = getattr(one.message, "kind", one.category.__name__)
        counts[kind, str(one.message.args[0]) if hasattr(one.message, "kind") else str(one.message)] += 1
    return tuple((kind, text, times) for (kind, text), times in counts.items())


def pickled(fitted: Any) -> bytes:
    """Fitted objects as bytes, also if they hold functions of a notebook."""
    return zlib.compress(by_value(fitted), SPEED)


def unpickled(content: bytes) -> Any:
    """Fitted objects from bytes."""
    return pickle.loads(zlib.decompress(content))


def by_value(thing: Any) -> bytes:
    """Bytes of an object, with the code of functions that no module holds."""
    return pickle.dumps(wrap_non_picklable_objects(thing, keep_wrapper=False))


def seed_of(base: int, name: Hashable) -> int:
    """The seed of a bridge, whatever the others are."""
    return int.from_bytes(sha256(f"{base} {name!r}".encode()).digest()[:4], "big")


def content_of(*parts: Any) -> str:
    """A text that is the same in every process for equal contents; of tables, values and labels count."""
    return str(joblib.hash([values_and_labels(part) for part in parts], coerce_mmap=True))


def values_and_labels(part: Any) -> Any:
    """A frame without the caches of its index; anything else as it is."""
    if not isinstance(part, pd.DataFrame):
        return part
    index = np.asarray(getattr(part.index, "asi8", part.index))
    return np.ascontiguousarray(part), index, str(part.index.dtype), list(part.columns)


def content_or_code(part: Any) -> str:
    """A text that is another one for another content; functions of scripts and notebooks count with their code."""
    code = by_value(part)
    if b"__main__" not in code:
        try:
            return content_of(part)
        except pickle.PicklingError:  # a function within a function
            pass
    return content_of(code)


def _place(error: BaseException) -> str:
    """File, line and function of the last line in the package or in the user's code."""
    frames = list(traceback.walk_tb(error.__traceback__))
    packages = [str(frame.f_globals.get("__name__", "")).partition(".")[0] for frame, _ in frames]
    foreign = LIBRARIES | sys.stdlib_module_names
    own = [one for one, package in zip(frames, packages, strict=True) if package not in foreign]
    if not own:
        return ""
    frame, line = own[-1]
    return f"{Path(frame.f_code.co_filename).name}:{line} in {frame.f_code.co_name}"


def run_tasks(tasks: Mapping[Hashable, Any], n_jobs: int | None) -> Iterator[tuple[Hashable, Any]]:
    """Names and results of tasks, as they come; each task is a function without arguments.

    If a process is killed, most back ends end all others. Tasks that may have run in it are begun again together with
    the rest, and after another time alone; one that is alone with a killed process is lost, and its ``lost(failure)``
    is the result.
    """
    left, n_lost = dict(tasks), Counter[Hashable]()
    while left:
        together = {name: task for name, task in left.items() if n_lost[name] < MOST_LOST}
        batch = together or dict(islice(left.items(), 1))
        begun: list[Hashable] = []
        try:
            with closing(_results(batch, begun, n_jobs)) as results:
                for name, result in results:
                    del left[name]
                    yield name, result
        except Exception as error:  # of the back end: tasks keep their own
            suspects = [name for name in begun if name in left]
            if not suspects:
                raise
            _refuse_what_cannot_travel({name: left[name] for name in suspects}, error)
            n_lost.update(suspects)
            for name in suspects:
                if n_lost[name] > MOST_LOST:
                    yield name, left.pop(name).lost(_killed(error))


def _results(
    tasks: Mapping[Hashable, Any], begun: list[Hashable], n_jobs: int | None
) -> Generator[tuple[Hashable, Any], None, None]:
    """Names and results; only tasks that have a worker are listed as begun."""

    def jobs(some: Iterable[tuple[Hashable, Any]]) -> Iterator[Any]:
        for name, task in some:
            begun.append(name)
            yield delayed(_run)(name, task)

    options: dict[str, Any] = {"n_jobs": n_jobs, "batch_size": 1, "pre_dispatch": "n_jobs", "max_nbytes": None}
    waiting = iter(tasks.items())
    try:
        parallel = Parallel(return_as="generator_unordered", **options)
    except ValueError:  # some back ends, such as Ray's, return all results at the end
        parallel = Parallel(**options)
        while wave := list(islice(waiting, WAVE * effective_n_jobs(n_jobs))):
            yield from parallel(jobs(wave))
    else:
        yield from parallel(jobs(waiting))


def _run(name: Hashable, task: Any) -> tuple[Hashable, Any]:
    return name, task()


def _refuse_what_cannot_travel(tasks: Mapping[Hashable, Any], error: Exception) -> None:
    """Raise an error for tasks that cannot be sent to another process."""
    for name, task in tasks.items():
        for what, part in vars(task).items():
            try:
                by_value(part)
            except Exception as problem:  # pickling fails with errors of every type
                raise ValueError(
                    f"{what} of bridge {name!r} cannot be pickled, so that no other process can get it ({problem}); "
                    "expected what can be, such as a function that makes it, or n_jobs=1"
                ) from error


def _killed(error: Exception) -> Failure:
    """What is said of a task whose process was killed each time."""
    first = str(error).strip().partition("\n")[0].partition(". ")[0]
    kind = type(error).__name__
    text = "its process was killed each time, also when it was alone: was it out of memory?"
    if kind not in KILLED:
        text = "the back end failed each time, also when it was alone"
    return Failure("process", kind, f"{text} ({first})", "")
