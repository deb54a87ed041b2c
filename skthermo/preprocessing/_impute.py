"""Gaps in monitoring records."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.impute import KNNImputer

from skthermo._validation import _check_feature_names_in, _num_samples, check_is_fitted, like


class KNNGapImputer(KNNImputer):
    """Fill gaps with the mean of the nearest complete neighbours.

    scikit-learn's ``KNNImputer`` with the ten neighbours of the paper; a frame stays a frame
    with its index, and a column without any value is an error and not dropped.

    Parameters
    ----------
    missing_values : int, float, str, numpy.nan, None or pandas.NA, default=numpy.nan
        What stands for a missing value.
    n_neighbors : int, default=10
        Number of neighbours.
    weights : {"uniform", "distance"} or callable, default="uniform"
        Weights of the neighbours.
    metric : {"nan_euclidean"} or callable, default="nan_euclidean"
        Distance between rows.
    copy : bool, default=True
        Whether to leave the input as it is.
    add_indicator : bool, default=False
        Whether to append columns that mark what was missing.
    keep_empty_features : bool, default=False
        True fills a column without any value with zeros instead of refusing it.

    See Also
    --------
    sklearn.impute.KNNImputer : The parameters in full.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.preprocessing import KNNGapImputer
    >>> F = pd.DataFrame({"f1": [4.0, 4.1, np.nan, 4.3], "f2": [5.0, 5.1, 5.1, 5.3]})
    >>> KNNGapImputer(n_neighbors=1).fit_transform(F).loc[[2]]
        f1   f2
    2  4.1  5.1
    """

    def __init__(
        self,
        *,
        missing_values: Any = np.nan,
        n_neighbors: int = 10,
        weights: Any = "uniform",
        metric: Any = "nan_euclidean",
        copy: bool = True,
        add_indicator: bool = False,
        keep_empty_features: bool = False,
    ):
        super().__init__(
            missing_values=missing_values,
            n_neighbors=n_neighbors,
            weights=weights,
            metric=metric,
            copy=copy,
            add_indicator=add_indicator,
            keep_empty_features=keep_empty_features,
        )

    def fit(self, X: ArrayLike, y: None = None) -> "KNNGapImputer":
        """Remember the rows among which neighbours are sought.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records with gaps, such as temperatures and frequencies side by side.
        y : None
            Ignored.

        Returns
        -------
        KNNGapImputer
            The fitted imputer.

        Raises
        ------
        ValueError
            If a column holds no value at all, unless ``keep_empty_features``.
        """
        super().fit(X, y)
        kept = set(super().get_feature_names_out())
        empty = [name for name in _check_feature_names_in(self, None) if name not in kept]
        if empty and not self.keep_empty_features:
            raise ValueError(
                f"the columns {empty} are missing in all {_num_samples(X)} rows; expected values to "
                "impute from: leave them out, or keep_empty_features=True fills them with zeros"
            )
        return self

    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Fill the gaps.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Records with gaps.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features)
            A frame gives a frame on its own index.
        """
        return like(X, super().transform(X), self.get_feature_names_out())

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the columns: those of the input, and of the indicators where asked for.

        Parameters
        ----------
        input_features : array-like of str, optional
            Names of the input's columns; by default those seen in `fit`.

        Returns
        -------
        ndarray of str
        """
        check_is_fitted(self)
        names = list(_check_feature_names_in(self, input_features))
        indicators = [name for name in super().get_feature_names_out(input_features) if name not in names]
        return np.array(names + indicators, dtype=object)
