"""Thresholds of damage indices that keep a rate of false alarms."""

from collections.abc import Callable
from functools import lru_cache

import numpy as np
import scipy  # which loads scipy.signal once it is used

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import FewRecordsWarning


def quantile_threshold(index: Array, contamination: float) -> float:
    """The (1 - contamination) quantile of a baseline's indices, NaN left out."""
    return float(np.nanquantile(index, 1 - contamination))


FEWEST_INDEPENDENT = 50  # baseline records, from which one baseline's rate of false alarms is close to the mean
FAR_ABOVE = 2.5  # times as far from the median of a baseline's own indices as their quantile is
N_SIMULATED, MOST_SIMULATED, N_NEW, START = 200, 400, 50, 200
"""Number of simulated baselines, most records of each, new records that each evaluates, records before the first."""


@lru_cache
def factor_of_few(n_records: int, n_modes: int, correlation_time: float, contamination: float) -> float:
    """What the indices of a short, dependent baseline are multiplied by, so that they are as those of new records.

    Normally distributed baselines of so many records and modes are drawn, in which each mode is an autoregression of
    first order with the given correlation time. It is the ratio of the distance that new, independent records exceed
    at the rate asked for, on the mean over such baselines, to that which as many of a baseline's own records exceed.
    """
    n_drawn = min(n_records, MOST_SIMULATED)  # longer steps stand for a long baseline
    memory = ((correlation_time - 1) / (correlation_time + 1)) ** (n_records / n_drawn)
    rate, random = max(contamination, 1 / (n_records + 1)), np.random.RandomState(0)
    shocks = random.standard_normal((N_SIMULATED, START + n_drawn, n_modes))
    rows = scipy.signal.lfilter([np.sqrt(1 - memory**2)], [1.0, -memory], shocks, axis=1)[:, START:]
    mean = rows.mean(axis=1, keepdims=True)
    precision = np.linalg.inv(np.einsum("rij,rik->rjk", rows - mean, rows - mean) / n_drawn)
    new = random.standard_normal((N_SIMULATED, N_NEW, n_modes))
    own, later = (
        np.sqrt(np.einsum("rij,rjk,rik->ri", some - mean, precision, some - mean, optimize=True))
        for some in (rows, new)
    )
    return float(np.quantile(later / np.quantile(own, 1 - rate, axis=1)[:, np.newaxis], 1 - rate))


def conformal_threshold(
    index: Array, contamination: float, share: float = 1.0, what: str = "records", n_independent: float | None = None
) -> float:
    """The ceil((n + 1)(1 - contamination))-th smallest index, which a new one exceeds with that probability at most.

    Each index comes from a detector that was not fitted on its record; NaN is left out. ``share`` is the number of
    independent records for each record by which the rank is chosen, where they depend on their neighbours in time;
    ``n_independent`` the number of which warnings speak (by default that of the rank).
    """
    ordered = np.sort(index[~np.isnan(index)])
    n_independent = share * len(ordered) if n_independent is None else n_independent
    rank = int(np.ceil((len(ordered) + 1 / share) * (1 - contamination) - 1e-9))
    threshold = float(ordered[min(rank, len(ordered)) - 1])
    if threshold == np.inf:
        raise ValueError(
            f"{len(ordered)} baseline rows are too few for their number of modes: some single row decides alone "
            "about a direction; expected more rows"
        )
    if rank > len(ordered):
        warn_user(
            f"{np.floor(n_independent):.0f} independent baseline {what} are too few for a false-alarm rate of "
            f"{contamination:.2g} (expected {np.ceil(1 / contamination - 1):.0f} or more). The threshold is the "
            f"largest index, which later {what} exceed at a rate of about {1 / (n_independent + 1):.2g}. Give a longer "
            "baseline, or a higher contamination",
            FewRecordsWarning,
            "few-baseline-records",
        )
    elif n_independent < min(FEWEST_INDEPENDENT, share * len(ordered)):
        warn_user(
            f"the {len(ordered)} baseline {what} depend on each other in time and count as {n_independent:.0f} "
            f"independent ones (expected {FEWEST_INDEPENDENT} or more). On average over such baselines, false alarms "
            f"are {contamination:.2g} of the records; after this one, they may be several times as many. Give a longer "
            "baseline, or a regression whose residuals depend less on each other",
            FewRecordsWarning,
            "few-baseline-records",
        )
    return threshold


def warn_of_blindness(own: Array, threshold: float, contamination: float, seen_at: Callable[[float], str]) -> None:
    """Warn if a threshold is far above the indices that a detector gives its own baseline, with what it still sees."""
    own = own[~np.isnan(own)]
    if not own.size:
        return
    middle, suggested = np.quantile(own, [0.5, 1 - contamination])
    if threshold - middle > FAR_ABOVE * (suggested - middle):
        warn_user(
            f"the threshold is {threshold:.3g}. It is more than {FAR_ABOVE:g} times as far from the median of the "
            f"baseline's own indices as {suggested:.3g}, which {contamination:.2g} of them exceed. The baseline has "
            f"few records, records that depend on each other, or outliers{seen_at(threshold)}. Give a longer baseline, "
            "or one without outliers; threshold='quantile' takes the lower value, with more false alarms",
            FewRecordsWarning,
            "high-threshold",
        )
