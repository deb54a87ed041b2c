"""Records that a chain was fitted to, their residuals out of fold, and draws of records that monitoring would take."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import deepcopy
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import (
    Array,
    as_columns,
    as_floats,
    as_random_state,
    check_noise,
    is_real,
    median,
    refuse_no_table,
    robust_deviation,
    spread_evenly,
)
from skthermo._core.estimators import _safe_indexing, fit_checked, last_step
from skthermo._core.frames import Table, check_same_rows, column_names, frame_like, row_times
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import collected
from skthermo.exceptions import RecordsWarning
from skthermo.fem import FEModel, match_modes
from skthermo.preprocessing import BlockedKFold, RecordFindings, check_records
from skthermo.preprocessing.folds import out_of_fold
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.weather import unseen_weather
from skthermo.surrogate._thermal import Discrepancy, ThermalModel, Weather, ratio_regressor

N_FOLDS = 5  # of records out of fold


@dataclass(frozen=True, eq=False)
class TrainingRecords(SavesFrames):
    """Records that `DataInformedFEM.fit` was given, in their order, and what M2 learned from them.

    M2 has ``inputs``, lags included, and ``targets``, the parameters of the records, whose columns are
    ``parameter_names``; for the inputs it gives the ``learned`` parameters. ``usable`` frequencies are without
    outliers, ``modelled`` frequencies are the FE model's at ``learned``, in the measured domain. ``weights`` of the
    rows may be None.
    """

    temperatures: Table
    frequencies: Table
    inputs: Array
    targets: Array
    learned: Array
    usable: Array
    modelled: Array
    weights: Array | None
    parameter_names: Sequence[str]

    @property
    def trained(self) -> NDArray[np.bool_]:
        """Which rows trained M2."""
        return ~(np.isnan(self.inputs).any(axis=1) | np.isnan(self.targets).any(axis=1)) & self.counted

    @property
    def counted(self) -> NDArray[np.bool_]:
        """Which rows have a weight, or had no mode that could give them one."""
        if self.weights is None:
            return np.ones(len(self.inputs), dtype=bool)
        return (self.weights > 0) | np.isnan(as_floats(self.frequencies)).all(axis=1)

    def residuals(self, model: ThermalModel, *, least: int = 1) -> BaselineResiduals:
        """Relative residuals of the records, each predicted by a mapper and a discrepancy of the other folds.

        A fold holds every fifth block of a week or, where that is longer, of five correlation times or the ``least``
        number of records, as far as each fold keeps two blocks.
        """
        measured = as_floats(self.frequencies)
        known = ~np.isnan(self.inputs).any(axis=1) & ~np.isnan(measured).all(axis=1) & self.counted
        order = np.argsort(row_times(self.temperatures), kind="stable")
        order = order[known[order]]
        inputs, theta, measured = self.inputs[order], self.targets[order], measured[order]
        weights = None if self.weights is None else self.weights[order]
        has_theta = ~np.isnan(theta).any(axis=1)
        if has_theta.sum() < 2 * N_FOLDS:
            found = f"{has_theta.sum()} records have parameters"
            raise ValueError(f"{found}; expected at least {2 * N_FOLDS} for residuals")
        own = measured / (self.modelled[order] * np.exp(model.discrepancy.at(inputs))) - 1
        records = _safe_indexing(self.temperatures, order)
        seen = ~np.isnan(own).all(axis=1)
        in_sample = BaselineResiduals(inputs[seen], own[seen], own[seen], np.zeros(seen.sum(), dtype=np.intp))
        length = max(5.0 * in_sample.correlation_time, least)
        fold_of = BlockedKFold(N_FOLDS).remembering(records, length).fold_of(records)
        learner, names = last_step(model.mapper), list(self.parameter_names)

        def learn_parameters(train: NDArray[np.intp]) -> Callable[[NDArray[np.intp]], Array]:
            rows = train[has_theta[train]]
            targets, own_weights = pd.DataFrame(theta[rows], columns=names), None if weights is None else weights[rows]
            fitted = fit_checked(clone(learner), inputs[rows], targets, own_weights)
            return lambda test: as_columns(fitted.predict(inputs[test]))

        def learn_discrepancy(train: NDArray[np.intp]) -> Callable[[NDArray[np.intp]], Array]:
            # ratios to predictions that are out of fold themselves, so that the model is not solved for each fold
            rows = train[has_theta[train]]
            own_weights = None if weights is None else weights[rows]
            known = model.discrepancy.regressor, inputs[rows], ratios[rows], own_weights
            others = Discrepancy.fitted(*known, shares=model.discrepancy.shares)
            return lambda test: others.at(inputs[test])

        predicted = out_of_fold(learn_parameters, fold_of)
        modelled = model.frequencies(predicted)
        ratios = self.usable[order] / modelled
        values = measured / (modelled * np.exp(out_of_fold(learn_discrepancy, fold_of))) - 1
        known = ~np.isnan(values).all(axis=1)
        consequence = "Standard deviations, intervals and noise are unreliable there"
        doubts = tuple(unseen_weather(records, fold_of, consequence))
        return BaselineResiduals(inputs[known], values[known], own[known], fold_of[known], order[known], doubts)


def frequency_table(y: Any) -> tuple[Table, bool]:
    """Frequencies as a table, and whether they were a vector of one mode."""
    if y is None:
        raise ValueError("This DataInformedFEM estimator requires y to be passed, but the target y is None")
    refuse_no_table(y, "y", or_vector=True)
    if np.ndim(y) != 1:
        return y, False
    if isinstance(y, pd.Series):
        return y.to_frame("f1" if y.name is None else y.name), True
    return np.reshape(y, (-1, 1)), True


def usable_records(T: Table, F: Table, model: FEModel) -> tuple[Table, Table, RecordFindings]:
    """Temperatures, NaN in sensors that say nothing, frequencies, and findings; an error if a mode says nothing."""
    found = check_records(T, F, model=model)
    is_left_out = np.array([name in found.left_out for name in column_names(T, "T")])
    if is_left_out.all() or is_left_out.sum() < len(found.left_out):
        found.refuse_meaningless(needs_all=True)
    found.refuse_meaningless(exclude={"useless-column"})
    return frame_like(T, np.where(is_left_out, np.nan, as_floats(found.temperatures))), found.frequencies, found


def doubts_of_order(model: FEModel, F: Table) -> list[RecordsWarning]:
    """The finding that modes look like others of the model.

    They do if another order reduces the squared offsets to a quarter, all below 15 percent, of modes each farther than
    2 percent from that of its column; a factor common to all modes does not count.
    """
    nominal = as_floats(model.frequencies(np.ones((1, len(model.parameter_names)))))[0]
    if len(nominal) < 2:
        return []
    table, names = match_modes(model, as_floats(F)), column_names(F, "f")
    order, logs = table["mode"].to_numpy(), np.log(table["measured"].to_numpy())
    offsets = 100 * (logs - np.log([nominal, table["model"]]))
    given, best = offsets - offsets.mean(axis=1, keepdims=True)
    others = np.flatnonzero(order != getattr(model, "mode_ranks", range(len(order))))
    is_better = (best**2).sum() < 0.25 * (given**2).sum() and np.abs(best).max() < 15
    if not is_better or np.abs(given[others]).min(initial=np.inf) < 2:
        return []
    remedy = f", or use model.with_modes({order.tolist()})" if hasattr(model, "with_modes") else f": {order.tolist()}"
    return [
        RecordsWarning(
            f"the frequencies {[names[place] for place in others]} look like other modes of the model. They would be "
            f"learned as those of their columns. Order them as the model does{remedy}; match_modes compares "
            "frequencies and shapes",
            "mode-order",
        )
    ]


def measurement_noise(mapper: BaseEstimator, T: Table, F: Table) -> Array:
    """Relative standard deviations of frequencies about a regression on what an unfitted mapper sees of the weather.

    Out of fold, and by medians, so that outliers and rare weather hardly move them; (n_modes,). At most 0.1 counts as
    noise; 3000 records, spread evenly, are looked at.
    """
    rows = spread_evenly(np.argsort(row_times(T), kind="stable"), 3000)
    logs, inputs = np.log(as_floats(F)), T
    if isinstance(mapper, Pipeline):
        with collected():
            inputs = clone(mapper[:-1]).fit_transform(T, np.where(np.isnan(logs), median(logs), logs))
    inputs, changes = as_floats(inputs)[rows], logs[rows] - median(logs)
    ratios, fold_of = np.exp(changes), BlockedKFold(N_FOLDS).fold_of(_safe_indexing(T, rows))

    def learn(train: NDArray[np.intp]) -> Callable[[NDArray[np.intp]], Array]:
        learned = Discrepancy.fitted(ratio_regressor(), inputs[train], ratios[train], shares=np.ones(ratios.shape[1]))
        return lambda test: learned.at(inputs[test])

    return np.minimum(robust_deviation(changes - out_of_fold(learn, fold_of)), 0.1)


@dataclass(frozen=True, eq=False)
class ServiceRecords:
    """Gaps and outliers of training records in order of time, as `RecordSimulator.service_of` gives them.

    ``missing`` temperatures and frequencies, (n_records, n_sensors + n_modes); relative residuals of ``outliers``,
    (n_records, n_modes), NaN where a value is none; ``weather``, (n_records, n_inputs).
    """

    missing: NDArray[np.bool_]
    outliers: Array
    weather: Array

    def draw(self, weather: Array, random_state: np.random.RandomState) -> NDArray[np.intp]:
        """Positions, (n_rows,), of the records from which rows of weather in order of time take their faults.

        They are successive records, after the last of which the first one comes, so that faults last as long as in
        training. The first row with known weather takes one of the 25 records with the most similar weather.
        """
        known = np.flatnonzero(~np.isnan(weather).any(axis=1))
        first = random_state.randint(len(self.weather))
        if len(known):
            differences = (self.weather - weather[known[0]]) / np.nanstd(self.weather, axis=0)
            first = random_state.choice(np.argsort((differences**2).sum(axis=1), kind="stable")[:25]) - known[0]
        return (first + np.arange(len(weather))) % len(self.weather)


@dataclass(frozen=True, eq=False)
class RecordSimulator(SavesFrames):
    """Draws what monitoring adds to the frequencies of a thermal model, as its training records show it.

    Records that were drawn themselves have the ``gaps_and_outliers`` of other records. `DataInformedFEM.simulate`
    describes the arguments ``noise``, ``gaps``, ``outliers`` and ``random_state``; weather comes from
    `DataInformedFEM.weather`.
    """

    model: ThermalModel
    records: TrainingRecords
    gaps_and_outliers: ServiceRecords | None = None

    @cached_property
    def residuals(self) -> BaselineResiduals:
        """Out-of-fold residuals of the training records by weather, for which the mapper is fitted in each fold."""
        return self.records.residuals(self.model)

    @cached_property
    def residuals_of_long_blocks(self) -> BaselineResiduals:
        """Residuals out of blocks of a tenth of the records, whose means scatter as the means of other years do.

        Where moisture or soil makes residuals last, a regression learns much of a shorter block from its neighbours.
        """
        return self.records.residuals(self.model, least=len(self.records.inputs))

    @cached_property
    def service(self) -> ServiceRecords:
        """Gaps and outliers of the training records."""
        return self.gaps_and_outliers or self.service_of(None)

    def service_of(self, F: ArrayLike | None) -> ServiceRecords:
        """Gaps and outliers of the training records; a value is an outlier if its residual is far from its neighbours'.

        With their frequencies before cleaning, outliers are what cleaning has changed or removed.
        """
        records, frequencies = self.records, as_floats(self.records.frequencies)
        measured, outliers = frequencies, np.full(frequencies.shape, np.nan)
        if F is None:
            outliers[self.residuals.rows] = self.residuals.outliers
        else:
            measured = as_floats(F)
            if measured.shape != frequencies.shape:
                raise ValueError(
                    f"outliers has shape {measured.shape}; expected the frequencies that the chain was fitted on "
                    f"before they were cleaned, {frequencies.shape}, or 'fitted', or the share of outliers"
                )
            check_same_rows(records.frequencies, F, ("the frequencies of fit", "outliers"))
            expected = records.modelled * np.exp(self.model.discrepancy.at(records.inputs))
            outliers = np.where(~np.isnan(measured) & (measured != frequencies), measured / expected - 1, np.nan)
        order = np.argsort(row_times(records.temperatures), kind="stable")
        order = order[records.counted[order]]
        missing = np.isnan(np.hstack([as_floats(records.temperatures), measured]))
        return ServiceRecords(missing[order], outliers[order], records.inputs[order])

    def noise(
        self,
        weather: Weather,
        noise: ArrayLike | Literal["fitted"] = "fitted",
        gaps: float | Literal["fitted"] | None = None,
        outliers: ArrayLike | Literal["fitted"] | ServiceRecords | None = None,
        random_state: int | np.random.RandomState | None = None,
    ) -> Array:
        """Relative noise, (n_rows, n_modes), which is added to 1; NaN where a mode is missing."""
        check_faults(gaps, outliers)
        random, names = as_random_state(random_state), self.model.mode_names
        streams, shape = fault_streams(random), (len(weather), len(names))
        is_fitted = isinstance(noise, str)
        if is_fitted and noise != "fitted":
            raise ValueError(f'noise is {noise!r}; expected "fitted" or relative standard deviations')
        if is_fitted and gaps is None and outliers is not None:
            gaps = "fitted"  # of the records that the noise, which is completed for the outliers, is of
        missing = False if gaps is None else self.gaps(weather, gaps, outliers, random)[1]
        if is_fitted:
            order = np.argsort(row_times(weather.given), kind="stable")
            inputs, residuals = weather.inputs[order], self.residuals
            if gaps is None:
                values = residuals.draw(inputs, random)[np.argsort(order)]
            else:
                values = residuals.draw_complete(inputs, random, outliers is not None)[np.argsort(order)]
        else:
            values = check_noise(noise, len(names), names) * random.standard_normal(shape)
        if are_drawn(outliers):
            service, taken = self._taken(weather, outliers, streams[0])
            drawn = service.outliers[taken]
            values = np.where(np.isnan(drawn), values, drawn)
        elif outliers is not None:
            values = values * np.where(streams[2].uniform(size=shape) < outliers, 10.0, 1.0)
        return np.where(missing, np.nan, values)

    def gaps(
        self,
        weather: Weather,
        gaps: float | Literal["fitted"] | None = "fitted",
        outliers: ArrayLike | Literal["fitted"] | ServiceRecords | None = None,
        random_state: int | np.random.RandomState | None = None,
    ) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
        """Which temperatures, (n_rows, n_sensors), and frequencies, (n_rows, n_modes), are missing.

        `noise` leaves out the same modes if gaps, outliers and the seed, an integer, are the same. Sensors have gaps
        with "fitted" only.
        """
        if gaps is None:
            raise ValueError("gaps is None; expected 'fitted', or the share of the values that are missing")
        check_faults(gaps, outliers)
        streams = fault_streams(as_random_state(random_state))
        n_sensors, n_modes = np.shape(weather.filled)[1], len(self.model.mode_names)
        if are_drawn(gaps):
            service, taken = self._taken(weather, outliers, streams[0])
            return service.missing[taken, :n_sensors], service.missing[taken, n_sensors:]
        single = streams[1].uniform(size=(len(weather), n_modes)) < gaps
        return np.zeros((len(weather), n_sensors), dtype=bool), single

    def _taken(
        self, weather: Weather, outliers: Any, stream: np.random.RandomState
    ) -> tuple[ServiceRecords, NDArray[np.intp]]:
        """Gaps and outliers of the training records, and the position of the record that each row takes them from."""
        if isinstance(outliers, ServiceRecords):
            service = outliers
        else:
            service = self.service_of(outliers) if np.ndim(outliers) else self.service
        order = np.argsort(row_times(weather.given), kind="stable")
        return service, service.draw(weather.inputs[order], stream)[np.argsort(order)]


def fault_streams(random_state: np.random.RandomState) -> list[np.random.RandomState]:
    """Random states of the records drawn from, of gaps and of outliers, the same whatever noise is drawn."""
    return [np.random.RandomState(seed) for seed in deepcopy(random_state).randint(np.iinfo(np.int32).max, size=3)]


def are_drawn(faults: Any) -> bool:
    """Whether gaps or outliers come from records: they are "fitted", known ones, or a table of raw frequencies."""
    return isinstance(faults, str | ServiceRecords) or np.ndim(faults) > 0


def check_faults(gaps: Any, outliers: Any) -> None:
    """Raise an error for gaps or outliers that are neither None nor "fitted" nor a share, nor outliers of records."""
    are_records = isinstance(outliers, ServiceRecords) or np.ndim(outliers) > 0
    for what, value, other in (("gaps", gaps, ""), ("outliers", outliers, "the frequencies before cleaning, ")):
        is_fitted, is_share = isinstance(value, str) and value == "fitted", is_real(value) and 0 <= value < 1
        if not (value is None or is_fitted or is_share or (other and are_records)):
            raise ValueError(
                f"{what} is {value!r:.100}; expected 'fitted', the share of the values, such as 0.01, {other}or None"
            )
