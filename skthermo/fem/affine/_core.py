"""Core of AffineModel and ReducedModel: terms, eigensolver, tracking, derivatives."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import Array, Matrix
from skthermo.fem._terms import AffineTerms, DenseTerms, SparseTerms, nominal_theta
from skthermo.fem.modal import (
    CondensationSolver,
    EigenSolver,
    LocalModes,
    ShiftInvertSolver,
    batch_solver,
    count_modes,
    dense_solver,
    hertz,
    may_be_missed,
    may_differ,
    pair_modes,
    repeated_modes,
    shape_derivatives,
)

GUARD_MODES = 4
"""Largest number of modes above the tracked ones that are examined first: modes that swap move up by a few ranks
only."""

MAX_CANDIDATES_PER_MODE = 8  # how many times as many candidates as modes are examined before a mode counts as dissolved
CHUNK_BYTES = 2**25

WIDEST_SPECTRUM = 1e13
"""Largest ratio of highest to lowest eigenvalue, divided by ``tol``, for which the standard form is accurate
enough."""

ITERATION_SHARE = 0.02
"""Error of an eigenvalue by iteration, as a share of ``tol``. The error of its frequency is half of it."""

LEAST_TOL = 1e-12


@dataclass(frozen=True, eq=False)
class NominalModes:
    """The healthy nominal modes, which the columns of a tracking model follow."""

    weighted_shapes: Array  # M phi with the nominal mass M and shapes phi of unit modal mass, (n, n_modes)
    mass_coefficients: Array  # of each mass term in M
    repeated: NDArray[np.bool_]  # which modes share a repeated frequency, (n_modes, n_modes)

    def __post_init__(self) -> None:
        for array in (self.weighted_shapes, self.mass_coefficients, self.repeated):
            array.flags.writeable = False

    def beside(self, mass: AffineTerms) -> "NominalModes":
        """The same modes, where mass has been added to the structure as further terms."""
        added = np.zeros(len(mass.factors) - len(self.mass_coefficients))
        return replace(self, mass_coefficients=np.append(self.mass_coefficients, added))

    def mac(self, shapes: Array, mass: AffineTerms) -> Array:
        """Mass-weighted MAC with shapes (n_samples, n, n_candidates), (n_samples, n_modes, n_candidates)."""
        masses = mass.quadratic_forms(shapes) @ self.mass_coefficients
        return (self.weighted_shapes.T @ shapes) ** 2 / masses[:, np.newaxis]

    def mass_spread(self, theta: Array, mass: AffineTerms) -> Array:
        """Ratio of the largest to the smallest factor of the terms of the nominal mass, (n_samples,)."""
        kept = self.mass_coefficients != 0
        factors = mass.coefficients(theta)[:, kept] / self.mass_coefficients[kept]
        return factors.max(axis=1) / factors.min(axis=1)


@dataclass(frozen=True, eq=False)
class AffineCore:
    """Modal analysis of affine stiffness and mass, for checked rows of theta and without warnings."""

    stiffness: AffineTerms
    mass: AffineTerms
    solver: EigenSolver
    nominal: NominalModes
    ranks: NDArray[np.intp]
    track: bool
    available: int  # how many modes the mass allows and the solver finds
    guards: int = GUARD_MODES  # how many modes above the lowest are computed first where columns are followed
    healthy: "AffineCore | None" = None  # whose nominal modes define the columns, if it is another core

    @classmethod
    def from_terms(
        cls, stiffness: AffineTerms, mass: AffineTerms, *, ranks: Sequence[int], track: bool, available: int
    ) -> "AffineCore":
        """The core whose columns are the modes of these ranks (the lowest is 0) at theta = 1."""
        solver, order = eigen_solver(stiffness, mass), np.asarray(ranks, dtype=np.intp)
        nominal = nominal_modes(solver, mass, order)
        return cls(stiffness, mass, solver, nominal, order, track, available)

    @property
    def n_modes(self) -> int:
        return len(self.ranks)

    @property
    def n_lowest(self) -> int:
        """How many of the lowest modes contain all columns at theta = 1."""
        return int(self.ranks.max()) + 1

    @property
    def first_candidates(self) -> int:
        """How many of the lowest modes are examined at first, where columns are followed."""
        return min(self.n_lowest + GUARD_MODES, self.max_candidates)

    @property
    def n_solved(self) -> int:
        """How many of the lowest modes are computed at first."""
        return min(self.n_lowest + self.guards, self.max_candidates) if self.track else self.n_lowest

    @property
    def max_candidates(self) -> int:
        """Largest number of lowest modes that are examined before a mode counts as dissolved."""
        return min(self.available, MAX_CANDIDATES_PER_MODE * self.n_lowest)

    @property
    def rows_per_chunk(self) -> int:
        """How many rows are solved together, so that memory stays bounded."""
        numbers = max(self.stiffness.n_entries, 2 * self.stiffness.n_dof * self.n_lowest)
        return max(1, min(self.stiffness.max_rows, CHUNK_BYTES // (8 * numbers)))

    @property
    def is_dense(self) -> bool:
        """Whether matrices are solved in dense batches."""
        return isinstance(self.stiffness, DenseTerms)

    def with_scaled_stiffness(self, factors: Array) -> "AffineCore":
        """The core with its stiffness terms multiplied; its columns stay the same nominal modes."""
        stiffness, solver = self.stiffness.scaled(factors), self.solver.scaled(factors)
        return replace(self, stiffness=stiffness, solver=solver, healthy=self.healthy or self)

    def rescaled(self, row: Array) -> "AffineCore":
        """The core whose theta = 1 is this one's theta = row; its columns stay the same nominal modes."""
        stiffness = self.stiffness.scaled(self.stiffness.products(row)[0])
        mass = self.mass.scaled(self.mass.products(row)[0])
        solver = eigen_solver(stiffness, mass)
        return replace(self, stiffness=stiffness, mass=mass, solver=solver, healthy=self.healthy or self)

    def with_modes(self, ranks: NDArray[np.intp]) -> "AffineCore":
        """The core whose columns are other modes of the healthy nominal state."""
        healthy = self.healthy or self
        nominal = nominal_modes(healthy.solver, healthy.mass, ranks).beside(self.mass)
        return replace(self, nominal=nominal, ranks=ranks)

    def with_parameters(self, columns: NDArray[np.intp]) -> "AffineCore":
        """The core of fewer parameters, the others being 1."""
        healthy = self.healthy.with_parameters(columns) if self.healthy else None
        return self._with_exponents(self.stiffness.exponents[:, columns], self.mass.exponents[:, columns], healthy)

    def with_group_factors(self, scaled: NDArray[np.int64]) -> "AffineCore":
        """The core with further parameters that multiply groups of stiffness terms, (n_terms, n_groups)."""
        healthy = self.healthy.with_group_factors(scaled) if self.healthy else None
        further = scaled[: len(self.stiffness.factors)]  # the healthy core may lack terms that were added
        constant = np.zeros((len(self.mass.factors), scaled.shape[1]), dtype=scaled.dtype)
        stiffness = np.hstack([self.stiffness.exponents, further])
        return self._with_exponents(stiffness, np.hstack([self.mass.exponents, constant]), healthy)

    def with_mass_factors(self, masses: Sequence[Matrix]) -> "AffineCore":
        """The core with further parameters: 1 + the number of times that each of these masses is added."""
        wider = self.with_group_factors(np.zeros((len(self.stiffness.factors), len(masses)), dtype=np.int64))
        none = np.zeros((len(masses), self.mass.exponents.shape[1]), dtype=np.int64)
        once = np.hstack([none, np.eye(len(masses), dtype=np.int64)])
        heavy = wider.mass.with_terms(masses, once).with_terms([-mass for mass in masses], 0 * once)
        solver, nominal = eigen_solver(wider.stiffness, heavy), self.nominal.beside(heavy)
        return replace(wider, mass=heavy, solver=solver, nominal=nominal)

    def _with_exponents(self, stiffness: NDArray, mass: NDArray, healthy: "AffineCore | None") -> "AffineCore":
        terms = self.stiffness.with_exponents(stiffness), self.mass.with_exponents(mass)
        return replace(self, stiffness=terms[0], mass=terms[1], solver=eigen_solver(*terms), healthy=healthy)

    def with_added(self, stiffness: Matrix | None, mass: Matrix | None) -> "AffineCore":
        """The core with further constant stiffness and mass; its columns stay the same nominal modes."""
        constant = np.zeros_like(self.mass.exponents[:1])
        stiff = self.stiffness if stiffness is None else self.stiffness.with_terms([stiffness], constant)
        heavy = self.mass if mass is None else self.mass.with_terms([mass], constant)
        if mass is not None:
            total = heavy.assemble(nominal_theta(heavy.exponents.shape[1]))[0]
            count_modes(total, at_least=self.n_modes, what="mass, with what is added,")
        solver, nominal = eigen_solver(stiff, heavy), self.nominal.beside(heavy)
        return replace(self, stiffness=stiff, mass=heavy, solver=solver, nominal=nominal, healthy=self.healthy or self)

    def with_divided_stiffness(self, parts: Sequence[tuple[int, Matrix]]) -> "AffineCore":
        """The core with parts of its stiffness terms, each with its term's position, taken out as further terms."""
        matrices = self.stiffness.each_matrix
        for position, part in parts:
            matrices[position] = matrices[position] - part
        origin = [*range(len(matrices)), *(position for position, _ in parts)]
        terms = [*matrices, *(part for _, part in parts)]
        stiffness = self.stiffness.from_matrices(terms, self.stiffness.exponents[origin])
        stiffness = stiffness.scaled(self.stiffness.factors[origin])
        return replace(self, stiffness=stiffness, solver=eigen_solver(stiffness, self.mass))

    def projected(self, basis: Array, tol: float) -> "AffineCore":
        """The core on a basis (n_dof, n) of shapes, whose own relative errors are much smaller than ``tol``."""
        stiffness, mass = self.stiffness.projected(basis), self.mass.projected(basis)
        nominal = replace(self.nominal, weighted_shapes=basis.T @ self.nominal.weighted_shapes)
        at = nominal_theta(stiffness.exponents.shape[1])
        lapack = dense_solver(stiffness, mass, at, tol * WIDEST_SPECTRUM)
        solver = batch_solver(stiffness, mass, at, lapack, max(ITERATION_SHARE * tol, LEAST_TOL))
        available = min(self.max_candidates, basis.shape[1])
        projected = replace(self, stiffness=stiffness, mass=mass, solver=solver, nominal=nominal, available=available)
        return replace(projected, guards=projected.guards_below_a_gap())

    def guards_below_a_gap(self) -> int:
        """Number of guards up to the widest gap between nominal eigenvalues: few modes swap across it."""
        highest = min(self.n_lowest + GUARD_MODES + 1, self.available)
        at = nominal_theta(self.stiffness.exponents.shape[1])
        eigenvalues = self.solver.eigenvalues(at, highest)[0, self.n_lowest - 1 :]
        ratios = eigenvalues[1:] / eigenvalues[:-1]
        return int(ratios.argmax()) if len(ratios) and np.isfinite(ratios).all() else GUARD_MODES

    def certified(self, theta: Array) -> NDArray[np.bool_]:
        """Rows that are solved by iteration; the others are solved by LAPACK."""
        if isinstance(self.solver, CondensationSolver):
            return self.solver.certified(theta, self.n_solved)
        return np.zeros(len(theta), dtype=bool)

    def frequencies(self, theta: Array) -> tuple[Array]:
        """Frequencies in Hz, (n_samples, n_modes)."""
        if self.track:
            return (self.modes(theta)[0],)
        return (hertz(self.solver.eigenvalues(theta, self.n_lowest)[:, self.ranks]),)

    def modes(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies in Hz and shapes (n_samples, n, n_modes)."""
        if self.track:
            return self._tracked(theta, self.n_solved)
        eigenvalues, shapes = self.solver.modes(theta, self.n_lowest)
        return hertz(eigenvalues[:, self.ranks]), shapes[:, :, self.ranks]

    def linearised(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies in Hz and d f / d theta, (n_samples, n_modes, n_parameters)."""
        frequencies, shapes = self.modes(theta)
        return frequencies, self.frequency_slopes(theta, frequencies, shapes)

    def linearised_modes(
        self, theta: Array, dofs: NDArray[np.intp], basis: Array | None
    ) -> tuple[Array, Array, Array, Array]:
        """Frequencies in Hz, shapes at some degrees of freedom, and the derivatives of both."""
        if isinstance(self.stiffness, DenseTerms) and isinstance(self.mass, DenseTerms):
            frequencies, shapes = self.modes(theta)
            jacobian = self.frequency_slopes(theta, frequencies, shapes)
            slopes = shape_derivatives(self.stiffness, self.mass, theta, (2 * np.pi * frequencies) ** 2, shapes)
            if basis is None:
                return frequencies, jacobian, shapes[:, dofs], slopes[:, dofs]
            slopes = np.einsum("di,simp->sdmp", basis[dofs], slopes, optimize=True)
            return frequencies, jacobian, basis[dofs] @ shapes, slopes
        parts = []
        for row in theta[:, np.newaxis]:
            modes = self.local_modes(row, follow=self.track, basis=basis)
            columns = modes.ranks if self.track else self.ranks
            d_frequencies, d_shapes = modes.derivatives(columns, dofs)
            parts.append((modes.frequencies[columns], d_frequencies, modes.shapes(dofs)[:, columns], d_shapes))
        frequencies, jacobian, shapes, slopes = (np.stack(arrays) for arrays in zip(*parts, strict=True))
        return frequencies, jacobian, shapes, slopes

    def frequency_slopes(self, theta: Array, frequencies: Array, shapes: Array) -> Array:
        """d f / d theta of modes of unit modal mass, (n_samples, n_modes, n_parameters)."""
        gradient = self.stiffness.gradients(theta, shapes)
        if not self.mass.is_constant:
            eigenvalues = (2 * np.pi * frequencies) ** 2
            gradient -= eigenvalues[:, :, np.newaxis] * self.mass.gradients(theta, shapes)
        return gradient / (8 * np.pi**2 * frequencies[:, :, np.newaxis])

    def nominal_mac(self, shapes: Array) -> Array:
        """Mass-weighted MAC of the nominal modes with shapes, (n_samples, n_modes, n_candidates)."""
        return self.nominal.mac(shapes, self.mass)

    def may_be_missed(self, theta: Array, mac: Array, order: NDArray[np.intp]) -> NDArray[np.bool_]:
        """Rows in which a mode beyond the candidates could be closer to a nominal mode than the one assigned."""
        return may_be_missed(mac, order, self.nominal.repeated, self.nominal.mass_spread(theta, self.mass))

    def local_modes(self, row: Array, *, follow: bool, basis: Array | None = None) -> LocalModes:
        """The lowest modes at one row of theta; with ``follow``, enough of them to hold every nominal mode."""
        n_candidates = self.first_candidates
        while True:
            eigenvalues, shapes, solve = self.solver.local_modes(row, n_candidates)
            mac = self.nominal_mac(shapes[np.newaxis])
            ranks = pair_modes(mac, self.nominal.repeated)
            doubtful = follow and self.may_be_missed(row, mac, ranks)[0]
            if not doubtful or n_candidates == self.max_candidates:
                break
            n_candidates = min(2 * n_candidates, self.max_candidates)
        return LocalModes(
            eigenvalues,
            shapes,
            mac[0],
            ranks[0],
            stiffness=self.stiffness,
            mass=self.mass,
            theta=row,
            solve=solve,
            basis=basis,
        )

    def _tracked(self, theta: Array, n_candidates: int) -> tuple[Array, Array]:
        """Nominal modes found among the lowest candidates, or among more candidates where the match is uncertain."""
        eigenvalues, candidates = self.solver.modes(theta, n_candidates)
        mac = self.nominal_mac(candidates)
        order, spread = pair_modes(mac, self.nominal.repeated), self.nominal.mass_spread(theta, self.mass)
        frequencies = np.take_along_axis(hertz(eigenvalues), order, axis=1)
        shapes = np.take_along_axis(candidates, order[:, np.newaxis], axis=2)
        if n_candidates < self.first_candidates:
            doubtful, more = may_differ(mac, order, self.nominal.repeated, spread), self.first_candidates
        else:
            doubtful, more = may_be_missed(mac, order, self.nominal.repeated, spread), 2 * n_candidates
        if n_candidates < self.max_candidates and doubtful.any():
            more = min(more, self.max_candidates)
            frequencies[doubtful], shapes[doubtful] = self._tracked(theta[doubtful], more)
        return frequencies, shapes


def nominal_modes(solver: EigenSolver, mass: AffineTerms, ranks: NDArray[np.intp]) -> NominalModes:
    """The modes of some ranks at theta = 1."""
    nominal = nominal_theta(mass.exponents.shape[1])
    eigenvalues, shapes = solver.modes(nominal, int(ranks.max()) + 1)
    return NominalModes(
        weighted_shapes=mass.product(nominal, shapes[:, :, ranks])[0],
        mass_coefficients=mass.coefficients(nominal)[0],
        repeated=repeated_modes(eigenvalues[0])[np.ix_(ranks, ranks)],
    )


def eigen_solver(stiffness: AffineTerms, mass: AffineTerms) -> EigenSolver:
    """Batches for dense terms, shift-invert for sparse ones."""
    if isinstance(stiffness, DenseTerms) and isinstance(mass, DenseTerms):
        return dense_solver(stiffness, mass, nominal_theta(stiffness.exponents.shape[1]))
    if isinstance(stiffness, SparseTerms) and isinstance(mass, SparseTerms):
        return ShiftInvertSolver(stiffness, mass)
    raise TypeError("stiffness and mass must both be dense or both sparse")
