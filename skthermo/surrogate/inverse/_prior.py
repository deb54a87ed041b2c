"""The prior of parameters, and the noise of frequencies, that records teach."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from skthermo._tables.arrays import Array, robust_deviation
from skthermo._tables.text import listed, percent
from skthermo.surrogate.inverse._steps import Local, information

FIRST_DEVIATION, FIRST_NOISE = 0.03, 0.01  # of ln theta and of ln f, before records are known
MOVED = 1e-3, 3.0  # range of the deviations of ln theta
LEAST_NOISE, MOST_NOISE = 1e-5, 0.3  # range of the noise
SHARE_OF_STEPS = 0.1  # least noise as a share of the scatter of the differences of successive records
FAR = 5.0  # standard deviations beyond which a frequency teaches nothing


@dataclass(frozen=True)
class ThermalPrior:
    """Gaussian prior of ln theta about the nominal state, N(0, common^2 11' + diag(own^2)).

    ``common`` is the standard deviation of a factor of all parameters, ``own`` those of each parameter by itself.
    """

    names: tuple[str, ...]
    common: float
    own: Array

    @property
    def covariance(self) -> Array:
        """Of ln theta, (n_parameters, n_parameters)."""
        return self.common**2 + np.diag(self.own**2)

    @property
    def precision(self) -> Array:
        """The inverse of the covariance."""
        weights = self.own**-2.0
        together = self.common**2 / (1 + self.common**2 * weights.sum())
        return np.diag(weights) - together * np.outer(weights, weights)

    @property
    def deviations(self) -> Array:
        """Standard deviations of ln theta, (n_parameters,)."""
        return np.sqrt(np.diag(self.covariance))

    @classmethod
    def first(cls, names: Sequence[str]) -> ThermalPrior:
        """Before records are known."""
        return cls(tuple(names), FIRST_DEVIATION, np.full(len(names), FIRST_DEVIATION))

    def __str__(self) -> str:
        own = listed(
            [f"{name!r} by itself by {percent(size, '.2g')}" for name, size in zip(self.names, self.own, strict=True)]
        )
        together = f"all stiffness together by {percent(self.common, '.2g')}, " if self.common else ""
        return f"temperature moves {together}{own} (standard deviations)".replace("\N{NO-BREAK SPACE}", " ")


@dataclass(frozen=True)
class LinearRecords:
    """Records by a model that was linearised near their ln theta: observation = J ln theta + noise, NaN where missing.

    ``values`` are (n_records, n_observations), ``slopes`` J (n_records, n_observations, n_parameters).
    """

    values: Array
    slopes: Array

    @classmethod
    def of(cls, local: Local, missing: NDArray[np.bool_]) -> LinearRecords:
        """Of an objective and its linear model at some ln theta."""
        values = local.residual + np.einsum("smp,sp->sm", local.sensitivity, local.x)
        usable = ~missing & np.isfinite(values) & np.isfinite(local.sensitivity).all(axis=2)
        return cls(np.where(usable, values, np.nan), np.where(usable[:, :, np.newaxis], local.sensitivity, 0.0))

    def near(self, prior: ThermalPrior, noise: Array) -> LinearRecords:
        """Those without observations that are far from what prior and noise make probable."""
        variances = np.einsum("smp,pq,smq->sm", self.slopes, prior.covariance, self.slopes) + noise**2
        with np.errstate(invalid="ignore"):
            return LinearRecords(np.where(self.values**2 <= FAR**2 * variances, self.values, np.nan), self.slopes)

    def posterior(self, prior: ThermalPrior, noise: Array) -> tuple[Array, Array]:
        """Means, (n_records, n_parameters), and covariances of ln theta given each record."""
        known = ~np.isnan(self.values)
        spread = np.where(known, noise, np.inf)
        covariances = np.linalg.inv(information(self.slopes, spread, prior.precision))
        pulls = np.einsum("smp,sm->sp", self.slopes, np.where(known, self.values, 0.0) / spread**2)
        return np.einsum("spq,sq->sp", covariances, pulls), covariances

    def learned(
        self, prior: ThermalPrior, noise: Array, least: Array, *, learns_prior: bool, learns_noise: NDArray[np.bool_]
    ) -> tuple[ThermalPrior, Array]:
        """The most likely prior and noise, from given ones.

        Noise is that of each observation, (n_observations,), and no smaller than the least. What the model cannot
        follow counts as noise.
        """
        n_own = 1 + len(prior.own)

        def read(logs: Array) -> tuple[ThermalPrior, Array]:
            values, found = np.exp(logs), noise.copy()
            found[learns_noise] = values[n_own * learns_prior :]
            return ThermalPrior(prior.names, values[0], values[1:n_own]) if learns_prior else prior, found

        def loss(logs: Array) -> tuple[float, Array]:
            likelihood, of_prior, of_noise = self._likelihood(*read(logs))
            return -likelihood, -np.append(of_prior if learns_prior else [], of_noise[learns_noise])

        learns_noise = learns_noise & ~np.isnan(self.values).all(axis=0)
        start = np.log(np.append([prior.common, *prior.own] if learns_prior else [], noise[learns_noise]))
        if not len(start):
            return prior, noise
        noisy = [(one, MOST_NOISE) for one in least[learns_noise]]
        bounds = np.log([MOVED] * (n_own * learns_prior) + noisy)
        return read(minimize(loss, start, jac=True, method="L-BFGS-B", bounds=bounds).x)

    def _likelihood(self, prior: ThermalPrior, noise: Array) -> tuple[float, Array, Array]:
        """Logarithm of the likelihood, and its derivatives by those of the deviations of the prior and of the noise.

        The derivatives are those expected given each record (Fisher's identity).
        """
        known, precision = ~np.isnan(self.values), prior.precision
        x, covariances = self.posterior(prior, noise)
        values, spread = np.where(known, self.values, 0.0), np.where(known, noise, np.inf)
        left = values - np.einsum("smp,sp->sm", self.slopes, x)
        variances = np.einsum("smp,spq,smq->sm", self.slopes, covariances, self.slopes)
        volumes = np.linalg.slogdet(covariances)[1].sum() + len(x) * np.linalg.slogdet(precision)[1]
        squares = ((left / spread) ** 2).sum() + np.einsum("sp,pq,sq->", x, precision, x)
        likelihood = 0.5 * (volumes - squares) - (known @ np.log(noise)).sum()
        moments = x.T @ x + covariances.sum(axis=0)
        slope = precision @ moments @ precision - len(x) * precision
        of_prior = np.append(prior.common**2 * slope.sum(), prior.own**2 * np.diag(slope))
        of_noise = (np.where(known, left**2 + variances, 0.0) / noise**2 - known).sum(axis=0)
        return float(likelihood), of_prior, of_noise


def least_noise(log_frequencies: Array) -> Array:
    """A lower limit of the noise of each mode, from records in their order, (n_modes,).

    A mode that a parameter of its own can follow would otherwise count as exact.
    """
    steps = robust_deviation(np.diff(log_frequencies, axis=0)) if len(log_frequencies) > 1 else np.zeros(1)
    share = SHARE_OF_STEPS / np.sqrt(2) * np.nan_to_num(steps)
    return np.clip(np.broadcast_to(share, log_frequencies.shape[1:]), LEAST_NOISE, MOST_NOISE / 2)
