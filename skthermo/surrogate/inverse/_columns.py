"""Columns of the inverse surrogate: frequencies and components of mode shapes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import Bunch

from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import column_names
from skthermo._validation import validate_data
from skthermo.fem import add_noise, evaluate
from skthermo.surrogate.refinement import ShapeInputs


@dataclass(frozen=True)
class InverseColumns:
    """How an `InverseSurrogate` reads, names and computes its columns: frequencies and, perhaps, shapes."""

    model: Any
    shapes: ShapeInputs | None
    n_jobs: int | None

    @classmethod
    def of(cls, inverse: Any) -> "InverseColumns":
        """The columns that the parameters of an `InverseSurrogate` ask for."""
        if inverse.dofs is None:
            return cls(inverse.model, None, inverse.n_jobs)
        if inverse.model is None:
            raise ValueError("dofs are given without a model; expected an FE model whose degrees of freedom they are")
        return cls(inverse.model, ShapeInputs.of(inverse.model, inverse.dofs, inverse.shape_noise), inverse.n_jobs)

    def names(self) -> list[str]:
        """Names of the columns."""
        modes = [f"f{i + 1}" for i in range(self.model.n_modes)]
        dofs = () if self.shapes is None else self.shapes.dofs
        return modes + [f"shape{i + 1}_dof{dof}" for i in range(self.model.n_modes) for dof in dofs]

    def check(self, inverse: Any, X: Any) -> None:
        """Check number and names of the columns; without X, they are those of an array."""
        n_columns = len(self.names())
        names_only = np.ones((1, n_columns)) if X is None else X
        found = validate_data(inverse, names_only, ensure_all_finite="allow-nan").shape[1]
        if found != n_columns:
            more = f" and their shapes at {self.shapes.n_sensors} sensors, {n_columns} columns" if self.shapes else ""
            raise ValueError(f"X has {found} columns; expected the {self.model.n_modes} modes of {self.model!r}{more}")

    def read(self, inverse: Any, X: ArrayLike) -> Array:
        """Measured columns, with shapes normalised."""
        has_names = hasattr(inverse, "feature_names_in_") or not hasattr(X, "columns")
        values = X if has_names else as_floats(X)
        inputs = validate_data(inverse, values, dtype=np.float64, ensure_all_finite="allow-nan", reset=False)
        frequencies = inputs if self.shapes is None else inputs[:, : self.shapes.n_modes]
        if inverse.inputs_.log and (frequencies <= 0).any():
            row, column = np.argwhere(frequencies <= 0)[0]
            raise ValueError(
                f"row {row} of {column_names(X, 'f')[column]!r} is {frequencies[row, column]:g}; expected positive "
                "frequencies in Hz, NaN where one is missing"
            )
        return inputs if self.shapes is None else self.shapes.normalised(inputs)

    def of_parameters(self, theta: ArrayLike) -> Array:
        """Columns that the model gives for rows of theta, without noise."""
        if self.shapes is None:
            return evaluate(self.model, theta, n_jobs=self.n_jobs)
        return self.shapes.of_parameters(self.model, theta, self.n_jobs)

    def noisy(self, drawn: Bunch, noise: ArrayLike, random: np.random.RandomState) -> Array:
        """Columns of simulated samples with the noise of a measurement."""
        frequencies = add_noise(drawn.frequencies, noise, random_state=random)
        if self.shapes is None:
            return frequencies
        shapes = drawn.shapes.swapaxes(1, 2).reshape(len(frequencies), -1)
        return self.shapes.with_noise(self.shapes.normalised(np.hstack([frequencies, shapes])), random)


class ShapeScores:
    """A few positive scores in place of many components: linear estimates of the parameters.

    Ridge regression of ln theta on ln f and the components learns them from noisy simulations. A regressor then has
    n_modes + n_parameters inputs, however many sensors there are.
    """

    def __init__(self, n_modes: int, inputs: Array, theta: Array):
        self._n_modes = n_modes
        complete = ~(np.isnan(inputs).any(axis=1) | np.isnan(theta).any(axis=1))
        self._linear = make_pipeline(StandardScaler(), Ridge())
        self._linear.fit(self._columns(inputs[complete]), np.log(theta[complete]))

    def transform(self, inputs: Array) -> Array:
        """Frequencies and scores, (n_samples, n_modes + n_parameters); NaN in rows that are not complete."""
        scores = np.full((len(inputs), self._linear[-1].coef_.shape[0]), np.nan)
        complete = ~np.isnan(inputs).any(axis=1)
        if complete.any():
            scores[complete] = np.exp(self._linear.predict(self._columns(inputs[complete])))
        return np.hstack([inputs[:, : self._n_modes], scores])

    def _columns(self, inputs: Array) -> Array:
        return np.hstack([np.log(inputs[:, : self._n_modes]), inputs[:, self._n_modes :]])
