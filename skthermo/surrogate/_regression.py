"""What both surrogates share: a regression from standardised inputs to log multipliers."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, StandardScaler

from skthermo._arrays import as_columns, as_floats
from skthermo._frames import check_same_rows, column_names, frame_like
from skthermo._threads import single_blas_thread
from skthermo._validation import check_array, check_is_fitted, clone_sharing_models, seed_parts, validate_data
from skthermo.metrics import complete_r2
from skthermo.surrogate._networks import default_network


class MultiplierRegressor(RegressorMixin, BaseEstimator):
    """Base of regressors onto multipliers: complete rows in, NaN where an input is missing.

    A subclass stores ``regressor`` and ``random_state`` and calls `_learn`.
    """

    _simulated_alone = False

    def predict(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Multipliers of the nominal parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Inputs; NaN is allowed.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            Positive if those learned from were; NaN in rows where an input is missing. A frame on X's
            index where X and the multipliers learned from were frames.
        """
        theta = self._predict_array(X)
        if self._y_is_vector:
            return theta[:, 0]
        return theta if self._parameter_names is None else frame_like(X, theta, self._parameter_names)

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """Coefficient of determination R2 over complete rows, averaged over parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Inputs.
        y : array-like or DataFrame of shape (n_samples, n_parameters)
            Multipliers.

        Returns
        -------
        float
            NaN if fewer than two rows are complete.
        """
        return complete_r2(as_columns(y), as_columns(self.predict(X)))

    def _learn(
        self, X: NDArray, y: NDArray, random_state: np.random.RandomState | None, *, log_inputs: bool = False
    ) -> None:
        """Fit on the complete rows of X and y (n_samples, n_parameters)."""
        complete = ~(np.isnan(X).any(axis=1) | np.isnan(y).any(axis=1))
        if complete.sum() < 2:
            raise ValueError(
                f"{type(self).__name__} got {complete.sum()} complete rows of {len(X)} samples; expected at least 2"
            )
        target = y[complete]
        regressor = default_network() if self.regressor is None else clone(self.regressor)
        self._log_inputs = log_inputs and is_positive(X[complete])
        regression = standardised_regression(regressor, log_inputs=self._log_inputs, log_targets=is_positive(target))
        seed_parts(regression, random_state)
        with single_blas_thread():
            self._regression = regression.fit(X[complete], target[:, 0] if target.shape[1] == 1 else target)
        self.regressor_ = self._regression.regressor_[-1]

    def _read_xy(self, X: Any, y: Any, names: tuple[str, str]) -> tuple[NDArray, NDArray]:
        """X and y, (n_samples, n_parameters), with NaN where something is missing."""
        if y is None:
            raise ValueError(
                f"This {type(self).__name__} estimator requires y to be passed, but the target y is None; "
                f"expected {names[1]}"
            )
        inputs = validate_data(self, X, dtype=np.float64, ensure_all_finite="allow-nan")
        targets = check_array(y, dtype=np.float64, ensure_all_finite="allow-nan", ensure_2d=False)
        plain_rows = isinstance(y, pd.DataFrame) and y.index.equals(pd.RangeIndex(len(y)))
        check_same_rows(X, targets if plain_rows else y, names)
        self._y_is_vector = targets.ndim == 1
        self._parameter_names = column_names(y, "") if isinstance(y, pd.DataFrame) else None
        return inputs, as_columns(targets)

    def _predict_array(self, X: ArrayLike) -> NDArray[np.float64]:
        check_is_fitted(self)
        table = as_floats(X) if self._simulated_alone else X  # no names to compare with
        inputs = validate_data(self, table, dtype=np.float64, ensure_all_finite="allow-nan", reset=False)
        if self._log_inputs and (inputs <= 0).any():
            row, column = np.argwhere(inputs <= 0)[0]
            raise ValueError(
                f"row {row} of {column_names(X, 'f')[column]!r} is {inputs[row, column]:g}; expected positive "
                "frequencies in Hz, NaN where one is missing"
            )
        complete = ~np.isnan(inputs).any(axis=1)
        theta = np.full((len(inputs), self._n_parameters), np.nan)
        if complete.any():
            # Far outside what was learned exp overflows to inf, which is what it should say.
            with np.errstate(over="ignore"):
                theta[complete] = as_columns(self._regression.predict(inputs[complete]))
        return theta

    def __sklearn_clone__(self) -> "MultiplierRegressor":
        return clone_sharing_models(self)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.target_tags.multi_output = True
        return tags


def standardised_regression(
    regressor: BaseEstimator, *, log_inputs: bool, log_targets: bool
) -> TransformedTargetRegressor:
    """Standardised inputs to standardised targets, or the logarithms of either; logarithms keep targets positive."""
    return TransformedTargetRegressor(
        make_pipeline(*([logarithm()] if log_inputs else []), standardiser(), regressor),
        transformer=make_pipeline(logarithm() if log_targets else identity(), standardiser()),
        check_inverse=False,
    )


def is_positive(values: NDArray) -> bool:
    """Whether all values have a logarithm."""
    return bool((values > 0).all())


def standardiser() -> StandardScaler:
    """To mean zero and unit variance, as an array whatever the user's configuration says."""
    return StandardScaler().set_output(transform="default")


def logarithm() -> FunctionTransformer:
    """To natural logarithms and back."""
    return FunctionTransformer(np.log, np.exp, check_inverse=False).set_output(transform="default")


def identity() -> FunctionTransformer:
    """Leaves arrays arrays and frames frames."""
    return FunctionTransformer().set_output(transform="default")
