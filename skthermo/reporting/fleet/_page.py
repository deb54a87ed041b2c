"""The page for the owner of many bridges, and the pages of the single ones beside it."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from hashlib import sha256
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas as pd

from skthermo._io import write_when_complete
from skthermo._tables.frames import as_moment
from skthermo._tables.text import counted, percent
from skthermo.fleet import Fleet
from skthermo.reporting._html import Html, Section, bullets, element, joined, page, paragraphs, section, table
from skthermo.reporting._model import learned, stiffnesses
from skthermo.reporting._settings import parameters, settings
from skthermo.reporting.fleet._answer import answer, errors_of, in_words, warnings_of_all
from skthermo.reporting.fleet._bridge import (
    BROKEN,
    FAILED,
    SILENT,
    UNEXPLAINED,
    UNKNOWN_STATES,
    UNWATCHED,
    WITHOUT_MONITOR,
    Bridge,
)
from skthermo.reporting.service import (
    Standing,
    Time,
    banner,
    moment,
    monitor_page,
    symbol,
)
from skthermo.surrogate import DataInformedFEM

LONGEST = 60  # letters of a file's name
RESERVED = re.compile(r"(?i)(con|prn|aux|nul|com\d|lpt\d)$")  # no names of files on Windows
COLUMNS = [
    "Bridge",
    "State",
    "Since",
    "Damage index over threshold",
    "Slow change",
    "Days evaluated in the last month",
    "Warnings",
]
HEADLINES = {
    FAILED: (
        "Not evaluated: it could not be fitted",
        "An engineer should look at the records and at the model of this bridge; the others are not affected.",
    ),
    "not evaluated": (
        "Not evaluated: its monitor cannot be used",
        "An engineer should look at the monitor of this bridge; the others are not affected.",
    ),
    UNWATCHED: ("Not evaluated: no monitor", "New records are evaluated once the bridge has a monitor."),
}
"""What heads the page of a bridge without a monitor that can be asked, and what to do."""


def fleet_page(fleet: Fleet, file: Path, title: str, now: Time, limit: float, fdr: float) -> tuple[Html, list[Section]]:
    """Write the pages of the single bridges; what stands above the sections of the page of all, and these."""
    written = moment(_as_written(now))
    folder = file.with_name(f"{file.stem}_pages")
    folder.mkdir(exist_ok=True)
    names = list(fleet.table.index)
    files = page_names(names)
    links = {name: link(folder.name, files[name]) for name in names}
    found = fleet.discoveries(fdr) if len(fleet.monitors) else None
    writer = PageWriter(fleet, found, folder, files, element("a", title, href=link("..", file.name)), now, limit)
    bridges = sorted((writer.write(name) for name in names), key=lambda bridge: bridge.order)
    sections = [
        answer(bridges, links, found, written),
        _all_bridges(bridges, links),
        _false_alarms(found),
        warnings_of_all(fleet.warnings, fleet.errors),
        _settings(fleet, limit, fdr),
    ]
    introduction = paragraphs(f"One row for each of {counted(len(bridges), 'bridge')}, the worst first.")
    return introduction, sections


@dataclass(frozen=True)
class PageWriter:
    """Writes the page of one bridge after the other, and keeps only what the page of all says of it."""

    fleet: Fleet
    found: Any
    folder: Path
    files: Mapping[Hashable, str]
    back: Html
    now: Time
    limit: float

    @cached_property
    def errors(self) -> dict[Hashable, pd.DataFrame]:
        """Errors by bridge: stage, error and what failed in an owner's words."""
        found = in_words(self.fleet.errors)
        by_bridge = dict(iter(found.groupby("bridge")))
        return {name: by_bridge.get(name, found[:0]) for name in self.files}

    @cached_property
    def messages(self) -> dict[Hashable, list[str]]:
        """Texts of the warnings by bridge, each once."""
        warned = self.fleet.warnings
        return {name: texts.unique().tolist() for name, texts in warned.groupby("bridge")["message"]}

    def write(self, name: Hashable) -> Bridge:
        """Write a bridge's page, and tell how it stands."""
        messages = self.messages.get(name, [])
        monitor, unread = _opened(self.fleet.monitors, name)
        failed = self.errors[name]
        error = "; ".join(dict.fromkeys(failed["what"]))
        standing = None if monitor is None else Standing.of(monitor, self.now, self.limit, error)
        texts = bullets(messages) or paragraphs("There was no warning.")
        listed = section("warnings", "Warnings of its fit", texts, *errors_of(failed, unread), link="Warnings")
        if standing is not None:
            ended = self.found.unexplained
            bridge = Bridge.watched(
                name,
                standing,
                is_significant=name in self.found.bridges,
                unexplained=ended.loc[ended["bridge"] == name, "event"].tolist(),
                n_warnings=len(messages),
            )
            introduction, sections = monitor_page(standing, is_one_of_many=True)
            sections[-1:-1] = [listed]
        else:
            bridge, chain = self._without_monitor(name, unread, error, len(messages))
            introduction, sections = Html(), fit_page(bridge, chain, listed, moment(_as_written(self.now)))
        back = element("p", "One of the bridges of ", self.back, ".")
        text = page(str(name), joined([back, introduction]), sections, paragraphs("Written by skthermo."))
        write_when_complete(self.folder / self.files[name], text)
        return bridge

    def _without_monitor(
        self, name: Hashable, unread: str, error: str, n_warnings: int
    ) -> tuple[Bridge, DataInformedFEM | None]:
        """A bridge that nobody watches, and its chain, if it has one."""
        chain, without_chain = _opened(self.fleet.chains, name)
        if unread:
            why = "The file of its monitor cannot be read."
            return Bridge(name, "not evaluated", SILENT, np.inf, why=why, n_warnings=n_warnings), chain
        if chain is None:
            why = "The file of its model cannot be read" if without_chain else error or "No reason is given"
            return Bridge(name, FAILED, BROKEN, why=f"{why}.", n_warnings=n_warnings), None
        why = f"{error or 'It has a model but no monitor'}."
        return Bridge(name, UNWATCHED, WITHOUT_MONITOR, why=why, n_warnings=n_warnings), chain


def fit_page(bridge: Bridge, chain: DataInformedFEM | None, warned: Section, written: str) -> list[Section]:
    """Sections on a bridge without a monitor: what its model has learned, or why it could not."""
    unknown = "Whether the bridge is healthy is not known, because no record of it is evaluated."
    headline, advice = HEADLINES.get(bridge.state, HEADLINES[UNWATCHED])
    state = banner("not evaluated", written, headline, bridge.why, unknown)
    sections = [section("today", "Today", state, paragraphs(advice))]
    report = getattr(chain, "report_", None)
    if hasattr(report, "offsets"):
        sections.append(section("fit", "How good the model is", *learned(report), *stiffnesses(report)))
    sections.append(warned)
    if chain is not None:
        sections.append(settings("For the engineer.", "Settings of the model.", parameters({"model": chain})))
    return sections


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


def _all_bridges(bridges: Sequence[Bridge], links: Mapping[Hashable, str]) -> Section:
    rows = [
        [
            element("a", bridge.name, href=links[bridge.name]),
            _state(bridge),
            moment(bridge.since, is_short=True),
            element("span", bridge.line, element("span", bridge.index)) if bridge.index else "",
            bridge.drift,
            bridge.days,
            f"{bridge.n_warnings:,}" if bridge.n_warnings else "",
        ]
        for bridge in bridges
    ]
    words = [
        "Since: when the present state began. A healthy bridge is healthy since its last event ended, or since the "
        "first day of its monitor.",
        "Damage index over threshold: the newest damage index divided by its threshold. An event opens when this is "
        "above 1 for most of several records. Of an open event, its highest value so far is given. The line "
        "shows the highest index of each week in the last year, and the dashed line the threshold.",
        "Slow change: the largest change of the stiffness of a group since the baseline, if it is beyond the error of "
        "the estimate.",
    ]
    caption = "All bridges, the worst first: alarms, lost stiffness, bridges of which nothing is known, healthy ones."
    return section("bridges", "All bridges", bullets(words), table(caption, COLUMNS, rows, is_cards=True))


def _state(bridge: Bridge) -> Html:
    """Symbol and word of a state, and what else an owner should know."""
    drawn = symbol("not evaluated" if bridge.state in UNKNOWN_STATES else bridge.state)
    word = "stiffness lost" if bridge.state == "attention" else bridge.state
    word = "healthy again" if bridge.state == "healthy" and bridge.place == UNEXPLAINED else word
    name = bridge.state if bridge.state not in (FAILED, UNWATCHED) else "not evaluated"
    badge = element("span", drawn, word, class_=f"badge {name.replace(' ', '-')}")
    note = element("small", f"{bridge.duration.strip()} ({bridge.note})" if bridge.note else bridge.duration.strip())
    return element("span", badge, note, element("span", bridge.why, class_="text soft") if bridge.why else Html())


def _false_alarms(found: Any) -> Section:
    """What few false alarms mean where there are many bridges."""
    if found is None:
        meaning = ("No bridge has a monitor, so that there are no alarms.",)
    else:
        meaning = (
            "A monitor with one false alarm a year is a good one for one bridge. Two hundred such monitors raise one "
            "on more than every second day. So the open events of all bridges are compared: an event is significant if "
            "its damage index is so high that few healthy bridges reach it, of as many as there are.",
            "Significant bridges are those of the procedure of Benjamini and Hochberg: over the years, "
            f"{percent(found.fdr)} of them are expected to be healthy, and more in weather unlike that of the "
            "baselines. An alarm that is not significant is not proved to be false: inspect its records, and wait for "
            "the next weeks. Damage that no monitor detects is not counted here.",
        )
    title = "What false alarms mean for many bridges"
    return section("false-alarms", title, paragraphs(*meaning), link="False alarms")


def _settings(fleet: Fleet, limit: float, fdr: float) -> Section:
    """What this page was made with."""
    monitors, chains = (f"{len(mapping):,}" for mapping in (fleet.monitors, fleet.chains))
    rows = [
        ["bridges", f"{len(fleet.table):,}"],
        ["of these fitted", chains],
        ["of these with a monitor", monitors],
        ["loss of stiffness that is reported", percent(limit)],
        ["false discovery rate of significant bridges", percent(fdr)],
    ]
    return settings("For the engineer who looks after the monitors.", "Settings of this page.", rows)
