"""One monitor in its folder: fitted, updated, reported; each method does the work of a command on it."""

from __future__ import annotations

import argparse
import json
import logging
import os
import re
import shutil
import zlib
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from functools import cached_property, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

import skthermo.reporting
from skthermo._core.files import alone_with, write_when_complete
from skthermo._core.frames import usual_step
from skthermo._core.text import counted, plain
from skthermo._core.warnings import collected, warn_each
from skthermo.commands._settings import RecordSettings, Settings, read_settings
from skthermo.exceptions import RecordsWarning, SkthermoWarning
from skthermo.monitoring import Monitor, MonitorStatus, Retraining, load_monitor
from skthermo.preprocessing.loggers.logger_files import NO_TEXT_FILES, CsvFormat, in_zone, look_at, read_file, text_of
from skthermo.preprocessing.loggers.stamps import of_the_right_clock
from skthermo.preprocessing.loggers.together import in_usual_units, joined, once
from skthermo.reporting.answers import (
    acknowledgement,
    counted_reasons,
    event_sentences,
    identified_in,
    newest_since,
    opened_since,
    regime_text,
    shifts_of,
)

HEALTHY, ALARM, NOT_EVALUATED, FAILED = range(4)
CODES = {
    "healthy": HEALTHY, "watch": HEALTHY, "known damage": HEALTHY, "drift": ALARM, "alarm": ALARM,
    "not evaluated": NOT_EVALUATED,
}  # fmt: skip
AS_BEFORE = ("records:", "damage events:", "expected:", "smallest change:")  # of a summary, what no night changes
COUNTS = {"n_repeated": "repeated", "n_late": "late", "n_too_late": "too late"}

logger = logging.getLogger("skthermo.commands")


class Bridge:
    """What a command is asked to work on, settings or the file of a monitor alone, and what it did and says.

    ``state`` and ``code`` are those of the command; ``status`` has the facts by the clock.
    """

    def __init__(self, file: Path, options: argparse.Namespace):
        self.file, self.options = file, options
        self.name = file.resolve().parent.name if file.suffix == ".toml" else file.stem  # until settings say another
        self.state: str | None = None
        self.code = HEALTHY
        self.status_: MonitorStatus | None = None
        self.records: dict[str, Any] | None = None
        self.metrics_file: Path | None = None
        self.lines: list[str] = []
        self.transitions: list[dict[str, Any]] = []
        self.identified: Any = None
        self.written: list[Path] = []
        self.errors: list[str] = []
        self.error: Exception | None = None

    def attempt(self, command: str) -> None:
        """Do the work of a command, which fails on this bridge alone."""
        try:
            if self.settings is not None:
                self.name = self.settings.name
                if self.settings.files.metrics and command != "status":  # which changes nothing
                    self.metrics_file = self.settings.path(self.settings.files.metrics)
            getattr(self, command)()
        except Exception as error:  # Python's own exit code of an error would be that of an alarm
            self.code, self.lines, self.state, self.error = FAILED, [], None, error
            self.errors.append(sentence(error))

    def facts(self) -> dict[str, Any]:
        """What JSON says of it."""
        status = None if self.status_ is None else self.status_.as_dict()
        done = {name: getattr(self, name) for name in ("name", "state", "records", "transitions", "errors")}
        found = self.identified
        done["identified"] = None if found is None else {"answer": found.answer(), "limits": found.limits()}
        return done | {"exit_code": self.code, "status": status, "written": list(map(str, self.written))}

    @cached_property
    def settings(self) -> Settings | None:
        return read_settings(self.file) if self.file.suffix == ".toml" else None

    @property
    def monitor_file(self) -> Path:
        return self.file if self.settings is None else self.settings.path(self.settings.files.monitor)

    @cached_property
    def taken(self) -> Taken:
        """What was taken in from which files, in a file named after the monitor, whose lock it is under."""
        return Taken.read(self.monitor_file.with_name(f"{self.monitor_file.name}.taken.json"))

    def alone(self) -> Any:
        """Be the only process that changes the monitor."""
        return alone_with(self.monitor_file, self.options.wait)

    def load(self) -> Monitor:
        """The monitor as it was saved; one that another version of skthermo has fitted can be fitted anew."""
        if self.settings is None:
            return load_monitor(self.monitor_file)
        if not self.monitor_file.exists():
            raise FileNotFoundError(
                f"there is no monitor {str(self.monitor_file)!r}; expected: skthermo fit {self.file}"
            )
        monitor = load_monitor(self.monitor_file)
        version = monitor.versions_["skthermo"]
        if version != skthermo.__version__:
            raise ValueError(
                f"{self.monitor_file} was fitted with skthermo {version}, and this is {skthermo.__version__}; expected "
                f"that version, or: skthermo fit {self.file} --replace, then update, which takes all records anew"
            )
        return monitor

    @property
    def call(self) -> str:
        """How the bridge is named in a call."""
        return str(self.file.parent if self.file.name == "monitor.toml" else self.file)

    def failed(self, error: Exception, what: str = "") -> None:
        """Note an error, which does not hide an alarm."""
        self.errors.append(f"{what}{sentence(error)}")
        self.code = self.code if self.code == ALARM else FAILED

    @contextmanager
    def noting_errors_of(self, file: Path) -> Iterator[None]:
        """An error of one file leaves the others."""
        try:
            yield
        except (OSError, ValueError) as error:
            self.failed(error if str(file) in str(error) else ValueError(f"{file}: {sentence(error)}"))

    def describe(self, monitor: Monitor, doubt: str = "", had_alarm: bool = False) -> None:
        """Say how things stand by the clock, or at the time that was asked for; an alarm that has ended again, and a
        doubt, come before a good state."""
        max_age = self.settings.files.max_age if self.settings else None
        self.status_ = monitor.status(self.options.now, max_age=max_age)
        self.state, reason = self.status_.state, self.status_.reason
        if had_alarm or self.state == "alarm":
            self.state, reason = "alarm", "" if self.state == "alarm" else "an event has opened and closed again"
        elif doubt and CODES[self.state] == HEALTHY:
            self.state, reason = "not evaluated", doubt
        self.code = FAILED if self.errors and CODES[self.state] != ALARM else CODES[self.state]
        newest = f" (newest record {monitor.last_})" if len(monitor.days_) else ""
        self.lines.append(f"state: {self.state}{newest}{f'; {reason}' if reason else ''}")
        for event in [one for one in self.status_.events if one["kind"] != "watch"]:
            self.lines += event_sentences(monitor, event, self.identified)
            if not event["acknowledged"]:
                self.lines.append(f"when you know what it was: {acknowledgement(event['event'], self.call)}")
        self.lines += monitor.summary().splitlines()[1:]
        before = None if self.settings is None else self.taken.settings
        if before is not None and (changed := self.settings.changed_since(before)):
            text = (
                f"{self.file}: {counted(len(changed), 'setting')} changed since the monitor was fitted: "
                f"{', '.join(changed)}; the monitor goes on with those of its fit: expected skthermo fit {self.file} "
                "--replace, or the settings as they were"
            )
            warn_each([SkthermoWarning(text, "changed-settings")])

    def identify_open(self, monitor: Monitor) -> None:
        """Find what explains an open event by the monitor's model; an error hides no alarm."""
        since = opened_since(monitor)
        if since is not None and monitor.fem is not None:
            try:
                self.identified = identified_in(monitor, since)
            except ValueError as error:
                self.lines.append(f"what has changed could not be identified: {error}")

    def fit(self) -> None:
        """Fit a monitor to its baseline, and save it."""
        settings, file = self.settings, self.monitor_file
        if settings is None:
            raise ValueError(f"{file} is no file of settings; expected a monitor.toml, as init writes it")
        paths = [settings.path(name) for name in settings.records.baseline]
        records, layouts = read_baseline(paths, settings.csv, settings.records)
        baseline = records if settings.records.until is None else records[: settings.records.until]
        with self.alone():
            if file.exists() and not self.options.replace:
                raise FileExistsError(
                    f"there is a monitor {str(file)!r} already, with the events that it has seen; expected --replace "
                    "to fit it anew: the old one is kept under another name"
                )
            T, F = (baseline[list(names)] for names in (settings.records.temperatures, settings.records.responses))
            monitor = settings.monitor(settings.fem(T, F)).fit(baseline)
            if file.exists():
                try:
                    self.lines.append(f"{counted(monitor.keep_acknowledgements(file), 'acknowledgement')} kept")
                except ValueError as error:
                    self.lines.append(f"no acknowledgement of the former monitor kept: {error}")
                shutil.copy2(file, file.with_name(f"{file.stem}.replaced-{datetime.now():%Y%m%d-%H%M%S}{file.suffix}"))
            monitor.save(file)
            fitted = datetime.now(UTC).isoformat(timespec="milliseconds")
            self.taken = Taken(self.taken.file, layouts, {}, fitted, settings.of_a_fit)
            self.taken.write()
        settings.path(settings.records.folder).mkdir(exist_ok=True)
        self.written.append(file)
        self.lines += [f"code that the settings name was run: {name}" for name in settings.code]
        self.lines.append(f"fitted to {len(baseline)} records, {baseline.index[0]} to {baseline.index[-1]}")
        if regimes := regime_text(monitor):
            self.lines.append(regimes)
        if len(records) > len(baseline):
            self.lines.append(f"later records of these files, for update: {len(records) - len(baseline)}")
        self.describe(monitor)
        self.code = HEALTHY

    def update(self) -> None:
        """Evaluate what is new, and save the monitor."""
        with self.alone():
            monitor = self.load()
            before, n_known, new = monitor.counts_, len(monitor.transitions()), self._new_files(monitor)
            read = list(self.lines)  # that a file is empty, or holds no records
            with collected() as findings:
                evaluated, handed = self._take_in(monitor, new)
            warn_each(one for one in findings if one.kind != "not-evaluated")  # said below, with all reasons
            if len(evaluated):
                monitor.save(self.monitor_file)
            if not self.options.records:
                for file in new:
                    if file.path in handed:
                        self.taken.note(file, handed[file.path])
            self.identify_open(monitor)
            is_usual = self._describe_update(monitor, evaluated, before)
            self.append_transitions(monitor)
            if not self.options.verbose:
                changed = {str(one["event"]) for one in monitor.transitions(n_known)}
                self.lines = [line for line in self.lines if _is_news(line, changed)]
                if is_usual and not (changed or self.errors or read):
                    unknown = (evaluated["state"] == "not evaluated").sum()
                    came = counted(len(evaluated), "new record") + (f" ({unknown} not evaluated)" if unknown else "")
                    (state,) = [line for line in self.lines if line.startswith("state: ")]
                    self.lines = [f"{state}; {came}, nothing has changed".replace("\N{NO-BREAK SPACE}", " ")]
            self._keep_state()
        self.write_page(monitor)

    def _keep_state(self) -> None:
        """Keep what was said and taken in for the next call."""
        self.taken.state = self.state
        self.taken.write()

    def _layouts(self) -> list[list[str]]:
        """Columns of each file of the baseline; they are read anew where what the fit has left of them is lost."""
        try:
            records, form = self.settings.records, self.settings.csv
            files = [] if self.taken.layouts else map(self.settings.path, records.baseline)
            self.taken.layouts += [list(read_columns(file, form, records)) for file in files]
        except (OSError, ValueError) as error:
            raise ValueError(
                f"{self.taken.file} is lost, and columns of the baseline's files cannot be read: {sentence(error)}; "
                f"expected one of them from a backup, or skthermo fit {self.file} --replace"
            ) from error
        return self.taken.layouts

    def _new_files(self, monitor: Monitor) -> list[NewFile]:
        """Files with rows to take in: those that are named, or those of the folder, and of the baseline's files after
        its end, that were not taken in yet."""
        settings, named, taken = self.settings, self.options.records, self.taken
        given = {name: getattr(self.options, name) for name in ("separator", "decimal", "stamps")}
        form = CsvFormat() if settings is None else settings.csv
        form = replace(form, **{name: value for name, value in given.items() if value is not None})

        def read(file: Path, after: pd.Timestamp | None = None, leave_unfinished: bool = False) -> pd.DataFrame:
            if settings is None:
                table = read_file(file, form, leave_unfinished=leave_unfinished)
            else:
                options = {"leave_unfinished": leave_unfinished}
                try:
                    table = read_columns(file, form, settings.records, **options)
                except ValueError:
                    of_baseline = {Path(name).suffix.lower() for name in settings.records.baseline}
                    if not of_baseline <= {*NO_TEXT_FILES} or file.suffix.lower() in NO_TEXT_FILES:
                        raise  # [csv] was found in text files, and not in workbooks, which say nothing of texts
                    own = look_at(file, form.time_zone, wanted=settings.records.columns).form
                    table = read_columns(file, replace(own, missing=form.missing), settings.records, **options)
                if set(table) != set(settings.records.columns):
                    check_layout(table, file, settings.records, self._layouts())
            table = in_zone(table, monitor.last_.tz, file).rename_axis(monitor.baseline_.index.name)
            return table if after is None else table[table.index > after]

        sources: dict[Path, pd.Timestamp | None] = dict.fromkeys(named)
        if not named:
            folder = settings.path(settings.records.folder)
            if not folder.is_dir():
                self.failed(FileNotFoundError(f"there is no folder {folder}; expected it, with the new records"))
            for file in files_in(folder):
                sources[file] = None
                if why := taken.why_no_records(file, settings.records.columns):
                    self.lines.append(f"no records in {file}: {why}")
            later = settings.records.baseline if settings.records.until else []
            sources |= {settings.path(name): monitor.baseline_.index[-1] for name in later}
        found = []
        for file, after in sources.items():
            with self.noting_errors_of(file):
                reader = partial(read, after=after)
                found.append(NewFile(file, reader(file), pd.DataFrame(), {}) if named else taken.new_in(file, reader))
        return [file for file in found if file is not None]

    def _take_in(self, monitor: Monitor, new: Sequence[NewFile]) -> tuple[pd.DataFrame, dict[Path, pd.DatetimeIndex]]:
        """Evaluations of the records of some files, and which stamps of each file were handed over.

        All files are one batch. If that is refused, each is one, the earliest records first, so that a wrong file does
        not keep the others out. Files with a part of the columns belong together.
        """
        columns, has_settings = list(monitor.baseline_), self.settings is not None
        for file in new:
            period = f", {file.rows.index.min()} to {file.rows.index.max()}" if len(file.rows) else ""
            self.lines.append(f"read from {file.path}: {len(file.rows)}{period}")
        handed = {file.path: file.rows.index for file in new if not len(file.rows)}
        new = [file for file in new if len(file.rows)]
        parts = [file for file in new if has_settings and set(file.rows) != set(columns)]
        units = [[file] for file in new if file not in parts] + ([parts] if parts else [])
        answers = []

        def take(files: Sequence[NewFile]) -> None:
            tables = [file.rows for file in files]
            batch, waiting = joined(tables, columns) if has_settings else (pd.concat(tables), ())
            answers.append(monitor.update(batch, confirm=self.options.confirm))
            done = batch.index
            if len(waiting):
                between = _between(waiting, monitor.records_.index, usual_step(monitor.baseline_.index))
                done = done.union(waiting[between])
                notes = {"stamps not in all files yet, so that they wait": ~between}
                notes["stamps left out, between records and not in all files"] = between
                self.lines += [f"{note}: {rows.sum()}" for note, rows in notes.items() if rows.any()]
            handed.update({file.path: done for file in files})

        if len(units) > 1:
            try:
                take(new)
                units = []
            except ValueError as error:
                logger.info("%s: the files are taken one by one, as together they are refused: %s", self.name, error)
        for files in sorted(units, key=lambda files: min(file.rows.index.min() for file in files)):
            with self.noting_errors_of(files[0].path):
                take(files)
        answers = [one for one in answers if len(one)]
        return pd.concat(answers) if answers else pd.DataFrame(columns=["state", "reason", "revised"]), handed

    def _describe_update(self, monitor: Monitor, evaluated: pd.DataFrame, before: dict[str, int]) -> bool:
        """What became of the records, and the state; whether all is as after the call before.

        An alarm that has ended again counts, and without a new evaluation, or with records of a time to come, nothing
        is healthy.
        """
        counts = {name: number - before[name] for name, number in monitor.counts_.items()}
        n_ahead, new = counts["n_ahead"], evaluated[~evaluated["revised"].astype(bool)]
        states = new["state"].value_counts().reindex(list(CODES), fill_value=0).to_dict()
        is_unknown = new["state"] == "not evaluated"
        reasons, remarks = (counted_reasons(new.loc[rows, "reason"]) for rows in (is_unknown, ~is_unknown))
        always = ("healthy", "alarm", "not evaluated")
        shown = ", ".join(f"{number} {state}" for state, number in states.items() if number or state in always)
        others = ", ".join(f"{counts[name]} {text}" for name, text in COUNTS.items())
        self.lines.append(f"new: {len(new)}{f' ({shown})' if len(evaluated) else ''}; {others}")
        notes = {"evaluated anew, as records came late or a sensor had failed": len(evaluated) - len(new)}
        notes |= {"set aside, stamped too far ahead": n_ahead}
        notes |= {f"not evaluated, {reason}": number for reason, number in reasons.items()}
        notes |= {f"evaluated, with a remark, {remark}": number for remark, number in remarks.items()}
        self.lines += [f"{note}: {number}" for note, number in notes.items() if number]
        self.records = {"new": len(new), **{state.replace(" ", "_"): number for state, number in states.items()}}
        ahead = monitor.counts_["n_ahead"]
        self.records |= {"revised": len(evaluated) - len(new), "ahead": ahead, "reasons": reasons}
        self.records |= {name.removeprefix("n_"): counts[name] for name in COUNTS}
        doubt = "records are stamped too far ahead" if n_ahead > 0 else ""
        if not doubt and is_unknown.all():
            doubt = "no new record could be evaluated" if len(new) else "no new record has come"
        self.describe(monitor, doubt, bool((evaluated["state"] == "alarm").any()))
        is_usual = len(new) == len(evaluated) and not (n_ahead or any(counts[name] for name in COUNTS))
        return is_usual and self.state == self.taken.state

    def append_transitions(self, monitor: Monitor) -> None:
        """Append what has changed to the file of transitions, for whoever holds the lock of the monitor."""
        name = self.settings.files.transitions if self.settings else ""
        if not name:
            return
        own = {"bridge": self.name, "fitted": self.taken.fitted}
        try:
            self.transitions = append_lines(self.settings.path(name), monitor.transitions(), own)
        except (OSError, ValueError) as error:
            self.failed(error, f"{name} was not written: ")

    def write_page(self, monitor: Monitor) -> None:
        """Write the page that the settings or the options name; the records are taken in, whatever becomes of it."""
        page = self.options.report
        if page is None and self.settings is not None and self.settings.files.page:
            page = self.settings.path(self.settings.files.page)
        if page is None:
            return
        try:
            options = {} if self.settings is None else self.settings.page()
            options |= {"title": self.options.title} if self.options.title else {}
            options |= {"identified": self.identified, "settings": self.call}
            self.written.append(skthermo.reporting.owner_report(monitor, page, now=self.options.now, **options))
        except Exception as error:  # it does not hide an alarm
            self.failed(error, f"{page} was not written: ")

    def status(self) -> None:
        """Say how things stand; the file is whole at any time, and needs no lock to be read."""
        monitor = self.load()
        self.describe(monitor)
        if self.options.report is not None:
            self.identify_open(monitor)
            self.write_page(monitor)

    def identify(self) -> None:
        """Say which damage explains the newest records by the model."""
        monitor = self.load()
        if monitor.fem is None:
            raise ValueError(f"{self.file} names no FE model; expected one in [fem], and a fit with it")
        since = self.options.since or opened_since(monitor) or monitor.last_ - pd.Timedelta("30D")
        self.identified = identified_in(monitor, since)
        moved = shifts_of(monitor, newest_since(monitor.corrected_, since).index)
        self.lines += [f"{name}: {100 * shift:+.2f} % against the healthy structure" for name, shift in moved.items()]
        self.lines += [*self.identified.answer(), *self.identified.limits()]

    def report(self) -> None:
        """Write the page for the owner."""
        monitor = self.load()
        self.identify_open(monitor)
        self.describe(monitor)
        self.code = HEALTHY
        self.write_page(monitor)
        if not self.written and not self.errors:
            raise ValueError(f"{self.file} names no page; expected --out with the name of a file")

    def acknowledge(self) -> None:
        """Say what an event was, and save the monitor."""
        event, harmless, note = self.options.event, self.options.harmless, self.options.note
        said = f"event {event} is acknowledged as {'harmless' if harmless else 'damage'}"
        self._change(lambda monitor: monitor.acknowledge(event, harmless=harmless, note=note) or said)

    def discard(self) -> None:
        """Take back records that should not have been taken in, and save the monitor."""
        since, until = self.options.since, self.options.until
        self._change(lambda monitor: f"records taken back: {monitor.discard(since, until)}")

    def refit(self) -> None:
        """Learn anew from the baseline and the records since, and save the monitor."""
        self._change(lambda monitor: monitor.refit(until=self.options.until, force=self.options.force))

    def rebaseline(self) -> None:
        """Begin a new baseline after a repair, and save the monitor."""
        self._change(lambda monitor: monitor.rebaseline(self.options.since, until=self.options.until))

    def _change(self, change: Callable[[Monitor], str | Retraining]) -> None:
        """Change the monitor and save it, unless that was refused; say what was changed, and how things stand."""
        with self.alone():
            monitor = self.load()
            said = change(monitor)
            refused = isinstance(said, Retraining) and not said.accepted
            if not refused:
                monitor.save(self.monitor_file)
            self.lines += (said.summary() if isinstance(said, Retraining) else said).splitlines()
            self.describe(monitor)
            self.code = HEALTHY
            if refused:
                self.failed(ValueError(f"the {said.kind} was refused, and the monitor is as it was before"))
            self.append_transitions(monitor)
            self._keep_state()


def _between(stamps: pd.DatetimeIndex, known: pd.DatetimeIndex, step: pd.Timedelta) -> NDArray[np.bool_]:
    """Which stamps are between two known records that follow each other as usual: no other file will have them."""
    after = known.searchsorted(stamps)
    is_inside = (after > 0) & (after < len(known))
    ends = after[is_inside]
    is_inside[is_inside] = known[ends] - known[ends - 1] <= 1.5 * step
    return is_inside


def _is_news(line: str, changed: Collection[str]) -> bool:
    """Whether a line of a summary is not as after the call before: of events, those that are open or have changed."""
    event = re.match(r"event (\d+):", line)
    return not line.startswith(AS_BEFORE) and (not event or "still open" in line or event[1] in changed)


def sentence(error: Exception) -> str:
    """What is wrong, in words: an error of the operating system names its file."""
    if isinstance(error, FileNotFoundError) and error.filename:
        return f"there is no file {error.filename}"
    if isinstance(error, OSError) and error.filename:
        return f"{error.filename}: {error.strerror}"
    return str(error) or type(error).__name__


def append_lines(file: Path, entries: Sequence[Mapping[str, Any]], own: Mapping[str, str]) -> list[dict[str, Any]]:
    """Append those entries to a file of JSON lines that it does not have yet, and give them.

    ``own`` are the name of the bridge, which may be a new one, and the time of the fit, by which its lines are known;
    where that is lost, it is the time in the last line. A line that a killed command has left unfinished is removed;
    the caller holds the lock of the monitor.
    """
    lines: list[dict[str, Any]] = []
    if file.exists():
        content = file.read_bytes()
        whole = content[: content.rfind(b"\n") + 1]
        for number, text in enumerate(whole.splitlines(), start=1):
            try:
                lines.append(dict(json.loads(text)))
            except (ValueError, TypeError) as error:
                raise ValueError(f"line {number} of {file} is damaged; expected JSON: mend or remove it") from error
        if len(whole) < len(content):
            os.truncate(file, len(whole))
    fitted = own["fitted"] or (lines[-1].get("fitted", "") if lines else "")
    known = max((line["id"] for line in lines if line.get("fitted") == fitted), default=0)
    new = [dict(own) | {"fitted": fitted} | dict(entry) for entry in entries if entry["id"] > known]
    if new:
        with open(file, "ab") as end:
            end.write("".join(f"{json.dumps(plain(one), ensure_ascii=False)}\n" for one in new).encode())
            end.flush()
            os.fsync(end.fileno())
    return new


@dataclass(frozen=True)
class NewFile:
    """Rows of a file that were not taken in before, after so many that were; ``seen`` says how the file was found."""

    path: Path
    rows: pd.DataFrame
    before: pd.DataFrame
    seen: Mapping[str, Any]


@dataclass
class Taken:
    """What has been taken in from which files, kept beside the monitor.

    ``layouts`` are the sets of columns that the files of the baseline have, ``fitted`` is the time of the fit,
    ``settings`` are those of the fit, and ``state`` is what the last call said. For each file there are its size,
    the time of its last change, and how many of its first rows are done, with a checksum of these. If a command is
    killed after it has saved the monitor, rows come again, and the monitor knows them.
    """

    file: Path
    layouts: list[list[str]] = field(default_factory=list)
    files: dict[str, dict[str, Any]] = field(default_factory=dict)
    fitted: str = ""
    settings: dict[str, Any] | None = None
    state: str | None = None

    @classmethod
    def read(cls, file: Path) -> Taken:
        """What an earlier call has left in a file beside the monitor; nothing if that cannot be read."""
        try:
            return cls(file, **json.loads(file.read_text(encoding="utf-8")))
        except (OSError, ValueError, TypeError):
            return cls(file)

    def write(self) -> None:
        """Keep it for the next call."""
        content = {name: value for name, value in vars(self).items() if name != "file"}
        write_when_complete(self.file, json.dumps(content, indent=1) + "\n")

    def new_in(self, file: Path, read: Any) -> NewFile | None:
        """What is new in a file; None if it is as it was when all of it was taken in."""
        known = self.files.get(self._key(file), {})
        seen = seen_of(file)
        is_as_before = seen.items() <= known.items()
        if is_as_before and known.get("whole"):
            return None
        table = read(file, leave_unfinished=not is_as_before)  # a line that is not finished may be, the next time
        n_rows = known.get("rows", 0)
        n_done = n_rows if len(table) >= n_rows and _checksum(table[:n_rows]) == known.get("checksum") else 0
        end = file.read_bytes().rstrip(b"\0")[-1:]
        is_finished = is_as_before or file.suffix.lower() in NO_TEXT_FILES or end in (b"\n", b"\r")
        return NewFile(file, table[n_done:], table[:n_done], seen | {"whole": is_finished})

    def why_no_records(self, file: Path, columns: Sequence[str]) -> str:
        """Why a new or changed file holds no records, as an empty one, or a text that names no column; it is done with
        by that. "" for others."""
        seen, known = seen_of(file), self.files.get(self._key(file), {})
        may_be_text = file.suffix.lower() == ".txt" and "rows" not in known
        if seen.items() <= known.items() or (seen["size"] and not may_be_text):
            return ""
        if any(name in text_of(file) for name in columns):
            return ""
        self.files[self._key(file)] = seen | {"whole": True}
        return "it names no column of the records" if seen["size"] else "the file is empty"

    def _key(self, file: Path) -> str:
        """How a file is called: by its path from the folder of the monitor, wherever the command is started."""
        return os.path.relpath(file, self.file.parent)

    def note(self, file: NewFile, handed: pd.DatetimeIndex) -> None:
        """Rows of a file that are done: the first ones, up to one whose stamp was not handed over."""
        waiting = ~file.rows.index.isin(handed)
        n_done = int(waiting.argmax()) if waiting.any() else len(file.rows)
        done = pd.concat([file.before, file.rows[:n_done]])
        self.files[self._key(file.path)] = dict(file.seen) | {
            "rows": len(done),
            "checksum": _checksum(done),
            "whole": file.seen["whole"] and not waiting.any(),
        }


def seen_of(file: Path) -> dict[str, int]:
    """Size of a file, and the time of its last change."""
    found = file.stat()
    return {"size": found.st_size, "changed": found.st_mtime_ns}


def _checksum(table: pd.DataFrame) -> int:
    """Of the stamps and of nine digits of the values: a program that writes the file anew may change the last bits."""
    digits = table.astype(float).map("{:.9g}".format)
    return zlib.crc32(pd.util.hash_pandas_object(digits).to_numpy().tobytes())


def files_in(folder: Path) -> list[Path]:
    """Files of records in a folder, by name; hidden and unfinished ones are left out."""
    endings = (".csv", ".txt", ".dat", ".tsv", *NO_TEXT_FILES)
    return sorted(one for one in folder.glob("*") if one.suffix.lower() in endings and one.name[0] not in "._~")


def read_columns(
    file: Path, form: CsvFormat, records: RecordSettings, *, leave_unfinished: bool = False
) -> pd.DataFrame:
    """Records of a file in the columns that the settings name, in degrees Celsius and Hz."""
    table = read_file(file, form, ignore=records.ignore, leave_unfinished=leave_unfinished)
    unknown = [name for name in table if name not in records.columns]
    if unknown:
        raise ValueError(
            f"{file} has the columns {unknown}, which [records] does not name; expected {records.columns}, and other "
            "columns under ignore"
        )
    return in_usual_units(table, records.convert)


def check_layout(table: pd.DataFrame, file: Path, records: RecordSettings, layouts: Sequence[Sequence[str]]) -> None:
    """Raise an error if a file has not the columns of a file of the baseline, or all columns."""
    known = [records.columns, *layouts]
    if not any(set(table) == set(layout) for layout in known):
        nearest = min(known, key=lambda layout: len(set(layout) ^ set(table)))
        lacking = [name for name in nearest if name not in table]
        raise ValueError(f"{file} lacks the columns {lacking}; expected {nearest}, in any order, as in the baseline")


def read_baseline(
    files: Sequence[Path], form: CsvFormat, records: RecordSettings
) -> tuple[pd.DataFrame, list[list[str]]]:
    """Records of the baseline's files, in order of time, and the columns of each file."""
    tables = [read_columns(file, form, records) for file in files]
    of_clocks = [of_the_right_clock(table, file) for table, file in zip(tables, files, strict=True)]
    tables = [table for table, _ in of_clocks]
    warn_each(finding for _, findings in of_clocks for finding in findings)
    lacking = [name for name in records.columns if not any(name in table for table in tables)]
    if lacking:
        raise ValueError(f"no file of the baseline has the columns {lacking}; expected {records.columns}")
    whole, waiting = joined(tables, records.columns)
    if not len(whole):
        stamps = ", ".join(f"{file.name} from {table.index.min()}" for file, table in zip(files, tables, strict=True))
        raise ValueError(f"no stamp is in all files of the baseline ({stamps}); expected records of the same times")
    if len(waiting):
        text = (
            f"{counted(len(waiting), 'stamp')} of the baseline are not in all files, the first {waiting.min()}. They "
            f"are left out; {len(whole)} records have all columns. If they are many, compare the clocks of the loggers"
        )
        warn_each([RecordsWarning(text, "different-rows")])
    return once(whole).sort_index(), [list(table) for table in tables]
