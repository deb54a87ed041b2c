"""What the records of one bridge tell of its response to the weather."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.stats import chi2

from skthermo._arrays import Array, rows_by_pattern, spread_evenly
from skthermo._gaussian import Gaussian
from skthermo._times import correlation_time
from skthermo.fleet.prior._basis import FleetBasis
from skthermo.fleet.prior._posterior import alone, posterior

MOST_ROWS = 20_000
ROUNDS = 4  # of noise and coefficients in turn
USUAL = 0.99  # share of the records, if normal, that count in full; others by how far beyond they are
PSEUDO_ROWS = 20.0  # independent records as which the noise of the fleet counts beside those of a new bridge
LEAST_LEFT = 0.25  # share of the records that regression leaves to the noise, at least
JITTER = 1e-9
ROWS_PER_EFFECTIVE_ROW = 10.0  # by which a chain's damping is less than the precision of the inverse's prior


@dataclass(frozen=True)
class BridgeRecords:
    """Inputs (n, d) and ln of positive quantities (n, q) of a bridge; ``weights`` are relative precisions of rows.

    ``seen``, (r, q), turns ln y into what was measured: A of equation z = A ln theta, without directions that no
    frequency sees. ``level_precision``, (q,), is that of the levels without any record.
    """

    inputs: Array
    logs: Array
    names: list[Any]
    weights: Array
    seen: Array
    level_precision: Array

    @classmethod
    def of(
        cls, inputs: Array, values: Array, names: Sequence[Any], weights: Array | None = None, coordinates: Any = None
    ) -> BridgeRecords:
        """The usable rows, evenly spread where there are very many."""
        usable = ~np.isnan(inputs).any(axis=1) & ~np.isnan(values).all(axis=1)
        weights = np.ones(len(inputs)) if weights is None else weights
        if coordinates is not None:
            usable &= ~np.isnan(values).any(axis=1)
        rows = spread_evenly(np.flatnonzero(usable & (weights > 0)), MOST_ROWS)
        if (values[rows] <= 0).any():
            raise ValueError(f"a quantity falls to {np.nanmin(values):g}; expected positive numbers")
        n_outputs = values.shape[1]
        seen, level_precision = np.eye(n_outputs), np.zeros(n_outputs)
        if coordinates is not None:
            _, sizes, vectors = np.linalg.svd(coordinates.sensitivities, full_matrices=False)
            kept = sizes > 1e-8 * sizes[0]
            seen = sizes[kept, np.newaxis] * vectors[kept]
            level_precision = coordinates.damping * len(rows) / ROWS_PER_EFFECTIVE_ROW
            level_precision = np.maximum(level_precision, JITTER * np.trace(seen.T @ seen))
        return cls(inputs[rows], np.log(values[rows]), list(names), weights[rows], seen, level_precision)

    @property
    def is_measured(self) -> bool:
        """Whether ln y was learned in coordinates of what was measured."""
        return bool(self.level_precision.any())


@dataclass(frozen=True)
class FleetNoise:
    """How records of the fleet scatter: variances of ln y by family, or of what was measured, and their memory."""

    variances: Mapping[Any, float] = field(default_factory=dict)
    measured: float = 1.0
    memory: float = 1.0

    def covariance(self, families: Sequence[Any], is_measured: bool, n_seen: int) -> Array | None:
        """What the residuals of a bridge are expected to scatter; None where the fleet does not tell."""
        if is_measured:
            return self.measured * np.eye(n_seen)
        if not self.variances:
            return None
        typical = float(np.median(list(self.variances.values())))
        return np.diag([self.variances.get(family, typical) for family in families])


@dataclass(frozen=True)
class Information:
    """Gaussian likelihood of a bridge's coefficients: exp(-b'J b / 2 + h'b), levels integrated out (flat prior).

    b holds the coefficients of the basis for one output after the other. The likelihood of a row is
    N(y; level + B'(u - centre), S / weight), its precision divided by the ``memory`` of the residuals. Given b, the
    levels are ``level - gain b`` with ``level_covariance``.
    """

    names: list[Any]
    J: Array
    h: Array
    centre: Array
    level: Array
    gain: Array
    level_covariance: Array
    scatter: Array
    memory: float
    n_rows: int

    @property
    def n_outputs(self) -> int:
        """Number of parameters or modes."""
        return len(self.names)

    @classmethod
    def of(
        cls,
        basis: FleetBasis,
        records: BridgeRecords,
        noise: FleetNoise | None = None,
        families: Sequence[Any] = (),
        typical: Array | None = None,
    ) -> Information:
        """Learn noise, its memory and outliers in turn with the coefficients of a plain ridge.

        The noise of the fleet, if given, counts as that of some records more.
        """
        u = basis(records.inputs)
        n_rows, n_outputs = records.logs.shape
        total = records.weights.sum()
        centre = records.weights @ u / total
        X = np.hstack([np.ones((n_rows, 1)), u - centre])
        known = ~np.isnan(records.logs)
        level = np.array(
            [
                np.average(y[k], weights=w) if k.any() else 0.0
                for y, k, w in ((y, k, records.weights[k]) for y, k in zip(records.logs.T, known.T, strict=True))
            ]
        )
        y = records.logs - level
        n_seen = len(records.seen)
        is_measured = records.is_measured
        expected = None if noise is None else noise.covariance(families, is_measured, n_seen)
        memory = 1.0 if noise is None else noise.memory
        z = y @ records.seen.T if is_measured else y
        scatter = expected if expected is not None else np.diag(np.maximum(np.nanvar(z, axis=0), JITTER**2))
        robust = np.ones(n_rows)
        for round_ in range(ROUNDS + 1):
            found = cls._given(records, X, y, level, centre, scatter, memory, robust)
            if round_ == ROUNDS:
                return found
            prior = alone(found.J, found.h, n_outputs, typical)
            state = posterior(found.J, found.h, *prior)
            dof = 1 + np.einsum("ij,ji->", found.J, state.covariance) / n_outputs
            b = state.mean.reshape(n_outputs, -1)
            residuals = z - X[:, 1:] @ b.T @ records.seen.T if is_measured else z - X[:, 1:] @ b.T
            residuals -= np.nan_to_num(np.nanmean(np.where(robust[:, np.newaxis] > 0.5, residuals, np.nan), axis=0))
            root_weights = np.sqrt(records.weights)[:, np.newaxis]
            gaussian = Gaussian(np.zeros(n_seen), scatter)
            distances = gaussian.distances(residuals * root_weights)
            n_known = (~np.isnan(residuals)).sum(axis=1)
            robust = np.minimum(1.0, chi2.ppf(USUAL, n_known) / np.maximum(np.nan_to_num(distances) ** 2, 1e-300))
            moments = gaussian.second_moments(residuals * root_weights)
            products = np.einsum("t,tij->ij", robust, moments)
            left = max(n_rows - memory * dof, LEAST_LEFT * n_rows)
            inflated = products * n_rows / left
            pseudo = PSEUDO_ROWS * memory
            if expected is None:
                expected_now, pseudo = np.diag(np.diag(inflated)) / n_rows, float(n_outputs)
            else:
                expected_now = expected
            scatter = (inflated + pseudo * expected_now) / (n_rows + pseudo)
            scatter = scatter + JITTER * np.diag(np.diag(scatter)) + 1e-18 * np.eye(n_seen)
            own = np.mean([correlation_time(column) for column in (residuals * np.sqrt(robust)[:, np.newaxis]).T])
            count = 0.0 if noise is None else PSEUDO_ROWS * noise.memory
            memory = max((n_rows * own + count * (1.0 if noise is None else noise.memory)) / (n_rows + count), 1.0)
        raise AssertionError

    @classmethod
    def _given(
        cls,
        records: BridgeRecords,
        X: Array,
        y: Array,
        level: Array,
        centre: Array,
        scatter: Array,
        memory: float,
        robust: Array,
    ) -> Information:
        """The information with noise of a given covariance, memory and weights of rows."""
        n_outputs, n_columns = y.shape[1], X.shape[1]
        weights = records.weights * robust / memory
        J = np.zeros((n_outputs, n_columns, n_outputs, n_columns))
        h = np.zeros((n_outputs, n_columns))
        is_measured = records.is_measured
        for mask, rows in rows_by_pattern(~np.isnan(y)):
            if is_measured:
                P = records.seen.T @ np.linalg.solve(scatter, records.seen)
            else:
                P = np.zeros((n_outputs, n_outputs))
                P[np.ix_(mask, mask)] = np.linalg.inv(scatter[np.ix_(mask, mask)])
            weighted = X[rows] * weights[rows, np.newaxis]
            J += np.einsum("ab,ij->aibj", P, X[rows].T @ weighted)
            h += P @ np.nan_to_num(y[rows]).T @ weighted
        levels = J[:, 0, :, 0] + np.diag(np.maximum(records.level_precision, 1e-300))
        level_covariance = np.linalg.inv(levels)
        size = n_outputs * (n_columns - 1)
        cross = J[:, 0, :, 1:].reshape(n_outputs, size)
        gain = level_covariance @ cross
        return cls(
            records.names,
            J[:, 1:, :, 1:].reshape(size, size) - cross.T @ gain,
            h[:, 1:].ravel() - cross.T @ (level_covariance @ h[:, 0]),
            centre,
            level + level_covariance @ h[:, 0],
            gain,
            level_covariance,
            scatter,
            memory,
            len(y),
        )
