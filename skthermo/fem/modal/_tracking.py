"""Tracking: which computed mode is which reference mode, by their MAC."""

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import linear_sum_assignment

REPEATED = 1e-6
"""Relative distance of eigenvalues below which they count as repeated: rounding then decides their shapes."""


def pair_modes(mac: NDArray[np.float64], repeated: NDArray[np.bool_] | None = None) -> NDArray[np.intp]:
    """The candidate of each reference mode, (n_samples, n_modes), so that the sum of MACs is highest.

    ``mac`` is (n_samples, n_modes, n_candidates). Reference modes that share a ``repeated`` frequency, (n_modes,
    n_modes), have an arbitrary basis of the space they span as their shapes: candidates are compared with that space,
    and those assigned to it are sorted by frequency.
    """
    spans = np.nan_to_num(mac if repeated is None else repeated @ mac)
    best = spans.argmax(axis=2)
    distinct = (np.diff(np.sort(best, axis=1), axis=1) > 0).all(axis=1)
    for sample in np.flatnonzero(~distinct):
        best[sample] = linear_sum_assignment(spans[sample], maximize=True)[1]
    for cluster in () if repeated is None else np.unique(repeated, axis=0):
        best[:, cluster] = np.sort(best[:, cluster], axis=1)
    return best


def may_be_missed(mac: NDArray[np.float64], order: NDArray[np.intp], repeated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples in which a mode beyond the candidates could have a higher MAC with a reference than the one assigned.

    Modes are orthogonal, so the MACs of a reference with all modes add up to 1 (with repeated references, to their
    number). No mode beyond the candidates can have a higher MAC than what the candidates leave of that sum.
    """
    spans = repeated @ mac
    assigned = np.take_along_axis(spans, order[:, :, np.newaxis], axis=2)[:, :, 0]
    left = repeated.sum(axis=1) - spans.sum(axis=2)
    return (assigned < left).any(axis=1)


def may_differ(mac: NDArray[np.float64], order: NDArray[np.intp], repeated: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Samples in which the assignment could be another one if more candidates were examined.

    It is final where every reference is assigned its best candidate, which no mode beyond these can surpass.
    """
    spans = repeated @ mac
    assigned = np.take_along_axis(spans, order[:, :, np.newaxis], axis=2)[:, :, 0]
    return (assigned < spans.max(axis=2)).any(axis=1) | may_be_missed(mac, order, repeated)


def repeated_modes(eigenvalues: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of some ascending eigenvalues equal each other up to rounding, (n_modes, n_modes)."""
    cluster = np.cumsum(np.diff(eigenvalues, prepend=0) > REPEATED * eigenvalues)
    return cluster[:, np.newaxis] == cluster
