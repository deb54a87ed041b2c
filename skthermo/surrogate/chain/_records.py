"""Records that a chain was fitted to, what M2 learned from them, and their residuals out of fold."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.pipeline import Pipeline

from skthermo._core.arrays import Array, as_columns, as_floats, median, refuse_no_table, robust_deviation, spread_evenly
from skthermo._core.estimators import _safe_indexing, last_step
from skthermo._core.frames import Table, column_names, frame_like, row_times
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.warnings import collected
from skthermo.exceptions import ModelWarning, RecordsWarning, SkthermoWarning
from skthermo.fem import FEModel, match_modes
from skthermo.preprocessing import BlockedKFold, RecordFindings, check_records
from skthermo.preprocessing.folds import out_of_fold
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.weather import misplaced_columns, unseen_weather
from skthermo.surrogate._regression import fit_checked
from skthermo.surrogate.chain._thermal import Discrepancy, ThermalModel, ratio_regressor

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

    def residuals(self, model: ThermalModel) -> BaselineResiduals:
        """Relative residuals of the records, each predicted by a mapper and a discrepancy of the other folds.

        A fold holds every fifth block of a week, or longer where residuals are correlated for longer.
        """
        measured = as_floats(self.frequencies)
        known = ~np.isnan(self.inputs).any(axis=1) & ~np.isnan(measured).all(axis=1) & self.counted
        order = np.argsort(row_times(self.temperatures), kind="stable")
        order = order[known[order]]
        inputs, theta, measured = self.inputs[order], self.targets[order], measured[order]
        weights = None if self.weights is None else self.weights[order]
        has_theta = ~np.isnan(theta).any(axis=1)
        if has_theta.sum() < 2 * N_FOLDS:
            least = 2 * N_FOLDS
            raise ValueError(f"{has_theta.sum()} records have parameters; expected at least {least} for residuals")
        own = measured / (self.modelled[order] * np.exp(model.discrepancy.at(inputs))) - 1
        records = _safe_indexing(self.temperatures, order)
        fold_of = remembering_folds(records, inputs, own)
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
            others = Discrepancy.fitted(model.discrepancy.regressor, inputs[rows], ratios[rows], own_weights)
            return lambda test: others.at(inputs[test])

        predicted = out_of_fold(learn_parameters, fold_of)
        modelled = model.frequencies(predicted)
        ratios = self.usable[order] / modelled
        values = measured / (modelled * np.exp(out_of_fold(learn_discrepancy, fold_of))) - 1
        known = ~np.isnan(values).all(axis=1)
        consequence = "Standard deviations, intervals and noise are unreliable there"
        doubts = tuple(unseen_weather(records, fold_of, consequence))
        return BaselineResiduals(inputs[known], values[known], own[known], fold_of[known], order[known], doubts)


def remembering_folds(records: Table, inputs: Array, own: Array) -> NDArray[np.intp]:
    """The fold of each record, in blocks of a week or of five correlation times of in-sample residuals."""
    known = ~np.isnan(own).all(axis=1)
    in_sample = BaselineResiduals(inputs[known], own[known], own[known], np.zeros(known.sum(), dtype=np.intp))
    return BlockedKFold(N_FOLDS).remembering(records, 5.0 * in_sample.correlation_time).fold_of(records)


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


class CheckedRecords(NamedTuple):
    """Records that a chain learns, without values that cannot be; ``usable`` frequencies are without outliers.

    ``findings`` is what `check_records` has found, and ``doubts`` hold warnings.
    """

    temperatures: Table
    frequencies: Table
    usable: Table
    findings: RecordFindings
    doubts: list[SkthermoWarning]


def checked_records(T: Table, F: Table, model: FEModel) -> CheckedRecords:
    """Check the records that a chain was given, once for all of its parts; outliers train nothing."""
    findings = check_records(T, F, model=model)
    findings.refuse_meaningless(needs_all=True)
    T, F = findings.temperatures, findings.frequencies
    doubts = [
        *findings.warnings(exclude={"frequency-outliers"}),
        *misplaced_columns(T, F),
        *doubts_of_modes(model, F),
    ]
    far, usable = findings.outliers.to_numpy(), F
    if far.any():
        usable = frame_like(F, np.where(far, np.nan, as_floats(F)), column_names(F, "f"))
    return CheckedRecords(T, F, usable, findings, doubts)


def mode_offsets(model: FEModel, F: Table) -> pd.Series:
    """Mean measured frequency against the model's nominal one, by mode, in percent."""
    nominal = as_floats(model.frequencies(np.ones((1, len(model.parameter_names)))))[0]
    return pd.Series(100 * (np.nanmean(as_floats(F), axis=0) / nominal - 1), index=column_names(F, "f"))


def doubts_of_modes(
    model: FEModel, F: Table, *, large: float = 15.0, small: float = 5.0, better: float = 0.25
) -> list[SkthermoWarning]:
    """Findings about the order and the units of the modes.

    Offsets above ``large`` percent are doubtful; a mode within ``small`` percent is not taken for another one. Modes
    count as swapped if another order reduces the squared offsets to a share of ``better``.
    """
    offsets = mode_offsets(model, F)
    ratios = 1 + offsets.to_numpy() / 100
    far = offsets[offsets.abs() > large]
    if len(ratios) > 1:
        table = match_modes(model, as_floats(F))
        unchanged = np.arange(len(offsets))
        near = offsets.abs().to_numpy() < small
        order = np.where(near, unchanged, table["mode"])
        best = np.where(near, offsets, table["offset"])
        moved = order != unchanged
        is_better = (best**2).sum() < better * (offsets**2).sum() and np.abs(best).max() < large
        if moved.any() and is_better and len(np.unique(order)) == len(order):
            return [
                ModelWarning(
                    f"the frequencies {offsets.index[moved].tolist()} look like other modes of the model. They would "
                    "be learned as those of their columns. Order them as the model does, or use "
                    f"model.with_modes({order.tolist()})",
                    "mode-order",
                )
            ]
    if not len(far):
        return []
    return [
        RecordsWarning(
            f"measured modes differ from the model's nominal frequencies by more than {large:g} %: "
            f"{', '.join(map(repr, far.index))} (see report_.modes). They may be other modes, or in another unit. Give "
            "Hz and the modes of the model in their order, or update the model",
            "mode-offsets",
        )
    ]


def measurement_noise(mapper: BaseEstimator, T: Table, F: Table, *, most: int = 3000) -> Array:
    """Relative standard deviations of frequencies about a regression on what an unfitted mapper sees of the weather.

    Out of fold, and by medians, so that outliers and rare weather hardly move them; (n_modes,). At most 0.1 counts as
    noise; ``most`` so many records, spread evenly, are looked at.
    """
    rows = spread_evenly(np.argsort(row_times(T), kind="stable"), most)
    logs, inputs = np.log(as_floats(F)), T
    if isinstance(mapper, Pipeline):
        with collected():
            inputs = clone(mapper[:-1]).fit_transform(T, np.where(np.isnan(logs), median(logs), logs))
    inputs, changes = as_floats(inputs)[rows], logs[rows] - median(logs)
    ratios, fold_of = np.exp(changes), np.zeros(len(rows), dtype=np.intp)
    if len(rows) >= N_FOLDS:
        fold_of = BlockedKFold(N_FOLDS).fold_of(_safe_indexing(T, rows))

    def learn(train: NDArray[np.intp]) -> Callable[[NDArray[np.intp]], Array]:
        learned = Discrepancy.fitted(ratio_regressor(), inputs[train], ratios[train])
        return lambda test: learned.at(inputs[test])

    return np.minimum(robust_deviation(changes - out_of_fold(learn, fold_of)), 0.1)
