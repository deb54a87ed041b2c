"""A regression of targets on inputs, with gaps in both: fitted to the rows that it can take, predicted out of fold."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from numbers import Integral
from typing import Any

import numpy as np
import scipy.sparse
from numpy.typing import NDArray
from sklearn.base import BaseEstimator, clone
from sklearn.compose import ColumnTransformer, TransformedTargetRegressor
from sklearn.model_selection import check_cv
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import FeatureUnion, Pipeline
from sklearn.utils import get_tags

from skthermo._core.arrays import Array, as_floats
from skthermo._core.estimators import BaseSearchCV, _BaseImputer, fit_checked, fit_outputs, last_step, predict_with_std
from skthermo._core.frames import column_names
from skthermo.preprocessing.folds import Rows, out_of_fold


@dataclass(frozen=True)
class RowsRegression:
    """A fitted regressor behind transformers that see all rows; it predicts NaN for rows that it cannot take."""

    head: Pipeline | None
    regressor: BaseEstimator
    takes_gaps: bool
    n_targets: int

    @classmethod
    def fitted(cls, estimator: BaseEstimator, T: Any, F: Any) -> RowsRegression:
        """Fit clones of an estimator's first transformers to all rows, and of the rest to complete ones."""
        head, rest = split_pipeline(estimator)
        head = None if head is None else clone(head)
        inputs = T if head is None else head.fit_transform(T)
        return cls(head, fit_rows(rest, inputs, F), takes_nan(rest), F.shape[1])

    @property
    def estimator(self) -> BaseEstimator:
        """Transformers and regressor as one."""
        if self.head is None:
            return self.regressor
        last = self.regressor
        tail = last.steps if isinstance(last, Pipeline) else [(type(last).__name__.lower(), last)]
        return Pipeline([*self.head.steps, *tail])

    def predict(self, T: Any) -> Array:
        """Predictions of the targets, and their standard deviations, (2, n_rows, n_targets).

        The latter are zero where the regressor's ``predict`` takes no ``return_std``.
        """
        return self.predict_behind(T if self.head is None else self.head.transform(T)).swapaxes(0, 1)

    def predict_behind(self, inputs: Any) -> Array:
        """The same from inputs behind the first transformers, (n_rows, 2, n_targets)."""
        usable = np.ones(inputs.shape[0], dtype=bool) if self.takes_gaps else are_complete(inputs)
        predicted = np.full((inputs.shape[0], 2, self.n_targets), np.nan)
        if usable.any():
            values, deviations = predict_with_std(self.regressor, rows_of(inputs, usable))
            if values.shape != (usable.sum(), self.n_targets):
                raise ValueError(
                    f"{type(self.regressor).__name__} predicted the shape {values.shape}; expected "
                    f"{(int(usable.sum()), self.n_targets)}, a column for each target"
                )
            predicted[usable, 0], predicted[usable, 1] = values, 0.0 if deviations is None else deviations
        return predicted

    def out_of_fold(self, estimator: BaseEstimator, T: Any, F: Any, folds: list[tuple[Rows, Rows]]) -> Array:
        """The same of each row by a clone of the estimator's rest that was fitted to other folds."""
        rest, inputs = split_pipeline(estimator)[1], T if self.head is None else self.head.transform(T)

        def learn(train: Rows) -> Callable[[Rows], Array]:
            fitted = fit_rows(rest, rows_of(inputs, train), rows_of(F, train))
            part = RowsRegression(None, fitted, self.takes_gaps, self.n_targets)
            return lambda test: part.predict_behind(rows_of(inputs, test))

        return out_of_fold(learn, folds).swapaxes(0, 1)


def fit_rows(estimator: BaseEstimator, inputs: Any, F: Any) -> BaseEstimator:
    """A clone fitted to the rows that it can take; where gaps of the targets differ, a clone for each target."""
    usable = np.ones(inputs.shape[0], dtype=bool) if takes_nan(estimator) else are_complete(inputs)
    present, last = ~np.isnan(as_floats(F)), last_step(estimator)
    if getattr(last, "_leaves_out_gaps", False):  # as a chain does itself
        present[:] = True
    rows = usable[:, np.newaxis] & present
    if not rows.any(axis=0).all():
        target = column_names(F, "target ")[rows.any(axis=0).argmin()]
        raise ValueError(
            f"{target!r} has none of {len(rows)} rows to learn from, of all or in a fold; expected rows with that "
            f"target and every other column for {type(estimator).__name__}"
        )
    if (rows == usable[:, np.newaxis]).all():
        takes_columns = F.shape[1] > 1 or not get_tags(last).target_tags.single_output
        targets = rows_of(F, usable)
        return fit_outputs(estimator, rows_of(inputs, usable), targets if takes_columns else targets.squeeze(axis=1))
    one = estimator.estimator if isinstance(estimator, MultiOutputRegressor) else estimator
    each = MultiOutputRegressor(one)
    named = hasattr(F, "iloc")  # so that a regressor may know which target it learns
    each.estimators_ = [
        fit_checked(clone(one), rows_of(inputs, own), F.iloc[own, k] if named else F[own, k])
        for k, own in enumerate(rows.T)
    ]
    return each


def read_folds(cv: Any, T: Any) -> list[tuple[Rows, Rows]]:
    """The folds that a user asks for, as training and test rows."""
    n_rows = len(T)
    n_folds = 5 if isinstance(cv, str) else cv
    if isinstance(n_folds, Integral) and n_folds > n_rows:
        raise ValueError(f"cv is {cv!r}, {n_folds} folds of {n_rows} rows; expected a row or more in each fold")
    if isinstance(n_folds, Iterable) and not hasattr(n_folds, "split"):
        n_folds = list(n_folds)
        for number, pair in enumerate(n_folds):
            if not (isinstance(pair, tuple | list) and len(pair) == 2 and all(are_rows(part, n_rows) for part in pair)):
                raise ValueError(
                    f"cv holds {pair!r:.100} as its element {number}; expected a number of folds, a splitter, or pairs "
                    f"of training and test rows, positions from 0 to {n_rows - 1}"
                )
    splits = list(check_cv(n_folds).split(T))
    tested = np.bincount(np.concatenate([[], *(test for _, test in splits)]).astype(int), minlength=n_rows)
    wrong = np.flatnonzero(tested != 1)
    wrong = wrong[wrong >= tested.argmax()]  # a splitter of time does not test the first rows
    if wrong.size:
        raise ValueError(
            f"cv is {cv!r}, which tests row {wrong[0]} {tested[wrong[0]]} times ({wrong.size} of {n_rows} rows not "
            "exactly once); expected a partition of the rows, such as KFold makes, or of all but the first, as "
            "TimeSeriesSplit does"
        )
    return splits


def are_rows(part: Any, n_rows: int) -> bool:
    """Whether a part of a fold holds positions of rows."""
    rows = np.asarray(part)
    whole = rows.ndim == 1 and (rows.size == 0 or rows.dtype.kind in "iu")
    return whole and (rows.size == 0 or (rows.min() >= 0 and rows.max() < n_rows))


def rows_of(table: Any, rows: Any) -> Any:
    """Some rows of a frame, an array or a sparse matrix."""
    return table.iloc[rows] if hasattr(table, "iloc") else table[rows]


def are_complete(inputs: Any) -> NDArray[np.bool_]:
    """Which rows have no gap."""
    if scipy.sparse.issparse(inputs):
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


def takes_nan(estimator: BaseEstimator) -> bool:
    """Whether an estimator accepts NaN in X, also inside a wrapper whose tag in scikit-learn does not say so."""
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
