"""What predicts multipliers: regressors, of temperatures among others, and the base of inverses of an FE model."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from datetime import timedelta
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.linear_model import RidgeCV
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import Pipeline, make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo._core.arrays import Array, as_columns, as_floats, by_name, check_flag, is_auto
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    StrOptions,
    TransformerMixin,
    _fit_context,
    check_array,
    check_is_fitted,
    check_takes_weights,
    fit_outputs,
    predict_with_std,
    seed_parts,
    seeded,
    validate_data,
)
from skthermo._core.frames import (
    Table,
    check_same_rows,
    column_names,
    columns_by_sensor,
    frame_like,
    has_stamps,
    like_targets,
    row_weights,
)
from skthermo._core.memory import remembered
from skthermo._core.parallel import single_blas_thread
from skthermo._core.warnings import collected, warn_each
from skthermo.fem import evaluate
from skthermo.metrics.errors import complete_r2
from skthermo.preprocessing import ExponentialMeans, HingeFeatures
from skthermo.preprocessing.checks import set_aside
from skthermo.surrogate._means import chosen_means


def default_network() -> MLPRegressor:
    """A small network for noisy data; Adam, because the line search of L-BFGS fails with several outputs."""
    return MLPRegressor(
        hidden_layer_sizes=(64,), alpha=1.0, learning_rate_init=0.003, max_iter=2000, n_iter_no_change=20
    )


def default_lines(penalties: ArrayLike | None = None, **options: Any) -> Pipeline:
    """Piecewise-linear regression with penalised changes of slope, which goes on straight beyond the data."""
    hinges = HingeFeatures().set_output(transform="default")  # whatever the global setting is at fit and at predict
    return make_pipeline(hinges, RidgeCV(np.logspace(-3, 5, 33) if penalties is None else penalties, **options))


class TableRegressor(RegressorMixin, Estimator):
    """Base of regressors whose inputs and outputs are tables with gaps, and names where frames have them."""

    parameter_names_: list | None
    predict: Callable[..., Any]

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        return tags

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Coefficient of determination R2 over complete rows, averaged over parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Inputs.
        y : array-like or DataFrame of shape (n_samples, n_parameters)
            Multipliers.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row; weights in a series are matched to the rows of a frame by index.

        Returns
        -------
        float
            NaN if fewer than two rows are complete.
        """
        predicted = self.predict(X)
        targets = by_name(y, self.parameter_names_, "y") if self.parameter_names_ and hasattr(y, "columns") else y
        return complete_r2(as_columns(targets), as_columns(predicted), row_weights(sample_weight, X))

    def _inputs(self, X: ArrayLike) -> Array:
        check_is_fitted(self)
        return validate_data(self, X, dtype=np.float64, reset=False)

    def _read_xy(self, X: Table, y: Any, names: tuple[str, str]) -> tuple[Array, Array]:
        """X and y, (n_samples, n_parameters), with NaN where something is missing."""
        if y is None:
            raise ValueError(
                f"This {type(self).__name__} estimator requires y to be passed, but the target y is None; "
                f"expected {names[1]}"
            )
        inputs = validate_data(self, X, dtype=np.float64)
        targets = check_array(y, dtype=np.float64, ensure_2d=False)
        plain_rows = isinstance(y, pd.DataFrame) and y.index.equals(pd.RangeIndex(len(y)))
        check_same_rows(X, targets if plain_rows else y, names)
        self.y_is_vector_ = targets.ndim == 1
        self.parameter_names_ = column_names(y, "") if isinstance(y, pd.DataFrame) else None
        return inputs, as_columns(targets)


class MultiplierRegressor(TableRegressor):
    """Base of regressors that predict multipliers: fitted to complete rows, NaN where an input is missing.

    A subclass stores ``regressor`` and ``random_state``; its ``fit`` reads the data and calls `_learn`. Hooks:
    ``_default_regressor`` makes the regressor where none is given, ``_inputs`` reads and checks the inputs of
    ``predict``.
    """

    _default_regressor: Callable[[], BaseEstimator]

    @overload
    def predict(self, X: pd.DataFrame, return_std: bool = False) -> Any: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[False] = False) -> Array: ...
    @overload
    def predict(self, X: ArrayLike, return_std: Literal[True]) -> tuple[Array, Array]: ...
    @overload
    def predict(self, X: ArrayLike, return_std: bool) -> Any: ...
    def predict(self, X: ArrayLike, return_std: bool = False) -> Any:
        """Multipliers of the nominal parameters.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Inputs; NaN is allowed.
        return_std : bool, default=False
            Whether to return standard deviations too; the regressor's own ``predict`` must give them.

        Returns
        -------
        theta : ndarray or DataFrame of shape (n_samples, n_parameters)
            Positive if the training multipliers were; NaN in rows where an input is missing. A frame with X's index if
            X and the training multipliers were frames.
        std : ndarray or DataFrame of shape (n_samples, n_parameters)
            Only with ``return_std``: standard deviations of theta, to first order from the standard deviations
            of ln theta.

        Raises
        ------
        ValueError
            If ``return_std`` is set and the regressor gives no standard deviations.
        """
        theta, std = self._regress(self._inputs(X), check_flag(return_std, "return_std"))
        names, is_vector = self.parameter_names_, self.y_is_vector_
        table = like_targets(X, theta, names, is_vector=is_vector)
        return table if std is None else (table, like_targets(X, std, names, is_vector=is_vector))

    def _default_part(self, name: str) -> BaseEstimator | None:
        return self._default_regressor() if name == "regressor" else None

    def _learn(
        self,
        X: Array,
        y: Array,
        sample_weight: Array | None = None,
        *,
        random_state: int | np.random.RandomState | None,
        log_inputs: bool = False,
        memory: str | Memory | None = None,
    ) -> None:
        """Fit on the complete rows of X and y (n_samples, n_parameters); a memory keeps the regressor."""
        complete = ~(np.isnan(X).any(axis=1) | np.isnan(y).any(axis=1))
        if sample_weight is not None:
            complete &= sample_weight > 0
        if complete.sum() < 2:
            weighted = "" if sample_weight is None else " with a weight"
            raise ValueError(
                f"{type(self).__name__} got {complete.sum()} complete rows of {len(X)} samples; expected at least 2"
                f"{weighted}"
            )
        X, y = X[complete], y[complete]
        weights = None if sample_weight is None else sample_weight[complete]
        self.n_parameters_ = y.shape[1]
        self.log_inputs_, self.log_targets_ = log_inputs and bool((X > 0).all()), bool((y > 0).all())
        X, y = np.log(X) if self.log_inputs_ else X, np.log(y) if self.log_targets_ else y
        arrays = StandardScaler().set_output(transform="default")  # whatever the global setting is
        self.inputs_ = clone(arrays).fit(X, sample_weight=weights)
        self.targets_ = clone(arrays).fit(y, sample_weight=weights)
        X, y = self.inputs_.transform(X), self.targets_.transform(y)
        regressor = self._default_regressor() if self.regressor is None else clone(self.regressor)
        seed_parts(regressor, seeded(random_state))
        with single_blas_thread():
            y = y[:, 0] if y.shape[1] == 1 else y
            self.regressor_ = remembered(memory, fit_outputs, regressor, X, y, weights)

    def _regress(self, inputs: Array, return_std: bool = False) -> tuple[Array, Array | None]:
        """Multipliers, (n_samples, n_parameters), of inputs that have been read, and their standard deviations."""
        complete = ~np.isnan(inputs).any(axis=1)
        theta = np.full((len(inputs), self.n_parameters_), np.nan)
        std = np.full_like(theta, np.nan) if return_std else None
        if not complete.any():
            return theta, std
        known = np.log(inputs[complete]) if self.log_inputs_ else inputs[complete]
        standardised = self.inputs_.transform(known)
        if std is None:
            means = as_columns(self.regressor_.predict(standardised))
        else:
            means, deviations = predict_with_std(self.regressor_, standardised)
            if deviations is None:
                raise ValueError(
                    f"{type(self.regressor_).__name__} gives no standard deviations; expected one whose predict takes "
                    "return_std, such as GaussianProcessRegressor or BayesianRidge"
                )
            std[complete] = deviations * self.targets_.scale_
        found = self.targets_.inverse_transform(means)
        with np.errstate(over="ignore"):
            theta[complete] = np.exp(found) if self.log_targets_ else found
        return theta, std * theta if std is not None and self.log_targets_ else std


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
            values = shapes.simulated(model, as_floats(X), self.n_jobs)
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
            The model's parameter names; without a model the names of the columns of y, else theta1, theta2, ...
        """
        check_is_fitted(self)
        names = self.parameter_names_ or [f"theta{i + 1}" for i in range(self.n_parameters_)]
        return np.array(names, dtype=object)

    def _checked_model(self) -> Any:
        if self.model is None:
            raise ValueError(f"{type(self).__name__} has no model; expected an FE model")
        return self.model

    def _positive(self, X: ArrayLike, n_frequencies: int | None, *, reset: bool = False) -> Array:
        """Columns as in `fit`, the first ``n_frequencies`` of them, by default all, checked to be positive."""
        has_names = reset or hasattr(self, "feature_names_in_") or not hasattr(X, "columns")
        inputs = validate_data(self, X if has_names else as_floats(X), dtype=np.float64, reset=reset)
        frequencies = inputs[:, :n_frequencies]
        if (frequencies <= 0).any():
            row, column = np.argwhere(frequencies <= 0)[0]
            raise ValueError(
                f"row {row} of {column_names(X, 'f')[column]!r} is {frequencies[row, column]:g}; expected positive "
                "frequencies in Hz, NaN where one is missing"
            )
        return inputs


class TemperatureMapper(MultiplierRegressor):
    """Parameters of an FE model from temperatures, equation (6) [KCM26]_.

    Parameters
    ----------
    regressor : regressor, optional
        Any regressor; a regressor of a single output is fitted once for each parameter. It learns the standardised
        logarithms of the parameters from standardised temperatures, so that predictions are positive. If some
        parameters are not positive, no logarithm is taken. By default piecewise-linear regression,
        ``make_pipeline(HingeFeatures(), RidgeCV(numpy.logspace(-3, 5, 33)))``, which goes on straight beyond the data.
        See `paper_network` for the paper's network.
    means : "auto", sequence of half-lives or None, default="auto"
        Exponential means of earlier temperatures beside those of now (`~skthermo.preprocessing.ExponentialMeans`): of
        all columns with these half-lives, or none. "auto" takes those of one column, with 6 hours, a day, 5 or 30 days
        or all of these, with which periods held out are predicted better, if any (:doc:`/guide/records_theory`). It
        needs a DatetimeIndex and records of nine months, and takes none beside lags.
    random_state : int, RandomState or None, default=None
        Seed of the regressor, unless it has its own seed.

    Attributes
    ----------
    regressor_ : regressor
        Fitted to standardised temperatures (inputs) and standardised log parameters (outputs).
    inputs_, targets_ : StandardScaler
        Means and scales of the temperatures and of the parameters, or of their logarithms.
    log_inputs_, log_targets_ : bool
        Whether logarithms of the inputs, and of the parameters, are standardised; never of temperatures.
    means_ : ExponentialMeans or None
        What gives means of earlier temperatures, where there are some.
    findings_ : list of SkthermoWarning
        Values of the records that were set aside.
    n_parameters_, parameter_names_ : int, list of str or None
        Number of parameters and, where `fit` saw them in a frame, their names.
    y_is_vector_ : bool
        Whether `fit` saw one parameter as a vector.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of temperature columns and, where `fit` saw a frame with such, their names.

    Notes
    -----
    Rows with a missing temperature or parameter are left out in `fit`, and only there. :doc:`/accuracy_regressors`
    compares regressors on the last fifth of the healthy records of the bridge Z24, warmer than all others.

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
        "means": [StrOptions({"auto"}), "array-like", None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        regressor: BaseEstimator | None = None,
        *,
        means: Sequence[str | timedelta | int] | Literal["auto"] | None = "auto",
        random_state: int | np.random.RandomState | None = None,
    ):
        self.regressor = regressor
        self.means = means
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(
        self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None, *, check_input: bool = True
    ) -> TemperatureMapper:
        """Learn the mapping from complete rows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius, lagged or not.
        y : array-like or DataFrame of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row; weights in a series are matched to the rows of a frame by index. A row of weight 0
            counts as left out. Of a pipeline as the regressor, the last step gets the weights; with metadata routing,
            those steps that request them.
        check_input : bool, default=True
            Whether X is checked as temperatures. Chains and compensators, which have checked theirs, do not check what
            the steps of a pipeline make of them.

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
        T = frame_like(X, T)
        with collected() as self.findings_:
            if check_input:
                harmless = ("few-records", "stuck", "implausible-values")  # in rows of any order, of any inputs
                T = set_aside(T, exclude=harmless, needs_all=True)[0].temperatures
        weights = row_weights(sample_weight, X)
        if weights is not None and self.regressor is not None:
            check_takes_weights(self.regressor)
        self._learn_with_means(T, theta, weights)
        warn_each(self.findings_)
        return self

    def behind_means(self, X: Table, y: Table, steps: Sequence[tuple[str, Any]] = ()) -> BaseEstimator:
        """This mapper, with the means that suit some records as a step of a pipeline before it.

        What is fitted to parts of records, as out of fold, then has means of all.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius, without gaps.
        y : array-like or DataFrame of shape (n_samples, n_targets)
            What follows them; NaN is allowed.
        steps : sequence of (name, transformer), optional
            Unfitted steps of a pipeline before the mapper.

        Returns
        -------
        TemperatureMapper or Pipeline
            Unfitted, and without means of its own.
        """
        last, steps = clone(self).set_params(means=None), [*steps]
        with collected():
            means = self._chosen(clone(Pipeline(steps)).fit_transform(X, y) if steps else X, as_columns(y))
        steps += [] if means is None else [("means", clone(means))]
        return Pipeline([*steps, ("mapper", last)]) if steps else last

    def _learn_with_means(self, T: Table, theta: Array, weights: Array | None) -> None:
        known = theta if weights is None else np.where(weights[:, np.newaxis] > 0, theta, np.nan)
        self.means_ = self._chosen(T, known)
        inputs = as_floats(T) if self.means_ is None else as_floats(self.means_.fit_transform(T))
        self._learn(inputs, theta, weights, random_state=self.random_state)

    def _chosen(self, T: Table, targets: Array) -> ExponentialMeans | None:
        """Unfitted means of earlier temperatures."""
        if self.means is None or not is_auto(self.means):
            return None if self.means is None else ExponentialMeans(half_lives=self.means)
        if not has_stamps(T) or T.index.hasnans or T.index.has_duplicates:
            return None
        has_past = any(len(columns) > 1 for columns in columns_by_sensor(T).values())  # lags or means
        return None if has_past else chosen_means(T, targets)

    def _inputs(self, X: ArrayLike) -> Array:
        T = super()._inputs(X)
        return T if self.means_ is None else as_floats(self.means_.transform(frame_like(X, T)))
