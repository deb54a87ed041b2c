"""A mapper of a bridge with few records, which knows those of other bridges."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array, as_columns, check_flag
from skthermo._core.estimators import _fit_context, check_is_fitted
from skthermo._core.frames import frame_like, has_stamps, like_targets, row_times
from skthermo._core.warnings import collected, warn_each
from skthermo.preprocessing.checks import set_aside
from skthermo.surrogate._regression import TableRegressor, TemperatureMapper


@dataclass(frozen=True)
class Posterior:
    """Level and coefficients of functions of the weather, given prior and records: a Bayesian ridge regression.

    ``centre`` holds the means of the functions in the records.
    """

    level: float
    level_variance: float
    centre: Array
    coefficients: Array
    covariance: Array

    @classmethod
    def learned(cls, functions: Array, values: Array, dependence: float) -> Posterior:
        """Learn from records, of which ``dependence`` count as one.

        The prior of the coefficients is N(0, v I), records have a noise of variance s^2; of a grid, v and s have the
        highest marginal likelihood.
        """
        n, centre, level = len(values), functions.mean(axis=0), values.mean()
        U, sizes, directions = np.linalg.svd(functions - centre, full_matrices=False)
        found = U.T @ (values - level)
        power, share = sizes**2 / dependence, found**2 / dependence
        left = max(np.sum((values - level) ** 2) - np.sum(found**2), 0.0) / dependence
        scatter = max(values.std(), 1e-9)

        def log_likelihood(v: float, s: float) -> float:
            expected = v * power + s**2
            n_left = n / dependence - len(sizes) - 1
            return -np.sum(np.log(expected) + share / expected) - n_left * np.log(s**2) - left / s**2

        grid = [(v, s) for v in (1.0, 10.0, 100.0) for s in scatter * np.geomspace(0.2, 1.2, 8)]
        v, s = max(grid, key=lambda one: log_likelihood(*one))
        shrunk = v * sizes / (v * sizes**2 + dependence * s**2)
        known = v * power / (v * power + s**2)
        covariance = v * (np.eye(len(centre)) - (directions.T * known) @ directions)
        return cls(float(level), s**2 * dependence / n, centre, directions.T @ (shrunk * found), covariance)

    def at(self, functions: Array) -> tuple[Array, Array]:
        """Means and standard deviations."""
        away = functions - self.centre
        variances = np.einsum("ij,jk,ik->i", away, self.covariance, away) + self.level_variance
        return self.level + away @ self.coefficients, np.sqrt(variances)


class FleetMapper(TableRegressor):
    """Parameters or frequencies of a bridge from the weather, learned together with the mappers of other bridges.

    Parameters
    ----------
    mappers : sequence or mapping of TemperatureMapper, default=()
        Fitted mappers of other bridges of its kind, with the same inputs, such as the means that
        `~skthermo.preprocessing.SensorMeans` gives; of a chain with a pipeline, ``chain.mapper_[-1]``. Outputs are
        matched by name where they have names. Without mappers, the bridge is on its own.

    Attributes
    ----------
    posteriors_ : list
        For each output, the level and the coefficients that the records leave, with their covariance.
    centre_, scale_ : ndarray of shape (n_inputs,)
        Mean and standard deviation of the inputs of the other bridges, on average.
    sizes_ : ndarray of shape (n_outputs,)
        By how much each output moves with the weather on the other bridges: a standard deviation.
    is_log_ : bool
        Whether logarithms are learned: where all outputs are positive.
    n_parameters_, parameter_names_ : int, list or None
        Number of outputs, and their names where `fit` saw them.
    y_is_vector_ : bool
        Whether `fit` saw one output as a vector.
    findings_ : list of SkthermoWarning
        Values of the records that were set aside.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of inputs and, where `fit` saw a frame with such, their names.

    See Also
    --------
    TemperatureMapper : Mapper of a bridge with a year of records.

    Notes
    -----
    Empirical Bayes: the logarithm of an output is a level of the bridge's own, the mean response m of the other bridges
    times a factor of about 1, their deviations from m, weighted as they scatter, and a small piecewise-linear function
    of its own. The weights are normally distributed, so that their posterior is that of a ridge regression. Their
    variance and that of the noise maximise the marginal likelihood: a bridge unlike the others gets a large variance,
    and learns from its own records. Records of two days count as one, because their errors last.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.surrogate import FleetMapper, TemperatureMapper
    >>> T = np.linspace(-10, 30, 200)[:, np.newaxis]
    >>> mappers = [TemperatureMapper().fit(T, np.exp(-0.004 * (1 + 0.1 * i) * T)) for i in range(5)]
    >>> new = FleetMapper(mappers).fit(T[:40], 2 * np.exp(-0.0044 * T[:40]))
    >>> bool(abs(new.predict([[30.0]])[0, 0] / (2 * np.exp(-0.0044 * 30)) - 1) < 0.002)
    True
    """

    _parameter_constraints: dict = {"mappers": ["array-like", Mapping]}
    _leaves_out_gaps = True  # output by output

    def __init__(self, mappers: Sequence[Any] | Mapping[Hashable, Any] = ()):
        self.mappers = mappers

    def __sklearn_clone__(self) -> FleetMapper:
        """The same fitted mappers of other bridges, and no own records."""
        return type(self)(self.mappers)

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: ArrayLike) -> FleetMapper:
        """Learn from the bridge's own records, beside the other bridges.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_inputs)
            Inputs, as those of the mappers.
        y : array-like, Series or DataFrame of shape (n_samples,) or (n_samples, n_outputs)
            Parameters or frequencies. A row counts for the outputs that it has.

        Returns
        -------
        FleetMapper
            The fitted estimator.

        Raises
        ------
        ValueError
            If a mapper has other inputs, none has an output, or an output has fewer than two rows.
        NotFittedError
            If a mapper is not fitted.
        """
        inputs, targets = self._read_xy(X, y, ("temperatures", "outputs"))
        self.parameter_names_ = [y.name] if getattr(y, "name", None) is not None else self.parameter_names_
        harmless = ("few-records", "stuck", "implausible-values", "useless-column")  # in rows of any order
        with collected() as self.findings_:
            found, _ = set_aside(frame_like(X, inputs), exclude=harmless, needs_all=True)
        inputs = np.asarray(found.temperatures)
        usable = ~(np.isnan(inputs).any(axis=1)[:, np.newaxis] | np.isnan(targets))
        if (usable.sum(axis=0) < 2).any():
            raise ValueError(
                f"an output has {usable.sum(axis=0).min()} of n_samples={len(inputs)} rows complete; expected 2 or more"
            )
        self.n_parameters_ = targets.shape[1]
        mappers = self._mappers()
        self._check(mappers)
        own = inputs[usable.any(axis=1)]
        first = slice(self.n_features_in_)  # means of earlier temperatures follow
        known = [(one.inputs_.mean_[first], one.inputs_.scale_[first]) for one in mappers]
        self.centre_, self.scale_ = np.mean(known or [(own.mean(axis=0), own.std(axis=0))], axis=0)
        self.is_log_ = not (targets <= 0).any() and all(mapper.log_targets_ for mapper in mappers)
        link, columns = np.log if self.is_log_ else np.positive, [targets[rows, j] for j, rows in enumerate(usable.T)]
        sizes = [self._sizes(mapper) for mapper in mappers] or [[link(column).std() for column in columns]]
        self.sizes_ = np.nanmean(sizes, axis=0)
        days = np.median(np.diff(row_times(X))) / 86_400e9 if has_stamps(X) and len(inputs) > 1 else 1.0
        dependence = 2.0 / np.clip(days, 1e-3, 2.0)
        self.posteriors_ = []
        for (mean, functions), column, rows in zip(self._functions(X, inputs), targets.T, usable.T, strict=True):
            rows = rows & ~np.isnan(functions).any(axis=1)  # a mapper may lack means of earlier temperatures
            if rows.sum() < 2:
                raise ValueError(
                    f"an output has {rows.sum()} of n_samples={len(inputs)} rows complete; expected 2 or more"
                )
            self.posteriors_.append(Posterior.learned(functions[rows], link(column[rows]) - mean[rows], dependence))
        warn_each(self.findings_)
        return self

    def predict(self, X: ArrayLike, return_std: bool = False) -> Any:
        """Outputs in the weather.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_inputs)
            Inputs; rows with NaN are NaN.
        return_std : bool, default=False
            Whether to return standard deviations too.

        Returns
        -------
        y : ndarray or DataFrame of shape (n_samples,) or (n_samples, n_outputs)
            Median of the posterior.
        std : ndarray or DataFrame of the same shape
            Only with ``return_std``: standard deviations of the expected outputs, without the noise of a record.
        """
        inputs = self._inputs(X)
        both = [
            (mean, *posterior.at(functions))
            for posterior, (mean, functions) in zip(self.posteriors_, self._functions(X, inputs), strict=True)
        ]
        means, changes, deviations = (np.column_stack(part) for part in zip(*both, strict=True))
        values = np.exp(means + changes) if self.is_log_ else means + changes
        table = like_targets(X, values, self.parameter_names_, is_vector=self.y_is_vector_)
        if not check_flag(return_std, "return_std"):
            return table
        deviations = values * deviations if self.is_log_ else deviations
        return table, like_targets(X, deviations, self.parameter_names_, is_vector=self.y_is_vector_)

    def _functions(self, X: ArrayLike, inputs: Array) -> list[tuple[Array, Array]]:
        """For each output: mean response of the other bridges, and functions whose coefficients scatter by 1."""
        z = (inputs - self.centre_) / np.where(self.scale_ > 0, self.scale_, 1.0)
        own = np.hstack([z, *(np.maximum(z - knot, 0) for knot in (-1.0, 0.0, 1.0))])
        found = []
        for others, size in zip(self._others(X, len(inputs)), self.sizes_, strict=True):
            others = np.log(others) if self.is_log_ else others
            mean = others.mean(axis=0) if len(others) else np.zeros(len(inputs))
            n = max(len(others), 2)  # one alone has no deviations
            deviations = (others - mean).T * np.sqrt((1 + 1 / n) / (n - 1))
            found.append((mean, np.hstack([0.3 * mean[:, np.newaxis], deviations, 0.1 * size * own])))
        return found

    def _others(self, X: ArrayLike, n_rows: int) -> list[Array]:
        """Predictions of the other bridges' mappers, (n_mappers, n_samples), for each output of those that have it."""
        found: list[list[Array]] = [[] for _ in range(self.n_parameters_)]
        for mapper in self._mappers():
            names = getattr(mapper, "feature_names_in_", None)
            T = X if names is None or hasattr(X, "columns") else pd.DataFrame(np.asarray(X), columns=names)
            with collected():
                predicted = as_columns(mapper.predict(T))
            for output, column in self._columns_of(mapper).items():
                found[output].append(predicted[:, column])
        return [np.reshape(one, (len(one), n_rows)) for one in found]

    def _sizes(self, mapper: Any) -> Array:
        """Standard deviation of each output, or of its logarithm, on another bridge; NaN where it has none."""
        scales = mapper.targets_.scale_
        if mapper.log_targets_ and not self.is_log_:
            scales = scales * np.exp(mapper.targets_.mean_)
        sizes, columns = np.full(self.n_parameters_, np.nan), self._columns_of(mapper)
        sizes[list(columns)] = scales[list(columns.values())]
        return sizes

    def _mappers(self) -> list[Any]:
        return list(self.mappers.values() if isinstance(self.mappers, Mapping) else self.mappers)

    def _columns_of(self, mapper: Any) -> dict[int, int]:
        """Position of each output, and of its column in what a mapper predicts: by name where both have names."""
        names, known = self.parameter_names_, mapper.parameter_names_
        if names is None or known is None:
            return {output: output for output in range(self.n_parameters_)}
        return {output: list(known).index(name) for output, name in enumerate(names) if name in known}

    def _check(self, mappers: Sequence[Any]) -> None:
        found: set[int] = set()
        for mapper in mappers:
            if not isinstance(mapper, TemperatureMapper):
                raise ValueError(f"mappers hold {mapper!r:.100}; expected fitted TemperatureMappers of other bridges")
            check_is_fitted(mapper)
            if mapper.n_features_in_ != self.n_features_in_:
                raise ValueError(
                    f"X has {self.n_features_in_} inputs, and a mapper {mapper.n_features_in_}; expected the same "
                    "inputs on all bridges, such as the means that SensorMeans gives, and TemperatureMapper(means=None)"
                )
            columns = self._columns_of(mapper)
            if max(columns.values(), default=-1) >= mapper.n_parameters_:
                raise ValueError(
                    f"y has {self.n_parameters_} outputs without names, and a mapper {mapper.n_parameters_}; expected "
                    "as many, or names"
                )
            found.update(columns)
        names = self.parameter_names_ or list(range(self.n_parameters_))
        missing = [name for output, name in enumerate(names) if output not in found]
        if mappers and missing:
            raise ValueError(f"no mapper has the outputs {missing!r:.200}; expected one for each output")
