"""Means of thermometers by role, so that structures with other thermometers have the same inputs."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from skthermo._tables.arrays import as_floats, means_of_known
from skthermo._tables.frames import Table, frame_like
from skthermo.preprocessing._records import RecordTransformer

EVERYWHERE = "ambient"
SINGULAR = 1e-9  # eigenvalue beside the largest that counts as zero


class SensorMeans(RecordTransformer):
    """Mean of the sensors of each role.

    Structures differ in number, names and places of their thermometers. Their mean by role ("air", "deck") is an input
    that all of them have.

    A sensor that fails does not make the mean jump: `fit` learns by how much each sensor differs from the others of its
    role, and `transform` allows for it where some are missing.

    Parameters
    ----------
    roles : mapping of str or int to str, optional
        Role of each column, by its name, or by its position in arrays. Columns whose role is None are left out. By
        default all columns have one role, "ambient".

    Attributes
    ----------
    columns_ : dict of str to list of int
        Positions of the columns of each role. Roles are sorted, as they are after `transform`.
    offsets_ : ndarray of shape (n_features,)
        By how much each sensor reads more than the mean of its role; NaN where a column is left out.
    n_features_in_ : int
        Number of columns.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    See Also
    --------
    LagFeatures : What the means were some time ago.

    Notes
    -----
    The offsets minimise the squares of x_ti - r_t - d_i over the values that are there, where r_t is the mean of the
    role in record t and the offsets d_i of its sensors sum to zero. In records without gaps, the result is the plain
    mean; where all sensors of a role are missing, it is NaN.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.preprocessing import SensorMeans
    >>> T = pd.DataFrame({"T1": [4.0, 8.0, np.nan], "T2": [6.0, 10.0, 3.0], "slab": [5.0, 7.0, 6.0]})
    >>> SensorMeans({"T1": "air", "T2": "air", "slab": "deck"}).fit_transform(T)
       air  deck
    0  5.0   5.0
    1  9.0   7.0
    2  2.0   6.0
    """

    _parameter_constraints: dict = {"roles": [Mapping, None]}

    def __init__(self, roles: Mapping[Hashable, str | None] | None = None):
        self.roles = roles

    def _learn(self, X: Table, values: NDArray) -> None:
        values = as_floats(values)
        role_of = self._read_roles()
        roles = sorted({role for role in role_of if role is not None})
        self.columns_ = {role: [i for i, own in enumerate(role_of) if own == role] for role in roles}
        self.offsets_ = np.full(values.shape[1], np.nan)
        for columns in self.columns_.values():
            self.offsets_[columns] = offsets_between(values[:, columns])

    def _transformed(self, X: Table, values: NDArray) -> Table:
        level = as_floats(values) - self.offsets_
        means = [means_of_known(level[:, columns], axis=1) for columns in self.columns_.values()]
        return frame_like(X, np.column_stack(means), self.columns_)

    def _names(self, columns: Sequence[Hashable]) -> list[Hashable]:
        return list(self.columns_)

    def _read_roles(self) -> list[str | None]:
        """Role of each column."""
        names = list(getattr(self, "feature_names_in_", range(self.n_features_in_)))
        if self.roles is None:
            return [EVERYWHERE] * len(names)
        if set(self.roles) != set(names):
            raise ValueError(
                f"roles names the columns {sorted(map(str, self.roles))}; expected each of {list(map(str, names))}, "
                "with None as the role of a column that is left out"
            )
        found = [self.roles[name] for name in names]
        if not all(role is None or isinstance(role, str) for role in found) or not any(found):
            raise ValueError(f"roles is {self.roles!r:.200}; expected names such as 'air', or None, and one at least")
        return found


def offsets_between(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """By how much columns differ from their mean, by least squares over the values that are there."""
    known = ~np.isnan(values)
    means = means_of_known(values, axis=1)[:, np.newaxis]
    shares = known / np.maximum(known.sum(axis=1, keepdims=True), 1)
    normal = np.diag(known.sum(axis=0)) - known.T @ shares
    # singular, because only differences are known: its zero eigenvalues are rounding errors of any size
    return np.linalg.lstsq(normal, np.where(known, values - means, 0.0).sum(axis=0), rcond=SINGULAR)[0]
