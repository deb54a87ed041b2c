"""The report of a fit: rows, modes, parameters and warnings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.utils import Bunch

from skthermo._core.arrays import Array, as_floats, cramer_rao, robust_deviation, spread_evenly
from skthermo._core.estimators import last_step
from skthermo._core.frames import Table, column_names, columns_by_sensor, has_stamps, midnights, row_times
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import capital
from skthermo.exceptions import FewRecordsWarning, ModelWarning, RecordsWarning, SkthermoWarning
from skthermo.fem import linearise
from skthermo.metrics import mape
from skthermo.preprocessing import RecordFindings
from skthermo.residuals.sensors import SensorRegression
from skthermo.surrogate._fleet_mapper import FleetMapper
from skthermo.surrogate.chain._records import TrainingRecords, mode_offsets
from skthermo.surrogate.inverse import InverseSurrogate, PosteriorInverse, ThermalPrior, unconverged

MOST_SCORED = 365  # largest number of rows that errors are computed for


@dataclass(frozen=True, repr=False)
class FittedRows(SavesFrames):
    """Which rows of the records trained a chain; see `FitReport`."""

    given: int
    trained: int
    scored: int
    left_out: pd.Series
    filled: pd.DataFrame
    expected: int

    @classmethod
    def counted(cls, records: TrainingRecords, sensors: SensorRegression, expected: int) -> FittedRows:
        """Rows that train, and those that do not: a sensor or a mode is missing, or no parameters were found.

        With fewer than ``expected`` ones the fit is unreliable.
        """
        T, trained = records.temperatures, records.trained
        inputs, F = as_floats(T), as_floats(records.frequencies)
        deviations, filled, missing = sensors.fill(T)[1], {}, {}
        for sensor, columns in columns_by_sensor(T).items():
            missing[f"temperature {sensor!r} is missing"] = np.isnan(inputs[:, columns]).any(axis=1) & ~trained
            values = deviations[:, columns]
            if (rows := (values > 0).any(axis=1)).any():
                filled[sensor] = [int(rows.sum()), float(values[values > 0].mean()), periods(T, rows)]
        without_theta = np.isnan(records.targets).any(axis=1)  # a posterior needs some modes only
        for name, column in zip(column_names(records.frequencies, "f"), F.T, strict=True):
            missing[f"frequency {name!r} is missing"] = np.isnan(column) & without_theta
        has_lags = ~np.isnan(inputs).any(axis=1) & np.isnan(records.inputs).any(axis=1)
        missing["a lag reaches into a gap"] = has_lags
        missing["their weight is 0"] = ~records.counted
        missing["no parameters were found"] = ~np.isnan(F).any(axis=1) & without_theta
        left_out = {f"{what}, {periods(T, rows)}": int(rows.sum()) for what, rows in missing.items() if rows.any()}
        n_trained = int(trained.sum())
        return cls(
            given=len(F),
            trained=n_trained,
            scored=min(n_trained, MOST_SCORED),
            left_out=pd.Series(left_out, dtype=int),
            filled=pd.DataFrame.from_dict(filled, orient="index", columns=["rows", "standard deviation", "when"]),
            expected=expected,
        )

    def __repr__(self) -> str:
        return "\n".join(self.sentences)

    @property
    def sentences(self) -> list[str]:
        """How many rows trained, and what was left out and filled."""
        lines = [f"{self.trained} of {self.given} rows trained the temperature mapper."]
        lines += [f"Left out: {count} rows, {reason}." for reason, count in self.left_out.items()]
        lines += [
            f"Filled from the other sensors: {rows} temperatures of {name!r} (standard deviation {deviation:.2g}), "
            f"{when}."
            for name, rows, deviation, when in self.filled.itertuples()
        ]
        return lines

    def warnings(self) -> Iterator[SkthermoWarning]:
        """Warnings that few rows train, or that most have a filled sensor."""
        if 2 * self.trained < self.given:
            yield FewRecordsWarning(
                "most rows did not train the temperature mapper (report_.rows says why). The chain has learned little "
                "of their weather. Fill gaps of temperatures, use fewer lags, or fill missing modes by "
                "imputer=KNNGapImputer()",
                "rows-left-out",
            )
        if self.trained < self.expected:
            yield FewRecordsWarning(
                "fewer than 10 complete rows for each parameter train the temperature mapper. The fit is "
                "unreliable. Give a season or a year of records",
                "few-rows",
            )
        mostly = self.filled.index[2 * self.filled["rows"] > self.given]
        if len(mostly):
            yield RecordsWarning(
                f"temperatures were filled from the other sensors in more than half of the rows: {named(mostly)}. "
                "Repair these sensors, or leave them out",
                "mostly-filled",
            )


@dataclass(frozen=True, repr=False)
class FittedParameters(SavesFrames):
    """How well the parameters are determined, and how they were found; see `FitReport`."""

    deviations: pd.Series
    prior: ThermalPrior | None
    n_unconverged: int | None
    n_by_full_model: int
    n_full_solves: int

    @classmethod
    def found(cls, chain: Any, found: Bunch, scatter: Array) -> FittedParameters:
        """What a chain's inverse has found in the records, given the scatter of each mode."""
        theta = found.theta[~np.isnan(found.theta).any(axis=1)]
        sensitivity = linearise(chain.model, np.median(theta, axis=0), relative=True)[1][0]
        information = (sensitivity.T / np.maximum(scatter, 1e-12) ** 2) @ sensitivity
        full_solves = found.get("full_solves", np.zeros(0))
        return cls(
            deviations=pd.Series(np.sqrt(np.diagonal(cramer_rao(information))), index=chain.parameter_names_),
            prior=getattr(last_step(chain.inverse_), "prior_", None),
            n_unconverged=int(unconverged(found).sum()) if "converged" in found else None,
            n_by_full_model=int((full_solves > 0).sum()),
            n_full_solves=int(full_solves.sum()),
        )

    @property
    def table(self) -> pd.DataFrame:
        """Smallest deviation, and what temperature does, in percent, by parameter."""
        percent = pd.DataFrame({"smallest deviation (%)": (100 * self.deviations).round(2)})
        if self.prior is not None:
            percent["moved by itself (%)"] = (100 * self.prior.own).round(2)
        return percent

    def __repr__(self) -> str:
        return "\n".join([*self.sentences, self.table.to_string()])

    @property
    def sentences(self) -> list[str]:
        """What temperature does to the parameters, and which rows were hard to solve."""
        lines = [] if self.prior is None else [f"{capital(str(self.prior))}."]
        if self.n_unconverged:
            lines.append(f"The parameters of {self.n_unconverged} rows have not converged.")
        if self.n_by_full_model:
            lines.append(
                f"The parameters of {self.n_by_full_model} rows are outside the box of the reduced model; the full "
                f"model was solved {self.n_full_solves} times."
            )
        return lines


@dataclass(frozen=True, repr=False)
class FitReport(SavesFrames):
    """Findings of `DataInformedFEM.fit` about the records.

    Parameters
    ----------
    rows : FittedRows
        Numbers of rows: all that were ``given``, rows that ``trained`` the temperature mapper, and rows that are
        ``scored`` by the errors, spread evenly over the training rows. ``left_out``, a series, has the rows that did
        not train by reason; a row may have several reasons. ``filled``, a frame by sensor, says in how many ``rows``
        temperatures were filled from the other sensors, the ``standard deviation`` of what was filled, in degrees, and
        ``when`` they are missing.
    modes : DataFrame
        By mode, in percent:

        - ``offset``: mean measured frequency against the model's nominal one;
        - ``hidden offset``: the part of it that the aligner removes, so that the model need not explain it; zero
          without an aligner;
        - ``MAPE``, ``MAPE of the mean``: in-sample error of the chain and of the training mean;
        - ``scatter``: standard deviation of measured over predicted frequencies, by the median of the distances;
        - ``noise`` of the records about a regression, and ``misfit``, that about the FE model, by which a
          `PosteriorInverse` weights the mode;
        - ``weather``: standard deviation of its effect on the FE model's frequencies;
        - ``discrepancy``: its root mean square over the training records;
        - ``round trip``, with an `InverseSurrogate` only: relative error of the nominal frequencies after inversion by
          it and another solution.
    unexplained_offset : float
        Size of the hidden offsets as a share of what weather and calibration may leave; above 1, the model is not
        calibrated to these records.
    parameters : FittedParameters
        ``deviations``, a series: smallest possible relative standard deviation of each parameter estimated from one
        record (Cramer-Rao bound), infinite where the modes do not determine it. With a `PosteriorInverse`: ``prior``,
        how much temperature moves the parameters, as the records teach it or as it was given; ``n_unconverged``, rows
        whose parameters have not converged; ``n_by_full_model`` and ``n_full_solves``, rows whose parameters are
        outside the box of the reduced model, and how often the full model was solved for them.
    solved : str
        Whether predictions are solved by a reduced model, of which size and accuracy, or by the full model, and why.
    findings : RecordFindings
        What `~skthermo.preprocessing.check_records` has found in the records.
    doubts : list of SkthermoWarning
        What `fit` has found doubtful in the records and by its parts, a finding of each kind.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> year.temperatures.iloc[10:15, 0] = float("nan")
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> print(fem.report_.rows)
    365 of 365 rows trained the temperature mapper.
    Filled from the other sensors: 5 temperatures of 'T1' (standard deviation 3.3), 2025-01-11 to 2025-01-15.
    """

    rows: FittedRows
    modes: pd.DataFrame
    unexplained_offset: float
    parameters: FittedParameters
    solved: str
    findings: RecordFindings
    doubts: list[SkthermoWarning]

    def __repr__(self) -> str:
        return "\n".join([*self._sentences(), "", self._printed_modes().to_string(), self.parameters.table.to_string()])

    def _repr_html_(self) -> str:
        text = "".join(f"<p>{escape(line)}</p>" for line in self._sentences())
        return text + self._printed_modes().to_html() + self.parameters.table.to_html()

    def _sentences(self) -> list[str]:
        trained, *others = self.rows.sentences
        lines = [trained, self.solved, *others]
        kinds = set(self.findings.table["what"])  # the summary lists them
        lines += [f"{capital(str(doubt))}." for doubt in self.warnings() if doubt.kind not in kinds]
        n_parameters, n_modes = len(self.parameters.deviations), len(self.modes)
        if n_parameters > n_modes:
            lines.append(
                f"{n_parameters} parameters, {n_modes} modes: a record of frequencies alone cannot distinguish all "
                "of them."
            )
        lines += self.parameters.sentences
        if len(self.findings.table):
            lines.append(self.findings.summary())
        return [*lines, f"MAPE is in-sample, of {self.rows.scored} rows spread evenly over the training rows."]

    def _printed_modes(self) -> pd.DataFrame:
        printed = self.modes.drop(columns=["hidden offset", "scatter"]).round({"offset": 2}).round(3) + 0.0  # not -0.0
        return printed.add_suffix(" (%)")

    @property
    def has_hidden_offsets(self) -> bool:
        """Whether the aligner hides offsets between measurement and model that weather does not explain."""
        return self.unexplained_offset > 1

    def warnings(self) -> Iterator[SkthermoWarning]:
        """Warnings of `fit`, one of each kind: its doubts, and those about the rows, the modes and the outliers.

        Yields
        ------
        SkthermoWarning
            Its text stands in the report, too.
        """
        yield from self.doubts
        yield from self.rows.warnings()
        modes, far = self.modes, self.findings.outliers.to_numpy()
        if modes["MAPE"].mean() > 1.2 * modes["MAPE of the mean"].mean():
            worst = (modes["MAPE"] / modes["MAPE of the mean"]).idxmax()
            yield ModelWarning(
                f"the chain misses its own training frequencies by more than their mean does, {worst!r} the most. Its "
                "parameters cannot follow these modes. See the offsets in report_.modes, update the model, or use the "
                "default aligner and discrepancy",
                "worse-than-mean",
            )
        if self.unexplained_offset > 1:
            large = modes.index[modes["hidden offset"].abs() >= 0.3]
            yield ModelWarning(
                "the aligner hides offsets between measurement and model that weather does not explain, of "
                f"{named(large)} (see report_.modes). Simulated damage moves the modes too much or too little, so that "
                "detection rates and severities are wrong by more than their noise. Update the model to these records "
                "(ModelUpdater). Give studies models=updater.sample_models(20) or uncertainty=(..., 'model')",
                "hidden-offsets",
            )
        if far.sum() > 0.05 * far.size:
            yield RecordsWarning(
                "more than 5 % of the frequencies are outliers and train nothing. They may be of other modes, or of "
                "another state. See report_.findings",
                "many-outliers",
            )
        # on nine bridges with models that are 2 to 5 % off, the discrepancy is up to 0.26 of what weather does to the
        # model; on the truss, whose thermal zones cut across the groups of its parameters, 1.4 of it
        is_large = modes["discrepancy"] > np.maximum(2 * modes["weather"], 0.5)
        if is_large.any():
            yield ModelWarning(
                f"the FE model cannot follow what the weather does to {named(modes.index[is_large])} (see "
                "report_.modes). Predictions rely on the discrepancy, and simulated damage on a model that is not "
                "calibrated. Update the model (ModelUpdater), or give it parameters that this weather changes",
                "large-discrepancy",
            )
        if "round trip" in modes:
            shares = modes["round trip"].abs() / modes["scatter"].clip(lower=0.1)  # less is not seen in single records
            if shares.max() > 1:
                yield ModelWarning(
                    f"the inverse turns the model's nominal frequencies into parameters that miss {shares.idxmax()!r} "
                    "by more than measurements scatter around the predictions (see report_.modes). Detectors take this "
                    "error for damage. Raise n_samples, or use the default inverse",
                    "round-trip-error",
                )


def named(columns: Iterable[Any]) -> str:
    """Names of columns, one after the other."""
    return ", ".join(map(repr, columns))


def report_of(chain: Any, found: Bunch, findings: RecordFindings, doubts: Sequence[SkthermoWarning]) -> FitReport:
    """The report of a chain that is fitted otherwise; its inverse has ``found`` parameters of the records."""
    modes, unexplained = modes_of(chain)
    expected = 0 if isinstance(last_step(chain.mapper_), FleetMapper) else 10 * len(chain.parameter_names_)
    return FitReport(
        rows=FittedRows.counted(chain.records_, chain.sensors_, expected),
        modes=modes,
        unexplained_offset=unexplained,
        parameters=FittedParameters.found(chain, found, modes["scatter"].to_numpy() / 100),
        solved=chain.simulator_.described,
        findings=findings,
        doubts=list({doubt.kind: doubt for doubt in doubts}.values()),
    )


def modes_of(chain: Any) -> tuple[pd.DataFrame, float]:
    """What `FitReport` says of each mode, and the share of the hidden offsets that nothing explains."""
    records, last, F = chain.records_, last_step(chain.inverse_), as_floats(chain.records_.frequencies)
    rows = spread_evenly(np.flatnonzero(records.trained), MOST_SCORED)
    of_model = chain.simulator_.frequencies(records.learned[rows], chain.n_jobs)
    measured = F[rows]
    predicted = records.modelled[rows] * np.exp(chain.discrepancy_.at(records.inputs[rows]))
    mean, seen = np.nanmean(F, axis=0), np.nanmean(as_floats(chain.aligner_.transform(records.frequencies)), axis=0)
    discrepancy = chain.discrepancy_.at(records.inputs[records.trained])
    table = {
        "offset": mode_offsets(chain.model, records.frequencies),
        "hidden offset": 100 * (mean / seen - 1),
        "MAPE": mape(measured, predicted),
        "MAPE of the mean": mape(measured, np.broadcast_to(mean, measured.shape)),
        "scatter": 100 * np.nan_to_num(robust_deviation(measured / predicted)),
        "noise": 100 * chain.noise_,
        "misfit": 100 * last.noise_ if isinstance(last, PosteriorInverse) else np.nan,
        "weather": 100 * np.nanstd(np.log(records.modelled[records.trained]), axis=0),
        "discrepancy": 100 * np.sqrt((discrepancy**2).mean(axis=0)),
    }
    if isinstance(last, InverseSurrogate):
        table["round trip"] = 100 * last.round_trip()
    errors = 100 * chain.noise_ / np.sqrt(np.maximum((~np.isnan(F)).sum(axis=0), 1))
    unexplained = unexplained_offset(table["hidden offset"], of_model, records.temperatures, errors)
    return pd.DataFrame(table, index=chain.mode_names_), unexplained


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


def unexplained_offset(hidden: Array, predicted: Array, T: Table, errors: Array) -> float:
    """Size of hidden offsets as a share of what weather, errors of the means and a calibrated model may leave.

    A factor common to all modes, of 10 %, hardly changes what damage does to them. Calibrated models were found to miss
    mean frequencies by 0.3 %. In units of all that, hidden offsets of a year, root mean square, are 0.1 to 0.7 for
    right and calibrated models, 0.9 to 2.9 for stiffnesses 3 to 5 % off in several groups. Two months, whose mean
    weather may be far from the weather of the model's nominal state, give 0.5 to 2.6 for right models.
    """
    offsets = 100 * np.log1p(hidden / 100)
    known = predicted[~np.isnan(predicted).any(axis=1)]
    weather = np.cov(100 * np.log(known.T)) if len(known) > 1 else np.zeros(1)
    covariance = np.atleast_2d(weather) + 10.0**2 + np.diag(0.3**2 + errors**2)
    size = np.sqrt(offsets @ np.linalg.solve(covariance, offsets) / len(offsets))
    if not has_stamps(T):
        return float(size / 1.5)
    n_months = ((T.index - T.index.min()) // pd.Timedelta(days=30)).nunique()
    return float(size / (0.85 if n_months >= 11 else 3.0))
