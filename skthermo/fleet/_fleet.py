"""What is known of many bridges, in memory or in a folder."""

from __future__ import annotations

import os
import pickle
import re
import zlib
from collections.abc import Hashable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import timedelta
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator

from skthermo._core.arrays import check_jobs, check_path
from skthermo._core.files import ReadWhenAsked, alone_with, write_when_complete
from skthermo._core.parallel import with_progress
from skthermo._core.text import counted
from skthermo._core.warnings import warn_user
from skthermo.exceptions import SkthermoWarning
from skthermo.fleet._discoveries import Discoveries, discover, without_zone
from skthermo.fleet._workers import (
    NOT_WATCHED,
    BridgeOutcome,
    BridgeUpdate,
    Failure,
    known_of,
    not_evaluated,
    pickled,
    run_tasks,
    unpickled,
)
from skthermo.monitoring import Monitor, MonitorStatus

MOST_NAMED = 5  # bridges or kinds in a sentence
SILENT = 7  # days without a record, after which a bridge counts as silent
SAID = {
    "alarm": "In alarm",
    "watch": "Raised damage index without an alarm (watch)",
    "not evaluated": "Not evaluated, state not known",
}
ANSWERS = ["bridge", "time", "state", "index", "threshold", "modes", "groups", "reason", "event", "revised"]
ENDING, REPLACED = ".bridge", ".replaced"
LONGEST = 40  # letters of a name that its file shows
SECONDS_TO_WAIT = 60.0  # for another process that works on the same folder


def _sentences(fleet: Fleet) -> Iterator[str]:
    table = fleet.table
    broken = table.index[~table["is_fitted"]]
    yield f"{int(table['is_fitted'].sum())} of {len(table)} bridges are fitted."
    if len(broken):
        yield f"Not fitted: {named(broken)}."
    fitted = table[table["is_fitted"]]
    watched = fitted[fitted["state"] != ""]
    if len(watched) < len(fitted):
        yield f"{len(fitted) - len(watched)} fitted bridges have no monitor; their state is not known."
    if len(watched):
        begun = watched["last"].notna()
        if not begun.all():
            yield (
                f"{(~begun).sum()} of {len(watched)} monitors have had no record since they were fitted; the state of "
                "their bridges is not known."
            )
        watched = watched[begun]
    if len(watched):
        state = watched["state"]
        yield (
            f"Newest records of {len(watched)} monitors: {(state == 'alarm').sum()} in alarm, "
            f"{(state == 'healthy').sum()} healthy, {(state == 'not evaluated').sum()} not evaluated."
        )
        for one, text in SAID.items():
            if (state == one).any():
                yield f"{text}: {named(watched.index[state == one])}."
        silent = watched.index[(state != "not evaluated") & (watched["days_silent"] > SILENT)]
        if len(silent):
            yield f"Without a record for more than {SILENT} days before the newest of all: {named(silent)}."
    failed = fitted.index[fitted["error"] != ""]
    if len(failed):
        yield f"Fitted, but with an error since: {named(failed)}."
    warned = fleet.warnings
    if len(warned):
        yield f"Warnings: {kinds(warned)}."


def named(names: Sequence[Hashable] | pd.Index) -> str:
    """The first names, and how many there are besides."""
    shown = ", ".join(str(name) for name in names[:MOST_NAMED])
    return shown if len(names) <= MOST_NAMED else f"{shown} and {len(names) - MOST_NAMED} more"


def kinds(warned: pd.DataFrame) -> str:
    """Kinds of warnings by how many bridges gave them."""
    numbers = warned.groupby("kind")["bridge"].nunique().sort_values(ascending=False, kind="stable")
    shown = [f"{kind} ({counted(number, 'bridge')})" for kind, number in numbers.iloc[:MOST_NAMED].items()]
    rest = [f"{len(numbers) - MOST_NAMED} other kinds"] if len(numbers) > MOST_NAMED else []
    return ", ".join(shown + rest).replace("\N{NO-BREAK SPACE}", " ")


class Fleet:
    """Fitted bridges, their monitors, and what became of each.

    Parameters
    ----------
    folder : str or path
        That of an earlier `fit_fleet`.

    Attributes
    ----------
    chains, monitors : mapping of name to estimator and to Monitor
        Those that are fitted, read when asked for, each time anew: what is done to them is not storage.
    table : DataFrame
        A row for each bridge, of which the columns are listed below.
    events : DataFrame
        Events of all monitors: ``bridge``, ``event`` (its number) and the columns of a monitor's ``events_``.
    warnings : DataFrame
        Warnings of the fits and of the last update: ``bridge``, ``stage`` ("fit" or "update"), ``kind``, ``message``
        and ``times``, how often it came.
    errors : DataFrame
        What failed: ``bridge``, ``stage`` ("records", "maker", "fit", "monitor", "saving", "process", or "new
        records" and "update" of the last update), ``error`` (type and text) and ``where``, the last line of this
        package or of your code.

    Raises
    ------
    ValueError
        If there is no such folder, or it holds no bridge.

    See Also
    --------
    fit_fleet : Fits the bridges.
    FleetPrior : What bridges have in common, for those with few records; takes a fleet.

    Notes
    -----
    Columns of ``table``: ``is_fitted``; ``error``, "" where there is none; ``n_records`` of the fit;
    ``gaps``, the share of their values that are missing; ``mape``, mean absolute error of the training frequencies in
    percent, in-sample; ``n_warnings``, and a column ``warnings KIND`` for each kind; ``state`` of the monitor
    ("healthy", "watch", "alarm", "not evaluated", "" without one); ``last`` record since the fit; ``days_silent``, days
    from it to the newest record of all bridges; ``n_evaluated`` records, and the share ``not_evaluated``;
    ``alarm_rate``, the share of evaluated records in an event; ``n_events`` of damage, and those that are open,
    ``n_open``; ``drift``, the largest change of stiffness beyond its error, of ``drift_group``; ``seconds`` of the fit;
    ``megabytes`` of the fitted objects, NaN where they are kept elsewhere.

    A bridge whose new records could not be evaluated is "not evaluated", or "alarm" while an event is open.

    Examples
    --------
    >>> from skthermo.fleet import Fleet
    >>> Fleet("no such folder")
    Traceback (most recent call last):
    ...
    ValueError: there is no folder 'no such folder'; expected that of a fit_fleet
    """

    def __init__(self, folder: str | os.PathLike[str]):
        path = check_path(folder, "folder")
        if not path.is_dir():
            raise ValueError(f"there is no folder {str(path)!r}; expected that of a fit_fleet")
        self._storage = Storage(path)
        self._storage.read()
        if not self._storage.outcomes:
            raise ValueError(f"the folder {str(path)!r} holds no bridge; expected that of a fit_fleet")

    @classmethod
    def _of(cls, storage: Storage) -> Fleet:
        fleet = cls.__new__(cls)
        fleet._storage = storage
        return fleet

    @classmethod
    def of_monitors(
        cls, monitors: Mapping[Hashable, Monitor], errors: Mapping[Hashable, Exception] | None = None
    ) -> Fleet:
        """A fleet, in memory, of monitors that were fitted one by one.

        Parameters
        ----------
        monitors : mapping of name to Monitor
            Fitted monitors. Copies of those of a dict are kept; any other mapping is asked again each time, so that it
            may read each from its file, and none stays in memory.
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
        is_copied = isinstance(monitors, dict)
        storage = Storage(elsewhere={} if is_copied else monitors)
        failures = {name: Failure.of("update", error) for name, error in (errors or {}).items()}
        for name in monitors:
            monitor = monitors[name]
            outcome = BridgeOutcome(
                name, is_fitted=True, facts={"n_records": len(monitor.baseline_)}, **known_of(monitor)
            )
            failure = failures.pop(name, None)
            outcome = outcome if failure is None else not_evaluated(outcome, failure)
            if is_copied:
                fitted = pickled((None, monitor))
                storage.put(replace(outcome, n_bytes=len(fitted)), fitted)
            else:
                storage.outcomes[name] = replace(outcome, n_bytes=np.nan)
        for name, failure in failures.items():
            storage.put(BridgeOutcome(name, failures=(failure,)), None)
        if not storage.outcomes:
            raise ValueError("there are no monitors; expected at least one")
        return cls._of(storage)

    def __len__(self) -> int:
        return len(self._outcomes)

    def __repr__(self) -> str:
        states = pd.Series([one.standing["state"] for one in self._outcomes.values()]).value_counts()
        watched = [f"{counted(len(self.monitors), 'monitor')}"] if len(self.monitors) else []
        words = {"alarm": "in alarm", "watch": "to be watched", "not evaluated": "not evaluated"}
        watched += [f"{states[state]} {text}" for state, text in words.items() if states.get(state)]
        parts = [counted(len(self), "bridge"), f"{len(self.chains)} fitted", *watched]
        return f"Fleet({', '.join(parts)})".replace("\N{NO-BREAK SPACE}", " ")

    @property
    def _outcomes(self) -> dict[Hashable, BridgeOutcome]:
        return self._storage.outcomes

    @property
    def chains(self) -> Mapping[Hashable, BaseEstimator]:
        """Fitted estimators by name, read when asked for."""
        fitted = (name for name, one in self._outcomes.items() if one.is_fitted)
        return ReadWhenAsked({name: partial(self._storage.estimator, name) for name in fitted})

    @property
    def monitors(self) -> Mapping[Hashable, Monitor]:
        """Monitors by name, read when asked for."""
        watched = (name for name, one in self._outcomes.items() if one.is_fitted and one.is_watched)
        return ReadWhenAsked({name: partial(self._storage.monitor, name) for name in watched})

    @property
    def table(self) -> pd.DataFrame:
        """A row for each bridge."""
        rows = [_row(one) for one in self._outcomes.values()]
        names = pd.Index(list(self._outcomes), name="bridge", tupleize_cols=False)
        table = pd.DataFrame(rows, index=names)
        last = pd.Series([without_zone(stamp) for stamp in table["last"]], index=names, dtype="datetime64[ns]")
        table.insert(table.columns.get_loc("last") + 1, "days_silent", (last.max() - last) / pd.Timedelta("1D"))
        warned = self.warnings
        counts = warned.groupby(["bridge", "kind"], sort=False)["times"].sum().unstack(fill_value=0)
        place = table.columns.get_loc("n_warnings") + 1
        for kind in sorted(counts.columns)[::-1]:
            table.insert(place, f"warnings {kind}", counts[kind].reindex(names, fill_value=0))
        return table

    @property
    def events(self) -> pd.DataFrame:
        """Events of all monitors."""
        tables = []
        for name, one in self._outcomes.items():
            if one.is_fitted and one.events is not None and len(one.events):
                table = one.events.reset_index()
                table.insert(0, "bridge", pd.Series([name] * len(table), dtype=object))
                tables.append(table)
        columns = ["bridge", "event", "kind", "start", "end", "peak", "peak_time", "modes", "groups", "n_alarms"]
        columns += ["acknowledged", "harmless", "note"]
        return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=columns)

    @property
    def warnings(self) -> pd.DataFrame:
        """Warnings of the fits and of the last update."""
        rows = [
            (name, stage, kind, text, times)
            for name, one in self._outcomes.items()
            for stage, warned in (("fit", one.warnings), ("update", one.late_warnings))
            for kind, text, times in warned
        ]
        return pd.DataFrame(rows, columns=["bridge", "stage", "kind", "message", "times"])

    @property
    def errors(self) -> pd.DataFrame:
        """What failed."""
        rows = [
            (name, failure.stage, str(failure), failure.where)
            for name, one in self._outcomes.items()
            for failure in one.failures
        ]
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
            If there is no bridge of a name; if records cannot be sent to another process.
        TimeoutError
            If another process works on the same folder.

        Warns
        -----
        UserWarning
            If bridges could not be updated: how many and why; and one that counts the warnings of all bridges by kind.

        Notes
        -----
        Monitors that were fitted in a folder are kept there as soon as they have evaluated their records. Records that
        come again are known, so that an update that was stopped is simply called again.
        """
        check_jobs(n_jobs)
        if not isinstance(records, Mapping):
            raise ValueError(f"records are {records!r:.100}; expected a mapping of the names of bridges to new records")
        unknown = [name for name in records if name not in self._outcomes]
        if unknown:
            raise ValueError(
                f"{len(unknown)} names of records are those of no bridge ({unknown!r:.200}); expected some of the "
                f"{len(self)} bridges"
            )
        answers: dict[Hashable, pd.DataFrame] = {}
        storage = self._storage
        with storage.alone():
            known = set(storage.outcomes)
            storage.read()  # another process may have updated the folder since
            storage.outcomes = {name: one for name, one in storage.outcomes.items() if name in known}
            tasks = {
                name: BridgeUpdate(name, storage.outcomes[name], given, storage) for name, given in records.items()
            }
            work = run_tasks(tasks, n_jobs)
            for name, result in with_progress(work, len(tasks), progress, count=lambda _: 1, unit="bridges"):
                storage.put(result.outcome, result.fitted)
                answers[name] = result.answers
        warn_of_bridges(self, list(records), "update")
        tables = [answers[name] for name in records if len(answers[name])]
        joined = pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()
        return joined.reindex(columns=ANSWERS)

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
        storage = self._storage
        with storage.alone():
            chain, monitor = unpickled(storage.fitted(bridge))
            monitor.acknowledge(event, harmless=harmless, note=note)
            storage.put(replace(storage.outcomes[bridge], **known_of(monitor)), pickled((chain, monitor)))

    def status(self, now: Any = None, *, max_age: str | timedelta | None = None) -> dict[Hashable, MonitorStatus]:
        """The state of each bridge at a time, and the facts behind it, for machines.

        Parameters
        ----------
        now : str or datetime, optional
            The time. By default that of the computer's clock; if records have no time zone, the local time.
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
        return {name: one.status_at(now, max_age) for name, one in self._outcomes.items()}

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
        standings = {name: self._outcomes[name].standing for name in self.monitors}
        return discover(self.monitors, standings, fdr, days)

    def summary(self) -> str:
        """How many bridges were fitted, failed, and are in which state, in a few lines.

        Returns
        -------
        str
            Plain sentences.
        """
        return "\n".join(_sentences(self))


def _row(one: BridgeOutcome) -> dict[str, Any]:
    facts = {"n_records": 0, "gaps": np.nan, "mape": np.nan} | one.facts
    standing = one.standing if one.is_fitted else NOT_WATCHED
    n_warnings = sum(times for _, _, times in (*one.warnings, *one.late_warnings))
    error = "; ".join(str(failure) for failure in one.failures)
    first = {"is_fitted": one.is_fitted, "error": error, **facts, "n_warnings": n_warnings}
    return first | standing | {"seconds": one.seconds, "megabytes": one.n_bytes / 1e6}


def warn_of_bridges(fleet: Fleet, names: list[Hashable] | None = None, stage: str = "fit") -> None:
    """One warning for all bridges that failed, and one for all of their warnings."""
    asked = list(fleet._outcomes) if names is None else names
    failed = [name for name in asked if fleet._outcomes[name].failures]
    if failed:
        first = fleet._outcomes[failed[0]].failures[0]
        warn_user(
            f"{len(failed)} of {len(asked)} bridges have failed ({named(failed)}), the first with {first!s:.300}. "
            "Nothing is known of their state. See fleet.errors",
            SkthermoWarning,
            "bridges-failed",
        )
    warned = fleet.warnings
    warned = warned[warned["bridge"].isin(asked) & (warned["stage"] == stage)]
    if len(warned):
        warn_user(
            f"{warned['bridge'].nunique()} of {len(asked)} bridges gave warnings: {kinds(warned)}. See fleet.warnings",
            SkthermoWarning,
            "bridges-warned",
        )


@dataclass
class Storage:
    """Outcomes by name, at hand; fitted objects as bytes in a folder or in memory, or monitors read elsewhere."""

    folder: Path | None = None
    outcomes: dict[Hashable, BridgeOutcome] = field(default_factory=dict)
    in_memory: dict[Hashable, bytes] = field(default_factory=dict)
    elsewhere: Mapping[Hashable, Monitor] = field(default_factory=dict)

    def read(self) -> None:
        """Read what the folder holds; a file that cannot be read is a bridge that is not fitted."""
        if self.folder is None:
            return
        for file in sorted(self.folder.glob(f"*{ENDING}")):
            try:
                outcome = _content(file)[0]
            except Exception as error:  # damaged files raise errors of every type
                outcome = BridgeOutcome(file.stem, failures=(Failure.of("reading its file", error),))
            self.outcomes[outcome.name] = outcome

    def put(self, outcome: BridgeOutcome, fitted: bytes | None) -> None:
        """Keep what is known of a bridge; without bytes, its fitted objects stay what they are."""
        if fitted is None:
            fitted = self.fitted(outcome.name) if outcome.is_fitted else b""
        if self.folder is None:
            self.in_memory[outcome.name] = fitted
        else:
            write_when_complete(self._file(outcome.name), zlib.compress(pickle.dumps((outcome, fitted)), level=0))
        self.outcomes[outcome.name] = outcome

    def set_aside(self, name: Hashable) -> None:
        """Keep a bridge as it was beside what follows it; nothing reads that again."""
        if self.folder is not None:
            self._file(name).replace(self._file(name).with_suffix(REPLACED))

    def fitted(self, name: Hashable) -> bytes:
        """Fitted objects of a bridge as bytes."""
        if self.folder is not None:
            return _content(self._file(name))[1]
        return self.in_memory[name] if name in self.in_memory else pickled(self.objects(name))

    def objects(self, name: Hashable) -> tuple[Any, Monitor | None]:
        """The fitted estimator of a bridge, None elsewhere, and its monitor."""
        if self.folder is None and name not in self.in_memory:
            return None, self.elsewhere[name]
        return unpickled(self.fitted(name))

    def estimator(self, name: Hashable) -> Any:
        return self.objects(name)[0]

    def monitor(self, name: Hashable) -> Any:
        return self.objects(name)[1]

    @contextmanager
    def alone(self) -> Iterator[None]:
        """Be the only process that works on the folder; what killed processes left half written is removed."""
        if self.folder is None:
            yield
            return
        self.folder.mkdir(parents=True, exist_ok=True)
        with alone_with(self.folder / "fleet", SECONDS_TO_WAIT):
            for left in self.folder.glob(f".*{ENDING}.*"):
                left.unlink(missing_ok=True)
            yield

    def _file(self, name: Hashable) -> Path:
        """The file of a bridge, whose name may hold any letters."""
        assert self.folder is not None
        shown = re.sub(r"[^\w-]+", "_", str(name))[:LONGEST]
        return self.folder / f"{shown}-{sha256(repr(name).encode()).hexdigest()[:10]}{ENDING}"


def _content(file: Path) -> tuple[BridgeOutcome, bytes]:
    """What `Storage.put` wrote, with a checksum."""
    outcome, fitted = pickle.loads(zlib.decompress(file.read_bytes()))
    return outcome, fitted
