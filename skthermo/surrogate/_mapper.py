"""The temperature mapper M2: temperatures to parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from skthermo._estimators.regressors import check_takes_weights
from skthermo._tables.arrays import Array
from skthermo._tables.frames import check_columns, check_temperatures, frame_like, row_weights
from skthermo._validation import HasMethods, _fit_context, check_is_fitted, seeded, validate_data
from skthermo.surrogate._regression import MultiplierRegressor, default_lines


class TemperatureMapper(MultiplierRegressor):
    """Parameters of an FE model from temperatures, equation (6) [KCM26]_.

    Parameters
    ----------
    regressor : regressor, optional
        Any regressor; a regressor of a single output is fitted once for each parameter. It learns the standardised
        logarithms of the parameters from standardised temperatures, so that predictions are positive. If some
        parameters are not positive, no logarithm is taken. By default broken lines, ``make_pipeline(HingeFeatures(),
        RidgeCV(numpy.logspace(-3, 5, 33)))``, which go on straight beyond the data. See `paper_network` for the paper's
        network.
    random_state : int, RandomState or None, default=None
        Seed of the regressor, unless it has its own seed.

    Attributes
    ----------
    regressor_ : regressor
        Fitted to standardised temperatures (inputs) and standardised log parameters (outputs).
    inputs_, targets_ : Standardiser
        Means and scales of the temperatures and of the (log) parameters.
    n_parameters_, parameter_names_ : int, list of str or None
        Number of parameters and, where `fit` saw them in a frame, their names.
    y_is_vector_ : bool
        Whether `fit` saw one parameter as a vector.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of temperature columns and, where `fit` saw a frame with such, their names.

    Notes
    -----
    Rows with a missing temperature or parameter are left out in `fit`, and only there.

    On the last fifth of the healthy records of the bridge Z24, warmer than all others, the errors are 0.60 % with
    broken lines, about 0.7 % with small networks (different for each seed), 0.67 % with random forests, 0.73 % with
    boosted trees, 1.4 % with Gaussian processes and 7 % with quadratic polynomials (``examples/plot_regressors.py``).
    Trees stay at their last value beyond the data. Where few records show a sharp knee, networks follow it better.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.surrogate import TemperatureMapper
    >>> T = np.linspace(-10, 40, 50)[:, np.newaxis]
    >>> theta = np.exp(-0.004 * T)
    >>> mapper = TemperatureMapper(random_state=0).fit(T, theta)
    >>> bool(np.abs(mapper.predict([[20.0]]) - np.exp(-0.08)).max() < 0.01)
    True
    """

    _default_regressor = staticmethod(default_lines)
    _parameter_constraints: dict = {
        "regressor": [HasMethods(["fit", "predict"]), None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        regressor: BaseEstimator | None = None,
        *,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.regressor = regressor
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> TemperatureMapper:
        """Learn the mapping from complete rows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius, lagged or not.
        y : array-like or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row; those of a series are matched to the rows of a frame by index. A row of weight 0 counts
            as left out. Of a pipeline as the regressor, the last step gets the weights; with metadata routing, those
            steps that request them.

        Returns
        -------
        TemperatureMapper
            The fitted estimator.

        Raises
        ------
        ValueError
            If lengths or indices differ, a temperature is constant, missing throughout, in kelvin or holds a number
            that stands for a missing value, such as -999, or fewer than two rows are complete and have a weight; if
            weights are negative, NaN or infinite, not one for each row, or of no use to the regressor, whose ``fit``
            takes none.
        """
        T, theta = self._read_xy(X, y, ("temperatures", "theta"))
        named = frame_like(X, T)
        check_temperatures(named)
        check_columns(named, "temperature", varying=True)
        weights = row_weights(sample_weight, X)
        if weights is not None and self.regressor is not None:
            check_takes_weights(self.regressor)
        self._learn(T, theta, seeded(self.random_state), log_inputs=False, sample_weight=weights)
        return self

    def _predict_arrays(self, X: ArrayLike, return_std: bool = False) -> tuple[Array, Array]:
        check_is_fitted(self)
        inputs = validate_data(self, X, dtype=np.float64, ensure_all_finite="allow-nan", reset=False)
        return self._regress(inputs, return_std)
