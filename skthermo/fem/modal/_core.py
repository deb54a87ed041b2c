"""Modal analysis of affine matrices: eigenproblems by LAPACK, columns that follow modes, and derivatives."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cache, partial
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import linear_sum_assignment

from skthermo._core.arrays import Array, Matrix
from skthermo.fem._terms import AffineTerms, DenseTerms, SparseTerms
from skthermo.fem.modal._modes import REPEATED, LocalModes, linearised_by_row
from skthermo.fem.modal._sparse import ShiftInvertSolver, count_modes

GUARD_MODES = 4  # examined first above those that are followed: modes that swap move up by a few ranks only


class NominalModes(NamedTuple):
    """The healthy nominal modes, which the columns of a tracking model follow."""

    weighted_shapes: Array  # M phi with the nominal mass M and shapes phi of unit modal mass, (n, n_modes)
    mass_coefficients: Array  # of each mass term in M
    repeated: NDArray[np.bool_]  # which modes share a repeated frequency, (n_modes, n_modes)

    @classmethod
    def of_ranks(cls, solver: "Solver", mass: AffineTerms, ranks: NDArray[np.intp]) -> "NominalModes":
        """The modes of some ranks at theta = 1."""
        nominal = np.ones((1, mass.exponents.shape[1]))
        eigenvalues, shapes = solver.modes(nominal, int(ranks.max()) + 1)
        return cls(
            weighted_shapes=mass.product(nominal, shapes[:, :, ranks])[0],
            mass_coefficients=mass.coefficients(nominal)[0],
            repeated=repeated_modes(eigenvalues[0])[np.ix_(ranks, ranks)],
        )

    def beside(self, mass: AffineTerms, share: float = 0.0) -> "NominalModes":
        """The same modes, where the mass has further terms, which have a share in the nominal mass."""
        added = np.full(len(mass.factors) - len(self.mass_coefficients), share)
        return self._replace(mass_coefficients=np.append(self.mass_coefficients, added))

    def mass_spread(self, theta: Array, mass: AffineTerms) -> Array:
        """Ratio of the largest to the smallest factor of the terms of the nominal mass, (n_samples,)."""
        kept = self.mass_coefficients != 0
        factors = mass.coefficients(theta)[:, kept] / self.mass_coefficients[kept]
        return factors.max(axis=1) / factors.min(axis=1)


@dataclass(eq=False)
class AffineCore:
    """Modal analysis of affine stiffness and mass, for checked rows of theta and without warnings. It never changes."""

    stiffness: AffineTerms
    mass: AffineTerms
    solver: "Solver"
    nominal: NominalModes
    ranks: NDArray[np.intp]
    track: bool
    available: int  # how many modes the mass allows and the solver finds
    healthy: "AffineCore | None" = None  # whose nominal modes define the columns, if it is another core
    parts: AffineTerms | None = None  # of the mass: those that damage groups lose with their section
    n_lowest: int = field(init=False)  # how many of the lowest modes contain all columns at theta = 1
    first_candidates: int = field(init=False)  # how many are examined at first, where columns are followed
    max_candidates: int = field(init=False)  # how many are examined before a mode counts as dissolved
    rows_per_chunk: int = field(init=False)  # rows of theta that are solved together, so that memory stays bounded

    @classmethod
    def from_terms(
        cls,
        stiffness: AffineTerms,
        mass: AffineTerms,
        *,
        ranks: Sequence[int],
        track: bool,
        available: int,
    ) -> "AffineCore":
        """The core whose columns are the modes of these ranks (the lowest is 0) at theta = 1."""
        solver, order = eigen_solver(stiffness, mass), np.asarray(ranks, dtype=np.intp)
        nominal = NominalModes.of_ranks(solver, mass, order)
        return cls(stiffness, mass, solver, nominal, order, track, available)

    def __post_init__(self) -> None:
        self.n_lowest = int(self.ranks.max()) + 1
        self.max_candidates = min(self.available, 8 * self.n_lowest)  # beyond them a mode counts as dissolved
        self.first_candidates = min(self.n_lowest + GUARD_MODES, self.max_candidates)
        numbers = max(self.stiffness.n_entries, 2 * self.stiffness.n_dof * self.n_lowest)
        self.rows_per_chunk = max(1, min(self.stiffness.max_rows, 2**25 // (8 * numbers)))

    def with_scaled_stiffness(self, factors: Array) -> "AffineCore":
        """The core with its stiffness terms multiplied; its columns stay the same nominal modes."""
        stiffness = self.stiffness.with_factors(self.stiffness.factors * factors)
        return self._with_terms(healthy=self.healthy or self, stiffness=stiffness)

    def with_scaled_parts(self, parts: AffineTerms) -> "AffineCore":
        """The core whose parts of the mass have these factors and exponents; its columns stay the same nominal modes.

        Each part that changes is added to the mass as it becomes, and taken away as it was.
        """
        old: Any = self.parts
        are_other = (parts.factors != old.factors) | (parts.exponents != old.exponents).any(axis=1)
        matrices = [matrix for matrix, is_other in zip(old.each_matrix, are_other, strict=True) if is_other]
        if not matrices:
            return self
        mass = self.mass.with_terms(
            [*matrices, *(-matrix for matrix in matrices)],
            np.vstack([parts.exponents[are_other], old.exponents[are_other]]),
            np.append(parts.factors[are_other], old.factors[are_other]),
        )
        nominal = self.nominal.beside(mass, share=1.0)
        return self._with_terms(mass=mass, parts=parts, nominal=nominal, healthy=self.healthy or self)

    def rescaled(self, row: Array) -> "AffineCore":
        """The core whose theta = 1 is this one's theta = row; its columns stay the same nominal modes."""
        changed = {name: one.with_factors(one.coefficients(row)[0]) for name, one in self._terms.items()}
        return self._with_terms(**changed, healthy=self.healthy or self)

    def with_modes(self, ranks: NDArray[np.intp]) -> "AffineCore":
        """The core whose columns are other modes of the healthy nominal state."""
        healthy = self.healthy or self
        nominal = NominalModes.of_ranks(healthy.solver, healthy.mass, ranks)
        nominal = nominal._replace(mass_coefficients=self.nominal.mass_coefficients)
        return replace(self, nominal=nominal, ranks=ranks)

    def with_parameters(self, columns: NDArray[np.intp]) -> "AffineCore":
        """The core of fewer parameters, the others being 1."""
        changed = {name: one.with_factors(one.factors, one.exponents[:, columns]) for name, one in self._terms.items()}
        return self._with_terms(**changed)

    def with_group_factors(self, scaled: NDArray[np.int64]) -> "AffineCore":
        """The core with further parameters that multiply groups of stiffness terms, (n_terms, n_groups)."""
        further = {name: np.zeros((len(one.factors), scaled.shape[1]), int) for name, one in self._terms.items()}
        further["stiffness"] = scaled
        changed = {
            name: one.with_factors(one.factors, np.hstack([one.exponents, further[name]]))
            for name, one in self._terms.items()
        }
        return self._with_terms(**changed)

    def with_mass_factors(self, masses: Sequence[Matrix]) -> "AffineCore":
        """The core with further parameters: 1 + the number of times that each of these masses is added."""
        wider = self.with_group_factors(np.zeros((len(self.stiffness.factors), len(masses)), dtype=np.int64))
        none = np.zeros((len(masses), self.mass.exponents.shape[1]), dtype=np.int64)
        once = np.hstack([none, np.eye(len(masses), dtype=np.int64)])
        heavy = wider.mass.with_terms(masses, once).with_terms([-mass for mass in masses], 0 * once)
        return wider._with_terms(mass=heavy, nominal=self.nominal.beside(heavy))

    def _with_terms(self, **changed: Any) -> "AffineCore":
        """The core with other terms, a solver of them, and other changes."""
        solver = eigen_solver(changed.get("stiffness", self.stiffness), changed.get("mass", self.mass))
        return replace(self, **changed, solver=solver)

    @property
    def _terms(self) -> dict[str, AffineTerms]:
        """Stiffness, mass and, where they are known, its parts."""
        terms = {"stiffness": self.stiffness, "mass": self.mass}
        return terms if self.parts is None else terms | {"parts": self.parts}

    def with_added(self, stiffness: Matrix | None, mass: Matrix | None) -> "AffineCore":
        """The core with further constant stiffness and mass; its columns stay the same nominal modes."""
        constant = np.zeros_like(self.mass.exponents[:1])
        stiff = self.stiffness if stiffness is None else self.stiffness.with_terms([stiffness], constant)
        heavy = self.mass if mass is None else self.mass.with_terms([mass], constant)
        if mass is not None:
            total = heavy.assemble(np.ones((1, heavy.exponents.shape[1])))[0]
            count_modes(total, at_least=len(self.ranks), what="mass, with what is added,")
        nominal = self.nominal.beside(heavy)
        return self._with_terms(stiffness=stiff, mass=heavy, nominal=nominal, healthy=self.healthy or self)

    def with_divided_terms(
        self, stiffness: Sequence[tuple[int, Matrix]], parts: Sequence[tuple[int, Matrix]]
    ) -> "AffineCore":
        """The core with some of its stiffness terms, and of the parts of its mass, divided."""
        smaller = self.parts if self.parts is None or not parts else self.parts.divided(parts)
        return self._with_terms(stiffness=self.stiffness.divided(stiffness), parts=smaller)

    def projected(self, basis: Array, tol: float) -> "AffineCore":
        """The core on a basis (n_dof, n) of shapes, whose own relative errors are much smaller than ``tol``."""
        stiffness, mass = self.stiffness.projected(basis), self.mass.projected(basis)
        nominal = self.nominal._replace(weighted_shapes=basis.T @ self.nominal.weighted_shapes)
        nominal_row = np.ones((1, stiffness.exponents.shape[1]))
        solver = dense_solver(stiffness, mass, nominal_row, widest=1e13 * tol)
        available = min(self.max_candidates, basis.shape[1])
        return replace(self, stiffness=stiffness, mass=mass, solver=solver, nominal=nominal, available=available)

    def frequencies(self, theta: Array) -> tuple[Array]:
        """Frequencies in Hz, (n_samples, n_modes)."""
        if self.track:
            return (self.modes(theta)[0],)
        return (np.sqrt(self.solver.eigenvalues(theta, self.n_lowest)[:, self.ranks]) / (2 * np.pi),)

    def modes(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies in Hz and shapes (n_samples, n, n_modes)."""
        if self.track:
            return self._tracked(theta, self.first_candidates)
        eigenvalues, shapes = self.solver.modes(theta, self.n_lowest)
        return np.sqrt(eigenvalues[:, self.ranks]) / (2 * np.pi), shapes[:, :, self.ranks]

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
        local_modes = partial(self.local_modes, follow=self.track, basis=basis)
        return linearised_by_row(local_modes, theta, dofs, None if self.track else self.ranks)

    def frequency_slopes(self, theta: Array, frequencies: Array, shapes: Array) -> Array:
        """d f / d theta of modes of unit modal mass, (n_samples, n_modes, n_parameters)."""
        gradient = self.stiffness.quadratic_forms(shapes) @ self.stiffness.coefficient_gradients(theta)
        if not self.mass.is_constant:
            eigenvalues = (2 * np.pi * frequencies[:, :, np.newaxis]) ** 2
            gradient -= eigenvalues * (self.mass.quadratic_forms(shapes) @ self.mass.coefficient_gradients(theta))
        return gradient / (8 * np.pi**2 * frequencies[:, :, np.newaxis])

    def nominal_mac(self, shapes: Array) -> Array:
        """Mass-weighted MAC of the nominal modes with shapes, (n_samples, n_modes, n_candidates)."""
        masses = self.mass.quadratic_forms(shapes) @ self.nominal.mass_coefficients
        return (self.nominal.weighted_shapes.T @ shapes) ** 2 / masses[:, np.newaxis]

    def paired(self, theta: Array, candidates: Array) -> tuple[Array, NDArray[np.intp], NDArray[np.bool_]]:
        """MAC of nominal modes with candidates, which candidate is which mode, and rows in which one may be missed."""
        mac, repeated = self.nominal_mac(candidates), self.nominal.repeated
        order = pair_modes(mac, repeated)
        return mac, order, may_be_missed(mac, order, repeated, self.nominal.mass_spread(theta, self.mass))

    def local_modes(self, row: Array, *, follow: bool, basis: Array | None = None) -> LocalModes:
        """The lowest modes at one row of theta; with ``follow``, enough of them to hold every nominal mode."""
        n_candidates = self.first_candidates
        while True:
            eigenvalues, shapes, solve = self.solver.local_modes(row, n_candidates)
            mac, ranks, missed = self.paired(row, shapes[np.newaxis])
            if not follow or n_candidates == self.max_candidates or not missed[0]:
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
        _, order, missed = self.paired(theta, candidates)
        frequencies = np.take_along_axis(np.sqrt(eigenvalues) / (2 * np.pi), order, axis=1)
        shapes = np.take_along_axis(candidates, order[:, np.newaxis], axis=2)
        if n_candidates < self.max_candidates and missed.any():
            more = min(2 * n_candidates, self.max_candidates)
            frequencies[missed], shapes[missed] = self._tracked(theta[missed], more)
        return frequencies, shapes


def pair_modes(mac: NDArray[np.float64], repeated: NDArray[np.bool_]) -> NDArray[np.intp]:
    """The candidate of each reference mode, (n_samples, n_modes), so that the sum of MACs is highest.

    ``mac`` is (n_samples, n_modes, n_candidates). Reference modes that share a ``repeated`` frequency, (n_modes,
    n_modes), have an arbitrary basis of the space they span as their shapes: candidates are compared with that space,
    and those assigned to it are sorted by frequency.
    """
    spans = np.nan_to_num(repeated @ mac)
    best = spans.argmax(axis=2)
    distinct = (np.diff(np.sort(best, axis=1), axis=1) > 0).all(axis=1)
    for sample in np.flatnonzero(~distinct):
        best[sample] = linear_sum_assignment(spans[sample], maximize=True)[1]
    for cluster in np.unique(repeated, axis=0):
        best[:, cluster] = np.sort(best[:, cluster], axis=1)
    return best


def may_be_missed(
    mac: NDArray[np.float64], order: NDArray[np.intp], repeated: NDArray[np.bool_], spread: ArrayLike = 1.0
) -> NDArray[np.bool_]:
    """Samples in which a mode beyond the candidates could have a higher MAC with a reference than the one assigned.

    Modes are orthogonal, so the MACs of a reference with all modes add up to 1 (with repeated references, to their
    number). No mode beyond the candidates can have a higher MAC than what the candidates leave of that sum. Where the
    mass M is not the M_0 of the references, but a M_0 <= M <= b M_0, the sum is at most the ``spread`` b / a: squares
    (phi_0' M_0 phi)^2 add up to phi_0' M_0 M^-1 M_0 phi_0 <= 1 / a, and phi' M_0 phi >= 1 / b.
    """
    spans = repeated @ mac
    assigned = np.take_along_axis(spans, order[:, :, np.newaxis], axis=2)[:, :, 0]
    left = np.multiply.outer(spread, repeated.sum(axis=1)) - spans.sum(axis=2)
    return (assigned < left).any(axis=1)


def repeated_modes(eigenvalues: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of some ascending eigenvalues equal each other up to rounding, (n_modes, n_modes)."""
    cluster = np.cumsum(np.diff(eigenvalues, prepend=0) > REPEATED * eigenvalues)
    return cluster[:, np.newaxis] == cluster


class DenseSolver(ABC):
    """A solver by LAPACK; at one theta the stiffness is factored when it is first needed."""

    _stiffness: DenseTerms

    @abstractmethod
    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        """Lowest eigenvalues, (n_samples, n_modes)."""

    @abstractmethod
    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        """Lowest eigenvalues and their shapes, (n_samples, n_dof, n_modes)."""

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        eigenvalues, shapes = self.modes(theta, n_modes)

        @cache
        def factors() -> tuple[Array, bool]:
            return scipy.linalg.cho_factor(self._stiffness.assemble(theta)[0])

        return eigenvalues[0], shapes[0], lambda columns: scipy.linalg.cho_solve(factors(), columns)


class StandardSolver(DenseSolver):
    """A y = lambda y with A = L^-1 K L^-T and phi = L^-T y, for a constant mass M = L L'.

    The mass is factored once and every stiffness term transformed once.
    """

    def __init__(self, transformed: DenseTerms, basis: Array, stiffness: DenseTerms):
        self._transformed = transformed
        self._basis = basis
        self._stiffness = stiffness

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        eigenvalues = np.linalg.eigvalsh(self._transformed.assemble(theta))
        return np.where(eigenvalues[:, :1] > 0, eigenvalues, np.nan)[:, :n_modes]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        eigenvalues, shapes = np.linalg.eigh(self._transformed.assemble(theta))
        positive = np.where(eigenvalues[:, :1] > 0, eigenvalues, np.nan)
        return positive[:, :n_modes], self._basis @ shapes[:, :, :n_modes]


class FlexibilitySolver(DenseSolver):
    """B y = y / lambda with B = L^-1 M L^-T and phi = L^-T y sqrt(lambda), for K = L L'.

    The mass may vary with theta or be zero at some degrees of freedom. The lowest modes stay accurate where the
    eigenvalues span many orders of magnitude.
    """

    def __init__(self, stiffness: DenseTerms, mass: DenseTerms):
        self._stiffness = stiffness
        self._mass = mass

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        flexibility, _, ones = self._flexibility(theta)
        return ones / np.linalg.eigvalsh(flexibility)[:, ::-1][:, :n_modes]

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        flexibility, back, ones = self._flexibility(theta)
        inverse_eigenvalues, shapes = np.linalg.eigh(flexibility)
        eigenvalues = ones / inverse_eigenvalues[:, ::-1][:, :n_modes]
        return eigenvalues, back @ shapes[:, :, ::-1][:, :, :n_modes] * np.sqrt(eigenvalues)[:, np.newaxis]

    def _flexibility(self, theta: Array) -> tuple[Array, Array, Array]:
        """B, L^-T, and a column of ones with NaN where the stiffness has no L."""
        lower, ones = _cholesky(self._stiffness.assemble(theta))
        inverse: Array = np.asarray(np.linalg.inv(lower), dtype=float)
        transposed = inverse.swapaxes(1, 2)
        return inverse @ self._mass.assemble(theta) @ transposed, transposed, ones


Solver: TypeAlias = DenseSolver | ShiftInvertSolver


def eigen_solver(stiffness: AffineTerms, mass: AffineTerms) -> Solver:
    """Batches for dense terms, shift-invert for sparse ones."""
    if isinstance(stiffness, DenseTerms) and isinstance(mass, DenseTerms):
        return dense_solver(stiffness, mass, np.ones((1, stiffness.exponents.shape[1])))
    if isinstance(stiffness, SparseTerms) and isinstance(mass, SparseTerms):
        return ShiftInvertSolver(stiffness, mass)
    raise TypeError("stiffness and mass must both be dense or both sparse")


def dense_solver(stiffness: DenseTerms, mass: DenseTerms, nominal: Array, widest: float = 1e6) -> DenseSolver:
    """The standard form, which is the fastest, where it is accurate enough; else the flexibility form.

    Up to the ``widest`` ratio of eigenvalues, the standard form gives the lowest one to 1e-9 of its value.
    """
    if mass.is_constant:
        matrix = mass.assemble(nominal)[0]
        lowest, highest = np.linalg.eigvalsh(matrix)[[0, -1]]
        if lowest > len(matrix) * np.finfo(float).eps * highest:
            lower = np.linalg.cholesky(matrix)
            basis = scipy.linalg.solve_triangular(lower, np.eye(len(matrix)), lower=True).T
            solver = StandardSolver(stiffness.projected(basis), basis, stiffness)
            eigenvalues = solver.eigenvalues(nominal, len(matrix))[0]
            if eigenvalues[-1] < widest * eigenvalues[0]:
                return solver
    return FlexibilitySolver(stiffness, mass)


def _cholesky(matrices: Array) -> tuple[Array, Array]:
    """Lower factors and ones; the identity and NaN where a matrix is not positive definite."""
    try:
        return np.asarray(np.linalg.cholesky(matrices), dtype=float), np.ones((len(matrices), 1))
    except np.linalg.LinAlgError:
        if len(matrices) == 1:
            return np.eye(matrices.shape[1])[np.newaxis], np.full((1, 1), np.nan)
        factors, ones = zip(*(_cholesky(matrix[np.newaxis]) for matrix in matrices), strict=True)
        return np.concatenate(factors), np.concatenate(ones)


def shape_derivatives(
    stiffness: DenseTerms, mass: DenseTerms, theta: Array, eigenvalues: Array, shapes: Array
) -> Array:
    """Derivatives of mode shapes of unit modal mass, (n_samples, n, n_modes, n_parameters).

    Solves the bordered equations

    [K - lambda M, M phi; phi' M, 0] [d phi; -d lambda] = [-(dK - lambda dM) phi; -1/2 phi' dM phi]

    for each mode of all rows together. They are regular where the eigenvalue is not repeated, also with massless
    degrees of freedom. Rows with NaN eigenvalues, which have no solution, stay NaN.
    """
    solved = np.flatnonzero(np.isfinite(eigenvalues).all(axis=1))
    derivatives = np.full((*shapes.shape, theta.shape[1]), np.nan)
    theta, eigenvalues, shapes = theta[solved], eigenvalues[solved], shapes[solved]
    K, M = stiffness.assemble(theta), mass.assemble(theta)
    forces, d_masses = -stiffness.derivatives(theta, shapes), np.zeros((len(theta), *derivatives.shape[2:]))
    if not mass.is_constant:
        inertia = mass.derivatives(theta, shapes)
        forces += eigenvalues[:, np.newaxis, :, np.newaxis] * inertia
        d_masses = np.einsum("sim,simp->smp", shapes, inertia)
    for mode in range(shapes.shape[2]):
        phi, shift = shapes[:, :, mode], eigenvalues[:, mode, np.newaxis, np.newaxis]
        right = np.concatenate([forces[:, :, mode], -0.5 * d_masses[:, np.newaxis, mode]], axis=1)
        border = (M @ phi[:, :, np.newaxis])[:, :, 0]
        derivatives[solved, :, mode] = _solve_bordered(K - shift * M, border, right, K)
    return derivatives


def _solve_bordered(matrices: Array, borders: Array, right: Array, scale: Array) -> Array:
    """The first n unknowns of equations with a border of one row and column."""
    n = matrices.shape[1]
    largest = np.abs(scale).max(axis=(1, 2), initial=0.0)
    factors = largest / np.abs(borders).max(axis=1)
    bordered = np.zeros((len(matrices), n + 1, n + 1))
    bordered[:, :n, :n] = matrices
    bordered[:, :n, n] = bordered[:, n, :n] = borders * factors[:, np.newaxis]
    right[:, n] *= factors[:, np.newaxis]
    try:
        found = np.linalg.solve(bordered, right)
    except np.linalg.LinAlgError:
        # A repeated eigenvalue makes the equations singular.
        bordered[:, :n, :n] += 1e-9 * largest[:, np.newaxis, np.newaxis] * np.eye(n)
        found = np.linalg.solve(bordered, right)
    return np.asarray(found, dtype=float)[:, :n]
