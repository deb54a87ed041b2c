"""Affine models recovered from programs that assemble matrices, and the check that they are affine."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from numbers import Integral
from operator import add

import numpy as np
import scipy.sparse

from skthermo._tables.arrays import Array, MatrixLike, RandomState, as_random_state
from skthermo.fem._terms import by_name, failures_named
from skthermo.fem.affine import AffineModel, check_different, read_terms
from skthermo.fem.external._differences import SAME, relative, split

Terms = list[tuple[tuple[str, ...], scipy.sparse.csc_array]]

MATRICES = ("stiffness", "mass")


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
        for matrix, what in zip(result, MATRICES, strict=True):
            try:
                _, (read,) = read_terms(matrix, what, self.n_dof)
            except ValueError as error:
                raise ValueError(f"{error}, {where}") from error
            self.n_dof = read.shape[0]
            matrices.append(scipy.sparse.csc_array(read))
        return matrices


def check_affine(program: Program, terms: tuple[Terms, Terms], row: Array) -> None:
    """Raise an error if the matrices of a program at a row of multipliers are not the sum of its terms."""
    if _difference(program, terms, row) is None:
        return
    names = program.parameter_names
    ones, columns = np.ones(len(row)), np.arange(len(row))
    for j, name in enumerate(names):
        if _difference(program, terms, np.where(columns <= j, row, ones)) is None:
            continue
        if found := _difference(program, terms, np.where(columns == j, row, ones)):
            _refuse(repr(name), found, f"{name} = {row[j]:.3g}")
        for i in range(j):
            if found := _difference(program, terms, np.where(np.isin(columns, (i, j)), row, ones)):
                both = f"{names[i]!r} and {name!r} together"
                _refuse(both, found, f"{names[i]} = {row[i]:.3g}, {name} = {row[j]:.3g}: it may hold their product")
        raise ValueError(f"the program is not affine: {name!r} acts together with two or more of {list(names[:j])}")


def _difference(program: Program, terms: tuple[Terms, Terms], row: Array) -> tuple[str, float] | None:
    """Which matrix of a program differs from the affine one, and by which share of the diagonal."""
    theta = by_name(row, program.parameter_names)
    for what, matrix, pairs in zip(MATRICES, program(row), terms, strict=True):
        affine = reduce(add, (np.prod([theta[name] for name in key]) * term for key, term in pairs))
        entries = (matrix - affine).tocoo()
        share = relative(entries, matrix.diagonal())
        if share.size and share.max() > SAME:
            return what, float(share.max())
    return None


def _refuse(names: str, found: tuple[str, float], where: str) -> None:
    matrix, share = found
    raise ValueError(
        f"the program is not affine in {names}: its {matrix} differs by {share:.2%} of the diagonal from "
        f"K_0 + sum of theta_j K_j at {where}; expected each parameter to act alone and to the first power (let one "
        "stand for the power or product), or CallableModel for what is not affine"
    )


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
    doubled = [program(row) for row in 1 + np.eye(len(names))]
    factors = dict.fromkeys(names, 2.0)
    stiffness, mass = (
        list(
            split(base[i], {name: matrices[i] for name, matrices in zip(names, doubled, strict=True)}, factors).items()
        )
        for i in range(2)
    )
    for name in names:
        if (name,) not in [key for key, _ in stiffness + mass]:
            raise ValueError(
                f"parameter {name!r} changes neither stiffness nor mass when doubled; expected one of them"
            )
    for row in as_random_state(random_state).uniform(0.5, 1.5, (n_checks, len(names))):
        check_affine(program, (stiffness, mass), row)
    return AffineModel(stiffness, mass, n_modes=n_modes, parameter_names=names, track=track)
