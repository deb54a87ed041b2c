"""The two stages of a chain: M1, which finds parameters of records, and M2 with all that predicts from temperatures."""

from __future__ import annotations

import warnings
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils import Bunch

from skthermo._core.arrays import (
    HUGE,
    Array,
    MatrixLike,
    Reduce,
    as_columns,
    as_floats,
    as_mapping,
    is_auto,
    is_real,
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
    offers,
    predicted_covariance,
    reach_of,
    rows_from_fleet,
    warn_of_fleet,
)
from skthermo._core.frames import Table, check_same_rows, column_names, frame_like
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import reported_by_caller, warn_user, without_warnings
from skthermo.exceptions import (
    FewRecordsWarning,
    ModelWarning,
    RecordsWarning,
    SkthermoWarning,
    UnevaluatedRowsWarning,
    WeatherWarning,
)
from skthermo.fem import FEModel, shape_components
from skthermo.residuals.weather import PredictionError, SensorRegression, TrainingRange, filled_text, unpredicted_text
from skthermo.surrogate._regression import TemperatureMapper, default_lines
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.inverse import InverseSurrogate, PosteriorInverse, ShapeInputs

SCARCE = 0.25  # mean weight of records with gaps below which a warning is given: four of six modes missing in each, say
FEW_SHAPES = 0.5  # share of measured modes with a complete shape below which a warning is given
SHAPES_COMPARED = 100  # rows of parameters at which the model's shapes are compared with the measured ones
UNLIKE = 5.0  # distance of median components from those of the model, in deviations of the noise, that gives a warning


@dataclass(frozen=True)
class ChainInverse:
    """M1 of a chain: a `PosteriorInverse`, an `InverseSurrogate`, a pipeline that ends with one, or a transformer."""

    estimator: BaseEstimator

    @property
    def inverses(self) -> list[PosteriorInverse | InverseSurrogate]:
        """Every inverse of an FE model that it is or holds."""
        parts = (self.estimator, *self.estimator.get_params().values())
        return [part for part in parts if isinstance(part, PosteriorInverse | InverseSurrogate)]

    @property
    def posterior(self) -> PosteriorInverse | None:
        """The `PosteriorInverse` that it is or ends with."""
        last = last_step(self.estimator)
        return last if isinstance(last, PosteriorInverse) else None

    @property
    def shape_inputs(self) -> ShapeInputs | None:
        """How shapes are read; None without ``dofs``."""
        part = self.posterior
        return None if part is None or part.dofs is None else ShapeInputs.of(part.model, part.dofs, part.shape_noise)

    def prepare(self, model: FEModel, memory: str | Memory | None, reduce: Reduce, *, has_shapes: bool) -> None:
        """Give every inverse what it has not: the chain's model, memory and choice of a reduced model."""
        names = list(model.parameter_names)
        for part in self.inverses:
            if part.model is None:
                part.set_params(model=model)
            if part.memory is None:
                part.set_params(memory=memory)
            if list(part.model.parameter_names) != names:
                raise ValueError(
                    f"the inverse's model has the parameters {list(part.model.parameter_names)}; expected {names}, as "
                    f"{model!r} has"
                )
            may_reduce = isinstance(part, PosteriorInverse) and is_auto(part.reduce)
            if may_reduce and (not reduce or hasattr(part.model, "reduced")):
                part.set_params(reduce=reduce)
        if self.shape_inputs is not None and not has_shapes:
            raise ValueError("the inverse has dofs, but there are no shapes; expected fit(T, F, shapes=shapes)")

    def fit(self, aligned: Table, noise: Array) -> None:
        """Fit M1 to aligned records; an `InverseSurrogate` with ``noise="auto"`` takes the noise of the records."""
        for part in self.inverses:
            if isinstance(part, InverseSurrogate) and isinstance(part.noise, str):
                part.set_params(noise=noise)
        self.estimator.fit(aligned)

    def invert(self, aligned: Table, parameter_names: list[str]) -> Bunch:
        """``theta`` of aligned records and, of a `PosteriorInverse`, all that its ``invert`` gives.

        It warns where records determine little.
        """
        last = self.posterior
        if last is None:
            theta = as_floats(self.estimator.transform(aligned))
            if theta.shape[1] != len(parameter_names):
                raise ValueError(f"the inverse gave {theta.shape[1]} columns; expected {parameter_names}")
            return Bunch(theta=theta)
        found = last.invert(inputs_of_last_step(self.estimator, aligned))
        last.warn_of(found)
        weight = found.weight[found.weight > 0].mean() if found.weight.any() else 1.0
        if weight < SCARCE:
            warn_user(
                f"because of gaps, a record carries on average {weight:.0%} of the parameter precision of a complete "
                "one. Estimates are drawn towards the model's nominal state. Track more modes, or use "
                "imputer=KNNGapImputer()",
                FewRecordsWarning,
                "sparse-modes",
            )
        return Bunch(**{**found, "theta": as_floats(found.theta)})

    def with_shapes(self, F: Table, shapes: ArrayLike | None) -> Table:
        """Frequencies with the columns of shapes that the inverse expects; NaN there without shapes."""
        inputs = self.shape_inputs
        if inputs is None:
            if shapes is not None:
                raise ValueError("shapes are given, but the inverse has no dofs; expected PosteriorInverse(dofs=...)")
            return F
        components = np.full((len(F), inputs.n_columns - inputs.n_modes), np.nan)
        if shapes is not None:
            components = shape_components(shapes, inputs.reference)
            if len(components) != len(F):
                raise ValueError(
                    f"shapes have {len(components)} rows and frequencies {len(F)}; expected the same number"
                )
        modes = [str(name) for name in column_names(F, "f")]
        if hasattr(F, "columns"):
            F = F.set_axis(modes, axis=1)
        names = [*modes, *(f"{mode}_dof{dof}" for mode in modes for dof in inputs.dofs)]
        return frame_like(F, np.hstack([as_floats(F), components]), names)

    def shape_warnings(self, aligned: Table, theta: Array) -> Iterator[SkthermoWarning]:
        """Warnings about measured shapes, beside the parameters of the records: kind and text of each."""
        inverse = self.posterior
        if inverse is None:
            return
        inputs, values = inverse.shape_inputs_, as_floats(aligned)
        n_modes, n_sensors = inputs.n_modes, inputs.n_sensors
        components = values[:, n_modes:].reshape(len(values), n_modes, n_sensors)
        found = ~np.isnan(values[:, :n_modes])
        n_shapes = (found & ~np.isnan(components).any(axis=2)).sum()
        names = column_names(aligned, "f")[:n_modes]
        if n_shapes < FEW_SHAPES * found.sum():
            yield RecordsWarning(
                f"{n_shapes} of {found.sum()} measured modes have a component of their shape at each of the "
                f"{n_sensors} sensors. The other shapes are not used. Leave sensors that failed out of dofs",
                "few-shapes",
            )
        rows = spread_evenly(np.flatnonzero(~np.isnan(theta).any(axis=1)), SHAPES_COMPARED)
        if not n_shapes or not len(rows):
            return
        possible = inputs.of_parameters(inverse.model, theta[rows])[:, n_modes:].reshape(-1, n_modes, n_sensors)
        lowest, highest = possible.min(axis=0), possible.max(axis=0)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)  # a mode without any shape
            median = np.nanmedian(components, axis=0)
        excess = np.nan_to_num(np.maximum(lowest - median, median - highest) / inputs.noise[:, np.newaxis])
        mode, sensor = np.unravel_index(excess.argmax(), excess.shape)
        if excess[mode, sensor] > UNLIKE:
            yield ModelWarning(
                f"measured shapes of {names[mode]!r} are unlike those of the model at the parameters of the records. "
                f"At sensor {sensor} the median component is {median[mode, sensor]:.2f}, by the model "
                f"{lowest[mode, sensor]:.2f} to {highest[mode, sensor]:.2f}. They distort the parameters. Check the "
                "modes, and order, signs and gains of the sensors (dofs), or raise shape_noise",
                "foreign-shapes",
            )


PENALTIES = np.logspace(-1, 5, 7)  # few, because it is fitted often; below them, rounding errors would show
FEWEST = 30  # records of a mode, below which its discrepancy counts as 0
TINY = 1e-300
FAR = 5.0  # robust deviations of ln(measured / model) from the median, beyond which a record does not count
MOST = 20_000  # records, spread evenly, that a discrepancy is learned from


@dataclass(frozen=True, eq=False)
class Ratios:
    """Ratios of measured over modelled frequencies, (n_rows, n_modes), beside inputs of M2, and weights of the rows."""

    inputs: Array
    values: Array
    weights: Array | None = None

    def weights_of(self, rows: NDArray[np.intp]) -> Array | None:
        return None if self.weights is None else self.weights[rows]

    def groups(self) -> Iterator[tuple[NDArray[np.intp], NDArray[np.intp]]]:
        """Modes that are there in the same rows, and these rows, without those in which a mode is far from its
        median."""
        usable = ~np.isnan(self.inputs).any(axis=1) & (True if self.weights is None else self.weights > 0)
        logs = np.log(np.where(usable[:, np.newaxis], self.values, np.nan))
        with np.errstate(invalid="ignore"):
            far = np.abs(logs - median(logs)) > FAR * robust_deviation(logs)
        present, of_mode = patterns(~np.isnan(logs).T)
        for number, mask in enumerate(present):
            modes = np.flatnonzero(of_mode == number)
            yield modes, spread_evenly(np.flatnonzero(mask & ~far[:, modes].any(axis=1)), MOST)

    def learned(
        self, regressor: BaseEstimator, modes: NDArray[np.intp], rows: NDArray[np.intp]
    ) -> LearnedRatios | None:
        """What a regressor learns of some modes in some rows; None where these are too few."""
        inputs, weights = self.inputs[rows], self.weights_of(rows)
        if len(rows) < FEWEST or not np.ptp(inputs, axis=0).all():
            return None
        values = self.values[np.ix_(rows, modes)]
        level = np.average(np.log(values), axis=0, weights=weights)
        values = values[:, 0] if len(modes) == 1 else values
        return LearnedRatios(modes, rows, level, fit_outputs(regressor, inputs, values, weights))

    def learned_by(self, regressor: BaseEstimator | None) -> tuple[LearnedRatios, ...]:
        """What a regressor learns of each group of modes that has enough rows."""
        if regressor is None:
            return ()
        found = [self.learned(regressor, *group) for group in self.groups()]
        return tuple(filter(None, found))


@dataclass(frozen=True, eq=False)
class LearnedRatios:
    """A regressor of ratios, fitted to some ``modes`` in some ``rows``; ``level`` is the mean of their logarithms."""

    modes: NDArray[np.intp]
    rows: NDArray[np.intp]
    level: Array
    regressor: BaseEstimator

    def logs(self, inputs: Array) -> Array:
        """Logarithms of the ratios at complete inputs, (n_samples, n_modes)."""
        return np.log(as_columns(self.regressor.predict(inputs)))


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Logarithm of measured over modelled frequencies in the weather, mode by mode: ``discrepancy_(T)``.

    ``learned`` holds the fitted regressors of the ratios, from inputs of the ``mapper``; modes with few records have
    none. The changes that they add to the ``levels`` of the modes count by ``shares``, the slopes of the ratios over
    what is predicted out of fold.
    """

    regressor: BaseEstimator
    learned: tuple[LearnedRatios, ...]
    levels: Array
    shares: Array
    sensors: SensorRegression | None = None
    mapper: Any = None

    @classmethod
    def of(cls, regressor: BaseEstimator, ratios: Ratios, folds: NDArray[np.intp], **chain: Any) -> Discrepancy:
        """Learn from ratios of measured over modelled frequencies, and the folds of their rows."""
        levels, shares = np.zeros((2, ratios.values.shape[1]))
        learned = ratios.learned_by(regressor)
        for one in learned:
            logs = np.log(ratios.values[np.ix_(one.rows, one.modes)]) - one.level
            change = np.zeros_like(logs)
            for fold in np.unique(folds[one.rows]):
                test = folds[one.rows] == fold
                other = ratios.learned(regressor, one.modes, one.rows[~test])
                if other is not None:
                    change[test] = other.logs(ratios.inputs[one.rows[test]]) - one.level
            slopes = (change * logs).sum(axis=0) / np.maximum((change**2).sum(axis=0), TINY)
            levels[one.modes], shares[one.modes] = one.level, np.clip(slopes, 0, 1)
        return cls(regressor, learned, levels, shares, **chain)

    def relearned(self, ratios: Ratios) -> Discrepancy:
        """The same with regressors that have learned other ratios."""
        return replace(self, learned=ratios.learned_by(self.regressor) if self.learned else ())

    def again(self, ratios: Ratios, mapper: BaseEstimator) -> Discrepancy:
        """What the regressor learns of other ratios beside another mapper; changes count by the same shares."""
        found, levels = self.relearned(ratios), self.levels.copy()
        for one in found.learned:
            levels[one.modes] = one.level
        return replace(found, levels=levels, mapper=mapper)

    def __call__(self, X: Table) -> Array:
        """delta, (n_samples, n_modes), at temperatures in degrees Celsius; 0 without a discrepancy."""
        T = frame_like(X, self.sensors.fill(as_floats(X))[0])
        with without_warnings():
            return self.at(as_floats(inputs_of_last_step(self.mapper, T)))

    def at(self, inputs: Array) -> Array:
        """delta at inputs of M2; NaN in rows in which one is missing."""
        known = ~np.isnan(inputs).any(axis=1)
        delta = np.where(known[:, np.newaxis], self.levels, np.nan)
        for one in self.learned if known.any() else ():
            change = one.logs(inputs[known]) - self.levels[one.modes]
            delta[np.ix_(known, one.modes)] += self.shares[one.modes] * change
        return delta


def ratio_regressor() -> TemperatureMapper:
    """What learns ratios and the noise by default, with a penalty for each mode."""
    return TemperatureMapper(default_lines(PENALTIES, alpha_per_target=True))


LARGE_FACTOR = 10.0  # factor of a parameter that was perhaps meant in percent
ALIGNED = 0.01  # relative change of frequencies for the slope of an aligner; exact for shifts and scales
FARTHEST_BEYOND = 0.3  # of ln theta, that no record has shown but other weather may
POSSIBLE = (1e-6, 1e6)  # range of multipliers; outside it rounding errors swamp the model's matrices


@dataclass(frozen=True, eq=False)
class Weather:
    """Temperatures as they were ``given``, and ``filled`` from the other sensors, with the deviations of the fills.

    ``mapper`` is the fitted M2 whose last step sees them as ``inputs``, lags included.
    """

    given: Table
    filled: Table
    deviations: Array
    mapper: BaseEstimator

    def __len__(self) -> int:
        return len(self.filled)

    @cached_property
    def columns(self) -> Table:
        """Inputs of the last step of M2, a frame as a frame."""
        return inputs_of_last_step(self.mapper, self.filled)

    @cached_property
    def inputs(self) -> Array:
        """Inputs of the last step of M2."""
        return as_floats(self.columns)


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

    def learned(self, temperatures: Table) -> Array:
        """What the mapper gives, without its warning of the weather, of which the chain says more."""
        with reported_by_caller({"implausible-temperatures"}):
            theta = as_columns(self.mapper.predict(temperatures))
        return np.where(is_possible(theta), np.clip(theta, *self.limits), theta)

    def parameters(self, weather: Weather) -> Array:
        """Parameters, with warnings of what was filled, unknown weather and impossible parameters."""
        filled, unknown = weather.filled, np.isnan(weather.inputs).any(axis=1)
        consequence = "Standard deviations and intervals of predictions include the error of that"
        message = filled_text(weather.deviations, column_names(filled, "T"), consequence)
        warn_user(message, RecordsWarning, "filled-temperatures")
        warn_user(unpredicted_text(unknown, as_floats(filled)), UnevaluatedRowsWarning, "not-predicted")
        learned, inputs = reach_of(self.mapper, filled) or (self.training_range, weather.columns)
        warn_user(learned.warning(inputs), WeatherWarning, "outside-training-weather")
        consequence = "Standard deviations and intervals include that uncertainty"
        warn_of_fleet(rows_from_fleet(self.mapper, filled), consequence)
        warn_user(self.sensors.warning(weather.given), RecordsWarning, "sensor-disagrees")
        theta, impossible = possible(self.learned(weather.filled))
        if impossible.any():
            row = np.flatnonzero(impossible)[0]
            warn_user(
                f"in {impossible.sum()} of {len(theta)} rows, row {row} the first, the mapper gave multipliers outside "
                f"{POSSIBLE[0]:g} to {POSSIBLE[1]:g}. These rows are NaN. Use a mapper that extrapolates mildly, such "
                "as the default",
                ModelWarning,
                "impossible-parameters",
            )
        return theta

    def frequencies(self, theta: Array) -> Array:
        """Frequencies of the healthy model in the measured domain, without discrepancy and warnings."""
        return frequencies_of(self.simulator, self.aligner, theta, self.n_jobs)

    def simulated(self, weather: Weather, modes: Sequence[int] | None = None, **changes: Any) -> Array:
        """Frequencies of the structure as `StructureInWeather` simulates it in this weather."""
        return StructureInWeather(self, weather).simulated(modes, **changes)

    def in_weather(self, weather: Weather, n_rows: int | None = None) -> StructureInWeather:
        """The structure in this weather, in which several changes can be simulated, each in so many rows in all."""
        return StructureInWeather(self, weather, n_rows)

    def propagated(self, theta: Array, covariances: Array) -> Array:
        """Covariances of ln f in the measured domain, G C G' with G = d ln f / d theta, (n, n_modes, n_modes)."""
        frequencies, jacobian = self.simulator.linearise(possible(theta)[0], self.n_jobs)
        sides = [as_floats(self.aligner.inverse_transform(frequencies * (1 + side))) for side in (-ALIGNED, ALIGNED)]
        slopes = np.log(sides[1] / sides[0]) / (2 * ALIGNED * frequencies)
        effects = slopes[:, :, np.newaxis] * jacobian
        return effects @ covariances @ effects.swapaxes(1, 2)

    def known_deviations(self, weather: Weather) -> Array:
        """Relative standard deviations because temperatures were filled and the mapper states errors of its own."""
        covariances = self.covariances_of_fills(weather), self.covariances_of_mapper(weather)
        return np.hypot(*(np.sqrt(np.einsum("ijj->ij", part)) for part in covariances))

    def covariances_of_fills(self, weather: Weather) -> Array:
        """Covariances of ln f because temperatures were filled, (n_rows, n_modes, n_modes)."""
        n_parameters = len(self.parameter_names)

        def predict(filled: Table) -> Array:
            return np.hstack([self.learned(filled), self.discrepancy(filled)])

        def log_frequencies(both: Array) -> Array:
            return np.log(self.frequencies(both[:, :n_parameters])) + both[:, n_parameters:]

        cost = PredictionError.of_fills(self.sensors, weather.given, weather.filled, predict, log_frequencies)
        return cost.of_all(len(weather), len(self.mode_names))

    def covariances_of_mapper(self, weather: Weather) -> Array:
        """Covariances of ln f as the mapper states them; zero where it does not."""
        if not offers(self.mapper, "predict_covariance"):
            return np.zeros((len(weather), len(self.mode_names), len(self.mode_names)))
        theta = self.learned(weather.filled)
        return self.propagated(theta, predicted_covariance(self.mapper, weather.filled))

    def predicted_covariance(self, weather: Weather) -> Array:
        """Covariance of predicted frequencies in Hz squared, (n_rows, n_modes, n_modes), as the mapper states it."""
        ratio = np.exp(self.discrepancy.at(weather.inputs))
        predicted = self.frequencies(self.learned(weather.filled)) * ratio
        return self.covariances_of_mapper(weather) * predicted[:, :, np.newaxis] * predicted[:, np.newaxis]


@dataclass(frozen=True, eq=False)
class StructureInWeather:
    """A thermal model in one weather, whose parameters and discrepancy are computed once for whatever changes.

    Frequencies of each change will be asked for in ``n_rows`` rows in all, by default in those of this weather.
    """

    model: ThermalModel
    weather: Weather
    n_rows: int | None = None

    @cached_property
    def theta(self) -> Array:
        """Parameters, with the warnings of `ThermalModel.parameters`."""
        return self.model.parameters(self.weather)

    @cached_property
    def ratio(self) -> Array:
        """Measured over modelled frequencies, as the discrepancy has it."""
        return np.exp(self.model.discrepancy.at(self.weather.inputs))

    def measured(self, frequencies: Array) -> Array:
        """Frequencies of the FE model in the measured domain, with the discrepancy."""
        return as_floats(self.model.aligner.inverse_transform(frequencies)) * self.ratio

    def simulated(
        self,
        modes: Sequence[int] | None = None,
        *,
        damage: Mapping[str, float | ArrayLike] | None = None,
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
    ) -> Array:
        """Frequencies of the changed structure, without noise; those of other modes are in the numerical domain."""
        model = self.model
        simulator = model.simulator if modes is None else model.simulator.changed("with_modes", modes)
        if stiffness is not None or mass is not None:
            simulator = simulator.changed("with_added", stiffness=stiffness, mass=mass)
        theta = self.theta * factors_of(parameters, model.parameter_names)
        fixed, growing = split_damage(damage, self.weather.given)
        simulator = simulator.damaged(fixed)
        if growing:
            severities = np.column_stack(list(growing.values()))
            simulator = simulator.with_damage_parameters(list(growing), severities.min(), severities.max())
            theta = np.hstack([theta, 1 - severities])
        frequencies = simulator.frequencies(theta, model.n_jobs, n_rows=self.n_rows)
        return frequencies if modes is not None else self.measured(frequencies)

    def with_each(self, draws: Sequence[Mapping[str, float]]) -> list[Array]:
        """Frequencies with one damage of the same groups after the other, solved together by one model."""
        groups, n_rows = list(draws[0]), len(self.theta)
        severities = np.array([[draw[group] for group in groups] for draw in draws])
        simulator = self.model.simulator.with_damage_parameters(groups, severities.min(), severities.max())
        theta = np.hstack([np.tile(self.theta, (len(draws), 1)), np.repeat(1 - severities, n_rows, axis=0)])
        return [self.measured(one) for one in np.split(simulator.frequencies(theta, self.model.n_jobs), len(draws))]


def frequencies_of(simulator: Simulator, aligner: BaseEstimator, theta: Array, n_jobs: int | None) -> Array:
    """Frequencies in the measured domain, NaN where theta is impossible, without warnings."""
    frequencies = simulator.frequencies(possible(theta)[0], n_jobs, warn=False, n_rows=len(theta))
    return as_floats(aligner.inverse_transform(frequencies))


def limits_in_weather(estimates: Array) -> Array:
    """The least and the largest value of each parameter in any weather, given what records have shown, (2, n).

    A mapper would carry a bearing that freezes on to any stiffness.
    """
    seen = np.nanmin(estimates, axis=0), np.nanmax(estimates, axis=0)
    return np.stack([np.minimum(np.exp(-FARTHEST_BEYOND), seen[0]), np.maximum(np.exp(FARTHEST_BEYOND), seen[1])])


def possible(theta: ArrayLike) -> tuple[Array, NDArray[np.bool_]]:
    """Parameters, with NaN in rows with impossible values, and a mask of those rows."""
    theta = as_columns(theta).copy()
    impossible = ~(is_possible(theta) | np.isnan(theta)).all(axis=1)
    theta[impossible] = np.nan
    return theta, impossible


def is_possible(theta: Array) -> NDArray[np.bool_]:
    """Which multipliers a model can have."""
    return (POSSIBLE[0] <= theta) & (theta <= POSSIBLE[1])


def factors_of(parameters: Mapping[str, float] | None, names: Sequence[str]) -> Array:
    """The factor of every parameter, 1 where none is given."""
    factors = dict.fromkeys(names, 1.0)
    parameters = {} if parameters is None else as_mapping(parameters)
    if not isinstance(parameters, Mapping):
        raise ValueError(f"parameters is {parameters!r:.200}; expected a mapping of parameter to factor")
    for name, factor in parameters.items():
        if name not in factors:
            raise ValueError(f"parameter {name!r} is unknown; expected some of {names}")
        if not is_real(factor) or not 0 < factor < HUGE:
            raise ValueError(f"the factor of parameter {name!r} is {factor!r:.100}; expected a positive number")
        if factor > LARGE_FACTOR:
            warn_user(
                f"the factor of parameter {name!r} is {factor:g} (expected at most {LARGE_FACTOR:g}). Its stiffness is "
                "multiplied by that. Give 1.02 for 2 % more",
                ModelWarning,
                "large-factor",
            )
        factors[name] = float(factor)
    return np.array(list(factors.values()))


def split_damage(
    damage: Mapping[str, float | ArrayLike] | None, X: ArrayLike
) -> tuple[dict[str, float], dict[str, NDArray[np.float64]]]:
    """Severities that are the same in all rows, and those with a value for each row."""
    damage = as_mapping(damage)
    if damage is not None and not isinstance(damage, Mapping):
        raise ValueError(f"damage is {damage!r}; expected a mapping of group to severity")
    fixed: dict[str, Any] = {}
    growing: dict[str, NDArray[np.float64]] = {}
    n_rows = np.shape(X)[0]
    for group, severity in (damage or {}).items():
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
