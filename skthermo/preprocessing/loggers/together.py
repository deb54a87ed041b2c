"""Records of several files side by side, joined by their stamps, in degrees Celsius; which columns are what."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import numpy as np
import pandas as pd

from skthermo._core.text import counted
from skthermo.preprocessing.loggers.logger_files import MOSTLY, FileLook, look_at

HZ = "Hz"


@dataclass(frozen=True)
class LoggerRecords:
    """Records of files, in order of time and in degrees Celsius.

    ``roles`` are names of columns by role: temperatures, reference and responses; ``units`` are the units of the
    responses, "" where unknown; ``convert`` has the units of temperatures that were not in degrees Celsius. ``waiting``
    are stamps that are not in all files; ``ignored`` says why columns are not used."""

    looks: Sequence[FileLook]
    table: pd.DataFrame
    roles: Mapping[str, list[str]]
    units: Mapping[str, str]
    convert: Mapping[str, str]
    waiting: pd.DatetimeIndex
    ignored: Mapping[str, str]

    @classmethod
    def read(
        cls,
        files: Sequence[Path],
        temperatures: Sequence[str] | None = None,
        responses: Sequence[str] | None = None,
        reference: Sequence[str] = (),
        zone: str | None = None,
        stamps: str | None = None,
    ) -> LoggerRecords:
        """Look at files, in a time zone and with a format of stamps if these are known. What is not said of columns is
        found by files, names and units."""
        wanted = [*(temperatures or ()), *(responses or ()), *reference]
        again = sorted({name for name in wanted if wanted.count(name) > 1})
        if again:
            raise ValueError(f"{again} are named twice among temperatures and responses; expected each column once")
        try:
            ZoneInfo("UTC" if zone is None else zone)
        except (KeyError, ValueError, OSError, TypeError) as error:
            text = f"zone is {zone!r:.100}; expected a time zone such as 'Europe/Brussels' or 'UTC'"
            raise ValueError(text) from error
        looks = [look_at(file, zone, stamps, wanted) for file in files]
        again = [
            name for n, look in enumerate(looks) for name in look.records if any(name in b.records for b in looks[:n])
        ]
        if again and len({frozenset(look.records) for look in looks}) > 1:
            raise ValueError(f"several files have the columns {again}; expected each in one, beside the stamps")
        columns = list(dict.fromkeys(name for look in looks for name in look.records))
        roles = _roles(looks, columns, {"temperatures": temperatures, "reference": reference, "responses": responses})
        used = [name for names in roles.values() for name in names]
        units = {name: unit for look in looks for name, unit in look.units.items()}
        table, waiting = joined([look.records for look in looks], columns)
        if not len(table):
            spans = "; ".join(
                f"{look.file}: {look.records.index.min()} to {look.records.index.max()}" for look in looks
            )
            raise ValueError(f"the files have no stamp in common ({spans}); expected records of the same times")
        table = once(table).sort_index()
        convert = {
            name: unit
            for name in (*roles["temperatures"], *roles["reference"])
            if (unit := _foreign(table, name, units))
        }
        units = {name: units.get(name, HZ if is_like_frequency(name) else "") for name in roles["responses"]}
        ignored = {name: why for look in looks for name, why in look.ignored.items()}
        ignored |= {name: "nothing says what it is" for name in columns if name not in used}
        return cls(looks, in_celsius(table, convert)[used], roles, units, convert, waiting, ignored)


def _roles(looks: Sequence[FileLook], columns: list[str], given: dict[str, Any]) -> dict[str, list[str]]:
    """Columns by role: as given, else as the first and the other of two files, or by unit and name."""
    unknown = [name for names in given.values() for name in names or () if name not in columns]
    if unknown:
        raise ValueError(f"there are no columns {unknown}; expected some of {columns}{_others(looks)}")
    named = {name for names in given.values() for name in names or ()}
    rest = [name for name in columns if name not in named]
    units = {name: unit for look in looks for name, unit in look.units.items()}
    is_pair = len({frozenset(look.records) for look in looks}) == 2
    for role, unit, is_like in (
        ("temperatures", {"°C", "K", "°F"}, is_like_temperature),
        ("responses", {HZ}, is_like_frequency),
    ):
        if given[role] is None and is_pair:
            first = set(looks[0].records)
            given[role] = [name for name in rest if (name in first) == (role == "temperatures")]
        elif given[role] is None:
            found = [n for n in rest if units.get(n) in unit or (n not in units and is_like(n))]
            given[role] = [n for n in found if n not in (given["temperatures"] or ())]
        if not given[role]:
            raise ValueError(
                f"no column is known to be one of the {role}; expected {role} (--{role}) by name, some of "
                f"{columns}{_others(looks)}"
            )
    return {role: list(names) for role, names in given.items()}


def is_like_temperature(name: Any) -> bool:
    """Whether a column has a name as temperatures have."""
    return re.match(r"t\d*$|t[A-Z_]|temp|.*temp|air|.*luft", str(name), re.IGNORECASE) is not None


def is_like_frequency(name: Any) -> bool:
    """Whether a column has a name as frequencies have."""
    return re.match(r"f_?\d*$|.*freq|(.*\W)?(mode|hz)", str(name), re.IGNORECASE) is not None


def _others(looks: Sequence[FileLook]) -> str:
    """Columns that cannot be used, and why."""
    others = [f"{name!r} is none, as {why}" for look in looks for name, why in look.ignored.items()]
    return f"; {', '.join(others)}" if others else ""


def _foreign(records: pd.DataFrame, name: str, units: Mapping[str, str]) -> str:
    """The unit of a temperature that is not in degrees Celsius."""
    unit = units.get(name, "")
    if unit in ("K", "°F"):
        return unit
    return "K" if unit == "" and records[name].between(200, 340).mean() > MOSTLY else ""


def in_celsius(table: pd.DataFrame, units: Mapping[str, str]) -> pd.DataFrame:
    """A table with columns that are in K or °F converted to degrees Celsius."""
    found = {name: unit for name, unit in units.items() if name in table}
    scaled = {
        name: table[name] - 273.15 if unit == "K" else (table[name] - 32.0) * (5 / 9) for name, unit in found.items()
    }
    return table.assign(**scaled)


def joined(tables: Iterable[pd.DataFrame], columns: Sequence[str]) -> tuple[pd.DataFrame, pd.DatetimeIndex]:
    """Records of files with the same columns one below the other, others side by side by their stamps; and stamps that
    are not in all of them, whose records wait for the rest."""
    groups: dict[frozenset[Any], list[pd.DataFrame]] = {}
    for table in tables:
        groups.setdefault(frozenset(table), []).append(table)
    whole = groups.pop(frozenset(columns), [])
    parts = [once(pd.concat(one)) for one in groups.values()]
    waiting = pd.DatetimeIndex([])
    if parts:
        together = pd.concat(parts, axis=1, join="inner")
        every = parts[0].index
        for part in parts[1:]:
            every = every.union(part.index)
        waiting = every.difference(together.index) if set(together) == set(columns) else every
        whole += [together] if set(together) == set(columns) else []
    if not whole:
        return pd.DataFrame(columns=list(columns), index=waiting[:0], dtype=float), waiting
    return pd.concat([one[list(columns)] for one in whole]), waiting


def once(table: pd.DataFrame) -> pd.DataFrame:
    """Records that come twice with the same values, up to the last bits, are one; others are an error."""
    again = table.index.duplicated()
    if not again.any():
        return table
    first = table[~again]
    known = first.loc[table.index[again]].to_numpy()
    again[again] = ~np.isclose(table[again].to_numpy(), known, rtol=1e-9, atol=0.0, equal_nan=True).all(axis=1)
    if again.any():
        raise ValueError(
            f"{counted(again.sum(), 'stamp')} of {list(table)} come twice with other values, the first "
            f"{table.index[again][0]}; expected each once. If the clocks go back then, give the time zone ([csv] "
            "time_zone of settings)"
        )
    return first
