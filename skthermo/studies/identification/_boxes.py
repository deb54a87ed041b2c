"""Normal laws of one to three dimensions within bounds: their probability, and draws."""

import numpy as np
from scipy.special import log_ndtr, ndtri_exp

from skthermo._tables.arrays import Array

N_NODES = 12  # quadrature nodes in each dimension but the last
NODES, WEIGHTS = np.polynomial.legendre.leggauss(N_NODES)
NODES, WEIGHTS = (NODES + 1) / 2, WEIGHTS / 2


def log_probability(mean: Array, covariance: Array, lowest: Array, highest: Array) -> Array:
    """Logarithm of the probability that a normal vector is within bounds, (...,), for arrays (..., k).

    The variables are integrated one after the other, each given those before (Genz); nodes are shares of the
    probability of each interval, so that bounds far out in the tail are no harder than others.
    """
    shape, size = mean.shape[:-1], mean.shape[-1]
    if size == 0:
        return np.zeros(shape)
    grid = np.meshgrid(*[NODES] * (size - 1), indexing="ij")
    shares = np.stack([axis.ravel() for axis in grid]) if grid else np.zeros((0, 1))
    weights = np.prod(np.stack(np.meshgrid(*[WEIGHTS] * (size - 1), indexing="ij")), axis=0).ravel() if grid else 1.0
    logs = _sequence(mean, covariance, lowest, highest, shares)[1]
    largest = logs.max(axis=-1)
    return largest + np.log((weights * np.exp(logs - largest[..., np.newaxis])).sum(axis=-1))


def log_marginal(mean: Array, covariance: Array, lowest: Array, highest: Array) -> Array:
    """Logarithm of the smallest probability of a single variable to be within its bounds, (...,)."""
    scale = np.sqrt(np.diagonal(covariance, axis1=-2, axis2=-1))
    return _log_between((lowest - mean) / scale, (highest - mean) / scale)[0].min(axis=-1, initial=0.0)


def draws(
    mean: Array, covariance: Array, lowest: Array, highest: Array, random: np.random.RandomState
) -> tuple[Array, Array]:
    """One draw of each of several normal laws within bounds, (n, k), and the logarithms of its weights, (n,)."""
    shares = random.uniform(size=(mean.shape[-1], len(mean), 1))
    values, logs = _sequence(mean, covariance, lowest, highest, shares)
    return values[..., 0], logs[..., 0]


def _sequence(mean: Array, covariance: Array, lowest: Array, highest: Array, shares: Array) -> tuple[Array, Array]:
    """Values at shares of the probability of each interval given the values before, and the logs of their product."""
    factor = np.linalg.cholesky(covariance)
    size, known = mean.shape[-1], []
    total = np.zeros((*mean.shape[:-1], shares.shape[-1]))
    for i in range(size):
        shift = mean[..., i, np.newaxis] + sum(
            (factor[..., i, j, np.newaxis] * known[j] for j in range(i)), np.zeros_like(total)
        )
        scale = factor[..., i, i, np.newaxis]
        lower, upper = (lowest[..., i, np.newaxis] - shift) / scale, (highest[..., i, np.newaxis] - shift) / scale
        inside, below, lower, upper, flipped = _log_between(lower, upper)
        total = total + inside
        if i < len(shares):
            share = np.where(flipped, 1 - shares[i], shares[i])
            value = ndtri_exp(np.logaddexp(below, np.log(share) + inside))
            value = np.clip(value, lower, upper)
            known.append(np.where(flipped, -value, value))
    if not known:
        return np.zeros((*total.shape[:-1], 0, total.shape[-1])), total
    standard = np.stack(known, axis=-2)
    n = standard.shape[-2]
    return mean[..., :n, np.newaxis] + factor[..., :n, :n] @ standard, total


def _log_between(lower: Array, upper: Array) -> tuple[Array, Array, Array, Array, Array]:
    """Logarithm of a standard normal probability, by the lower tail, with the bounds there and what was turned."""
    flipped = lower > 0  # the lower tail is the one with accurate logarithms
    lower, upper = np.where(flipped, -upper, lower), np.where(flipped, -lower, upper)
    below, above = log_ndtr(lower), log_ndtr(upper)
    return above + np.log(-np.expm1(np.minimum(below - above, -1e-300))), below, lower, upper, flipped
