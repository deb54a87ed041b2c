"""Rows of theta, and matrices that are affine in products of its parameters: how they are read, and summed."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import copy
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
import scipy.sparse
from numpy.typing import NDArray

from skthermo._core.arrays import Array, Matrix, as_dense, check_names, is_real, mapping_of, real_array
from skthermo.exceptions import ModelWarning, SkthermoWarning
from skthermo.fem._factors import elimination
from skthermo.fem.damage import LossKind, damage_directions

if TYPE_CHECKING:
    import pandas as pd

Key = tuple[str, ...]
Content = tuple[Hashable, tuple[str, ...]]

ROWS_PER_CHUNK = 256  # largest number of samples solved together


class PartsOfMass(NamedTuple):
    """Masses of damage groups, parts of a model's mass; groups with common members share some.

    ``terms`` are the parts in kg with the parameters that multiply them, ``groups`` gives the positions of the parts of
    each group, and ``contents`` the members of a structure, and their properties, whose masses each part sums.
    """

    terms: Sequence[tuple[Key, Matrix]]
    groups: dict[str, tuple[int, ...]]
    contents: Sequence[Sequence[Content]] = ()


def failures(theta: Array, frequencies: Array) -> list[SkthermoWarning]:
    """The finding that some rows of known theta have no solution."""
    failed = np.isnan(frequencies).any(axis=1) & ~np.isnan(theta).any(axis=1)
    if not failed.any():
        return []
    text = (
        "some rows of theta have no solution, and their frequencies are NaN: the stiffness there is not positive "
        "definite, or the solver failed. Narrow the bounds, or correct the model there"
    )
    return [ModelWarning(text, "no-solution")]


class ImmutableModel:
    """A model that never changes, of which clones are the same and a twin may be silent."""

    _is_quiet = False

    def quiet(self) -> Self:
        """The same model without warnings and without errors of a function, in place of which it gives NaN.

        Returns
        -------
        FE model
            For searches that may pass through theta without a solution.
        """
        return self._twin(_is_quiet=True)

    def findings(self, theta: Array, frequencies: Array) -> list[SkthermoWarning]:
        """Warnings about a whole table of theta and its solution, for the caller to give.

        Parameters
        ----------
        theta, frequencies : ndarray of shape (n_samples, n_parameters) and (n_samples, n_modes)
            The table, and its solution in Hz.

        Returns
        -------
        list of SkthermoWarning
            Empty for a model that is `quiet`.
        """
        return [] if self._is_quiet else failures(theta, frequencies)

    def damage_directions(self, groups: Sequence[str] | None = None, *, kind: LossKind | None = None) -> pd.DataFrame:
        """Relative change of each frequency per loss of each damage group, for small losses.

        Parameters
        ----------
        groups : sequence of str, optional
            Damage groups. By default all but those that other groups make up.
        kind : {"stiffness", "section"}, optional
            What is lost, as in `damaged`. By default stiffness and, of the groups whose mass is known, section.

        Returns
        -------
        DataFrame of shape (n_directions, n_modes)
            Derivatives of ln f by the severity, at the model's nominal state, by central differences where it gives no
            exact ones: in a row named as the group for its stiffness, in a row "GROUP, section" for its section. Losses
            that move no frequency are left out.

        Raises
        ------
        ValueError
            If a group is unknown, none moves a frequency, or the mass of a group is not known.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> make_truss().damage_directions(["bottom", "top"]).round(3)
                             0      1      2      3      4      5
        bottom          -0.233 -0.225 -0.159 -0.070 -0.022 -0.031
        top             -0.212 -0.127 -0.098 -0.053 -0.140 -0.029
        bottom, section -0.129 -0.119 -0.060  0.022 -0.004  0.059
        top, section    -0.108 -0.019  0.008  0.042 -0.116  0.065
        """
        return damage_directions(self, groups, kind)

    def __sklearn_clone__(self) -> Self:
        return self

    def _twin(self, **changes: Any) -> Self:
        """A model like this one, with some attributes changed."""
        twin = copy(self)
        vars(twin).update(changes)
        return twin


def by_name(row: Array, parameter_names: Sequence[str]) -> dict[str, float]:
    """Multipliers by parameter name, for messages."""
    return dict(zip(parameter_names, row.tolist(), strict=True))


@contextmanager
def failures_named(rows: Array, parameter_names: Sequence[str]) -> Iterator[None]:
    """Re-raise a user function's error with its theta."""
    try:
        yield
    except Exception as error:
        many = f"{len(rows)} rows from " if rows.ndim == 2 else ""
        theta = by_name(np.atleast_2d(rows)[0], parameter_names)
        raise RuntimeError(
            f"the model's function failed at {many}theta = {theta}: {type(error).__name__}: {error}"
        ) from error


def check_different(
    names: Sequence[str] | str, what: str = "parameter_names", known: Iterable[str] | None = None
) -> tuple[str, ...]:
    """One or more different names, all of them known; a text is one."""
    found = tuple(check_names([names] if isinstance(names, str) else names, what, known))
    if not found:
        raise ValueError(f"{what} is {names!r}; expected one or more different names")
    return found


def check_severities(damage: Mapping[str, float], groups) -> Mapping[str, float]:
    """Check that groups are known, and severities leave some stiffness and are no percentages."""
    damage = mapping_of(damage, "damage", "a mapping of group to severity")
    for group, severity in damage.items():
        if group not in groups:
            raise ValueError(f"unknown damage group {group!r}; expected one of {sorted(groups)}")
        if not (is_real(severity) and -10 <= float(severity) < 1):
            raise ValueError(
                f"damage of group {group!r} has severity {severity!r}; expected a number below 1, and not below -10 "
                "(0.5 halves the stiffness, -0.15 adds 15 %)"
            )
    return damage


def read_terms(terms, what: str, n_dof: int | None = None) -> tuple[list[Key], list[Matrix]]:
    """Keys and matrices: symmetric copies, dense or sparse as given."""
    if isinstance(terms, Mapping):
        pairs = list(terms.items())
    elif isinstance(terms, Sequence) and all(
        isinstance(term, tuple) and len(term) == 2 and isinstance(term[0], tuple | str) for term in terms
    ):
        pairs = list(terms)
    else:
        pairs = [((), terms)]
    if not pairs:
        raise ValueError(f"{what} has no terms; expected at least one matrix")
    keys, matrices = [], []
    for key, matrix in pairs:
        names = (key,) if isinstance(key, str) else key
        if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
            raise ValueError(f"{what} has the key {key!r}; expected a tuple of parameter names")
        keys.append(names)
        matrices.append(read_matrix(matrix, f"{what} term {names}", n_dof))
        n_dof = matrices[0].shape[0]
    return keys, matrices


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


class AffineTerms(ABC):
    """The sum over t of ``factor_t * prod_p(theta_p ** exponent_tp) * matrix_t``.

    ``exponents`` (n_terms, n_parameters) say how often each parameter multiplies each term, and ``factors`` (n_terms,)
    are fixed multipliers, such as 1 - severity of damage.
    """

    n_dof: int
    n_entries: int  # stored entries of one summed matrix
    is_dense: bool
    max_rows: int  # largest number of rows of theta whose matrices are held together

    def __init__(self, exponents: NDArray[np.int64], factors: Array | None = None):
        self.exponents = exponents
        self.factors = np.ones(len(exponents)) if factors is None else factors
        self.exponents.flags.writeable = self.factors.flags.writeable = False
        self.is_constant = not exponents.any()
        self._used = list(zip(*np.nonzero(exponents), exponents[exponents != 0], strict=True))

    def coefficients(self, theta: Array) -> Array:
        """The factor of each matrix, (n_samples, n_terms): its own times the product of its parameters."""
        products = np.ones((len(theta), len(self.exponents)))
        for term, parameter, exponent in self._used:
            products[:, term] *= theta[:, parameter] ** exponent
        return self.factors * products

    def coefficient_gradients(self, theta: Array) -> Array:
        """Derivative of ``coefficients``, (n_samples, n_terms, n_parameters)."""
        return self.coefficients(theta)[:, :, np.newaxis] * self.exponents / theta[:, np.newaxis]

    @classmethod
    @abstractmethod
    def from_matrices(cls, matrices: Sequence[Matrix], exponents: NDArray[np.int64]) -> AffineTerms:
        """Terms with a factor of one."""

    @abstractmethod
    def assemble(self, theta: Array) -> Array | list[scipy.sparse.csc_array]:
        """The summed matrix of every row of theta."""

    @abstractmethod
    def derivatives(self, theta: Array, vectors: Array) -> Array:
        """(dA / d theta_p) times the vectors of every row of theta, (n_samples, n, n_vectors, n_parameters)."""

    def each(self, theta: Array) -> Iterator[Matrix]:
        """The summed matrices, one by one; a constant matrix is summed once."""
        for i, row in enumerate(theta[:, np.newaxis]):
            if i == 0 or not self.is_constant:
                matrix = self.assemble(row)[0]
            yield matrix

    def product(self, theta: Array, vectors: Array) -> Array:
        """The summed matrix of every row times its vectors, (n_samples, n, n_vectors)."""
        return np.stack([matrix @ columns for matrix, columns in zip(self.each(theta), vectors, strict=True)])

    @abstractmethod
    def quadratic_forms(self, shapes: Array) -> Array:
        """phi' A_t phi of every shape and term, (n_samples, n_modes, n_terms)."""

    def with_factors(self, factors: Array, exponents: NDArray[np.int64] | None = None) -> Self:
        """The same matrices with these fixed multipliers, and other parameters if there are new exponents."""
        twin = copy(self)
        AffineTerms.__init__(twin, self.exponents if exponents is None else exponents, factors)
        return twin

    @property
    @abstractmethod
    def each_matrix(self) -> list[Matrix]:
        """The matrices of the terms."""

    def with_terms(
        self, matrices: Sequence[Matrix], exponents: NDArray[np.int64], factors: Array | None = None
    ) -> AffineTerms:
        """These terms and further ones; a row of zeros among the exponents makes a constant one."""
        terms = type(self).from_matrices([*self.each_matrix, *matrices], np.vstack([self.exponents, exponents]))
        return terms.with_factors(np.append(self.factors, np.ones(len(matrices)) if factors is None else factors))

    def divided(self, parts: Sequence[tuple[int, Matrix]]) -> AffineTerms:
        """These terms and parts of them, each with its term's position, as further terms."""
        matrices = self.each_matrix
        for position, part in parts:
            matrices[position] = matrices[position] - part
        origin = [*range(len(matrices)), *(position for position, _ in parts)]
        terms = self.from_matrices([*matrices, *(part for _, part in parts)], self.exponents[origin])
        return terms.with_factors(self.factors[origin])

    @abstractmethod
    def projected(self, basis: Array) -> DenseTerms:
        """Terms basis' A_t basis with the same coefficients."""


class DenseTerms(AffineTerms):
    """Terms for batches: ``matrices`` is (n_terms, n, n)."""

    is_dense, max_rows = True, ROWS_PER_CHUNK

    def __init__(self, matrices: Array, exponents: NDArray[np.int64], factors: Array | None = None):
        super().__init__(exponents, factors)
        self.matrices = matrices
        self.matrices.flags.writeable = False
        self.n_dof, self.n_entries = matrices.shape[1], matrices.shape[1] ** 2

    @classmethod
    def from_matrices(cls, matrices: Sequence[Matrix], exponents: NDArray[np.int64]) -> DenseTerms:
        return cls(np.ascontiguousarray(np.stack([as_dense(matrix) for matrix in matrices])), exponents)

    def assemble(self, theta: Array) -> Array:
        flat = self.matrices.reshape(len(self.matrices), -1)
        return (self.coefficients(theta) @ flat).reshape(-1, self.n_dof, self.n_dof)

    def derivatives(self, theta: Array, vectors: Array) -> Array:
        products = np.stack([matrix @ vectors for matrix in self.matrices], axis=3)
        return products @ self.coefficient_gradients(theta)[:, np.newaxis]

    def quadratic_forms(self, shapes: Array) -> Array:
        forms = np.empty((len(shapes), shapes.shape[2], len(self.matrices)))
        for term, matrix in enumerate(self.matrices):
            forms[:, :, term] = np.einsum("sim,sim->sm", shapes, matrix @ shapes)
        return forms

    @property
    def each_matrix(self) -> list[Matrix]:
        return list(self.matrices)

    def projected(self, basis: Array) -> DenseTerms:
        return DenseTerms(basis.T @ self.matrices @ basis, self.exponents, self.factors)


class SparseTerms(AffineTerms):
    """Terms on the union of their sparsity patterns: ``entries`` is (n_union, n_terms), one column for each matrix.

    The union is stored as compressed sparse columns, so that a sum of terms is one product
    with ``entries`` and has the same pattern whatever theta is.
    """

    is_dense, max_rows = False, 16  # sparse samples are solved one by one; a few of them are enough work for one task

    def __init__(
        self,
        entries: scipy.sparse.csc_array,
        rows: NDArray[np.int32],
        pointers: NDArray[np.int32],
        exponents: NDArray[np.int64],
    ):
        super().__init__(exponents)
        self.entries, self.rows, self.pointers = entries, rows, pointers
        self.n_dof, self.n_entries = len(pointers) - 1, len(rows)
        self.factorise = elimination(rows, pointers)
        for array in (entries.data, entries.indices, entries.indptr, rows, pointers):
            array.flags.writeable = False

    @property
    def columns(self) -> NDArray[np.int32]:
        """Column of each entry of the union."""
        return np.repeat(np.arange(self.n_dof, dtype=np.int32), np.diff(self.pointers))

    def matrix(self, data: Array) -> scipy.sparse.csc_array:
        """The matrix of these values in the places of the union."""
        return scipy.sparse.csc_array((data, self.rows, self.pointers), shape=(self.n_dof, self.n_dof))

    @classmethod
    def from_matrices(cls, matrices: Sequence[Matrix], exponents: NDArray[np.int64]) -> SparseTerms:
        n_dof = matrices[0].shape[0]
        parts = [scipy.sparse.coo_array(matrix) for matrix in matrices]
        places = np.concatenate([part.col.astype(np.int64) * n_dof + part.row for part in parts])
        union, position = np.unique(places, return_inverse=True)
        term = np.repeat(np.arange(len(parts)), [part.nnz for part in parts])
        values = np.concatenate([part.data for part in parts])
        entries = scipy.sparse.csc_array((values, (position, term)), shape=(len(union), len(parts)))
        pointers = np.searchsorted(union, np.arange(n_dof + 1) * n_dof)
        return cls(entries, (union % n_dof).astype(np.int32), pointers.astype(np.int32), exponents)

    def assemble(self, theta: Array) -> list[scipy.sparse.csc_array]:
        sums = self.entries @ self.coefficients(theta).T
        return [self.matrix(data) for data in sums.T.copy()]

    def derivatives(self, theta: Array, vectors: Array) -> Array:
        slopes = np.empty((*vectors.shape, theta.shape[1]))
        for row, gradient in enumerate(self.coefficient_gradients(theta)):
            for parameter, weights in enumerate(gradient.T):
                used = np.flatnonzero(weights)
                matrix = self.matrix(self.entries[:, used] @ weights[used])
                slopes[row, :, :, parameter] = matrix @ vectors[row]
        return slopes

    def quadratic_forms(self, shapes: Array) -> Array:
        columns = self.columns
        forms = [self.entries.T @ (shape[self.rows] * shape[columns]) for shape in shapes]
        return np.array(forms).reshape(len(shapes), -1, shapes.shape[2]).swapaxes(1, 2)

    @property
    def each_matrix(self) -> list[scipy.sparse.csc_array]:
        ends = self.entries.indptr[1:-1]
        parts = zip(np.split(self.entries.data, ends), np.split(self.entries.indices, ends), strict=True)
        columns = self.columns
        places = ((data, (self.rows[union], columns[union])) for data, union in parts)
        return [scipy.sparse.csc_array(place, shape=(self.n_dof, self.n_dof)) for place in places]

    def projected(self, basis: Array) -> DenseTerms:
        matrices = np.empty((len(self.exponents), basis.shape[1], basis.shape[1]))
        for projected, matrix in zip(matrices, self.each_matrix, strict=True):
            used = np.flatnonzero(np.diff(matrix.indptr))  # the degrees of freedom that it joins
            projected[:] = basis[used].T @ (matrix[:, used] @ basis[used])[used]
        return DenseTerms(matrices, self.exponents, self.factors)
