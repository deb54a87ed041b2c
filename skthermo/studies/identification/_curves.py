"""Measured shifts in coordinates with independent errors, and the effects of causes on them, exact and tabulated."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import stats
from scipy.linalg import block_diag
from scipy.special import logsumexp

from skthermo._core.arrays import Array
from skthermo.studies.identification._causes import Cause

Effects = Callable[[Array], tuple[Array, Array]]

SHARES = np.array([0.0, 1 / 6, 1 / 3, 1 / 2, 2 / 3, 5 / 6, 11 / 12, 1.0])  # of the bounds, where effects are tabulated
LOGARITHMS = -np.log1p([0.0, -0.3, -0.6, -0.9])  # of 1 / (1 - severity), between which effects of damage are smooth
N_SMALL = 3  # nodes that all causes have; those of larger amounts are computed for causes that need them
COMMON_SHARE = 0.3  # share of the mean square of all shifts in the error of the model's effect on one of them
FARTHEST = 1e-6  # probability of scales of Student's law beyond the smallest one that counts
WIDTHS = 1.5  # standard deviations of the posterior of ln scale between two of them


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
class Part:
    """Shifts of one kind, of frequencies or of mode shapes: NaN where nothing was measured; (n_observed,) each.

    Effects are a function from amounts of all causes, (..., n_causes), to the change and its derivatives. Errors follow
    Student's law with ``freedom``.
    """

    effects: Effects
    measured: Array
    covariance: Array
    freedom: float = np.inf

    @property
    def known(self) -> NDArray[np.intp]:
        return np.flatnonzero(~np.isnan(self.measured))


@dataclass(frozen=True)
class ShiftComparison:
    """All measured shifts, and the effects of all causes on them."""

    parts: list[Part]

    def observed(self, model_error: float = 0.0) -> Observed:
        return Observed.of(
            [(p.measured[p.known], p.covariance[np.ix_(p.known, p.known)], p.freedom) for p in self.parts],
            model_error,
        )

    def effects(self, amounts: Array) -> tuple[Array, Array]:
        """Changes, (..., n_observed), and their derivatives, (..., n_observed, n_causes)."""
        solved = [part.effects(amounts) for part in self.parts]
        changes = [change[..., part.known] for (change, _), part in zip(solved, self.parts, strict=True)]
        slopes = [slope[..., part.known, :] for (_, slope), part in zip(solved, self.parts, strict=True)]
        return np.concatenate(changes, axis=-1), np.concatenate(slopes, axis=-2)

    def slopes(self, n_causes: int) -> Array:
        """Effects of small amounts in standard errors, (n_observed, n_causes)."""
        return self.observed().rotation @ self.effects(np.zeros(n_causes))[1]


@dataclass(frozen=True)
class Curves:
    """Effects of single causes, tabulated, in the coordinates of what was observed; those of several are added.

    ``values`` and ``slopes``, (n_causes, n_nodes, n_observed), are those at the ``nodes``: shares of the ``bounds``, or
    logarithms of 1 / (1 - severity) where there are none. Beyond a third of the bound they are extrapolated unless
    ``is_whole``. ``first``, (n_observed, n_causes), are the derivatives of what was observed itself, where nothing has
    changed.
    """

    nodes: Array
    bounds: Array | None
    values: Array
    slopes: Array
    first: Array
    is_whole: NDArray[np.bool_]

    @classmethod
    def of(cls, effects: Effects, causes: Sequence[Cause], observed: Observed) -> Curves:
        """Curves of exact effects of small amounts."""
        bounds = np.array([cause.highest if cause.highest > 0 else cause.lowest for cause in causes])
        columns = np.arange(len(causes))
        solved, slopes = effects(np.vstack([np.zeros(len(causes)), _alone(bounds, columns, SHARES[1:N_SMALL])]))
        values = np.zeros((len(causes), len(SHARES), solved.shape[1]))
        tangents = np.zeros_like(values)
        tangents[:, 0] = slopes[0].T * bounds[:, np.newaxis]
        values[:, 1:N_SMALL], tangents[:, 1:N_SMALL] = _by_share(solved[1:], slopes[1:], bounds, columns)
        beyond = (SHARES[N_SMALL:] - SHARES[N_SMALL - 1])[:, np.newaxis]
        last = tangents[:, N_SMALL - 1 : N_SMALL]
        values[:, N_SMALL:] = values[:, N_SMALL - 1 : N_SMALL] + beyond * last
        tangents[:, N_SMALL:] = last
        turned = (array @ observed.rotation.T for array in (values, tangents))
        return cls(SHARES, bounds, *turned, slopes[0], np.zeros(len(causes), dtype=bool))

    @classmethod
    def of_stretches(cls, effects: Effects, incidence: NDArray[np.bool_], rotation: Array) -> Curves:
        """Of causes that each damage some groups by one severity; incidence is (n_causes, n_groups)."""
        n_causes, n_groups = incidence.shape
        severities = -np.expm1(-LOGARITHMS[1:, np.newaxis])
        sets = (incidence[:, np.newaxis] * severities).reshape(-1, n_groups)
        changes, slopes = effects(np.vstack([np.zeros((1, n_groups)), sets]))
        first, by_logarithm = slopes[0] @ incidence.T, slopes[1:] * (1 - sets)[:, np.newaxis]
        own = by_logarithm.reshape(n_causes, len(severities), -1, n_groups) * incidence[:, np.newaxis, np.newaxis]
        values = np.zeros((n_causes, len(LOGARITHMS), len(first)))
        tangents = np.zeros_like(values)
        values[:, 1:] = changes[1:].reshape(n_causes, len(severities), -1)
        tangents[:, 0], tangents[:, 1:] = first.T, own.sum(axis=-1)
        turned = (array @ rotation.T for array in (values, tangents))
        return cls(LOGARITHMS, None, *turned, first, np.ones(n_causes, dtype=bool))

    def whole(self, effects: Effects, columns: Sequence[int], observed: Observed) -> Curves:
        """The same with exact effects of large amounts of some causes."""
        values, tangents, is_whole = self.values.copy(), self.slopes.copy(), self.is_whole.copy()
        found = _by_share(*effects(_alone(self.bounds, columns, SHARES[N_SMALL:])), self.bounds, columns)
        values[columns, N_SMALL:], tangents[columns, N_SMALL:] = (array @ observed.rotation.T for array in found)
        is_whole[columns] = True
        return replace(self, values=values, slopes=tangents, is_whole=is_whole)

    def are_small(self, causes: Sequence[int], amounts: Array) -> NDArray[np.bool_]:
        """Whether amounts of causes, (n_causes,), are within those that all causes are tabulated for."""
        return np.abs(amounts) <= SHARES[N_SMALL - 1] * np.abs(self.bounds[list(causes)])

    def at(self, sets: Array, amounts: Array) -> tuple[Array, Array]:
        """Changes by sets (n_sets, k) of amounts (n_sets, n_errors, k), and their derivatives."""
        shape = (*amounts.shape[:-1], self.values.shape[-1])
        change, slopes = np.zeros(shape), []
        for i in range(sets.shape[-1]):
            column, amount = sets[:, i, np.newaxis], amounts[..., i]
            if self.bounds is None:
                places, units = -np.log1p(-amount), 1 - amount
            else:
                places, units = amount / self.bounds[column], self.bounds[column]
            values, slope = cubic(self.nodes, self.values, self.slopes, column, places, units)
            change += values
            slopes.append(slope)
        return change, np.stack(slopes, axis=-1) if slopes else np.zeros((*shape, 0))


def _alone(bounds: Array, columns: Sequence[int], shares: Array) -> Array:
    """Amounts with one of some causes alone, at shares of its bound, a row each."""
    single = np.diag(bounds)[columns]
    return (shares[:, np.newaxis] * single[:, np.newaxis]).reshape(-1, len(bounds))


def _by_share(changes: Array, slopes: Array, bounds: Array, columns: Sequence[int]) -> tuple[Array, Array]:
    """Changes by single causes, (n_columns, n_shares, n_observed), and their slopes by the share of the bound."""
    own = slopes.reshape(len(columns), -1, *slopes.shape[1:])[np.arange(len(columns)), ..., columns]
    return changes.reshape(len(columns), -1, changes.shape[1]), own * bounds[columns, np.newaxis, np.newaxis]


def cubic(nodes: Array, values: Array, slopes: Array, rows: Array, places: Array, units: Array) -> tuple[Array, Array]:
    """Values in rows of a table at some places, (..., n_observed), by cubic polynomials, and derivatives by amounts.

    ``values`` and ``slopes``, (n_rows, n_nodes, n_observed), are those at the nodes; ``units`` are amounts by place.
    """
    left = np.searchsorted(nodes[1:-1], places, side="right")
    width = (nodes[left + 1] - nodes[left])[..., np.newaxis]
    t = (places - nodes[left])[..., np.newaxis] / width
    low, high = values[rows, left], values[rows, left + 1]
    start, end = slopes[rows, left] * width, slopes[rows, left + 1] * width
    found = (
        (2 * t**3 - 3 * t**2 + 1) * low
        + (t**3 - 2 * t**2 + t) * start
        + (3 * t**2 - 2 * t**3) * high
        + (t**3 - t**2) * end
    )
    slope = (6 * t**2 - 6 * t) * (low - high) + (3 * t**2 - 4 * t + 1) * start + (3 * t**2 - 2 * t) * end
    return found, slope / (width * units[..., np.newaxis])
