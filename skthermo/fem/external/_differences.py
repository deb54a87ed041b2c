"""Terms from whole matrices with one parameter multiplied, which a program exports or returns."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import reduce
from numbers import Integral
from operator import add

import numpy as np
import scipy.sparse

from skthermo._core.arrays import Array, MatrixLike, RandomState, as_random_state, is_real
from skthermo._core.warnings import warn_each
from skthermo.exceptions import ModelWarning, SkthermoWarning
from skthermo.fem._factors import factorise
from skthermo.fem._terms import Key, by_name, check_different, failures_named, read_matrix, read_terms
from skthermo.fem.affine import AffineModel

ParameterTerms = dict[Key, scipy.sparse.csc_array]
TermPairs = list[tuple[Key, scipy.sparse.csc_array]]

SAME_ENTRIES = 1e-6  # largest difference, relative to the diagonal, of entries that count as the same


def relative(entries: scipy.sparse.coo_array, diagonal: Array) -> Array:
    """|entry_ij| / sqrt(d_i d_j)."""
    size, scale = np.abs(entries.data), np.sqrt(np.abs(diagonal[entries.row] * diagonal[entries.col]))
    return np.divide(size, scale, out=np.where(size > 0, np.inf, 0.0), where=scale > 0)


def split(
    base: scipy.sparse.csc_array, changed: Mapping[str, scipy.sparse.csc_array], factors: Mapping[str, float]
) -> ParameterTerms:
    """The term of each parameter that changes the matrix when it is multiplied, and the constant part that remains."""
    diagonal, rounding = base.diagonal(), 16 * np.finfo(float).eps * (len(changed) + 1)
    terms: ParameterTerms = {
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

    The term of parameter j is K_j = (K(theta_j = factor) - K(1)) / (factor - 1), and the rest of K(1) is constant.

    Parameters
    ----------
    nominal : array-like or sparse matrix of shape (n_dof, n_dof)
        Stiffness of the structure as built.
    changed : mapping of str to array-like or sparse matrix of shape (n_dof, n_dof)
        Parameter -> stiffness of the whole structure with that parameter, such as the modulus of a group of members,
        multiplied by ``factor``.
    factor : float or mapping of str to float, default=2.0
        Factor of the parameters: one number for all, or one for each.
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
    Stiffness that is linear in moduli is a sum of parts without negative eigenvalues. A term or rest that has one,
    below -1e-6 relative to the diagonal of the nominal stiffness, is an error. Matrices therefore need seven digits or
    more: Nastran's DMIG in large field has them, in small field it has not.

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
    terms, doubts = read_differences(nominal, changed, factor, check)
    warn_each(doubtful_matrices(doubts))
    return terms


def doubtful_matrices(doubts: Sequence[str]) -> list[SkthermoWarning]:
    """One warning for all doubts about matrices."""
    return [ModelWarning(". ".join(doubts), "doubtful-factor")] if doubts else []


def read_differences(
    nominal: MatrixLike,
    changed: Mapping[str, MatrixLike],
    factor: float | Mapping[str, float],
    check: tuple[Mapping[str, float], MatrixLike] | None = None,
) -> tuple[ParameterTerms, list[str]]:
    """The terms of `difference_terms`, and doubts about the factors."""
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
    if () in terms:
        _check_rest(base, terms, factors)
    if check is not None:
        _check_sum(base, terms, check)
    return terms, _doubtful_factors(terms, factors)


def _read_factors(factor: float | Mapping[str, float], names: Sequence[str]) -> dict[str, float]:
    factors = factor if isinstance(factor, Mapping) else dict.fromkeys(names, factor)
    if set(factors) != set(names):
        raise ValueError(f"factor names {list(factors)}; expected {list(names)}, as changed does")
    for name, value in factors.items():
        if not is_real(value) or not np.isfinite(value) or value <= 0 or abs(value - 1) < SAME_ENTRIES:
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
    return factorise(scipy.sparse.csc_array(scaled + SAME_ENTRIES * scipy.sparse.eye_array(len(rows)))) is not None


def _check_rest(base: scipy.sparse.csc_array, terms: ParameterTerms, factors: Mapping[str, float]) -> None:
    """Refuse terms that are together more than the whole."""
    rest, parts = terms[()], {key[0]: term for key, term in terms.items() if key}
    if _is_nonnegative(rest, base):
        return
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


def _doubtful_factors(terms: ParameterTerms, factors: Mapping[str, float]) -> list[str]:
    """Sentences about terms that seem to be less than their part of the whole."""
    doubts: list[str] = []
    rest, parts = terms.get(()), {key[0]: term for key, term in terms.items() if key}
    if rest is None:
        return doubts
    for name, part in parts.items():
        others = [abs(other) for key, other in terms.items() if key and key != (name,)]
        shared = reduce(add, others).sum(axis=0) if others else np.zeros(part.shape[0])
        rows = np.flatnonzero((abs(part).sum(axis=0) > 0) & (shared == 0))
        alone, beside = part[rows], rest[rows]
        ratio = float((alone * beside).sum() / max((alone * alone).sum(), np.finfo(float).tiny))
        if (
            alone.nnz > len(rows)
            and ratio > SAME_ENTRIES
            and abs(beside - ratio * alone).max() < SAME_ENTRIES * abs(beside).max()
        ):
            doubts.append(
                f"where parameter {name!r} is the only one, the constant rest of the stiffness is {ratio:.4g} times "
                "its term. The term is too small if its factor is not the one that was used. Give the factor "
                f"{1 + (factors[name] - 1) / (1 + ratio):.4g} in place of {factors[name]:g}, unless that rest is meant"
            )
    return doubts


def _check_sum(
    base: scipy.sparse.csc_array, terms: ParameterTerms, check: tuple[Mapping[str, float], MatrixLike]
) -> None:
    """Refuse terms that do not give the stiffness at other multipliers."""
    if not isinstance(check, tuple | list) or len(check) != 2 or not isinstance(check[0], Mapping):
        raise ValueError(f"check is {check!r:.200}; expected (multipliers by parameter, stiffness at these)")
    multipliers, matrix = check
    names = [key[0] for key in terms if key]
    unknown = [name for name, value in multipliers.items() if name not in names or not is_real(value)]
    if unknown:
        raise ValueError(f"check has the multipliers {dict(multipliers)!r:.200}; expected numbers for some of {names}")
    whole = _read(matrix, "the matrix of check", base.shape[0])
    share, row = largest_difference(whole, terms.items(), dict.fromkeys(names, 1.0) | {**multipliers})
    if share > SAME_ENTRIES:
        involved = [name for name in multipliers if terms[name,].diagonal()[row] > 0]
        raise ValueError(
            f"at {dict(multipliers)} the stiffness differs from the sum of the terms, most in row {row}, by "
            f"{share:.2%} of the diagonal; expected a stiffness that is linear in "
            f"{involved or list(multipliers)}, each of which acts alone"
        )


def largest_difference(
    matrix: scipy.sparse.csc_array, pairs: Iterable[tuple[Key, scipy.sparse.csc_array]], theta: Mapping[str, float]
) -> tuple[float, int]:
    """Largest difference of a matrix from the sum of terms at multipliers, relative to the diagonal, and its row."""
    affine = reduce(add, (np.prod([theta[name] for name in key]) * term for key, term in pairs))
    entries = (matrix - affine).tocoo()
    share = relative(entries, matrix.diagonal())
    return (float(share.max()), int(entries.row[share.argmax()])) if share.size else (0.0, 0)


class Program:
    """A user's function that returns stiffness and mass; its results are checked, and errors name theta."""

    def __init__(self, function: Callable[[Array], tuple[MatrixLike, MatrixLike]], parameter_names: tuple[str, ...]):
        self.function = function
        self.parameter_names = parameter_names
        self.n_dof: int | None = None

    def __call__(self, row: Array) -> list[scipy.sparse.csc_array]:
        with failures_named(row, self.parameter_names):
            result = self.function(row.copy())
        where = f"at theta = {by_name(row, self.parameter_names)}"
        if not isinstance(result, tuple | list) or len(result) != 2:
            raise ValueError(f"the program returned a {type(result).__name__} {where}; expected (stiffness, mass)")
        matrices = []
        for matrix, what in zip(result, ("stiffness", "mass"), strict=True):
            try:
                _, (read,) = read_terms(matrix, what, self.n_dof)
            except ValueError as error:
                raise ValueError(f"{error}, {where}") from error
            self.n_dof = read.shape[0]
            matrices.append(scipy.sparse.csc_array(read))
        return matrices


def check_affine(program: Program, terms: Sequence[TermPairs], row: Array) -> None:
    """Raise an error if the matrices of a program at a row of multipliers are not the sum of its terms."""
    names, columns = program.parameter_names, range(len(row))

    def difference(moved: Sequence[int]) -> tuple[str, float] | None:
        """Which matrix differs where only some parameters have multipliers, and by which share of the diagonal."""
        theta = np.where(np.isin(columns, moved), row, 1.0)
        for what, matrix, pairs in zip(("stiffness", "mass"), program(theta), terms, strict=True):
            share, _ = largest_difference(matrix, pairs, by_name(theta, names))
            if share > SAME_ENTRIES:
                return what, share
        return None

    if difference(columns) is None:
        return
    last = next(j for j in columns if difference(columns[: j + 1]))
    for moved in ([last], *([i, last] for i in columns[:last])):
        if found := difference(moved):
            together, product = (" together", ": it may hold their product") if len(moved) > 1 else ("", "")
            raise ValueError(
                f"the program is not affine in {' and '.join(repr(names[j]) for j in moved)}{together}: its {found[0]} "
                f"differs by {found[1]:.2%} of the diagonal from K_0 + sum of theta_j K_j at "
                f"{', '.join(f'{names[j]} = {row[j]:.3g}' for j in moved)}{product}; expected each parameter to act "
                "alone and to the first power (let one stand for the power or product), or CallableModel for what is "
                "not affine"
            )
    raise ValueError(f"the program is not affine: {names[last]!r} acts together with two or more of {[*names[:last]]}")


def probe(
    assemble: Callable[[Array], tuple[MatrixLike, MatrixLike]],
    parameter_names: Sequence[str],
    *,
    n_modes: int | None = None,
    track: bool = False,
    n_checks: int = 3,
    random_state: RandomState = None,
) -> AffineModel:
    """An affine model from a program that returns stiffness and mass for given parameters.

    The terms of K(theta) = K_0 + sum of theta_j K_j, and of M likewise, are recovered from one call at theta = 1 and
    one call for each parameter, with that parameter doubled. After that the program is no longer needed.

    Parameters
    ----------
    assemble : callable
        Takes one row of multipliers, an array of shape (n_parameters,), and returns stiffness and mass,
        each dense or SciPy sparse of shape (n_dof, n_dof).
    parameter_names : sequence of str
        Columns of theta.
    n_modes : int, optional
        How many of the lowest modes the model gives. By default six, or all if there are fewer.
    track : bool, default=False
        Whether a column follows its mode rather than its rank.
    n_checks : int, default=3
        Number of random points, each multiplier between 0.5 and 1.5, at which the program is called to verify that it
        is affine.
    random_state : int, RandomState or None, default=None
        Seed of these points.

    Returns
    -------
    AffineModel
        A term for each parameter that changes the stiffness, and one for each that changes the mass.

    Raises
    ------
    ValueError
        If the program is not affine; the error names the parameter, or the two whose product it may hold, and by how
        much a matrix differs (found with at most 2 n_parameters more calls). If a parameter changes neither matrix, or
        a matrix has another shape than at theta = 1.
    RuntimeError
        If the program fails; the error says at which theta.

    See Also
    --------
    CallableModel : For programs that are not affine, or return frequencies only.
    load_affine : For matrices in files.

    Notes
    -----
    Differences are relative to the diagonal, abs(A_ij - B_ij) / sqrt(A_ii A_jj): differences below about 1e-14 are
    rounding errors and left out, so that sparse matrices stay sparse; above 1e-6 a program counts as not affine.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.fem import probe
    >>> def tower(theta):
    ...     k1, k2, m = 400.0 * theta[0], 400.0 * theta[1], 1.0
    ...     return np.array([[k1 + k2, -k2], [-k2, k2]]), m * np.eye(2)
    >>> model = probe(tower, ["k_base", "k_top"], n_modes=2, random_state=0)
    >>> model.frequencies([[1.0, 1.0], [1.0, 0.5]]).round(3)
    array([[1.967, 5.15 ],
           [1.723, 4.159]])
    """
    if not isinstance(n_checks, Integral) or isinstance(n_checks, bool) or n_checks < 0:
        raise ValueError(f"n_checks is {n_checks!r}; expected zero or a positive integer")
    if not callable(assemble) or isinstance(assemble, type):
        raise ValueError(f"assemble is {assemble!r}; expected a callable that returns stiffness and mass")
    names = check_different(parameter_names)
    program = Program(assemble, names)
    base = program(np.ones(len(names)))
    doubled = {name: program(row) for name, row in zip(names, 1 + np.eye(len(names)), strict=True)}
    factors = dict.fromkeys(names, 2.0)
    stiffness, mass = (
        list(split(base[i], {name: doubled[name][i] for name in names}, factors).items()) for i in range(2)
    )
    for name in names:
        if (name,) not in [key for key, _ in stiffness + mass]:
            raise ValueError(
                f"parameter {name!r} changes neither stiffness nor mass when doubled; expected one of them"
            )
    for row in as_random_state(random_state).uniform(0.5, 1.5, (n_checks, len(names))):
        check_affine(program, (stiffness, mass), row)
    return AffineModel(stiffness, mass, n_modes=n_modes, parameter_names=names, track=track)
