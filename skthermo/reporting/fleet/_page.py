"""What the page for the owner of many bridges is made of, and the pages of the single ones beside it."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas as pd

from skthermo._core.files import write_when_complete
from skthermo._core.frames import as_moment
from skthermo.monitoring import Fleet
from skthermo.reporting._settings import settings_of, versions
from skthermo.reporting._templates import Row, rendered, rows_of
from skthermo.reporting.fleet._bridge import FAILED, UNKNOWN_STATES, UNWATCHED, Bridge
from skthermo.reporting.service import Standing, Time, monitor_facts

LONGEST = 60  # letters of a file's name
RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com\d|lpt\d)$")  # no names of files on Windows


def write_fleet(
    fleet: Fleet, file: Path, title: str | None, now: Time, limit: float, fdr: float, templates: str = ""
) -> None:
    """Write a page for each bridge into a folder beside the file, and then the file."""
    folder = file.with_name(f"{file.stem}_pages")
    written = _as_written(now)
    found = fleet.discoveries(fdr) if len(fleet.monitors) else None
    files = page_names(fleet.table.index)
    folder.mkdir(exist_ok=True)
    back = {"title": title, "address": link("..", file.name)}
    writer = PageWriter(fleet, found, folder, files, back, written, now, limit, templates)
    bridges = sorted((writer.write(name) for name in files), key=lambda bridge: bridge.order)
    links = {name: link(folder.name, one) for name, one in files.items()}
    facts = {"title": title, "written": written, "limit": limit, "fdr": fdr}
    write_when_complete(file, rendered("fleet", fleet_facts(fleet, bridges, links, found) | facts, templates))


def fleet_facts(fleet: Fleet, bridges: list[Bridge], links: Mapping[Hashable, str], found: Any) -> dict[str, Any]:
    """What the template of the page is given: bridges by state, the worst first, warnings and errors."""
    counts = Counter(bridge.state for bridge in bridges)
    n_unknown = sum(counts[state] for state in UNKNOWN_STATES)
    unexplained = [bridge for bridge in bridges if bridge.place == "unexplained"]
    state = "alarm" if counts["alarm"] else "attention" if unexplained or counts["attention"] else "healthy"
    state = "watch" if counts["watch"] and state == "healthy" else state
    state = "not evaluated" if n_unknown and state == "healthy" else state
    kinds = fleet.warnings.groupby("kind").agg(n=("bridge", "nunique"), first=("message", "first"))
    return {
        "bridges": bridges,
        "links": links,
        "found": found,
        "counts": dict(+counts),
        "n_unknown": n_unknown,
        "state": state,
        "alarms": [bridge for bridge in bridges if bridge.state == "alarm"],
        "unexplained": unexplained,
        "warned": rows_of(kinds.sort_values("n")[::-1]),
        "errors": rows_of(fleet.errors),
        "n_fitted": len(fleet.chains),
        "n_watched": len(fleet.monitors),
        "versions": versions(),
    }


@dataclass(frozen=True)
class PageWriter:
    """Writes the page of one bridge after the other, and keeps only what the page of all says of it."""

    fleet: Fleet
    found: Any
    folder: Path
    files: Mapping[Hashable, str]
    back: Mapping[str, str | None]
    written: pd.Timestamp
    now: Time
    limit: float
    templates: str

    @cached_property
    def errors(self) -> dict[Hashable, list[Row]]:
        """Errors by bridge."""
        found: dict[Hashable, list[Row]] = {name: [] for name in self.files}
        for error in rows_of(self.fleet.errors):
            found.setdefault(error["bridge"], []).append(error)
        return found

    @cached_property
    def messages(self) -> dict[Hashable, list[str]]:
        """Texts of the warnings by bridge, each once."""
        warned = self.fleet.warnings
        return {name: texts.unique().tolist() for name, texts in warned.groupby("bridge")["message"]}

    def write(self, name: Hashable) -> Bridge:
        """Write a bridge's page, and tell how it stands."""
        messages, errors = self.messages.get(name, []), self.errors[name]
        monitor, unread = _opened(self.fleet.monitors, name)
        stages = [error["stage"] for error in errors]
        if unread:
            errors = [*errors, {"bridge": "monitor", "stage": "file", "error": unread}]
        of_fleet = {**self.back, "warnings": messages, "errors": errors}
        facts = {"title": str(name), "written": self.written, "fleet": of_fleet}
        if monitor is not None:
            standing, ended = Standing.of(monitor, self.now, self.limit, stages), self.found.unexplained
            bridge = Bridge.watched(
                name,
                standing,
                is_significant=name in self.found.bridges,
                unexplained=ended.loc[ended["bridge"] == name, "event"].tolist(),
                n_warnings=len(messages),
            )
            text = rendered("monitor", monitor_facts(standing) | facts, self.templates)
        else:
            bridge, chain = self._without_monitor(name, bool(unread), stages, len(messages))
            report = getattr(chain, "report_", None)
            facts |= {
                "bridge": bridge,
                "report": report if hasattr(report, "modes") else None,
                "settings": None if chain is None else settings_of({"model": chain}),
                "versions": versions(),
            }
            text = rendered("bridge", facts, self.templates)
        write_when_complete(self.folder / self.files[name], text)
        return bridge

    def _without_monitor(
        self, name: Hashable, is_unread: bool, stages: list[str], n_warnings: int
    ) -> tuple[Bridge, Any]:
        """A bridge that nobody watches, and its chain, if it has one."""
        chain, without_chain = _opened(self.fleet.chains, name)
        state, place = (UNWATCHED, "without monitor") if chain is not None else (FAILED, "broken")
        unread = "model" if without_chain and chain is None else ""
        size = 0.0
        if is_unread:
            state, place, size, unread = "not evaluated", "silent", np.inf, "monitor"
        errors = tuple(dict.fromkeys(stages))
        return Bridge(name, state, place, size, errors=errors, unread=unread, n_warnings=n_warnings), chain


def page_names(bridges: Iterable[Hashable]) -> dict[Hashable, str]:
    """A file name for each bridge, of plain letters: no two are equal, in capitals or not."""
    plain = {bridge: _plain(str(bridge)) for bridge in bridges}
    shared, names = Counter(name.casefold() for name in plain.values()), {}
    for bridge, name in plain.items():
        digest = sha256(repr(bridge).encode("utf-8", "backslashreplace")).hexdigest()[:8]
        names[bridge] = name if shared[name.casefold()] == 1 else f"{name}-{digest}"
    taken: dict[str, Hashable] = {}
    for bridge, name in names.items():
        number, free = 2, name
        while free.casefold() in taken:
            number, free = number + 1, f"{name}-{number}"
        taken[free.casefold()], names[bridge] = bridge, free
    return {bridge: f"{name}.html" for bridge, name in names.items()}


def link(*parts: str) -> str:
    """A relative address of a file."""
    return "/".join(quote(part) for part in parts)


def _plain(name: str) -> str:
    letters = unicodedata.normalize("NFKD", name).encode("ascii", "ignore").decode()
    text = re.sub(r"[^A-Za-z0-9]+", "_", letters).strip("_")[:LONGEST].rstrip("_")
    return f"bridge_{text}".rstrip("_") if not text or RESERVED.match(text) else text


def _as_written(now: Time) -> pd.Timestamp:
    """The time shown on the pages, as it was given: bridges may have records of different time zones."""
    if now is None:
        return as_moment(None, None).floor("min")
    zone = pd.to_datetime(str(now), errors="coerce").tz
    return as_moment(now, zone)


def _opened(mapping: Mapping[Hashable, Any], name: Hashable) -> tuple[Any, str]:
    """What a mapping has under a name, read from its file perhaps; nothing, and why, where it cannot be read."""
    if name not in mapping:
        return None, ""
    try:
        return mapping[name], ""
    except Exception as error:  # one damaged file does not hide the other bridges
        return None, f"{type(error).__name__}: {error}"
