"""One of many bridges: its fit, its updates, and the facts about it."""

from __future__ import annotations

import pickle
import re
import time
import traceback
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
import sklearn
from joblib import wrap_non_picklable_objects
from sklearn.base import BaseEstimator, clone

import skthermo
from skthermo._core.estimators import seed_parts
from skthermo._core.memory import as_new
from skthermo._core.parallel import single_blas_thread
from skthermo._core.warnings import collected
from skthermo.exceptions import SkthermoWarning
from skthermo.metrics import mape
from skthermo.monitoring._monitor import Monitor
from skthermo.monitoring._status import MonitorStatus

Fitted = tuple[Any, Monitor | None]  # an estimator and the monitor of its bridge


@dataclass(frozen=True)
class KnownBridge:
    """All that is known of a bridge beside its fitted objects.

    ``content`` identifies the records, the estimator and the versions by which it was fitted. ``warnings`` have stage,
    kind, message and number, ``errors`` have stage, type and text, and place.
    """

    name: Hashable
    content: str = ""
    is_fitted: bool = False
    facts: dict[str, Any] = field(default_factory=dict)
    events: pd.DataFrame | None = None
    status: MonitorStatus | None = None  # at the time of the newest record
    warnings: tuple[tuple[str, str, str, int], ...] = ()
    errors: tuple[tuple[str, str, str], ...] = ()

    @property
    def is_watched(self) -> bool:
        return self.is_fitted and self.status is not None

    @property
    def error(self) -> str:
        return "; ".join(text for _, text, _ in self.errors)

    @property
    def state(self) -> str:
        """State at the newest record: "" without a monitor; nothing is healthy whose newest records failed."""
        if not self.is_watched:
            return ""
        return self.status_at(self.status.now).state

    def status_at(self, now: Any, max_age: Any = None) -> MonitorStatus:
        """Status at a time."""
        if not self.is_watched:
            return MonitorStatus("not evaluated", self.error or "there is no monitor").at(now)
        status = self.status.at(now, max_age=max_age)
        if not self.errors:
            return status
        return replace(status, state="alarm" if status.state == "alarm" else "not evaluated", reason=self.error)

    def after(self, monitor: Monitor | None) -> KnownBridge:
        """The bridge as its monitor knows it now."""
        if monitor is None:
            return self
        days, events, drift = monitor.days_, monitor.events_, monitor.drift_
        damage = events[events["kind"] == "damage"]
        n_evaluated, n_records = int(days["n_evaluated"].sum()), monitor.counts_["n_records"]
        facts = {
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
            facts |= {"drift": float(certain.loc[group, "change"]), "drift_group": str(group)}
        status = monitor.status(monitor.last_)
        return replace(self, facts=self.facts | facts, events=events, status=status)

    def failed(self, stage: str, error: BaseException) -> KnownBridge:
        """The bridge as it was, with an error and the line of code that raised it."""
        last = traceback.extract_tb(error.__traceback__)[-1:]
        places = [f"{Path(one.filename).name}:{one.lineno} in {one.name}" for one in last]
        return replace(self, errors=((stage, f"{type(error).__name__}: {error}", "".join(places)),))

    def warned(self, stage: str, found: Iterable[SkthermoWarning]) -> KnownBridge:
        """The bridge with the warnings of a stage in place of earlier ones."""
        counts = Counter((stage, one.kind, str(one.args[0])) for one in found)
        others = tuple(one for one in self.warnings if one[0] != stage)
        return replace(self, warnings=(*others, *((*one, times) for one, times in counts.items())))


def fit_bridge(
    known: KnownBridge,
    maker: Any,
    records: Any,
    monitor: Callable[[BaseEstimator], Monitor] | None,
    seed: int,
    keeps: bool,
) -> tuple[KnownBridge, Fitted | None]:
    """Fit a bridge and its monitor, unless the same was fitted before; no fitted objects where all is as it was."""
    start, stage, bridge, fitted = time.perf_counter(), "records", KnownBridge(known.name), None
    with single_blas_thread(), collected() as found:
        try:
            T, F = pair_of(called(records))
            stage = "maker"
            estimator = clone(called(maker))
            seed_parts(estimator, np.random.RandomState(seed))
            content = content_of(estimator, T, F, monitor) if keeps else ""
            if keeps and content == known.content:
                return (replace(known, errors=()) if known.errors else known), None
            missing = np.concatenate([pd.isna(np.asarray(table)).ravel() for table in (T, F)])
            facts = {"n_records": len(F), "gaps": missing.mean()}
            bridge, stage = replace(bridge, content=content, facts=facts), "fit"
            chain = estimator.fit(T, F)
            facts = facts | {"mape": error_of(chain, T, F)}
            bridge, fitted = replace(bridge, is_fitted=True, facts=facts), (chain, None)
            if monitor is not None:
                stage = "monitor"
                watch = monitor(chain)
                seed_parts(watch, np.random.RandomState(seed))
                watch.fit(joined(T, F))
                bridge, fitted = bridge.after(watch), (chain, watch)
        except Exception as error:
            if stage in ("records", "maker") and known.is_fitted:
                return known.failed(stage, error), None
            bridge = replace(bridge, content="").failed(stage, error)
    bridge = replace(bridge, facts=bridge.facts | {"seconds": time.perf_counter() - start})
    return bridge.warned("fit", found), fitted


def update_bridge(
    known: KnownBridge, opened: Callable[[], Fitted], records: Any
) -> tuple[KnownBridge, Fitted | None, pd.DataFrame]:
    """Evaluate new records of a bridge by its monitor."""
    stage, fitted = "new records", None
    with single_blas_thread(), collected() as found:
        try:
            new = called(records)
            new, stage = joined(*new) if isinstance(new, tuple) else new, "update"
            chain, monitor = opened()
            if monitor is None:
                raise ValueError("the bridge has no monitor; expected fit_fleet(..., monitor=function of a chain)")
            answers = monitor.update(new).rename_axis("time").reset_index()
            bridge, fitted = replace(known, errors=()).after(monitor), (chain, monitor)
        except Exception as error:
            bridge = known.failed(stage, error)
            row = {"time": pd.NaT, "state": "not evaluated", "index": np.nan, "reason": bridge.error, "event": 0}
            answers = pd.DataFrame([row | {"revised": False}])
    answers.insert(0, "bridge", pd.Series([known.name] * len(answers), dtype=object))
    return bridge.warned("update", found), fitted, answers


def called(given: Any) -> Any:
    """What a function or a class gives; anything else as it is. Estimators are no functions."""
    is_function = callable(given) and (isinstance(given, type) or not hasattr(given, "get_params"))
    return given() if is_function else given


def pair_of(records: Any) -> tuple[Any, Any]:
    """Temperatures and frequencies."""
    if not isinstance(records, tuple | list) or len(records) != 2:
        raise ValueError(f"records are {type(records).__name__!r}; expected a pair (T, F)")
    shapes = [np.shape(table) for table in records]
    if not all(shape and shape[0] for shape in shapes):
        raise ValueError(f"records have the shapes {shapes[0]} and {shapes[1]}; expected a row for each record")
    return records[0], records[1]


def error_of(chain: Any, T: Any, F: Any) -> float:
    """Mean absolute error of the training frequencies in percent, in-sample."""
    report = getattr(chain, "report_", None)
    return float(np.mean(mape(np.asarray(F), np.asarray(chain.predict(T))) if report is None else report.modes["MAPE"]))


def joined(T: Any, F: Any) -> pd.DataFrame:
    """Temperatures and frequencies side by side, as monitors want them."""
    if not (isinstance(T, pd.DataFrame) and isinstance(F, pd.DataFrame) and T.index.equals(F.index)):
        raise ValueError(
            f"records for a monitor are {type(T).__name__} and {type(F).__name__}; expected two frames with the same "
            "stamps"
        )
    return T.join(F)


def by_value(thing: Any) -> bytes:
    """Bytes of an object, with the code of functions that no module holds."""
    return pickle.dumps(wrap_non_picklable_objects(thing, keep_wrapper=False))


def content_of(estimator: Any, T: Any, F: Any, monitor: Any) -> str:
    """A text that is the same in every process for equal records, estimators, versions and code of the monitor."""
    versions = skthermo.__version__, sklearn.__version__
    return str(joblib.hash([versions, estimator, as_new(T), as_new(F), by_value(monitor)], coerce_mmap=True))


def given(fitted: Fitted) -> Fitted:
    """The fitted objects of a bridge that is kept in memory."""
    return fitted


def read_fitted(file: Path) -> Fitted:
    """The fitted objects of a bridge, which its file holds after the facts about it."""
    with open(file, "rb") as content:
        pickle.load(content)
        return pickle.load(content)


def read_known(file: Path) -> KnownBridge:
    """What a file holds first; one that cannot be read is a bridge that is not fitted."""
    try:
        with open(file, "rb") as content:
            return pickle.load(content)
    except Exception as error:  # damaged files raise errors of every type
        return KnownBridge(file.stem).failed("reading its file", error)


def monitor_in(monitors: Mapping[Hashable, Monitor], name: Hashable) -> Fitted:
    """No estimator, and the monitor of a bridge, from a mapping that may read it when it is asked for."""
    return None, monitors[name]


def file_of(folder: Path, name: Hashable) -> Path:
    """The file of a bridge, whose name may hold any letters."""
    shown = re.sub(r"[^\w-]+", "_", str(name))[:40]
    return folder / f"{shown}-{sha256(repr(name).encode()).hexdigest()[:10]}.bridge"


def part_of(opened: Callable[[], Fitted], part: int) -> Any:
    """The estimator (0) or the monitor (1) of a bridge that is opened for it."""
    return opened()[part]
