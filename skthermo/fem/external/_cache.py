"""A file of solved samples, shared with other and later processes."""

import json
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from os import PathLike

import numpy as np

from skthermo._estimators.arguments import check_path
from skthermo._tables.arrays import Array

SECONDS = 600  # a process waits so long while others write


class SampleCache:
    """An SQLite database of frequencies by the bytes of their theta, to which several processes may add.

    The file and its folder are created when the first sample is solved. A folder, or a file that belongs to other
    parameters, another number of modes or something else, is an error.
    """

    def __init__(self, path: str | PathLike, parameter_names: Sequence[str], n_modes: int):
        self.path = check_path(path, "cache").absolute()
        self._describes = {"parameter_names": list(parameter_names), "n_modes": int(n_modes)}
        self.read([])

    def read(self, keys: Sequence[bytes]) -> dict[bytes, Array]:
        """Frequencies of the keys that are known."""
        if self.path.is_dir():
            raise ValueError(f"{self.path}: the cache is a folder; expected a file, such as {self.path / 'solved'}")
        if not self.path.exists():
            return {}
        with self._opened() as database:
            if not self._is_begun(database):
                return {}
            found = (
                (k, database.execute("SELECT frequencies FROM solved WHERE theta = ?", [k]).fetchone()) for k in keys
            )
            return {key: np.frombuffer(row[0], "<f8") for key, row in found if row}

    def add(self, solved: Mapping[bytes, Array]) -> None:
        """Write frequencies by their key; other processes wait meanwhile."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self._opened() as database:
            database.execute("BEGIN IMMEDIATE")
            if not self._is_begun(database):
                database.execute("CREATE TABLE about (columns TEXT)")
                database.execute("CREATE TABLE solved (theta BLOB PRIMARY KEY, frequencies BLOB) WITHOUT ROWID")
                database.execute("INSERT INTO about VALUES (?)", [json.dumps(self._describes)])
            rows = ((key, frequencies.astype("<f8").tobytes()) for key, frequencies in solved.items())
            database.executemany("INSERT OR REPLACE INTO solved VALUES (?, ?)", rows)

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        """The database; what is written is kept if nothing fails."""
        try:
            with closing(sqlite3.connect(self.path, SECONDS, isolation_level=None)) as database, database:
                # A killed process loses nothing; a power failure may cost the file, which only saves time.
                database.execute("PRAGMA synchronous = OFF")
                yield database
        except sqlite3.DatabaseError as error:
            if isinstance(error, sqlite3.OperationalError):
                raise
            raise self._refusal(f"something that is not a cache of solved samples ({error})") from None

    def _is_begun(self, database: sqlite3.Connection) -> bool:
        """Whether the tables are there; those of another file are an error."""
        tables = {name for (name,) in database.execute("SELECT name FROM sqlite_master WHERE type = 'table'")}
        if not tables:
            return False
        if tables != {"about", "solved"}:
            raise self._refusal("something that is not a cache of solved samples")
        got = json.loads(database.execute("SELECT columns FROM about").fetchone()[0])
        if got != self._describes:
            raise self._refusal(got)
        return True

    def _refusal(self, got: object) -> ValueError:
        return ValueError(f"{self.path}: the file holds {got}; expected {self._describes}, or a path of its own")
