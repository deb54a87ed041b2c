"""The page for the owner of many bridges: how each stands among the others, and its own page beside it."""

from __future__ import annotations

import re
import unicodedata
from collections import Counter
from collections.abc import Hashable, Iterable, Mapping
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import quote

import numpy as np
import pandas as pd

from skthermo._core.files import write_when_complete
from skthermo._core.frames import as_moment, midnights_between
from skthermo.monitoring import Fleet
from skthermo.reporting._monitor import Standing, Time, monitor_facts
from skthermo.reporting._page import Row, rendered, rows_of, settings_of

PLACES = (
    "significant", "open", "slow", "unexplained", "raised", "worn", "silent", "broken", "unwatched", "known",
    "drifting", "well",
)  # fmt: skip
"""Places of a bridge, the worst first: an open event that is significant among all bridges; another open event; a slow
change; one that would be significant, has ended and was not explained; a raised index; much stiffness lost; not
evaluated; not fitted; without a monitor; damage that its owner knows; a drift beyond its error; healthy."""


def watched(standing: Standing, is_significant: bool, unexplained: list[int]) -> Row:
    """What the page of many bridges says of one as its monitor evaluates it, without the monitor.

    ``size`` orders bridges in one place: the larger, the worse. ``unexplained`` are numbers of its ended events.
    """
    state, status, threshold = standing.state, standing.status, float(standing.monitor.threshold_)
    peak = max((event["peak"] for event in status.events), default=0.0)
    certain = [group for group in standing.drift or () if group["significant"]]
    lost = max([-group["change"] for group in certain], default=0.0)
    places = {
        "alarm": ("significant" if is_significant else "open", peak),
        "drift": ("slow", peak),
        "watch": ("raised", peak),
        "known damage": ("known", peak),
        "attention": ("worn", lost),
        "not evaluated": ("silent", standing.now - standing.since),
    }
    place, size = places.get(state, ("drifting" if lost > 0 else "well", lost))
    if unexplained and state not in ("alarm", "drift"):
        place, size = "unexplained", standing.events.loc[unexplained, "peak"].max()
    month = midnights_between(standing.now - pd.Timedelta(days=30), standing.now)
    month = month[month >= standing.days.index[0]] if standing.has_records else month[:0]
    return {
        "state": state,
        "place": place,
        "size": size / (pd.Timedelta("1D") if place == "silent" else threshold),
        "since": standing.since,
        "alarm_for": max(standing.now - standing.since, status.records.step) if state == "alarm" else None,
        "standing": {"status": status, "errors": standing.errors},
        "damage": [event for event in status.events if event["kind"] == "damage"],
        "worn": standing.worn,
        "unexplained": unexplained,
        "is_followed": standing.drift is not None,
        "drift": max(certain, key=lambda group: abs(group["change"]), default=None),
        "n_evaluated": int((standing.days["n_evaluated"].reindex(month) > 0).sum()),
        "n_days": len(month),
    }


def write_fleet(
    fleet: Fleet, file: Path, title: str | None, now: Time, limit: float, fdr: float, templates: str = ""
) -> None:
    """Write a page for each bridge into a folder beside the file, and then the file."""
    zone = None if now is None else pd.to_datetime(str(now), errors="coerce").tz
    written = as_moment(now, zone).floor("min")  # as it was given: bridges may have records of different time zones
    found = fleet.discoveries(fdr) if len(fleet.monitors) else None
    folder, files = file.with_name(f"{file.stem}_pages"), page_names(fleet.table.index)
    folder.mkdir(exist_ok=True)
    ended = pd.DataFrame(columns=["bridge", "event"]) if found is None else found.unexplained
    bridges = []
    for name, own_file in files.items():
        messages = fleet.warnings.loc[fleet.warnings["bridge"] == name, "message"].unique().tolist()
        errors = rows_of(fleet.errors[fleet.errors["bridge"] == name])
        stages = [error["stage"] for error in errors]
        monitor, unread = opened(fleet.monitors, name)
        if unread:
            errors.append({"bridge": "monitor", "stage": "file", "error": unread})
        back = {"title": title, "address": f"../{quote(file.name)}", "warnings": messages, "errors": errors}
        facts = {"title": str(name), "written": written, "fleet": back}
        if monitor is not None:
            standing = Standing(monitor, now, limit, stages)
            unexplained = ended.loc[ended["bridge"] == name, "event"].tolist()
            bridge = watched(standing, name in found.bridges, unexplained)
            page = rendered("monitor", monitor_facts(standing) | facts, templates)
        else:
            bridge, chain = unwatched(fleet, name, bool(unread), stages)
            report = getattr(chain, "report_", None)
            facts |= {"bridge": bridge, "report": report if hasattr(report, "modes") else None}
            facts |= {"settings": None if chain is None else settings_of({"model": chain})}
            page = rendered("bridge", facts, templates)
        write_when_complete(folder / own_file, page)
        bridges.append(bridge | {"name": name, "errors": stages, "n_warnings": len(messages)})
        bridges[-1]["link"] = f"{quote(folder.name)}/{own_file}"
    bridges.sort(key=lambda bridge: (PLACES.index(bridge["place"]), -bridge["size"]))
    kinds = fleet.warnings.groupby("kind").agg(n=("bridge", "nunique"), first=("message", "first"))
    facts = {"title": title, "written": written, "limit": limit, "fdr": fdr, "found": found, "bridges": bridges}
    facts |= {"fleet": fleet, "counts": Counter(bridge["state"] for bridge in bridges), "warned": kinds}
    write_when_complete(file, rendered("fleet", facts, templates))


def unwatched(fleet: Fleet, name: Hashable, is_unread: bool, stages: list[str]) -> tuple[Row, Any]:
    """What is said of a bridge without a monitor that can be read, and its chain, if it has one."""
    chain, without_chain = opened(fleet.chains, name)
    bridge = {"state": "no monitor", "place": "unwatched", "size": 0.0, "since": None, "unread": "", "errors": stages}
    bridge |= {"standing": None, "alarm_for": None, "unexplained": []}
    if is_unread:
        bridge |= {"state": "not evaluated", "place": "silent", "size": np.inf, "unread": "monitor"}
    elif chain is None:
        bridge |= {"state": "not fitted", "place": "broken", "unread": "model" if without_chain else ""}
    return bridge, chain


def page_names(bridges: Iterable[Hashable]) -> dict[Hashable, str]:
    """A file name for each bridge, of plain letters: no two are equal, in capitals or not."""
    names: dict[Hashable, str] = {}
    taken: set[str] = set()
    for bridge in bridges:
        letters = unicodedata.normalize("NFKD", str(bridge)).encode("ascii", "ignore").decode()
        plain = re.sub(r"[^A-Za-z0-9]+", "_", letters).strip("_")[:60] or "bridge"
        plain = f"bridge_{plain}" if re.fullmatch(r"(?i)con|prn|aux|nul|com\d|lpt\d", plain) else plain  # on Windows
        free = (plain if number == 1 else f"{plain}_{number}" for number in count(1))
        names[bridge] = next(name for name in free if name.casefold() not in taken)
        taken.add(names[bridge].casefold())
    return {bridge: f"{name}.html" for bridge, name in names.items()}


def opened(mapping: Mapping[Hashable, Any], name: Hashable) -> tuple[Any, str]:
    """What a mapping has under a name, read from its file perhaps; nothing, and why, where it cannot be read."""
    if name not in mapping:
        return None, ""
    try:
        return mapping[name], ""
    except Exception as error:  # one damaged file does not hide the other bridges
        return None, f"{type(error).__name__}: {error}"
