"""One monitor in its folder: fitted, updated, reported; each function does the work of a command on it."""

from __future__ import annotations

import argparse
import json
import logging
import os
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property
from pathlib import Path
from typing import Any

import pandas as pd

import skthermo
from skthermo._core.files import alone_with
from skthermo._core.text import counted, plain
from skthermo._core.warnings import collected, warn_each
from skthermo.commands._new_records import (
    NewFile,
    Taken,
    check_layout,
    files_in,
    joined,
    read_baseline,
    read_columns,
)
from skthermo.commands._settings import Settings, read_settings
from skthermo.exceptions import SkthermoWarning
from skthermo.monitoring import Monitor, MonitorStatus, Retraining, load_monitor
from skthermo.preprocessing.loggers.logger_files import CsvFormat, in_zone, read_file

HEALTHY, ALARM, NOT_EVALUATED, FAILED = range(4)
CODES = {"healthy": HEALTHY, "watch": HEALTHY, "alarm": ALARM, "not evaluated": NOT_EVALUATED}
NO_ALARM = ("healthy", "watch")
COUNTS = {"n_repeated": "repeated", "n_late": "late", "n_too_late": "too late"}

logger = logging.getLogger("skthermo.commands")


@dataclass
class Done:
    """What a command did with a bridge, and what it says of it.

    ``state`` and ``code`` are those of the command; ``status`` has the facts by the clock.
    """

    name: str
    state: str | None = None
    code: int = HEALTHY
    lines: list[str] = field(default_factory=list)
    status: MonitorStatus | None = None
    records: dict[str, Any] | None = None
    transitions: list[dict[str, Any]] = field(default_factory=list)
    written: list[Path] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def failed(self, error: Exception, what: str = "") -> None:
        """Note an error, which does not hide an alarm."""
        self.errors.append(f"{what}{sentence(error)}")
        self.code = self.code if self.code == ALARM else FAILED

    def facts(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "state": self.state,
            "exit_code": self.code,
            "status": None if self.status is None else self.status.as_dict(),
            "records": self.records,
            "transitions": self.transitions,
            "written": list(map(str, self.written)),
            "errors": self.errors,
        }


@dataclass(frozen=True)
class Bridge:
    """What a command is asked to work on: settings, or the file of a monitor alone."""

    file: Path
    options: argparse.Namespace

    @cached_property
    def settings(self) -> Settings | None:
        return read_settings(self.file) if self.file.suffix == ".toml" else None

    @property
    def name(self) -> str:
        return self.file.stem if self.settings is None else self.settings.name

    @property
    def monitor_file(self) -> Path:
        return self.file if self.settings is None else self.settings.path(self.settings.files.monitor)

    @property
    def taken_file(self) -> Path:
        """What was taken in from which files; named after the monitor, whose lock it is under."""
        return self.monitor_file.with_name(f"{self.monitor_file.name}.taken.json")

    @property
    def metrics_file(self) -> Path | None:
        """Where metrics are written after each command but status, which changes nothing; None for nowhere."""
        try:
            metrics = None if self.settings is None else self.settings.files.metrics
        except (OSError, ValueError):  # of settings with an error, which is reported
            return None
        return None if not metrics or self.options.name == "status" else self.settings.path(metrics)

    def alone(self) -> Any:
        """Be the only process that changes the monitor."""
        return alone_with(self.monitor_file, self.options.wait)

    def load(self) -> Monitor:
        """The monitor as it was saved; one that another version of skthermo has fitted can be fitted anew."""
        if not self.monitor_file.exists() and self.settings is not None:
            raise FileNotFoundError(
                f"there is no monitor {str(self.monitor_file)!r}; expected: skthermo fit {self.file}"
            )
        monitor = load_monitor(self.monitor_file)
        version = monitor.versions_["skthermo"]
        if self.settings is not None and version != skthermo.__version__:
            raise ValueError(
                f"{self.monitor_file} was fitted with skthermo {version}, and this is {skthermo.__version__}; expected "
                f"that version, or: skthermo fit {self.file} --replace, then update, which takes all records anew"
            )
        return monitor

    def status(self, monitor: Monitor) -> MonitorStatus:
        """The facts by the clock, or at the time that was asked for."""
        return monitor.status(self.options.now, max_age=self.settings.files.max_age if self.settings else None)

    def described(self, monitor: Monitor, done: Done, state: str | None = None, reason: str = "") -> None:
        """Say how things stand: the state of the command if there is one, else that by the clock."""
        done.status = self.status(monitor)
        done.state = done.status.state if state is None else state
        done.code = FAILED if done.errors and done.state != "alarm" else CODES[done.state]
        reason = reason or (done.status.reason if done.state != "alarm" else "")
        newest = f" (newest record {monitor.last_})" if len(monitor.days_) else ""
        why = f"{', as' if done.state == 'not evaluated' else ';'} {reason}" if reason else ""
        done.lines.append(f"state: {done.state}{newest}{why}")
        done.lines += monitor.summary().splitlines()[1:]
        self.warn_of_changes()

    def warn_of_changes(self) -> None:
        """Warn of settings that have changed since the fit, by which the monitor does not go yet."""
        before = None if self.settings is None else Taken.read(self.taken_file).settings
        changed = [] if self.settings is None or before is None else self.settings.changed_since(before)
        if changed:
            text = (
                f"{self.file}: {counted(len(changed), 'setting')} changed since the monitor was fitted: "
                f"{', '.join(changed)}; the monitor goes on with those of its fit: expected skthermo fit {self.file} "
                "--replace, or the settings as they were"
            )
            warn_each([SkthermoWarning(text, "changed-settings")])

    def append_transitions(self, monitor: Monitor, done: Done) -> None:
        """Append what has changed to the file of transitions, for whoever holds the lock of the monitor."""
        name = self.settings.files.transitions if self.settings else ""
        if not name:
            return
        own = {"bridge": self.name, "fitted": Taken.read(self.taken_file).fitted}
        try:
            done.transitions = append_lines(self.settings.path(name), monitor.transitions(), own)
        except (OSError, ValueError) as error:
            done.failed(error, f"{name} was not written: ")

    def write_page(self, monitor: Monitor, done: Done) -> None:
        """Write the page that the settings or the options name; the records are taken in, whatever becomes of it."""
        page = self.options.report
        if page is None and self.settings is not None and self.settings.files.page:
            page = self.settings.path(self.settings.files.page)
        if page is None:
            return
        from skthermo.reporting import owner_report  # a job without a page needs no drawings

        try:
            options = {} if self.settings is None else self.settings.page()
            options |= {"title": self.options.title} if self.options.title else {}
            options.pop("fdr", None)
            done.written.append(owner_report(monitor, page, now=self.options.now, **options))
        except Exception as error:  # it does not hide an alarm
            done.failed(error, f"{page} was not written: ")


def sentence(error: Exception) -> str:
    """What is wrong, in words: an error of the operating system names its file."""
    if isinstance(error, FileNotFoundError) and error.filename:
        return f"there is no file {error.filename}"
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__


def attempt(work: Callable[[Bridge, Done], None], bridge: Bridge) -> tuple[Done, Exception | None]:
    """Do the work of a command on one bridge, which fails alone."""
    done = Done(bridge.file.stem)
    try:
        done.name = bridge.name
        work(bridge, done)
    except Exception as error:  # Python's own exit code of an error would be that of an alarm
        done.code, done.lines, done.state = FAILED, [], None
        done.errors.append(sentence(error))
        return done, error
    return done, None


def fit(bridge: Bridge, done: Done) -> None:
    """Fit a monitor to its baseline, and save it."""
    settings = _of_file(bridge)
    files = [settings.path(name) for name in settings.records.baseline]
    records, layouts = read_baseline(files, settings.csv, settings.records)
    until = settings.records.until
    baseline = records if until is None else records[:until]
    with bridge.alone():
        if bridge.monitor_file.exists() and not bridge.options.replace:
            raise FileExistsError(
                f"there is a monitor {str(bridge.monitor_file)!r} already, with the events that it has seen; expected "
                "--replace to fit it anew: the old one is kept under another name"
            )
        T, F = (baseline[list(names)] for names in (settings.records.temperatures, settings.records.responses))
        monitor = settings.monitor(settings.fem(T, F)).fit(baseline)
        if bridge.monitor_file.exists():
            old = bridge.monitor_file
            try:
                kept = f"{counted(monitor.keep_acknowledgements(old), 'acknowledgement')} of the former monitor kept"
            except ValueError as error:
                kept = f"no acknowledgement of the former monitor kept: {error}"
            done.lines.append(kept)
            old.replace(old.with_name(f"{old.stem}.replaced-{datetime.now():%Y%m%d-%H%M%S}{old.suffix}"))
        monitor.save(bridge.monitor_file)
        fitted = datetime.now(UTC).isoformat(timespec="seconds")
        Taken(bridge.taken_file, layouts, {}, fitted, settings.of_a_fit).write()
    settings.path(settings.records.folder).mkdir(exist_ok=True)
    done.written.append(bridge.monitor_file)
    done.lines.append(f"fitted to {len(baseline)} records, {baseline.index[0]} to {baseline.index[-1]}")
    if len(records) > len(baseline):
        done.lines.append(f"later records of these files, for update: {len(records) - len(baseline)}")
    bridge.described(monitor, done)
    done.code = HEALTHY


def update(bridge: Bridge, done: Done, files: Sequence[Path] = ()) -> None:
    """Evaluate what is new, and save the monitor."""
    with bridge.alone():
        monitor, taken = bridge.load(), Taken.read(bridge.taken_file)
        before = monitor.counts_
        new = _given(bridge, files, monitor, done) if files else _found(bridge, taken, monitor, done)
        with collected() as findings:
            evaluated, handed = _taken_in(monitor, new, bridge, done)
        warn_each(one for one in findings if one.kind != "not-evaluated")  # said below, with all reasons
        if len(evaluated):
            monitor.save(bridge.monitor_file)
        if not files:
            for file in new:
                if file.path in handed:
                    taken.note(file, handed[file.path])
            taken.write()
        _described_update(bridge, monitor, done, evaluated, before)
        bridge.append_transitions(monitor, done)
    bridge.write_page(monitor, done)


def _given(bridge: Bridge, files: Sequence[Path], monitor: Monitor, done: Done) -> list[NewFile]:
    """Records of files that were named."""
    read = _reader(bridge, monitor)
    nothing = pd.DataFrame()
    return [
        NewFile(file, table, nothing, {}) for file in files if (table := _tried(done, file, read, file)) is not None
    ]


def _found(bridge: Bridge, taken: Taken, monitor: Monitor, done: Done) -> list[NewFile]:
    """Records of files in the folder, and of those of the baseline after its end, that were not taken in yet."""
    settings = _of_file(bridge)
    read = _reader(bridge, monitor)
    end = monitor.baseline_.index[-1]
    later = [settings.path(name) for name in settings.records.baseline] if settings.records.until else []

    def read_later(file: Path, **options: Any) -> pd.DataFrame:
        table = read(file, **options)
        return table[table.index > end]

    sources = [(file, read) for file in files_in(settings.path(settings.records.folder))]
    sources += [(file, read_later) for file in later]
    found = [_tried(done, file, taken.new_in, file, one) for file, one in sources]
    return [file for file in found if file is not None]


def _tried(done: Done, file: Path, read: Callable[..., Any], *arguments: Any) -> Any:
    """What a file gives; an error of one file leaves the others."""
    try:
        return read(*arguments)
    except (OSError, ValueError) as error:
        done.failed(error if str(file) in str(error) else ValueError(f"{file}: {sentence(error)}"))
        return None


def _reader(bridge: Bridge, monitor: Monitor) -> Callable[..., pd.DataFrame]:
    """How files of records are read, in the time zone of the monitor."""
    zone, name = monitor.last_.tz, monitor.baseline_.index.name
    settings, layouts = bridge.settings, Taken.read(bridge.taken_file).layouts
    form = CsvFormat() if settings is None else settings.csv
    given = {one: getattr(bridge.options, one) for one in ("separator", "decimal", "stamps")}
    form = replace(form, **{one: value for one, value in given.items() if value is not None})

    def read(file: Path, *, leave_unfinished: bool = False) -> pd.DataFrame:
        if settings is None:
            table = read_file(file, form, leave_unfinished=leave_unfinished)
        else:
            table = read_columns(file, form, settings.records, leave_unfinished=leave_unfinished)
            check_layout(table, file, settings.records, layouts)
        return in_zone(table, zone, file).rename_axis(name)

    return read


def _taken_in(
    monitor: Monitor, new: Sequence[NewFile], bridge: Bridge, done: Done
) -> tuple[pd.DataFrame, dict[Path, pd.DatetimeIndex]]:
    """Evaluations of the records of some files, and which stamps of each file were handed over.

    All files are one batch. If that is refused, each is one, the earliest records first, so that a wrong file does not
    keep the others out. Files with a part of the columns belong together.
    """
    columns, has_settings = list(monitor.baseline_), bridge.settings is not None
    done.lines += [_read(file.path, file.rows) for file in new]
    handed = {file.path: file.rows.index for file in new if not len(file.rows)}
    new = [file for file in new if len(file.rows)]
    parts = [file for file in new if has_settings and set(file.rows) != set(columns)]
    units = [[file] for file in new if file not in parts] + ([parts] if parts else [])
    answers = []

    def take(files: Sequence[NewFile]) -> None:
        tables = [file.rows for file in files]
        batch, waiting = joined(tables, columns) if has_settings else (pd.concat(tables), ())
        answers.append(monitor.update(batch, confirm=bridge.options.confirm))
        handed.update({file.path: batch.index for file in files})
        done.lines += [f"not in all files yet, so that they wait: {len(waiting)} stamps"] if len(waiting) else []

    if len(units) > 1:
        try:
            take(new)
            units = []
        except ValueError as error:
            logger.info("%s: the files are taken one by one, as together they are refused: %s", bridge.name, error)
    for files in sorted(units, key=lambda files: min(file.rows.index.min() for file in files)):
        _tried(done, files[0].path, take, files)
    evaluated = [one for one in answers if len(one)]
    return pd.concat(evaluated) if evaluated else pd.DataFrame(), handed


def _described_update(
    bridge: Bridge, monitor: Monitor, done: Done, evaluated: pd.DataFrame, before: dict[str, int]
) -> None:
    """What became of the records, and the state: an alarm that has ended again counts, and without a new evaluation, or
    with records of a time to come, nothing is healthy."""
    after = monitor.counts_
    counts = {name: after[name] - before[name] for name in COUNTS}
    others = ", ".join(f"{counts[name]} {text}" for name, text in COUNTS.items())
    new = evaluated[~evaluated["revised"]] if len(evaluated) else evaluated
    states = {state: int((new["state"] == state).sum()) if len(new) else 0 for state in CODES}
    is_unknown = new["state"] == "not evaluated" if len(new) else []
    reasons = new.loc[is_unknown, "reason"].value_counts().to_dict() if len(new) else {}
    remarks = new.loc[~is_unknown & (new["reason"] != ""), "reason"].value_counts().to_dict() if len(new) else {}
    n_revised, n_ahead = len(evaluated) - len(new), after["n_ahead"]
    numbers = [f"{number} {state}" for state, number in states.items() if number or state != "watch"]
    shown = f" ({', '.join(numbers)})" if len(evaluated) else ""
    done.lines.append(f"new: {len(new)}{shown}; {others}")
    done.lines += [f"evaluated anew, as records came late: {n_revised}"] if n_revised else []
    done.lines += [f"set aside, stamped too far ahead: {n_ahead}"] if n_ahead else []
    done.lines += [f"not evaluated, {reason}: {number}" for reason, number in reasons.items()]
    done.lines += [f"evaluated, with a remark, {remark}: {number}" for remark, number in remarks.items()]
    done.records = {"new": len(new), **{state.replace(" ", "_"): number for state, number in states.items()}}
    done.records |= {"revised": n_revised, "ahead": n_ahead} | {name[2:]: number for name, number in counts.items()}
    done.records["reasons"] = reasons
    has_alarm = len(evaluated) > 0 and (evaluated["state"] == "alarm").any()
    state = bridge.status(monitor).state
    if has_alarm or state == "alarm":
        bridge.described(monitor, done, "alarm", "" if state == "alarm" else "an event has opened and closed again")
    elif state in NO_ALARM and n_ahead > before["n_ahead"]:
        bridge.described(monitor, done, "not evaluated", "records are stamped too far ahead")
    elif state in NO_ALARM and not any(states[one] for one in NO_ALARM):
        bridge.described(monitor, done, "not evaluated", "no new record could be evaluated")
    else:
        bridge.described(monitor, done)


def _read(file: Path, records: pd.DataFrame) -> str:
    period = f", {records.index.min()} to {records.index.max()}" if len(records) else ""
    return f"read from {file}: {len(records)}{period}"


def status(bridge: Bridge, done: Done) -> None:
    """Say how things stand; the file is whole at any time, and needs no lock to be read."""
    monitor = bridge.load()
    bridge.described(monitor, done)
    if bridge.options.report is not None:
        bridge.write_page(monitor, done)


def report(bridge: Bridge, done: Done) -> None:
    """Write the page for the owner."""
    monitor = bridge.load()
    bridge.described(monitor, done)
    done.code = HEALTHY
    bridge.write_page(monitor, done)
    if not done.written and not done.errors:
        raise ValueError(f"{bridge.file} names no page; expected --out with the name of a file")


def acknowledge(bridge: Bridge, done: Done) -> None:
    """Say what an event was, and save the monitor."""
    options = bridge.options

    def said(monitor: Monitor) -> list[str]:
        monitor.acknowledge(options.event, harmless=options.harmless, note=options.note)
        return [f"event {options.event} is acknowledged as {'harmless' if options.harmless else 'damage'}"]

    _changed(bridge, done, said)


def discard(bridge: Bridge, done: Done) -> None:
    """Take back records that should not have been taken in, and save the monitor."""
    options = bridge.options
    _changed(bridge, done, lambda monitor: [f"records taken back: {monitor.discard(options.since, options.until)}"])


def refit(bridge: Bridge, done: Done) -> None:
    """Learn anew from the baseline and the records since, and save the monitor."""
    options = bridge.options
    _changed(bridge, done, lambda monitor: monitor.refit(until=options.until, force=options.force))


def rebaseline(bridge: Bridge, done: Done) -> None:
    """Begin a new baseline after a repair, and save the monitor."""
    options = bridge.options
    _changed(bridge, done, lambda monitor: monitor.rebaseline(options.since, until=options.until))


def _changed(bridge: Bridge, done: Done, change: Callable[[Monitor], list[str] | Retraining]) -> None:
    """Change the monitor and save it, unless that was refused; say what was changed, and how things stand."""
    with bridge.alone():
        monitor = bridge.load()
        said = change(monitor)
        refused = isinstance(said, Retraining) and not said.accepted
        if not refused:
            monitor.save(bridge.monitor_file)
        done.lines += said.summary().splitlines() if isinstance(said, Retraining) else said
        bridge.described(monitor, done)
        done.code = HEALTHY
        if refused:
            done.failed(ValueError(f"the {said.kind} was refused, and the monitor is as it was before"))
        bridge.append_transitions(monitor, done)


def _of_file(bridge: Bridge) -> Settings:
    """Settings, for what needs them."""
    if bridge.settings is None:
        raise ValueError(f"{bridge.file} is no file of settings; expected a monitor.toml, as init writes it")
    return bridge.settings


def append_lines(file: Path, entries: Sequence[Mapping[str, Any]], own: Mapping[str, str]) -> list[dict[str, Any]]:
    """Append those entries to a file of JSON lines that it does not have yet, and give them.

    ``own`` are the values that lines of this monitor have. A line that a killed command has left unfinished is
    removed; the caller holds the lock of the monitor.
    """
    known = 0
    if file.exists():
        content = file.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        for line in map(json.loads, whole.splitlines()):
            if all(line.get(name) == value for name, value in own.items()):
                known = max(known, line["id"])
        if len(whole) < len(content):
            os.truncate(file, len(whole))
    new = [dict(own) | dict(entry) for entry in entries if entry["id"] > known]
    if new:
        with open(file, "ab") as lines:
            lines.write("".join(f"{json.dumps(plain(one), ensure_ascii=False)}\n" for one in new).encode())
            lines.flush()
            os.fsync(lines.fileno())
    return new
