"""The temperature mapper M2: temperatures to parameters."""

from numbers import Real

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from skthermo._arrays import Array, real_array
from skthermo._frames import check_columns, check_temperatures, frame_like
from skthermo._validation import HasMethods, Interval, _check_sample_weight, _fit_context, seeded
from skthermo.surrogate._networks import default_lines
from skthermo.surrogate._regression import MultiplierRegressor


class TemperatureMapper(MultiplierRegressor):
    """Parameters of an FE model from temperatures, equation (6).

    Parameters
    ----------
    regressor : regressor, optional
        Any regressor; a regressor of a single output is fitted once for each parameter. It learns the standardised
        logarithms of the parameters from standardised temperatures, so that predictions are positive. If some
        parameters are not positive, no logarithm is taken. By default broken lines,
        ``make_pipeline(HingeFeatures(), RidgeCV(numpy.logspace(-3, 5, 33)))``, which go on straight beyond the data.
        See `paper_network` for the paper's network.
    sensitivities : array-like of shape (n_modes, n_parameters), optional
        Derivatives d ln f / d ln theta of an FE model. The regressor then learns z = sensitivities ln theta, the change
        of ln f to first order, so that errors of parameters count as much as they change the frequencies; theta follows
        by damped least squares. `DataInformedFEM` gives those of its model.
    damping : float or array-like of shape (n_parameters,), default=0.0
        What damped least squares adds to the diagonal of sensitivities' sensitivities. It keeps parameters that hardly
        change the frequencies near their means.
    random_state : int, RandomState or None, default=None
        Seed of the regressor, unless it has its own seed.

    Attributes
    ----------
    regressor_ : regressor
        Fitted to standardised temperatures (inputs) and standardised log parameters (outputs).
    inputs_, targets_ : Standardiser
        Means and scales of the temperatures and of the (log) parameters.
    n_parameters_ : int
        Number of parameters.
    parameter_names_ : list of str or None
        Their names, where `fit` saw them in a frame.
    y_is_vector_ : bool
        Whether `fit` saw one parameter as a vector.
    n_features_in_ : int
        Number of temperature columns.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    Notes
    -----
    Rows with a missing temperature or parameter are left out in `fit`, and only there.

    On the last fifth of the healthy records of the bridge Z24, warmer than all others, the errors are 0.60 % with
    broken lines, about 0.7 % with small networks (different for each seed), 0.67 % with random forests, 0.73 % with
    boosted trees, 1.4 % with Gaussian processes and 7 % with quadratic polynomials (``examples/plot_regressors.py``).
    Trees stay at their last value beyond the data. Where few records show a sharp knee, networks follow it better.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519 [KCM26]_.

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
        "sensitivities": ["array-like", None],
        "damping": [Interval(Real, 0, None, closed="left"), "array-like"],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        regressor: BaseEstimator | None = None,
        *,
        sensitivities: ArrayLike | None = None,
        damping: ArrayLike = 0.0,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.regressor = regressor
        self.sensitivities = sensitivities
        self.damping = damping
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> "TemperatureMapper":
        """Learn the mapping from complete rows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius, lagged or not.
        y : array-like or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row; a regressor whose ``fit`` takes no weights ignores them.

        Returns
        -------
        TemperatureMapper
            The fitted estimator.

        Raises
        ------
        ValueError
            If lengths or indices differ, a temperature is constant, missing throughout, in kelvin or holds a number
            that stands for a missing value, such as -999, or fewer than two rows are complete; if ``sensitivities``
            do not have a column for each parameter, or theta is not positive there.
        """
        T, theta = self._read_xy(X, y, ("temperatures", "theta"))
        named = frame_like(X, T)
        check_temperatures(named)
        check_columns(named, "temperature", varying=True)
        weights = None if sample_weight is None else _check_sample_weight(sample_weight, T, ensure_non_negative=True)
        self._learn(
            T,
            theta,
            seeded(self.random_state),
            log_inputs=False,
            coordinates=self._coordinates(theta),
            damping=self._damping(theta),
            sample_weight=weights,
        )
        return self

    def _coordinates(self, theta: Array) -> Array | None:
        if self.sensitivities is None:
            return None
        sensitivities = real_array(self.sensitivities, "sensitivities")
        if sensitivities.ndim != 2 or sensitivities.shape[1] != theta.shape[1] or not np.isfinite(sensitivities).all():
            raise ValueError(
                f"sensitivities have shape {sensitivities.shape}; expected finite numbers, (n_modes, "
                f"{theta.shape[1]}), a column for each parameter"
            )
        if (theta <= 0).any():
            raise ValueError(f"theta falls to {np.nanmin(theta):g}; expected positive multipliers with sensitivities")
        return sensitivities

    def _damping(self, theta: Array) -> Array:
        damping = real_array(self.damping, "damping")
        if damping.shape not in ((), theta.shape[1:]) or not ((damping >= 0) & np.isfinite(damping)).all():
            raise ValueError(f"damping is {damping}; expected one number from 0, or {theta.shape[1]}, one a parameter")
        return damping
