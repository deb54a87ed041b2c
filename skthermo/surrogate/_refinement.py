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

EXACT, EXACT_WITH_GAPS = 1e-6, 1e-3
"""Relative standard deviation of frequencies that count as exact. Where modes are missing, the parameters that fit the
others lie on a curve, which steps cannot follow if nothing may leave it."""


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

    def refined(self, frequencies: Array, guess: Array) -> Bunch:
        """Parameters, standard deviations, misfits and convergence of rows of frequencies.

        A row that does not converge keeps its guess, if it has one, and the standard deviation of the prior.
        """
        some, gaps = ~np.isnan(frequencies).all(axis=1), np.isnan(frequencies).any(axis=1)
        theta, std = np.full((2, *guess.shape), np.nan)
        misfit, converged = np.full(len(guess), np.nan), np.zeros(len(guess), dtype=bool)
        if some.any():
            prior, measured = self.prior, np.log(frequencies[some])
            noise = np.maximum(self.noise, np.where(gaps, EXACT_WITH_GAPS, EXACT)[some, np.newaxis])
            start = np.where(np.isnan(guess[some]), prior.mean, np.log(guess[some]))
            objective = Objective(partial(self.simulator.linearise, n_jobs=self.n_jobs), measured, noise, prior)
            sorts = not getattr(self.simulator.model, "track", False)
            found = refine(objective, np.clip(start, prior.lowest, prior.highest), self.n_steps, sorts=sorts)
            done = found.converged[:, np.newaxis]
            theta[some] = np.where(done, np.exp(found.x), guess[some])
            std[some] = np.where(done, found.std, prior.width) * theta[some]
            misfit[some], converged[some] = found.misfit, found.converged
        return Bunch(theta=theta, std=std, misfit=misfit, converged=converged)
