"""Reading what an affine model is made from."""

from collections.abc import Mapping, Sequence
from numbers import Integral, Real

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

Array = NDArray[np.float64]
Key = tuple[str, ...]


def read_terms(terms, what: str, n_dof: int | None = None) -> tuple[list[Key], Array]:
    """Keys and stacked matrices (n_terms, n_dof, n_dof), copied, symmetric and dense."""
    if isinstance(terms, Mapping):
        pairs = list(terms.items())
    elif isinstance(terms, Sequence) and all(_is_pair(term) for term in terms):
        pairs = list(terms)
    else:
        pairs = [((), terms)]
    if not pairs:
        raise ValueError(f"{what} has no terms; expected at least one matrix")
    keys = [_read_key(key, what) for key, _ in pairs]
    matrices = []
    for key, (_, matrix) in zip(keys, pairs, strict=True):
        matrices.append(_read_matrix(matrix, f"{what} term {key}", n_dof))
        n_dof = len(matrices[0])
    return keys, np.stack(matrices)


def _is_pair(term) -> bool:
    return isinstance(term, tuple) and len(term) == 2 and isinstance(term[0], tuple | str)


def _read_key(key, what: str) -> Key:
    names = (key,) if isinstance(key, str) else key
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{what} has the key {key!r}; expected a tuple of parameter names")
    return names


def _read_matrix(matrix, what: str, n_dof: int | None) -> Array:
    array = matrix.toarray() if scipy.sparse.issparse(matrix) else np.asarray(matrix)
    if np.iscomplexobj(array):
        raise ValueError(f"{what} is complex; expected a real matrix")
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not array.size:
        raise ValueError(f"{what} has shape {array.shape}; expected a square matrix")
    if n_dof is not None and len(array) != n_dof:
        raise ValueError(f"{what} has shape {array.shape}; expected ({n_dof}, {n_dof}) like the first term")
    array = array.astype(float)
    if not np.isfinite(array).all():
        raise ValueError(f"{what} holds values that are not finite")
    if np.abs(array - array.T).max() > 1e-8 * np.abs(array).max():
        row, column = np.unravel_index(np.abs(array - array.T).argmax(), array.shape)
        raise ValueError(
            f"{what} is not symmetric: entries ({row}, {column}) and ({column}, {row}) are "
            f"{array[row, column]} and {array[column, row]}"
        )
    return (array + array.T) / 2


def check_names(parameter_names: Sequence[str] | None, keys: Sequence[Key]) -> tuple[str, ...]:
    """The parameters' names; every one in some term, and no term with another."""
    mentioned = dict.fromkeys(name for key in keys for name in key)
    if parameter_names is None:
        names = tuple(mentioned)
        if not names:
            raise ValueError("no term names a parameter; expected at least one, such as ('E_deck',)")
        return names
    names = check_different(parameter_names)
    unknown = [name for name in mentioned if name not in names]
    if unknown:
        raise ValueError(f"terms name {unknown}; expected only the parameters {list(names)}")
    idle = [name for name in names if name not in mentioned]
    if idle:
        raise ValueError(f"no term names the parameters {idle}; the terms name {list(mentioned)}")
    return names


def check_different(parameter_names: Sequence[str] | str) -> tuple[str, ...]:
    """Names of parameters, each once."""
    names = (parameter_names,) if isinstance(parameter_names, str) else tuple(parameter_names)
    if not names or len(set(names)) < len(names):
        raise ValueError(f"parameter_names is {names}; expected one or more different names")
    return names


def check_groups(groups, names: Sequence[str], keys: Sequence[Key]) -> dict[str, tuple[int, ...]]:
    """Damage groups as positions of stiffness terms."""
    if groups is None:
        groups = {name: [i for i, key in enumerate(keys) if name in key] for name in names}
        return {name: tuple(positions) for name, positions in groups.items() if positions}
    found = {}
    for group, terms in groups.items():
        positions: set[int] = set()
        for term in [terms] if isinstance(terms, str) else terms:
            matches = [i for i, key in enumerate(keys) if term in (i, key) or (term,) == key]
            if not matches:
                raise ValueError(f"group {group!r} names the term {term!r}; expected one of {list(keys)}")
            positions.update(matches)
        if not positions:
            raise ValueError(f"group {group!r} names no stiffness term")
        found[group] = tuple(sorted(positions))
    return found


def check_severities(damage: Mapping[str, float], groups) -> Mapping[str, float]:
    """Known groups, and severities that leave some stiffness."""
    if not isinstance(damage, Mapping):
        raise ValueError(f"damage is {damage!r}; expected a mapping of group to severity")
    for group, severity in damage.items():
        if group not in groups:
            raise ValueError(f"unknown damage group {group!r}; expected one of {sorted(groups)}")
        if not (isinstance(severity, Real) and -np.inf < severity < 1):
            raise ValueError(
                f"damage of group {group!r} has severity {severity!r}; expected a number below 1 "
                "(0.5 halves the stiffness, -0.15 adds 15 %)"
            )
    return damage


def check_n_modes(n_modes: int) -> int:
    """A positive number of modes."""
    if not isinstance(n_modes, Integral) or isinstance(n_modes, bool) or n_modes < 1:
        raise ValueError(f"n_modes is {n_modes!r}; expected a positive integer")
    return n_modes


def count_modes(mass: Array, *, at_least: int) -> int:
    """How many modes of finite frequency a mass matrix allows."""
    check_n_modes(at_least)
    eigenvalues = np.linalg.eigvalsh(mass)
    tolerance = 10 * len(mass) * np.finfo(float).eps * abs(eigenvalues[-1])
    if eigenvalues[0] < -tolerance:
        raise ValueError(f"the nominal mass has the negative eigenvalue {eigenvalues[0]:.3g}; expected none below zero")
    count = int((eigenvalues > tolerance).sum())
    if count < at_least:
        raise ValueError(
            f"n_modes is {at_least}, but {len(mass)} degrees of freedom, {len(mass) - count} of them "
            f"massless, have only {count} modes"
        )
    return count


def exponents_of(keys: Sequence[Key], names: Sequence[str]) -> NDArray[np.int64]:
    """How often each parameter stands in each key, (n_terms, n_parameters)."""
    return np.array([[key.count(name) for name in names] for key in keys], dtype=np.int64)
