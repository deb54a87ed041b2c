"""Which records are new: files of a folder that were not taken in yet, and rows that have been appended to others."""

from __future__ import annotations

import json
import os
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pandas as pd

from skthermo._core.files import write_when_complete
from skthermo._core.text import counted
from skthermo._core.warnings import warn_each
from skthermo.commands._settings import RecordSettings
from skthermo.exceptions import RecordsWarning
from skthermo.preprocessing.loggers.logger_files import NO_TEXT_FILES, CsvFormat, read_file
from skthermo.preprocessing.loggers.together import in_celsius, joined, once


@dataclass(frozen=True)
class NewFile:
    """Rows of a file that were not taken in before, after so many that were; ``seen`` says how the file was found."""

    path: Path
    rows: pd.DataFrame
    before: pd.DataFrame
    seen: Mapping[str, Any]


@dataclass
class Taken:
    """What has been taken in from which files, kept beside the monitor.

    ``layouts`` are the sets of columns that the files of the baseline have, ``fitted`` is the time of the fit, and
    ``settings`` are those of the fit. For each file there are its size, the time of its last change, and how many of
    its first rows are done, with a checksum of these. If a command is killed after it has saved the monitor, rows come
    again, and the monitor knows them.
    """

    file: Path
    layouts: list[list[str]] = field(default_factory=list)
    files: dict[str, dict[str, Any]] = field(default_factory=dict)
    fitted: str = ""
    settings: dict[str, Any] | None = None

    @classmethod
    def read(cls, file: Path) -> Taken:
        """What an earlier call has left in a file beside the monitor; nothing if that cannot be read."""
        try:
            content = json.loads(file.read_text(encoding="utf-8"))
            return cls(file, content["layouts"], content["files"], content["fitted"], content.get("settings"))
        except (OSError, ValueError, KeyError, TypeError):
            return cls(file)

    def write(self) -> None:
        """Keep it for the next call."""
        content = {name: value for name, value in vars(self).items() if name != "file"}
        write_when_complete(self.file, json.dumps(content, indent=1) + "\n")

    def new_in(self, file: Path, read: Any) -> NewFile | None:
        """What is new in a file; None if it is as it was when all of it was taken in."""
        known = self.files.get(self._key(file), {})
        found = file.stat()
        if not found.st_size:
            return None
        seen = {"size": found.st_size, "changed": found.st_mtime_ns}
        is_as_before = all(known.get(name) == value for name, value in seen.items())
        if is_as_before and known.get("whole"):
            return None
        table = read(file, leave_unfinished=not is_as_before)  # a line that is not finished may be, the next time
        n_rows = known.get("rows", 0)
        n_done = n_rows if len(table) >= n_rows and _checksum(table[:n_rows]) == known.get("checksum") else 0
        end = file.read_bytes().rstrip(b"\0")[-1:]
        is_finished = is_as_before or file.suffix.lower() in NO_TEXT_FILES or end in (b"\n", b"\r")
        return NewFile(file, table[n_done:], table[:n_done], seen | {"whole": is_finished})

    def _key(self, file: Path) -> str:
        """How a file is called: by its path from the folder of the monitor, wherever the command is started."""
        return os.path.relpath(file, self.file.parent)

    def note(self, file: NewFile, handed: pd.DatetimeIndex) -> None:
        """Rows of a file that are done: the first ones, up to one whose stamp was not handed over."""
        waiting = ~file.rows.index.isin(handed)
        n_done = int(waiting.argmax()) if waiting.any() else len(file.rows)
        done = pd.concat([file.before, file.rows[:n_done]])
        self.files[self._key(file.path)] = dict(file.seen) | {
            "rows": len(done),
            "checksum": _checksum(done),
            "whole": file.seen["whole"] and not waiting.any(),
        }


def _checksum(table: pd.DataFrame) -> int:
    return zlib.crc32(pd.util.hash_pandas_object(table.astype(float)).to_numpy().tobytes())


def files_in(folder: Path) -> list[Path]:
    """Files of records in a folder, by name; hidden and unfinished ones are left out."""
    endings = (".csv", ".txt", ".dat", ".tsv", *NO_TEXT_FILES)
    return sorted(one for one in folder.glob("*") if one.suffix.lower() in endings and one.name[0] not in "._~")


def read_columns(
    file: Path, form: CsvFormat, records: RecordSettings, *, leave_unfinished: bool = False
) -> pd.DataFrame:
    """Records of a file in the columns that the settings name, temperatures in degrees Celsius."""
    table = read_file(file, form, ignore=records.ignore, leave_unfinished=leave_unfinished)
    unknown = [name for name in table if name not in records.columns]
    if unknown:
        raise ValueError(
            f"{file} has the columns {unknown}, which [records] does not name; expected {records.columns}, and other "
            "columns under ignore"
        )
    return in_celsius(table, records.convert)


def check_layout(table: pd.DataFrame, file: Path, records: RecordSettings, layouts: Sequence[Sequence[str]]) -> None:
    """Raise an error if a file has not the columns of a file of the baseline, or all columns."""
    known = [records.columns, *layouts]
    if not any(set(table) == set(layout) for layout in known):
        nearest = max(known, key=lambda layout: len(set(layout) & set(table)))
        lacking = [name for name in nearest if name not in table]
        raise ValueError(f"{file} lacks the columns {lacking}; expected {nearest}, in any order, as in the baseline")


def read_baseline(
    files: Sequence[Path], form: CsvFormat, records: RecordSettings
) -> tuple[pd.DataFrame, list[list[str]]]:
    """Records of the baseline's files, in order of time, and the columns of each file."""
    tables = [read_columns(file, form, records) for file in files]
    lacking = [name for name in records.columns if not any(name in table for table in tables)]
    if lacking:
        raise ValueError(f"no file of the baseline has the columns {lacking}; expected {records.columns}")
    whole, waiting = joined(tables, records.columns)
    if not len(whole):
        stamps = ", ".join(f"{file.name} from {table.index.min()}" for file, table in zip(files, tables, strict=True))
        raise ValueError(f"no stamp is in all files of the baseline ({stamps}); expected records of the same times")
    if len(waiting):
        text = (
            f"{counted(len(waiting), 'stamp')} of the baseline are not in all files, the first {waiting.min()}. They "
            f"are left out; {len(whole)} records have all columns. If they are many, compare the clocks of the loggers"
        )
        warn_each([RecordsWarning(text, "different-rows")])
    return once(whole).sort_index(), [list(table) for table in tables]
