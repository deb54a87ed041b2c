"""How far measured frequencies are from predicted ones."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import norm

from skthermo._estimators.regressors import offers, predicted_covariance
from skthermo._tables.arrays import Array, as_columns
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.weather import PredictionError
from skthermo.surrogate.chain._thermal_model import ThermalModel, Weather


@dataclass(frozen=True, eq=False)
class PredictionIntervals:
    """Relative errors of a thermal model's predictions: what its residuals show, and what is known of each row."""

    model: ThermalModel
    residuals: BaselineResiduals

    def deviations(self, weather: Weather) -> Array:
        """Standard deviations, (n_rows, n_modes)."""
        return np.hypot(self.residuals.spread(weather.inputs), self.known(weather))

    def margins(self, weather: Weather, confidence: float) -> Array:
        """Half-widths of intervals that hold a mode with a probability, (n_rows, n_modes)."""
        margin = self.residuals.quantiles(confidence) * self.residuals.spread(weather.inputs)
        return np.hypot(margin, norm.ppf((1 + confidence) / 2) * self.known(weather))

    def known(self, weather: Weather) -> Array:
        """Standard deviations because temperatures were filled, and because the mapper states that it is uncertain."""
        return np.hypot(
            *(np.sqrt(np.einsum("ijj->ij", part)) for part in (self.of_fills(weather), self.of_mapper(weather)))
        )

    def of_fills(self, weather: Weather) -> Array:
        """Covariances of predictions because temperatures were filled, each (n_modes, n_modes)."""
        model, n_parameters = self.model, len(self.model.parameter_names)

        def predict(filled: Any) -> Array:
            return np.hstack([as_columns(model.mapper.predict(filled)), model.discrepancy(filled)])

        def log_frequencies(both: Array) -> Array:
            return np.log(model.frequencies(both[:, :n_parameters])) + both[:, n_parameters:]

        cost = PredictionError.of_fills(model.sensors, weather.given, weather.filled, predict, log_frequencies)
        return cost.of_all(len(weather), len(model.mode_names))

    def of_mapper(self, weather: Weather) -> Array:
        """Covariances of ln f as the mapper states them; zero where it does not."""
        mapper, n_modes = self.model.mapper, len(self.model.mode_names)
        if not offers(mapper, "predict_covariance"):
            return np.zeros((len(weather), n_modes, n_modes))
        theta = as_columns(mapper.predict(weather.filled))
        return self.model.propagated(theta, predicted_covariance(mapper, weather.filled))
