"""Records: those that a chain was fitted to, their residuals, and those that monitoring would take."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Literal

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from scipy.spatial import cKDTree
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
    patterns,
    refuse_no_table,
    robust_deviation,
    spread_evenly,
)
from skthermo._core.estimators import fit_weighted, last_step, offers, predicted_covariance, reach_of
from skthermo._core.frames import Table, check_same_rows, column_names, frame_like, row_times
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import without_warnings
from skthermo.preprocessing import BlockedKFold, RecordFindings
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.folds import CORRELATION_TIMES, N_FOLDS
from skthermo.residuals.weather import warn_of_unseen_weather
from skthermo.surrogate.chain._stages import Discrepancy, Ratios, ThermalModel, Weather, ratio_regressor

MOST_NOISE = 0.1  # relative standard deviation of records, at most, that counts as noise
MOST_FOR_NOISE = 3000  # records, spread evenly, that the noise is estimated from


@dataclass(frozen=True, eq=False)
class TrainingRecords(SavesFrames):
    """Records that `DataInformedFEM.fit` was given, in their order, and what M2 learned from them.

    ``inputs`` are those of M2, lags included, ``targets`` the parameters that it learned, ``learned`` those that it
    gives for the inputs, ``usable`` the frequencies without outliers, ``modelled`` the FE model's frequencies at
    ``learned``, in the measured domain, ``weights`` those of the rows, or None, and ``parameter_names`` the columns of
    the targets.
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

    @property
    def ratios(self) -> Ratios:
        """Measured over modelled frequencies, which a discrepancy learns."""
        return Ratios(self.inputs, self.usable / self.modelled, self.weights)

    @property
    def folds(self) -> NDArray[np.intp]:
        """The fold of each row for what learns of the records, out of fold."""
        return BlockedKFold(N_FOLDS).fold_of(as_frame(self.temperatures))

    def resampled(
        self, residuals: BaselineResiduals, discrepancy: Discrepancy, random_state: np.random.RandomState
    ) -> TrainingRecords:
        """Records that this structure could have given as well in the same weather, before a mapper learns them.

        Each takes what a record of similar weather left unexplained, of its parameters and of its frequencies, in runs.
        """
        known = ~np.isnan(self.inputs).any(axis=1)
        order = np.argsort(row_times(self.temperatures), kind="stable")
        order = order[known[order]]
        taken, (values, ratios) = residuals.draw_records(self.inputs[order], random_state)
        targets, measured = np.full_like(self.targets, np.nan), np.full(np.shape(self.frequencies), np.nan)
        targets[order] = self.learned[order] * ratios
        expected = self.modelled[order] * np.exp(discrepancy.at(self.inputs[order]))
        measured[order] = expected * (1 + values)
        weights = None
        if self.weights is not None:
            weights = np.zeros(len(targets))
            weights[order] = self.weights[residuals.rows[taken]]
        return replace(
            self, frequencies=frame_like(self.frequencies, measured), usable=measured, targets=targets, weights=weights
        )

    def out_of_fold(self, model: ThermalModel) -> BaselineResiduals:
        """Relative residuals of the records, each predicted by a mapper and a discrepancy of the other folds.

        A fold holds every fifth of blocks of a week, or longer where residuals are correlated for longer.
        """
        measured = as_floats(self.frequencies)
        known = ~np.isnan(self.inputs).any(axis=1) & ~np.isnan(measured).all(axis=1) & self.counted
        order = np.argsort(row_times(self.temperatures), kind="stable")
        order = order[known[order]]
        inputs, theta, measured = self.inputs[order], self.targets[order], measured[order]
        usable = ~np.isnan(theta).any(axis=1)
        if usable.sum() < 2 * N_FOLDS:
            raise ValueError(f"{usable.sum()} records have parameters; expected at least {2 * N_FOLDS} for residuals")
        own = measured / (self.modelled[order] * np.exp(model.discrepancy.at(inputs))) - 1
        records, weights = as_frame(self.temperatures).iloc[order], self.ratios.weights_of(order)
        fold_of = _remembering_folds(records, inputs, own)
        learner, predicted, beyond = last_step(model.mapper), np.full_like(theta, np.nan), np.zeros(len(order))
        named, states = pd.DataFrame(theta, columns=list(self.parameter_names)), offers(learner, "predict_covariance")
        covariances = np.zeros((*theta.shape, theta.shape[1])) if states else None
        for fold in range(N_FOLDS):
            train, test = np.flatnonzero(usable & (fold_of != fold)), fold_of == fold
            weighted = named.iloc[train], None if weights is None else weights[train]
            fitted = fit_weighted(clone(learner), inputs[train], *weighted)
            predicted[test] = as_columns(fitted.predict(inputs[test]))
            if covariances is not None:
                covariances[test] = predicted_covariance(fitted, inputs[test])
                found = reach_of(fitted, inputs[test])
                beyond[test] = 0.0 if found is None else found[0].excess(found[1]).mean(axis=1)
        if not states:
            warn_of_unseen_weather(records, fold_of, "Standard deviations, intervals and noise are unreliable there")
        modelled = model.frequencies(predicted)
        expected, ratios = np.full_like(modelled, np.nan), self.usable[order] / modelled
        for fold in range(N_FOLDS):
            train, test = usable & (fold_of != fold), fold_of == fold
            # ratios to predictions that are out of fold themselves, so that the model is not solved for each fold
            others = Ratios(inputs, np.where(train[:, np.newaxis], ratios, np.nan), weights)
            expected[test] = modelled[test] * np.exp(model.discrepancy.relearned(others).at(inputs[test]))
        values = measured / expected - 1
        known = ~np.isnan(values).all(axis=1)
        residuals = BaselineResiduals(
            inputs[known], values[known], own[known], fold_of[known], order[known], (theta / predicted)[known]
        )
        if covariances is None:
            return residuals
        errors = np.sqrt(np.einsum("ijj->ij", model.propagated(predicted, covariances)))
        reach = (reach_of(learner, inputs) or (None,))[0]
        return replace(residuals, errors=errors[known], reach=reach, beyond=beyond[known])


def _remembering_folds(records: pd.DataFrame, inputs: Array, own: Array) -> NDArray[np.intp]:
    """The fold of each record, in blocks of a week or of five correlation times of in-sample residuals."""
    known = ~np.isnan(own).all(axis=1)
    in_sample = BaselineResiduals(inputs[known], own[known], own[known], np.zeros(known.sum(), dtype=np.intp))
    return BlockedKFold(N_FOLDS).remembering(records, CORRELATION_TIMES * in_sample.correlation_time).fold_of(records)


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


def without_outliers(findings: RecordFindings, F: Table) -> Table:
    """Frequencies without the outliers among them; findings may be of longer tables, of which these are rows."""
    far = findings.outliers
    if isinstance(F, pd.DataFrame) and far.index.is_unique:
        far = far.reindex(index=F.index, columns=F.columns, fill_value=False)
    if far.shape != F.shape or not far.to_numpy().any():
        return F
    return frame_like(F, np.where(far, np.nan, as_floats(F)), column_names(F, "f"))


def measurement_noise(mapper: BaseEstimator, T: Table, F: Table) -> Array:
    """Relative standard deviations of frequencies about a regression on what an unfitted mapper sees of the weather.

    Out of fold, and by medians, so that outliers and rare weather hardly move them; (n_modes,).
    """
    rows = spread_evenly(np.argsort(row_times(T), kind="stable"), MOST_FOR_NOISE)
    logs, inputs = np.log(as_floats(F)), T
    if isinstance(mapper, Pipeline):
        with without_warnings():
            inputs = clone(mapper[:-1]).fit_transform(T, np.where(np.isnan(logs), median(logs), logs))
    inputs, residuals = as_floats(inputs)[rows], logs[rows] - median(logs)
    ratios = Ratios(inputs, np.exp(residuals))
    folds = BlockedKFold(N_FOLDS).fold_of(as_frame(T).iloc[rows]) if len(rows) >= N_FOLDS else np.zeros(len(rows))
    known = ~np.isnan(inputs).any(axis=1)
    for modes, of_modes in ratios.groups():
        for fold in range(N_FOLDS):
            learned = ratios.learned(ratio_regressor(), modes, of_modes[folds[of_modes] != fold])
            test = np.flatnonzero((folds == fold) & known)
            if learned is not None and len(test):
                residuals[np.ix_(test, modes)] -= learned.logs(inputs[test])
    return np.minimum(robust_deviation(residuals), MOST_NOISE)


def as_frame(table: Table) -> pd.DataFrame:
    """A frame of records, whose index holds the times."""
    return table if isinstance(table, pd.DataFrame) else pd.DataFrame(as_floats(table), copy=False)


MEAN_LENGTH = 25  # of runs of consecutive training records, before records of similar weather take over
TAKEN_FROM = 25  # number of records with the most similar weather, and the same faults, that take over
FEW = 10_000  # records at a joint, up to which computing all distances is about as fast as searching a tree
TIMES_WIDER = 10.0  # noise of an outlier over that of other values, where the share of outliers is given
LARGEST_SEED = np.iinfo(np.int32).max


@dataclass(frozen=True, eq=False)
class ServiceRecords:
    """Gaps and outliers of training records in order of time, as `RecordSimulator.service_of` gives them.

    ``missing`` temperatures and frequencies, (n_records, n_sensors + n_modes); relative residuals of ``outliers``,
    (n_records, n_modes), NaN where a value is none; ``places``, (n_records, n_coordinates), near for similar weather.
    """

    missing: NDArray[np.bool_]
    outliers: Array
    places: Array

    @classmethod
    def of(cls, records: TrainingRecords, residuals: BaselineResiduals) -> ServiceRecords:
        """Learn from training records; a value is an outlier if its residual is far from those of its neighbours."""
        outliers = np.full(np.shape(records.frequencies), np.nan)
        outliers[residuals.rows] = residuals.outliers
        return cls._in_order(records, residuals, as_floats(records.frequencies), outliers)

    @classmethod
    def of_raw(
        cls, records: TrainingRecords, residuals: BaselineResiduals, raw: ArrayLike, predicted: Array
    ) -> ServiceRecords:
        """Learn from raw frequencies of the training records: what cleaning has changed or removed is an outlier."""
        measured = as_floats(raw)
        if measured.shape != np.shape(records.frequencies):
            raise ValueError(
                f"outliers has shape {measured.shape}; expected the frequencies that the chain was fitted on before "
                f"they were cleaned, {np.shape(records.frequencies)}, or 'fitted', or the share of outliers"
            )
        check_same_rows(records.frequencies, raw, ("the frequencies of fit", "outliers"))
        is_outlier = ~np.isnan(measured) & (measured != as_floats(records.frequencies))
        outliers = np.where(is_outlier, measured / predicted - 1, np.nan)
        return cls._in_order(records, residuals, measured, outliers)

    @classmethod
    def _in_order(
        cls, records: TrainingRecords, residuals: BaselineResiduals, measured: Array, outliers: Array
    ) -> ServiceRecords:
        order = np.argsort(row_times(records.temperatures), kind="stable")
        order = order[records.counted[order]]
        missing = np.isnan(np.hstack([as_floats(records.temperatures), measured]))
        places = pd.DataFrame(places_of(residuals, records.inputs[order])).ffill().bfill()
        return cls(missing[order], outliers[order], places.to_numpy())

    @property
    def has_faults(self) -> bool:
        """Whether there is a gap or an outlier."""
        return bool(self.missing.any() or not np.isnan(self.outliers).all())

    def draw(self, places: Array, random_state: np.random.RandomState) -> NDArray[np.intp]:
        """Positions of the records whose faults rows of weather in order of time have, (n_rows,).

        A row takes the record after the one that the row before it took, so that faults last as long as in training.
        Now and then, a record with the same faults and similar weather takes over before: where a run of faults
        begins, or in records with the most usual faults, which are mostly none. All records are taken equally often.
        """
        n_records, n_rows = len(self.places), len(places)
        if not self.has_faults:
            return np.zeros(n_rows, dtype=np.intp)  # all records are alike
        passes = random_state.uniform(size=n_rows) < 1 / MEAN_LENGTH
        which = random_state.uniform(size=n_rows)
        taken = np.empty(n_rows, dtype=np.intp)
        trees = {joint: cKDTree(self.places[rows]) for joint, rows in self._joints.items() if len(rows) > FEW}
        record = self._similar(0, places[0], which[0], trees) if n_rows else 0
        for row in range(n_rows):
            if row:
                if passes[row] and self._joint_of[record]:
                    record = self._similar(self._joint_of[record], places[row - 1], which[row], trees)
                record = (record + 1) % n_records
            taken[row] = record
        return taken

    def resampled(self, random_state: np.random.RandomState) -> ServiceRecords:
        """Gaps and outliers that the training records could have had as well, in their own weather."""
        taken = self.draw(self.places, random_state)
        return replace(self, missing=self.missing[taken], outliers=self.outliers[taken])

    def drawn_outliers(self, taken: NDArray[np.intp], random_state: np.random.RandomState) -> Array:
        """Outliers of the records that rows took, (n_rows, n_modes), NaN where a value is none; sizes are smoothed
        run by run, with the bandwidth of Silverman's rule on logarithms."""
        drawn, logs = self.outliers[taken], np.log(np.abs(self.outliers))
        n_runs = _begins(self.outliers).sum()
        if n_runs < 2:
            return drawn
        mean, deviation, bandwidth = np.nanmean(logs), np.nanstd(logs), (4 / (3 * n_runs)) ** 0.2
        run = np.cumsum(_begins(drawn), axis=0)
        normal = np.take_along_axis(random_state.standard_normal((run.max() + 1, run.shape[1])), run, axis=0)
        smoothed = (np.log(np.abs(drawn)) - mean + bandwidth * deviation * normal) / np.hypot(1, bandwidth)
        return np.sign(drawn) * np.exp(mean + smoothed)

    def _similar(self, joint: int, place: Array, share: float, trees: Mapping[int, cKDTree]) -> int:
        """One of the records at a joint whose weather is most similar, or any where it is unknown."""
        rows = self._joints[joint]
        if len(rows) > TAKEN_FROM and not np.isnan(place).any():
            if joint in trees:
                near = trees[joint].query(place, TAKEN_FROM)[1]
            else:
                distances = ((self.places[rows] - place) ** 2).sum(axis=1)
                near = np.argpartition(distances, TAKEN_FROM)[:TAKEN_FROM]
            rows = rows[near]
        return int(rows[int(share * len(rows))])

    @cached_property
    def _joint_of(self) -> NDArray[np.intp]:
        """From 1 on, the number of the faults of records at which others may take over; 0 for the rest."""
        of_row = patterns(np.hstack([self.missing, ~np.isnan(self.outliers)]))[1]
        begins = np.diff(of_row, prepend=of_row[-1:]) != 0
        return np.where(begins | (of_row == np.bincount(of_row).argmax()), of_row + 1, 0)

    @cached_property
    def _joints(self) -> dict[int, NDArray[np.intp]]:
        """Records by these numbers, and all of them for 0."""
        order = np.argsort(self._joint_of, kind="stable")
        joints, first = np.unique(self._joint_of[order], return_index=True)
        found = dict(zip(joints.tolist(), np.split(order, first[1:]), strict=True))
        return found | {0: np.arange(len(self.places))}


def _begins(outliers: Array) -> NDArray[np.bool_]:
    """Where a run of outliers of a mode begins."""
    is_outlier = ~np.isnan(outliers)
    return is_outlier & ~np.vstack([np.zeros((1, outliers.shape[1]), dtype=bool), is_outlier[:-1]])


def places_of(residuals: BaselineResiduals, weather: Array) -> Array:
    """Coordinates of weather; NaN where it is unknown."""
    known = ~np.isnan(weather).any(axis=1)
    places = np.full((len(weather), residuals.places.shape[1]), np.nan)
    if known.any():
        places[known] = residuals.coordinates.transform(weather[known])
    return places


@dataclass(frozen=True, eq=False)
class RecordSimulator(SavesFrames):
    """Draws what monitoring adds to the frequencies of a thermal model, as its training records show it.

    ``gaps_and_outliers`` are those of other records, where these have been drawn themselves. Arguments ``noise``,
    ``gaps``, ``outliers`` and ``random_state`` are those of `DataInformedFEM.simulate`, weather comes from
    `DataInformedFEM.weather`.
    """

    model: ThermalModel
    records: TrainingRecords
    gaps_and_outliers: ServiceRecords | None = None

    @cached_property
    def residuals(self) -> BaselineResiduals:
        """Out-of-fold residuals of the training records by weather, for which the mapper is fitted in each fold."""
        return self.records.out_of_fold(self.model)

    @cached_property
    def service(self) -> ServiceRecords:
        """Gaps and outliers of the training records."""
        return self.gaps_and_outliers or ServiceRecords.of(self.records, self.residuals)

    def service_of(self, F: ArrayLike | None = None) -> ServiceRecords:
        """Gaps and outliers of the training records.

        With their frequencies before cleaning, outliers are what cleaning has changed or removed.
        """
        if F is None:
            return self.service
        expected = self.records.modelled * np.exp(self.model.discrepancy.at(self.records.inputs))
        return ServiceRecords.of_raw(self.records, self.residuals, F, expected)

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
        if not is_fitted:
            values = check_noise(noise, len(names), names) * random.standard_normal(shape)
        else:
            order = np.argsort(row_times(weather.given), kind="stable")
            inputs, residuals = weather.inputs[order], self.residuals
            if gaps is None and outliers is None:
                values = residuals.draw(inputs, random)[np.argsort(order)]
            else:
                values = residuals.draw_complete(inputs, random, outliers is not None)[np.argsort(order)]
            if gaps is None and outliers is not None:
                gaps = "fitted"  # of the records that the noise, which was completed for the outliers, is of
        if are_drawn(gaps) or are_drawn(outliers):
            service, taken = self._taken(weather, outliers, streams[0])
        if are_drawn(outliers):
            drawn = service.drawn_outliers(taken, streams[2])
            values = np.where(np.isnan(drawn), values, drawn)
        elif outliers is not None:
            values = values * np.where(streams[2].uniform(size=shape) < outliers, TIMES_WIDER, 1.0)
        if are_drawn(gaps):
            return np.where(service.missing[taken, -len(names) :], np.nan, values)
        return values if gaps is None else np.where(streams[1].uniform(size=shape) < gaps, np.nan, values)

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
        if np.ndim(outliers):
            self.service_of(outliers)  # which refuses what is not of the training records
        single = streams[1].uniform(size=(len(weather), n_modes)) < gaps
        return np.zeros((len(weather), n_sensors), dtype=bool), single

    def _taken(
        self, weather: Weather, outliers: Any, stream: np.random.RandomState
    ) -> tuple[ServiceRecords, NDArray[np.intp]]:
        """Gaps and outliers of the training records, and those of which records the rows have."""
        if isinstance(outliers, ServiceRecords):
            service = outliers
        else:
            service = self.service_of(outliers if np.ndim(outliers) else None)
        order = np.argsort(row_times(weather.given), kind="stable")
        taken = service.draw(places_of(self.residuals, weather.inputs[order]), stream)
        return service, taken[np.argsort(order)]


def fault_streams(random_state: np.random.RandomState) -> list[np.random.RandomState]:
    """Random states of the records drawn from, of gaps and of outliers, the same whatever noise is drawn."""
    return [np.random.RandomState(seed) for seed in deepcopy(random_state).randint(LARGEST_SEED, size=3)]


def are_drawn(faults: Any) -> bool:
    """Whether gaps or outliers come from records: they are "fitted", known ones, or a table of raw frequencies."""
    return isinstance(faults, str | ServiceRecords) or np.ndim(faults) > 0


def check_faults(gaps: Any, outliers: Any) -> None:
    """Raise an error for gaps or outliers that are neither None nor "fitted" nor a share, nor outliers of records."""
    expected = {
        "gaps": "'fitted', the share of the values that are missing, such as 0.1, or None",
        "outliers": "'fitted', the share of the values that are outliers, such as 0.01, the frequencies that the chain "
        "was fitted on before they were cleaned, or None",
    }
    for what, value in (("gaps", gaps), ("outliers", outliers)):
        is_of_records = what == "outliers" and not isinstance(value, str) and are_drawn(value)
        is_share = is_real(value) and 0 <= value < 1
        is_fitted = isinstance(value, str) and value == "fitted"
        if not (value is None or is_of_records or is_share or is_fitted):
            raise ValueError(f"{what} is {value!r:.100}; expected {expected[what]}")
