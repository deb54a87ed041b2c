"""Estimates of the inverse surrogate, refined on the FE model."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from sklearn.utils import Bunch

from skthermo._arrays import Array
from skthermo.fem import check_bounds, check_noise, check_prior
from skthermo.surrogate._posterior import Objective, Prior
from skthermo.surrogate._refine import refine
from skthermo.surrogate._simulator import Simulator

DEFAULT_STEPS = 40

ENOUGH = 365
"""Number of records that an estimate of their scatter needs at most."""

EXACT, EXACT_WITH_GAPS = 1e-6, 1e-3
"""Relative standard deviation of frequencies that count as exact. Where modes are missing, the parameters that fit the
others lie on a curve, which steps cannot follow if nothing may leave it."""

ASSUMED = 1e-3
"""Noise on which standard deviations are based where it is neither given nor can be estimated."""


@dataclass(frozen=True)
class Refinement:
    """Posterior modes of the parameters of measured frequencies.

    Attributes
    ----------
    simulator : Simulator
        Gives frequencies and derivatives.
    noise : ndarray of shape (n_modes,)
        Relative standard deviations of the frequencies.
    prior : Prior
        Of ln theta.
    n_steps : int
        Largest number of steps for each row.
    n_jobs : int or None
        Number of parallel jobs.
    """

    simulator: Simulator
    noise: Array
    prior: Prior
    n_steps: int
    n_jobs: int | None

    @classmethod
    def of(cls, inverse: Any) -> "Refinement":
        """The refinement that the parameters of an `InverseSurrogate` ask for."""
        names = inverse.model.parameter_names
        width = None if inverse.prior is None else check_prior(inverse.prior, names)
        prior = Prior.of_box(check_bounds(inverse.bounds, names), width)
        noise = check_noise(inverse.noise, inverse.model.n_modes)
        return cls(inverse.simulator_, noise, prior, inverse.n_steps_, inverse.n_jobs)

    def refined(self, frequencies: Array, guess: Array, scatter: Array) -> Bunch:
        """Parameters, standard deviations given the scatter, residuals and convergence of rows of frequencies.

        A row that does not converge keeps its guess, if it has one, and the standard deviation of the prior.
        """
        some, gaps = ~np.isnan(frequencies).all(axis=1), np.isnan(frequencies).any(axis=1)
        theta, std = np.full((2, *guess.shape), np.nan)
        residuals, converged = np.full(frequencies.shape, np.nan), np.zeros(len(guess), dtype=bool)
        if some.any():
            prior, measured = self.prior, np.log(frequencies[some])
            noise = np.maximum(self.noise, np.where(gaps, EXACT_WITH_GAPS, EXACT)[some, np.newaxis])
            start = np.where(np.isnan(guess[some]), prior.mean, np.log(guess[some]))
            objective = Objective(partial(self.simulator.linearise, n_jobs=self.n_jobs), measured, noise, prior)
            sorts = not getattr(self.simulator.model, "track", False)
            found, done = refine(objective, np.clip(start, prior.lowest, prior.highest), self.n_steps, sorts=sorts)
            deviations = prior.deviations(found.sensitivity, np.maximum(noise, scatter))
            theta[some] = np.where(done[:, np.newaxis], np.exp(found.x), guess[some])
            std[some] = np.where(done[:, np.newaxis], deviations, prior.width) * theta[some]
            residuals[some] = np.where(np.isnan(measured) | ~done[:, np.newaxis], np.nan, found.residual)
            converged[some] = done
        return Bunch(theta=theta, std=std, residuals=residuals, converged=converged, stalled=some & ~converged)

    def estimated_scatter(self, frequencies: Array, guess: Array) -> Array:
        """The noise of each mode; where it is 0, estimated from what exact parameters leave of complete records.

        Records can tell only if there are more modes than parameters, and are not exact themselves.
        """
        n_modes, n_parameters = len(self.noise), guess.shape[1]
        if self.noise.all():
            return self.noise
        rows = np.flatnonzero(~np.isnan(frequencies).any(axis=1))
        rows = rows[np.unique(np.linspace(0, len(rows) - 1, min(len(rows), ENOUGH)).astype(int))] if rows.size else rows
        scatter = ASSUMED
        if n_modes > n_parameters and len(rows) > n_parameters:
            residuals = self.refined(frequencies[rows], guess[rows], self.noise).residuals
            scatter = np.sqrt(np.nanvar(residuals, axis=0).sum() / (n_modes - n_parameters))
        return np.where(self.noise > 0, self.noise, scatter)
