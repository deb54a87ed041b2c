"""Dense eigenproblems of many theta by iterated condensation, from the nominal modes, with LAPACK for the rest."""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np
import scipy.linalg
from numpy.typing import NDArray

from skthermo._core.arrays import Array
from skthermo.fem._terms import DenseTerms


class EigenSolver(Protocol):
    """Solves the eigenproblem for many theta at once."""

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        """Lowest eigenvalues, (n_samples, n_modes)."""

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        """Lowest eigenvalues and their shapes, (n_samples, n_dof, n_modes)."""

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        """Eigenvalues and shapes at one row of theta, and a function that solves K x = b there."""

    def scaled(self, factors: Array) -> "EigenSolver":
        """The solver of the same structure with its stiffness terms multiplied."""


class Ritz(NamedTuple):
    """Eigenvalues (n_samples, m) and shapes x (n_samples, m, n) on a subspace, M x, and the residuals."""

    eigenvalues: Array
    shapes: Array
    inertia: Array
    residuals: Array

    @classmethod
    def with_residuals(cls, eigenvalues: Array, x: Array, Kx: Array, mu: Array) -> "Ritz":
        """Residuals from Kx and the diagonal of M."""
        inertia = x * mu
        return cls(eigenvalues, x, inertia, Kx - eigenvalues[:, :, np.newaxis] * inertia)


class CondensationSolver:
    """The lowest modes of K(theta) x = lambda M x for a constant mass, from the nominal ones.

    In coordinates of the nominal modes, of unit strain energy, K(1) = I and M = diag(mu). The first m coordinates are
    masters. The others, x_s, follow from the second of the two block rows,

        (K_ss - lambda M_ss) x_s = -K_sm x_m,

    by a few steps of conjugate gradients, which converge fast because K_ss is near I. The first block row is solved
    by a Rayleigh-Ritz step. Both are repeated until a bound certifies every eigenvalue, and that none was missed; rows
    that are not certified are solved by LAPACK.

    With K(theta) >= c K(1), the form K - s M is at least W = diag(c; c - s mu / (1 - tau)) on the M-orthogonal
    complement of the m shapes, whose slave coordinates hold the share tau of their modal masses. By Haynsworth's
    inertia formula, fewer than j eigenvalues lie below s = lambda_j (1 - tol) if

        sum over k >= j of r_k' W^-1 r_k / (lambda_k - s) < 1

    with the residuals r. By Rayleigh and Ritz, at least j are not above lambda_j.
    """

    def __init__(self, stiffness: DenseTerms, mu: Array, basis: Array, lapack: EigenSolver, tol: float):
        self._stiffness = stiffness
        self._mu = mu
        self._basis = basis
        self._lapack = lapack
        self._tol = tol
        self._tol_of_shapes = min(tol, 1e-12)  # the error of a shape is about the square root
        terms = stiffness.matrices * stiffness.factors[:, np.newaxis, np.newaxis]
        self._floors = np.minimum(np.linalg.eigvalsh(terms)[:, 0], 0.0)

    def eigenvalues(self, theta: Array, n_modes: int) -> Array:
        eigenvalues, _, certified = self._iterate(theta, n_modes, self._tol)
        if not certified.all():
            eigenvalues[~certified] = self._lapack.eigenvalues(theta[~certified], n_modes)
        return eigenvalues

    def modes(self, theta: Array, n_modes: int) -> tuple[Array, Array]:
        eigenvalues, coordinates, certified = self._iterate(theta, n_modes, self._tol_of_shapes)
        shapes = (coordinates @ self._basis.T).swapaxes(1, 2)
        if not certified.all():
            eigenvalues[~certified], shapes[~certified] = self._lapack.modes(theta[~certified], n_modes)
        return eigenvalues, shapes

    def local_modes(self, theta: Array, n_modes: int) -> tuple[Array, Array, Callable[[Array], Array]]:
        return self._lapack.local_modes(theta, n_modes)

    def scaled(self, factors: Array) -> EigenSolver:
        return self._lapack.scaled(factors)

    def _iterate(self, theta: Array, n_modes: int, tol: float) -> tuple[Array, Array, NDArray[np.bool_]]:
        """Eigenvalues (n_samples, n_modes), shapes (n_samples, n_modes, n), and which rows are certified."""
        eigenvalues = np.full((len(theta), n_modes), np.nan)
        shapes = np.full((len(theta), n_modes, len(self._mu)), np.nan)
        certified = np.zeros(len(theta), dtype=bool)
        n_masters = self._n_masters(n_modes)
        if n_masters:
            for first in range(0, len(theta), 32):  # rows whose matrices stay in the processor's cache
                part = slice(first, first + 32)
                results = eigenvalues[part], shapes[part], certified[part]
                self._iterate_together(theta[part], n_masters, tol, *results)
        return eigenvalues, shapes, certified

    def _n_masters(self, n_modes: int) -> int:
        """Number of master coordinates; 0 where LAPACK is faster or the modes are not far enough from the others."""
        apart = np.flatnonzero(1.7 * self._mu < self._mu[n_modes - 1])
        apart = apart[apart >= n_modes + 2]  # fewest masters beyond the wanted modes
        most = min(len(self._mu) // 3, np.count_nonzero(self._mu > 1e-12 * self._mu[0]))  # others are massless
        return int(apart[0]) if apart.size and apart[0] <= most else 0

    def _iterate_together(
        self, theta: Array, m: int, tol: float, eigenvalues: Array, shapes: Array, certified: NDArray[np.bool_]
    ) -> None:
        """Fill in the rows that can be certified."""
        mu, n_modes = self._mu, eigenvalues.shape[1]
        products = self._stiffness.coefficients(theta) / self._stiffness.factors
        lowest = products.min(axis=1)
        bounds = lowest + (products - lowest[:, np.newaxis]) @ self._floors  # c such that K(theta) >= c K(1)
        rows = np.flatnonzero(bounds > 0)
        bounds, K = bounds[rows], self._stiffness.assemble(theta[rows])
        ritz = masters_alone(K, mu, m)
        K_ss = K[:, m:, m:].astype(np.float32)
        for n_steps in (3, 5, 5, 5):  # of conjugate gradients, between Rayleigh-Ritz steps
            solvable = bounds > ritz.eigenvalues[:, n_modes - 1] * mu[m]
            rows, K, K_ss, bounds, ritz = _take(solvable, rows, K, K_ss, bounds, ritz)
            if not rows.size:
                return
            x = ritz.shapes.copy()
            # Solutions of (K_ss - lambda M_ss) x = r_s, in single precision: the next residuals tell their errors.
            lowest = np.minimum(ritz.eigenvalues, ritz.eigenvalues[:, n_modes - 1 : n_modes]).astype(np.float32)
            shift = lowest[:, :, np.newaxis] * mu[m:].astype(np.float32)
            x[:, :, m:] -= conjugate_gradients(K_ss, shift, ritz.residuals[:, :, m:].astype(np.float32), n_steps)
            ritz = rayleigh_ritz(x, x @ K, mu)
            done = certificate(ritz, mu, bounds, m, n_modes, tol)
            finished = rows[done]
            eigenvalues[finished] = ritz.eigenvalues[done, :n_modes]
            shapes[finished] = ritz.shapes[done, :n_modes]
            certified[finished] = True
            rows, K, K_ss, bounds, ritz = _take(~done, rows, K, K_ss, bounds, ritz)


def batch_solver(
    stiffness: DenseTerms, mass: DenseTerms, nominal: Array, lapack: EigenSolver, tol: float
) -> EigenSolver:
    """A solver for many theta around ``nominal``, which gives eigenvalues to a relative error of ``tol``.

    It is LAPACK for small matrices, and where the mass varies.
    """
    if stiffness.n_dof < 40 or not mass.is_constant:
        return lapack
    try:
        lower = np.linalg.cholesky(stiffness.assemble(nominal)[0])
    except np.linalg.LinAlgError:
        return lapack
    inverse = scipy.linalg.solve_triangular(lower, np.eye(len(lower)), lower=True)
    mu, vectors = np.linalg.eigh(inverse @ mass.assemble(nominal)[0] @ inverse.T)
    basis = inverse.T @ vectors[:, ::-1]
    return CondensationSolver(stiffness.projected(basis), np.maximum(mu[::-1], 0.0), basis, lapack, tol)


def conjugate_gradients(K: Array, shift: Array, right: Array, n_steps: int) -> Array:
    """Approximate solutions x (n_samples, m, n) of x_j (K - diag(shift_j)) = right_j, where K is nearly diagonal."""
    inverse = 1 / (np.einsum("sii->si", K)[:, np.newaxis] - shift)
    x, r = np.zeros_like(right), right.copy()
    p = z = r * inverse
    rz = _dot(r, z)
    for step in range(n_steps):
        image = p @ K
        image -= shift * p
        length = _ratio(rz, _dot(p, image))
        x += length * p
        if step < n_steps - 1:
            r -= length * image
            z = r * inverse
            before, rz = rz, _dot(r, z)
            p = z + _ratio(rz, before) * p
    return x


def masters_alone(K: Array, mu: Array, m: int) -> Ritz:
    """Rayleigh-Ritz on the masters, with nothing in the slave coordinates."""
    to_unit = 1 / np.sqrt(mu[:m])
    eigenvalues, vectors = np.linalg.eigh(to_unit[:, np.newaxis] * K[:, :m, :m] * to_unit)
    x = np.zeros((len(K), m, len(mu)))
    x[:, :, :m] = vectors.swapaxes(1, 2) * to_unit
    return Ritz.with_residuals(eigenvalues, x, x[:, :, :m] @ K[:, :m], mu)


def rayleigh_ritz(x: Array, Kx: Array, mu: Array) -> Ritz:
    """Ritz values in ascending order and shapes of unit modal mass on the span of some shapes."""
    to_unit = np.linalg.inv(np.linalg.cholesky((x * mu) @ x.swapaxes(1, 2)))
    eigenvalues, vectors = np.linalg.eigh(to_unit @ (Kx @ x.swapaxes(1, 2)) @ to_unit.swapaxes(1, 2))
    turned = vectors.swapaxes(1, 2) @ to_unit
    return Ritz.with_residuals(eigenvalues, turned @ x, turned @ Kx, mu)


def certificate(ritz: Ritz, mu: Array, bounds: Array, m: int, n_modes: int, tol: float) -> NDArray[np.bool_]:
    """Rows in which each of the lowest Ritz values exceeds the eigenvalue of its rank by at most ``tol`` times that."""
    lam = ritz.eigenvalues
    tau = np.einsum("smi,smi->s", ritz.shapes[:, :, m:], ritz.inertia[:, :, m:])
    floors = np.repeat(bounds[:, np.newaxis], len(mu), axis=1)
    floors[:, m:] -= (lam[:, n_modes - 1] / (1 - np.minimum(tau, 0.99)))[:, np.newaxis] * mu[m:]
    positive = (floors[:, m] > 0) & (tau < 0.99)
    errors = (ritz.residuals**2 @ (1 / np.where(floors > 0, floors, np.inf))[:, :, np.newaxis])[:, :, 0]
    wanted = lam[:, :n_modes, np.newaxis]
    shares = errors[:, np.newaxis] / (np.abs(lam[:, np.newaxis] - wanted) + tol * wanted)
    return positive & (np.triu(shares).sum(axis=2) < 1).all(axis=1)


def _take(kept: NDArray[np.bool_], *arrays: Any) -> tuple[Any, ...]:
    if kept.all():
        return arrays
    *plain, ritz = arrays
    return *(array[kept] for array in plain), Ritz(*(array[kept] for array in ritz))


def _dot(a: Array, b: Array) -> Array:
    return np.einsum("smi,smi->sm", a, b)[:, :, np.newaxis]


def _ratio(a: Array, b: Array) -> Array:
    """a / b, or 0 where the iteration has found the solution."""
    return np.divide(a, b, out=np.zeros_like(a), where=b > 0)
