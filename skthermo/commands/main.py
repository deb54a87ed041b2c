"""Commands of nightly jobs: a monitor in service.

    python -m skthermo update bridge.skops new.csv --report status.html
    python -m skthermo status bridge.skops
    python -m skthermo acknowledge bridge.skops 3 --harmless --note "a special transport"

Exit codes of update and status: 0 healthy, 1 alarm, 2 not evaluated (also if there was no new record), 3 an error, and
the monitor's file is as it was: no state is printed that was not saved. An alarm is 1 also if its report cannot be
written. acknowledge: 0 done, 3 an error.
"""

from __future__ import annotations

import argparse
import sys
import traceback
import warnings
from collections.abc import Sequence
from pathlib import Path
from typing import NoReturn

import pandas as pd

from skthermo._estimators.warnings import told_around
from skthermo._io import alone_with
from skthermo.commands._record_files import ISO, read_file
from skthermo.monitoring import Monitor, load_monitor

HEALTHY, ALARM, NOT_EVALUATED, FAILED = range(4)
CODES = {"healthy": HEALTHY, "alarm": ALARM, "not evaluated": NOT_EVALUATED}


class Parser(argparse.ArgumentParser):
    """A parser whose exit code for wrong arguments is not that of a monitor that was not evaluated."""

    def error(self, message: str) -> NoReturn:
        """Print usage and message, and end the program."""
        self.print_usage(sys.stderr)
        self.exit(FAILED, f"error: {message}\n")


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command; its exit code."""
    options = _parser().parse_args(arguments)
    with warnings.catch_warnings():
        warnings.simplefilter("default", UserWarning)  # once for each line of code, whatever the environment says
        warnings.showwarning = lambda message, *_: print(f"warning: {message}", file=sys.stderr)
        try:
            return options.command(options)
        except Exception as error:  # Python's own exit code of an error would be that of an alarm
            _complain(error)
            return FAILED


def _parser() -> Parser:
    parser = Parser("python -m skthermo", description=__doc__)
    parser.formatter_class = argparse.RawDescriptionHelpFormatter
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for command, text in ((_update, "take in new records"), (_status, "say how things stand"), (_acknowledge, "")):
        name = command.__name__[1:]
        one = commands.add_parser(name, help=text or "say what an event was", formatter_class=parser.formatter_class)
        one.set_defaults(command=command)
        one.add_argument("monitor", type=Path, help="the monitor's file, .skops or .joblib")
        if command is not _acknowledge:
            one.add_argument("--report", type=Path, metavar="HTML", help="page for the owner, written anew")
            one.add_argument("--title", help="heading of the page")
        if command is not _status:
            one.add_argument(
                "--wait", type=float, default=60.0, metavar="SECONDS", help="for another command at work (default: 60)"
            )
        if command is _update:
            _add_records(one)
        if command is _acknowledge:
            one.add_argument("event", type=int, help="its number")
            kinds = one.add_mutually_exclusive_group(required=True)
            kinds.add_argument("--harmless", action="store_true", help="its records may train the monitor anew")
            kinds.add_argument("--damage", action="store_true", help="its records may not")
            one.add_argument("--note", default="", help="what was found")
    return parser


def _add_records(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("records", type=Path, help="new records, CSV or parquet; the first column holds the stamps")
    parser.add_argument("--separator", default=",", help="between values of a CSV file (default: a comma)")
    parser.add_argument("--decimal", default=".", help="decimal sign of a CSV file (default: a point)")
    parser.add_argument(
        "--stamps", default=ISO, metavar="FORMAT", help='such as "%%d.%%m.%%Y %%H:%%M" (default: 2026-01-31 13:00)'
    )
    parser.add_argument("--confirm", action="store_true", help="take in records that are stamped far ahead")


def _update(options: argparse.Namespace) -> int:
    """Evaluate new records, and save the monitor."""
    with alone_with(options.monitor, options.wait):
        monitor = load_monitor(options.monitor)
        form = {name: getattr(options, name) for name in ("separator", "decimal", "stamps")}
        records = read_file(options.records, **form, zone=monitor.last_.tz)
        records.index.name = monitor.baseline_.index.name
        before = monitor.counts_
        with told_around({"records not evaluated"}):  # said below, with all reasons
            evaluated = monitor.update(records, confirm=options.confirm) if len(records) else None
        if evaluated is not None:
            monitor.save(options.monitor)
    taken_in = _taken_in(before, monitor.counts_, evaluated)
    print("\n".join([_read(options.records, records), *taken_in, monitor.summary()]))
    return _reported(monitor, options, _code(monitor, evaluated))


def _status(options: argparse.Namespace) -> int:
    """Say how things stand; the file is whole at any time, and needs no lock to be read."""
    monitor = load_monitor(options.monitor)
    print(monitor.summary())
    return _reported(monitor, options, CODES[monitor.state()])


def _acknowledge(options: argparse.Namespace) -> int:
    """Say what an event was, and save the monitor."""
    with alone_with(options.monitor, options.wait):
        monitor = load_monitor(options.monitor)
        monitor.acknowledge(options.event, harmless=options.harmless, note=options.note)
        monitor.save(options.monitor)
    print(f"event {options.event} is acknowledged as {'harmless' if options.harmless else 'damage'}")
    print(monitor.summary())
    return 0


def _reported(monitor: Monitor, options: argparse.Namespace, code: int) -> int:
    """Write the report that was asked for; the exit code."""
    if options.report is None:
        return code
    from skthermo.reporting import owner_report  # a job without a report needs no drawings

    try:
        owner_report(monitor, options.report, title=options.title)
    except Exception as error:  # it does not hide an alarm
        _complain(error, f"{options.report} was not written: ")
        return code if code == ALARM else FAILED
    return code


def _complain(error: Exception, what: str = "") -> None:
    if not isinstance(error, ValueError | OSError | ImportError):  # these explain themselves
        traceback.print_exception(error)
    print(f"error: {what}{error}", file=sys.stderr)


def _code(monitor: Monitor, evaluated: pd.DataFrame | None) -> int:
    """Exit code of an update: an alarm that has ended again counts, and without a new evaluation nothing is healthy."""
    states = set() if evaluated is None else set(evaluated["state"])
    if "alarm" in states or monitor.state() == "alarm":
        return ALARM
    is_evaluated = evaluated is not None and (~evaluated["revised"] & (evaluated["state"] == "healthy")).any()
    return CODES[monitor.state()] if is_evaluated else NOT_EVALUATED


def _read(file: Path, records: pd.DataFrame) -> str:
    period = f", {records.index.min()} to {records.index.max()}" if len(records) else ""
    return f"read from {file}: {len(records)}{period}"


def _taken_in(before: dict[str, int], after: dict[str, int], evaluated: pd.DataFrame | None) -> list[str]:
    """What became of the records."""
    names = {"n_repeated": "repeated", "n_late": "late", "n_too_late": "too late"}
    others = ", ".join(f"{after[name] - before[name]} {text}" for name, text in names.items())
    if evaluated is None:
        return [f"new: 0; {others}"]
    new, revised = evaluated[~evaluated["revised"]], evaluated["revised"].sum()
    states = ", ".join(f"{(new['state'] == state).sum()} {state}" for state in CODES)
    lines = [f"new: {len(new)} ({states}); {others}"]
    lines += [f"evaluated anew, as records came late: {revised}"] if revised else []
    lines += [f"set aside, stamped too far ahead: {after['n_ahead']}"] if after["n_ahead"] else []
    reasons = new.loc[new["state"] == "not evaluated", "reason"].value_counts()
    return lines + [f"not evaluated, {reason}: {number}" for reason, number in reasons.items()]
