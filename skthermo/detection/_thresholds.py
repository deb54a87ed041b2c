"""Thresholds of damage indices that keep a rate of false alarms."""

import numpy as np

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import FewRecordsWarning


def quantile_threshold(index: Array, contamination: float) -> float:
    """The (1 - contamination) quantile of a baseline's indices, NaN left out."""
    return float(np.nanquantile(index, 1 - contamination))


FEWEST_INDEPENDENT = 50  # baseline records, from which one baseline's rate of false alarms is close to the mean


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
            f"{np.floor(n_independent):.0f} independent baseline {what} are too few for a rate of false alarms of "
            f"{contamination:.2g}: the threshold is the largest index, which later ones exceed at a rate of about "
            f"{1 / (n_independent + 1):.2g}; expected at least {np.ceil(1 / contamination - 1):.0f}",
            FewRecordsWarning,
            "few records for a threshold",
        )
    elif n_independent < min(FEWEST_INDEPENDENT, share * len(ordered)):
        warn_user(
            f"the {len(ordered)} baseline {what} depend on each other in time and count as {n_independent:.0f} "
            f"independent ones: false alarms are {contamination:.2g} of the records on the mean over such baselines, "
            f"but may be far more or fewer after this one; expected {FEWEST_INDEPENDENT} independent ones or more",
            FewRecordsWarning,
            "few records for a threshold",
        )
    return threshold
