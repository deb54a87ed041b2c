"""Estimates of the inverse surrogate, refined on the FE model."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from sklearn.utils import Bunch

from skthermo._arrays import Array
from skthermo.fem import check_bounds, check_noise, check_prior
from skthermo.surrogate._posterior import Local, Objective, Prior
from skthermo.surrogate._refine import refine
from skthermo.surrogate._simulator import Simulator

DEFAULT_STEPS = 40

ENOUGH = 365
"""Number of records that an estimate of their scatter needs at most."""

EXACT, EXACT_WITH_GAPS = 1e-6, 1e-3
"""Relative standard deviation of frequencies that count as exact. Where modes are missing, the parameters that fit the
others lie on a curve, which steps cannot follow if nothing may leave it."""

FARTHEST = 5.0
"""Largest step of ln theta without the prior; beyond it only its direction matters."""

LARGEST = 0.02
"""Scatter above which a misfit counts as a wrong model rather than noise."""

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
        """What `InverseSurrogate.invert` gives, for rows of frequencies and the regressor's guess."""
        some, gaps = ~np.isnan(frequencies).all(axis=1), np.isnan(frequencies).any(axis=1)
        result = Bunch(
            theta=np.full_like(guess, np.nan),
            std=np.full_like(guess, np.nan),
            residuals=np.full_like(frequencies, np.nan),
            weight=np.zeros(len(guess)),
            converged=np.zeros(len(guess), dtype=bool),
            likeliest=np.full_like(guess, np.nan),
            doubt=np.full_like(guess, np.nan),
        )
        if not some.any():
            return result
        prior, measured, guess = self.prior, np.log(frequencies[some]), guess[some]
        noise = np.maximum(self.noise, np.where(gaps, EXACT_WITH_GAPS, EXACT)[some, np.newaxis])
        start = np.clip(np.where(np.isnan(guess), prior.mean, np.log(guess)), prior.lowest, prior.highest)
        objective = Objective(partial(self.simulator.linearise, n_jobs=self.n_jobs), measured, noise, prior)
        sorts = not getattr(self.simulator.model, "track", False)
        found, converged, stalled = refine(objective, start, self.n_steps, sorts=sorts)
        lost, complete = stalled[:, np.newaxis], np.maximum(noise, scatter)
        deviations, at_best = (
            prior.deviations(found.sensitivity, spread)
            for spread in (np.where(np.isnan(measured), np.inf, complete), complete)
        )
        result.theta[some] = np.where(lost, guess, np.exp(found.x))
        result.std[some] = np.where(lost, prior.width, deviations) * result.theta[some]
        result.residuals[some] = np.where(lost | np.isnan(measured), np.nan, found.residual)
        result.weight[some] = ((at_best / deviations) ** 2).mean(axis=1)
        result.converged[some] = converged
        step, result.doubt[some] = without_prior(found, scatter)
        result.likeliest[some] = np.exp(found.x + step)
        result.likeliest[gaps] = np.nan
        return result

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
            residuals = self.refined(frequencies[rows], guess[rows], np.maximum(self.noise, EXACT)).residuals
            scatter = np.sqrt(np.nanvar(residuals, axis=0).sum() / (n_modes - n_parameters))
            scatter = min(max(scatter, EXACT), LARGEST)
        return np.where(self.noise > 0, self.noise, scatter)


def without_prior(found: Local, scatter: Array) -> tuple[Array, Array]:
    """A Gauss-Newton step of ln theta that leaves the prior out, and standard deviations of where it leads."""
    weighted = found.sensitivity / scatter[:, np.newaxis]
    inverse = np.linalg.pinv(np.nan_to_num(weighted))
    step = (inverse @ (found.residual / scatter)[:, :, np.newaxis])[:, :, 0]
    return np.clip(step, -FARTHEST, FARTHEST), np.sqrt((inverse**2).sum(axis=2))
