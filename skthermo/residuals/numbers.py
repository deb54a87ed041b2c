"""Numbers of independent records."""

from __future__ import annotations

import numpy as np

from skthermo._core.arrays import Array


def independent_records(values: Array, n_parts: int = 12) -> float:
    """Number of independent records whose mean scatters as the mean of these records in order of time.

    Parameters
    ----------
    values : ndarray of shape (n_records,)
        NaN is left out.
    n_parts : int, default=12
        Parts of equal length; the variance of their means tells the variance of the mean of all records, however long
        records remember.

    Returns
    -------
    float
        From 1 to the number of records.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.RandomState(0).standard_normal(1200)
    >>> bool(independent_records(noise) > 500), bool(independent_records(np.cumsum(noise)) < 20)
    (True, True)
    """
    known = values[~np.isnan(values)]
    if len(known) < 2 * n_parts or not np.ptp(known):
        return float(max(len(known), 1))
    starts = np.arange(n_parts) * len(known) // n_parts
    means = np.add.reduceat(known, starts) / np.diff(np.append(starts, len(known)))
    return float(np.clip(n_parts * known.var(ddof=1) / max(means.var(ddof=1), np.finfo(float).tiny), 1, len(known)))
