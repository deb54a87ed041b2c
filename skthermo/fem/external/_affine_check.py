"""Checks that a program's matrices are affine in its parameters, and names the parameter in which they are not."""

from collections.abc import Callable
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np
import scipy.sparse

from skthermo._tables.arrays import Array, MatrixLike
from skthermo.fem._theta import by_name, failures_named
from skthermo.fem.affine import read_terms

Terms = list[tuple[tuple[str, ...], scipy.sparse.csc_array]]

MATRICES = ("stiffness", "mass")
SAME = 1e-6


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


class Difference(NamedTuple):
    """The largest difference between a program's matrix and the affine one."""

    matrix: str
    share: float


def relative(entries: scipy.sparse.coo_array, diagonal: Array) -> Array:
    """|entry_ij| / sqrt(d_i d_j)."""
    size, scale = np.abs(entries.data), np.sqrt(np.abs(diagonal[entries.row] * diagonal[entries.col]))
    return np.divide(size, scale, out=np.where(size > 0, np.inf, 0.0), where=scale > 0)


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


def _difference(program: Program, terms: tuple[Terms, Terms], row: Array) -> Difference | None:
    theta = by_name(row, program.parameter_names)
    for what, matrix, pairs in zip(MATRICES, program(row), terms, strict=True):
        affine = reduce(add, (np.prod([theta[name] for name in key]) * term for key, term in pairs))
        entries = (matrix - affine).tocoo()
        share = relative(entries, matrix.diagonal())
        if share.size and share.max() > SAME:
            return Difference(what, float(share.max()))
    return None


def _refuse(names: str, found: Difference, where: str) -> None:
    raise ValueError(
        f"the program is not affine in {names}: its {found.matrix} differs by {found.share:.2%} of the diagonal from "
        f"K_0 + sum of theta_j K_j at {where}; expected each parameter to act alone and to the first power (let one "
        "stand for the power or product), or CallableModel for what is not affine"
    )
