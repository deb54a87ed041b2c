"""The records that a chain was fitted to, and its residuals out of fold."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.model_selection import BaseCrossValidator
from sklearn.pipeline import Pipeline

from skthermo._estimators.regressors import fit_weighted, offers, predicted_covariance, reach_of
from skthermo._estimators.warnings import without_warnings
from skthermo._tables.arrays import Array, as_columns, as_floats, median, robust_deviation, spread_evenly
from skthermo._tables.frames import check_columns, column_names, frame_like
from skthermo._tables.saved_frames import SavesFrames
from skthermo._tables.times import row_times
from skthermo._validation import last_step
from skthermo.fem import FEModel
from skthermo.preprocessing import BlockedKFold, RecordFindings
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.folds import CORRELATION_TIMES, N_FOLDS
from skthermo.residuals.weather import SensorRegression, warn_of_unseen
from skthermo.surrogate.chain._discrepancy import Discrepancy, ratio_regressor, ratios_of

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

    temperatures: Any
    frequencies: Any
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
    def ratios(self) -> Array:
        """Measured over modelled frequencies, which a discrepancy learns, (n_rows, n_modes)."""
        return self.usable / self.modelled

    def learns(self, regressor: Any, mapper: Any, sensors: SensorRegression) -> Discrepancy:
        """The discrepancy that a regressor learns of these records, beside a fitted mapper."""
        folds = BlockedKFold(N_FOLDS).fold_of(as_frame(self.temperatures))
        chain = {"mapper": mapper, "sensors": sensors}
        return Discrepancy.of(regressor, self.inputs, self.ratios, self.weights, folds, **chain)

    def resampled(
        self, residuals: BaselineResiduals, discrepancy: Discrepancy, random_state: np.random.RandomState
    ) -> "TrainingRecords":
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
            self,
            frequencies=frame_like(self.frequencies, measured),
            usable=measured,
            targets=targets,
            weights=weights,
        )

    def out_of_fold(
        self,
        mapper: Any,
        frequencies_of: Callable[[Array], Array],
        discrepancy: Discrepancy,
        folds: BaseCrossValidator | None = None,
        propagated: Callable[[Array, Array], Array] | None = None,
    ) -> BaselineResiduals:
        """Relative residuals of the records, each predicted by a mapper and a discrepancy of the other folds.

        Given are the fitted mapper, the function from parameters to frequencies in the measured domain, the discrepancy
        and, for a mapper that states its errors, the function from parameters and their covariances to covariances of
        ln f. By default, a fold holds every fifth of blocks of a week, or longer if
        the residuals remember for longer.
        """
        order = np.argsort(row_times(self.temperatures), kind="stable")
        measured = as_floats(self.frequencies)
        known = ~np.isnan(self.inputs).any(axis=1) & ~np.isnan(measured).all(axis=1) & self.counted
        order = order[known[order]]
        inputs, theta, measured = self.inputs[order], self.targets[order], measured[order]
        usable = ~np.isnan(theta).any(axis=1)
        if usable.sum() < 2 * N_FOLDS:
            raise ValueError(f"{usable.sum()} records have parameters; expected at least {2 * N_FOLDS} for residuals")
        own = measured / (self.modelled[order] * np.exp(discrepancy.at(inputs))) - 1
        records = as_frame(self.temperatures).iloc[order]
        if folds is None:
            known = ~np.isnan(own).all(axis=1)
            in_sample = BaselineResiduals(inputs[known], own[known], own[known], np.zeros(known.sum(), dtype=np.intp))
            folds = BlockedKFold(N_FOLDS).remembering(records, CORRELATION_TIMES * in_sample.correlation_time)
        learner, predicted, fold_of = last_step(mapper), np.full_like(theta, np.nan), np.zeros(len(order), dtype=int)
        named, states = pd.DataFrame(theta, columns=list(self.parameter_names)), offers(mapper, "predict_covariance")
        covariances, beyond = np.zeros((*theta.shape, theta.shape[1])) if states else None, np.zeros(len(order))
        for fold, (train, test) in enumerate(folds.split(records)):
            train = train[usable[train]]
            weights = None if self.weights is None else self.weights[order][train]
            fitted = fit_weighted(clone(learner), inputs[train], named.iloc[train], weights)
            predicted[test], fold_of[test] = as_columns(fitted.predict(inputs[test])), fold
            if covariances is not None:
                covariances[test] = predicted_covariance(fitted, inputs[test])
                found = reach_of(fitted, inputs[test])
                beyond[test] = 0.0 if found is None else found[0].excess(found[1]).mean(axis=1)
        if not states:
            warn_of_unseen(records, fold_of, "standard deviations, intervals and noise are guesses there")
        modelled = frequencies_of(predicted)
        expected = np.full_like(modelled, np.nan)
        for fold in range(fold_of.max() + 1):
            train, test = usable & (fold_of != fold), fold_of == fold
            weights = None if self.weights is None else self.weights[order]
            # ratios to predictions that are out of fold themselves, so that the model is not solved for each fold
            learned = discrepancy.relearned(inputs, self.usable[order] / modelled, weights, train)
            expected[test] = modelled[test] * np.exp(learned.at(inputs[test]))
        values = measured / expected - 1
        known = ~np.isnan(values).all(axis=1)
        residuals = BaselineResiduals(
            inputs[known], values[known], own[known], fold_of[known], order[known], (theta / predicted)[known]
        )
        if covariances is None or propagated is None:
            return residuals
        errors = np.sqrt(np.einsum("ijj->ij", propagated(predicted, covariances)))
        reach = (reach_of(learner, inputs) or (None,))[0]
        return replace(residuals, errors=errors[known], reach=reach, beyond=beyond[known])


def check_frequencies(F: Any, model: FEModel) -> None:
    """Raise an error unless there is a column for each mode of a model, and all values are positive or NaN."""
    if F.shape[1] != model.n_modes:
        raise ValueError(f"frequencies have {F.shape[1]} columns; expected the {model.n_modes} modes of {model!r}")
    values = as_floats(F)
    wrong = ~np.isnan(values) & ~(values > 0)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise ValueError(
            f"frequency {column_names(F, 'f')[column]!r} in row {row} is {values[row, column]:g}; expected positive "
            "numbers in Hz, and NaN where a mode is missing"
        )
    check_columns(F, "frequency")


def without_outliers(findings: RecordFindings, F: Any) -> Any:
    """Frequencies without the outliers among them; findings may be of longer tables, of which these are rows."""
    far = findings.outliers
    if isinstance(F, pd.DataFrame) and far.index.is_unique:
        far = far.reindex(index=F.index, columns=F.columns, fill_value=False)
    if far.shape != F.shape or not far.to_numpy().any():
        return F
    return frame_like(F, np.where(far, np.nan, as_floats(F)), column_names(F, "f"))


def measurement_noise(mapper: Any, T: Any, F: Any) -> Array:
    """Relative standard deviations of frequencies about a regression on what an unfitted mapper sees of the weather.

    Out of fold, and by medians, so that outliers and rare weather hardly move them; (n_modes,).
    """
    rows = spread_evenly(np.argsort(row_times(T), kind="stable"), MOST_FOR_NOISE)
    logs, inputs = np.log(as_floats(F)), T
    if isinstance(mapper, Pipeline):
        with without_warnings():
            inputs = clone(mapper[:-1]).fit_transform(T, np.where(np.isnan(logs), median(logs), logs))
    inputs, residuals = as_floats(inputs)[rows], logs[rows] - median(logs)
    measured, records = np.exp(residuals), as_frame(T).iloc[rows]
    folds = BlockedKFold(N_FOLDS).fold_of(records) if len(rows) >= N_FOLDS else np.zeros(len(rows))
    known = ~np.isnan(inputs).any(axis=1)
    for one in ratios_of(ratio_regressor(), inputs, measured, None):
        for fold in range(N_FOLDS):
            learned = one.refitted(ratio_regressor(), inputs, measured, None, one.rows[folds[one.rows] != fold])
            test = np.flatnonzero((folds == fold) & known)
            if learned.regressor is not None and len(test):
                residuals[np.ix_(test, one.modes)] -= learned.logs(inputs[test])
    return np.minimum(robust_deviation(residuals), MOST_NOISE)


def as_frame(table: Any) -> pd.DataFrame:
    """A frame of records, of which the index tells the times."""
    return table if isinstance(table, pd.DataFrame) else pd.DataFrame(as_floats(table), copy=False)
