"""Removes the offset between measured frequencies and those of an FE model."""

from __future__ import annotations

from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.arguments import by_mode, is_model
from skthermo._tables.arrays import as_floats, real_array
from skthermo._tables.frames import Table, check_columns, frame_like, warn_of_markers
from skthermo._validation import HasMethods, StrOptions, check_array, check_is_fitted
from skthermo.preprocessing._records import RecordTransformer


class BiasAligner(RecordTransformer):
    """Move measured frequencies so that their means are the model's frequencies, equation (22).

    Parameters
    ----------
    reference : array-like of shape (n_modes,), FE model or None, default=None
        Means of the frequencies after `transform`: a vector in Hz, or an FE model, which stands for
        its nominal frequencies. None stands for the model of the `~skthermo.surrogate.DataInformedFEM` whose aligner
        this is; elsewhere for zeros, or for ones with ``method="scale"``.
    method : {"shift", "scale"}, default="shift"
        ``F - mean(F) + reference``, or ``F / mean(F) * reference``, which keeps relative changes.

    Attributes
    ----------
    mean_ : ndarray of shape (n_modes,)
        Means of the measured frequencies in Hz, NaN ignored.
    reference_ : ndarray of shape (n_modes,)
        Means after `transform`, in Hz.
    n_features_in_ : int
        Number of modes.
    feature_names_in_ : ndarray of str
        Names of the modes, where `fit` saw a frame with such names.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519 [KCM26]_.

    Examples
    --------
    >>> from skthermo.preprocessing import BiasAligner
    >>> aligner = BiasAligner([4.0, 9.0]).fit([[3.9, 9.3], [4.3, 9.5]])
    >>> aligner.transform([[4.1, 9.5]]).round(3)
    array([[4. , 9.1]])
    >>> aligner.inverse_transform([[4.0, 9.1]]).round(3)
    array([[4.1, 9.5]])
    """

    _parameter_constraints: dict = {
        "reference": ["array-like", HasMethods(["frequencies"]), None],
        "method": [StrOptions({"shift", "scale"})],
    }

    def __init__(self, reference: Any = None, *, method: Literal["shift", "scale"] = "shift"):
        self.reference = reference
        self.method = method

    def _learn(self, X: Table, values: NDArray) -> None:
        check_columns(frame_like(X, values), "frequency")
        warn_of_markers(frame_like(X, values))
        self.mean_ = np.nanmean(values, axis=0)
        self.reference_ = self._read_reference(values.shape[1])
        if self.method == "scale":
            for what, factors in (("mean", self.mean_), ("reference", self.reference_)):
                if (factors == 0).any():
                    name = self.get_feature_names_out()[factors == 0][0]
                    raise ValueError(f"the {what} of mode {name!r} is zero; expected another number to scale by")

    def _transformed(self, X: Table, values: NDArray) -> Table:
        if self.method == "scale":
            return frame_like(X, values / self.mean_ * self.reference_)
        return frame_like(X, values - self.mean_ + self.reference_)

    @overload
    def inverse_transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Shift or scale the model's frequencies back to the measured ones.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            In Hz; NaN stays NaN.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_modes)
            Frequencies in the measured domain in Hz.
        """
        check_is_fitted(self)
        if hasattr(X, "columns") and hasattr(self, "feature_names_in_"):
            F = self._validated(X, reset=False)
        else:  # frequencies of a model have no column names
            F = check_array(X, dtype=[np.float64, np.float32], ensure_all_finite="allow-nan")
        if F.shape[1] != self.n_features_in_:
            raise ValueError(f"X has {F.shape[1]} features; expected {self.n_features_in_} modes, as in fit")
        if self.method == "scale":
            return frame_like(X, F / self.reference_ * self.mean_)
        return frame_like(X, F - self.reference_ + self.mean_)

    def _read_reference(self, n_modes: int) -> NDArray[np.float64]:
        if self.reference is None:
            return np.full(n_modes, 1.0 if self.method == "scale" else 0.0)
        if is_model(self.reference):
            reference = as_floats(self.reference.frequencies(np.ones((1, len(self.reference.parameter_names)))))[0]
        else:
            names = getattr(self, "feature_names_in_", None)
            reference = real_array(by_mode(self.reference, n_modes, names, "reference"), "reference")
        if reference.shape != (n_modes,) or not np.isfinite(reference).all():
            raise ValueError(
                f"reference {reference} has shape {reference.shape}; expected a frequency for each of the "
                f"{n_modes} modes of X"
            )
        return reference
