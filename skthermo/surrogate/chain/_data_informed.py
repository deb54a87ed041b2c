"""The whole chain: temperatures and frequencies in, a thermal FE model out."""

from numbers import Integral, Real
from typing import Any, Literal, TypeAlias, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin

from skthermo._arrays import as_floats
from skthermo._frames import check_same_rows, column_names, frame_like
from skthermo._saved_frames import SavesFrames
from skthermo._validation import (
    HasMethods,
    Interval,
    StrOptions,
    _fit_context,
    check_array,
    check_is_fitted,
    clone_sharing_models,
)
from skthermo._warnings import warn_each, warn_user
from skthermo.fem import FEModel
from skthermo.metrics import complete_r2
from skthermo.surrogate._chain_parts import box_of, clone_parts, read_records
from skthermo.surrogate._chain_shapes import shape_inputs_of, with_shapes
from skthermo.surrogate._chain_simulation import ChainSimulation
from skthermo.surrogate._chain_steps import ChainSteps
from skthermo.surrogate._chain_uncertainty import ChainUncertainty
from skthermo.surrogate._report import mode_warnings
from skthermo.surrogate._simulator import tolerance

Table: TypeAlias = NDArray[np.float64] | pd.DataFrame


class DataInformedFEM(SavesFrames, ChainSimulation, ChainUncertainty, ChainSteps, RegressorMixin, BaseEstimator):
    """FE model whose parameters depend on temperature as learned from monitoring data.

    The method of Kamali et al. (2026), Section 2. M1 turns measured frequencies into parameters (eq. (5)), M2 maps
    temperatures to those parameters (eq. (6)), and the FE model, healthy or damaged, turns the parameters back into
    frequencies (eqs. (7)-(8)).

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
        Maps measured frequencies onto the model's and back, such as ``BiasAligner(model)``.
    imputer : transformer or "passthrough", default="passthrough"
        Fills gaps in the frequencies, given temperatures and frequencies side by side; used in `fit` only.
        Without an imputer, an inverse that refines estimates the parameters of such rows from the modes that are
        there; without refining, they do not train M2.
    coordinates : {"frequencies", "parameters"}, default="frequencies"
        What a `TemperatureMapper` learns: parameters in coordinates in which their errors count as those of frequencies
        do (see its ``sensitivities``), free of the shrinkage that an inverse's prior causes; or parameters as the
        inverse gives them. Without refining, the latter.
    weighted : bool, default=True
        Whether rows train M2 with weights that are their posterior precision, so that rows with missing modes count
        less. Weights need an inverse that refines, and a mapper whose ``fit`` takes ``sample_weight``; other rows
        count alike.
    reduce : bool or float, default=False
        Whether predictions and simulations use the reduced model ``model.reduced``, which makes large models much
        faster. Its box covers the parameters that M2 gives for the training weather, plus a quarter of their range on
        either side. True allows a relative error of 1e-5 in the frequencies; a number sets the error allowed. Rows
        outside the box are solved by the model itself, with a warning that counts them.
    n_jobs : int, optional
        Number of parallel jobs when the model is solved for many rows.
    random_state : int, RandomState or None, default=None
        Seed of every part that has no seed of its own.

    Attributes
    ----------
    inverse_, mapper_, aligner_ : estimators
        Fitted clones.
    imputer_ : estimator or None
        Fitted clone.
    parameters_ : DataFrame or ndarray of shape (n_samples, n_parameters)
        Multipliers that M1 found in the training data, eq. (5).
    report_ : FitReport
        Findings of `fit`: rows left out and why, offsets of modes, errors, and doubtful data.
    training_range_ : TrainingRange
        Lowest and highest value of each input of M2, lags included.
    box_ : Box or None
        Bounds of the inverse.
    simulator_ : Simulator
        The model and, with ``reduce``, its reduced model.
    parameter_names_, mode_names_ : list of str
        Columns of the parameters and of the frequencies.
    n_features_in_ : int
        Number of temperature columns.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    Notes
    -----
    ``predict(T)`` is ``aligner_.inverse_transform(model.frequencies(predict_parameters(T)))``
    and nothing else: no correction is learned on top of the FE model. If temperatures are a frame, results are frames.
    A row that cannot be computed is NaN; no row is dropped.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519 [KCM26]_.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.metrics import mape
    >>> from skthermo.surrogate import DataInformedFEM, InverseSurrogate
    >>> year = make_truss_campaign(random_state=0)
    >>> model = make_truss()
    >>> fem = DataInformedFEM(model, inverse=InverseSurrogate(noise=0.01), random_state=0)
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
        "coordinates": [StrOptions({"frequencies", "parameters"})],
        "weighted": ["boolean"],
        "reduce": ["boolean", Interval(Real, 0, 1, closed="neither")],
        "n_jobs": [Integral, None],
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
        coordinates: Literal["frequencies", "parameters"] = "frequencies",
        weighted: bool = True,
        reduce: bool | float = False,
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.model = model
        self.inverse = inverse
        self.mapper = mapper
        self.aligner = aligner
        self.imputer = imputer
        self.coordinates = coordinates
        self.weighted = weighted
        self.reduce = reduce
        self.n_jobs = n_jobs
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike, y: ArrayLike, shapes: ArrayLike | None = None) -> "DataInformedFEM":
        """Learn how temperature moves the parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius; NaN is allowed.
        y : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies of the healthy structure in Hz; NaN is allowed.
        shapes : array-like of shape (n_samples, n_modes, n_sensors), optional
            Measured mode shapes, real or complex, of any scale, sign and phase, NaN where a mode is missing; for an
            inverse with ``dofs``, whose order the sensors have.

        Returns
        -------
        DataInformedFEM
            The fitted estimator.

        Raises
        ------
        ValueError
            If lengths or indices differ, the number of modes is not the model's, a temperature
            is constant, missing throughout, in kelvin or holds a number that stands for a missing value, or a mode
            was never measured; if shapes are given to an inverse without ``dofs``, or not given to one with ``dofs``.

        Warns
        -----
        UserWarning
            One warning, with counts, for each kind of doubtful data in ``report_``: few rows, rows left out, modes that
            are far from the model's or look swapped, parameters far outside the bounds of the inverse.
        """
        T, F = read_records(self, X, y)
        tolerance(self.model, self.reduce)
        self.mode_names_ = column_names(F, "f")
        self.parameter_names_ = list(self.model.parameter_names)
        self.inverse_, self.mapper_, self.aligner_, self.imputer_ = clone_parts(self)
        if shapes is None and shape_inputs_of(self.inverse_) is not None:
            raise ValueError("the inverse has dofs, but there are no shapes; expected fit(T, F, shapes)")
        self.box_ = box_of(self.inverse_)
        warn_each(mode_warnings(self.model, F))
        theta, residuals, weights = self._fit_inverse(self._completed(T, F), shapes)
        self.parameters_ = frame_like(T, theta, self.parameter_names_)
        targets = self._fit_mapper(T, theta, residuals, weights)
        self._records, self._residuals = (T, F, targets, weights), None
        self._report(T, F, theta)
        return self

    @overload
    def estimate_parameters(self, F: pd.DataFrame, shapes: ArrayLike | None = None) -> pd.DataFrame: ...
    @overload
    def estimate_parameters(self, F: ArrayLike, shapes: ArrayLike | None = None) -> NDArray[np.float64]: ...
    def estimate_parameters(self, F: ArrayLike, shapes: ArrayLike | None = None) -> Table:
        """Parameters behind measured frequencies, equation (5).

        Parameters
        ----------
        F : array-like or DataFrame of shape (n_samples, n_modes)
            Measured frequencies in Hz; NaN is allowed.
        shapes : array-like of shape (n_samples, n_modes, n_sensors), optional
            Measured mode shapes, as in `fit`. Without them, an inverse with ``dofs`` that refines estimates parameters
            from frequencies alone.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters; NaN in rows without any mode and, without refining, where one is
            missing.

        Raises
        ------
        ValueError
            If the number or the names of the modes differ from `fit`, or a frequency is not positive.
        """
        check_is_fitted(self)
        measured = frame_like(F, check_array(F, dtype=np.float64, ensure_all_finite="allow-nan"))
        inputs = with_shapes(self.inverse_, self.aligner_.transform(measured), shapes)
        theta = as_floats(self.inverse_.transform(inputs))
        return frame_like(F, theta, self.parameter_names_)

    @overload
    def predict_parameters(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def predict_parameters(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def predict_parameters(self, X: ArrayLike) -> Table:
        """Parameters at given temperatures, equation (7).

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters; NaN where an input of M2 is missing, and, with a warning, where M2
            gives a physically impossible multiplier (less than 1e-6 or more than 1e6).
        """
        return frame_like(X, self._predict_theta(X), self.parameter_names_)

    @overload
    def predict(self, X: pd.DataFrame, return_std: Literal[False] = False) -> pd.DataFrame: ...
    @overload
    def predict(self, X: pd.DataFrame, return_std: Literal[True]) -> tuple[pd.DataFrame, pd.DataFrame]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[False] = False) -> NDArray[np.float64]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[True]) -> tuple[NDArray[np.float64], NDArray[np.float64]]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: bool) -> Any: ...
    def predict(self, X: ArrayLike, return_std: bool = False) -> Table | tuple[Table, Table]:
        """Frequencies of the healthy structure at given temperatures.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        return_std : bool, default=False
            Whether to return standard deviations too.

        Returns
        -------
        frequencies : ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain.
        std : ndarray or DataFrame of shape (n_samples, n_modes)
            Only with ``return_std``: root mean square differences between measured and predicted frequencies in similar
            weather, out of fold, in Hz. They contain the scatter of the measurement.
        """
        frequencies = self._frequencies(X)
        predicted = frame_like(X, frequencies, self.mode_names_)
        return (predicted, frame_like(X, frequencies * self._spread(X), self.mode_names_)) if return_std else predicted

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
            NaN if fewer than two rows are complete. A warning counts the rows scored if they are fewer than half;
            `~skthermo.metrics.frequency_scorer` always reports their share.
        """
        check_is_fitted(self)
        check_same_rows(X, y, ("temperatures", "frequencies"))
        if np.ndim(y) != 2 or np.shape(y)[1] != len(self.mode_names_):
            raise ValueError(
                f"frequencies have shape {np.shape(y)}; expected a column for each of {self.mode_names_}, as in fit"
            )
        predicted = self.predict(X)
        scored = int((~np.isnan(as_floats(y) + as_floats(predicted)).any(axis=1)).sum())
        if 2 * scored < len(predicted):
            warn_user(f"the score is of {scored} of {len(predicted)} rows: the others have gaps", "rows scored")
        return complete_r2(y, predicted)

    def __sklearn_clone__(self) -> "DataInformedFEM":
        return clone_sharing_models(self)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        tags.target_tags.multi_output = True
        tags.target_tags.single_output = False
        return tags
