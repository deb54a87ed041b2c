"""Records of several files side by side, joined by their stamps, in degrees Celsius and Hz; which columns are what."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zoneinfo import ZoneInfo

import pandas as pd

from skthermo.preprocessing._quantities import (
    FREQUENCY,
    OPEN,
    TEMPERATURE,
    Unit,
    can_be_temperature,
    in_usual_units,
    kind_of,
    varies_as_modes,
)
from skthermo.preprocessing.loggers.logger_files import FileLook, look_at, once, side_by_side
from skthermo.preprocessing.loggers.stamps import MOSTLY

HZ = "Hz"


@dataclass(frozen=True)
class LoggerRecords:
    """Records of files, in order of time, in degrees Celsius and Hz.

    ``roles`` are names of columns by role: temperatures, reference and responses; ``units`` are the units of the
    responses, "" where unknown; ``convert`` has the units of columns that were in others than degrees Celsius or Hz.
    ``waiting`` are stamps that are not in all files; ``ignored`` says why columns are not used, ``notes`` what else a
    reader should know."""

    looks: Sequence[FileLook]
    table: pd.DataFrame
    roles: Mapping[str, list[str]]
    units: Mapping[str, str]
    convert: Mapping[str, str]
    waiting: pd.DatetimeIndex
    ignored: Mapping[str, str]
    notes: Sequence[str]

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
        columns = [name for look in looks for name in look.records]
        again = sorted({name for name in columns if columns.count(name) > 1})
        if again and len({frozenset(look.records) for look in looks}) > 1:
            raise ValueError(f"several files have the columns {again}; expected each in one, beside the stamps")
        columns = list(dict.fromkeys(columns))
        given = {"temperatures": temperatures, "reference": reference, "responses": responses}
        units = {name: unit for look in looks for name, unit in look.units.items()}
        ignored = {name: why for look in looks for name, why in look.ignored.items()}
        roles, notes = _roles(looks, columns, units, given, ignored)
        table, waiting = joined([look.records for look in looks], columns)
        if not len(table):
            stamps = [(str(look.file), look.records.index) for look in looks]
            spans = "; ".join(f"{name}: {index.min()} to {index.max()}" for name, index in stamps)
            raise ValueError(f"the files have no stamp in common ({spans}); expected records of the same times")
        table = once(table).sort_index()
        used = [name for names in roles.values() for name in names]
        convert = {name: unit for name in used if (unit := _foreign(table[name], name, columns, units, roles))}
        if convert:
            notes.append(f"converted to degrees Celsius and Hz: {', '.join(map(' from '.join, convert.items()))}")
        of_responses = {name: _response_unit(name, units.get(name), table[name]) for name in roles["responses"]}
        by_values = [n for n, unit in of_responses.items() if unit == HZ and kind_of(n, units.get(n))[0] != FREQUENCY]
        if by_values:
            notes.append(f"{', '.join(by_values)}: taken for natural frequencies in Hz, by their values")
        if unknown := [name for name, unit in of_responses.items() if not unit]:
            notes.append(
                f"the unit of {', '.join(map(repr, unknown))} is unknown, so that a change up counts as a change down; "
                "natural frequencies need names such as 'f1 [Hz]'"
            )
        table = in_usual_units(table, convert)[used]
        return cls(looks, table, roles, of_responses, convert, waiting, ignored, notes)


def _roles(
    looks: Sequence[FileLook],
    columns: list[str],
    units: Mapping[str, Unit],
    given: dict[str, Any],
    ignored: dict[str, str],
) -> tuple[dict[str, list[str]], list[str]]:
    """Columns by role, and what to know about it: as given, else by unit, name and values; why others have none is
    added to what is ignored. Of two files, what stays open in the first is a temperature, and a response in the second,
    if its values can be that."""
    unknown = [name for names in given.values() for name in names or () if name not in columns]
    if unknown:
        raise ValueError(f"there are no columns {unknown}; expected some of {columns}{_reasons(ignored)}")
    named = {name for names in given.values() for name in names or ()}
    values = {name: look.records[name] for look in looks for name in look.records}
    kinds = {name: kind_of(name, units.get(name), values[name]) for name in columns if name not in named}
    is_pair, notes = len({frozenset(look.records) for look in looks}) == 2, []
    for role, kind in (("temperatures", TEMPERATURE), ("responses", FREQUENCY)):
        if given[role] is not None:
            continue
        given[role] = found = [name for name, (one, _) in kinds.items() if one == kind]
        if is_pair:
            own = [name for name in kinds if (name in looks[0].records) == (role == "temperatures")]
            if role == "temperatures" and found and not set(found).intersection(own):
                notes.append(f"the files are exchanged, as {', '.join(found)} of the second are temperatures")
            by_file = [name for name in own if _is_open(role, kinds[name][0], values[name])]
            if by_file:
                notes.append(f"{', '.join(by_file)}: {role} as their file says, as names and units do not")
            given[role] = [name for name in kinds if name in found or name in by_file]
    used = {name for names in given.values() for name in names or ()}
    ignored |= {name: why for name, (_, why) in kinds.items() if name not in used}
    for role in ("temperatures", "responses"):
        if not given[role]:
            expected = f"{role} (--{role}) by name, some of {columns}{_reasons(ignored)}"
            raise ValueError(f"no column is known to be one of the {role}; expected {expected}")
    return {role: list(names) for role, names in given.items()}, notes


def _reasons(ignored: Mapping[str, str]) -> str:
    """Columns that cannot be used, and why."""
    return "".join(f"; {name!r} is none, as {why}" for name, why in ignored.items())


def _is_open(role: str, kind: str, values: pd.Series) -> bool:
    """Whether a column may have the role that its file says: with another quantity than frequency, as a response."""
    if role == "temperatures":
        return kind == OPEN and can_be_temperature(values)
    return kind == OPEN or kind in ("force", "strain", "displacement", "inclination", "acceleration")


def _response_unit(name: str, unit: Unit | None, values: pd.Series) -> str:
    """The unit of a response, "" where nothing tells; Hz for a letter and a number with values of frequencies."""
    kind, _ = kind_of(name, unit)
    is_mode = re.fullmatch(r"[A-Za-z]{1,2}[ _-]?\d+", name) is not None and varies_as_modes(values)
    if kind == FREQUENCY or (unit is None and is_mode):
        return HZ
    return unit.name if unit else ""


def _foreign(
    values: pd.Series, name: str, columns: Sequence[str], units: Mapping[str, Unit], roles: Mapping[str, list[str]]
) -> str:
    """The unit of a column that is in another one than degrees Celsius or Hz: as it is named, F behind the word or
    symbol of a temperature if it is no letter of a series, and kelvin by the values."""
    if unit := units.get(name):
        return unit.name if unit.kind in (TEMPERATURE, FREQUENCY) and unit.name not in ("°C", HZ) else ""
    if name in roles["responses"]:
        return ""
    letter = re.search(r"F(?=(_[A-Za-z]+)?$)", name)
    series = [name[: letter.start()] + other + name[letter.end() :] for other in "ABDEG"] if letter else []
    if letter and not set(series).intersection(columns):
        return "°F"
    return "K" if values.between(200, 340).mean() > MOSTLY else ""


def joined(tables: Iterable[pd.DataFrame], columns: Sequence[str]) -> tuple[pd.DataFrame, pd.DatetimeIndex]:
    """Records of files with the same columns one below the other, others side by side by their stamps; and stamps that
    are not in all of them, whose records wait for the rest."""
    groups: dict[frozenset[Any], list[pd.DataFrame]] = {}
    for table in tables:
        groups.setdefault(frozenset(table), []).append(table)
    whole = groups.pop(frozenset(columns), [])
    waiting = pd.DatetimeIndex([])
    if groups:
        together, waiting = side_by_side([pd.concat(one) for one in groups.values()])
        if set(together) == set(columns):
            whole.append(together)
        else:
            waiting = waiting.union(together.index)
    if not whole:
        return pd.DataFrame(columns=list(columns), index=waiting[:0], dtype=float), waiting
    return pd.concat([one[list(columns)] for one in whole]), waiting
