"""Probability of false alarm and of detection, time to detection, minimum detectable damage."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import is_labelled, real_array
from skthermo._core.frames import check_same_rows, row_times, time_of
from skthermo._core.warnings import warn_each
from skthermo.exceptions import UnevaluatedRowsWarning


def probability_of_false_alarm(damage_index: ArrayLike, threshold: float) -> float:
    """Share of healthy records above the threshold (PFA).

    Parameters
    ----------
    damage_index : array-like of shape (n_samples,)
        Damage index of records of the healthy structure that are not in the baseline; NaN where nothing can be
        evaluated, which counts neither as healthy nor as an alarm. `~skthermo.detection.MahalanobisDetector` gives the
        unsquared distance, and its ``threshold_`` is one of that.
    threshold : float
        A damage index above it is an alarm.

    Returns
    -------
    float
        Between 0 and 1; NaN if no record has an index.

    Raises
    ------
    ValueError
        If the index is not a vector or the threshold not finite.

    Warns
    -----
    UserWarning
        How many records are not evaluated, if any.

    Examples
    --------
    >>> from skthermo.metrics import probability_of_false_alarm
    >>> probability_of_false_alarm([1.0, 2.0, 4.0, 1.5], threshold=3.0)
    0.25
    """
    return _share_above(damage_index, threshold)


def probability_of_detection(damage_index: ArrayLike, threshold: float) -> float:
    """Share of records of the damaged structure above the threshold (POD).

    Parameters
    ----------
    damage_index : array-like of shape (n_samples,)
        Damage index of records of the damaged structure; NaN where nothing can be evaluated, which counts neither as
        found nor as missed.
    threshold : float
        A damage index above it is an alarm.

    Returns
    -------
    float
        Between 0 and 1; NaN if no record has an index.

    Raises
    ------
    ValueError
        If the index is not a vector or the threshold not finite.

    Warns
    -----
    UserWarning
        How many records are not evaluated, if any.

    Examples
    --------
    >>> from skthermo.metrics import probability_of_detection
    >>> probability_of_detection([3.5, 2.0, 4.0, 5.0], threshold=3.0)
    0.75
    """
    return _share_above(damage_index, threshold)


def minimum_detectable_damage(severities: ArrayLike, pod: ArrayLike, level: float = 0.9) -> float:
    """Smallest tested severity from which damage is detected reliably (MDD) [KQP24]_.

    Parameters
    ----------
    severities : array-like of shape (n_severities,)
        Tested severities in any order, such as 0.1, 0.2, 0.3, or -0.1, -0.2, -0.3 for strengthening; all of one
        sign.
    pod : array-like of shape (n_severities,)
        Probability of detection (POD) at each severity, between 0 and 1; NaN counts as not detected.
    level : float, default=0.9
        POD that counts as reliable.

    Returns
    -------
    float
        The smallest severity, in magnitude, for which the POD reaches the level there and at every
        larger severity. NaN if the POD does not reach it at the largest one. There is no
        interpolation between tested severities.

    Raises
    ------
    ValueError
        If lengths differ, a severity is not finite, is 1 or more or occurs twice, severities are not all positive
        or all negative, or a probability is not between 0 and 1.

    Examples
    --------
    >>> from skthermo.metrics import minimum_detectable_damage
    >>> minimum_detectable_damage([0.1, 0.2, 0.3], [0.26, 0.95, 1.0])
    0.2
    """
    s, p, reliable_pod = (
        real_array(values, name) for name, values in (("severities", severities), ("pod", pod), ("level", level))
    )
    if all(is_labelled(values) for values in (severities, pod)):
        check_same_rows(severities, pod, ("severities", "pod"))
    if s.ndim != 1 or s.shape != p.shape or not s.size:
        raise ValueError(f"severities have shape {s.shape} and pod {p.shape}; expected two vectors of one length")
    if not np.isfinite(s).all() or len(np.unique(s)) < len(s):
        raise ValueError(f"severities are {s.tolist()}; expected different numbers")
    if not ((s > 0).all() or (s < 0).all()):
        raise ValueError(
            f"severities are {s.tolist()}; expected all positive (damage) or all negative (strengthening), and not 0, "
            "which is the healthy structure"
        )
    if (s >= 1).any():
        raise ValueError(f"severities are {s.tolist()}; expected shares of the stiffness below 1, not percent")
    for name, values in (("pod", p), ("level", reliable_pod)):
        if ((values < 0) | (values > 1)).any():
            raise ValueError(f"{name} is {values.tolist()}; expected probabilities between 0 and 1, not percent")
    if reliable_pod.shape or np.isnan(reliable_pod):
        raise ValueError(f"level is {reliable_pod.tolist()}; expected one probability between 0 and 1")
    descending = np.argsort(-np.abs(s))
    reliable = np.logical_and.accumulate(p[descending] >= reliable_pod)
    return float(s[descending][reliable][-1]) if reliable.any() else float("nan")


@overload
def time_to_detection(damage_index: pd.Series, threshold: float, onset: Any = None) -> Any: ...
@overload
def time_to_detection(damage_index: ArrayLike, threshold: float, onset: Any = None) -> float: ...
def time_to_detection(damage_index: ArrayLike, threshold: float, onset: Any = None) -> Any:
    """Time from the onset of damage to the first alarm.

    Parameters
    ----------
    damage_index : array-like or Series of shape (n_samples,)
        Damage index of records in order of time. A record with NaN is not evaluated: it raises no alarm, and the wait
        goes on.
    threshold : float
        A damage index above it is an alarm.
    onset : int or time, optional
        First damaged record: its position counted from 0 or, for a series on a ``DatetimeIndex``, a time, which may lie
        between two records or before all. By default the first record.

    Returns
    -------
    float or Timedelta
        Number of records from the onset to the first alarm at or after it, 0 if the record of the onset raises it, NaN
        if none does. For a series on a ``DatetimeIndex`` the time between them, or NaT.

    Raises
    ------
    ValueError
        If the index is not a vector or not in order of time, the threshold is not finite, or the onset is after
        the last record.

    Examples
    --------
    >>> from skthermo.metrics import time_to_detection
    >>> time_to_detection([5.0, 1.0, 2.0, 4.0, 5.0], threshold=3.0, onset=1)
    2.0
    """
    index, limit = _checked(damage_index, threshold)
    times = row_times(damage_index)
    if (np.diff(times) < 0).any():
        raise ValueError("the damage index is not in order of time; expected records in order")
    start = 0.0 if onset is None else time_of(damage_index, onset, "onset")
    if not len(times) or start > times[-1]:
        raise ValueError(f"onset is {onset!r} for {len(times)} records; expected one not after the last record")
    first = int(times.searchsorted(start))
    alarms = np.flatnonzero(index[first:] > limit)
    if isinstance(getattr(damage_index, "index", None), pd.DatetimeIndex):
        return pd.Timedelta(int(times[first + alarms[0]] - start), "ns") if alarms.size else pd.NaT
    return float(alarms[0]) if alarms.size else float("nan")


def _checked(damage_index: ArrayLike, threshold: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    index, limit = real_array(damage_index, "damage_index"), real_array(threshold, "threshold")
    if index.ndim != 1:
        raise ValueError(f"damage_index has shape {index.shape}; expected a vector (n_samples,)")
    if limit.shape or not np.isfinite(limit):
        raise ValueError(f"threshold is {limit.tolist()}; expected a finite number")
    return index, limit


def _share_above(damage_index: ArrayLike, threshold: float) -> float:
    index, limit = _checked(damage_index, threshold)
    present = index[~np.isnan(index)]
    if len(present) < len(index):
        text = "records without a damage index (NaN) are not evaluated. The rate counts the others"
        warn_each([UnevaluatedRowsWarning(text, "not-evaluated")])
    return float((present > limit).mean()) if present.size else float("nan")
