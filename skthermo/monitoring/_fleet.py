"""Many bridges: fitted side by side, with their monitors, in memory or in a folder, and compared."""

from __future__ import annotations

import os
import pickle
import re
import threading
import time
import traceback
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import timedelta
from hashlib import sha256
from pathlib import Path
from typing import Any

import joblib
import numpy as np
import pandas as pd
import sklearn
from joblib import delayed, wrap_non_picklable_objects
from scipy.stats import false_discovery_control
from sklearn.base import BaseEstimator, clone

import skthermo
from skthermo._core.arrays import as_random_state, check_jobs, check_path, check_size
from skthermo._core.estimators import seed_parts
from skthermo._core.files import ReadWhenAsked, alone_with, write_when_complete
from skthermo._core.frames import DAY, YEAR
from skthermo._core.memory import as_new
from skthermo._core.parallel import as_they_come, single_blas_thread, with_progress
from skthermo._core.text import SPACE, counted, counted_number, listed, percent, significant
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import SkthermoWarning
from skthermo.metrics import mape
from skthermo.monitoring._events import times_exceeded
from skthermo.monitoring._monitor import Monitor
from skthermo.monitoring._status import MonitorStatus


@dataclass(frozen=True)
class KnownBridge:
    """All that is known of a bridge, and where its fitted objects are.

    ``content`` identifies the records, the estimator and the versions by which it was fitted. ``warnings`` have stage,
    kind, message and number, ``failure`` has stage, type and text, and place. ``kept`` are the estimator and the
    monitor, the file that holds them, or a mapping that gives the monitor by the name of the bridge.
    """

    name: Hashable
    content: str = ""
    is_fitted: bool = False
    facts: dict[str, Any] = field(default_factory=dict)
    events: pd.DataFrame | None = None
    status: MonitorStatus | None = None  # at the time of the newest record; None without a monitor
    warnings: tuple[tuple[str, str, str, int], ...] = ()
    failure: tuple[str, str, str] = ("", "", "")
    kept: Any = (None, None)

    @property
    def error(self) -> str:
        return self.failure[1]

    def opened(self) -> tuple[Any, Monitor | None]:
        """The estimator and the monitor; they come after the facts in a file."""
        if isinstance(self.kept, Path):
            with open(self.kept, "rb") as content:
                pickle.load(content)
                return pickle.load(content)
        return (None, self.kept[self.name]) if isinstance(self.kept, Mapping) else self.kept

    def status_at(self, now: Any = None, max_age: Any = None) -> MonitorStatus:
        """Status at a time; nothing is healthy whose newest records failed."""
        if self.status is None:
            return MonitorStatus("not evaluated", self.error or "there is no monitor").at(now)
        status = self.status.at(now, max_age=max_age)
        state = status.state if status.state in ("alarm", "drift") else "not evaluated"
        return replace(status, state=state, reason=self.error) if self.error else status

    @property
    def state(self) -> str:
        """State at the newest record, "" without a monitor."""
        return "" if self.status is None else self.status_at(self.status.now).state

    def after(self, monitor: Monitor) -> KnownBridge:
        """The bridge as its monitor knows it now."""
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
        if drift is not None and drift["significant"].any():
            group = drift.loc[drift["significant"], "change"].abs().idxmax()
            facts |= {"drift": float(drift.loc[group, "change"]), "drift_group": str(group)}
        return replace(self, facts=self.facts | facts, events=events, status=monitor.status(monitor.last_))

    def failed(self, stage: str, error: BaseException) -> KnownBridge:
        """The bridge as it was, with an error and the line of code that raised it."""
        places = traceback.extract_tb(error.__traceback__)[-1:]
        where = "".join(f"{Path(one.filename).name}:{one.lineno} in {one.name}" for one in places)
        return replace(self, failure=(stage, f"{type(error).__name__}: {error}", where))

    def warned(self, stage: str, found: Iterable[SkthermoWarning]) -> KnownBridge:
        """The bridge with the warnings of a stage in place of earlier ones."""
        counts = Counter((stage, one.kind, str(one.args[0])) for one in found)
        if threading.current_thread() is not threading.main_thread():
            counts[stage, "not-kept", "fitted or updated in a thread: its warnings are in the log of that process"] = 1
        others = tuple(one for one in self.warnings if one[0] != stage)
        return replace(self, warnings=(*others, *((*one, times) for one, times in counts.items())))


def fit_bridge(
    known: KnownBridge, maker: Any, records: Any, monitor: Callable[[Any], Monitor] | None, seed: int, keeps: bool
) -> KnownBridge:
    """Fit a bridge and its monitor, unless the same was fitted before."""
    start, stage, bridge = time.perf_counter(), "records", KnownBridge(known.name)
    with single_blas_thread(), collected() as found:
        try:
            T, F = called(records)
            stage = "maker"
            estimator = clone(called(maker))
            seed_parts(estimator, np.random.RandomState(seed))
            versions = skthermo.__version__, sklearn.__version__
            content = [versions, estimator, as_new(T), as_new(F), by_value(monitor)]
            content = str(joblib.hash(content, coerce_mmap=True)) if keeps else ""
            if keeps and content == known.content:
                return replace(known, failure=bridge.failure)
            stage, chain = "fit", estimator.fit(T, F)
            errors = chain.report_.modes["MAPE"] if hasattr(chain, "report_") else mape(np.asarray(F), chain.predict(T))
            missing = np.concatenate([pd.isna(np.asarray(table)).ravel() for table in (T, F)])
            facts = {"n_records": len(F), "gaps": missing.mean(), "mape": float(np.mean(errors))}
            bridge = replace(bridge, content=content, is_fitted=True, facts=facts, kept=(chain, None))
            if monitor is not None:
                stage = "monitor"
                watch = monitor(chain)
                seed_parts(watch, np.random.RandomState(seed))
                watch.fit(pd.concat([T, F], axis=1))
                bridge = replace(bridge.after(watch), kept=(chain, watch))
        except Exception as error:
            if stage in ("records", "maker") and known.is_fitted:
                return known.failed(stage, error)
            bridge = replace(bridge, content="").failed(stage, error)
    bridge = replace(bridge, facts=bridge.facts | {"seconds": time.perf_counter() - start})
    return bridge.warned("fit", found)


def update_bridge(known: KnownBridge, records: Any) -> tuple[KnownBridge, pd.DataFrame]:
    """Evaluate new records of a bridge by its monitor."""
    stage = "new records"
    with single_blas_thread(), collected() as found:
        try:
            new = called(records)
            new, stage = pd.concat(new, axis=1) if isinstance(new, tuple) else new, "update"
            chain, monitor = known.opened()
            if monitor is None:
                raise ValueError("the bridge has no monitor; expected fit_fleet(..., monitor=function of a chain)")
            answers = monitor.update(new).rename_axis("time").reset_index()
            bridge = replace(known.after(monitor), failure=("", "", ""), kept=(chain, monitor))
        except Exception as error:
            bridge = known.failed(stage, error)
            row = {"time": pd.NaT, "state": "not evaluated", "index": np.nan, "reason": bridge.error, "event": 0}
            answers = pd.DataFrame([row | {"revised": False}])
    return bridge.warned("update", found), labelled(known.name, answers)


def labelled(bridge: Hashable, table: pd.DataFrame) -> pd.DataFrame:
    """A table with the name of its bridge in each row."""
    table.insert(0, "bridge", pd.Series([bridge] * len(table), table.index, dtype=object))
    return table


def called(given: Any) -> Any:
    """What a function or a class gives; anything else as it is. Estimators are no functions."""
    is_function = callable(given) and (isinstance(given, type) or not hasattr(given, "get_params"))
    return given() if is_function else given


def by_value(thing: Any) -> bytes:
    """Bytes of an object, with the code of functions that no module holds."""
    return pickle.dumps(wrap_non_picklable_objects(thing, keep_wrapper=False))


def read_known(file: Path) -> KnownBridge:
    """What a file holds first; one that cannot be read is a bridge that is not fitted."""
    try:
        with open(file, "rb") as content:
            return replace(pickle.load(content), kept=file)
    except Exception as error:  # damaged files raise errors of every type
        return KnownBridge(file.stem).failed("reading its file", error)


def file_of(folder: Path, name: Hashable) -> Path:
    """The file of a bridge, whose name may hold any letters."""
    shown = re.sub(r"[^\w-]+", "_", str(name))[:40]
    return folder / f"{shown}-{sha256(repr(name).encode()).hexdigest()[:10]}.bridge"


def fit_fleet(
    estimators: Mapping[Hashable, BaseEstimator | Callable[[], BaseEstimator]],
    records: Mapping[Hashable, Any],
    *,
    monitor: Callable[[BaseEstimator], Monitor] | None = None,
    folder: str | os.PathLike[str] | None = None,
    n_jobs: int | None = None,
    random_state: int | np.random.RandomState | None = 0,
    progress: bool | None = None,
) -> Fleet:
    """Fit many bridges, and their monitors, side by side; each fails alone.

    Parameters
    ----------
    estimators : mapping of name to estimator or function
        An unfitted estimator for each bridge, such as a `~skthermo.surrogate.DataInformedFEM`, or a function without
        arguments that makes one; a worker calls it, so that its model never is in this process.
    records : mapping of name to (T, F) or function
        Temperatures in degrees Celsius and frequencies in Hz of the healthy bridge, or a function without arguments
        that loads them in the worker.
    monitor : function, optional
        Takes a fitted estimator and gives an unfitted `~skthermo.monitoring.Monitor`, which is fitted to the same
        records. By default there are no monitors.
    folder : str or path, optional
        Where each bridge is kept as soon as it is fitted, a file for each. The same call goes on where the first was
        stopped, and fits anew what has changed. By default all is kept in memory.
    n_jobs : int, optional
        Number of bridges that are worked on at once; each has one core. By default the number of jobs of the active
        ``joblib.parallel_config``, else 1.
    random_state : int, RandomState or None, default=0
        With the name of a bridge, the seed of all its parts that have none. With None, each call fits all anew.
    progress : bool, optional
        Whether to show a progress bar on stderr. By default it appears on a terminal after one second.

    Returns
    -------
    Fleet
        Fitted bridges, their monitors, and a row for each bridge that says what became of it.

    Raises
    ------
    ValueError
        If the names of estimators and records differ.
    TimeoutError
        If another process works on the same folder.

    Warns
    -----
    UserWarning
        If bridges could not be fitted: how many and why; one that counts the warnings of all bridges by kind; if a
        monitor that has evaluated records is replaced, because its bridge has changed.

    See Also
    --------
    Fleet : What is known of the bridges afterwards, and new records for their monitors.
    skthermo.surrogate.FleetMapper : Learns from the mappers of a fleet, for a bridge with few records.

    Notes
    -----
    The result is the same, bit for bit, whatever the number of jobs, the back end of joblib (its own processes, Dask,
    Ray) and the other bridges are. Parallel parts within a bridge run one after another. Where bridges are fitted in
    threads (joblib's, or Dask's), their warnings go to the log of that process, and ``fleet.warnings`` has one row of
    the kind ``not-kept`` for each of these bridges.

    If a process is killed, for lack of memory, say, joblib ends the call with an error. With ``folder``, the bridges
    that are finished are kept, and the same call goes on with the others (:ref:`fleet-cluster`).

    Changes are found by content: records, the estimator with its model, versions, and the code of ``monitor``. Code
    that other modules hold is not looked into: use another folder when it has changed. Files are read with ``pickle``,
    which can run any code: use only folders of your own.

    Examples
    --------
    >>> from sklearn.linear_model import LinearRegression
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.monitoring import fit_fleet
    >>> years = {name: make_truss_campaign(random_state=seed) for seed, name in enumerate(["north", "south"])}
    >>> records = {name: (year.temperatures, year.frequencies) for name, year in years.items()}
    >>> fleet = fit_fleet(dict.fromkeys(records, LinearRegression()), records)
    >>> fleet
    Fleet(2 bridges, 2 fitted)
    >>> fleet.table["n_records"].to_dict()
    {'north': 365, 'south': 365}
    """
    check_jobs(n_jobs)
    for what, one in (("estimators", estimators), ("records", records)):
        if not isinstance(one, Mapping) or not one:
            raise ValueError(f"{what} are {one!r:.100}; expected a mapping of at least one name of a bridge")
    if odd := [name for name in (*estimators, *records) if name not in estimators or name not in records]:
        raise ValueError(f"bridges {odd!r:.200} have no estimator or no records; expected the same names in both")
    if monitor is not None and not callable(monitor):
        raise ValueError(
            f"monitor is {type(monitor).__name__!r}; expected a function of a fitted estimator that gives a Monitor"
        )
    generator, is_seed = as_random_state(random_state), isinstance(random_state, int | np.integer)
    base = random_state if is_seed else generator.randint(np.iinfo(np.int32).max)
    path, restarted = None if folder is None else check_path(folder, "folder"), []
    with only_user(path):
        fleet = Fleet._in(path)
        before = {name: fleet._known.get(name, KnownBridge(name)) for name in estimators}
        fleet._known = {name: before[name] for name in estimators}
        jobs = (
            delayed(fit_bridge)(before[name], maker, records[name], monitor, seed_of(base, name), path is not None)
            for name, maker in estimators.items()
        )
        for known in in_turn(jobs, len(before), n_jobs, progress):
            is_new = known.is_fitted and isinstance(known.kept, tuple)
            if before[known.name].facts.get("n_evaluated") and is_new:
                file = file_of(path, known.name)
                file.replace(file.with_suffix(".replaced"))
                restarted.append(known.name)
            if is_new or known.failure != before[known.name].failure:
                fleet._put(known)
    findings = list(fleet._findings(list(estimators), "fit"))
    if restarted:
        text = (
            f"bridges were fitted anew, because their records, estimator or monitor have changed ({named(restarted)}). "
            "Their monitors restart without earlier records and events, which files ending in .replaced keep. To "
            "continue with monitors as they were, use Fleet(folder)"
        )
        findings.append(SkthermoWarning(text, "changed-settings"))
    warn_each(findings)
    return fleet


def seed_of(base: int, name: Hashable) -> int:
    """The seed of a bridge, whatever the others are."""
    return int.from_bytes(sha256(f"{base} {name!r}".encode()).digest()[:4], "big")


def in_turn(jobs: Iterable[Any], n_bridges: int, n_jobs: int | None, progress: bool | None) -> Iterable[Any]:
    """Results of jobs as they come, beside a progress bar."""
    work = as_they_come(jobs, n_jobs=n_jobs, pre_dispatch="n_jobs", max_nbytes=None)
    return with_progress(work, n_bridges, progress, count=lambda _: 1, unit="bridges")


class Fleet:
    """Fitted bridges, their monitors, and what became of each.

    Parameters
    ----------
    folder : str or path
        That of an earlier `fit_fleet`.

    Attributes
    ----------
    chains, monitors : mapping of name to estimator and to Monitor
        Those that are fitted, read when asked for.
    table : DataFrame
        A row for each bridge, with the columns below.
    events : DataFrame
        Events of all monitors: ``bridge``, ``event`` (its number) and the columns of a monitor's ``events_``.
    warnings : DataFrame
        The package's warnings of the fits and of the last update: ``bridge``, ``stage`` ("fit" or "update"), ``kind``,
        ``message`` and ``times``, how often it came.
    errors : DataFrame
        What failed: ``bridge``, ``stage`` ("records", "maker", "fit", "monitor", or "new records" and "update" of the
        last update), ``error`` (type and text) and ``where``, the line of code.

    Raises
    ------
    ValueError
        If the folder holds no bridge.

    See Also
    --------
    fit_fleet : Fits the bridges.
    skthermo.surrogate.FleetMapper : Learns from the mappers of a fleet, for a bridge with few records.

    Notes
    -----
    Columns of ``table``: ``is_fitted``; ``error``, "" where there is none; ``n_records`` of the fit;
    ``gaps``, the share of their values that are missing; ``mape``, mean absolute error of the training frequencies in
    percent, in-sample; ``n_warnings``, and a column ``warnings KIND`` for each kind; ``state`` of the monitor
    (as in `MonitorStatus`, "" without one); ``last`` record since the fit; ``days_silent``, days
    from it to the newest record of all bridges; ``n_evaluated`` records, and the share ``not_evaluated``;
    ``alarm_rate``, the share of evaluated records in an event; ``n_events`` of damage, and those that are open,
    ``n_open``; ``drift``, the largest change of stiffness beyond its error, of ``drift_group``; ``seconds`` of the fit;
    ``megabytes`` of its file, NaN in memory.

    A bridge whose new records could not be evaluated is "not evaluated", or in its alarm or drift.

    Examples
    --------
    >>> from skthermo.monitoring import Fleet
    >>> Fleet("no such folder")
    Traceback (most recent call last):
    ...
    ValueError: the folder 'no such folder' holds no bridge; expected the folder of a fit_fleet
    """

    def __init__(self, folder: str | os.PathLike[str]):
        self._folder, self._known = check_path(folder, "folder"), {}
        self._read()
        if not self._known:
            raise ValueError(f"the folder {str(folder)!r} holds no bridge; expected the folder of a fit_fleet")

    @classmethod
    def _in(cls, folder: Path | None) -> Fleet:
        """A fleet in memory, or in a folder that may be empty."""
        fleet = cls.__new__(cls)
        fleet._folder, fleet._known = folder, {}
        fleet._read()
        return fleet

    def _read(self) -> None:
        """Read what the folder holds."""
        for file in sorted(self._folder.glob("*.bridge")) if self._folder else ():
            known = read_known(file)
            self._known[known.name] = known

    def _put(self, known: KnownBridge) -> None:
        """Keep a bridge, in its file if there is a folder."""
        if self._folder is not None:
            file = file_of(self._folder, known.name)
            write_when_complete(file, pickle.dumps(replace(known, kept=None)) + by_value(known.opened()))
            known = replace(known, kept=file)
        self._known[known.name] = known

    @classmethod
    def of_monitors(
        cls, monitors: Mapping[Hashable, Monitor], errors: Mapping[Hashable, Exception] | None = None
    ) -> Fleet:
        """A fleet, in memory, of monitors that were fitted one by one.

        Parameters
        ----------
        monitors : mapping of name to Monitor
            Fitted monitors. The mapping is asked for one each time that it is needed, so that it may read it from its
            file.
        errors : mapping of name to exception, optional
            Bridges whose newest records, or whose monitor, could not be used, and why.

        Returns
        -------
        Fleet
            Its ``chains`` are None.

        Raises
        ------
        ValueError
            If there is no bridge.
        NotFittedError
            If a monitor is not fitted.
        """
        fleet = cls._in(None)
        for name, monitor in monitors.items():
            facts = {"n_records": len(monitor.baseline_)}
            fleet._known[name] = KnownBridge(name, is_fitted=True, facts=facts, kept=monitors).after(monitor)
        for name, error in (errors or {}).items():
            fleet._known[name] = fleet._known.get(name, KnownBridge(name)).failed("update", error)
        if not fleet._known:
            raise ValueError("there are no monitors; expected at least one")
        return fleet

    def __len__(self) -> int:
        return len(self._known)

    def __repr__(self) -> str:
        return f"Fleet({len(self)} bridges, {len(self.chains)} fitted)"

    @property
    def chains(self) -> Mapping[Hashable, BaseEstimator]:
        """Fitted estimators by name, read when asked for."""
        return self._opened(0, [one for one in self._known.values() if one.is_fitted])

    @property
    def monitors(self) -> Mapping[Hashable, Monitor]:
        """Monitors by name, read when asked for."""
        return self._opened(1, [one for one in self._known.values() if one.status is not None])

    def _opened(self, place: int, known: Iterable[KnownBridge]) -> Mapping[Hashable, Any]:
        return ReadWhenAsked({one.name: lambda one=one: one.opened()[place] for one in known})

    @property
    def table(self) -> pd.DataFrame:
        """A row for each bridge."""
        usual = {"n_records": 0, "gaps": np.nan, "mape": np.nan, "n_warnings": 0, "state": "", "last": pd.NaT}
        usual |= {"n_evaluated": 0, "not_evaluated": np.nan, "alarm_rate": np.nan, "n_events": 0, "n_open": 0}
        usual |= {"drift": np.nan, "drift_group": "", "seconds": np.nan}
        rows = []
        for name, one in self._known.items():
            about = {"n_warnings": sum(times for *_, times in one.warnings), "state": one.state}
            file = None if self._folder is None else file_of(self._folder, name)
            size = {"megabytes": file.stat().st_size / 1e6 if file is not None and file.exists() else np.nan}
            rows.append({"is_fitted": one.is_fitted, "error": one.error} | usual | about | one.facts | size)
        table = pd.DataFrame(rows, index=pd.Index(list(self._known), name="bridge", tupleize_cols=False))
        last = pd.Series(map(without_zone, table["last"]), table.index, dtype="datetime64[ns]")
        table.insert(table.columns.get_loc("last") + 1, "days_silent", (last.max() - last) / DAY)
        counts = self.warnings.groupby(["bridge", "kind"], sort=False)["times"].sum().unstack(fill_value=0)
        for kind in sorted(counts.columns, reverse=True):
            place = table.columns.get_loc("n_warnings") + 1
            table.insert(place, f"warnings {kind}", counts[kind].reindex(table.index, fill_value=0))
        return table

    @property
    def events(self) -> pd.DataFrame:
        """Events of all monitors."""
        known = [one for one in self._known.values() if one.events is not None]
        filled = [one for one in known if len(one.events)] or known[:1]
        tables = [labelled(one.name, one.events.reset_index()) for one in filled]
        return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=["bridge", "event"])

    @property
    def warnings(self) -> pd.DataFrame:
        """Warnings of the fits and of the last update."""
        rows = [(name, *one) for name, known in self._known.items() for one in known.warnings]
        return pd.DataFrame(rows, columns=["bridge", "stage", "kind", "message", "times"])

    @property
    def errors(self) -> pd.DataFrame:
        """What failed."""
        rows = [(name, *one.failure) for name, one in self._known.items() if one.error]
        return pd.DataFrame(rows, columns=["bridge", "stage", "error", "where"])

    def update(
        self, records: Mapping[Hashable, Any], n_jobs: int | None = None, *, progress: bool | None = None
    ) -> pd.DataFrame:
        """Evaluate records that came since, each bridge by its own monitor; each fails alone.

        Parameters
        ----------
        records : mapping of name to DataFrame, (T, F) or function
            New records of some bridges: a frame in the columns of the monitor's baseline, temperatures and frequencies
            as two frames, or a function without arguments that loads one of these in the worker.
        n_jobs : int, optional
            Number of bridges that are worked on at once.
        progress : bool, optional
            Whether to show a progress bar on stderr. By default it appears on a terminal after one second.

        Returns
        -------
        DataFrame
            A row for each record that was evaluated: ``bridge``, ``time`` and the columns of
            `~skthermo.monitoring.Monitor.update`. A bridge whose records could not be evaluated has one row without a
            time: "not evaluated", and the error as the reason.

        Raises
        ------
        ValueError
            If there is no bridge of a name.
        TimeoutError
            If another process works on the same folder.

        Warns
        -----
        UserWarning
            If bridges could not be updated: how many and why; and one that counts the warnings of all bridges by kind.

        Notes
        -----
        Monitors that were fitted in a folder are kept there as soon as they have evaluated their records. Records that
        come again are known: an update that was stopped, or whose process was killed, is simply called again.
        """
        check_jobs(n_jobs)
        if not isinstance(records, Mapping):
            raise ValueError(f"records are {records!r:.100}; expected a mapping of the names of bridges to new records")
        if unknown := [name for name in records if name not in self._known]:
            raise ValueError(
                f"records have names of no bridge ({unknown!r:.200}); expected names of the {len(self)} bridges"
            )
        answers: dict[Hashable, pd.DataFrame] = {}
        with only_user(self._folder):
            self._read()  # another process may have updated the folder since
            jobs = (delayed(update_bridge)(self._known[name], new) for name, new in records.items())
            for known, one in in_turn(jobs, len(records), n_jobs, progress):
                self._put(known)
                answers[known.name] = one
        warn_each(self._findings(list(records), "update"))
        tables = [answers[name] for name in records if len(answers[name])]
        columns = ["bridge", "time", "state", "index", "threshold", "modes", "groups", "reason", "event", "revised"]
        return (pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()).reindex(columns=columns)

    def acknowledge(self, bridge: Hashable, event: int, *, harmless: bool, note: str = "") -> None:
        """Record what the owner has found out about an event, and keep it.

        Parameters
        ----------
        bridge : str
            Name of the bridge.
        event : int
            Number of the event, as in ``events``.
        harmless : bool
            Whether the bridge is as before. Harmless events are not among `discoveries`.
        note : str, default=""
            What was found.

        Raises
        ------
        ValueError
            If there is no monitor of that name, or no such event.
        TimeoutError
            If another process works on the same folder.
        """
        if not isinstance(bridge, Hashable) or bridge not in self.monitors:
            raise ValueError(
                f"{bridge!r:.100} is no bridge with a monitor; expected one of {list(self.monitors)!r:.200}"
            )
        with only_user(self._folder):
            self._read()  # another process may have updated the folder since
            chain, monitor = self._known[bridge].opened()
            monitor.acknowledge(event, harmless=harmless, note=note)
            self._put(replace(self._known[bridge].after(monitor), kept=(chain, monitor)))

    def status(self, now: Any = None, *, max_age: str | timedelta | None = None) -> dict[Hashable, MonitorStatus]:
        """The state of each bridge at a time, and the facts behind it, for machines.

        Parameters
        ----------
        now : str or datetime, optional
            The time. By default the computer's clock tells it; if records have no time zone, the local time.
        max_age : str or timedelta, optional
            Age of a newest record beyond which nothing is healthy. By default the usual time between the records of
            the bridge, and two days more.

        Returns
        -------
        dict of name to MonitorStatus
            As `~skthermo.monitoring.Monitor.status` gives it. A bridge without a monitor, or whose newest records could
            not be used, is "not evaluated", with the reason.

        Raises
        ------
        ValueError
            If ``now`` is no time, or has a time zone where records have none; if ``max_age`` is no duration.
        """
        return {name: one.status_at(now, max_age) for name, one in self._known.items()}

    def discoveries(self, fdr: float = 0.1, *, days: float = 365.25) -> Discoveries:
        """Which open events are significant after correction for many bridges.

        Parameters
        ----------
        fdr : float, default=0.1
            False discovery rate: share of healthy ones among the significant bridges, on average.
        days : float, default=365.25
            Events that are open, or ended within so many days before the newest record of all bridges, are compared.

        Returns
        -------
        Discoveries
            Events with their p values, and which bridges are significant.

        Raises
        ------
        ValueError
            If no bridge has a monitor, or ``fdr`` is not between 0 and 1.
        """
        if not len(self.monitors):
            raise ValueError("no bridge has a monitor; expected fit_fleet(..., monitor=function of a chain)")
        return discover(self.monitors, self.table, fdr, days)

    def summary(self) -> str:
        """How many bridges were fitted, failed, and are in which state, in a few lines.

        Returns
        -------
        str
            Plain sentences.
        """
        table = self.table
        is_begun, is_watched = table["last"].notna(), table["state"] != ""
        rows = {
            "Not fitted": ~table["is_fitted"],
            "Fitted without a monitor, state not known": table["is_fitted"] & ~is_watched,
            "Without a record since the fit, state not known": is_watched & ~is_begun,
            "In alarm": table["state"] == "alarm",
            "Moved in the mean of 30 days, without an alarm (drift)": table["state"] == "drift",
            "Raised damage index without an alarm (watch)": table["state"] == "watch",
            "With damage that is known": table["state"] == "known damage",
            "Not evaluated, state not known": is_begun & (table["state"] == "not evaluated"),
            "Without a record for more than 7 days before the newest of all": table["days_silent"] > 7,
            "With an error since the fit": table["is_fitted"] & (table["error"] != ""),
        }
        n_fitted, n_healthy = table["is_fitted"].sum(), (table["state"] == "healthy").sum()
        lines = [f"{n_fitted} of {len(table)} bridges are fitted, {n_healthy} healthy."]
        lines += [f"{what}: {one.sum()} ({named(table.index[one])})." for what, one in rows.items() if one.any()]
        return "\n".join([*lines, *([f"Warnings: {kinds(self.warnings)}."] if len(self.warnings) else [])])

    def _findings(self, asked: list[Hashable], stage: str) -> Iterator[SkthermoWarning]:
        """One finding of all bridges that failed or warned."""
        failed = [name for name in asked if self._known[name].error]
        warned = self.warnings
        warned = warned[warned["bridge"].isin(asked) & (warned["stage"] == stage)]
        parts = []
        if failed:
            error = self._known[failed[0]].error
            parts.append(f"have failed ({named(failed)}), the first with {error:.300}, and their state is not known")
        if len(warned):
            parts.append(f"gave warnings: {kinds(warned)}")
        if parts:
            yield SkthermoWarning(f"bridges {', or '.join(parts)}. See fleet.errors and fleet.warnings", "bridges")


@contextmanager
def only_user(folder: Path | None) -> Iterator[None]:
    """Be the only process that works on a folder."""
    if folder is None:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    with alone_with(folder / "fleet", 60.0):
        for left in folder.glob(".*.bridge.*"):
            left.unlink(missing_ok=True)
        yield


def named(names: Iterable[Any]) -> str:
    """The first names, and how many there are besides."""
    first, rest = list(map(str, names))[:5], len(list(names)) - 5
    return ", ".join(first) + (f" and {rest} more" if rest > 0 else "")


def kinds(warned: pd.DataFrame) -> str:
    """Kinds of warnings by how many bridges gave them."""
    numbers = warned.groupby("kind")["bridge"].nunique().sort_values(ascending=False, kind="stable")
    shown = [f"{kind} ({counted(number, 'bridge')})" for kind, number in numbers.items()]
    return named(shown).replace(SPACE, " ")


@dataclass(frozen=True, repr=False)
class Discoveries:
    """Events of all bridges, and which of those that are open are significant after correction for many bridges.

    Parameters
    ----------
    fdr : float
        False discovery rate: share of healthy ones among the bridges with a significant event, on average.
    table : DataFrame
        Damage events that are open or recent, and were not acknowledged as harmless: ``bridge``, ``event`` (its number
        in the monitor's ``events_``), ``start``, ``end``, ``peak``, ``modes``, ``p_value``, ``acknowledged``, and
        ``is_discovery``: it is open, and its bridge is significant.
    p_values : Series
        By bridge that was evaluated: p value of its highest open event, 1 without one.
    level : float
        P value up to which bridges are significant.
    not_evaluated : list
        Names of bridges with a monitor that has evaluated nothing: they count neither as healthy nor as significant.
    false_discoveries_per_year : float
        Expected number of bridges with a significant event in a year at this level, if all are healthy.
    false_alarms_per_year : float
        Number for which all monitors together are set.

    Notes
    -----
    The p value of an event is the probability that a healthy bridge has so high a peak of its damage index in the time
    in which it was watched: from the rank of the peak among the highest indices of three days each of its baseline.
    The squares of higher ones are taken as exponential. Benjamini and Hochberg's procedure compares the bridges.

    References
    ----------
    Benjamini and Hochberg, *J. R. Stat. Soc. B* 57 (1995) 289-300.
    """

    fdr: float
    table: pd.DataFrame
    p_values: pd.Series
    level: float
    not_evaluated: list[Hashable]
    false_discoveries_per_year: float
    false_alarms_per_year: float

    @property
    def bridges(self) -> list[Hashable]:
        """Names of the bridges with a significant open event, the least probable first."""
        return self.table.loc[self.table["is_discovery"]].sort_values("p_value")["bridge"].unique().tolist()

    @property
    def unexplained(self) -> pd.DataFrame:
        """Events that have ended, would be significant, and were not acknowledged."""
        ended = self.table["end"].notna() & ~self.table["acknowledged"].astype(bool)
        return self.table[ended & (self.table["p_value"].astype(float) <= self.level)]

    @property
    def n_evaluated(self) -> int:
        """Number of bridges that were evaluated."""
        return len(self.p_values)

    def __repr__(self) -> str:
        return self.summary()

    def summary(self) -> str:
        """Which bridges are in alarm significantly, and how many false alarms and discoveries to expect.

        Returns
        -------
        str
            One sentence a line.
        """
        names, n_open = self.bridges, self.table.loc[self.table["end"].isna(), "bridge"].nunique()
        alarms = counted_number(float(significant(self.false_alarms_per_year, 2)), "false alarm")
        found = f"{len(names)} of them significantly after correction for many bridges{': ' if names else ''}"
        lines = [
            f"{n_open} of {self.n_evaluated} evaluated bridges are in alarm, {found}{listed(names)}."
            if n_open
            else f"None of the {self.n_evaluated} evaluated bridges is in alarm.",
            f"Expected if all bridges are healthy: {alarms} a year over all bridges, "
            f"{significant(self.false_discoveries_per_year, 2)} of them significant.",
            f"False discovery rate: {percent(self.fdr)} of the significant bridges are healthy on average.",
        ]
        lines += [f"Not evaluated, state not known: {listed(self.not_evaluated)}."] if self.not_evaluated else []
        return "\n".join(lines).replace(SPACE, " ")


def discover(monitors: Mapping[Hashable, Monitor], known: pd.DataFrame, fdr: float, days: float) -> Discoveries:
    """Compare the events of all monitors that were open within so many days before the newest record of all."""
    fdr = check_size(fdr, "fdr", 0, 1, "a number between 0 and 1, such as 0.1")
    days = check_size(days, "days", 0, 100_000, "a number of days up to 100000, such as 365")
    begin = pd.Series(map(without_zone, known["last"]), dtype="datetime64[ns]").max() - pd.Timedelta(days=days)
    tables, p_values, years, expected, not_evaluated = [], {}, {}, 0.0, []
    for name in monitors:
        try:
            monitor = monitors[name]
            expected += monitor.false_alarms_per_year
            table, n_years = events_since(monitor, begin)
        except Exception:  # damaged files raise errors of every type, which are in the table of errors
            table, n_years = pd.DataFrame(), 0.0
        if not len(table) and (known.loc[name, "state"] == "not evaluated" or not n_years):
            not_evaluated.append(name)
            continue
        peaks = monitor.baseline_peaks_.to_numpy()  # each of three days
        rates = np.array([times_exceeded(peaks, peak) for peak in table["peak"]]) / (len(peaks) * 3 * (DAY / YEAR))
        table = labelled(name, table.assign(p_value=-np.expm1(-n_years * rates)).reset_index())
        p_values[name], years[name] = table.loc[table["end"].isna(), "p_value"].min(), n_years
        tables += [table] if len(table) else []
    p = pd.Series(p_values, dtype=float).fillna(1.0)
    is_found = false_discovery_control(p) <= fdr if len(p) else np.zeros(0, dtype=bool)
    level = fdr * max(np.count_nonzero(is_found), 1) / max(len(p), 1)
    columns = ["bridge", "event", "start", "end", "peak", "modes", "p_value", "acknowledged"]
    table = pd.concat(tables, ignore_index=True)[columns] if tables else pd.DataFrame(columns=columns)
    table["is_discovery"] = table["end"].isna() & table["bridge"].isin(p.index[is_found])
    false = float(np.sum(-np.log1p(-level) / np.array(list(years.values()))))
    return Discoveries(fdr, table, p, level, not_evaluated, false, expected)


def events_since(monitor: Monitor, begin: pd.Timestamp) -> tuple[pd.DataFrame, float]:
    """Events that are open or have ended since a time, and years in which records were evaluated since their begin."""
    events = monitor.events_
    events = events[(events["kind"] == "damage") & ~events["harmless"].astype(bool)]
    if not len(monitor.days_) or pd.isna(begin):
        return events.iloc[:0], 0.0
    since = begin.tz_localize("UTC").tz_convert(monitor.last_.tz) if monitor.last_.tz else begin
    events = events[events["end"].isna() | (events["end"] >= since)]
    return events, monitor.years_watched(min([since, *events.loc[events["end"].isna(), "start"]]))


def without_zone(stamp: pd.Timestamp) -> pd.Timestamp:
    """A stamp of UTC without a time zone, so that stamps of all bridges can be compared."""
    return stamp if stamp.tzinfo is None else stamp.tz_convert("UTC").tz_localize(None)
