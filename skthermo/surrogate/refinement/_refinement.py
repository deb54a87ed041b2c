"""Estimates of the inverse surrogate, refined on the FE model from the solution of a response surface."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial, reduce
from itertools import combinations_with_replacement
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.utils import Bunch

from skthermo._estimators.arguments import check_bounds, check_prior
from skthermo._estimators.threads import single_blas_thread
from skthermo._io import with_progress
from skthermo._tables.arrays import Array, robust_deviation, spread_evenly
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.refinement._posterior import Linearise, Objective, Prior, Refined, minimise, refine
from skthermo.surrogate.refinement._shapes import MeasuredShapes, ShapeInputs

SAMPLES_PER_TERM = 2  # least number of samples for each term of the polynomial
ROWS_PER_CHUNK = 1024
KEPT = 0.01  # weight of the samples of the box, beside solutions near the records


@dataclass(frozen=True)
class ResponseSurface:
    """ln f as a polynomial of z = (ln theta - middle) / scale; coefficients (n_terms, n_modes)."""

    degree: int
    middle: Array
    scale: Array
    coefficients: Array

    @classmethod
    def of_samples(cls, theta: Array, frequencies: Array) -> ResponseSurface | None:
        """The surface of samples of a box; None where they are too few."""
        known = ~(np.isnan(frequencies).any(axis=1) | np.isnan(theta).any(axis=1))
        x, log_f = np.log(theta[known]), np.log(frequencies[known])
        n_parameters = theta.shape[1]
        degree = next((d for d in (3, 2) if len(x) >= SAMPLES_PER_TERM * comb(n_parameters + d, d)), None)
        if degree is None:
            return None
        middle, scale = x.mean(axis=0), x.std(axis=0)
        return cls(degree, middle, scale, least_squares(terms((x - middle) / scale, degree), log_f))

    def near(self, x: Array, frequencies: Array, sensitivity: Array) -> ResponseSurface:
        """The surface that is accurate near solutions, frequencies and d ln f / d ln theta at rows of ln theta = x.

        In directions in which these hardly differ, this surface is kept.
        """
        solved = np.isfinite(frequencies).all(axis=1) & np.isfinite(sensitivity).all(axis=(1, 2))
        z, log_f = (x[solved] - self.middle) / self.scale, np.log(frequencies[solved])
        slopes = (sensitivity[solved] * self.scale).swapaxes(1, 2).reshape(-1, log_f.shape[1])
        kept = KEPT * np.sqrt(len(z)) * np.eye(len(self.coefficients))
        equations = np.vstack([terms(z, self.degree), slopes_of_terms(z, self.degree).reshape(-1, len(kept)), kept])
        coefficients = least_squares(equations, np.vstack([log_f, slopes, kept @ self.coefficients]))
        return replace(self, coefficients=coefficients)

    def linearise(self, theta: Array) -> tuple[Array, Array]:
        """Frequencies and d ln f / d ln theta."""
        z = (np.log(theta) - self.middle) / self.scale
        log_f, slopes = (
            np.empty((len(z), self.coefficients.shape[1])),
            np.empty((len(z), self.coefficients.shape[1], z.shape[1])),
        )
        for rows in (slice(i, i + ROWS_PER_CHUNK) for i in range(0, len(z), ROWS_PER_CHUNK)):
            log_f[rows] = terms(z[rows], self.degree) @ self.coefficients
            slopes[rows] = (slopes_of_terms(z[rows], self.degree) @ self.coefficients).swapaxes(1, 2)
        return np.exp(log_f), slopes / self.scale


def products(n_variables: int, degree: int) -> list[NDArray[np.intp]]:
    """Which variables are multiplied in each product of one, two, ... variables, (n_products, n_factors)."""
    variables = range(n_variables)
    return [np.array([*combinations_with_replacement(variables, factors)]) for factors in range(1, degree + 1)]


def terms(z: Array, degree: int) -> Array:
    """1 and every product of up to so many variables, (n_samples, n_terms)."""
    values = [z[:, chosen].prod(axis=2) for chosen in products(z.shape[1], degree)]
    return np.hstack([np.ones((len(z), 1)), *values])


def slopes_of_terms(z: Array, degree: int) -> Array:
    """Derivatives of the terms by each variable, (n_samples, n_variables, n_terms)."""
    slopes = [np.zeros((*z.shape, 1))]
    for chosen in products(z.shape[1], degree):
        slope, column = np.zeros((*z.shape, len(chosen))), np.arange(len(chosen))
        for factor in range(chosen.shape[1]):
            slope[:, chosen[:, factor], column] += z[:, np.delete(chosen, factor, axis=1)].prod(axis=2)
        slopes.append(slope)
    return np.concatenate(slopes, axis=2)


def least_squares(equations: Array, values: Array) -> Array:
    """Least-squares solution, the same bits on any number of threads."""
    with single_blas_thread():
        return np.linalg.lstsq(equations, values, rcond=None)[0]


EXACT, EXACT_WITH_GAPS = 1e-6, 1e-3
"""Relative standard deviation of frequencies that count as exact. Where modes are missing, many parameters fit the
others, and this noise lets steps move along the curve of these parameters."""

FAR_OUTSIDE = 2 * np.sqrt(3)
"""Standard deviations of a box's prior that are two half-widths of the box; parameters beyond are far outside it."""

TINY_SHARE = 1e-12

LARGEST_SCATTER = 0.02  # scatter above which a misfit counts as a wrong model rather than noise
ASSUMED_SCATTER = 1e-3  # noise on which standard deviations are based where it is neither given nor can be estimated
ROWS_FOR_SCATTER = 365
STEPS_ON_SURFACE = 100
ROWS_FOR_SURFACE = 50  # number of records near which a response surface is made accurate
ROWS_FOR_BOX = 200  # number of records near which a reduced model has to be accurate
CHUNKS_PER_BLOCK = 8  # of the model, that are refined together: few, so that progress is visible


def unconverged(found: Bunch) -> NDArray[np.bool_]:
    """Rows with frequencies whose refinement has not converged."""
    return ~found.converged & (found.weight > 0)


@dataclass(frozen=True)
class Refinement:
    """Posterior modes of the parameters of measured frequencies and, perhaps, shapes.

    ``noise`` holds relative standard deviations, (n_modes,); ``n_steps`` is the most for each row. Rows start where the
    response ``surface`` has its posterior mode, or at the regressor's guess. Rows that end outside the box of a reduced
    model go on with the full one. ``recent`` holds the rows that the scatter was estimated from until they are needed.
    """

    simulator: Simulator
    noise: Array
    prior: Prior
    n_steps: int
    n_jobs: int | None
    shapes: ShapeInputs | None = None
    surface: ResponseSurface | None = None
    recent: list[tuple[Array, Refined]] = field(default_factory=list, repr=False)

    @classmethod
    def of(cls, inverse: Any) -> Refinement:
        """The refinement that the parameters of an `InverseSurrogate` ask for."""
        names = inverse.model.parameter_names
        width = None if inverse.prior is None else check_prior(inverse.prior, names)
        prior = Prior.of_box(check_bounds(inverse.bounds, names), width)
        drawn, surface = inverse.samples_, None
        if inverse.box_ is not None and inverse.shape_inputs_ is None:
            surface = ResponseSurface.of_samples(drawn.theta, drawn.frequencies)
        settings = inverse.n_steps_, inverse.n_jobs, inverse.shape_inputs_, surface
        return cls(inverse.simulator_, inverse.noise_, prior, *settings)

    def adapted(self, inputs: Array, guess: Array) -> Refinement:
        """The refinement whose reduced model and response surface suit where records have their parameters."""
        n_rows = ROWS_FOR_SURFACE if self.simulator.reduced is None else ROWS_FOR_BOX
        rows = spread_evenly(np.flatnonzero(~np.isnan(inputs).all(axis=1)), n_rows)
        if not rows.size or (self.surface is None and self.simulator.reduced is None):
            return self
        objective, start = self._problem(inputs[rows], guess[rows])
        x = minimise(objective, start, self.n_steps).local.x
        simulator = self.simulator.extended(np.exp(x), self.prior.limits)
        if self.surface is None:
            return replace(self, simulator=simulator)
        solved = simulator.approximate.linearise(np.exp(x), self.n_jobs, relative=True)
        return replace(self, simulator=simulator, surface=self.surface.near(x, *solved))

    def refined(self, inputs: Array, guess: Array, scatter: Array, *, remember: bool = False) -> Bunch:
        """What `InverseSurrogate.invert` gives, for rows of inputs and the regressor's guess."""
        n_modes, some = len(self.noise), ~np.isnan(inputs).all(axis=1)
        result = Bunch(
            theta=np.full_like(guess, np.nan),
            std=np.full_like(guess, np.nan),
            residuals=np.full((len(guess), n_modes), np.nan),
            weight=np.zeros(len(guess)),
            converged=np.zeros(len(guess), dtype=bool),
            outside=np.zeros(guess.shape, dtype=bool),
            solves=np.zeros(len(guess), dtype=np.intp),
            full_solves=np.zeros(len(guess), dtype=np.intp),
        )
        if not some.any():
            return result
        prior, guess = self.prior, guess[some]
        objective, start = self._problem(inputs[some], guess)
        found = self._recall(inputs[some], objective, start)
        if remember:
            self.recent.append((inputs[some], found))
        local, lost = found.local, found.stalled[:, np.newaxis]
        complete = self._with_shapes(np.maximum(objective.noise[:, :n_modes], scatter))
        deviations, at_best = (
            prior.deviations(np.nan_to_num(local.sensitivity), spread)
            for spread in (np.where(objective.missing, np.inf, complete), complete)
        )
        result.theta[some] = np.where(lost, guess, np.exp(local.x))
        result.std[some] = np.where(lost, prior.width, deviations) * result.theta[some]
        unknown = lost | np.isnan(objective.log_measured)
        result.residuals[some] = np.where(unknown, np.nan, local.residual[:, :n_modes])
        result.weight[some] = ((at_best / deviations) ** 2).mean(axis=1)
        result.outside[some] = self._contradicts(local.x, deviations)
        result.converged[some] = found.converged
        result.solves[some], result.full_solves[some] = found.solves, found.full_solves
        return result

    def _problem(self, inputs: Array, guess: Array) -> tuple[Objective, Array]:
        """The objective of rows of inputs, by the reduced model where there is one, and where their steps start."""
        prior, frequencies = self.prior, inputs[:, : len(self.noise)]
        gaps = np.isnan(frequencies).any(axis=1, keepdims=True)
        noise = np.maximum(self.noise, np.where(gaps, EXACT_WITH_GAPS, EXACT))
        shapes = None if self.shapes is None else MeasuredShapes(self.shapes.unit_shapes(inputs))
        observed = np.log(frequencies), self._with_shapes(noise)
        objective = Objective(self._by(self.simulator.approximate), *observed, prior, shapes)
        start = np.clip(np.where(np.isnan(guess), prior.mean, np.log(guess)), prior.lowest, prior.highest)
        if self.surface is not None:
            start = minimise(replace(objective, linearise=self.surface.linearise), start, STEPS_ON_SURFACE).local.x
        return objective, start

    def _by(self, simulator: Simulator) -> Linearise:
        """Frequencies and, perhaps, shapes by a simulator, with their derivatives by ln theta."""
        dofs = None if self.shapes is None else self.shapes.dofs
        return partial(simulator.linearise, n_jobs=self.n_jobs, dofs=dofs, relative=True)

    def _recall(self, inputs: Array, objective: Objective, start: Array) -> Refined:
        """Refine rows, except those that were refined just before; rows do not depend on each other."""
        if not self.recent:
            return self._refine(objective, start)
        known_inputs, found = self.recent.pop()
        places = {row.tobytes(): place for place, row in enumerate(known_inputs)}
        place = np.array([places.get(row.tobytes(), -1) for row in inputs], dtype=np.intp)
        new = np.flatnonzero(place < 0)
        if new.size:
            place[new] = len(known_inputs) + np.arange(new.size)
            found = found.beside(self._refine(objective.of(new), start[new]))
        return found.of(place)

    def _refine(self, objective: Objective, start: Array) -> Refined:
        """Refine rows in blocks, which show the progress."""
        size = CHUNKS_PER_BLOCK * getattr(self.simulator.approximate.model, "rows_per_chunk", 32)
        blocks = np.split(np.arange(len(start)), range(size, len(start), size))
        refined = (self._refine_block(objective.of(rows), start[rows]) for rows in blocks)
        parts = with_progress(refined, len(start), None, count=lambda part: len(part.converged), unit="records")
        return reduce(Refined.beside, parts)

    def _refine_block(self, objective: Objective, start: Array) -> Refined:
        """Refine rows; where those of a reduced model end outside its box, the full model takes the last steps."""
        found = refine(objective, start, self.n_steps, sorts=self._sorts)
        if self.simulator.reduced is not None:
            outside = np.flatnonzero(self.simulator.outside(np.exp(found.local.x)))
            if outside.size:
                exact = replace(objective.of(outside), linearise=self._by(Simulator(self.simulator.model)))
                last = minimise(exact, found.local.x[outside], self.n_steps)
                last.full_solves += last.solves
                last.solves += found.solves[outside]
                found.put(outside, last)
        return found

    @property
    def _sorts(self) -> bool:
        return not getattr(self.simulator.model, "track", False)

    def _with_shapes(self, noise: Array) -> Array:
        """Standard deviations of all observations, (n_samples, n_observations), given those of ln f."""
        if self.shapes is None:
            return noise
        return np.hstack([noise, np.tile(self.shapes.deviations, (len(noise), 1))])

    def _contradicts(self, x: Array, deviations: Array) -> NDArray[np.bool_]:
        """Whether ln theta is farther from the prior's mean than data from the prior can bring it.

        The share of the prior's variance that a row explains is 1 - (deviation / width)^2. The variance of posterior
        modes is that share of the prior's; the variance of exact inversions is the prior's over that share.
        """
        explained = np.maximum(1 - (deviations / self.prior.width) ** 2, TINY_SHARE)
        expected = self.prior.width * (np.sqrt(explained) if self.noise.all() else 1 / np.sqrt(explained))
        return np.abs(x - self.prior.mean) > FAR_OUTSIDE * expected

    def estimated_scatter(self, inputs: Array, guess: Array) -> Array:
        """The noise of each mode; where it is 0, what exact parameters leave of complete records, with more modes than
        parameters."""
        n_modes, n_parameters = len(self.noise), guess.shape[1]
        if self.noise.all():
            return self.noise
        rows = spread_evenly(np.flatnonzero(~np.isnan(inputs).any(axis=1)), ROWS_FOR_SCATTER)
        scatter = ASSUMED_SCATTER
        if n_modes > n_parameters and rows.size:
            exact = np.maximum(self.noise, EXACT)
            residuals = self.refined(inputs[rows], guess[rows], exact, remember=True).residuals
            residuals = residuals[~np.isnan(residuals).any(axis=1)]
            if len(residuals) > n_parameters:
                estimate = np.sqrt((robust_deviation(residuals) ** 2).sum() / (n_modes - n_parameters))
                scatter = min(max(estimate, EXACT), LARGEST_SCATTER)
        return np.where(self.noise > 0, self.noise, scatter)
