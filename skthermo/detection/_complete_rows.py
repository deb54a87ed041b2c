"""Regression on records with missing values."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
import scipy.sparse
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, RegressorMixin, clone
from sklearn.compose import ColumnTransformer, TransformedTargetRegressor
from sklearn.model_selection import cross_val_predict
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.utils import get_tags

from skthermo._estimators.warnings import explain_rows, explained_rows, reported_by_caller, without_warnings
from skthermo._tables.arrays import as_columns, as_floats, is_model
from skthermo._tables.frames import column_names
from skthermo._validation import (
    BaseSearchCV,
    _BaseImputer,
    fit_outputs,
    last_step,
    offers,
    predicted_covariance,
    reach_of,
    rows_from_fleet,
)
from skthermo.preprocessing import RecordFindings
from skthermo.residuals.folds import Folds
from skthermo.residuals.weather import PredictionError, TrainingRange

REPORTED = (
    "filled-temperatures",
    "implausible-temperatures",
    "not-predicted",
    "outside-training-weather",
    "sensor-disagrees",
    "rows-from-fleet",
)  # kinds of warnings that the compensator gives


@dataclass(frozen=True)
class Regression:
    """A fitted estimator, of which the first transformers got all rows and the rest those that it accepts.

    One that offers ``predict_covariance`` states the errors of its predictions.
    """

    estimator: BaseEstimator
    head: Pipeline | None
    rest: CompleteRowsRegressor

    @property
    def states_errors(self) -> bool:
        """Whether the estimator says how uncertain its predictions are."""
        return offers(self.rest.regressor_, "predict_covariance")

    @classmethod
    def of(cls, estimator: BaseEstimator, X: Any, y: Any, findings: RecordFindings) -> Regression:
        """Fit a clone to records in which something was found."""
        head, rest = split_pipeline(estimator)
        head = None if head is None else clone(head)
        fitted = CompleteRowsRegressor(rest, findings).fit(X if head is None else head.fit_transform(X), y)
        whole = fitted.regressor_ if head is None else joined(estimator, head, fitted.regressor_)
        return cls(whole, head, fitted)

    def predict(self, X: Any) -> NDArray[np.float64]:
        """Predictions, NaN for rows that the estimator does not accept."""
        inputs = self._inputs(X)
        return explain_rows(self.rest.predict(inputs), explained_rows(inputs))

    def errors(self, X: Any) -> PredictionError:
        """Errors of the predictions as the estimator states them; none where it does not."""
        if not self.states_errors:
            return PredictionError.none()
        with without_warnings():  # which predictions have given, here and below
            return PredictionError.of_rows(self.rest.predict_covariance(self._inputs(X)))

    def out_of_fold(self, X: Any, y: Any, folds: Folds) -> tuple[Any, PredictionError]:
        """Predictions by clones of the rest that are fitted on other rows, and their errors.

        The first transformers know all rows.
        """
        partition = [*folds.splits, (folds.untested, folds.untested)] if folds.untested.size else folds.splits
        learner, n_targets = clone(self.rest).set_params(states_errors=self.states_errors), y.shape[1]
        # With metadata routing, scikit-learn 1.6 fails where params are None.
        found = cross_val_predict(learner, self._inputs(X), y, cv=partition, params={})
        predicted, covariances = found[:, :n_targets], found[:, n_targets:]
        predicted[folds.untested] = np.nan
        if not self.states_errors:
            return predicted, self.errors(X)
        return predicted, PredictionError.of_rows(covariances.reshape(-1, n_targets, n_targets))

    def predict_apart(self, X: Any, y: Any, apart: NDArray[np.bool_]) -> NDArray[np.float64]:
        """Predictions of some rows by a clone of the rest that is fitted on all others."""
        inputs = self._inputs(X)
        with without_warnings():  # which the fit on all rows has given
            return clone(self.rest).fit(inputs[~apart], y[~apart]).predict(inputs[apart])

    def reach(self, X: Any) -> tuple[TrainingRange, Any] | None:
        """The weather that the estimator was fitted in, and X as its last step sees it; None without ``reach_``."""
        if not offers(self.rest.regressor_, "reach_"):
            return None
        with without_warnings():
            return reach_of(self.rest.regressor_, self._inputs(X))

    def from_fleet(self, X: Any) -> NDArray[np.bool_]:
        """Rows in weather that only a fleet has shown."""
        if not offers(self.rest.regressor_, "from_fleet"):
            return np.zeros(len(X), dtype=bool)
        with without_warnings():
            return self.rest.from_fleet(self._inputs(X))

    def _inputs(self, X: Any) -> Any:
        return X if self.head is None else self.head.transform(X)


class CompleteRowsRegressor(RegressorMixin, BaseEstimator):
    """Fits and predicts with the rows that a regressor accepts; the prediction of other rows is NaN.

    The compensator has checked the records with some findings, and warns of what it hands on. With
    ``states_errors``, the covariance of each row's prediction follows in the columns behind it.
    """

    def __init__(self, estimator: BaseEstimator, findings: RecordFindings, states_errors: bool = False):
        self.estimator = estimator
        self.findings = findings
        self.states_errors = states_errors

    def fit(self, X: Any, y: Any) -> CompleteRowsRegressor:
        with reported_by_caller(REPORTED, self.findings):  # also in a worker process
            return self._fit(X, y)

    def predict(self, X: Any) -> NDArray[np.float64]:
        with reported_by_caller(REPORTED):
            predicted = self._predict(X)
        if not self.states_errors:
            return predicted
        return np.hstack([predicted, self.predict_covariance(X).reshape(len(predicted), -1)])

    def predict_covariance(self, X: Any) -> NDArray[np.float64]:
        usable = self._predictable(X)
        covariances = np.full((X.shape[0], self.n_targets_, self.n_targets_), np.nan)
        if usable.any():
            with reported_by_caller(REPORTED):
                covariances[usable] = predicted_covariance(self.regressor_, X[usable])
        return covariances

    def from_fleet(self, X: Any) -> NDArray[np.bool_]:
        rows = self._predictable(X)
        if rows.any():
            rows[rows] = rows_from_fleet(self.regressor_, X[rows])
        return rows

    def _fit(self, X: Any, y: Any) -> CompleteRowsRegressor:
        self.takes_nan_ = takes_nan(self.estimator)
        self.n_targets_ = y.shape[1]
        usable, present = self._predictable(X), ~np.isnan(as_floats(y))
        if takes_missing_targets(self.estimator):
            present[:] = True
        in_use = usable[:, np.newaxis] & present
        if not in_use.any(axis=0).all():
            wanted = "that target" if self.takes_nan_ else "that target and every other column"
            target = column_names(y, "target ")[in_use.any(axis=0).argmin()]
            raise ValueError(
                f"{target!r} has none of {len(y)} rows to learn from, of all or in a fold; expected rows with {wanted} "
                f"for {type(self.estimator).__name__}"
            )
        if (in_use == usable[:, np.newaxis]).all():
            self.regressor_ = fit_outputs(self.estimator, X[usable], as_target(self.estimator, y[usable]))
        else:
            self.regressor_ = MultiOutputRegressor(self.estimator)
            # Named, so that a regressor may know which target it learns.
            targets = [column for _, column in y.items()] if isinstance(y, pd.DataFrame) else as_floats(y).T
            self.regressor_.estimators_ = [
                clone(self.estimator).fit(X[rows], target[rows]) for rows, target in zip(in_use.T, targets, strict=True)
            ]
        return self

    def _predict(self, X: Any) -> NDArray[np.float64]:
        usable = self._predictable(X)
        predicted = np.full((X.shape[0], self.n_targets_), np.nan)
        if usable.any():
            values = as_columns(self.regressor_.predict(X[usable]))
            expected = (int(usable.sum()), self.n_targets_)
            if values.shape != expected:
                raise ValueError(
                    f"{type(self.regressor_).__name__} predicted the shape {values.shape}; expected {expected}, a "
                    "column for each target"
                )
            predicted[usable] = values
        return predicted

    def _predictable(self, inputs: Any) -> NDArray[np.bool_]:
        if self.takes_nan_ or scipy.sparse.issparse(inputs):
            return np.ones(inputs.shape[0], dtype=bool)
        return ~np.isnan(as_floats(inputs)).any(axis=1)


def split_pipeline(estimator: BaseEstimator) -> tuple[Pipeline | None, BaseEstimator]:
    """The first transformers of a pipeline, as far as they accept NaN and learn without y, and what follows them."""
    if not isinstance(estimator, Pipeline):
        return None, estimator
    steps = [step for _, step in estimator.steps]
    n_head = next(
        (i for i, step in enumerate(steps[:-1]) if not takes_nan(step) or learns_from_y(step)), len(steps) - 1
    )
    if not n_head:
        return None, estimator
    return estimator[:n_head], steps[-1] if n_head == len(steps) - 1 else estimator[n_head:]


def has_lags_behind(estimator: BaseEstimator) -> bool:
    """Whether lags or means stand behind the first transformers, where they see the rows of their folds only."""
    parts = split_pipeline(estimator)[1].get_params(deep=True).values()
    return any(hasattr(type(part), "lookback_") for part in parts)


def joined(pipeline: Pipeline, head: Pipeline, rest: BaseEstimator) -> Pipeline:
    """A fitted pipeline of its fitted parts."""
    tail = rest.steps if isinstance(rest, Pipeline) else [(pipeline.steps[-1][0], rest)]
    return Pipeline([*head.steps, *tail], memory=pipeline.memory, verbose=pipeline.verbose)


def as_target(estimator: BaseEstimator, y: Any) -> Any:
    """The targets as the regressor takes them: a single one as a vector, unless it always takes columns."""
    if y.shape[1] > 1 or not get_tags(last_step(estimator)).target_tags.single_output:
        return y
    return y.squeeze(axis=1)


def takes_nan(estimator: BaseEstimator) -> bool:
    """Whether an estimator accepts NaN in X, also inside a wrapper, of which scikit-learn's tag does not say so."""
    if estimator is None or isinstance(estimator, str):  # "passthrough" or "drop"
        return True
    if isinstance(estimator, Pipeline):
        steps = [step for _, step in estimator.steps]
        imputer = next((i for i, step in enumerate(steps) if isinstance(step, _BaseImputer)), len(steps))
        return all(takes_nan(step) for step in steps[: imputer + 1])
    if isinstance(estimator, ColumnTransformer | FeatureUnion):
        parts = estimator.transformers if isinstance(estimator, ColumnTransformer) else estimator.transformer_list
        return all(takes_nan(part) for _, part, *_ in parts)
    if isinstance(estimator, MultiOutputRegressor | BaseSearchCV):
        return takes_nan(estimator.estimator)
    if isinstance(estimator, TransformedTargetRegressor) and estimator.regressor is not None:
        return takes_nan(estimator.regressor)
    return get_tags(estimator).input_tags.allow_nan


def learns_from_y(transformer: BaseEstimator | str | None) -> bool:
    """Whether a transformer may need the targets, which are not known in every row."""
    if transformer is None or isinstance(transformer, str):
        return False
    return get_tags(transformer).target_tags.required or hasattr(transformer, "estimator")


def takes_missing_targets(estimator: BaseEstimator) -> bool:
    """Whether an estimator accepts NaN in y: one with an FE model leaves out incomplete rows itself, after its lags."""
    return is_model(getattr(last_step(estimator), "model", None))
