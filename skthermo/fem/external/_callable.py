"""Models of any function, and the file that keeps what it has solved."""

from __future__ import annotations

import copy
import json
import sqlite3
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array, check_flag, check_path, check_theta, positive_integer, real_array
from skthermo._core.warnings import warn_user
from skthermo.exceptions import ModelWarning
from skthermo.fem._terms import (
    ROWS_PER_CHUNK,
    by_name,
    check_different,
    check_severities,
    failures_named,
    warn_of_failures,
)
from skthermo.fem.damage import damage_directions

if TYPE_CHECKING:
    import pandas as pd

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
        """Frequencies of the keys that are known; a record that was damaged on the disk is not."""
        if self.path.is_dir():
            raise ValueError(f"{self.path}: the cache is a folder; expected a file, such as {self.path / 'solved'}")
        if not self.path.exists():
            return {}
        with self._opened() as database:
            if not self._is_begun(database):
                return {}
            query = "SELECT frequencies, checksum FROM solved WHERE theta = ?"
            found = ((key, row) for key in keys if (row := database.execute(query, [key]).fetchone()))
            return {key: np.frombuffer(f, "<f8") for key, (f, checksum) in found if checksum == zlib.crc32(key + f)}

    def add(self, solved: Mapping[bytes, Array]) -> None:
        """Write frequencies by their key; other processes wait meanwhile."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self._opened() as database:
            database.execute("BEGIN IMMEDIATE")
            if not self._is_begun(database):
                database.execute("CREATE TABLE about (columns TEXT)")
                columns = "theta BLOB PRIMARY KEY, frequencies BLOB, checksum INTEGER"
                database.execute(f"CREATE TABLE solved ({columns}) WITHOUT ROWID")
                database.execute("INSERT INTO about VALUES (?)", [json.dumps(self._describes)])
            records = ((key, frequencies.astype("<f8").tobytes()) for key, frequencies in solved.items())
            rows = ((key, f, zlib.crc32(key + f)) for key, f in records)
            database.executemany("INSERT OR REPLACE INTO solved VALUES (?, ?, ?)", rows)

    @contextmanager
    def _opened(self) -> Iterator[sqlite3.Connection]:
        """The database; what is written is kept if nothing fails."""
        try:
            with closing(sqlite3.connect(self.path, timeout=SECONDS, isolation_level=None)) as database, database:
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


def read_parameter_groups(
    groups: Mapping[str, str | Sequence[str]] | None, parameter_names: Sequence[str]
) -> dict[str, tuple[str, ...]]:
    """Parameters of each damage group; by default each parameter is one."""
    if groups is None:
        return {name: (name,) for name in parameter_names}
    if not isinstance(groups, Mapping):
        raise ValueError(f"groups is {groups!r:.200}; expected a mapping of group to the parameters that it scales")
    found = {group: check_different(names) for group, names in groups.items()}
    for group, names in found.items():
        unknown = [name for name in names if name not in parameter_names]
        if unknown:
            raise ValueError(f"group {group!r} names {unknown}; expected some of {list(parameter_names)}")
    return found


ROWS_PER_TASK = 32
"""Rows per task for a function that solves row by row: few, so that all workers are busy and progress is visible."""


class CallableModel:
    """An FE model from any function that turns parameters into frequencies.

    Parameters
    ----------
    function : callable
        Takes one row of multipliers, an array of shape (n_parameters,), and returns the
        frequencies in Hz, (n_modes,), NaN where one is not known. With ``vectorized=True`` it takes (n_samples,
        n_parameters) and returns (n_samples, n_modes).
    parameter_names : sequence of str
        Columns of theta.
    n_modes : int
        Number of frequencies returned.
    vectorized : bool, default=False
        Whether the function takes many rows at once.
    cache : str or path-like, optional
        A file, an SQLite database, that stores every solved row of theta, so that no row is solved twice, neither
        after a crash nor in a later process.
    groups : mapping of str to str or sequence of str, optional
        Damage group -> the parameters that its damage multiplies by 1 - severity, which should be of stiffness alone.
        By default each parameter is a group.

    Attributes
    ----------
    cache : Path or None
        The file, as an absolute path.
    groups : dict of str to tuple of str
        Damage groups and their parameters.

    Raises
    ------
    ValueError
        If the cache is a folder or belongs to other parameters or another number of modes, or a group names unknown
        parameters.

    See Also
    --------
    probe : For programs that return matrices.

    Notes
    -----
    A row is recognised by the exact bits of its theta and is written as soon as it is solved; with
    ``vectorized=True``, all rows of a call are written together. Several processes may share a cache. It cannot know
    whether the function is still the same: delete the file when the function changes.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.fem import CallableModel
    >>> model = CallableModel(lambda row: np.sqrt(row[0]) * np.array([1.0, 2.0]), ["E"], 2)
    >>> model.frequencies([[1.0], [4.0]])
    array([[1., 2.],
           [2., 4.]])
    >>> model.damaged({"E": 0.19}).frequencies([[1.0]])
    array([[0.9, 1.8]])
    """

    def __init__(
        self,
        function: Callable[[Array], ArrayLike],
        parameter_names: Sequence[str],
        n_modes: int,
        *,
        vectorized: bool = False,
        cache: str | PathLike | None = None,
        groups: Mapping[str, str | Sequence[str]] | None = None,
    ):
        if not callable(function) or isinstance(function, type):
            raise ValueError(f"function is {function!r}; expected a callable")
        self.function = function
        self.parameter_names = check_different(parameter_names)
        self.n_modes = positive_integer(n_modes, "n_modes")
        self.vectorized = check_flag(vectorized, "vectorized")
        self.groups = read_parameter_groups(groups, self.parameter_names)
        self._factors = np.ones(len(self.parameter_names))
        self._is_quiet = False
        self._samples = None if cache is None else SampleCache(cache, self.parameter_names, self.n_modes)

    @property
    def cache(self) -> Path | None:
        """The file that keeps solved rows."""
        return None if self._samples is None else self._samples.path

    @property
    def rows_per_chunk(self) -> int:
        """Number of samples in one parallel task."""
        return ROWS_PER_CHUNK if self.vectorized else ROWS_PER_TASK

    def frequencies(self, theta: ArrayLike) -> Array:
        """Natural frequencies.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters. Rows that repeat are solved once.

        Returns
        -------
        ndarray of shape (n_samples, n_modes)
            In Hz. Rows at which the function fails are NaN, with a warning, and are not cached. It fails if it raises
            an error or returns a frequency that is neither NaN nor finite and positive.

        Raises
        ------
        ValueError
            If the function returns another shape or values that are not real numbers.
        RuntimeError
            If the function fails at all of several rows (cached rows count as solved) or, with ``vectorized=True``,
            raises an error for several rows at once. It names the first such theta.
        """
        rows = check_theta(theta, self.parameter_names) * self._factors
        keys = [row.tobytes() for row in rows.astype("<f8")]
        known = {} if self._samples is None else self._samples.read(keys)
        missing = {key: row for key, row in zip(keys, rows, strict=True) if key not in known}
        batches = [list(missing)] if self.vectorized and missing else [[key] for key in missing]
        solved: dict[bytes, Array] = {}
        failures: dict[bytes, RuntimeError] = {}
        whole_batch_fails = False
        for batch in batches:
            asked = np.array([missing[key] for key in batch])
            try:
                frequencies = self._solve(asked)
            except RuntimeError as failure:
                failures |= dict.fromkeys(batch, failure)
                whole_batch_fails = len(batch) > 1
                continue
            impossible = self._impossible(asked, frequencies)
            failures |= {batch[row]: failure for row, failure in impossible.items()}
            good = {key: frequencies[row] for row, key in enumerate(batch) if row not in impossible}
            if self._samples is not None and good:
                self._samples.add(good)
            solved |= good
        if failures:
            first = next(iter(failures.values()))
            everywhere = whole_batch_fails or len(failures) == len(set(keys))
            if len(failures) > 1 and everywhere and not self._is_quiet:
                raise first
            if not self._is_quiet:
                warn_user(
                    f"{len(failures)} of {len(rows)} rows are NaN, because the model failed: {first}",
                    ModelWarning,
                    "failing-program",
                )
            solved |= dict.fromkeys(failures, np.full(self.n_modes, np.nan))
        found = [solved[key] if key in solved else known[key] for key in keys]
        return np.array(found).reshape(len(rows), self.n_modes)

    def _solve(self, rows: Array) -> Array:
        argument, shape = (rows, (len(rows), self.n_modes)) if self.vectorized else (rows[0], (self.n_modes,))
        with failures_named(argument, self.parameter_names):
            returned = self.function(argument.copy())
        where = f"at theta = {by_name(rows[0], self.parameter_names)}"
        result = real_array(returned, f"what the model's function returned {where}")
        if result.size != np.prod(shape) or result.shape[-1:] != shape[-1:]:
            raise ValueError(
                f"the model's function returned shape {result.shape}; expected {shape}"
                + ("" if self.vectorized else " for one row of theta (for many rows: vectorized=True)")
                + f", {where}"
            )
        return result.reshape(len(rows), self.n_modes)

    def _impossible(self, rows: Array, frequencies: Array) -> dict[int, RuntimeError]:
        wrong = ~np.isnan(frequencies) & ~(np.isfinite(frequencies) & (frequencies > 0))
        return {
            int(row): RuntimeError(
                f"the model's function returned {frequencies[row][wrong[row]][0]} Hz at theta = "
                f"{by_name(rows[row], self.parameter_names)}; expected frequencies that are finite and positive, or NaN"
            )
            for row in np.flatnonzero(wrong.any(axis=1))
        }

    def damaged(self, damage: Mapping[str, float]) -> CallableModel:
        """A new model with damage: the parameters of each group are multiplied by 1 - severity.

        Parameters
        ----------
        damage : mapping of str to float
            Group -> severity: 0.5 is half, -0.15 a strengthening by 15 %. A parameter in several damaged groups is
            multiplied by all their factors.

        Returns
        -------
        CallableModel
            Of the same function, which is called at other theta, and with the same cache.

        Raises
        ------
        ValueError
            If a group is unknown, or a severity is 1 or more or not finite.
        """
        twin = copy.copy(self)
        twin._factors = self._factors.copy()
        for group, severity in check_severities(damage, self.groups).items():
            twin._factors[[self.parameter_names.index(name) for name in self.groups[group]]] *= 1 - severity
        return twin

    def damage_directions(self, groups: Sequence[str] | None = None) -> pd.DataFrame:
        """Relative change of each frequency per loss of stiffness of each damage group, for small losses.

        Parameters
        ----------
        groups : sequence of str, optional
            Damage groups. By default all but those that other groups make up.

        Returns
        -------
        DataFrame of shape (n_groups, n_modes)
            Central differences of ln f by the severity, at the model's nominal state. Groups that move no frequency
            are left out.

        Raises
        ------
        ValueError
            If a group is unknown, or none moves a frequency.
        """
        return damage_directions(self, groups)

    def quiet(self) -> CallableModel:
        """The same model, but without warnings and errors: it gives NaN where the function fails.

        Returns
        -------
        CallableModel
            For searches.
        """
        twin = copy.copy(self)
        twin._is_quiet = True
        return twin

    def warn_of(self, theta: Array, frequencies: Array) -> None:
        """Warn of rows without frequencies.

        Parameters
        ----------
        theta, frequencies : ndarray of shape (n_samples, n_parameters) and (n_samples, n_modes)
            A table and its solution.
        """
        if not self._is_quiet:
            warn_of_failures(theta, frequencies)

    def __sklearn_clone__(self) -> CallableModel:
        return self

    def __repr__(self) -> str:
        name = getattr(self.function, "__name__", type(self.function).__name__)
        return f"CallableModel({name}, {list(self.parameter_names)}, {self.n_modes} modes)"
