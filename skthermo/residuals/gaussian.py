"""Normal distributions of rows in which modes may be missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from skthermo._core.arrays import Array, patterns, spread_evenly
from skthermo._core.warnings import warn_user
from skthermo.exceptions import ResultWarning

Mask = NDArray[np.bool_]
MOST_STEPS = 100  # of expectation maximisation
MOST_WITH_ERRORS = 5000  # rows, each with an error of its own, that are learned from
PSEUDO_ROWS = 5  # of which their errors are not taken away
TOLERANCE = 1e-9  # it ends when no mean or covariance of standardised modes moves by more
SETTLED = 0.01  # size of the last of the most steps, beside the sampling error, above which it warns
GAPS_TOLERANCE = 1e-7  # variance below which a combination of standardised modes with gaps counts as constant
IN_COMBINATION = 0.1  # coefficient of a standardised mode from which it counts as part of a constant combination
JITTER = 1e-12  # added to variances of standardised modes: copies of a mode have inverses until `check_invertible`


@dataclass(frozen=True)
class Gaussian:
    """Mean and covariance of all modes; a row's distance is that of the modes that it has."""

    mean: Array
    covariance: Array

    @classmethod
    def of(cls, rows: Array, errors: Array | None = None) -> Gaussian:
        """The most likely one, by expectation maximisation where modes are missing.

        With the covariance of an ``error`` that each row holds besides, (n_rows, n_modes, n_modes), it is that of rows
        without it.
        """
        present = ~np.isnan(rows)
        centre = np.nanmean(rows, axis=0)
        deviations = np.nanstd(rows, axis=0)
        scale = np.where(deviations > 0, deviations, 1.0)
        standard = np.where(present, (rows - centre) / scale, 0.0)
        mean, covariance = (
            _expectation_maximisation(standard, present)
            if errors is None
            else _maximisation_with_errors(standard, present, errors / np.outer(scale, scale))
        )
        return cls(centre + scale * mean, covariance * np.outer(scale, scale))

    def whiten(self, rows: Array) -> Array:
        """Rows in standard deviations and uncorrelated; NaN stays where a mode is missing."""
        present, all_alike = ~np.isnan(rows), np.zeros(len(rows), dtype=np.intp)
        return Whitenings.of(self.covariance[np.newaxis], all_alike, present).white(rows - self.mean)

    def distances(self, rows: Array) -> Array:
        """Mahalanobis distances in the modes that rows have; NaN where there is none."""
        scale = np.sqrt(np.diag(self.covariance))
        masks, of_row = patterns(~np.isnan(rows))
        # The inverse of the covariance itself would lose modes in a small unit beside others in a large one.
        inverses = precisions(self.covariance / np.outer(scale, scale), masks)
        standard = np.nan_to_num(rows - self.mean) / scale
        scaled = standard @ inverses[0] if len(masks) == 1 else np.einsum("ij,ijk->ik", standard, inverses[of_row])
        squared = np.einsum("ij,ij->i", scaled, standard)
        return np.where(masks.any(axis=1)[of_row], np.sqrt(np.maximum(squared, 0.0)), np.nan)

    def log_densities(self, rows: Array) -> Array:
        """Logarithm of the density of each row in the modes that it has; 0 where there is none."""
        scale = np.sqrt(np.diag(self.covariance))
        present, correlation = ~np.isnan(rows), self.covariance / np.outer(scale, scale)
        units = present @ np.log(2 * np.pi * scale**2)
        all_alike = np.zeros(len(rows), dtype=np.intp)
        roots = Whitenings.of(correlation[np.newaxis], all_alike, present)
        volumes = units + roots.logarithms[roots.pair]
        return -0.5 * (np.nan_to_num(self.distances(rows)) ** 2 + volumes)

    def completed(self, rows: Array) -> tuple[Array, Array]:
        """Rows whose gaps hold what is expected given the values that are there, and the standard deviations of those.

        These are zero where a value is there; rows without any stay NaN.
        """
        masks, of_row = patterns(~np.isnan(rows))
        fill, rest = _conditionals(self.covariance, masks)
        expected = self.mean + np.einsum("ijk,ik->ij", fill[of_row], np.nan_to_num(rows - self.mean))
        deviations = np.sqrt(np.maximum(np.einsum("ijj->ij", rest), 0.0))[of_row]
        empty = np.isnan(rows).all(axis=1)[:, np.newaxis]
        filled = np.where(np.isnan(rows), np.where(empty, np.nan, expected), rows)
        return filled, np.where(np.isnan(rows), np.where(empty, np.nan, deviations), 0.0)

    def error_roots(self, rows: Array) -> tuple[Array, NDArray[np.intp]]:
        """Cholesky roots of the covariance of what `completed` fills in, and which of them is that of each row."""
        masks, of_row = patterns(~np.isnan(rows))
        rest = _conditionals(self.covariance, masks)[1]
        missing = ~masks[:, :, np.newaxis] & ~masks[:, np.newaxis, :]
        return np.where(missing, np.linalg.cholesky(_alone(rest, ~masks, missing)), 0.0), of_row

    def second_moments(self, rows: Array) -> Array:
        """Expected products of the centred modes given those that are there, (n_rows, n_modes, n_modes)."""
        masks, of_row = patterns(~np.isnan(rows))
        fill, rest = _conditionals(self.covariance, masks)
        complete = np.einsum("ijk,ik->ij", fill[of_row], np.nan_to_num(rows - self.mean))
        return complete[:, :, np.newaxis] * complete[:, np.newaxis, :] + rest[of_row]


@dataclass(frozen=True)
class Whitenings:
    """The `whitenings` of the pairs of a covariance and a mask that rows have, and the pair of each row."""

    roots: Array
    logarithms: Array
    pair: NDArray[np.intp]

    @classmethod
    def of(cls, covariances: Array, which: NDArray[np.intp], present: Mask) -> Whitenings:
        """Those of rows, each with one of several covariances and a mask of the modes that it has."""
        masks, pattern = patterns(present)
        cases, pair = np.unique(which * len(masks) + pattern, return_inverse=True)
        return cls(*whitenings(covariances[cases // len(masks)], masks[cases % len(masks)]), pair)

    def white(self, centred: Array) -> Array:
        """Centred rows in standard deviations and uncorrelated."""
        filled = np.nan_to_num(centred)
        many = len(self.roots) > 1
        white = np.einsum("ij,ijk->ik", filled, self.roots[self.pair]) if many else filled @ self.roots[0]
        return np.where(np.isnan(centred), np.nan, white)


def precisions(covariance: Array, masks: Mask) -> Array:
    """Inverses of the covariance of the modes in each mask; zero elsewhere."""
    both = masks[:, :, np.newaxis] & masks[:, np.newaxis, :]
    return np.where(both, np.linalg.inv(_alone(covariance, masks, both)), 0.0)


def whitenings(covariances: Array, masks: Mask) -> tuple[Array, Array]:
    """Symmetric roots of the `precisions`, and the logarithms of the determinants of the covariances."""
    both = masks[..., :, np.newaxis] & masks[..., np.newaxis, :]
    values, vectors = np.linalg.eigh(_alone(covariances, masks, both))
    roots = np.einsum("...ij,...j,...kj->...ik", vectors, 1 / np.sqrt(values), vectors)
    return np.where(both, roots, 0.0), np.log(values).sum(axis=-1)


def no_smaller(covariances: Array, least: Array) -> Array:
    """Covariances that have, in every direction, the variance of the given ones or that of the least one, or more.

    Of all such, those that change the given ones only along the directions in which both are uncorrelated.
    """
    scale = np.linalg.cholesky(least)
    inverse = np.linalg.inv(scale)
    ratios, axes = np.linalg.eigh(inverse @ covariances @ inverse.T)
    along = scale @ axes
    return np.einsum("...ij,...j,...kj->...ik", along, np.maximum(ratios, 1.0), along)


def check_not_empty(rows: Array, names: Sequence[str] | None = None) -> None:
    """Refuse modes that no row has."""
    empty = np.isnan(rows).all(axis=0)
    if empty.any():
        raise ValueError(f"{modes_text(empty, names)} are NaN in all {len(rows)} rows")


def modes_text(chosen: Mask, names: Sequence[str] | None) -> str:
    """Some modes by their names or, without names, by their positions."""
    if names is None:
        return f"modes {np.flatnonzero(chosen).tolist()} (counted from 0)"
    return f"modes {[str(name) for name in np.asarray(names)[chosen]]}"


def check_invertible(
    covariance: Array, rows: Array, size: Array | None = None, names: Sequence[str] | None = None
) -> Array:
    """Standard deviations of the modes, more than rounding beside their size, if no mode depends on others."""
    size = np.fmax.reduce(np.abs(rows)) if size is None else size
    deviations = np.sqrt(np.diag(covariance))
    constant = (deviations <= 1e-14 * size) | (np.fmax.reduce(rows) == np.fmin.reduce(rows))
    scale = np.where(constant, np.inf, deviations)
    # With gaps, the iteration leaves a small variance where there is none.
    tolerance = GAPS_TOLERANCE if np.isnan(rows).any() else None
    rank = np.linalg.matrix_rank(covariance / np.outer(scale, scale), tolerance, hermitian=True)
    if rank < len(covariance):
        n_rows = int((~np.isnan(rows)).any(axis=1).sum())
        which = f", {modes_text(constant, names)} are constant" if constant.any() else ""
        if not which and n_rows > len(covariance):
            combination = np.linalg.eigh(covariance / np.outer(scale, scale))[1][:, 0]
            part = modes_text(np.abs(combination) > IN_COMBINATION, names)
            which = f", {part} are copies or combinations of each other"
        raise ValueError(
            f"the covariance of {n_rows} baseline rows and {len(covariance)} modes is singular (rank {rank}){which}; "
            f"expected more than {len(covariance)} rows, and no mode that is constant or a copy of others (or, in "
            "MahalanobisDetector, a shrunk covariance such as LedoitWolf())"
        )
    return scale


def _alone(covariances: Array, masks: Mask, both: Mask) -> Array:
    """Covariances in which missing modes have unit variance and no correlation."""
    return np.where(both, covariances, 0.0) + np.eye(masks.shape[-1]) * ~masks[..., np.newaxis, :]


def _conditionals(covariance: Array, masks: Mask) -> tuple[Array, Array]:
    """Matrices that complete centred rows of each mask, and the covariance of what they fill in."""
    fill = covariance @ precisions(covariance, masks)
    return fill, covariance - fill @ covariance


def _expectation_maximisation(rows: Array, present: Mask) -> tuple[Array, Array]:
    """Mean and covariance of standardised rows that hold zeros where a mode is missing."""
    n_modes = rows.shape[1]
    if present.all():
        mean = rows.mean(axis=0)
        return mean, (rows - mean).T @ (rows - mean) / len(rows)
    masks, of_row = patterns(present)
    counts = np.bincount(of_row).astype(float)
    sums, products = np.zeros((len(masks), n_modes)), np.zeros((len(masks), n_modes, n_modes))
    for pattern in range(len(masks)):
        group = rows[of_row == pattern]
        sums[pattern], products[pattern] = group.sum(axis=0), group.T @ group
    return _settled(partial(_em_step, masks, counts, sums, products), len(rows), n_modes)


def _maximisation_with_errors(rows: Array, present: Mask, errors: Array) -> tuple[Array, Array]:
    """The same where each row holds an error of known covariance besides; evenly spaced rows stand for very many.

    A few pseudo-rows with the covariance of rows and errors together keep it from vanishing where errors are said to be
    larger than they are.
    """
    chosen = spread_evenly(np.flatnonzero(present.any(axis=1)), MOST_WITH_ERRORS)
    whole = _expectation_maximisation(rows, present)[1]
    step = partial(_em_step_with_errors, rows[chosen], present[chosen], errors[chosen], whole)
    return _settled(step, len(chosen), rows.shape[1])


def _settled(step: Callable[[Array], Array], n_rows: int, n_modes: int) -> tuple[Array, Array]:
    """Mean and covariance that a step of expectation maximisation of standardised rows leaves as they are."""
    state = np.concatenate([np.zeros((1, n_modes)), np.eye(n_modes)])
    for _ in range(MOST_STEPS):
        once = step(state)
        twice = step(once)
        first, second = once - state, twice - once
        state = twice
        if np.abs(second).max() < TOLERANCE:
            break
        # SQUAREM (Varadhan and Roland, 2008): two steps tell how much farther the iteration would go.
        length = max(np.linalg.norm(first) / np.linalg.norm(second - first), 1.0)
        far = once - first + 2 * length * first + length**2 * (second - first)
        if np.linalg.eigvalsh(far[1:])[0] > 0:
            beyond = step(far)
            state = beyond if np.abs(beyond - far).max() <= np.abs(first).max() else twice
    is_singular = np.linalg.eigvalsh(state[1:])[0] < GAPS_TOLERANCE  # which `check_invertible` refuses
    if np.abs(second).max() > SETTLED / np.sqrt(n_rows) and not is_singular:
        warn_user(
            f"the covariance of {n_rows} rows with gaps has not settled after {MOST_STEPS} steps. Gaps leave a part of "
            "it nearly undetermined. Leave out the mode that is missing most, or give more records",
            ResultWarning,
            "covariance-with-gaps",
        )
    return state[0], state[1:]


def _em_step_with_errors(rows: Array, present: Mask, errors: Array, whole: Array, state: Array) -> Array:
    """The next mean and covariance S of what rows are without their errors C: each row has S + C."""
    mean, covariance = state[0], state[1:] + JITTER * np.eye(rows.shape[1])
    fill = covariance @ precisions(covariance + errors, present)
    expected = np.einsum("ijk,ik->ij", fill, np.where(present, rows - mean, 0.0))
    rest = covariance - np.mean(fill, axis=0) @ covariance
    step = expected.mean(axis=0)
    own = expected.T @ expected / len(rows) + rest - np.outer(step, step)
    updated = (len(rows) * own + PSEUDO_ROWS * whole) / (len(rows) + PSEUDO_ROWS)
    return np.concatenate([[mean + step], (updated + updated.T) / 2])


def _em_step(masks: Mask, counts: Array, sums: Array, products: Array, state: Array) -> Array:
    """Expectation and maximisation: the next mean (first row) and covariance, from sums over rows of each mask."""
    mean, covariance = state[0], state[1:]
    shift = masks * mean
    cross = sums[:, :, np.newaxis] * shift[:, np.newaxis, :]
    centred_sums = sums - counts[:, np.newaxis] * shift
    centred = products - cross - cross.transpose(0, 2, 1)
    centred += counts[:, np.newaxis, np.newaxis] * shift[:, :, np.newaxis] * shift[:, np.newaxis, :]
    fill, rest = _conditionals(covariance + JITTER * np.eye(len(mean)), masks)
    step = np.einsum("ijk,ik->j", fill, centred_sums) / counts.sum()
    moments = fill @ centred @ fill.transpose(0, 2, 1) + counts[:, np.newaxis, np.newaxis] * rest
    updated = moments.sum(axis=0) / counts.sum() - np.outer(step, step)
    return np.concatenate([[mean + step], (updated + updated.T) / 2])
