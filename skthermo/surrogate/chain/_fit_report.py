"""What others need of a chain that has been fitted, and the report of its fit: numbers and warnings."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any, Protocol

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from skthermo._tables.arrays import Array, as_floats, cramer_rao, robust_deviation, spread_evenly
from skthermo._tables.frames import Table, column_names, columns_by_sensor, has_stamps, midnights, row_times
from skthermo._tables.saved_frames import SavesFrames
from skthermo._tables.text import capital
from skthermo._validation import last_step, offers, reach_of
from skthermo.exceptions import FewRecordsWarning, ModelWarning, RecordsWarning, SkthermoWarning
from skthermo.fem import FEModel, linearise, match_modes
from skthermo.metrics import mape
from skthermo.preprocessing import RecordFindings
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.residuals.weather import SensorRegression, TrainingRange
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.chain._records import RecordSimulator, TrainingRecords
from skthermo.surrogate.chain._stages import Discrepancy, Estimates, ThermalModel, Weather
from skthermo.surrogate.inverse import InverseSurrogate, PosteriorInverse, ThermalPrior


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
    inverse_, mapper_, aligner_, discrepancy_, simulator_, sensors_, training_range_, thermal_, recorder_
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
        """Temperatures, checked and filled, as `DataInformedFEM.weather` gives them."""

    def predict(self, X: ArrayLike) -> Table:
        """Frequencies of the healthy structure in Hz, as `DataInformedFEM.predict` gives them."""

    def predict_parameters(self, X: ArrayLike) -> Table:
        """Multipliers of the nominal parameters, as `DataInformedFEM.predict_parameters` gives them."""

    def simulate(self, X: ArrayLike, **options: Any) -> Table:
        """Frequencies as monitoring would record them, as `DataInformedFEM.simulate` gives them."""


LEAST_SCATTER = 1e-12  # of a mode, so that an exact fit does not divide by zero
MOST_INPUTS = 3  # of the mapper, of which the fleet's weather is listed
MOST_SCORED = 365  # largest number of rows that errors are computed for
ROWS_PER_PARAMETER = 10  # below which a warning is given
WORSE_THAN_MEAN = 1.2  # ratio of the chain's error to that of the training mean from which a warning is given
RESOLUTION = 0.1  # percent of a frequency, below which single records from ambient vibration show no change
LARGE_OFFSET = 15.0  # difference in percent between a measured mode and the model's above which a warning is given
SMALL_OFFSET = 5.0  # percent by which a mode may differ from the model's without being taken for another one
LEFT_BY_CALIBRATION = 0.3  # percent by which a calibrated model was found to miss mean frequencies
COMMON = 10.0
"""Standard deviation in percent of a factor common to all modes: it hardly changes what damage does to them."""

MOST_UNEXPLAINED, MOST_WITHOUT_DATES, MOST_OF_FEW_MONTHS = 0.85, 1.5, 3.0
"""Hidden offsets, root mean square in units of what weather, a common factor and calibration leave, above which a
warning is given: a year's are 0.1 to 0.7 for right and calibrated models, 0.9 to 2.9 for stiffnesses 3 to 5 % off in
several groups; those of two months are 0.5 to 2.6 for right models."""

MOST_OF_A_YEAR, MONTH = 11, pd.Timedelta(days=30)
"""Number of months with records below which their mean weather may be far from that of the model's nominal state."""

LARGE_DISCREPANCY, SMALL_DISCREPANCY = 2.0, 0.5
"""Discrepancy over what weather does to the model's frequencies, and in percent, above both of which a warning is
given: on nine bridges with models that are 2 to 5 % off it is up to 0.26 of that effect, on the truss, whose thermal
zones cut across the groups of its parameters, 1.4."""

MANY_OUTLIERS = 0.05  # share of the frequencies above which a warning is given
SMALLEST_OFFSET = 0.3  # smallest offset in percent that the warning names
CLEARLY_BETTER = 0.25  # modes count as swapped if another order reduces the squared offsets to this share or less


@dataclass(frozen=True, repr=False)
class FitReport(SavesFrames):
    """Findings of `DataInformedFEM.fit` about the records.

    Parameters
    ----------
    n_rows, n_trained : int
        Rows given, and rows that trained the temperature mapper.
    left_out : Series
        Rows that did not train the mapper, by reason; a row may have several reasons.
    filled : DataFrame
        Sensors with missing temperatures, in how many ``rows`` these were filled from the other sensors, the ``standard
        deviation`` of what was filled, in degrees, and ``when`` they are missing.
    offsets : Series
        Mean measured frequency against the model's nominal one, by mode, in percent.
    hidden_offsets : Series
        Part of the offsets that the aligner removes, so that the model need not explain it, by mode, in percent; zero
        without an aligner.
    unexplained_offset : float
        Size of the hidden offsets as a share of what weather and calibration may leave; above 1, the model is not
        calibrated to these records.
    prior : ThermalPrior or None
        With a `PosteriorInverse`: how much temperature moves the parameters, as the records teach it or as it was
        given.
    deviations : Series
        Smallest possible relative standard deviation of each parameter estimated from one record (Cramer-Rao bound);
        infinite where the modes do not determine a parameter.
    errors : DataFrame
        In-sample MAPE of the chain and of the training mean, by mode, in percent.
    n_scored : int
        Number of rows used for ``errors``, spread evenly over the training rows.
    n_unconverged : int or None
        Rows whose parameters have not converged; None without a `PosteriorInverse`.
    n_by_full_model, n_full_solves : int
        Rows whose parameters are outside the box of the reduced model, and how often the full model was solved for
        them.
    round_trip : Series or None
        With an `InverseSurrogate`: relative error of the nominal frequencies after inversion by it and another
        solution, by mode, in percent.
    scatter : Series
        Standard deviation of measured over predicted frequencies, by mode, in percent, by the median of the distances.
    variation : DataFrame
        By mode, in percent: ``noise`` of the records about a regression, ``misfit``, that about the FE model, by which
        a `PosteriorInverse` weights the mode, ``weather``, the standard deviation of what it does to the FE model's
        frequencies, and ``discrepancy``, its root mean square over the training records.
    findings : RecordFindings
        What `~skthermo.preprocessing.check_records` has found in the records.
    fleet : DataFrame or None
        With a mapper that has learned from a fleet: lowest and highest value of each input in these records and in the
        fleet's.
    pooling_probability : mapping or None
        Probability that the structure behaves as the fleet does, by family, where the mapper gives it.
    solved : str
        Whether predictions are solved by a reduced model, of which size and accuracy, or by the full model, and why.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> year.temperatures.iloc[10:15, 0] = float("nan")
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> fem.report_.n_trained, fem.report_.filled["rows"].to_dict()
    (365, {'T1': 5})
    """

    n_rows: int
    n_trained: int
    left_out: pd.Series
    filled: pd.DataFrame
    offsets: pd.Series
    hidden_offsets: pd.Series
    unexplained_offset: float
    prior: ThermalPrior | None
    deviations: pd.Series
    errors: pd.DataFrame
    n_scored: int
    n_unconverged: int | None
    n_by_full_model: int
    n_full_solves: int
    round_trip: pd.Series | None
    scatter: pd.Series
    variation: pd.DataFrame
    findings: RecordFindings
    fleet: pd.DataFrame | None
    pooling_probability: Mapping[Any, float] | None
    solved: str

    def __repr__(self) -> str:
        tables = self._modes().to_string(), self._parameters().to_string()
        return "\n".join([*self._sentences(), "", *tables])

    def _repr_html_(self) -> str:
        text = "".join(f"<p>{escape(line)}</p>" for line in self._sentences())
        return text + self._modes().to_html() + self._parameters().to_html()

    def _sentences(self) -> list[str]:
        lines = [f"{self.n_trained} of {self.n_rows} rows trained the temperature mapper.", self.solved]
        lines += [f"Left out: {count} rows, {reason}." for reason, count in self.left_out.items()]
        lines += [
            f"Filled from the other sensors: {rows} temperatures of {name!r} (standard deviation {deviation:.2g}), "
            f"{when}."
            for name, rows, deviation, when in self.filled.itertuples()
        ]
        lines += [f"{text[0].upper()}{text[1:]}." for text in map(str, self.warnings())]
        n_modes, n_parameters = len(self.offsets), len(self.deviations)
        if n_parameters > n_modes:
            lines.append(
                f"{n_parameters} parameters, {n_modes} modes: a record of frequencies alone cannot distinguish all "
                "of them."
            )
        if self.prior is not None:
            lines.append(f"{capital(str(self.prior))}.")
        if self.n_unconverged:
            lines.append(f"The parameters of {self.n_unconverged} of {self.n_rows} rows have not converged.")
        if self.n_by_full_model:
            lines.append(
                f"The parameters of {self.n_by_full_model} of {self.n_rows} rows are outside the box of the reduced "
                f"model; the full model was solved {self.n_full_solves} times."
            )
        if self.fleet is not None:
            lines.append(
                f"Outside the weather of these records, predictions are based on the fleet: {self._listed_weather()}."
            )
        if self.pooling_probability is not None:
            listed = ", ".join(f"{name!r} {share:.0%}" for name, share in self.pooling_probability.items())
            lines.append(f"Probability that the structure behaves as the fleet does: {listed}.")
        if getattr(self.findings.memory, "features", None) is not None:
            lines.append(self.findings.memory.summary())
        if len(self.findings.table):
            lines.append(self.findings.summary())
        return [*lines, f"MAPE is in-sample, of {self.n_scored} rows spread evenly over the training rows."]

    @property
    def has_hidden_offsets(self) -> bool:
        """Whether the aligner hides offsets between measurement and model that weather does not explain."""
        return self.unexplained_offset > 1

    def _listed_weather(self) -> str:
        """The inputs that the fleet has seen farthest beyond these records."""
        own = self.fleet["highest"] - self.fleet["lowest"]
        farther = (self.fleet["fleet highest"] - self.fleet["fleet lowest"]) / own.where(own > 0, 1.0)
        widest = self.fleet.loc[farther.sort_values(ascending=False, kind="stable").index[:MOST_INPUTS]]
        return ", ".join(
            f"{name!r} from {lowest:.3g} to {highest:.3g}, here {own_lowest:.3g} to {own_highest:.3g}"
            for name, own_lowest, own_highest, lowest, highest in widest.itertuples()
        )

    def _modes(self) -> pd.DataFrame:
        table = pd.DataFrame({"offset (%)": self.offsets.round(2)})
        table = table.join([part.round(3).add_suffix(" (%)") for part in (self.errors, self.variation)])
        if self.round_trip is not None:
            table = table.assign(**{"round trip (%)": self.round_trip.round(3) + 0.0})  # not -0.0
        return table

    def _parameters(self) -> pd.DataFrame:
        percent = pd.DataFrame({"smallest deviation (%)": (100 * self.deviations).round(2)})
        if self.prior is not None:
            percent["moved by itself (%)"] = (100 * self.prior.own).round(2)
        return percent

    def warnings(self) -> Iterator[SkthermoWarning]:
        """Warnings about the rows.

        Yields
        ------
        SkthermoWarning
            Its text stands in the report, too.
        """
        yield from self._few_trained()
        yield from self._few_for_parameters()
        yield from self._mostly_filled()
        yield from self._worse_than_mean()
        yield from self._hidden()
        yield from self._many_outliers()
        yield from self._large_discrepancy()
        yield from self._poor_round_trip()

    def _few_trained(self) -> Iterator[SkthermoWarning]:
        if 2 * self.n_trained >= self.n_rows:
            return
        reasons = "; ".join(f"{count} rows: {reason}" for reason, count in self.left_out.items())
        yield FewRecordsWarning(
            f"only {self.n_trained} of {self.n_rows} rows trained the temperature mapper ({reasons}). The chain has "
            "learned little of the others' weather. Fill gaps of temperatures, use fewer lags, or fill missing modes "
            "by imputer=KNNGapImputer()",
            "rows-left-out",
        )

    def _few_for_parameters(self) -> Iterator[SkthermoWarning]:
        n_parameters = len(self.deviations)
        if self.n_trained >= ROWS_PER_PARAMETER * n_parameters or self.fleet is not None:
            return
        yield FewRecordsWarning(
            f"{self.n_trained} complete rows train {n_parameters} parameters (expected "
            f"{ROWS_PER_PARAMETER * n_parameters} or more). The fit is unreliable. Give a season or a year of records",
            "few-rows",
        )

    def _mostly_filled(self) -> Iterator[SkthermoWarning]:
        mostly = [
            f"{name!r} is missing in {rows} of {self.n_rows} rows ({when}; standard deviation {deviation:.2g} degrees)"
            for name, rows, deviation, when in self.filled[2 * self.filled["rows"] > self.n_rows].itertuples()
        ]
        if mostly:
            yield RecordsWarning(
                f"temperatures were filled from the other sensors in more than half of the rows: {', '.join(mostly)}. "
                "Repair these sensors, or leave them out",
                "mostly-filled",
            )

    def _worse_than_mean(self) -> Iterator[SkthermoWarning]:
        chain, mean = self.errors.mean()
        if not chain > WORSE_THAN_MEAN * mean:
            return
        worst = (self.errors["MAPE"] / self.errors["MAPE of the mean"]).idxmax()
        yield ModelWarning(
            f"the chain misses its own training frequencies by {chain:.2g} % on average, their mean by only {mean:.2g} "
            f"% (the worst mode is {worst!r}). Its parameters cannot follow these modes. See report_.offsets, update "
            "the model, or use the default aligner and discrepancy",
            "worse-than-mean",
        )

    def _hidden(self) -> Iterator[SkthermoWarning]:
        if not self.has_hidden_offsets:
            return
        large = self.hidden_offsets[self.hidden_offsets.abs() >= SMALLEST_OFFSET]
        offsets = ", ".join(f"{name!r} {offset:+.1f} %" for name, offset in large.items())
        yield ModelWarning(
            f"the aligner hides offsets between measurement and model that weather does not explain ({offsets}). "
            "Simulated damage moves the modes too much or too little, so that detection rates and severities are "
            "wrong by more than their noise. Update the model to these records (ModelUpdater). Give studies "
            "models=updater.sample_models(20) or uncertainty=(..., 'model')",
            "hidden-offsets",
        )

    def _many_outliers(self) -> Iterator[SkthermoWarning]:
        far = self.findings.outliers.to_numpy()
        if far.sum() <= MANY_OUTLIERS * far.size:
            return
        yield RecordsWarning(
            f"{far.sum()} of {far.size} frequencies are outliers and train nothing (expected at most "
            f"{MANY_OUTLIERS:.0%}). They may be of other modes, or of another state. See report_.findings",
            "many-outliers",
        )

    def _large_discrepancy(self) -> Iterator[SkthermoWarning]:
        weather, discrepancy = self.variation["weather"], self.variation["discrepancy"]
        large = discrepancy[discrepancy > np.maximum(LARGE_DISCREPANCY * weather, SMALL_DISCREPANCY)]
        modes = ", ".join(
            f"{name!r} ({weather[name]:.2g} % by the model, discrepancy {size:.2g} %)" for name, size in large.items()
        )
        if modes:
            yield ModelWarning(
                f"the FE model cannot follow what the weather does to {modes}. Predictions rely on the discrepancy, "
                "and simulated damage on a model that is not calibrated. Update the model (ModelUpdater), or give it "
                "parameters that this weather changes",
                "large-discrepancy",
            )

    def _poor_round_trip(self) -> Iterator[SkthermoWarning]:
        if self.round_trip is None:
            return
        shares = self.round_trip.abs() / self.scatter.clip(lower=RESOLUTION)
        if not (shares > 1).any():
            return
        worst = shares.idxmax()
        yield ModelWarning(
            f"the inverse turns the model's nominal frequencies into parameters that miss {worst!r} by "
            f"{self.round_trip[worst]:+.2g} %. Measurements scatter around the predictions by only "
            f"{self.scatter[worst]:.2g} %, so that detectors take this error for damage. Raise n_samples, or use "
            "the default inverse",
            "round-trip-error",
        )


def report_of(chain: FittedChain, estimates: Estimates, findings: RecordFindings) -> FitReport:
    """The report of a chain of which all else is fitted."""
    records, theta = chain.records_, estimates.theta
    names, modes, F = chain.parameter_names_, chain.mode_names_, as_floats(records.frequencies)
    measured, of_model, predicted = _in_sample(chain)
    hidden = hidden_offsets(chain.aligner_, records.frequencies)
    errors_of_means = 100 * chain.noise_ / np.sqrt(np.maximum((~np.isnan(F)).sum(axis=0), 1))
    means = np.broadcast_to(np.nanmean(F, axis=0), measured.shape)
    errors = {"MAPE": mape(measured, predicted), "MAPE of the mean": mape(measured, means)}
    full_solves = np.zeros(0) if estimates.full_solves is None else estimates.full_solves
    known, scatter = ~np.isnan(theta).any(axis=1), np.nan_to_num(robust_deviation(measured / predicted))
    last = last_step(chain.inverse_)
    round_trip = last.round_trip() if isinstance(last, InverseSurrogate) else None
    return FitReport(
        n_rows=len(theta),
        n_trained=int(records.trained.sum()),
        left_out=left_out(records, theta),
        filled=filled(records.temperatures, chain.sensors_),
        offsets=mode_offsets(chain.model, records.frequencies),
        hidden_offsets=hidden,
        unexplained_offset=unexplained_offset(hidden, of_model, records.temperatures, errors_of_means),
        prior=getattr(last, "prior_", None),
        deviations=pd.Series(smallest_deviations(chain.model, theta[known], scatter), index=names),
        errors=pd.DataFrame(errors, index=modes),
        n_scored=len(measured),
        n_unconverged=estimates.n_unconverged,
        n_by_full_model=int((full_solves > 0).sum()),
        n_full_solves=int(full_solves.sum()),
        round_trip=None if round_trip is None else pd.Series(100 * round_trip, index=modes),
        scatter=pd.Series(100 * scatter, index=modes),
        variation=_variation(chain),
        findings=findings,
        fleet=weather_of_fleet(chain),
        pooling_probability=getattr(last_step(chain.mapper_), "pooling_probability_", None),
        solved=chain.simulator_.described,
    )


def _in_sample(chain: FittedChain) -> tuple[Array, Array, Array]:
    """Frequencies of some training rows: measured, of the model itself, and predicted by the chain."""
    records = chain.records_
    rows = spread_evenly(np.flatnonzero(records.trained), MOST_SCORED)
    of_model = chain.simulator_.frequencies(records.learned[rows], chain.n_jobs, warn=False)
    predicted = records.modelled[rows] * np.exp(chain.discrepancy_.at(records.inputs[rows]))
    return as_floats(records.frequencies)[rows], of_model, predicted


def _variation(chain: FittedChain) -> pd.DataFrame:
    """What noise, the weather and the discrepancy do to each mode, in percent."""
    records = chain.records_
    weather, last = np.nanstd(np.log(records.modelled[records.trained]), axis=0), last_step(chain.inverse_)
    misfit = last.noise_ if isinstance(last, PosteriorInverse) else np.full_like(weather, np.nan)
    discrepancy = np.sqrt((chain.discrepancy_.at(records.inputs[records.trained]) ** 2).mean(axis=0))
    return 100 * pd.DataFrame(
        {"noise": chain.noise_, "misfit": misfit, "weather": weather, "discrepancy": discrepancy},
        index=chain.mode_names_,
    )


def weather_of_fleet(chain: FittedChain) -> pd.DataFrame | None:
    """Range of each input in the chain's own records, and in those of a fleet that its mapper has learned from."""
    if not offers(chain.mapper_, "from_fleet") or not offers(chain.mapper_, "reach_"):
        return None
    own, fleet = chain.training_range_, reach_of(chain.mapper_, chain.records_.temperatures)[0]
    limits = np.column_stack([own.lowest, own.highest, fleet.lowest, fleet.highest])
    return pd.DataFrame(limits, index=list(own.names), columns=["lowest", "highest", "fleet lowest", "fleet highest"])


def smallest_deviations(model: FEModel, theta: Array, scatter: Array) -> Array:
    """Cramer-Rao deviations of ln theta from one record at the median parameters, given the scatter of each mode."""
    sensitivity = linearise(model, np.median(theta, axis=0), relative=True)[1][0]
    return np.sqrt(np.diagonal(cramer_rao((sensitivity.T / np.maximum(scatter, LEAST_SCATTER) ** 2) @ sensitivity)))


def filled(T: Table, sensors: SensorRegression) -> pd.DataFrame:
    """In how many rows temperatures were filled, with which standard deviation, and when, by sensor."""
    deviations, found = sensors.fill(T)[1], {}
    for sensor, columns in columns_by_sensor(T).items():
        values = deviations[:, columns]
        if (rows := (values > 0).any(axis=1)).any():
            found[sensor] = [int(rows.sum()), float(values[values > 0].mean()), periods(T, rows)]
    return pd.DataFrame.from_dict(found, orient="index", columns=["rows", "standard deviation", "when"])


def left_out(records: TrainingRecords, theta: Array) -> pd.Series:
    """Rows that do not train the mapper, by reason: a sensor or a mode that is missing, with the periods."""
    T, F, trained = records.temperatures, records.frequencies, records.trained
    without_theta = np.isnan(theta).any(axis=1)  # a posterior needs some modes only
    complete_T, complete_F = (~np.isnan(as_floats(table)).any(axis=1) for table in (T, F))
    missing = {
        f"temperature {sensor!r} is missing": np.isnan(as_floats(T)[:, columns]).any(axis=1) & ~trained
        for sensor, columns in columns_by_sensor(T).items()
    }
    for name, column in zip(column_names(F, "f"), as_floats(F).T, strict=True):
        missing[f"frequency {name!r} is missing"] = np.isnan(column) & without_theta
    missing["a lag reaches into a gap"] = complete_T & np.isnan(records.inputs).any(axis=1)
    missing["their weight is 0"] = ~records.counted
    missing["no parameters were found"] = complete_F & without_theta
    counts = {f"{what}, {periods(T, rows)}": int(rows.sum()) for what, rows in missing.items() if rows.any()}
    return pd.Series(counts, dtype=int)


def periods(T: Table, rows: NDArray[np.bool_]) -> str:
    """When some rows of a table were taken: their period, or the longest one and how many there are."""
    order = np.argsort(row_times(T), kind="stable")
    places = np.flatnonzero(rows[order])
    runs = np.split(places, np.flatnonzero(np.diff(places) > 1) + 1)
    longest = max(runs, key=len)
    label = _labels(T, order[longest[[0, -1]]])
    text = label[0] if label[0] == label[1] else f"{label[0]} to {label[1]}"
    return text if len(runs) == 1 else f"in {len(runs)} periods, the longest {text}"


def _labels(T: Table, rows: NDArray[np.intp]) -> list[str]:
    """What rows are called: their stamps, or their numbers."""
    if not has_stamps(T):
        return [f"row {row}" for row in rows]
    stamps = T.index[rows]
    at_midnight = (T.index == midnights(T.index)).all()
    return [f"{stamp:%Y-%m-%d}" if at_midnight else f"{stamp:%Y-%m-%d %H:%M}" for stamp in stamps]


def mode_offsets(model: FEModel, F: Table) -> pd.Series:
    """Mean measured frequency against the model's nominal one, by mode, in percent."""
    nominal = as_floats(model.frequencies(np.ones((1, len(model.parameter_names)))))[0]
    return pd.Series(100 * (np.nanmean(as_floats(F), axis=0) / nominal - 1), index=column_names(F, "f"))


def hidden_offsets(aligner: BaseEstimator, F: Table) -> pd.Series:
    """Mean measured frequency against the mean that the model sees behind an aligner, by mode, in percent."""
    seen = np.nanmean(as_floats(aligner.transform(F)), axis=0)
    return pd.Series(100 * (np.nanmean(as_floats(F), axis=0) / seen - 1), index=column_names(F, "f"))


def unexplained_offset(hidden: pd.Series, predicted: Array, T: Table, errors: Array) -> float:
    """Size of hidden offsets as a share of what weather, errors of the means and a calibrated model may leave."""
    offsets = 100 * np.log1p(hidden.to_numpy() / 100)
    known = predicted[~np.isnan(predicted).any(axis=1)]
    weather = np.cov(100 * np.log(known.T)) if len(known) > 1 else np.zeros(1)
    covariance = np.atleast_2d(weather) + COMMON**2 + np.diag(LEFT_BY_CALIBRATION**2 + errors**2)
    size = np.sqrt(offsets @ np.linalg.solve(covariance, offsets) / len(offsets))
    if not has_stamps(T):
        return float(size / MOST_WITHOUT_DATES)
    n_months = ((T.index - T.index.min()) // MONTH).nunique()
    return float(size / (MOST_UNEXPLAINED if n_months >= MOST_OF_A_YEAR else MOST_OF_FEW_MONTHS))


def mode_warnings(model: FEModel, F: Table) -> Iterator[SkthermoWarning]:
    """Warnings about the order and the units of the modes."""
    offsets = mode_offsets(model, F)
    ratios = 1 + offsets.to_numpy() / 100
    far = offsets[offsets.abs() > LARGE_OFFSET]
    if len(ratios) > 1:
        table = match_modes(model, as_floats(F))
        unchanged = np.arange(len(offsets))
        near = offsets.abs().to_numpy() < SMALL_OFFSET
        order = np.where(near, unchanged, table["mode"])
        best = np.where(near, offsets, table["offset"])
        moved = order != unchanged
        is_better = (best**2).sum() < CLEARLY_BETTER * (offsets**2).sum() and np.abs(best).max() < LARGE_OFFSET
        if moved.any() and is_better and len(np.unique(order)) == len(order):
            yield ModelWarning(
                f"the frequencies {offsets.index[moved].tolist()} look like other modes of the model. They would be "
                "learned as those of their columns. Order them as the model does, or use "
                f"model.with_modes({order.tolist()})",
                "mode-order",
            )
            return
    if len(far):
        listed = ", ".join(f"{name!r} by {offset:+.0f} %" for name, offset in far.items())
        yield RecordsWarning(
            f"measured modes differ from the model's nominal frequencies: {listed} (expected at most {LARGE_OFFSET:g} "
            "%). They may be other modes, or in another unit. Give Hz and the modes of the model in their order, or "
            "update the model",
            "mode-offsets",
        )
