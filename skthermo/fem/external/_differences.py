"""Stiffness terms from whole matrices, in each of which one parameter was multiplied."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import reduce
from operator import add

import numpy as np
import scipy.sparse

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, MatrixLike, is_real
from skthermo.exceptions import ModelWarning
from skthermo.fem._factors import factorise
from skthermo.fem.affine import check_different, read_matrix

Key = tuple[str, ...]
Terms = dict[Key, scipy.sparse.csc_array]

SAME = 1e-6
ROUNDING = 16 * np.finfo(float).eps


def relative(entries: scipy.sparse.coo_array, diagonal: Array) -> Array:
    """|entry_ij| / sqrt(d_i d_j)."""
    size, scale = np.abs(entries.data), np.sqrt(np.abs(diagonal[entries.row] * diagonal[entries.col]))
    return np.divide(size, scale, out=np.where(size > 0, np.inf, 0.0), where=scale > 0)


def split(
    base: scipy.sparse.csc_array, changed: Mapping[str, scipy.sparse.csc_array], factors: Mapping[str, float]
) -> Terms:
    """The term of each parameter that changes the matrix when it is multiplied, and the constant part that remains."""
    diagonal, rounding = base.diagonal(), ROUNDING * (len(changed) + 1)
    terms: Terms = {
        (name,): _without(rounding, matrix - base, diagonal) / (factors[name] - 1) for name, matrix in changed.items()
    }
    terms[()] = _without(rounding, base - reduce(add, terms.values()), diagonal)
    return {key: matrix for key, matrix in terms.items() if matrix.nnz} or {(): terms[()]}


def _without(rounding: float, matrix: scipy.sparse.csc_array, diagonal: Array) -> scipy.sparse.csc_array:
    entries = matrix.tocoo()
    matters = relative(entries, diagonal) > rounding
    places = entries.row[matters], entries.col[matters]
    return scipy.sparse.csc_array((entries.data[matters], places), shape=matrix.shape)


def difference_terms(
    nominal: MatrixLike,
    changed: Mapping[str, MatrixLike],
    *,
    factor: float | Mapping[str, float] = 2.0,
    check: tuple[Mapping[str, float], MatrixLike] | None = None,
) -> dict[tuple[str, ...], scipy.sparse.csc_array]:
    """Stiffness terms from whole matrices: one as built, and one with each parameter multiplied.

    The term of parameter j is K_j = (K(theta_j = factor) - K(1)) / (factor - 1), and what the terms leave of K(1) is
    constant.

    Parameters
    ----------
    nominal : array-like or sparse matrix of shape (n_dof, n_dof)
        Stiffness of the structure as built.
    changed : mapping of str to array-like or sparse matrix of shape (n_dof, n_dof)
        Parameter -> stiffness of the whole structure with that parameter, such as the modulus of a group of members,
        multiplied by ``factor``.
    factor : float or mapping of str to float, default=2.0
        What the parameters were multiplied by: one number for all, or one for each.
    check : (mapping of str to float, matrix), optional
        Multipliers of some parameters, the others being 1, and the stiffness of the whole structure with these, with
        which the sum of the terms is compared. Other multipliers than ``factor``, on all parameters at once, show that
        each is linear and that none act together.

    Returns
    -------
    dict of tuple of str to csc_array
        Stiffness terms as `AffineModel` takes them: ``(name,)`` for each parameter, and ``()`` for the constant rest
        if there is one.

    Raises
    ------
    ValueError
        If matrices have different shapes or are not symmetric; a parameter changes nothing; the stiffness falls where
        its parameter rises; the terms are together more than the whole, which names the parameter whose factor was
        another or that is not linear, or those that share members; or the terms do not give the matrix of ``check``.

    Warns
    -----
    ModelWarning
        If the constant rest is a multiple of a term wherever that term is alone: probably the factor was smaller.

    See Also
    --------
    load_affine : Reads a folder of such matrices in one call, with ``factor``.
    probe : Calls a program that returns matrices.

    Notes
    -----
    Stiffness that is linear in moduli is a sum of parts none of which has a negative eigenvalue. A term or rest that
    has one, below -1e-6 relative to the diagonal of the nominal stiffness, is an error. Matrices therefore need seven
    digits or more: Nastran's DMIG in large field has them, in small field it has not.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.fem import AffineModel, difference_terms
    >>> def tower(base=1.0, top=1.0):  # in place of a program: a fixed spring of 100 beside both
    ...     return np.array([[400.0 * base + 400 * top + 100, -400 * top], [-400 * top, 400 * top]])
    >>> terms = difference_terms(tower(), {"base": tower(base=2), "top": tower(top=2)})
    >>> list(terms), terms[()].toarray().tolist()
    ([('base',), ('top',), ()], [[100.0, 0.0], [0.0, 0.0]])
    >>> AffineModel(terms, np.eye(2), n_modes=2).frequencies([[1.0, 1.0]]).round(2)
    array([[2.13, 5.33]])
    """
    if not isinstance(changed, Mapping) or not changed:
        raise ValueError(f"changed is {changed!r:.200}; expected a mapping of parameters to stiffness matrices")
    names = check_different(list(changed))
    factors = _read_factors(factor, names)
    base = _read(nominal, "nominal")
    others = {name: _read(changed[name], f"changed[{name!r}]", base.shape[0]) for name in names}
    terms = split(base, others, factors)
    for name in names:
        if (name,) not in terms:
            raise ValueError(f"parameter {name!r} changes nothing when multiplied by {factors[name]:g}")
        if not _is_nonnegative(terms[name,], base):
            raise ValueError(
                f"multiplied by {factors[name]:g}, parameter {name!r} takes stiffness away; expected a stiffness that "
                "grows with it: is that the factor, and was nothing else changed?"
            )
    _check_rest(base, terms, factors)
    if check is not None:
        _check_sum(base, terms, check)
    return terms


def _read_factors(factor: float | Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    factors = factor if isinstance(factor, Mapping) else dict.fromkeys(names, factor)
    if set(factors) != set(names):
        raise ValueError(f"factor names {list(factors)}; expected {list(names)}, as changed does")
    for name, value in factors.items():
        if not is_real(value) or not np.isfinite(value) or value <= 0 or abs(value - 1) < SAME:
            raise ValueError(f"factor of {name!r} is {value!r}; expected a positive number other than 1, such as 2.0")
    return {name: float(factors[name]) for name in names}


def _read(matrix: MatrixLike, what: str, n_dof: int | None = None) -> scipy.sparse.csc_array:
    return scipy.sparse.csc_array(read_matrix(matrix, what, n_dof))


def _is_nonnegative(matrix: scipy.sparse.csc_array, base: scipy.sparse.csc_array) -> bool:
    """Whether no eigenvalue is below -1e-6, relative to the diagonal of the base."""
    rows = np.unique(matrix.tocoo().row)
    diagonal = base.diagonal()[rows]
    if (diagonal <= 0).any():
        return False
    scale = scipy.sparse.diags_array(1 / np.sqrt(diagonal), format="csc")
    scaled = scale @ matrix[rows][:, rows] @ scale
    return factorise(scipy.sparse.csc_array(scaled + SAME * scipy.sparse.eye_array(len(rows)))) is not None


def _check_rest(base: scipy.sparse.csc_array, terms: Terms, factors: Mapping[str, float]) -> None:
    """Refuse terms that are together more than the whole, and warn of one that seems to be less than its part."""
    rest = terms.get(())
    parts = {key[0]: term for key, term in terms.items() if key}
    if rest is None:
        return
    if not _is_nonnegative(rest, base):
        for name, part in parts.items():
            if not _is_nonnegative(base - part, base):
                raise ValueError(
                    f"the term of parameter {name!r} is more than the whole stiffness if its factor was "
                    f"{factors[name]:g}; expected the factor by which it was multiplied, and a parameter in which "
                    "stiffness is linear, such as a modulus and not a thickness"
                )
        lacking = rest.diagonal() / np.where(base.diagonal() > 0, base.diagonal(), np.inf)
        row = int(np.argmin(lacking))
        sharing = [name for name, part in parts.items() if part.diagonal()[row] > 0]
        raise ValueError(
            f"the terms of parameters {sharing} are together more than the whole stiffness, in row {row} by "
            f"{-lacking[row]:.2%}; expected groups that share no members, and the factors by which they were multiplied"
        )
    for name, part in parts.items():
        others = [abs(other) for key, other in terms.items() if key and key != (name,)]
        shared = reduce(add, others).sum(axis=0) if others else np.zeros(len(base.diagonal()))
        rows = np.flatnonzero((abs(part).sum(axis=0) > 0) & (shared == 0))
        alone, beside = part[rows], rest[rows]
        ratio = float((alone * beside).sum() / max((alone * alone).sum(), np.finfo(float).tiny))
        if alone.nnz > len(rows) and ratio > SAME and abs(beside - ratio * alone).max() < SAME * abs(beside).max():
            warn_user(
                f"where parameter {name!r} is the only one, the constant rest of the stiffness is {ratio:.4g} times "
                "its term. The term is too small if its factor is not the one that was used. Give the factor "
                f"{1 + (factors[name] - 1) / (1 + ratio):.4g} in place of {factors[name]:g}, unless that rest is meant",
                ModelWarning,
                "doubtful-factor",
            )


def _check_sum(base: scipy.sparse.csc_array, terms: Terms, check: tuple[Mapping[str, float], MatrixLike]) -> None:
    """Refuse terms that do not give the stiffness at other multipliers."""
    if not isinstance(check, tuple | list) or len(check) != 2 or not isinstance(check[0], Mapping):
        raise ValueError(f"check is {check!r:.200}; expected (multipliers by parameter, stiffness at these)")
    multipliers, matrix = check
    names = [key[0] for key in terms if key]
    unknown = [name for name, value in multipliers.items() if name not in names or not is_real(value)]
    if unknown:
        raise ValueError(f"check has the multipliers {dict(multipliers)!r:.200}; expected numbers for some of {names}")
    whole = _read(matrix, "the matrix of check", base.shape[0])
    changes = ((multipliers[name] - 1) * terms[name,] for name in multipliers)
    entries = (whole - reduce(add, changes, base)).tocoo()
    share = relative(entries, base.diagonal())
    if share.size and share.max() > SAME:
        row = int(entries.row[np.argmax(share)])
        involved = [name for name in multipliers if terms[name,].diagonal()[row] > 0]
        raise ValueError(
            f"at {dict(multipliers)} the stiffness differs from the sum of the terms, most in row {row}, by "
            f"{share.max():.2%} of the diagonal; expected a stiffness that is linear in "
            f"{involved or list(multipliers)}, each of which acts alone"
        )
