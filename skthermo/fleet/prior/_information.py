"""Functions of the weather of a fleet, and what the records of a bridge tell of its response and noise."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.stats import chi2

from skthermo._core.arrays import Array, piecewise_linear, rows_by_pattern
from skthermo._core.frames import correlation_times
from skthermo.fleet.prior._posterior import CoefficientPosterior, OwnPrior
from skthermo.fleet.prior._records import BridgeRecords
from skthermo.preprocessing import HampelFilter
from skthermo.residuals.baseline import lagged_covariances
from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.weather import weather_axes

SMALLEST = 1e-5  # share of the variance of the inputs that is left out
BREAKING = 0.02  # share from which lines in a component break
ROUNDS = 4  # of noise and coefficients in turn
USUAL = 0.99  # share of the records, if normal, that count in full; others the less the farther away they are
PSEUDO_ROWS = 20.0  # independent records as which the noise of the fleet counts beside that of a new bridge
SLOW_DAYS, FEWEST = (2.0, 3.0), 30  # lags of residuals that weather leaves, and rows that tell of them
FAR_IN_TIME = 1e-3  # weight of such a row before it is known whether the weather explains it
LEAST_LEFT = 0.25  # share of the records that regression leaves to the noise, at least
SMALLEST_VARIANCE = 1e-18  # of ln y
JITTER = 1e-9  # share of its variance that each output has of its own


@dataclass(frozen=True)
class FleetBasis:
    """Principal components of the inputs, and piecewise-linear functions of the largest, of zero mean in the fleet.

    The lines break at quantiles of the weather of all bridges and have unit variance there. Beyond the weather of the
    fleet they go on straight.
    """

    middle: Array
    components: Array
    knots: Array
    centre: Array
    scale: Array

    @classmethod
    def of(cls, weather: Array, n_knots: int) -> FleetBasis:
        """The basis for weather, (n_samples, n_inputs) without gaps."""
        middle, components = weather_axes(weather, 1 - SMALLEST)
        places = (weather - middle) @ components.T
        shares = places.var(axis=0)
        n_breaking = max(int((shares > BREAKING * shares.sum()).sum()), 1)
        knots = np.quantile(places[:, :n_breaking], np.linspace(0, 1, n_knots + 2)[1:-1], axis=0)
        plain = cls(middle, components, knots, np.zeros(1), np.ones(1))
        lines = plain(weather)
        scale = np.where(np.arange(lines.shape[1]) < places.shape[1], 1.0, np.maximum(lines.std(axis=0), 1e-12))
        return replace(plain, centre=lines.mean(axis=0), scale=scale)

    @property
    def n_functions(self) -> int:
        return len(self.scale)

    def steady(self, temperatures: Array) -> Array:
        """The functions where all inputs have been at one temperature for long."""
        return self(np.repeat(temperatures[:, np.newaxis], len(self.middle), axis=1))

    def __call__(self, inputs: Array) -> Array:
        """The functions at rows of complete inputs, (n_samples, n_functions)."""
        places = (inputs - self.middle) @ self.components.T
        n_breaking = self.knots.shape[1]
        lines = piecewise_linear(places[:, :n_breaking], self.knots)[:, n_breaking:]
        return (np.hstack([places, lines]) - self.centre) / self.scale


@dataclass(frozen=True)
class FleetNoise:
    """How records of a fleet scatter: variances of ln y by family, and their memory.

    ``misfits`` are variances, by family, of what no function of the basis can follow, less their standard errors.
    """

    variances: Mapping[Hashable, float] = field(default_factory=dict)
    misfits: Mapping[Hashable, float] = field(default_factory=dict)
    memory: float = 1.0

    @classmethod
    def of(cls, found: Sequence[Information], families: Sequence[Sequence[Hashable]]) -> FleetNoise:
        """Medians over bridges."""
        variances: dict[Hashable, list[float]] = {}
        misfits: dict[Hashable, list[float]] = {}
        for one, of_output in zip(found, families, strict=True):
            for family, variance, misfit in zip(of_output, np.diag(one.noise.scatter), one.misfit, strict=True):
                variances.setdefault(family, []).append(float(variance))
                misfits.setdefault(family, []).append(float(misfit))
        return cls(
            {family: float(np.median(some)) for family, some in variances.items()},
            {family: float(np.median(some) - np.std(some) / np.sqrt(len(some))) for family, some in misfits.items()},
            float(np.median([one.noise.memory for one in found])),
        )

    def misfit(self, found: Information, families: Sequence[Hashable]) -> Array:
        """Variances of what a bridge does that the basis cannot follow, from the fleet where it has the family."""
        expected = [self.misfits.get(family, own) for family, own in zip(families, found.misfit, strict=True)]
        return np.maximum(expected, 0.0)

    def scatter(self, families: Sequence[Hashable]) -> Array | None:
        """Expected covariance of a bridge's ln y; None where the fleet does not tell."""
        if not self.variances:
            return None
        typical = float(np.median(list(self.variances.values())))
        return np.diag([self.variances.get(family, typical) for family in families])


@dataclass(frozen=True)
class RowNoise:
    """Covariance of what a row of weight 1 measures, records that tell as much as an independent one, and weights.

    ``robust``, (n_rows,), are at most 1 and smaller for outliers.
    """

    scatter: Array
    memory: float
    robust: Array

    @classmethod
    def before(cls, z: Array, expected: Array | None, memory: float) -> RowNoise:
        """That of the fleet, or the variances of what was measured; rows far from their neighbours hardly count."""
        if expected is None:
            expected = np.diag(np.maximum(np.nanvar(z, axis=0), SMALLEST_VARIANCE))
        far = ~np.isnan(z) & np.isnan(HampelFilter().fit(z).transform(z))
        return cls(expected, memory, np.where(far.any(axis=1), FAR_IN_TIME, 1.0))

    def updated(
        self, residuals: Array, weights: Array, dof: float, expected: Array | None, fleet_memory: float
    ) -> RowNoise:
        """From residuals of a regression with that many degrees of freedom; the fleet's counts as some rows more."""
        n_rows, n_seen = residuals.shape
        clean = np.where(self.robust[:, np.newaxis] >= 1, residuals, np.nan)
        centred = residuals - np.nan_to_num(np.where(np.isnan(clean).all(axis=0), 0.0, _mean(clean)))
        scaled = centred * np.sqrt(weights)[:, np.newaxis]
        gaussian = Gaussian(np.zeros(n_seen), self.scatter)
        squares = np.nan_to_num(gaussian.distances(scaled)) ** 2
        usual = chi2.ppf(USUAL, (~np.isnan(scaled)).sum(axis=1))
        robust = np.minimum(1.0, usual / np.maximum(squares, 1e-300))
        complete, (roots, of_row) = np.nan_to_num(gaussian.completed(scaled)[0]), gaussian.error_roots(scaled)
        errors = (roots @ roots.transpose(0, 2, 1))[of_row]  # of what is filled in
        products = np.einsum("t,ti,tj->ij", robust, complete, complete) + np.einsum("t,tij->ij", robust, errors)
        products *= n_rows / max(n_rows - self.memory * dof, LEAST_LEFT * n_rows)
        if expected is None:  # a bridge of the fleet: only so much that its covariance can be inverted
            expected, count = np.diag(np.diag(products)) / n_rows, float(n_seen)
        else:
            count = PSEUDO_ROWS * fleet_memory
        scatter = (products + count * expected) / (n_rows + count)
        scatter += np.diag(JITTER * np.diag(scatter) + SMALLEST_VARIANCE)
        own = float(correlation_times(scaled * np.sqrt(robust)[:, np.newaxis]).mean())
        memory = max((n_rows * own + count * fleet_memory) / (n_rows + count), 1.0)
        return RowNoise(scatter, memory, robust)


@dataclass(frozen=True)
class Information:
    """Gaussian likelihood of a bridge's coefficients: exp(-b'J b / 2 + h'b), levels integrated out (flat prior).

    b holds the coefficients of the basis u(T) of one output after the other. A row is N(level + B'(u - centre), S / w),
    its precision divided by the memory of the noise. Given b, levels are ``level - gain b`` with ``level_covariance``.
    ``misfit`` are variances of residuals that last for days.
    """

    J: Array
    h: Array
    centre: Array
    level: Array
    gain: Array
    level_covariance: Array
    noise: RowNoise
    misfit: Array

    @property
    def n_outputs(self) -> int:
        return len(self.level)

    @classmethod
    def of(
        cls,
        basis: FleetBasis,
        records: BridgeRecords,
        families: Sequence[Hashable],
        own: OwnPrior,
        fleet: FleetNoise | None = None,
    ) -> Information:
        """Learn noise, memory and outliers in turn with coefficients that have the bridge's own prior."""
        u = basis(records.inputs)
        centre = records.weights @ u / records.weights.sum()
        level = _mean(records.linear, records.weights)
        X, y = np.column_stack([np.ones(len(u)), u - centre]), records.linear - level
        q = records.n_outputs
        expected = None if fleet is None else fleet.scatter(families)
        memory = 1.0 if fleet is None else fleet.memory
        noise = RowNoise.before(y, expected, memory)
        for _ in range(ROUNDS):
            found = cls.given(noise, records, X, y, level, centre)
            state = CoefficientPosterior(found.J, found.h, *own.fitted(found.J, found.h, families))
            dof = 1 + np.einsum("ij,ji->", found.J, state.covariance) / q
            left = y - X[:, 1:] @ state.mean.reshape(q, -1).T
            noise = noise.updated(left, records.weights, dof, expected, memory)
        usual = np.where(noise.robust[:, np.newaxis] >= 1, left, np.nan)
        found = cls.given(noise, records, X, y, level, centre)
        return replace(found, misfit=slow_variance(usual - _mean(usual), records.step))

    @classmethod
    def given(
        cls, noise: RowNoise, records: BridgeRecords, X: Array, y: Array, level: Array, centre: Array
    ) -> Information:
        """The information in rows X (a constant first) and y, less their level, for known noise.

        Over levels and coefficients it is the sum over rows of (P kron x x') w / memory, with the inverse P of the part
        of S that a row has. The Schur complement integrates the levels out.
        """
        q, n_columns = y.shape[1], X.shape[1]
        weights = (records.weights * noise.robust / noise.memory)[:, np.newaxis]
        J, h = np.zeros((q, n_columns, q, n_columns)), np.zeros((q, n_columns))
        for mask, rows in rows_by_pattern(~np.isnan(y)):
            P = np.zeros((q, q))
            P[np.ix_(mask, mask)] = np.linalg.inv(noise.scatter[np.ix_(mask, mask)])
            weighted = X[rows] * weights[rows]
            J += np.einsum("ab,ij->aibj", P, X[rows].T @ weighted)
            h += P @ np.nan_to_num(y[rows]).T @ weighted
        size = q * (n_columns - 1)
        level_covariance = np.linalg.inv(J[:, 0, :, 0])
        cross, own = J[:, 0, :, 1:].reshape(q, size), level_covariance @ h[:, 0]
        gain = level_covariance @ cross
        return cls(
            J[:, 1:, :, 1:].reshape(size, size) - cross.T @ gain,
            h[:, 1:].ravel() - cross.T @ own,
            centre,
            level + own,
            gain,
            level_covariance,
            noise,
            np.zeros(q),
        )


def slow_variance(residuals: Array, step: float) -> Array:
    """Mean autocovariance of columns over some days, which noise has forgotten, and weather has not."""
    lags = [max(round(days / step), 1) for days in SLOW_DAYS]
    lags = [lag for lag in lags if len(residuals) - lag > FEWEST]
    if not lags:
        return np.zeros(residuals.shape[1])
    found = lagged_covariances(residuals, residuals, lags)
    return np.diagonal(found, axis1=1, axis2=2).sum(axis=0) / len(SLOW_DAYS)


def _mean(values: Array, weights: Array | None = None) -> Array:
    """Means of columns over the rows that have a value, 0 without any."""
    known = ~np.isnan(values)
    shares = known * (1.0 if weights is None else weights[:, np.newaxis])
    return (shares * np.nan_to_num(values)).sum(axis=0) / np.maximum(shares.sum(axis=0), 1e-300)
