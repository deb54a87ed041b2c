"""The part of the inverse surrogate that reads its columns, frequencies and components of shapes, and names them."""

from typing import Any, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from skthermo._arrays import Array, as_floats
from skthermo._frames import column_names, frame_like
from skthermo._validation import check_is_fitted, validate_data
from skthermo.fem import add_noise, evaluate
from skthermo.surrogate._regression import MultiplierRegressor
from skthermo.surrogate._shape_inputs import ShapeInputs, ShapeScores


class InverseInputs(MultiplierRegressor):
    """Methods of `InverseSurrogate` that concern its columns."""

    model: Any
    noise: ArrayLike
    dofs: ArrayLike | None
    shape_noise: ArrayLike
    n_jobs: int | None
    shape_inputs_: ShapeInputs | None

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
        if self.model is None:
            raise ValueError("InverseSurrogate has no model; expected an FE model to turn parameters into frequencies")
        names = getattr(self, "feature_names_in_", self._column_names())
        return frame_like(X, self._of_parameters(X), names)

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the parameters.

        Parameters
        ----------
        input_features : array-like of str, optional
            Ignored.

        Returns
        -------
        ndarray of str
            The model's parameter names, else y's columns, else theta1, theta2, ...
        """
        check_is_fitted(self)
        numbered = [f"theta{i + 1}" for i in range(self.n_parameters_)]
        return np.array(self.parameter_names_ or numbered, dtype=object)

    def _read_dofs(self) -> ShapeInputs | None:
        if self.dofs is None:
            return None
        if self.model is None:
            raise ValueError("dofs are given without a model; expected an FE model whose degrees of freedom they are")
        return ShapeInputs.of(self.model, self.dofs, self.shape_noise)

    def _of_parameters(self, theta: ArrayLike) -> Array:
        """Inputs that the model gives for rows of theta, without noise."""
        if self.shape_inputs_ is None:
            return evaluate(self.model, theta, n_jobs=self.n_jobs)
        return self.shape_inputs_.of_parameters(self.model, theta, self.n_jobs)

    def _column_names(self) -> list[str]:
        modes = [f"f{i + 1}" for i in range(self.model.n_modes)]
        dofs = () if self.shape_inputs_ is None else self.shape_inputs_.dofs
        return modes + [f"shape{i + 1}_dof{dof}" for i in range(self.model.n_modes) for dof in dofs]

    def _check_columns(self, X: Any) -> None:
        """Check number and names of the columns; without X, they are those of an array."""
        shapes = self.shape_inputs_
        n_columns = self.model.n_modes if shapes is None else shapes.n_columns
        names_only = np.ones((1, n_columns)) if X is None else X
        found = validate_data(self, names_only, ensure_all_finite="allow-nan").shape[1]
        if found != n_columns:
            more = f" and their shapes at {shapes.n_sensors} sensors, {n_columns} columns" if shapes else ""
            raise ValueError(f"X has {found} columns; expected the {self.model.n_modes} modes of {self.model!r}{more}")

    def _noisy(self, drawn: Bunch, random: np.random.RandomState) -> Array:
        """Simulated inputs with the noise of a measurement."""
        frequencies = add_noise(drawn.frequencies, self.noise, random_state=random)
        if self.shape_inputs_ is None:
            return frequencies
        shapes = drawn.shapes.swapaxes(1, 2).reshape(len(frequencies), -1)
        clean = self.shape_inputs_.normalised(np.hstack([frequencies, shapes]))
        return self.shape_inputs_.with_noise(clean, random)

    def _scored(self, inputs: Array, theta: Array) -> Array:
        """What the regressor learns from: inputs with scores in place of components."""
        if self.shape_inputs_ is None:
            return inputs
        if inputs.shape[1] != self.shape_inputs_.n_columns:
            self._check_columns(inputs)
        inputs = self.shape_inputs_.normalised(inputs)
        self.scores_ = ShapeScores(self.shape_inputs_.n_modes, inputs, theta)
        return self.scores_.transform(inputs)

    def _estimate(self, inputs: Array, return_std: bool = False) -> tuple[Array, Array]:
        return super()._estimate(inputs if self.shape_inputs_ is None else self.scores_.transform(inputs), return_std)

    def _read_inputs(self, X: ArrayLike) -> NDArray[np.float64]:
        has_names = hasattr(self, "feature_names_in_") or not hasattr(X, "columns")
        inputs = super()._read_inputs(X if has_names else as_floats(X))
        frequencies = inputs if self.shape_inputs_ is None else inputs[:, : self.shape_inputs_.n_modes]
        if self.inputs_.log and (frequencies <= 0).any():
            row, column = np.argwhere(frequencies <= 0)[0]
            raise ValueError(
                f"row {row} of {column_names(X, 'f')[column]!r} is {frequencies[row, column]:g}; expected positive "
                "frequencies in Hz, NaN where one is missing"
            )
        return inputs if self.shape_inputs_ is None else self.shape_inputs_.normalised(inputs)
