"""What measured frequencies do with the weather that the FE model cannot follow."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._estimators.regressors import fit_outputs, inputs_of_last_step
from skthermo._estimators.warnings import without_warnings
from skthermo._tables.arrays import Array, as_columns, as_floats, median, patterns, robust_deviation, spread_evenly
from skthermo._tables.frames import frame_like
from skthermo.residuals.weather import SensorRegression
from skthermo.surrogate._mapper import TemperatureMapper
from skthermo.surrogate._regression import default_lines

PENALTIES = np.logspace(-1, 5, 7)  # few, because it is fitted often; below them, rounding errors would show
FEWEST = 30  # records of a mode, below which its discrepancy counts as 0
TINY = 1e-300
FAR = 5.0  # robust deviations of ln(measured / model) from the median, beyond which a record does not count
MOST = 20_000  # records, spread evenly, that a discrepancy is learned from


@dataclass(frozen=True, eq=False)
class Discrepancy:
    """Logarithm of measured over modelled frequencies in the weather, mode by mode: ``discrepancy_(T)``.

    ``learned`` holds the fitted regressors of the ratios; modes of which too little is known have none, so that the FE
    model counts alone. They learn from the inputs of the temperature ``mapper``; missing temperatures are filled by
    ``sensors``. ``levels`` and ``shares``, (n_modes,): a share of what a regressor adds to the mean level counts, the
    slope of a regression of the ratios on what it predicts out of fold. ``regressor`` is the unfitted one.
    """

    regressor: Any
    learned: tuple[Ratios, ...]
    levels: Array
    shares: Array
    sensors: SensorRegression | None = None
    mapper: Any = None

    @classmethod
    def of(
        cls, regressor: Any, inputs: Array, ratios: Array, weights: Array | None, folds: NDArray[np.intp], **chain: Any
    ) -> Discrepancy:
        """Learn from inputs of M2, ratios of measured over modelled frequencies, weights and the folds of the rows."""
        n_modes = ratios.shape[1]
        learned = () if regressor is None else ratios_of(regressor, inputs, ratios, weights)
        found = cls(regressor, learned, np.zeros(n_modes), np.zeros(n_modes), **chain)
        for one in learned:
            logs = np.log(ratios[np.ix_(one.rows, one.modes)])
            level = np.average(logs, axis=0, weights=None if weights is None else weights[one.rows])
            change = np.zeros_like(logs)
            for fold in np.unique(folds[one.rows]):
                test = folds[one.rows] == fold
                other = one.refitted(regressor, inputs, ratios, weights, one.rows[~test])
                if other.regressor is not None:
                    change[test] = other.logs(inputs[one.rows[test]]) - level
            slopes = (change * (logs - level)).sum(axis=0) / np.maximum((change**2).sum(axis=0), TINY)
            found.levels[one.modes], found.shares[one.modes] = level, np.clip(slopes, 0, 1)
        return found

    def relearned(self, inputs: Array, ratios: Array, weights: Array | None, rows: NDArray[np.bool_]) -> Discrepancy:
        """The same with regressors that have learned some of the rows only."""
        some = (
            ratios_of(self.regressor, inputs, np.where(rows[:, np.newaxis], ratios, np.nan), weights)
            if self.learned
            else ()
        )
        return replace(self, learned=some)

    def __call__(self, X: Any) -> Array:
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


@dataclass(frozen=True, eq=False)
class Ratios:
    """A regressor of ratios, fitted to some ``modes`` that are there in the same rows; None where these are too few."""

    modes: NDArray[np.intp]
    rows: NDArray[np.intp]
    regressor: Any

    def refitted(
        self, regressor: Any, inputs: Array, ratios: Array, weights: Array | None, rows: NDArray[np.intp]
    ) -> Ratios:
        """The same modes learned from other rows."""
        if len(rows) < FEWEST or not np.ptp(inputs[rows], axis=0).all():
            return replace(self, rows=rows, regressor=None)
        values = ratios[np.ix_(rows, self.modes)]
        values = values[:, 0] if len(self.modes) == 1 else values
        fitted = fit_outputs(regressor, inputs[rows], values, None if weights is None else weights[rows])
        return replace(self, rows=rows, regressor=fitted)

    def logs(self, inputs: Array) -> Array:
        """Logarithms of the ratios at complete inputs, (n_samples, n_modes)."""
        return np.log(as_columns(self.regressor.predict(inputs)))


def ratios_of(regressor: Any, inputs: Array, ratios: Array, weights: Array | None) -> tuple[Ratios, ...]:
    """Regressors of the modes, of which those that are there in the same rows are learned together.

    Rows in which a mode is far from its median are left out.
    """
    usable = ~np.isnan(inputs).any(axis=1) & (True if weights is None else weights > 0)
    logs = np.log(np.where(usable[:, np.newaxis], ratios, np.nan))
    with np.errstate(invalid="ignore"):
        far = np.abs(logs - median(logs)) > FAR * robust_deviation(logs)
    present, of_mode = patterns(~np.isnan(logs).T)
    learned = []
    for number, mask in enumerate(present):
        modes = np.flatnonzero(of_mode == number)
        rows = spread_evenly(np.flatnonzero(mask & ~far[:, modes].any(axis=1)), MOST)
        learned.append(Ratios(modes, rows, None).refitted(regressor, inputs, ratios, weights, rows))
    return tuple(one for one in learned if one.regressor is not None)


def ratio_regressor() -> TemperatureMapper:
    """What learns ratios and the noise by default, with a penalty for each mode."""
    return TemperatureMapper(default_lines(PENALTIES, alpha_per_target=True))
