"""The records that a chain was fitted to, and what it leaves of them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from sklearn.base import clone
from sklearn.model_selection import KFold

from skthermo._arrays import Array, as_columns, as_floats
from skthermo._pipelines import last_step
from skthermo._regressors import weights_for
from skthermo._saved_frames import SavesFrames
from skthermo._times import row_times
from skthermo.surrogate.chain._residuals import WeatherResiduals

N_FOLDS = 5


@dataclass
class TrainingRecords(SavesFrames):
    """Records that `DataInformedFEM.fit` was given, in their order, and what M2 learned from them.

    ``inputs`` are those of M2, lags included, ``targets`` the parameters that it learned, and ``weights`` those of the
    rows, or None. ``residuals`` are out of fold, and None until they have been computed.
    """

    temperatures: Any
    frequencies: Any
    inputs: Array
    targets: Array
    weights: Array | None
    residuals: WeatherResiduals | None = None

    @property
    def trained(self) -> NDArray[np.bool_]:
        """Which rows trained M2."""
        return ~(np.isnan(self.inputs).any(axis=1) | np.isnan(self.targets).any(axis=1))

    def out_of_fold(self, mapper: Any, frequencies_of: Callable[[Array], Array]) -> WeatherResiduals:
        """Relative residuals of the records, each predicted by a mapper fitted on other periods of time.

        Given are the fitted mapper, and the function from parameters to frequencies as they would be measured.
        """
        order = np.argsort(row_times(self.temperatures), kind="stable")
        inputs, theta, measured = self.inputs[order], self.targets[order], as_floats(self.frequencies)[order]
        rows = np.flatnonzero(~np.isnan(inputs).any(axis=1) & ~np.isnan(measured).all(axis=1))
        usable = ~np.isnan(theta[rows]).any(axis=1)
        if usable.sum() < 2 * N_FOLDS:
            raise ValueError(f"{usable.sum()} records have parameters; expected at least {2 * N_FOLDS} for residuals")
        learner, predicted, folds = last_step(mapper), np.full_like(theta[rows], np.nan), np.empty(len(rows), dtype=int)
        for fold, (train, test) in enumerate(KFold(N_FOLDS).split(rows)):
            train = train[usable[train]]
            weights = None if self.weights is None else self.weights[order][rows][train]
            fitted = clone(learner).fit(inputs[rows][train], theta[rows][train], **weights_for(learner, weights))
            predicted[test], folds[test] = as_columns(fitted.predict(inputs[rows][test])), fold
        own = as_columns(mapper.predict(self.temperatures))[order][rows]
        values, own = (measured[rows] / frequencies_of(theta) - 1 for theta in (predicted, own))
        known = ~np.isnan(values).all(axis=1)
        return WeatherResiduals(inputs[rows][known], values[known], own[known], folds[known])
