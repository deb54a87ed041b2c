"""Numbers of independent records."""

from __future__ import annotations

import numpy as np

from skthermo._core.arrays import Array, means_of_known


def independent_records(values: Array, n_parts: int = 12) -> float:
    """Number of independent records whose mean scatters as the mean of these records in order of time.

    Parameters
    ----------
    values : ndarray of shape (n_records,) or (n_records, n_columns)
        NaN is left out. Several columns, each in its standard deviations, tell one number together.
    n_parts : int, default=12
        Parts of equal length; the variance of their means tells the variance of the mean of all records. Of several
        columns, the correlation of neighbouring parts tells how much larger it is where records remember for longer
        than a part; a dozen parts tell it too vaguely from one column.

    Returns
    -------
    float
        From 1 to the number of records.

    Examples
    --------
    >>> import numpy as np
    >>> noise = np.random.RandomState(0).standard_normal((1200, 4))
    >>> bool(independent_records(noise) > 500), bool(independent_records(np.cumsum(noise, axis=0)) < 20)
    (True, True)
    """
    rows = values.reshape(len(values), -1) if values.size else np.empty((0, 1))
    rows = rows[~np.isnan(rows).all(axis=1)]
    rows = rows[:, np.nanstd(rows, axis=0) > 0] if len(rows) else rows
    if len(rows) < 2 * n_parts or not rows.shape[1]:
        return float(max(len(rows), 1))
    standard = (rows - means_of_known(rows)) / np.nanstd(rows, axis=0, ddof=1)
    means = np.array([means_of_known(part) for part in np.array_split(standard, n_parts)])
    means = np.nan_to_num(means - means_of_known(means))
    squares = (means**2).sum()
    neighbours = (n_parts * (means[1:] * means[:-1]).sum() / squares + 1) / (n_parts - 3)  # its bias removed
    neighbours = np.clip(neighbours, 0, 0.9) if rows.shape[1] > 1 else 0.0
    memory = (1 + neighbours) / (1 - neighbours)
    n_records = (~np.isnan(rows)).sum() / rows.shape[1]
    variance = squares / ((n_parts - 1) * rows.shape[1])
    return float(np.clip(n_parts / (variance * memory), 1, n_records))
