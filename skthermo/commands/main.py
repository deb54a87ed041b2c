"""Commands of nightly jobs: monitors without a line of Python.

    skthermo demo FOLDER                           write files of a synthetic bridge to try these commands on
    skthermo check T.csv F.csv                     look at records
    skthermo init T.csv F.csv --into bridge        write settings that fit them
    skthermo fit bridge/monitor.toml               fit a monitor to the baseline
    skthermo update bridge/monitor.toml            evaluate what is new in the folder bridge/new
    skthermo update bridge/monitor.toml NEW.csv    evaluate the records of a file
    skthermo status bridge/monitor.toml            say how things stand
    skthermo report bridge/monitor.toml --out PAGE write the owner's page
    skthermo identify bridge/monitor.toml          say which damage explains the newest records
    skthermo acknowledge bridge/monitor.toml 3 --harmless --note "a special transport"
    skthermo rebaseline bridge/monitor.toml --since 2027-05-01
    skthermo refit bridge/monitor.toml             learn anew, the records since the fit included
    skthermo discard bridge/monitor.toml --since 2027-05-01 --until 2027-05-03

The folder stands for the monitor.toml in it, and the file of a monitor alone, .skops or .joblib, for settings. Several
settings in one call are a fleet.

Exit codes of update and status: 0 healthy, watch or known damage, 1 alarm or drift, 2 not evaluated (also if there was
no new record), 3 an error, and the monitor's file is as it was: no state is printed that was not saved. An alarm is 1
also if its page cannot be written. Of several bridges: 1 if one is in alarm or drifts, else 3 if one failed, else 2 if
one is not evaluated. check: 0 no finding, 1 findings. All others: 0 done, 3 an error.
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
from itertools import combinations
from pathlib import Path
from typing import Any, NoReturn

import pandas as pd

import skthermo
from skthermo import reporting
from skthermo._core.files import ReadWhenAsked, write_when_complete
from skthermo._core.text import capital, plain
from skthermo._core.warnings import collected
from skthermo.commands._bridge import ALARM, CODES, FAILED, HEALTHY, NOT_EVALUATED, Bridge, sentence
from skthermo.monitoring import Fleet

MONITORS = (".toml", ".skops", ".joblib")  # endings of files that stand for a monitor
EXPLAINED = (ValueError, OSError, ImportError)  # errors that need no traceback
COMMANDS = {
    "demo": "write files of a synthetic bridge to try the other commands on",
    "check": "look at files of records, and say what was found",
    "init": "look at files of records, and write settings that fit them",
    "fit": "fit monitors to their baselines",
    "update": "take in new records",
    "status": "say how things stand",
    "report": "write the page for the owner",
    "identify": "say which damage explains the newest records",
    "acknowledge": "say what an event was",
    "rebaseline": "begin a new baseline after a repair",
    "refit": "learn anew from the baseline and the records since",
    "discard": "take back records, such as those stamped by a wrong clock",
}
RECORDS, SINGLE, SEVERAL = "check init", "identify acknowledge rebaseline refit discard", "fit update status report"
PAGE = {"dest": "report", "type": Path, "metavar": "PAGE", "help": "HTML for the owner, or of the fleet"}
BRIDGES = "settings (.toml), their folder, or the file of a monitor (.skops, .joblib)"
OPTIONS: tuple[tuple[str, str, dict[str, Any]], ...] = (
    ("--json", " ".join(COMMANDS), {"action": "store_true", "help": "print JSON in place of text"}),
    ("--log", " ".join(COMMANDS), {"type": Path, "metavar": "FILE", "help": "append warnings and what was done"}),
    ("--verbose", " ".join(COMMANDS), {"action": "store_true", "help": "say more on stderr"}),
    ("files", RECORDS, {"nargs": "+", "type": Path, "help": "T.csv F.csv, or one file with all columns"}),
    ("--temperatures", RECORDS, {"nargs": "+", "metavar": "COLUMN", "help": "by default as files or names tell"}),
    ("--responses", RECORDS, {"nargs": "+", "metavar": "COLUMN", "help": "by default as files or names tell"}),
    ("--reference", RECORDS, {"nargs": "+", "default": [], "metavar": "COLUMN", "help": "temperatures from elsewhere"}),
    ("--zone", RECORDS, {"help": 'time zone of the logger\'s clock, such as "Europe/Brussels"'}),
    ("--stamps", RECORDS, {"metavar": "FORMAT", "help": 'such as "%%m/%%d/%%Y %%H:%%M" (default: as stamps tell)'}),
    ("--until", RECORDS, {"metavar": "TIME", "help": "last moment of the baseline (default: all records)"}),
    ("folder", "demo", {"type": Path, "help": "made if it does not exist"}),
    ("--into", "init", {"type": Path, "required": True, "metavar": "FOLDER", "help": "made if it does not exist"}),
    ("--name", "init", {"dest": "bridge", "help": "of the bridge (default: that of the folder)"}),
    ("files", SINGLE, {"type": Path, "nargs": 1, "metavar": "file", "help": BRIDGES}),
    ("files", SEVERAL, {"type": Path, "nargs": "+", "help": f"{BRIDGES}; of update, then new records"}),
    ("--metrics", f"{SINGLE} {SEVERAL}", {"type": Path, "metavar": "FILE", "help": "in Prometheus' text format"}),
    ("--now", f"{SINGLE} {SEVERAL}", {"metavar": "TIME", "help": "as of this time (default: that of the clock)"}),
    ("--report", "update status", PAGE),
    ("--out", "report", PAGE),
    ("--title", "update status report", {"help": "heading of the page"}),
    ("--fdr", "update status report", {"type": float, "default": 0.1, "help": "false discovery rate of a fleet"}),
    ("--wait", f"{SINGLE} fit update", {"type": float, "default": 60.0, "help": "seconds for another command at work"}),
    ("--replace", "fit", {"action": "store_true", "help": "fit anew; the old monitor is kept beside"}),
    ("--separator", "update", {"help": "between values of a CSV file (default: as the settings say, or a comma)"}),
    ("--decimal", "update", {"help": "decimal sign of a CSV file (default: as the settings say, or a point)"}),
    ("--stamps", "update", {"metavar": "FORMAT", "help": 'such as "%%d.%%m.%%Y %%H:%%M" (default: 2026-01-31 13:00)'}),
    ("--confirm", "update", {"action": "store_true", "help": "take in records that are stamped far ahead"}),
    ("event", "acknowledge", {"type": int, "help": "its number"}),
    ("--harmless", "acknowledge", {"action": "store_true", "help": "its records may train the monitor anew"}),
    ("--damage", "acknowledge", {"action": "store_true", "help": "its records may not"}),
    ("--note", "acknowledge", {"default": "", "help": "what was found"}),
    ("--since", "rebaseline", {"required": True, "metavar": "TIME", "help": "when the work was complete"}),
    ("--since", "identify", {"metavar": "TIME", "help": "first record (default: of the event, or of 30 days)"}),
    ("--since", "discard", {"required": True, "metavar": "TIME", "help": "first stamp of the records"}),
    ("--until", "rebaseline refit", {"metavar": "TIME", "help": "last moment that may train"}),
    ("--until", "discard", {"metavar": "TIME", "help": "last stamp (default: all records since)"}),
    ("--force", "refit", {"action": "store_true", "help": "take over whatever speaks against it"}),
)
"""Arguments and options, the commands that have them, and their settings for argparse."""

GAUGES: dict[str, tuple[str, Callable[[Mapping[str, Any]], Any]]] = {
    "damage_index": ("Damage index of the newest record that was evaluated", lambda status: status["index"]),
    "threshold": ("Damage index above which a damage event opens", lambda status: status["threshold"]),
    "watch_threshold": ("Damage index above which the level watch begins", lambda status: status["watch_threshold"]),
    "newest_record_timestamp_seconds": ("Time of the newest record, seconds since 1970", lambda status: newest(status)),
    "record_age_seconds": ("Age of the newest record when the metrics were written", lambda status: status["age"]),
    "failed_sensors": ("Number of sensors that have failed", lambda status: len(status["faults"])),
    "records": ("Number of records since the baseline", lambda status: status["counts"]["n_records"]),
    "records_not_evaluated": ("Number of these not evaluated", lambda status: status["counts"]["n_not_evaluated"]),
}
"""Metrics of a status that are one number each, and their help; what is not known is left out."""

logger = logging.getLogger("skthermo.commands")


def newest(status: Mapping[str, Any]) -> float | None:
    """Time of the newest record in seconds since 1970."""
    return status["newest"] and datetime.fromisoformat(status["newest"]).timestamp()


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
        _print([json.dumps(plain(facts), indent=1, ensure_ascii=False, allow_nan=False)])
    return facts["exit_code"]


def _run(options: argparse.Namespace, facts: dict[str, Any]) -> None:
    """Do what was asked for, and then say each warning once."""
    with collected() as findings:
        try:
            work = _demonstrate if options.name == "demo" else _look if options.name in RECORDS.split() else _on_bridges
            facts["exit_code"] = work(options, facts)
        except Exception as error:  # Python's own exit code of an error would be that of an alarm
            _failed(error, "", facts)
            facts["exit_code"] = FAILED
    facts["warnings"] = list(dict.fromkeys(map(str, findings)))
    for text in facts["warnings"]:
        logger.warning("%s", text)
    logger.info("%s ends with exit code %s", options.name, facts["exit_code"])


def _print(lines: Sequence[str], options: argparse.Namespace | None = None) -> None:
    """Print lines, unless the options ask for JSON; nothing more once their reader has gone, as ``head`` does."""
    if options is not None and options.json:
        return
    try:
        print("\n".join(lines), flush=True)
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


def _parser() -> Parser:
    parser = Parser("skthermo", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    parser.add_argument("--version", action="version", version=f"%(prog)s {skthermo.__version__}")
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, text in COMMANDS.items():
        one = commands.add_parser(name, help=text, description=f"{capital(text)}.")
        one.set_defaults(name=name, metrics=None, now=None, report=None, title=None)
        said = one.add_mutually_exclusive_group(required=True) if name == "acknowledge" else one
        for option, of_commands, settings in OPTIONS:
            if name in of_commands.split():
                (said if option in ("--harmless", "--damage") else one).add_argument(option, **settings)
    return parser


def _on_bridges(options: argparse.Namespace, facts: dict[str, Any]) -> int:
    """Do the work of a command on each bridge; the exit code."""
    folders = [file for file in options.files if file.is_dir() or not (file.suffix or file.exists())]
    given = [file / "monitor.toml" if file in folders else file for file in options.files]
    files = [file for file in given if file.suffix in MONITORS]
    options.records = [file for file in given if file.suffix not in MONITORS]
    is_update = options.name == "update"
    if not files or (options.records and (not is_update or len(files) > 1)):
        raise ValueError(
            f"files are {', '.join(map(str, given))}; expected settings (.toml) or monitors (.skops, .joblib)"
            f"{', one alone if records are named' if is_update else ' only'}"
        )
    if is_update and not options.records and any(file.suffix != ".toml" for file in files):
        raise ValueError(f"no new records are named for {files[0]}; expected their file, such as new.csv")
    of_fleet = {} if len(files) == 1 else {"report": None, "title": None}  # what is named is the fleet's page
    bridges = [Bridge(file, argparse.Namespace(**vars(options) | of_fleet)) for file in files]
    for bridge in bridges:
        bridge.attempt(options.name)
        _say(bridge, options, len(bridges))
    facts["bridges"] = [bridge.facts() for bridge in bridges]
    codes = {bridge.code for bridge in bridges}
    facts["exit_code"] = next(code for code in (ALARM, FAILED, NOT_EVALUATED, HEALTHY) if code in codes)
    if len(bridges) > 1 and options.name in ("update", "status", "report"):
        _as_fleet(bridges, options, facts)
    metrics: dict[Path, list[Bridge]] = {}
    for bridge in bridges:
        for file in {options.metrics, bridge.metrics_file} - {None}:
            metrics.setdefault(file, []).append(bridge)
    for file, shown in metrics.items():
        try:
            _refuse_one_name(shown)
            write_metrics(file, [bridge.facts() for bridge in shown], pd.Timestamp.now("UTC"))
        except (OSError, ValueError) as error:
            _failed(error, f"{file} was not written: ", facts)
    return facts["exit_code"]


def _say(bridge: Bridge, options: argparse.Namespace, number: int) -> None:
    heading, end = ([f"[{bridge.name}]"], [""]) if number > 1 else ([], [])
    if bridge.lines:
        _print([*heading, *bridge.lines, *end], options)
    for text in bridge.errors:
        logger.error("%s%s", f"{bridge.name}: " if number > 1 else "", text)
    if bridge.error is not None and not isinstance(bridge.error, EXPLAINED):
        traceback.print_exception(bridge.error)
    logger.info("%s %s: state %s, exit code %s", options.name, bridge.name, bridge.state, bridge.code)


def _refuse_one_name(bridges: Sequence[Bridge]) -> None:
    """Raise an error where two bridges have the same name, as a folder and its copy have."""
    for one, other in combinations(bridges, 2):
        if one.name == other.name:
            raise ValueError(
                f"{one.call} and {other.call} are both called {one.name!r}; expected another name for one of them, "
                f"as name under [files] in {other.file}"
            )


def _as_fleet(bridges: Sequence[Bridge], options: argparse.Namespace, facts: dict[str, Any]) -> None:
    """Say which alarms are significant among those of several bridges, and write their page."""
    loaded = {bridge.name: bridge.load for bridge in bridges if bridge.state is not None}
    errors = {one.name: one.error or ValueError("; ".join(one.errors)) for one in bridges if one.errors}
    try:
        _refuse_one_name(bridges)
        fleet = Fleet.of_monitors(ReadWhenAsked(loaded), errors)
        facts["fleet"] = {"summary": fleet.summary(), "page": None, "discoveries": []}
        if len(fleet.monitors):
            found = fleet.discoveries(options.fdr)
            facts["fleet"]["summary"] += f"\n{found.summary()}"
            facts["fleet"]["discoveries"] = found.table.to_dict("records")
        _print([facts["fleet"]["summary"]], options)
        if options.report is not None:
            page = reporting.owner_report(fleet, options.report, title=options.title, fdr=options.fdr, now=options.now)
            facts["fleet"]["page"] = str(page)
    except Exception as error:  # it does not hide an alarm
        _failed(error, "the fleet was not reported: ", facts)


def _failed(error: Exception, what: str, facts: dict[str, Any]) -> None:
    """Say that something beside the monitors failed, which does not hide an alarm."""
    if not isinstance(error, EXPLAINED):
        traceback.print_exception(error)
    logger.error("%s%s", what, sentence(error))
    facts["errors"].append(f"{what}{sentence(error)}")
    facts["exit_code"] = ALARM if facts["exit_code"] == ALARM else FAILED


def _look(options: argparse.Namespace, facts: dict[str, Any]) -> int:
    """Say what files of records hold and, of init, write settings that fit them."""
    from skthermo.commands._proposal import Proposal  # for jobs that look at files

    found = Proposal(options)
    facts["findings"] = found.findings.table.to_dict("records")
    lines = [*found.account(), found.findings.summary()]
    if options.name == "init":
        file = found.write(options.into, options.bridge)
        facts["settings"] = str(file)
        lines += [f"chosen: {found.detectors[0]['said']}", f"written: {file}", f"read it, then: skthermo fit {file}"]
    _print(lines, options)
    return HEALTHY if options.name == "init" or found.findings.table.empty else ALARM


def _demonstrate(options: argparse.Namespace, facts: dict[str, Any]) -> int:
    from skthermo.commands._demo import write_demo

    _print(write_demo(options.folder, facts["time"]), options)
    return HEALTHY


def write_metrics(file: Path, bridges: Sequence[Mapping[str, Any]], now: pd.Timestamp) -> None:
    """Replace a file of metrics of some bridges, as the JSON has them: all are gauges that begin with ``skthermo_``."""
    escapes = str.maketrans({"\\": r"\\", '"': r"\"", "\n": r"\n"})  # of labels, as the text format wants them
    lines: list[str] = []

    def add(name: str, text: str, values_of: Callable[[Mapping[str, Any]], Mapping[str, Any]], label: str = "") -> None:
        lines.extend([f"# HELP skthermo_{name} {text}", f"# TYPE skthermo_{name} gauge"])
        for bridge in bridges:
            own = f'bridge="{bridge["name"].translate(escapes)}"'
            for key, value in values_of(bridge).items():
                shown = f'{own},{label}="{key}"' if label else own
                lines.extend([f"skthermo_{name}{{{shown}}} {value:.10g}"] if value is not None else [])

    def states(bridge: Mapping[str, Any]) -> dict[str, bool]:
        return {state: bridge["status"]["state"] == state for state in CODES} if bridge["status"] else {}

    def open_events(bridge: Mapping[str, Any]) -> dict[str, int]:
        kinds = [event["kind"] for event in bridge["status"]["events"]] if bridge["status"] else None
        known = ("damage", "watch", "drift", "fault")
        return {} if kinds is None else {kind: kinds.count(kind) for kind in known}

    add("up", "1 if the last command could do its work on this bridge, else 0", lambda one: {"": not one["errors"]})
    add("state", "1 for the state that the bridge is in, 0 for the others", states, "state")
    add("open_events", "Number of events that are open, by kind", open_events, "kind")
    for name, (text, value) in GAUGES.items():
        add(name, text, lambda one, value=value: {"": value(one["status"])} if one["status"] else {})
    add("written_timestamp_seconds", "Time at which the metrics were written", lambda one: {"": now.timestamp()})
    write_when_complete(file, "\n".join(lines) + "\n")
