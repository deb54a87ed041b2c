"""What machines read: JSON, metrics in Prometheus' text format, and a file to which changes of state are appended."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any

import pandas as pd

from skthermo._io import write_when_complete
from skthermo._tables.text import plain

STATES = ("healthy", "watch", "alarm", "not evaluated")
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

KINDS = ("damage", "watch", "measurement or structure")


def as_json(facts: Mapping[str, Any]) -> str:
    """Facts as text of JSON."""
    return json.dumps(plain(facts), indent=1, ensure_ascii=False, allow_nan=False)


def write_metrics(file: Path, bridges: Sequence[Mapping[str, Any]], now: pd.Timestamp) -> None:
    """Replace a file of metrics of some bridges, as the JSON has them."""
    samples = [(name, *sample) for bridge in bridges for name, sample in _samples(bridge, now)]
    lines = []
    for name, text in GAUGES.items():
        lines += [f"# HELP skthermo_{name} {text}", f"# TYPE skthermo_{name} gauge"]
        for one, labels, value in samples:
            if one == name:
                shown = ",".join(f'{label}="{_escaped(text)}"' for label, text in labels.items())
                lines.append(f"skthermo_{name}{{{shown}}} {value:.10g}")
    write_when_complete(file, "\n".join(lines) + "\n")


def _samples(bridge: Mapping[str, Any], now: pd.Timestamp) -> Iterator[tuple[str, tuple[dict[str, str], float]]]:
    """Names of metrics, labels and values of one bridge; what is not known is left out."""
    status, own = bridge["status"], {"bridge": bridge["name"]}
    yield "up", (own, float(not bridge["errors"]))
    yield "written_timestamp_seconds", (own, now.timestamp())
    if status is None:
        return
    for state in STATES:
        yield "state", (own | {"state": state}, float(status["state"] == state))
    for kind in KINDS:
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


def _escaped(text: str) -> str:
    """A label's value, as the text format wants it."""
    return text.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n")


def append_transitions(
    file: Path, entries: Sequence[Mapping[str, Any]], own: Mapping[str, str]
) -> list[dict[str, Any]]:
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
