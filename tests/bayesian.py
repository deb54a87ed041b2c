"""A small regressor that knows how uncertain it is."""

import numpy as np
import pandas as pd
from sklearn.base import BaseEstimator, RegressorMixin

MEAN, WIDTH = np.array([1.0, -0.02, 0.01, 0.0]), np.array([0.03, 0.01, 0.01, 0.01])
"""Of the coefficients of many bridges."""

NOISE = 0.003


def basis(X, knots=(5.0, 15.0)):
    """A constant and piecewise-linear functions of the mean temperature, in units of ten degrees."""
    mean = np.asarray(X, dtype=float).mean(axis=1)
    return np.column_stack([np.ones(len(mean)), mean / 10, *(np.maximum(mean - knot, 0) / 10 for knot in knots)])


class Logs(RegressorMixin, BaseEstimator):
    """ln y = basis(X) beta + noise with beta ~ N(mean, diag(width^2)): posterior mean, and no word of the rest."""

    def __init__(self, mean=0.0, width=1.0, noise=0.01, share=1.0):
        self.mean = mean
        self.width = width
        self.noise = noise
        self.share = share

    def fit(self, X, y, sample_weight=None):
        B, logs = basis(X), np.log(np.asarray(y, dtype=float))
        self.is_single_ = logs.ndim == 1
        logs = logs.reshape(len(B), -1)
        start = np.reshape(self.mean, (-1, 1)) * np.ones((B.shape[1], 1))
        prior = np.diag(np.broadcast_to(np.asarray(self.width, dtype=float) ** -2.0, (B.shape[1],)))
        self.covariance_ = np.linalg.inv(B.T @ B / self.noise**2 + prior)
        self.coef_ = start + self.covariance_ @ B.T @ (logs - B @ start) / self.noise**2
        return self

    def predict(self, X):
        values = np.exp(basis(X) @ self.coef_)
        return values[:, 0] if self.is_single_ else values


class BayesianLogs(Logs):
    """The same with a share of its covariance."""

    def predict(self, X, return_std=False):
        values = super().predict(X)
        if not return_std:
            return values
        B = basis(X)
        variances = self.share * np.einsum("ij,jk,ik->i", B, self.covariance_, B)
        deviations = np.sqrt(variances)[:, np.newaxis] * np.exp(B @ self.coef_)
        return values, deviations[:, 0] if self.is_single_ else deviations


def weather(days, seed=0, start="2025-01-01"):
    """Daily temperatures of two sensors on stamps: seasons and weather that lasts for days."""
    rng, stamps = np.random.default_rng(seed), pd.date_range(start, periods=days, freq="D")
    season = 10 - 12 * np.cos(2 * np.pi * (stamps.day_of_year.to_numpy() - 20) / 365.25)
    spells = np.zeros(days)
    for day in range(1, days):
        spells[day] = 0.8 * spells[day - 1] + 2.0 * rng.standard_normal()
    both = season + spells
    return pd.DataFrame({"T1": both, "T2": both + rng.standard_normal(days)}, index=stamps)


def records_of(seed, days, root):
    """Daily records of a bridge of that fleet, with noise of some root of its covariance; in winter first."""
    rng, T = np.random.default_rng(seed), weather(days, seed)
    beta = MEAN[:, None] + WIDTH[:, None] * rng.standard_normal((4, len(root)))
    F = np.exp(basis(T) @ beta) * (1 + NOISE * rng.standard_normal((days, len(root))) @ root.T)
    return T.join(pd.DataFrame(F, T.index, [f"f{mode + 1}" for mode in range(len(root))]))
