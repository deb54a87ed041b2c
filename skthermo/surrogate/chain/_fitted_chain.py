"""What studies, monitors and fleets need of a chain that has been fitted."""

from __future__ import annotations

from typing import Any, Protocol

from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from skthermo._tables.arrays import Array
from skthermo._tables.frames import Table
from skthermo.fem import FEModel
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.weather import SensorRegression, TrainingRange
from skthermo.surrogate._simulator import Box, Simulator
from skthermo.surrogate.chain._records import RecordSimulator, TrainingRecords
from skthermo.surrogate.chain._stages import Discrepancy, ThermalModel, Weather


class FittedChain(Protocol):
    """A fitted `DataInformedFEM`, or anything that predicts and simulates as it does.

    Attributes
    ----------
    model : FE model
        What turns parameters into frequencies.
    n_jobs : int or None
        Number of parallel jobs.
    n_features_in_ : int
        Number of temperature columns.
    mode_names_, parameter_names_ : list of str
        Columns of the frequencies and of the parameters.
    inverse_, mapper_, aligner_, discrepancy_, simulator_, sensors_, training_range_, box_, thermal_, recorder_
        What the chain has learned, as `DataInformedFEM` describes it.
    parameters_, noise_, records_, report_
        What it has found in the training records.

    See Also
    --------
    DataInformedFEM : The class of skthermo with this interface.
    """

    model: FEModel
    n_jobs: int | None
    n_features_in_: int
    mode_names_: list[Any]
    parameter_names_: list[str]
    inverse_: BaseEstimator
    mapper_: BaseEstimator
    aligner_: BaseEstimator
    discrepancy_: Discrepancy
    simulator_: Simulator
    sensors_: SensorRegression
    training_range_: TrainingRange
    box_: Box | None
    parameters_: Table
    noise_: Array
    thermal_: ThermalModel
    recorder_: RecordSimulator
    records_: TrainingRecords
    report_: Any

    @property
    def training_records_(self) -> tuple[Table, Table]:
        """Temperatures and frequencies that ``fit`` was given."""

    def residuals(self) -> BaselineResiduals:
        """Out-of-fold residuals of the training records, as `DataInformedFEM.residuals` gives them."""

    def weather(self, X: ArrayLike) -> Weather:
        """Temperatures, checked and filled, as `DataInformedFEM.weather` gives them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        """

    def predict(self, X: ArrayLike) -> Table:
        """Frequencies of the healthy structure in Hz, as `DataInformedFEM.predict` gives them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        """

    def predict_parameters(self, X: ArrayLike) -> Table:
        """Multipliers of the nominal parameters, as `DataInformedFEM.predict_parameters` gives them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        """

    def simulate(self, X: ArrayLike, **options: Any) -> Table:
        """Frequencies as monitoring would record them, as `DataInformedFEM.simulate` gives them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        **options : dict
            Damage, noise, gaps and outliers.
        """
