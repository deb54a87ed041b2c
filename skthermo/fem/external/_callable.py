"""Models of any function."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from os import PathLike

import numpy as np
from joblib import Memory
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array, check_flag, check_path, check_theta, mapping_of, positive_integer, real_array
from skthermo._core.warnings import warn_each
from skthermo.exceptions import ModelWarning
from skthermo.fem._terms import (
    ROWS_PER_CHUNK,
    ImmutableModel,
    by_name,
    check_different,
    check_severities,
    failures_named,
)
from skthermo.fem.damage import LossKind, kind_option


def read_parameter_groups(
    groups: Mapping[str, str | Sequence[str]] | None, parameter_names: Sequence[str]
) -> dict[str, tuple[str, ...]]:
    """Parameters of each damage group; by default each parameter is one."""
    if groups is None:
        return {name: (name,) for name in parameter_names}
    groups = mapping_of(groups, "groups", "a mapping of group to the parameters that it scales")
    return {group: check_different(names, f"group {group!r}", parameter_names) for group, names in groups.items()}


def frequencies_of_row(
    parameter_names: tuple[str, ...], n_modes: int, theta: bytes, solve: Callable[[], Array]
) -> Array:
    """The result of ``solve``, which the memory keeps by the other arguments."""
    return solve()


class CallableModel(ImmutableModel):
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
        A folder in which a `joblib.Memory` keeps every solved row of theta, so that no row is solved twice, neither
        after a crash nor in a later process.
    groups : mapping of str to str or sequence of str, optional
        Damage group -> the parameters that its damage multiplies by 1 - severity, which should be of stiffness alone.
        By default each parameter is a group.

    Attributes
    ----------
    cache : Path or None
        The folder, as an absolute path.
    groups : dict of str to tuple of str
        Damage groups and their parameters.

    Raises
    ------
    ValueError
        If the cache is a file, or a group names unknown parameters.

    See Also
    --------
    probe : For programs that return matrices.

    Notes
    -----
    A row is recognised by the names of the parameters, the number of modes and the exact bits of its theta, and is
    written as soon as it is solved. Several processes may share a cache. It cannot know whether the function is still
    the same: delete the folder when the function changes.

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
        self.cache = None if cache is None else check_path(cache, "cache").absolute()  # wherever the process goes
        if self.cache is not None and self.cache.is_file():
            raise ValueError(f"{self.cache}: the cache is a file; expected a folder")
        self._memory = Memory(self.cache, verbose=0)

    @property
    def rows_per_chunk(self) -> int:
        """Number of samples in one parallel task: few for a slow function, so that all workers are busy."""
        return ROWS_PER_CHUNK if self.vectorized else 32

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
        different = dict(zip(keys, rows, strict=True))
        asked, kept = (self.parameter_names, self.n_modes), self._memory.cache(frequencies_of_row, ignore=["solve"])
        missing = [key for key in different if not kept.check_call_in_cache(*asked, key, None)]
        found: dict[bytes, Array] = {}
        failed: dict[bytes, RuntimeError] = {}
        for batch in [missing] if self.vectorized and missing else [[key] for key in missing]:
            try:
                solved = self._solve(np.array([different[key] for key in batch]))
            except RuntimeError as failure:
                failed |= dict.fromkeys(batch, failure)
                continue
            for key, own in zip(batch, solved, strict=True):
                try:
                    found[key] = kept(*asked, key, partial(self._possible, different[key], own))
                except RuntimeError as failure:
                    failed[key] = failure
        first = next(iter(failed.values()), None)
        if first is not None and not self._is_quiet:
            are_one = all(failure is first for failure in failed.values())  # an error for many rows at once
            if len(failed) > 1 and (len(failed) == len(different) or are_one):
                raise first
            warn_each([ModelWarning(f"some rows are NaN, because the model failed: {first}", "no-solution")])
        found |= dict.fromkeys(failed, np.full(self.n_modes, np.nan))
        for key in different.keys() - found.keys():  # which the memory has, or solves again if its file is damaged
            found[key] = kept(*asked, key, lambda row=different[key]: self._solve(row[np.newaxis])[0])
        return np.array([found[key] for key in keys]).reshape(len(rows), self.n_modes)

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

    def _possible(self, row: Array, frequencies: Array) -> Array:
        wrong = ~np.isnan(frequencies) & ~(np.isfinite(frequencies) & (frequencies > 0))
        if wrong.any():
            raise RuntimeError(
                f"the model's function returned {frequencies[wrong][0]} Hz at theta = "
                f"{by_name(row, self.parameter_names)}; expected frequencies that are finite and positive, or NaN"
            )
        return frequencies

    def damaged(self, damage: Mapping[str, float], *, kind: LossKind = "stiffness") -> CallableModel:
        """A new model with damage: the parameters of each group are multiplied by 1 - severity.

        Parameters
        ----------
        damage : mapping of str to float
            Group -> severity: 0.5 is half, -0.15 a strengthening by 15 %. A parameter in several damaged groups is
            multiplied by all their factors.
        kind : {"stiffness"}, default="stiffness"
            The function knows what its parameters multiply: where one is a cross-section, with its mass, its group
            loses section.

        Returns
        -------
        CallableModel
            Of the same function, which is called at other theta, and with the same cache.

        Raises
        ------
        ValueError
            If a group is unknown, a severity is 1 or more or not finite, or the kind is another.
        """
        kind_option(self, kind)
        factors = self._factors.copy()
        for group, severity in check_severities(damage, self.groups).items():
            factors[[self.parameter_names.index(name) for name in self.groups[group]]] *= 1 - severity
        return self._twin(_factors=factors)

    def __repr__(self) -> str:
        name = getattr(self.function, "__name__", type(self.function).__name__)
        return f"CallableModel({name}, {list(self.parameter_names)}, {self.n_modes} modes)"
