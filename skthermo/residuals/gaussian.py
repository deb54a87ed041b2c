"""Normal distributions of rows in which modes may be missing."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import NDArray

from skthermo._core.arrays import Array, patterns

Mask = NDArray[np.bool_]
SINGULAR_WITH_GAPS = 1e-7  # variance below which a combination of standardised modes with gaps counts as constant


@dataclass(frozen=True)
class Gaussian:
    """Mean and covariance of all modes; a row's distance counts the modes that it has.

    ``is_settled`` says whether expectation maximisation has converged, where gaps made it necessary.
    """

    mean: Array
    covariance: Array
    is_settled: bool = True

    @classmethod
    def fitted(cls, rows: Array) -> Gaussian:
        """The most likely one, by expectation maximisation where modes are missing."""
        present = ~np.isnan(rows)
        if present.all():
            mean = np.ones(len(rows)) @ rows / len(rows)
            centred = rows - mean
            return cls(mean, centred.T @ centred / len(rows))
        centre, deviations = np.nanmean(rows, axis=0), np.nanstd(rows, axis=0)
        scale = np.where(deviations > 0, deviations, 1.0)
        mean, covariance, is_settled = _most_likely(np.where(present, (rows - centre) / scale, 0.0), present)
        return cls(centre + scale * mean, covariance * np.outer(scale, scale), is_settled)

    def without(self, some: Array, n_rows: int) -> Gaussian:
        """The most likely one of the others of so many complete rows, whose most likely one this is."""
        centred, n_others = some - self.mean, n_rows - len(some)
        shift = -np.ones(len(some)) @ centred / n_others
        products = n_rows * self.covariance - centred.T @ centred
        return Gaussian(self.mean + shift, products / n_others - np.outer(shift, shift))

    def distances(self, rows: Array) -> Array:
        """Mahalanobis distances in the modes that rows have; NaN where there is none."""
        # The inverse of the covariance itself would lose modes in a small unit beside others in a large one.
        scale = np.sqrt(np.diag(self.covariance))
        standard, correlation = (rows - self.mean) / scale, self.covariance / np.outer(scale, scale)
        if not np.isnan(standard).any():
            return np.sqrt(np.maximum(np.einsum("ij,ij->i", standard @ np.linalg.inv(correlation), standard), 0.0))
        standard = np.nan_to_num(standard)
        masks, of_row = patterns(~np.isnan(rows))
        scaled = np.einsum("ij,ijk->ik", standard, precisions(correlation, masks)[of_row])
        squared = np.einsum("ij,ij->i", scaled, standard)
        return np.where(masks.any(axis=1)[of_row], np.sqrt(np.maximum(squared, 0.0)), np.nan)

    def log_densities(self, rows: Array) -> Array:
        """Logarithm of the density of each row in the modes that it has; 0 where there is none."""
        scale = np.sqrt(np.diag(self.covariance))
        masks, of_row = patterns(~np.isnan(rows))
        both = masks[:, :, np.newaxis] & masks[:, np.newaxis, :]
        volumes = np.linalg.slogdet(_alone(self.covariance / np.outer(scale, scale), masks, both))[1]
        volumes += masks @ np.log(2 * np.pi * scale**2)
        return -0.5 * (np.nan_to_num(self.distances(rows)) ** 2 + volumes[of_row])

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
        """Cholesky roots of the covariance of what `completed` fills in, and the number of each row's root."""
        masks, of_row = patterns(~np.isnan(rows))
        rest = _conditionals(self.covariance, masks)[1]
        missing = ~masks[:, :, np.newaxis] & ~masks[:, np.newaxis, :]
        return np.where(missing, np.linalg.cholesky(_alone(rest, ~masks, missing)), 0.0), of_row


def precisions(covariance: Array, masks: Mask) -> Array:
    """Inverses of the covariance of the modes in each mask; zero elsewhere."""
    both = masks[:, :, np.newaxis] & masks[:, np.newaxis, :]
    return np.where(both, np.linalg.inv(_alone(covariance, masks, both)), 0.0)


def modes_text(chosen: Mask, names: Sequence[str] | None) -> str:
    """Some modes by their names or, without names, by their positions."""
    if names is None:
        return f"modes {np.flatnonzero(chosen).tolist()} (counted from 0)"
    return f"modes {[str(name) for name in np.asarray(names)[chosen]]}"


def check_invertible(normal: Gaussian, n_rows: int, *, has_gaps: bool, names: Sequence[str] | None = None) -> Array:
    """Standard deviations of the modes, more than rounding beside their size, if no mode depends on others.

    With gaps, the iteration leaves a small variance where there is none.
    """
    covariance = normal.covariance
    deviations = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    constant = deviations <= (1e-7 if has_gaps else 1e-14) * np.abs(normal.mean)
    scale = np.where(constant, np.inf, deviations)
    tolerance = SINGULAR_WITH_GAPS if has_gaps else None
    rank = np.linalg.matrix_rank(covariance / np.outer(scale, scale), tolerance, hermitian=True)
    if rank < len(covariance):
        which = f", {modes_text(constant, names)} are constant" if constant.any() else ""
        if not which and n_rows > len(covariance):
            combination = np.linalg.eigh(covariance / np.outer(scale, scale))[1][:, 0]
            part = modes_text(np.abs(combination) > 0.1, names)
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


def _most_likely(rows: Array, present: Mask) -> tuple[Array, Array, bool]:
    """Mean and covariance of standardised rows, zero where a mode is missing, and whether they have settled."""
    masks, of_row = patterns(present)
    n_modes, counts = rows.shape[1], np.bincount(of_row).astype(float)
    sums, products = np.zeros((len(masks), n_modes)), np.zeros((len(masks), n_modes, n_modes))
    for pattern in range(len(masks)):
        group = rows[of_row == pattern]
        sums[pattern], products[pattern] = group.sum(axis=0), group.T @ group
    return _settled(partial(_em_step, masks, counts, sums, products), len(rows), n_modes)


def _settled(
    step: Callable[[Array], Array], n_rows: int, n_modes: int, *, tolerance: float = 1e-9, most_steps: int = 100
) -> tuple[Array, Array, bool]:
    """Mean and covariance that a step of expectation maximisation of standardised rows leaves as they are."""
    state = np.concatenate([np.zeros((1, n_modes)), np.eye(n_modes)])
    for _ in range(most_steps):
        once = step(state)
        twice = step(once)
        first, second = once - state, twice - once
        state = twice
        if np.abs(second).max() < tolerance:
            break
        # SQUAREM (Varadhan and Roland, 2008): two steps tell how much farther the iteration would go.
        length = max(np.linalg.norm(first) / np.linalg.norm(second - first), 1.0)
        far = once - first + 2 * length * first + length**2 * (second - first)
        if np.linalg.eigvalsh(far[1:])[0] > 0:
            beyond = step(far)
            state = beyond if np.abs(beyond - far).max() <= np.abs(first).max() else twice
    is_singular = np.linalg.eigvalsh(state[1:])[0] < SINGULAR_WITH_GAPS  # which `check_invertible` refuses
    last_step_is_small = np.abs(second).max() <= 0.01 / np.sqrt(n_rows)  # beside the sampling error
    return state[0], state[1:], bool(last_step_is_small or is_singular)


def _em_step(masks: Mask, counts: Array, sums: Array, products: Array, state: Array) -> Array:
    """Expectation and maximisation: the next mean (first row) and covariance, from sums over rows of each mask."""
    mean, covariance = state[0], state[1:]
    shift = masks * mean
    cross = sums[:, :, np.newaxis] * shift[:, np.newaxis, :]
    centred_sums = sums - counts[:, np.newaxis] * shift
    centred = products - cross - cross.transpose(0, 2, 1)
    centred += counts[:, np.newaxis, np.newaxis] * shift[:, :, np.newaxis] * shift[:, np.newaxis, :]
    fill, rest = _conditionals(covariance + 1e-12 * np.eye(len(mean)), masks)  # copies of a mode have inverses
    step = np.einsum("ijk,ik->j", fill, centred_sums) / counts.sum()
    moments = fill @ centred @ fill.transpose(0, 2, 1) + counts[:, np.newaxis, np.newaxis] * rest
    updated = moments.sum(axis=0) / counts.sum() - np.outer(step, step)
    return np.concatenate([[mean + step], (updated + updated.T) / 2])
