"""What a chain predicts with: the weather of rows, M2, the simulator of the FE model, aligner and discrepancy."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from skthermo._core.arrays import (
    Array,
    MatrixLike,
    as_columns,
    as_floats,
    as_mapping,
    is_real,
    mapping_of,
    median,
    patterns,
    real_array,
    robust_deviation,
    spread_evenly,
)
from skthermo._core.estimators import (
    fit_outputs,
    inputs_of_last_step,
    last_step,
    predict_with_std,
)
from skthermo._core.frames import Table, check_same_rows, column_names, frame_like
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import collected
from skthermo.exceptions import ModelWarning, SkthermoWarning
from skthermo.fem.damage import LossKind
from skthermo.preprocessing.folds import BlockedKFold, Rows, out_of_fold
from skthermo.residuals.sensors import SensorRegression, filled_findings
from skthermo.residuals.weather import TrainingRange, unpredicted_findings
from skthermo.surrogate._regression import TemperatureMapper, default_lines
from skthermo.surrogate._simulator import Simulator


def ratio_regressor() -> TemperatureMapper:
    """What learns ratios of frequencies by default, with a penalty for each mode.

    Penalties are few, because it is fitted often; below the least, rounding errors would show.
    """
    return TemperatureMapper(default_lines(np.logspace(-1, 5, 7), alpha_per_target=True))


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Logarithm of measured over modelled frequencies in the weather, mode by mode: ``discrepancy_(T)``.

    Regressors have ``learned`` the ratios of modes that are measured in the same rows, from inputs of the ``mapper``;
    changes from their mean logarithm count by the ``shares`` of the modes (:func:`reliable_shares`). It is 0 for modes
    with few records, and for all without a ``regressor``.
    """

    regressor: BaseEstimator | None
    learned: tuple[tuple[NDArray[np.intp], BaseEstimator, Array], ...]
    shares: Array
    sensors: SensorRegression | None = None
    mapper: Any = None

    @classmethod
    def fitted(
        cls,
        regressor: BaseEstimator | None,
        inputs: Array,
        ratios: Array,
        weights: Array | None = None,
        shares: Array | None = None,
        **parts: Any,
    ) -> Discrepancy:
        """Learn from ratios, (n_rows, n_modes), beside inputs of M2; sensors and mapper are parts.

        A mode with a ratio five robust deviations from its median, of logarithms, leaves out the row. Modes with 30
        rows learn, from at most 20,000, spread evenly. Shares may be known from more rows.
        """
        found = np.zeros(ratios.shape[1])
        usable = ~np.isnan(inputs).any(axis=1) & (True if weights is None else weights > 0)
        if regressor is None or not usable.any():
            return cls(None, (), found, **parts)
        logs, learned = np.log(np.where(usable[:, np.newaxis], ratios, np.nan)), []
        with np.errstate(invalid="ignore"):
            is_far = np.abs(logs - median(logs)) > 5 * robust_deviation(logs)
        present, of_mode = patterns(~np.isnan(logs).T)
        for number, mask in enumerate(present):
            modes = np.flatnonzero(of_mode == number)
            rows = spread_evenly(np.flatnonzero(mask & ~is_far[:, modes].any(axis=1)), 20_000)
            if len(rows) < 30 or not np.ptp(inputs[rows], axis=0).any():
                continue
            values, own = ratios[np.ix_(rows, modes)], None if weights is None else weights[rows]
            values = values[:, 0] if len(modes) == 1 else values
            learned.append((modes, fit_outputs(regressor, inputs[rows], values, own), mean_level(values, own)))
            found[modes] = reliable_shares(regressor, inputs[rows], values, own) if shares is None else shares[modes]
        return cls(regressor, tuple(learned), found, **parts)

    def __call__(self, X: Table) -> Array:
        """delta, (n_samples, n_modes), at temperatures in degrees Celsius; 0 without a discrepancy."""
        T = frame_like(X, self.sensors.fill(as_floats(X))[0])
        with collected():
            return self.at(as_floats(inputs_of_last_step(self.mapper, T)))

    def at(self, inputs: Array) -> Array:
        """delta at inputs of M2; NaN in rows in which one is missing."""
        known = ~np.isnan(inputs).any(axis=1)
        delta = np.full((len(inputs), len(self.shares)), np.nan)
        delta[known] = 0.0
        for modes, regressor, level in self.learned if known.any() else ():
            change = np.log(as_columns(regressor.predict(inputs[known]))) - level
            delta[np.ix_(known, modes)] = level + self.shares[modes] * change
        return delta


def mean_level(ratios: Array, weights: Array | None) -> Array:
    """Mean logarithm of ratios, (n_modes,)."""
    return np.average(np.log(as_columns(ratios)), axis=0, weights=weights)


def reliable_shares(regressor: BaseEstimator, inputs: Array, ratios: Array, weights: Array | None) -> Array:
    """Slopes of changes of ratios over those that a regressor predicts out of fold, from 0 to 1, (n_modes,)."""

    def learn(train: Rows) -> Callable[[Rows], Array]:
        own = None if weights is None else weights[train]
        fitted, level = fit_outputs(regressor, inputs[train], ratios[train], own), mean_level(ratios[train], own)
        return lambda test: np.log(as_columns(fitted.predict(inputs[test]))) - level

    predicted = out_of_fold(learn, BlockedKFold(5).fold_of(inputs))
    measured = np.log(as_columns(ratios)) - mean_level(ratios, weights)
    slopes = (predicted * measured).sum(axis=0) / np.maximum((predicted**2).sum(axis=0), np.finfo(float).tiny)
    return np.clip(slopes, 0.0, 1.0)


@dataclass(frozen=True, eq=False)
class Weather:
    """Temperatures of rows, and what a chain expects in them.

    Temperatures are ``given``, and ``filled`` from the other sensors with standard ``deviations``. M2 sees ``inputs``,
    lags included, and gives ``theta``, NaN in ``impossible`` rows; ``delta`` is the discrepancy.
    """

    given: Table
    filled: Table
    deviations: Array
    inputs: Array
    theta: Array
    impossible: NDArray[np.bool_]
    delta: Array

    def __len__(self) -> int:
        return len(self.inputs)


@dataclass(frozen=True, eq=False)
class ThermalModel(SavesFrames):
    """What a chain has learned to predict with: M2, the simulator of the FE model, the aligner and the discrepancy.

    ``sensors`` and ``training_range`` detect unusual weather, in which parameters stay within ``limits``, the least and
    the largest of each.
    """

    mapper: BaseEstimator
    simulator: Simulator
    aligner: BaseEstimator
    discrepancy: Discrepancy
    sensors: SensorRegression
    training_range: TrainingRange
    limits: Array
    parameter_names: Sequence[str]
    mode_names: Sequence[Any]
    n_jobs: int | None

    def weather(self, X: Table, T: Array) -> Weather:
        """The weather of a table, whose temperatures T have been read."""
        T, deviations = self.sensors.fill(T)
        filled = frame_like(X, T)
        inputs = as_floats(inputs_of_last_step(self.mapper, filled))
        theta, impossible = possible(self.learned(filled))
        return Weather(X, filled, deviations, inputs, theta, impossible, self.discrepancy.at(inputs))

    def learned(self, T: Table) -> Array:
        """Parameters at complete temperatures, as the mapper gives them, within the limits."""
        theta = as_columns(self.mapper.predict(T))
        return np.where(is_impossible(theta), theta, np.clip(theta, *self.limits))

    def doubts(self, weather: Weather) -> list[SkthermoWarning]:
        """Findings: filled sensors, unknown weather, impossible parameters."""
        consequence = "Standard deviations and intervals of predictions include the error of that"
        findings = [
            *self.sensors.doubts(weather.given),
            *filled_findings(weather.deviations, column_names(weather.filled, "T"), consequence),
            *unpredicted_findings(np.isnan(weather.inputs).any(axis=1), as_floats(weather.filled)),
            *self.training_range.doubts(weather.inputs),
        ]
        if weather.impossible.any():
            findings.append(
                ModelWarning(
                    "the mapper gave multipliers outside 1e-06 to 1e+06. These rows are NaN. Use a mapper that "
                    "extrapolates mildly, such as the default",
                    "outside-bounds",
                )
            )
        return findings

    def frequencies(self, theta: Array) -> Array:
        """Frequencies of the healthy model in the measured domain, without discrepancy; NaN where theta is."""
        return as_floats(self.aligner.inverse_transform(self.simulator.frequencies(possible(theta)[0], self.n_jobs)))

    def simulated(
        self,
        weather: Weather,
        modes: Sequence[int] | None = None,
        *,
        damage: Mapping[str, float | ArrayLike] | None = None,
        kind: LossKind = "stiffness",
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
    ) -> Array:
        """Frequencies of the changed structure, without noise; frequencies of other modes are in the numerical
        domain."""
        simulator, theta = self.simulator, weather.theta
        if modes is not None:
            simulator = simulator.changed("with_modes", modes)
        if stiffness is not None or mass is not None:
            simulator = simulator.changed("with_added", stiffness=stiffness, mass=mass)
        if parameters is not None:
            theta = theta * factors_of(parameters, self.parameter_names)
        if damage is not None:
            fixed, growing = split_damage(damage, weather.given)
            simulator = simulator.damaged(fixed, kind)
            if growing:
                severities = np.column_stack(list(growing.values()))
                simulator = simulator.with_damage_parameters(list(growing), severities.min(), severities.max(), kind)
                theta = np.hstack([theta, 1 - severities])
        frequencies = simulator.frequencies(theta, self.n_jobs)
        if modes is not None:
            return frequencies
        return as_floats(self.aligner.inverse_transform(frequencies)) * np.exp(weather.delta)

    def elasticity(self, theta: Array, *, step: float = 0.01) -> Array:
        """Relative changes of measured frequencies by those of the model's, (n_rows, n_modes), over a relative step;
        exact for shifts and scales."""
        frequencies = self.simulator.frequencies(theta, self.n_jobs)
        lower, higher = (as_floats(self.aligner.inverse_transform(frequencies * (1 + side))) for side in (-step, step))
        return (higher - lower) / (step * (higher + lower))

    def propagated(self, theta: Array, deviations: Array) -> Array:
        """Relative standard deviations of measured frequencies, (n_rows, n_modes), given those of theta."""
        theta = possible(theta)[0]
        slopes = self.simulator.linearise(theta, self.n_jobs)[1]
        effects = self.elasticity(theta)[:, :, np.newaxis] * slopes * (deviations / theta)[:, np.newaxis]
        return np.sqrt((effects**2).sum(axis=2))

    def known_deviations(self, weather: Weather) -> Array:
        """Relative standard deviations because temperatures were filled and as the mapper's ``return_std`` says."""
        n_parameters = len(self.parameter_names)

        def predict(filled: Table) -> Array:
            return np.hstack([self.learned(filled), self.discrepancy(filled)])

        def log_frequencies(both: Array) -> Array:
            return np.log(self.frequencies(both[:, :n_parameters])) + both[:, n_parameters:]

        variances = self.sensors.variances_of_fills(weather.given, weather.filled, predict, log_frequencies)
        inputs = inputs_of_last_step(self.mapper, weather.filled)
        stated = predict_with_std(last_step(self.mapper), inputs)[1]
        if stated is not None:
            variances = variances + self.propagated(weather.theta, stated) ** 2
        return np.sqrt(variances)


def limits_in_weather(estimates: Array) -> Array:
    """The least and the largest value of each parameter in any weather, given what records have shown, (2, n).

    Other weather may move ln theta by 0.3, or as far as a record has shown. A mapper would carry a bearing that freezes
    on to any stiffness.
    """
    seen = np.nanmin(estimates, axis=0), np.nanmax(estimates, axis=0)
    return np.stack([np.minimum(np.exp(-0.3), seen[0]), np.maximum(np.exp(0.3), seen[1])])


def possible(theta: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
    """Parameters, with NaN in rows with impossible values, and a mask of those rows."""
    theta = as_columns(theta).copy()
    impossible = is_impossible(theta).any(axis=1)
    theta[impossible] = np.nan
    return theta, impossible


def is_impossible(theta: Array) -> NDArray[np.bool_]:
    """Which multipliers no model can have: those with which rounding errors swamp its matrices."""
    return (theta < 1e-6) | (theta > 1e6)


def factors_of(parameters: Mapping[str, float], names: Sequence[str]) -> Array:
    """The factor of every parameter, 1 where none is given."""
    factors = dict.fromkeys(names, 1.0)
    parameters = mapping_of(parameters, "parameters", "a mapping of parameter to factor")
    for name, factor in parameters.items():
        if name not in factors:
            raise ValueError(f"parameter {name!r} is unknown; expected some of {names}")
        if not is_real(factor) or not 0 < factor < 1e150:
            raise ValueError(f"the factor of parameter {name!r} is {factor!r:.100}; expected a positive number")
        factors[name] = float(factor)
    return np.array(list(factors.values()))


def doubts_of_factors(parameters: Mapping[str, float] | None) -> list[ModelWarning]:
    """The finding that a factor was perhaps meant in percent."""
    return [
        ModelWarning(
            f"the factor of parameter {name!r} is {factor:g} (expected at most 10). Its stiffness is multiplied "
            "by that. Give 1.02 for 2 % more",
            "doubtful-factor",
        )
        for name, factor in (as_mapping(parameters) or {}).items()
        if factor > 10
    ]


def split_damage(
    damage: Mapping[str, float | ArrayLike], X: ArrayLike
) -> tuple[dict[str, float], dict[str, NDArray[np.float64]]]:
    """Severities that are the same in all rows, and those with a value for each row."""
    damage = mapping_of(damage, "damage", "a mapping of group to severity")
    fixed: dict[str, Any] = {}
    growing: dict[str, NDArray[np.float64]] = {}
    n_rows = np.shape(X)[0]
    for group, severity in damage.items():
        if np.ndim(severity) == 0:
            fixed[group] = severity
            continue
        values = real_array(severity, f"damage of group {group!r}")
        if values.shape != (n_rows,) or not (values < 1).all() or not np.isfinite(values).all():
            raise ValueError(
                f"damage of group {group!r} has shape {values.shape} and highest value {values.max(initial=0)}; "
                f"expected one severity or {n_rows}, one for each row, finite and below 1"
            )
        check_same_rows(X, severity, ("temperatures", f"damage of group {group!r}"))
        growing[group] = values
    return fixed, growing
