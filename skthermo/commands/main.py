"""Commands of nightly jobs: monitors without a line of Python.

    skthermo check T.csv F.csv                     look at records
    skthermo init T.csv F.csv --into bridge        write settings that fit them
    skthermo fit bridge/monitor.toml               fit a monitor to the baseline
    skthermo update bridge/monitor.toml            evaluate what is new in the folder bridge/new
    skthermo update bridge/monitor.toml NEW.csv    evaluate the records of a file
    skthermo status bridge/monitor.toml            say how things stand
    skthermo report bridge/monitor.toml --out PAGE write the owner's page
    skthermo acknowledge bridge/monitor.toml 3 --harmless --note "a special transport"
    skthermo rebaseline bridge/monitor.toml --since 2027-05-01
    skthermo refit bridge/monitor.toml             learn anew, the records since the fit included
    skthermo discard bridge/monitor.toml --since 2027-05-01 --until 2027-05-03

The folder stands for the monitor.toml in it, and the file of a monitor alone, .skops or .joblib, for settings. Several
settings in one call are a fleet.

Exit codes of update and status: 0 healthy, 1 alarm, 2 not evaluated (also if there was no new record), 3 an error, and
the monitor's file is as it was: no state is printed that was not saved. An alarm is 1 also if its page cannot be
written. Of several bridges: 1 if one is in alarm, else 3 if one failed, else 2 if one is not evaluated. check: 0 no
finding, 1 findings. All others: 0 done, 3 an error.
"""

from __future__ import annotations

import argparse
import json
import logging
import os
import sys
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from datetime import datetime
from functools import partial
from pathlib import Path
from typing import Any, NoReturn

import pandas as pd

import skthermo
from skthermo._core.files import ReadWhenAsked, write_when_complete
from skthermo._core.text import capital, plain
from skthermo._core.warnings import collected
from skthermo.commands import _bridge
from skthermo.commands._bridge import ALARM, CODES, FAILED, HEALTHY, NOT_EVALUATED, Bridge, Done, attempt, sentence
from skthermo.commands._settings import HOW_TO_BEGIN

MONITORS = (".toml", ".skops", ".joblib")  # endings of files that stand for a monitor
EXPLAINED = (ValueError, OSError, ImportError)  # errors that need no traceback
GAUGES = {
    "up": "1 if the last command could do its work on this bridge, else 0",
    "state": "1 for the state that the bridge is in, 0 for the others",
    "damage_index": "Damage index of the newest record that was evaluated",
    "threshold": "Damage index above which a damage event opens",
    "watch_threshold": "Damage index above which the level watch begins",
    "newest_record_timestamp_seconds": "Time of the newest record, in seconds since 1970",
    "record_age_seconds": "Age of the newest record when the metrics were written",
    "open_events": "Number of events that are open, by kind",
    "failed_sensors": "Number of sensors that have failed",
    "records": "Number of records since the baseline",
    "records_not_evaluated": "Number of records since the baseline that were not evaluated",
    "written_timestamp_seconds": "Time at which the metrics were written, in seconds since 1970",
}
"""Names of metrics, all of them gauges that begin with ``skthermo_``, and their help."""


logger = logging.getLogger("skthermo.commands")


class Parser(argparse.ArgumentParser):
    """A parser whose exit code for wrong arguments is not that of a monitor that was not evaluated."""

    def error(self, message: str) -> NoReturn:
        self.print_usage(sys.stderr)
        self.exit(FAILED, f"error: {message}\n")


class Spoken(logging.Formatter):
    """Messages as lines such as "warning: text"."""

    def format(self, record: logging.LogRecord) -> str:
        return f"{record.levelname.lower()}: {record.getMessage()}"


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; its exit code."""
    options = _parser().parse_args(arguments)
    facts: dict[str, Any] = {"skthermo": skthermo.__version__, "command": options.name, "exit_code": FAILED}
    facts |= {"time": pd.Timestamp.now("UTC"), "bridges": [], "fleet": None, "findings": None, "settings": None}
    facts |= {"warnings": [], "errors": []}
    try:
        with _logged(options):
            _run(options, facts)
    except OSError as error:
        print(f"error: {sentence(error)}", file=sys.stderr)
        facts["errors"].append(sentence(error))
    if options.json:
        _print(json.dumps(plain(facts), indent=1, ensure_ascii=False, allow_nan=False))
    return facts["exit_code"]


def _run(options: argparse.Namespace, facts: dict[str, Any]) -> None:
    """Do what was asked for, and then say each warning once."""
    with collected() as findings:
        try:
            facts["exit_code"] = options.command(options, facts)
        except Exception as error:  # Python's own exit code of an error would be that of an alarm
            _complain(error)
            facts["errors"].append(sentence(error))
    facts["warnings"] = list(dict.fromkeys(map(str, findings)))
    for text in facts["warnings"]:
        logger.warning("%s", text)
    logger.info("%s ends with exit code %s", options.name, facts["exit_code"])


def _print(text: str) -> None:
    """Print a text, or nothing more once its reader has gone, as ``head`` does."""
    try:
        print(text, flush=True)
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())


@contextmanager
def _logged(options: argparse.Namespace) -> Iterator[None]:
    """Warnings and errors go to stderr, and to a file that the options name."""
    root, handlers = logging.getLogger("skthermo"), [logging.StreamHandler()]
    level = root.level
    handlers[0].setFormatter(Spoken())
    handlers[0].setLevel(logging.INFO if options.verbose else logging.WARNING)
    if options.log is not None:
        file = logging.FileHandler(options.log, encoding="utf-8")
        file.setFormatter(logging.Formatter("%(asctime)s %(levelname)s %(name)s: %(message)s"))
        handlers.append(file)
    for handler in handlers:
        root.addHandler(handler)
    root.setLevel(logging.INFO)
    try:
        yield
    finally:
        root.setLevel(level)
        for handler in handlers:
            root.removeHandler(handler)
            handler.close()


def _complain(error: Exception, what: str = "") -> None:
    if not isinstance(error, EXPLAINED):
        traceback.print_exception(error)
    logger.error("%s%s", what, sentence(error))


def _parser() -> Parser:
    parser = Parser("skthermo", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--version", action="version", version=f"%(prog)s {skthermo.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")

    def add(name: str, text: str, command: Callable[..., int]) -> argparse.ArgumentParser:
        one = commands.add_parser(name, help=text, description=f"{capital(text)}.")
        one.set_defaults(command=command, name=name, metrics=None, now=None, report=None, title=None)
        one.add_argument("--json", action="store_true", help="print JSON in place of text")
        one.add_argument("--log", type=Path, metavar="FILE", help="append warnings, errors and what was done")
        one.add_argument("--verbose", action="store_true", help="say more on stderr")
        return one

    _on_records(add("check", "look at files of records, and say what was found", _look))
    init = add("init", "look at files of records, and write settings that fit them", _look)
    _on_records(init)
    init.add_argument("--into", type=Path, required=True, metavar="FOLDER", help="made if it does not exist")
    init.add_argument("--name", dest="bridge", help="of the bridge (default: that of the folder)")
    works: tuple[tuple[str, str, Any], ...] = (
        ("fit", "fit monitors to their baselines", _bridge.fit),
        ("update", "take in new records", _bridge.update),
        ("status", "say how things stand", _bridge.status),
        ("report", "write the page for the owner", _bridge.report),
        ("acknowledge", "say what an event was", _bridge.acknowledge),
        ("rebaseline", "begin a new baseline after a repair", _bridge.rebaseline),
        ("refit", "learn anew from the baseline and the records since", _bridge.refit),
        ("discard", "take back records, such as those stamped by a wrong clock", _bridge.discard),
    )
    for name, text, work in works:
        _on_monitors(add(name, text, partial(_on_bridges, work)), name)
    _add_details(commands.choices)
    return parser


def _on_records(one: argparse.ArgumentParser) -> None:
    one.add_argument("files", nargs="+", type=Path, help="T.csv F.csv, or one file with all columns")
    one.add_argument("--temperatures", nargs="+", metavar="COLUMN", help="by default as files or names tell")
    one.add_argument("--responses", nargs="+", metavar="COLUMN", help="by default as files or names tell")
    one.add_argument("--reference", nargs="+", default=[], metavar="COLUMN", help="temperatures from elsewhere")
    one.add_argument("--zone", help='time zone of the logger\'s clock, such as "Europe/Brussels"')
    one.add_argument("--stamps", metavar="FORMAT", help='such as "%%m/%%d/%%Y %%H:%%M" (default: as stamps tell)')
    one.add_argument("--until", metavar="TIME", help="last moment of the baseline (default: all records)")


def _on_monitors(one: argparse.ArgumentParser, name: str) -> None:
    many = {} if name in ("acknowledge", "rebaseline", "refit", "discard") else {"nargs": "+"}
    what = "settings (.toml), their folder, or the file of a monitor (.skops, .joblib)"
    one.add_argument("files", type=Path, help=f"{what}, then new records" if name == "update" else what, **many)
    one.add_argument("--metrics", type=Path, metavar="FILE", help="write them in Prometheus' text format")
    one.add_argument("--now", metavar="TIME", help="as of this time (default: that of the clock)")
    if name in ("update", "status", "report"):
        page = "--out" if name == "report" else "--report"
        one.add_argument(page, dest="report", type=Path, metavar="PAGE", help="HTML for the owner, or of the fleet")
        one.add_argument("--title", help="heading of the page")
        one.add_argument("--fdr", type=float, default=0.1, help="false discovery rate of a fleet (default: 0.1)")
    if name not in ("status", "report"):
        one.add_argument(
            "--wait", type=float, default=60.0, metavar="SECONDS", help="for another command at work (default: 60)"
        )


def _add_details(parsers: dict[str, argparse.ArgumentParser]) -> None:
    parsers["fit"].add_argument("--replace", action="store_true", help="fit anew; the old monitor is kept beside")
    update = parsers["update"]
    update.add_argument("--separator", help="between values of a CSV file (default: as the settings say, or a comma)")
    update.add_argument("--decimal", help="decimal sign of a CSV file (default: as the settings say, or a point)")
    update.add_argument("--stamps", metavar="FORMAT", help='such as "%%d.%%m.%%Y %%H:%%M" (default: 2026-01-31 13:00)')
    update.add_argument("--confirm", action="store_true", help="take in records that are stamped far ahead")
    parsers["acknowledge"].add_argument("event", type=int, help="its number")
    kinds = parsers["acknowledge"].add_mutually_exclusive_group(required=True)
    kinds.add_argument("--harmless", action="store_true", help="its records may train the monitor anew")
    kinds.add_argument("--damage", action="store_true", help="its records may not")
    parsers["acknowledge"].add_argument("--note", default="", help="what was found")
    parsers["rebaseline"].add_argument("--since", required=True, metavar="TIME", help="when the work was complete")
    for name in ("rebaseline", "refit"):
        parsers[name].add_argument("--until", metavar="TIME", help="last moment that may train")
    parsers["refit"].add_argument("--force", action="store_true", help="take over whatever speaks against it")
    parsers["discard"].add_argument("--since", required=True, metavar="TIME", help="first stamp of the records")
    parsers["discard"].add_argument("--until", metavar="TIME", help="last stamp (default: all records since)")


def _on_bridges(work: Callable[..., None], options: argparse.Namespace, facts: dict[str, Any]) -> int:
    given = [_settings_in(file) for file in (options.files if isinstance(options.files, list) else [options.files])]
    files = [file for file in given if file.suffix in MONITORS]
    records = [file for file in given if file.suffix not in MONITORS]
    empty = [file for file in given if file.is_dir() or not (file.suffix or file.exists())]
    if empty:
        what = "the folder {} has no monitor.toml" if empty[0].is_dir() else "there is no folder {}"
        raise FileNotFoundError(f"{what.format(repr(str(empty[0])))}; expected: {HOW_TO_BEGIN.format(empty[0])}")
    if not files or (records and (work is not _bridge.update or len(files) > 1)):
        raise ValueError(
            f"files are {', '.join(map(str, given))}; expected settings (.toml) or monitors (.skops, .joblib)"
            f"{', one alone if records are named' if work is _bridge.update else ' only'}"
        )
    if work is _bridge.update and not records and any(file.suffix != ".toml" for file in files):
        raise ValueError(f"no new records are named for {files[0]}; expected their file, such as new.csv")
    if records:
        work = partial(work, files=records)
    of_fleet = {} if len(files) == 1 else {"report": None, "title": None}  # what is named is the fleet's page
    bridges = [Bridge(file, argparse.Namespace(**vars(options) | of_fleet)) for file in files]
    done, errors = [], {}
    for bridge in bridges:
        one, error = attempt(work, bridge)
        done.append(one)
        _say(one, options, len(bridges), error)
        if one.errors:
            errors[one.name] = error or ValueError("; ".join(one.errors))
    facts["bridges"] = [one.facts() for one in done]
    code = next(code for code in (ALARM, FAILED, NOT_EVALUATED, HEALTHY) if any(one.code == code for one in done))
    if len(bridges) > 1 and options.name in ("update", "status", "report"):
        code = _as_fleet(bridges, done, errors, options, facts, code)
    metrics: dict[Path, list[dict[str, Any]]] = {}
    for bridge, one in zip(bridges, facts["bridges"], strict=True):
        for file in {options.metrics, bridge.metrics_file} - {None}:
            metrics.setdefault(file, []).append(one)
    for file, of_bridges in metrics.items():
        try:
            write_metrics(file, of_bridges, pd.Timestamp.now("UTC"))
        except OSError as error:
            code = _failed(error, f"{file} was not written: ", facts, code)
    return code


def _settings_in(path: Path) -> Path:
    """The settings in a bridge's folder; any other path as it is."""
    settings = path / "monitor.toml"
    return settings if settings.is_file() else path


def _say(done: Done, options: argparse.Namespace, number: int, error: Exception | None) -> None:
    where = f"{done.name}: " if number > 1 else ""
    if not options.json and done.lines:
        _print("\n".join([f"[{done.name}]"] * (number > 1) + done.lines + [""] * (number > 1)))
    for text in done.errors:
        logger.error("%s%s", where, text)
    if error is not None and not isinstance(error, EXPLAINED):
        traceback.print_exception(error)
    logger.info("%s %s: state %s, exit code %s", options.name, done.name, done.state, done.code)


def _as_fleet(
    bridges: Sequence[Bridge],
    done: Sequence[Done],
    errors: dict[str, Exception],
    options: argparse.Namespace,
    facts: dict[str, Any],
    code: int,
) -> int:
    """Say which alarms are significant among those of several bridges, and write their page; the exit code."""
    from skthermo.monitoring import Fleet  # a job of one bridge needs none

    loaded = {one.name: bridge.load for bridge, one in zip(bridges, done, strict=True) if one.state is not None}
    if len(loaded) + sum(one.state is None for one in done) < len(done):
        raise ValueError(
            f"bridges are called {[one.name for one in done]}; expected another name for each, as in [files]"
        )
    try:
        fleet = Fleet.of_monitors(ReadWhenAsked(loaded), errors)
        facts["fleet"] = {"summary": fleet.summary(), "page": None, "discoveries": []}
        if len(fleet.monitors):
            found = fleet.discoveries(options.fdr)
            facts["fleet"]["summary"] += f"\n{found.summary()}"
            facts["fleet"]["discoveries"] = found.table.to_dict("records")
        if not options.json:
            _print(facts["fleet"]["summary"])
        if options.report is not None:
            from skthermo.reporting import owner_report

            page = owner_report(fleet, options.report, title=options.title, fdr=options.fdr, now=options.now)
            facts["fleet"]["page"] = str(page)
    except Exception as error:  # it does not hide an alarm
        return _failed(error, "the fleet was not reported: ", facts, code)
    return code


def _failed(error: Exception, what: str, facts: dict[str, Any], code: int) -> int:
    """Say that something beside the monitors failed; the exit code, which stays that of an alarm."""
    _complain(error, what)
    facts["errors"].append(f"{what}{sentence(error)}")
    return code if code == ALARM else FAILED


def _look(options: argparse.Namespace, facts: dict[str, Any]) -> int:
    """Say what files of records hold and, of init, write settings that fit them."""
    from skthermo.commands._proposal import Proposal  # for jobs that look at files

    found = Proposal.found(options)
    facts["findings"] = found.findings.table.to_dict("records")
    lines = [*found.account(), found.findings.summary()]
    if options.name == "init":
        file = found.write(options.into, options.bridge)
        facts["settings"] = str(file)
        lines += [f"chosen: {found.detectors[0]}", f"written: {file}", f"read it, then: skthermo fit {file}"]
    if not options.json:
        _print("\n".join(lines))
    return HEALTHY if options.name == "init" or found.findings.table.empty else ALARM


def write_metrics(file: Path, bridges: Sequence[Mapping[str, Any]], now: pd.Timestamp) -> None:
    """Replace a file of metrics of some bridges, as the JSON has them."""
    samples = [(name, *sample) for bridge in bridges for name, sample in _samples(bridge, now)]
    escapes = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})  # of labels, as the text format wants them
    lines = []
    for name, text in GAUGES.items():
        lines += [f"# HELP skthermo_{name} {text}", f"# TYPE skthermo_{name} gauge"]
        for one, labels, value in samples:
            if one == name:
                escaped = {label: text.translate(escapes) for label, text in labels.items()}
                shown = ",".join(f'{label}="{text}"' for label, text in escaped.items())
                lines.append(f"skthermo_{name}{{{shown}}} {value:.10g}")
    write_when_complete(file, "\n".join(lines) + "\n")


def _samples(bridge: Mapping[str, Any], now: pd.Timestamp) -> Iterator[tuple[str, tuple[dict[str, str], float]]]:
    """Names of metrics, labels and values of one bridge; what is not known is left out."""
    status, own = bridge["status"], {"bridge": bridge["name"]}
    yield "up", (own, float(not bridge["errors"]))
    yield "written_timestamp_seconds", (own, now.timestamp())
    if status is None:
        return
    for state in CODES:
        yield "state", (own | {"state": state}, float(status["state"] == state))
    for kind in ("damage", "watch", "measurement or structure"):
        yield "open_events", (own | {"kind": kind}, sum(one["kind"] == kind for one in status["events"]))
    yield "failed_sensors", (own, len(status["faults"]))
    counts = status["counts"] or {}
    newest = status["newest"] and datetime.fromisoformat(status["newest"]).timestamp()
    values = {
        "damage_index": status["index"],
        "threshold": status["threshold"],
        "watch_threshold": status["watch_threshold"],
        "newest_record_timestamp_seconds": newest,
        "record_age_seconds": status["age"],
        "records": counts.get("n_records"),
        "records_not_evaluated": counts.get("n_not_evaluated"),
    }
    yield from ((name, (own, value)) for name, value in values.items() if value is not None)
