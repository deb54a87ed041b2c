"""Polynomials for frequencies: of one structure in all its weather, and of a model near the parameters of records."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import chain, combinations, combinations_with_replacement
from math import comb
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import Array, Bounds, check_theta, spread_evenly
from skthermo._core.parallel import single_blas_thread

CLOSE = 0.01  # relative distance of two modes in which the order of their columns is not known


@dataclass(frozen=True, eq=False)
class PrincipalBox:
    """Box around rows of ln theta along their principal directions, with a margin; its own coordinates are -1 to 1.

    ``jitter`` is the share of the margin in each half-width, and ``rows`` hold some rows in its coordinates. The box
    ends at ``bounds`` of the parameters, (n_parameters, 2).
    """

    centre: Array
    directions: Array
    half_widths: Array
    jitter: Array
    rows: Array
    bounds: Array

    @classmethod
    def around(cls, theta: Array, bounds: Array | None = None) -> PrincipalBox:
        """The box around rows of theta; rows with NaN do not count."""
        logs = np.log(theta[spread_evenly(np.flatnonzero(~np.isnan(theta).any(axis=1)), 1000)])
        middle = logs.mean(axis=0)
        directions = np.linalg.svd(logs - middle, full_matrices=True)[2]
        places = (logs - middle) @ directions.T
        lowest, highest = places.min(axis=0), places.max(axis=0)
        own = (highest - lowest) / 2
        half_widths = own + np.maximum(0.25 * own, 0.02)
        centre = middle + (lowest + highest) / 2 @ directions
        everywhere = np.tile([0.0, np.inf], (theta.shape[1], 1))
        rows = (logs - centre) @ directions.T / half_widths
        return cls(
            centre, directions, half_widths, 1 - own / half_widths, rows, everywhere if bounds is None else bounds
        )

    def places(self, theta: Array) -> Array:
        return (np.log(theta) - self.centre) @ self.directions.T / self.half_widths

    def holds(self, theta: Array, places: Array) -> NDArray[np.bool_]:
        """Which rows, given in both ways, are inside."""
        lowest, highest = self.bounds.T
        return (np.abs(places) <= 1).all(axis=1) & ((lowest <= theta) & (theta <= highest)).all(axis=1)

    def drawn(self, number: int, random: np.random.RandomState) -> Array:
        """Random points near rows, and some anywhere in the box, as rows of theta."""
        places = random.uniform(-1, 1, size=(number, len(self.centre)))
        near = are_near_rows(number)
        around = self.rows[random.randint(len(self.rows), size=number)]
        places[near] = (around + places * self.jitter)[near]
        theta = np.exp(self.centre + np.clip(places, -1, 1) * self.half_widths @ self.directions)
        return np.clip(theta, *self.bounds.T)


def are_near_rows(number: int) -> NDArray[np.bool_]:
    """Which of some drawn points are near rows: all but every fourth, which is anywhere in the box."""
    return np.arange(number) % 4 > 0


@dataclass(frozen=True)
class SmoothCoordinates:
    """Functions of the frequencies that are smooth in theta also where two modes cross or repel each other.

    These are ln f of a mode alone, and of each of ``pairs`` of modes the mean of ln f and the square of half its
    difference: symmetric functions of two eigenvalues have no branch points where these meet.
    """

    pairs: tuple[tuple[int, int], ...]

    @classmethod
    def of_modes(cls, frequencies: Array) -> SmoothCoordinates:
        """The coordinates for some rows, (n_samples, n_modes): modes that come close are pairs, the closest first."""
        logs, pairs, left = np.log(frequencies), [], set(range(frequencies.shape[1]))
        gaps = {(i, j): np.nanmin(np.abs(logs[:, i] - logs[:, j])) for i, j in combinations(sorted(left), 2)}
        for pair in sorted(gaps, key=gaps.__getitem__):
            if gaps[pair] < 0.05 and left.issuperset(pair):
                pairs.append(pair)
                left.difference_update(pair)
        return cls(tuple(pairs))

    def values(self, frequencies: Array) -> tuple[Array, Array]:
        """Coordinates, (n_samples, n_modes), and halves of the differences with their sign, (n_samples, n_pairs)."""
        found, halves = np.log(frequencies), np.empty((len(frequencies), len(self.pairs)))
        for number, (i, j) in enumerate(self.pairs):
            mean, halves[:, number] = (found[:, j] + found[:, i]) / 2, (found[:, j] - found[:, i]) / 2
            found[:, i], found[:, j] = mean, halves[:, number] ** 2
        return found, halves

    def frequencies(self, values: Array, errors: Array, signs: Array) -> tuple[Array, Array]:
        """Frequencies, (n_samples, n_modes), and the largest of their relative errors in each row.

        Given are coordinates with their errors, both changed in place, and the signs of the differences.
        """
        for number, (i, j) in enumerate(self.pairs):
            half = np.sqrt(np.maximum(values[:, j], 0.0))
            with np.errstate(divide="ignore", invalid="ignore"):
                errors[:, i] += errors[:, j] / (2 * half)
            errors[:, j] = errors[:, i]
            values[:, j] = values[:, i] + signs[:, number] * half
            values[:, i] -= signs[:, number] * half
        return np.exp(values), errors.max(axis=1)


@dataclass(frozen=True)
class ResponseSurface:
    """ln f as a polynomial of z = (ln theta - middle) / scale; coefficients (n_terms, n_modes)."""

    degree: int
    middle: Array
    scale: Array
    coefficients: Array

    @classmethod
    def fitted(cls, x: Array, frequencies: Array, sensitivity: Array | None = None) -> ResponseSurface:
        """The surface through frequencies at rows of ln theta = x and, where they are known, d ln f / d ln theta."""
        solved = np.isfinite(frequencies).all(axis=1)
        x, log_f, n_parameters = x[solved], np.log(frequencies[solved]), x.shape[1]
        most = 150 if sensitivity is not None else len(x) // 2
        degree = 1
        while degree < 3 and n_terms(n_parameters, degree + 1) <= most:
            degree += 1
        middle, scale = x.mean(axis=0), np.maximum(x.std(axis=0), 0.01)  # of ln theta
        z = (x - middle) / scale
        equations, results = [terms(z, degree)], [log_f]
        if sensitivity is not None:
            # Coefficients that solutions hardly determine stay small.
            small = 0.01 * np.sqrt(len(x)) * np.eye(n_terms(n_parameters, degree))[1 + n_parameters :]
            equations += [slopes_of_terms(z, degree).reshape(-1, small.shape[1]), small]
            results.append((sensitivity[solved] * scale).swapaxes(1, 2).reshape(-1, log_f.shape[1]))
            results.append(np.zeros((len(small), log_f.shape[1])))
        with single_blas_thread():  # the same bits on any number of threads
            coefficients = np.linalg.lstsq(np.vstack(equations), np.vstack(results), rcond=None)[0]
        return cls(degree, middle, scale, coefficients)

    def linearise(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies and d ln f / d ln theta."""
        z = (np.log(theta) - self.middle) / self.scale
        log_f = np.empty((len(z), self.coefficients.shape[1]))
        slopes = np.empty((*log_f.shape, z.shape[1]))
        for first in range(0, len(z), 1024):
            rows = slice(first, first + 1024)
            log_f[rows] = terms(z[rows], self.degree) @ self.coefficients
            slopes[rows] = (slopes_of_terms(z[rows], self.degree) @ self.coefficients).swapaxes(1, 2)
        return np.exp(log_f), slopes / self.scale


def n_terms(n_variables: int, degree: int) -> int:
    """Number of products of up to so many variables, 1 included."""
    return comb(n_variables + degree, degree)


def products(n_variables: int, degree: int) -> list[list[tuple[int, ...]]]:
    """Which variables are multiplied in each product of one, of two, ... variables."""
    variables = range(n_variables)
    return [[*combinations_with_replacement(variables, n_factors)] for n_factors in range(1, degree + 1)]


def terms(z: Array, degree: int) -> Array:
    """1 and every product of up to so many variables, (n_samples, n_terms)."""
    values, variables = np.ones((n_terms(z.shape[1], degree), len(z))), np.ascontiguousarray(z.T)
    for value, chosen in zip(values[1:], chain(*products(z.shape[1], degree)), strict=True):
        for variable in chosen:
            np.multiply(value, variables[variable], out=value)
    return values.T


def slopes_of_terms(z: Array, degree: int) -> Array:
    """Derivatives of the terms by each variable, (n_samples, n_variables, n_terms)."""
    slopes = [np.zeros((*z.shape, 1))]
    for chosen in map(np.array, products(z.shape[1], degree)):
        slope, column = np.zeros((*z.shape, len(chosen))), np.arange(len(chosen))
        for factor in range(chosen.shape[1]):
            slope[:, chosen[:, factor], column] += z[:, np.delete(chosen, factor, axis=1)].prod(axis=2)
        slopes.append(slope)
    return np.concatenate(slopes, axis=2)


class FrequencySurface:
    """Frequencies of one structure as polynomials in ln theta, near the parameters that its weather gives.

    In the box of all parameters that a model may have, frequencies are no polynomials; along the rows of theta that the
    weather gives they nearly are. Polynomials of ln f are fitted by least squares to a few hundred solves near such
    rows, and checked at others. Of two modes that come within 2 % of each other, polynomials give the mean and the
    squared difference of ln f, which are smooth also where modes cross or repel each other. A damaged structure needs a
    surface of its own.

    Parameters
    ----------
    solve : callable
        Gives frequencies in Hz, (n_samples, n_modes), of rows of theta.
    theta : array-like of shape (n_samples, n_parameters)
        Rows that the weather gives; those with NaN do not count.
    tol : float, default=4e-6
        Largest relative error of a frequency at the check points.
    highest_degree : int, default=5
        Of the polynomials; the degree is raised from 3 on until the error is small enough.
    bounds : array-like of shape (n_parameters, 2), optional
        Beyond them nothing is solved, and no row is served.

    Attributes
    ----------
    degree_ : int
        Of the polynomials.
    error_ : float
        Largest relative error at the check points that are served.
    share_ : float
        Share of the check points near rows of theta that are served.
    n_solves_ : int
        How many rows were solved.

    Raises
    ------
    RuntimeError
        If polynomials serve less than half of the check points near rows of theta with this error.

    Notes
    -----
    The box holds the rows along their principal directions, with a quarter of its half-width as a margin, or 2 %. The
    difference from the polynomial of one degree less estimates the error of a row. Rows are not served outside the box,
    where that estimate is more than half of the least one at a check point of too large an error, and where two modes
    are within 1 %, or a polynomial of their difference leaves open which is higher.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import FrequencySurface
    >>> truss, air = make_truss(), np.random.default_rng(0).normal(10, 8, size=(365, 1))
    >>> theta = np.exp([-0.002, -0.003, -0.001, -0.002] * (air - 10))
    >>> surface = FrequencySurface(truss.frequencies, theta)
    >>> frequencies, served = surface.frequencies(theta)
    >>> bool(served.all()), bool(np.abs(frequencies / truss.frequencies(theta) - 1).max() < 4e-6)
    (True, True)
    """

    def __init__(
        self,
        solve: Callable[[Array], Array],
        theta: ArrayLike,
        *,
        tol: float = 4e-6,
        highest_degree: int = 5,
        bounds: Bounds | None = None,
    ):
        rows = np.asarray(theta, dtype=float)
        self._box = PrincipalBox.around(rows, None if bounds is None else np.asarray(bounds, dtype=float))
        self.n_solves_, self.share_ = 0, 0.0
        if highest_degree >= 3:
            self._learn(solve, highest_degree, tol)
        if self.share_ < 0.5:
            raise RuntimeError(
                f"polynomials of degree {highest_degree} give frequencies to {tol:g} at {self.share_:.0%} of the check "
                "points near rows of theta; expected rows in a narrower region, in which no modes cross, a larger tol "
                "or a higher degree"
            )

    @staticmethod
    def degree_within(n_solves: int, n_parameters: int) -> int:
        """The highest degree for which so many solves suffice; 2 where they suffice for none.

        Parameters
        ----------
        n_solves : int
            Number of rows that may be solved.
        n_parameters : int
            Number of parameters.

        Returns
        -------
        int
            Of polynomials with at most 500 terms.
        """
        degree = 2
        while (number := n_terms(n_parameters, degree + 1)) <= 500:
            if 2 * number + 100 > n_solves:  # points to learn from, and to check
                break
            degree += 1
        return degree

    @property
    def size(self) -> int:
        """Number of numbers that it holds."""
        return self._coefficients.size

    def frequencies(self, theta: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Frequencies of rows, and which of them are served.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters; a row with NaN is not served.

        Returns
        -------
        frequencies : ndarray of shape (n_samples, n_modes)
            In Hz; NaN in rows that are not served.
        served : ndarray of bool, shape (n_samples,)
            Which rows have frequencies.
        """
        rows = check_theta(theta, [f"{i}" for i in range(len(self._box.centre))], allow_nan=True)
        frequencies, estimates = self._estimated(rows)
        served = estimates <= self._limit
        frequencies[~served] = np.nan
        return frequencies, served

    def _learn(self, solve: Callable[[Array], Array], highest_degree: int, tol: float) -> None:
        """Raise the degree until polynomials serve enough check points, or no higher one is allowed."""
        random = np.random.RandomState(0)
        checks = self._box.drawn(100, random)
        exact, near = solve(checks), are_near_rows(100)
        points, values = checks[:0], exact[:0]
        self._coordinates = SmoothCoordinates.of_modes(exact)
        may_serve = np.mean(smallest_gap(exact[near]) > CLOSE) >= 0.5
        for degree in range(3, may_serve * highest_degree + 1):
            n_more = 2 * n_terms(checks.shape[1], degree) - len(points)
            more = self._box.drawn(n_more, random)
            points, values = np.vstack([points, more]), np.vstack([values, solve(more)])
            self._fit(points, values, degree)
            self._check(checks, exact, near, tol)
            if self.share_ >= 0.9:
                break
        self.n_solves_ = len(points) + len(checks)

    def _fit(self, points: Array, values: Array, degree: int) -> None:
        self.degree_, features = degree, terms(self._box.places(points), degree)
        n_lower = n_terms(points.shape[1], degree - 1)
        smooth, halves = self._coordinates.values(values)
        whole, lower = (np.linalg.lstsq(part, smooth, rcond=None)[0] for part in (features, features[:, :n_lower]))
        difference = whole.copy()
        difference[:n_lower] -= lower
        apart = np.abs(halves) > CLOSE / 2
        signed = [
            np.linalg.lstsq(features[one], half[one], rcond=None)[0]
            for one, half in zip(apart.T, halves.T, strict=True)
        ]
        self._coefficients = np.column_stack([whole, difference, *signed])

    def _check(self, checks: Array, exact: Array, near: NDArray[np.bool_], tol: float) -> None:
        frequencies, estimates = self._estimated(checks)
        errors = np.nan_to_num(np.abs(frequencies / exact - 1), nan=np.inf).max(axis=1)
        known = np.isfinite(estimates)
        wrong = estimates[known & (errors > tol)]
        self._limit = 0.5 * wrong.min() if len(wrong) else estimates[known].max(initial=0.0)
        served = estimates <= self._limit
        self.error_, self.share_ = float(errors[served].max(initial=0.0)), float(served[near].mean())

    def _estimated(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies and estimates of the largest relative error of each row, infinite where none is served."""
        n_modes = (self._coefficients.shape[1] - len(self._coordinates.pairs)) // 2
        frequencies = np.full((len(theta), n_modes), np.nan)
        estimates = np.full(len(theta), np.inf)
        known = np.flatnonzero(~np.isnan(theta).any(axis=1))
        places = self._box.places(theta[known])
        is_inside = self._box.holds(theta[known], places)
        inside = known[is_inside]
        if len(inside):
            polynomials = terms(places[is_inside], self.degree_) @ self._coefficients
            smooth, differences, halves = np.split(polynomials, [n_modes, 2 * n_modes], axis=1)
            frequencies[inside], errors = self._coordinates.frequencies(smooth, np.abs(differences), np.sign(halves))
            is_apart = smallest_gap(frequencies[inside]) > CLOSE
            estimates[inside] = np.where(is_apart & self._in_order(frequencies[inside], halves), errors, np.inf)
        return frequencies, estimates

    def _in_order(self, frequencies: Array, halves: Array) -> NDArray[np.bool_]:
        """Rows in which the polynomials of differences, with their sign, agree with the others to a half."""
        found = self._coordinates.values(frequencies)[1]
        agreed: NDArray[np.bool_] = np.abs(halves - found) < np.abs(found) / 2
        return np.asarray(agreed.all(axis=1))


def smallest_gap(frequencies: Array) -> Array:
    """Smallest relative distance of two modes in each row; infinite of one mode, 0 with NaN."""
    in_order = np.sort(frequencies, axis=1)
    gaps = np.diff(in_order, axis=1) / in_order[:, 1:]
    smallest: Any = gaps.min(axis=1, initial=np.inf)
    return np.nan_to_num(smallest, nan=0.0, posinf=np.inf)
