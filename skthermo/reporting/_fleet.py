"""The page for the owner of many bridges: how each stands among the others, and its own page beside it."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas as pd

from skthermo._core.files import write_when_complete
from skthermo._core.frames import as_moment, midnights_between
from skthermo.monitoring import Fleet
from skthermo.reporting._monitor import Doubt, Standing, Time, monitor_facts
from skthermo.reporting._page import Row, rendered, rows_of, settings_of, versions

PLACES = (
    "significant",
    "open",
    "unexplained",
    "raised",
    "worn",
    "silent",
    "broken",
    "without monitor",
    "drifting",
    "well",
)
"""Places of a bridge, the worst first: an open event that is significant among all bridges; another open event; one
that would be significant, has ended and was not explained; a raised index; much stiffness lost; not evaluated; not
fitted; without a monitor; a drift beyond its error; healthy."""


@dataclass(frozen=True)
class BridgeRow:
    """State of a bridge in the table of a fleet.

    ``size`` orders those in the same place: the larger, the worse. ``alarm_for`` is how long it is in alarm, ``modes``
    and ``groups`` drive and explain the alarm, ``index`` and ``highest`` are over the threshold, ``drift`` is the group
    that has changed most beyond its error, with its change. ``errors`` are stages that failed; ``unread`` is the
    "monitor" or "model" whose file cannot be read.
    """

    name: Hashable
    state: str
    place: str
    size: float = 0.0
    is_watched: bool = False
    since: pd.Timestamp = pd.NaT
    alarm_for: pd.Timedelta | None = None
    modes: list[str] = field(default_factory=list)
    groups: list[str] = field(default_factory=list)
    silent_since: pd.Timestamp | None = None
    doubt: Doubt | None = None
    worn: list[str] = field(default_factory=list)
    unexplained: list[int] = field(default_factory=list)
    failed: list[str] = field(default_factory=list)
    errors: tuple[str, ...] = ()
    unread: str = ""
    index: float | None = None
    highest: float | None = None
    is_followed: bool = False
    drift: tuple[str, float] | None = None
    n_evaluated: int = 0
    n_days: int = 0
    n_warnings: int = 0

    @property
    def order(self) -> tuple[int, float]:
        """By which bridges are sorted, the worst first."""
        return PLACES.index(self.place), -self.size

    @classmethod
    def watched(
        cls,
        name: Hashable,
        standing: Standing,
        *,
        is_significant: bool = False,
        unexplained: Sequence[int] = (),
        n_warnings: int = 0,
    ) -> BridgeRow:
        """A bridge as its monitor evaluates it; ``unexplained`` are the numbers of its events that have ended so."""
        opened, state = standing.opened("damage"), standing.state
        threshold = float(standing.monitor.threshold_)
        highest = float(opened["peak"].max()) / threshold if len(opened) else None
        certain = [group for group in standing.drift or () if group["significant"]]
        largest = max(certain, key=lambda group: abs(group["change"]), default=None)
        lost = max([-group["change"] for group in certain], default=0.0)
        place, size = "drifting" if lost > 0 else "well", max(lost, 0.0)
        if state == "alarm":
            place, size = ("significant" if is_significant else "open"), np.nan if highest is None else highest
        elif unexplained:
            place, size = "unexplained", float(standing.events.loc[list(unexplained), "peak"].max()) / threshold
        elif state == "watch":
            place, size = "raised", float(standing.opened("watch")["peak"].max()) / threshold
        elif state == "attention":
            place = "worn"
        elif state == "not evaluated":
            place, size = "silent", (standing.now - standing.doubt.since) / pd.Timedelta("1D")
        days, known = standing.monitor.days_, standing.evaluations["index"].dropna()
        month = midnights_between(standing.now - pd.Timedelta(days=30), standing.now)
        month = month[month >= days.index[0]] if standing.has_records else month[:0]
        is_alarm = state == "alarm"
        return cls(
            name,
            state,
            place,
            size,
            is_watched=True,
            since=_since(standing, opened),
            alarm_for=max(standing.now - opened["start"].min(), standing.status.records.step) if is_alarm else None,
            modes=_names(opened["modes"]),
            groups=_names(opened["groups"]),
            silent_since=standing.last if standing.status.records.is_late else None,
            doubt=standing.doubt if state == "not evaluated" else None,
            worn=standing.worn,
            unexplained=list(unexplained),
            failed=[str(column) for column in standing.failed["column"]],
            errors=standing.errors,
            index=float(known.iloc[-1]) / threshold if len(known) else None,
            highest=highest,
            is_followed=standing.drift is not None,
            drift=None if largest is None else (largest["name"], largest["change"]),
            n_evaluated=int((days["n_evaluated"].reindex(month) > 0).sum()),
            n_days=len(month),
            n_warnings=n_warnings,
        )


def _names(texts: pd.Series) -> list[str]:
    """Names in texts that list them."""
    return sorted({name for text in texts if text for name in str(text).split(", ")})


def _since(standing: Standing, opened: pd.DataFrame) -> pd.Timestamp:
    """Since when a bridge is in its state; healthy since its last damage event, or since its service began."""
    if len(opened):
        return opened["start"].min()
    if standing.state == "watch":
        return standing.opened("watch")["start"].min()
    if standing.state == "not evaluated":
        return standing.doubt.since
    ends = standing.events.loc[standing.events["kind"] == "damage", "end"]
    return ends.max() if len(ends) else standing.monitor.days_.index[0]


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


def fleet_facts(fleet: Fleet, bridges: list[BridgeRow], links: Mapping[Hashable, str], found: Any) -> dict[str, Any]:
    """What the template of the page is given: bridges by state, the worst first, warnings and errors."""
    counts = Counter(bridge.state for bridge in bridges)
    n_unknown = sum(counts[state] for state in ("not evaluated", "not fitted", "no monitor"))
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

    def write(self, name: Hashable) -> BridgeRow:
        """Write a bridge's page, and tell how it stands."""
        messages, errors = self.messages.get(name, []), self.errors[name]
        monitor, unread = _opened(self.fleet.monitors, name)
        stages = [error["stage"] for error in errors]
        if unread:
            errors = [*errors, {"bridge": "monitor", "stage": "file", "error": unread}]
        of_fleet = {**self.back, "warnings": messages, "errors": errors}
        facts = {"title": str(name), "written": self.written, "fleet": of_fleet}
        if monitor is not None:
            standing, ended = Standing.at(monitor, self.now, self.limit, stages), self.found.unexplained
            bridge = BridgeRow.watched(
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
    ) -> tuple[BridgeRow, Any]:
        """A bridge that nobody watches, and its chain, if it has one."""
        chain, without_chain = _opened(self.fleet.chains, name)
        state, place = ("no monitor", "without monitor") if chain is not None else ("not fitted", "broken")
        unread = "model" if without_chain and chain is None else ""
        size = 0.0
        if is_unread:
            state, place, size, unread = "not evaluated", "silent", np.inf, "monitor"
        errors = tuple(dict.fromkeys(stages))
        return BridgeRow(name, state, place, size, errors=errors, unread=unread, n_warnings=n_warnings), chain


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
    text = re.sub(r"[^A-Za-z0-9]+", "_", letters).strip("_")[:60].rstrip("_")
    is_reserved = re.fullmatch(r"(?i)con|prn|aux|nul|com\d|lpt\d", text)  # on Windows
    return f"bridge_{text}".rstrip("_") if not text or is_reserved else text


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
