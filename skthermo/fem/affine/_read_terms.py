"""Reads and checks the arguments of an affine model."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._estimators.arguments import as_mapping, integer_row
from skthermo._tables.arrays import Matrix, MatrixLike, is_real, real_array

Key = tuple[str, ...]

DENSE_DOFS = 200  # degrees of freedom up to which dense batches are faster (tests/benchmarks/dense_or_sparse.py)
LOWEST_SEVERITY = -10.0  # lowest severity accepted; a lower number is probably a percentage given instead of a fraction
DENSE_SHARE = 0.3  # share of nonzero entries above which a matrix counts as dense


def read_terms(terms, what: str, n_dof: int | None = None) -> tuple[list[Key], list[Matrix]]:
    """Keys and matrices: symmetric copies, dense or sparse as given."""
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
        matrices.append(read_matrix(matrix, f"{what} term {key}", n_dof))
        n_dof = matrices[0].shape[0]
    return keys, matrices


def _is_pair(term) -> bool:
    return isinstance(term, tuple) and len(term) == 2 and isinstance(term[0], tuple | str)


def _read_key(key, what: str) -> Key:
    names = (key,) if isinstance(key, str) else key
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{what} has the key {key!r}; expected a tuple of parameter names")
    return names


def read_matrix(matrix, what: str, n_dof: int | None) -> Matrix:
    """An exactly symmetric copy of a matrix that is symmetric to 1e-8 of its largest entry, dense or sparse."""
    array = scipy.sparse.csc_array(matrix) if scipy.sparse.issparse(matrix) else real_array(matrix, what)
    if np.iscomplexobj(array):
        raise ValueError(f"{what} is complex; expected real numbers")
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not array.shape[0]:
        raise ValueError(f"{what} has shape {array.shape}; expected a square matrix")
    if n_dof is not None and array.shape[0] != n_dof:
        raise ValueError(f"{what} has shape {array.shape}; expected ({n_dof}, {n_dof}) like the first term")
    array = array.astype(float)
    if not np.isfinite(array.data if scipy.sparse.issparse(array) else array).all():
        raise ValueError(f"{what} holds values that are not finite")
    skew = abs(array - array.T)
    if skew.max() > 1e-8 * abs(array).max():
        row, column = np.unravel_index(int(skew.argmax()), array.shape)
        raise ValueError(
            f"{what} is not symmetric: entries ({row}, {column}) and ({column}, {row}) are "
            f"{array[row, column]} and {array[column, row]}"
        )
    return (array + array.T) / 2


def read_mass(mass: MatrixLike, what: str, n_dof: int) -> Matrix:
    """A mass matrix; lumped masses, in a vector, become its diagonal."""
    if scipy.sparse.issparse(mass) or real_array(mass, what).ndim != 1:
        return read_matrix(mass, what, n_dof)
    if np.shape(mass) != (n_dof,):
        raise ValueError(f"{what} has shape {np.shape(mass)}; expected ({n_dof},) or a matrix")
    return read_matrix(scipy.sparse.diags_array(real_array(mass, what)), what, n_dof)


def are_sparse(matrices: Sequence[Matrix], n_modes: int) -> bool:
    """Whether shift-invert is faster than dense batches for this many modes."""
    n_dof = matrices[0].shape[0]
    entries = sum(np.count_nonzero(m) if isinstance(m, np.ndarray) else m.nnz for m in matrices)
    return n_dof > max(DENSE_DOFS, 4 * n_modes) and entries < DENSE_SHARE * n_dof**2


def check_names(parameter_names: Sequence[str] | None, keys: Sequence[Key]) -> tuple[str, ...]:
    """Names of the parameters, checked: each occurs in some term, and the terms contain no other names."""
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
    unused = [name for name in names if name not in mentioned]
    if unused:
        raise ValueError(f"no term names the parameters {unused}; expected some of {list(mentioned)}")
    return names


def check_different(parameter_names: Sequence[str] | str) -> tuple[str, ...]:
    """Names of parameters, all different."""
    if not isinstance(parameter_names, Iterable) or isinstance(parameter_names, bytes | type):
        raise ValueError(f"parameter_names is {parameter_names!r}; expected one or more different names")
    names = (parameter_names,) if isinstance(parameter_names, str) else tuple(parameter_names)
    if not names or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        raise ValueError(f"parameter_names is {names}; expected one or more different names")
    return names


def check_groups(groups, names: Sequence[str], keys: Sequence[Key]) -> dict[str, tuple[int, ...]]:
    """Damage groups as positions of stiffness terms."""
    if groups is None:
        groups = {name: [i for i, key in enumerate(keys) if name in key] for name in names}
        return {name: tuple(positions) for name, positions in groups.items() if positions}
    found = {}
    if not isinstance(groups, Mapping):
        raise ValueError(f"groups is {groups!r:.200}; expected a mapping of group to the terms that it scales")
    for group, terms in groups.items():
        if isinstance(terms, bytes | type) or not isinstance(terms, Iterable):
            raise ValueError(f"group {group!r} is {terms!r:.200}; expected stiffness terms, such as ['E_deck']")
        positions: set[int] = set()
        for term in [terms] if isinstance(terms, str) else terms:
            matches = [i for i, key in enumerate(keys) if term in (i, key) or (term,) == key]
            if not matches or isinstance(term, bool):
                raise ValueError(f"group {group!r} names the term {term!r}; expected one of {list(keys)}")
            positions.update(matches)
        if not positions:
            raise ValueError(f"group {group!r} names no stiffness term; expected one or more of {list(keys)}")
        found[group] = tuple(sorted(positions))
    return found


def check_severities(damage: Mapping[str, float], groups) -> Mapping[str, float]:
    """Checks that groups are known and that severities leave some stiffness."""
    damage = as_mapping(damage)
    if not isinstance(damage, Mapping):
        raise ValueError(f"damage is {damage!r}; expected a mapping of group to severity")
    for group, severity in damage.items():
        if group not in groups:
            raise ValueError(f"unknown damage group {group!r}; expected one of {sorted(groups)}")
        if not (is_real(severity) and LOWEST_SEVERITY <= float(severity) < 1):
            raise ValueError(
                f"damage of group {group!r} has severity {severity!r}; expected a number below 1, and not below "
                f"{LOWEST_SEVERITY:g} (0.5 halves the stiffness, -0.15 adds 15 %)"
            )
    return damage


def check_modes(modes: Sequence[int], available: int) -> NDArray[np.intp]:
    """Checks that ranks of modes are different integers from 0 to below the number available."""
    ranks = integer_row(modes, "modes", "ranks of modes, such as [0, 1, 3, 2], the lowest being 0")
    outside = ranks[(ranks < 0) | (ranks >= available)]
    if outside.size:
        raise ValueError(f"mode {outside[0]} is none of the model's; expected 0 to {available - 1}")
    if len(np.unique(ranks)) < len(ranks):
        raise ValueError(f"modes {ranks.tolist()} repeat; expected each once")
    return ranks.astype(np.intp)


def exponents_of(keys: Sequence[Key], names: Sequence[str]) -> NDArray[np.int64]:
    """How often each parameter occurs in each key, (n_terms, n_parameters)."""
    return np.array([[key.count(name) for name in names] for key in keys], dtype=np.int64)
