"""How probable measured shifts are, given the effects of some causes with unknown amounts."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy import stats
from scipy.linalg import block_diag
from scipy.special import logsumexp

from skthermo._tables.arrays import Array
from skthermo.studies.identification._boxes import log_marginal, log_probability

ELSE_SIZES = 0.0005 * 4.0 ** np.arange(5)  # relative shifts by which something else may move the modes
ERROR_FACTORS = np.array([1 / 3, 1.0, 3.0])  # of the model's error, which is not well known either
COMMON_SHARE = 0.3  # share of the mean square of all shifts in the error of the model's effect on one of them
FARTHEST = 1e-6  # probability of scales of Student's law beyond the smallest one that counts
WIDTHS = 1.5  # standard deviations of the posterior of ln scale between two of them
NEGLIGIBLE = 18.0  # difference of a logarithm of a probability below which a term adds nothing
SWEEPS = 25  # steps of a search along each amount in turn


@dataclass(frozen=True)
class Observed:
    """Measured shifts and their errors in coordinates in which these are independent, with unit variance.

    ``rotation`` leads to them. There, ``elsewhere`` (n_observed,) are the variances of a shift by something else of
    size 1, and ``of_model`` the part of the unit variance that is the model's error. Errors of those coordinates that
    ``is_scaled`` marks follow Student's law, as a mixture of normal laws whose precisions are ``scales`` times 1, with
    the logarithms of their weights, ``log_scales``.
    """

    measured: Array
    rotation: Array
    elsewhere: Array
    of_model: Array
    is_scaled: Array
    scales: Array
    log_scales: Array

    @classmethod
    def of(cls, parts: list[tuple[Array, Array, float]], model_error: float = 0.0) -> Observed:
        """Of parts with measured shifts, their covariance, and the freedom of their errors.

        The model is wrong by a share of what it explains, which is about what was measured.
        """
        rotations, variances, of_model = [], [], []
        for measured, covariance, _ in parts:
            squares = (1 - COMMON_SHARE) * measured**2 + COMMON_SHARE * (measured**2).mean()
            squares *= model_error**2
            values, vectors = np.linalg.eigh(covariance + np.diag(squares))
            of_model.append((vectors**2).T @ squares / values)
            rotations.append((vectors / np.sqrt(values)).T)
            variances.append(1 / values)
        is_scaled = np.concatenate([np.full(len(part[0]), np.isfinite(part[2])) for part in parts])
        freedom = min(part[2] for part in parts)
        scales, log_scales = student_scales(freedom, int(is_scaled.sum()))
        rotation = block_diag(*rotations)
        measured = rotation @ np.concatenate([part[0] for part in parts])
        return cls(
            measured, rotation, np.concatenate(variances), np.concatenate(of_model), is_scaled, scales, log_scales
        )

    def variances(self, sizes: Array, factors: Array) -> Array:
        """Variances with something else of some sizes and the model's error times factors, (n_errors, n_observed)."""
        return 1 + sizes[:, np.newaxis] ** 2 * self.elsewhere + (factors[:, np.newaxis] ** 2 - 1) * self.of_model


def student_scales(freedom: float, n_observed: int) -> tuple[Array, Array]:
    """Precisions of normal laws that mix to Student's, and the logarithms of their weights."""
    if not np.isfinite(freedom):
        return np.ones(1), np.zeros(1)
    law = stats.gamma(freedom / 2, scale=2 / freedom)
    lowest, highest = np.log(law.ppf(FARTHEST)), np.log(law.isf(FARTHEST**2))
    number = int(np.ceil((highest - lowest) / (WIDTHS * np.sqrt(2 / (freedom + n_observed))))) + 1
    steps = np.linspace(lowest, highest, number)
    logs = law.logpdf(np.exp(steps)) + steps
    return np.exp(steps), logs - logsumexp(logs)


@dataclass(frozen=True)
class Amounts:
    """Law of the amounts of the causes of each of some sets before the records are seen: normal, within bounds.

    Arrays of shape (n_sets, n_causes of a set).
    """

    deviations: Array
    lowest: Array
    highest: Array

    @property
    def precisions(self) -> Array:
        return self.deviations**-2

    def log_inside(self) -> Array:
        """Logarithm of the probability of the bounds, (n_sets,)."""
        sides = [stats.norm.cdf(bound / self.deviations) for bound in (self.highest, self.lowest)]
        return np.log(sides[0] - sides[1]).sum(axis=-1)


def most_probable(slopes: Array, target: Array, variances: Array, law: Amounts) -> Array:
    """Amounts within their bounds, (n_sets, n_errors, k), of linear effects (n_sets, n_errors, n_observed, k)."""
    weighted = slopes / variances[..., np.newaxis]
    inner = np.swapaxes(weighted, -1, -2) @ slopes
    size = inner.shape[-1]
    inner = inner + law.precisions[:, np.newaxis, :, np.newaxis] * np.eye(size)
    right = (weighted * target[..., np.newaxis]).sum(axis=-2)
    found = np.zeros_like(right)
    for _ in range(SWEEPS if size > 1 else 1):
        for i in range(size):
            rest = right[..., i] - (inner[..., i, :] * found).sum(axis=-1) + inner[..., i, i] * found[..., i]
            found[..., i] = np.clip(
                rest / inner[..., i, i], law.lowest[:, np.newaxis, i], law.highest[:, np.newaxis, i]
            )
    return found


def weighed(
    observed: Observed, slopes: Array, target: Array, variances: Array, law: Amounts, log_prior: Array
) -> tuple[Array, Array, Array]:
    """Log evidence of linear effects, (n_sets, n_errors, n_scales), and means and covariances of amounts, normal laws.

    These have one or two axes more, for the causes of a set, and end at the bounds. ``log_prior``, (n_sets, n_errors),
    counts in what may be neglected, and not in the evidence.
    """
    size = slopes.shape[-1]
    own = np.where(observed.is_scaled, 1 - observed.of_model, 0.0)  # without the model's error
    inverse = own * (1 / observed.scales[:, np.newaxis] - 1)  # what a scale adds
    spread = variances[:, :, np.newaxis, :] + inverse
    weighted = slopes[:, :, np.newaxis] / spread[..., np.newaxis]
    inner = np.swapaxes(weighted, -1, -2) @ slopes[:, :, np.newaxis]
    inner = inner + law.precisions[:, np.newaxis, np.newaxis, :, np.newaxis] * np.eye(size)
    right = (weighted * target[:, :, np.newaxis, :, np.newaxis]).sum(axis=-2)
    covariances = np.linalg.inv(inner)
    means = (covariances @ right[..., np.newaxis])[..., 0]
    logs = observed.log_scales - (np.log(2 * np.pi * spread) + target[:, :, np.newaxis] ** 2 / spread).sum(axis=-1) / 2
    logs = logs + ((right * means).sum(axis=-1) - np.linalg.slogdet(inner)[1]) / 2
    logs = logs + (np.log(law.precisions).sum(axis=-1) / 2 - law.log_inside())[:, np.newaxis, np.newaxis]
    # the probability of the bounds only lowers them, and is at most that of any one of them
    most = logs + log_prior[..., np.newaxis]
    where = np.nonzero(most > most.max() - NEGLIGIBLE)
    lowest, highest = law.lowest[where[0]], law.highest[where[0]]
    one = log_marginal(means[where], covariances[where], lowest, highest)
    most[where] += one
    kept = most[where] > most[where].max() - NEGLIGIBLE
    where = tuple(place[kept] for place in where)
    inside = log_probability(means[where], covariances[where], lowest[kept], highest[kept])
    log_evidence = np.full(logs.shape, -np.inf)
    log_evidence[where] = logs[where] + inside
    return log_evidence, means, covariances
