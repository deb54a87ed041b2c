"""The whole chain: temperatures and frequencies in, a thermal FE model out."""

import warnings
from collections.abc import Mapping
from typing import Any, TypeAlias

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin

from skthermo._arrays import as_columns, as_floats
from skthermo._frames import check_same_rows, column_names, frame_like
from skthermo._validation import (
    HasMethods,
    StrOptions,
    _fit_context,
    check_is_fitted,
    clone_sharing_models,
    validate_data,
)
from skthermo.fem import FEModel, add_noise, evaluate
from skthermo.metrics import complete_r2
from skthermo.surrogate._chain_parts import clone_parts, read_records

POSSIBLE = (1e-6, 1e6)
"""Multipliers outside which a model's matrices lose all digits."""

Table: TypeAlias = NDArray[np.float64] | pd.DataFrame


class DataInformedFEM(RegressorMixin, BaseEstimator):
    """FE model whose parameters follow temperature as monitoring data say.

    The method of Kamali et al. (2026), Section 2: measured frequencies become parameters
    (M1, eq. (5)), temperatures are mapped to those parameters (M2, eq. (6)), and the FE model,
    healthy or damaged, turns them into frequencies again (eqs. (7)-(8)).

    Parameters
    ----------
    model : FE model
        Its modes are the columns of the frequencies.
    inverse : transformer, optional
        M1. By default ``InverseSurrogate(model)``; an InverseSurrogate without a model gets
        this one.
    mapper : regressor, optional
        M2. By default ``TemperatureMapper()``; with thermal inertia, for example
        ``make_pipeline(LagFeatures(), TemperatureMapper())``.
    aligner : transformer or "passthrough", default="passthrough"
        Takes measured frequencies to the model's domain and back, such as ``BiasAligner(model)``.
    imputer : transformer or "passthrough", default="passthrough"
        Completes the frequencies from temperatures and frequencies side by side, in `fit` only.
        Without it, rows with a missing mode do not train M2.
    random_state : int, RandomState or None, default=None
        Seeds every part that has no seed of its own.

    Attributes
    ----------
    inverse_, mapper_, aligner_ : estimators
        Fitted clones.
    imputer_ : estimator or None
        Fitted clone.
    parameters_ : DataFrame or ndarray of shape (n_samples, n_parameters)
        Multipliers that M1 found in the training data, eq. (5).
    parameter_names_, mode_names_ : list of str
        Columns of the parameters and of the frequencies.
    n_features_in_ : int
        Number of temperature columns.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    Notes
    -----
    ``predict(T)`` is ``aligner_.inverse_transform(model.frequencies(predict_parameters(T)))``
    and nothing else: no correction is learned behind the FE model. Temperatures in a frame
    give frames. A row that cannot be computed is NaN; none is dropped.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.metrics import mape
    >>> from skthermo.surrogate import DataInformedFEM, InverseSurrogate
    >>> year = make_truss_campaign(random_state=0)
    >>> model = make_truss()
    >>> fem = DataInformedFEM(model, inverse=InverseSurrogate(bounds=0.2, noise=0.01), random_state=0)
    >>> fem = fem.fit(year.temperatures, year.frequencies)
    >>> later = make_truss_campaign(damage={"bottom": 0.5}, random_state=1)
    >>> damaged = fem.simulate(later.temperatures, damage={"bottom": 0.5})
    >>> bool(mape(later.clean_frequencies, damaged).max() < 1.5)
    True
    """

    _parameter_constraints: dict = {
        "model": [HasMethods(["frequencies"])],
        "inverse": [HasMethods(["fit", "transform"]), None],
        "mapper": [HasMethods(["fit", "predict"]), None],
        "aligner": [HasMethods(["fit", "transform", "inverse_transform"]), StrOptions({"passthrough"})],
        "imputer": [HasMethods(["fit_transform"]), StrOptions({"passthrough"})],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        model: FEModel,
        *,
        inverse: BaseEstimator | None = None,
        mapper: BaseEstimator | None = None,
        aligner: BaseEstimator | str = "passthrough",
        imputer: BaseEstimator | str = "passthrough",
        random_state: int | np.random.RandomState | None = None,
    ):
        self.model = model
        self.inverse = inverse
        self.mapper = mapper
        self.aligner = aligner
        self.imputer = imputer
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: ArrayLike) -> "DataInformedFEM":
        """Learn how temperature moves the parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius; NaN is allowed.
        y : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies of the healthy structure in Hz; NaN is allowed.

        Returns
        -------
        DataInformedFEM
            The fitted estimator.

        Raises
        ------
        ValueError
            If lengths or indices differ, the number of modes is not the model's, a temperature
            is constant or missing throughout, or a mode was never measured.
        """
        T, F = read_records(self, X, y)
        self.mode_names_ = column_names(F, "f")
        self.parameter_names_ = list(self.model.parameter_names)
        self.inverse_, self.mapper_, self.aligner_, self.imputer_ = clone_parts(self)
        theta = self._fit_inverse(self._completed(T, F))
        self.parameters_ = frame_like(T, theta, self.parameter_names_)
        self.mapper_.fit(T, self.parameters_)
        return self

    def estimate_parameters(self, F: ArrayLike) -> Table:
        """Parameters behind measured frequencies, eq. (5).

        Parameters
        ----------
        F : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz; NaN is allowed.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters; NaN where a mode is missing.

        Raises
        ------
        ValueError
            If the number or the names of the modes differ from `fit`, or a frequency is not positive.
        """
        check_is_fitted(self)
        theta = as_floats(self.inverse_.transform(self.aligner_.transform(F)))
        return frame_like(F, theta, self.parameter_names_)

    def predict_parameters(self, X: ArrayLike) -> Table:
        """Parameters at given temperatures, eq. (7).

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters; NaN where M2 has no complete input, and, with a warning,
            where it gives what no structure has (less than 1e-6 or more than 1e6).
        """
        return frame_like(X, self._predict_theta(X), self.parameter_names_)

    def predict(self, X: ArrayLike) -> Table:
        """Frequencies of the healthy structure at given temperatures.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain.
        """
        return frame_like(X, self._frequencies(self.model, X), self.mode_names_)

    def simulate(
        self,
        X: ArrayLike,
        *,
        damage: Mapping[str, float] | None = None,
        noise: ArrayLike = 0.0,
        random_state: int | np.random.RandomState | None = None,
    ) -> Table:
        """Frequencies of the structure, healthy or damaged, as monitoring would record them, eq. (8).

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        damage : mapping of str to float, optional
            Severity by damage group of the model: 0.5 is half the stiffness.
        noise : float or array-like of shape (n_modes,), default=0.0
            Relative standard deviation of Gaussian noise on the frequencies.
        random_state : int, RandomState or None, default=None
            Seed of the noise.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain.

        Raises
        ------
        ValueError
            If a damage group is unknown, a severity is 1 or more, or the model cannot be damaged.
        """
        frequencies = self._frequencies(self._damaged_model(damage), X)
        return frame_like(X, add_noise(frequencies, noise, random_state=random_state), self.mode_names_)

    def score(self, X: ArrayLike, y: ArrayLike) -> float:
        """Coefficient of determination R2 over complete rows, averaged over modes.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        y : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz.

        Returns
        -------
        float
            NaN if fewer than two rows are complete; `skthermo.metrics.frequency_scorer`
            also reports the share of rows scored.
        """
        check_same_rows(X, y, ("temperatures", "frequencies"))
        return complete_r2(y, self.predict(X))

    def _predict_theta(self, X: ArrayLike) -> NDArray[np.float64]:
        check_is_fitted(self)
        validate_data(self, X, ensure_all_finite="allow-nan", reset=False)
        theta = as_columns(self.mapper_.predict(X)).copy()
        impossible = ((theta < POSSIBLE[0]) | (theta > POSSIBLE[1])).any(axis=1)
        if impossible.any():
            row = np.flatnonzero(impossible)[0]
            warnings.warn(
                f"in {impossible.sum()} of {len(theta)} rows, row {row} the first, the mapper gave multipliers outside "
                f"{POSSIBLE[0]:g} to {POSSIBLE[1]:g}: these rows are NaN",
                UserWarning,
                stacklevel=4,
            )
            theta[impossible] = np.nan
        return theta

    def _frequencies(self, model: FEModel, X: ArrayLike) -> NDArray[np.float64]:
        """Frequencies of a model at given temperatures, in the measured domain."""
        frequencies = evaluate(model, self._predict_theta(X))
        return as_floats(self.aligner_.inverse_transform(frequencies))

    def _damaged_model(self, damage: Mapping[str, float] | None) -> FEModel:
        if not damage:
            return self.model
        if not hasattr(self.model, "damaged"):
            raise ValueError(f"{self.model!r} has no method 'damaged'; expected a model that damage can be put into")
        return self.model.damaged(damage)

    def _completed(self, T: Any, F: Any) -> Any:
        """Frequencies without gaps, where there is an imputer."""
        if self.imputer_ is None:
            return F
        n_sensors, n_modes = T.shape[1], F.shape[1]
        values = as_floats(self.imputer_.fit_transform(np.hstack([T, F])))
        return frame_like(F, values[:, n_sensors : n_sensors + n_modes], self.mode_names_)

    def _fit_inverse(self, F: Any) -> NDArray[np.float64]:
        """Fit aligner and M1, which gives the parameters of the training data."""
        aligned = self.aligner_.fit(F).transform(F)
        theta = as_floats(self.inverse_.fit(aligned).transform(aligned))
        if theta.shape[1] != len(self.parameter_names_):
            raise ValueError(f"the inverse gave {theta.shape[1]} columns; expected {self.parameter_names_}")
        return theta

    def __sklearn_clone__(self) -> "DataInformedFEM":
        return clone_sharing_models(self)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.target_tags.multi_output = True
        tags.target_tags.single_output = False
        return tags
