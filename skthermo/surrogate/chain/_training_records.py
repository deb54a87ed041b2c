"""How far to trust the chain: intervals of predictions, realistic noise, weather unlike that of the training rows."""

from numbers import Real
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.model_selection import KFold

from skthermo._arrays import Array, as_columns, as_floats
from skthermo._frames import frame_like
from skthermo._regressors import weights_for
from skthermo._validation import check_is_fitted
from skthermo.surrogate._mapper_inputs import last_step, mapper_inputs
from skthermo.surrogate._residuals import WeatherResiduals

N_FOLDS = 5


class ChainUncertainty:
    """Methods of the chain that say how far to trust it, and their private steps."""

    @overload
    def predict_interval(self, X: pd.DataFrame, confidence: float = 0.9) -> tuple[pd.DataFrame, pd.DataFrame]: ...
    @overload
    def predict_interval(self, X: ArrayLike, confidence: float = 0.9) -> tuple[Array, Array]: ...
    def predict_interval(self, X: ArrayLike, confidence: float = 0.9) -> tuple[Any, Any]:
        """Intervals that hold the measured frequencies with a given probability, mode by mode.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        confidence : float, default=0.9
            Probability, between 0 and 1.

        Returns
        -------
        lowest : ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain; 0 if there are too few training records for the confidence.
        highest : ndarray or DataFrame of shape (n_samples, n_modes)
            Likewise; infinite if there are too few.

        Raises
        ------
        ValueError
            If the confidence is not between 0 and 1.

        Notes
        -----
        Split-conformal intervals: the training records are divided into five periods of time, and each is predicted by
        a mapper fitted on the others. The width is a multiple of the spread of these residuals in similar weather, so
        that it grows, for example, in frost; the multiple is the order statistic that the periods themselves needed.
        If new records are exchangeable with the training records, the interval holds a mode with about the probability
        asked. Records of one structure are not: they are serially correlated, so that the share of a short period that
        is held varies much more than that of independent records, and weather beyond the training range has no
        residuals to learn from: there the interval is widened by the distance (see `applicability`).

        References
        ----------
        Lei, G'Sell, Rinaldo, Tibshirani & Wasserman, Distribution-free predictive inference for regression, Journal of
        the American Statistical Association 113 (2018) 1094-1111 [LGR18]_.

        Examples
        --------
        >>> from skthermo.datasets import make_truss, make_truss_campaign
        >>> from skthermo.surrogate import DataInformedFEM
        >>> year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
        >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
        >>> lowest, highest = fem.predict_interval(later.temperatures)
        >>> held = (later.frequencies > lowest) & (later.frequencies < highest)
        >>> bool(0.85 < held.to_numpy().mean() < 0.95)
        True
        """
        check_is_fitted(self)
        if not isinstance(confidence, Real) or isinstance(confidence, bool) or not 0 < confidence < 1:
            raise ValueError(f"confidence is {confidence!r}; expected a probability between 0 and 1, such as 0.9")
        frequencies = self._frequencies(X)
        margin = self.residuals_.quantiles(confidence) * self._spread(X)
        bounds = (frequencies * np.maximum(1 - margin, 0.0), frequencies * (1 + margin))
        lowest, highest = (frame_like(X, bound, self.mode_names_) for bound in bounds)
        return lowest, highest

    def applicability(self, X: ArrayLike) -> pd.DataFrame:
        """How far inputs and parameters are outside the training range, row by row.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.

        Returns
        -------
        DataFrame
            With X's index. One column for each input of M2, lags included: its distance outside the range of the
            training rows, divided by that range (0 inside). The last column, ``outside_bounds``, says whether a
            parameter is outside the bounds of the inverse.
        """
        T = self._temperatures(X)
        inputs = mapper_inputs(self.mapper_, T)
        excess = pd.DataFrame(self.training_range_.excess(inputs), columns=self.training_range_.names)
        excess.index = X.index if isinstance(X, pd.DataFrame) else excess.index
        theta = as_columns(self.mapper_.predict(T))
        outside = np.zeros(len(theta), dtype=bool) if self.box_ is None else self.box_.outside(theta).any(axis=1)
        return excess.assign(outside_bounds=outside)

    @overload
    def expected_residuals(self, X: pd.DataFrame, return_number: Literal[False] = False) -> pd.DataFrame: ...
    @overload
    def expected_residuals(self, X: pd.DataFrame, return_number: Literal[True]) -> tuple[pd.DataFrame, Array]: ...
    @overload
    def expected_residuals(self, X: ArrayLike, return_number: Literal[False] = False) -> Array: ...
    @overload
    def expected_residuals(self, X: ArrayLike, return_number: Literal[True]) -> tuple[Array, Array]: ...
    @overload
    def expected_residuals(self, X: ArrayLike, return_number: bool) -> Any: ...
    def expected_residuals(self, X: ArrayLike, return_number: bool = False) -> Any:
        """Mean relative residual of the training records in weather like that of each row.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        return_number : bool, default=False
            Whether to return how many training records the mean over all rows stands on.

        Returns
        -------
        expected : ndarray or DataFrame of shape (n_samples, n_modes)
            Measured frequency over the prediction, minus 1: what the chain leaves unexplained in such weather. NaN
            where an input of M2 is missing.
        number : ndarray of shape (n_modes,)
            Only with ``return_number``: how many independent records have a mean with the same variance as the mean of
            ``expected`` over the rows. It is lower than the number of training records if the rows have little
            variety of weather.
        """
        inputs, known = self._weather(X)
        expected, number = np.full((len(inputs), len(self.mode_names_)), np.nan), np.zeros(len(self.mode_names_))
        if known.any():
            expected[known] = self.residuals_.expected(inputs[known])
            number = self.residuals_.n_expected(inputs[known]) if return_number else number
        frame = frame_like(X, expected, self.mode_names_)
        return (frame, number) if return_number else frame

    @property
    def training_records_(self) -> tuple[Any, Any]:
        """Temperatures and frequencies that `fit` was given."""
        check_is_fitted(self)
        return self._records[:2]

    @property
    def residuals_(self) -> WeatherResiduals:
        """Out-of-fold residuals of the training records by weather, computed on first use."""
        check_is_fitted(self)
        if self._residuals is None:
            self._residuals = self._out_of_fold()
        return self._residuals

    def _out_of_fold(self) -> WeatherResiduals:
        """Relative residuals of the training records, each predicted by a mapper fitted on other periods of time."""
        T, F, targets, weights = self._records
        has_stamps = isinstance(getattr(T, "index", None), pd.DatetimeIndex)
        order = T.index.argsort(kind="stable") if has_stamps else np.arange(len(T))
        inputs, theta = as_floats(mapper_inputs(self.mapper_, T))[order], targets[order]
        measured = as_floats(F)[order]
        rows = np.flatnonzero(~np.isnan(inputs).any(axis=1) & ~np.isnan(measured).all(axis=1))
        usable = ~np.isnan(theta[rows]).any(axis=1)
        if usable.sum() < 2 * N_FOLDS:
            raise ValueError(f"{usable.sum()} records have parameters; expected at least {2 * N_FOLDS} for residuals")
        predicted, folds = np.full_like(theta[rows], np.nan), np.empty(len(rows), dtype=int)
        for fold, (train, test) in enumerate(KFold(N_FOLDS).split(rows)):
            train = train[usable[train]]
            options = {} if weights is None else weights_for(last_step(self.mapper_), weights[order][rows][train])
            mapper = clone(last_step(self.mapper_)).fit(inputs[rows][train], theta[rows][train], **options)
            predicted[test], folds[test] = as_columns(mapper.predict(inputs[rows][test])), fold
        own = as_columns(self.mapper_.predict(T))[order][rows]
        values, own = (measured[rows] / self._of_parameters(theta) - 1 for theta in (predicted, own))
        known = ~np.isnan(values).all(axis=1)
        return WeatherResiduals(inputs[rows][known], values[known], own[known], folds[known])

    def _of_parameters(self, theta: Array) -> Array:
        """Frequencies in the measured domain, without warnings."""
        frequencies = self.simulator_.frequencies(self._possible(theta)[0], self.n_jobs, warn=False)
        return as_floats(self.aligner_.inverse_transform(frequencies))

    def _weather(self, X: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
        """Inputs of the mapper, and which rows are complete."""
        inputs = as_floats(mapper_inputs(self.mapper_, self._temperatures(X)))
        return inputs, ~np.isnan(inputs).any(axis=1)

    def _spread(self, X: ArrayLike) -> Array:
        """Root mean square of the relative residuals in weather like that of each row, (n_samples, n_modes)."""
        inputs, known = self._weather(X)
        spread = np.full((len(inputs), len(self.mode_names_)), np.nan)
        if known.any():
            spread[known] = self.residuals_.spread(inputs[known])
        return spread

    def _fitted_noise(self, X: ArrayLike, random_state: np.random.RandomState) -> Array:
        """Relative residuals drawn from similar weather, (n_samples, n_modes)."""
        inputs, known = self._weather(X)
        order = np.flatnonzero(known)
        if isinstance(X, pd.DataFrame) and isinstance(X.index, pd.DatetimeIndex):
            order = order[X.index[order].argsort(kind="stable")]
        noise = np.full((len(inputs), len(self.mode_names_)), np.nan)
        if order.size:
            noise[order] = self.residuals_.draw(inputs[order], random_state)
        return noise
