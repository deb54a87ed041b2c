"""What every inverse of an FE model is: frequencies to parameters, and back by the model."""

from __future__ import annotations

from typing import Any, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import column_names, frame_like
from skthermo._validation import TransformerMixin, check_is_fitted, validate_data
from skthermo.fem import evaluate


class FrequencyInverse(TransformerMixin):
    """Base of transformers from frequencies, and perhaps mode shapes, to the parameters of ``model``."""

    @overload
    def inverse_transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Frequencies and, with ``dofs``, shapes of given parameters, computed by the FE model.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_parameters)
            Multipliers.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz, followed by components of shapes with a root mean square of 1; NaN in rows with NaN. A
            frame, whose columns must be the model's parameters, gives a frame on its own index.

        Raises
        ------
        ValueError
            If the estimator has no model, or the parameters are not the model's.
        """
        check_is_fitted(self)
        model, shapes = self._checked_model(), getattr(self, "shape_inputs_", None)
        names = [f"f{i + 1}" for i in range(model.n_modes)]
        if shapes is None:
            values = evaluate(model, X, n_jobs=self.n_jobs)
        else:
            values = shapes.of_parameters(model, as_floats(X), self.n_jobs)
            names += [f"shape{i + 1}_dof{dof}" for i in range(model.n_modes) for dof in shapes.dofs]
        return frame_like(X, values, getattr(self, "feature_names_in_", names))

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the parameters.

        Parameters
        ----------
        input_features : array-like of str, optional
            Ignored.

        Returns
        -------
        ndarray of str
            The model's parameter names; without a model those of the columns of y, else theta1, theta2, ...
        """
        check_is_fitted(self)
        numbered = [f"theta{i + 1}" for i in range(self.n_parameters_)]
        return np.array(self.parameter_names_ or numbered, dtype=object)

    def _checked_model(self) -> Any:
        if self.model is None:
            raise ValueError(f"{type(self).__name__} has no model; expected an FE model")
        return self.model

    def _positive(self, X: ArrayLike, n_frequencies: int | None) -> Array:
        """Columns as in `fit`, the first of which are frequencies; all if no number is given."""
        has_names = hasattr(self, "feature_names_in_") or not hasattr(X, "columns")
        inputs = validate_data(self, X if has_names else as_floats(X), dtype=np.float64, reset=False)
        frequencies = inputs[:, :n_frequencies]
        if (frequencies <= 0).any():
            row, column = np.argwhere(frequencies <= 0)[0]
            raise ValueError(
                f"row {row} of {column_names(X, 'f')[column]!r} is {frequencies[row, column]:g}; expected positive "
                "frequencies in Hz, NaN where one is missing"
            )
        return inputs
