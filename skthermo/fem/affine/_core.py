"""What AffineModel and ReducedModel share: terms, eigensolver, tracking, derivatives."""

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.fem._theta import nominal_theta
from skthermo.fem.affine._terms import AffineTerms, DenseTerms, SparseTerms
from skthermo.fem.modal import (
    EigenSolver,
    LocalModes,
    ShiftInvertSolver,
    dense_solver,
    hertz,
    may_be_missed,
    pair_modes,
    repeated_modes,
)

GUARD_MODES = 4
"""Number of modes above the tracked ones that are examined first: a mode that swaps moves up by a few ranks."""

CHUNK_BYTES = 2**25


@dataclass(frozen=True, eq=False)
class NominalModes:
    """The healthy nominal modes, which the columns of a tracking model follow.

    Attributes
    ----------
    weighted_shapes : ndarray of shape (n, n_modes)
        M phi, with the nominal mass M and shapes phi of unit modal mass.
    mass_coefficients : ndarray of shape (n_mass_terms,)
        What multiplies each mass term in M.
    repeated : ndarray of bool of shape (n_modes, n_modes)
        Which of the modes share a repeated frequency.
    """

    weighted_shapes: Array
    mass_coefficients: Array
    repeated: NDArray[np.bool_]

    def __post_init__(self) -> None:
        for array in (self.weighted_shapes, self.mass_coefficients, self.repeated):
            array.flags.writeable = False

    def mac(self, shapes: Array, mass: AffineTerms) -> Array:
        """Mass-weighted MAC with shapes (n_samples, n, n_candidates), (n_samples, n_modes, n_candidates)."""
        masses = mass.quadratic_forms(shapes) @ self.mass_coefficients
        return (self.weighted_shapes.T @ shapes) ** 2 / masses[:, np.newaxis]


@dataclass(frozen=True, eq=False)
class AffineCore:
    """Modal analysis of affine stiffness and mass, for checked rows of theta and without warnings."""

    stiffness: AffineTerms
    mass: AffineTerms
    solver: EigenSolver
    nominal: NominalModes
    n_modes: int
    track: bool
    max_candidates: int

    @classmethod
    def from_terms(
        cls, stiffness: AffineTerms, mass: AffineTerms, *, n_modes: int, track: bool, max_candidates: int
    ) -> "AffineCore":
        """The core whose nominal modes are those at theta = 1."""
        nominal = nominal_theta(stiffness.exponents.shape[1])
        solver = eigen_solver(stiffness, mass)
        eigenvalues, shapes = solver.modes(nominal, n_modes)
        modes = NominalModes(
            weighted_shapes=mass.product(nominal, shapes)[0],
            mass_coefficients=mass.coefficients(nominal)[0],
            repeated=repeated_modes(eigenvalues[0]),
        )
        return cls(stiffness, mass, solver, modes, n_modes, track, max_candidates)

    @property
    def rows_per_chunk(self) -> int:
        """How many rows are solved together, so that memory stays bounded."""
        numbers = max(self.stiffness.n_entries, 2 * self.stiffness.n_dof * self.n_modes)
        return max(1, min(self.stiffness.max_rows, CHUNK_BYTES // (8 * numbers)))

    @property
    def is_dense(self) -> bool:
        """Whether matrices are solved in dense batches."""
        return isinstance(self.stiffness, DenseTerms)

    def with_scaled_stiffness(self, factors: Array) -> "AffineCore":
        """The core with its stiffness terms multiplied; its columns stay the same nominal modes."""
        return replace(self, stiffness=self.stiffness.scaled(factors), solver=self.solver.scaled(factors))

    def rescaled(self, row: Array) -> "AffineCore":
        """The core whose theta = 1 is this one's theta = row; its columns stay the same nominal modes."""
        stiffness = self.stiffness.scaled(self.stiffness.products(row)[0])
        mass = self.mass.scaled(self.mass.products(row)[0])
        return replace(self, stiffness=stiffness, mass=mass, solver=eigen_solver(stiffness, mass))

    def projected(self, basis: Array, widest_spectrum: float) -> "AffineCore":
        """The core on a basis (n_dof, n) of shapes."""
        stiffness, mass = self.stiffness.projected(basis), self.mass.projected(basis)
        nominal = replace(self.nominal, weighted_shapes=basis.T @ self.nominal.weighted_shapes)
        solver = dense_solver(stiffness, mass, nominal_theta(stiffness.exponents.shape[1]), widest_spectrum)
        max_candidates = min(self.max_candidates, basis.shape[1])
        return replace(
            self, stiffness=stiffness, mass=mass, solver=solver, nominal=nominal, max_candidates=max_candidates
        )

    def frequencies(self, theta: Array) -> tuple[Array]:
        """Frequencies in Hz, (n_samples, n_modes)."""
        if self.track:
            return (self.modes(theta)[0],)
        return (hertz(self.solver.eigenvalues(theta, self.n_modes)),)

    def modes(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies in Hz and shapes (n_samples, n, n_modes)."""
        if self.track:
            return self._tracked(theta, min(self.n_modes + GUARD_MODES, self.max_candidates))
        eigenvalues, shapes = self.solver.modes(theta, self.n_modes)
        return hertz(eigenvalues), shapes

    def linearised(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies in Hz and d f / d theta, (n_samples, n_modes, n_parameters)."""
        frequencies, shapes = self.modes(theta)
        gradient = self.stiffness.gradients(theta, shapes)
        if not self.mass.is_constant:
            eigenvalues = (2 * np.pi * frequencies) ** 2
            gradient -= eigenvalues[:, :, np.newaxis] * self.mass.gradients(theta, shapes)
        return frequencies, gradient / (8 * np.pi**2 * frequencies[:, :, np.newaxis])

    def nominal_mac(self, shapes: Array) -> Array:
        """Mass-weighted MAC of the nominal modes with shapes, (n_samples, n_modes, n_candidates)."""
        return self.nominal.mac(shapes, self.mass)

    def local_modes(self, row: Array, *, follow: bool, basis: Array | None = None) -> LocalModes:
        """The lowest modes at one row of theta; with ``follow``, enough of them to hold every nominal mode."""
        n_candidates = min(self.n_modes + GUARD_MODES, self.max_candidates)
        while True:
            eigenvalues, shapes, solve = self.solver.local_modes(row, n_candidates)
            mac = self.nominal_mac(shapes[np.newaxis])
            ranks = pair_modes(mac, self.nominal.repeated)
            doubtful = follow and may_be_missed(mac, ranks, self.nominal.repeated)[0]
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
        """Nominal modes among the lowest candidates, and among more where these leave a doubt."""
        eigenvalues, candidates = self.solver.modes(theta, n_candidates)
        mac = self.nominal_mac(candidates)
        order = pair_modes(mac, self.nominal.repeated)
        frequencies = np.take_along_axis(hertz(eigenvalues), order, axis=1)
        shapes = np.take_along_axis(candidates, order[:, np.newaxis], axis=2)
        doubtful = may_be_missed(mac, order, self.nominal.repeated)
        if n_candidates < self.max_candidates and doubtful.any():
            more = min(2 * n_candidates, self.max_candidates)
            frequencies[doubtful], shapes[doubtful] = self._tracked(theta[doubtful], more)
        return frequencies, shapes


def eigen_solver(stiffness: AffineTerms, mass: AffineTerms) -> EigenSolver:
    """Batches for dense terms, shift-invert for sparse ones."""
    if isinstance(stiffness, DenseTerms) and isinstance(mass, DenseTerms):
        return dense_solver(stiffness, mass, nominal_theta(stiffness.exponents.shape[1]))
    if isinstance(stiffness, SparseTerms) and isinstance(mass, SparseTerms):
        return ShiftInvertSolver(stiffness, mass)
    raise TypeError("stiffness and mass must both be dense or both sparse")
