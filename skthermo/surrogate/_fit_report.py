"""The report of a fit: rows, modes, parameters and findings."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from html import escape
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.utils import Bunch

from skthermo._core.arrays import Array, as_floats, cramer_rao, robust_deviation, spread_evenly
from skthermo._core.estimators import last_step
from skthermo._core.frames import Table, column_names, columns_by_sensor, has_stamps
from skthermo._core.saved_frames import SavesFrames
from skthermo._core.text import capital, listed
from skthermo.exceptions import FewRecordsWarning, ModelWarning, RecordsWarning, SkthermoWarning
from skthermo.fem import linearise
from skthermo.metrics import mape
from skthermo.preprocessing import RecordFindings
from skthermo.preprocessing.checks import period_of
from skthermo.residuals.sensors import SensorRegression
from skthermo.surrogate._fleet_mapper import FleetMapper
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._posterior import PosteriorInverse, ThermalPrior, unconverged
from skthermo.surrogate._records import TrainingRecords

MOST_SCORED = 365  # largest number of rows that errors are computed for


@dataclass(frozen=True, repr=False)
class FittedRows(SavesFrames):
    """Which rows of the records trained a chain; see `FitReport`."""

    given: int
    trained: int
    scored: int
    left_out: pd.Series
    filled: pd.DataFrame

    @classmethod
    def counted(cls, records: TrainingRecords, sensors: SensorRegression | None) -> FittedRows:
        """Rows that train, and those that do not: a sensor or a mode is missing, or no parameters were found.

        Sensors are those that fill gaps of others, if any do.
        """
        T, trained = records.temperatures, records.trained
        index = T.index if isinstance(T, pd.DataFrame) else pd.RangeIndex(len(T))
        temperatures, F = as_floats(T), as_floats(records.frequencies)
        deviations, filled, missing = np.zeros_like(temperatures) if sensors is None else sensors.fill(T)[1], {}, {}
        for sensor, columns in columns_by_sensor(T).items():
            missing[f"temperature {sensor!r} is missing"] = np.isnan(temperatures[:, columns]).any(axis=1) & ~trained
            values = deviations[:, columns]
            if (rows := (values > 0).any(axis=1)).any():
                when = period_of(index, np.flatnonzero(rows))
                filled[sensor] = [int(rows.sum()), float(values[values > 0].mean()), when]
        without_theta = np.isnan(records.targets).any(axis=1)  # a posterior needs some modes only
        for name, column in zip(column_names(records.frequencies, "f"), F.T, strict=True):
            missing[f"frequency {name!r} is missing"] = np.isnan(column) & without_theta
        missing["a lag reaches into a gap"] = ~np.isnan(temperatures).any(axis=1) & np.isnan(records.inputs).any(axis=1)
        missing["their weight is 0"] = ~records.counted
        missing["no parameters were found"] = ~np.isnan(F).any(axis=1) & without_theta
        when = {what: period_of(index, np.flatnonzero(rows)) for what, rows in missing.items() if rows.any()}
        left_out = {f"{what}, {period}": int(missing[what].sum()) for what, period in when.items()}
        n_trained = int(trained.sum())
        return cls(
            given=len(F),
            trained=n_trained,
            scored=min(n_trained, MOST_SCORED),
            left_out=pd.Series(left_out, dtype=int),
            filled=pd.DataFrame.from_dict(filled, orient="index", columns=["rows", "standard deviation", "when"]),
        )

    def __repr__(self) -> str:
        lines = [f"{self.trained} of {self.given} rows trained the temperature mapper."]
        lines += [f"Left out: {count} rows, {reason}." for reason, count in self.left_out.items()]
        for name, rows, deviation, when in self.filled.itertuples():
            lines.append(
                f"Filled from the other sensors: {rows} temperatures of {name!r} (standard deviation {deviation:.2g}), "
                f"{when}."
            )
        return "\n".join(lines)

    def doubts(self, expected: int) -> Iterator[SkthermoWarning]:
        """Findings that few rows train, fewer than ``expected`` ones, or that most have a filled sensor."""
        is_few = self.trained < expected
        if is_few or 2 * self.trained < self.given:
            few = "fewer than 10 complete rows for each parameter" if is_few else "less than half of them"
            yield few_rows(f"{few} train the temperature mapper (report_.rows says why)")
        mostly = self.filled.index[2 * self.filled["rows"] > self.given]
        if len(mostly):
            yield RecordsWarning(
                f"temperatures were filled from the other sensors in more than half of the rows: {named(mostly)}. "
                "Repair these sensors, or leave them out",
                "faulty-sensor",
            )


def few_rows(what: str) -> FewRecordsWarning:
    """The finding that records are few, or carry little."""
    return FewRecordsWarning(
        f"there are few records: {what}. The fit is unreliable. Give a year of records and fill their gaps, such as by "
        "imputer=KNNGapImputer(), or use fewer lags",
        "few-records",
    )


@dataclass(frozen=True, repr=False)
class FittedParameters(SavesFrames):
    """How well the parameters are determined, and how they were found; see `FitReport`."""

    deviations: pd.Series
    prior: ThermalPrior | None
    n_unconverged: int
    n_by_full_model: int

    @classmethod
    def found(cls, chain: Any, found: Bunch, scatter: Array) -> FittedParameters:
        """What a chain's inverse has found in the records, given the scatter of each mode."""
        theta = found.theta[~np.isnan(found.theta).any(axis=1)]
        sensitivity = linearise(chain.model, np.median(theta, axis=0), relative=True)[1][0]
        information = (sensitivity.T / np.maximum(scatter, 1e-12) ** 2) @ sensitivity
        return cls(
            deviations=pd.Series(np.sqrt(np.diagonal(cramer_rao(information))), index=chain.parameter_names_),
            prior=getattr(last_step(chain.inverse_), "prior_", None),
            n_unconverged=int(unconverged(found).sum()) if "converged" in found else 0,
            n_by_full_model=int(np.sum(found.get("by_full_model", 0))),
        )

    @property
    def table(self) -> pd.DataFrame:
        """Smallest deviation, and what temperature does, in percent, by parameter."""
        percent = pd.DataFrame({"smallest deviation (%)": (100 * self.deviations).round(2)})
        if self.prior is not None:
            percent["moved by itself (%)"] = np.where(self.is_determined, (100 * self.prior.own).round(2), np.nan)
        return percent

    @property
    def is_determined(self) -> NDArray[np.bool_]:
        """Which parameters move a frequency, so that records tell of them."""
        return np.isfinite(self.deviations.to_numpy())

    @property
    def sentences(self) -> list[str]:
        """What temperature does to the parameters, and which rows were hard to solve."""
        lines, known = [], self.is_determined
        if self.prior is not None and known.any():
            names = tuple(self.deviations.index[known])
            lines.append(f"{capital(str(replace(self.prior, names=names, own=self.prior.own[known])))}.")
        if not known.all():
            lines.append(f"These modes say nothing of {listed(list(map(repr, self.deviations.index[~known])))}.")
        if self.n_unconverged:
            lines.append(f"The parameters of {self.n_unconverged} rows have not converged.")
        if self.n_by_full_model:
            lines.append(
                f"The parameters of {self.n_by_full_model} rows are outside the box of the reduced model; the full "
                "model was solved for them."
            )
        return lines

    def __repr__(self) -> str:
        return "\n".join([*self.sentences, self.table.to_string()])


@dataclass(frozen=True, repr=False)
class FitReport(SavesFrames):
    """Findings of `DataInformedFEM.fit` about the records.

    Parameters
    ----------
    rows : FittedRows
        Numbers of rows: all that were ``given``, rows that ``trained`` the temperature mapper, and rows that are
        ``scored`` by the errors, spread evenly over the training rows. ``left_out``, a series, has the rows that did
        not train by reason and period; a row may have several reasons. ``filled``, a frame by sensor, says in how many
        ``rows`` temperatures were filled from the other sensors, the ``standard deviation`` of what was filled, in
        degrees, and ``when`` they are missing.
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
        whose parameters have not converged; ``n_by_full_model``, rows whose parameters are outside the box of the
        reduced model, for which the full model was solved.
    solved : str
        Whether predictions are solved by a reduced model, of which size and accuracy, or by the full model, and why.
    findings : RecordFindings
        What `~skthermo.preprocessing.check_records` has found in the records.
    doubts : list of SkthermoWarning
        What ``fit`` warns of: doubtful records, parts of the chain, rows and modes; a finding of each kind.

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
        trained, *others = repr(self.rows).splitlines()
        lines = [trained, self.solved, *others]
        of_records = set(map(str, self.findings.warnings()))  # the summary lists them
        lines += [f"{capital(str(doubt))}." for doubt in self.doubts if str(doubt) not in of_records]
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
        """Warnings of ``fit``, one of each kind.

        Yields
        ------
        SkthermoWarning
            Its text stands in the report, too.
        """
        yield from self.doubts


def report_of(chain: Any, found: Bunch, findings: RecordFindings, doubts: Iterable[SkthermoWarning]) -> FitReport:
    """The report of a chain that is fitted otherwise; its inverse has ``found`` parameters of the records."""
    modes, unexplained = modes_of(chain)
    rows = FittedRows.counted(chain.records_, chain.sensors_ if chain.imputer_ is None else None)
    expected = 0 if isinstance(last_step(chain.mapper_), FleetMapper) else 10 * len(chain.parameter_names_)
    doubts = [*doubts, *rows.doubts(expected), *doubts_of_modes(modes, unexplained)]
    return FitReport(
        rows=rows,
        modes=modes,
        unexplained_offset=unexplained,
        parameters=FittedParameters.found(chain, found, modes["scatter"].to_numpy() / 100),
        solved=chain.simulator_.described,
        findings=findings,
        doubts=list({doubt.kind: doubt for doubt in reversed(doubts)}.values())[::-1],
    )


def modes_of(chain: Any) -> tuple[pd.DataFrame, float]:
    """What `FitReport` says of each mode, and the share of the hidden offsets that nothing explains."""
    records, last, F = chain.records_, last_step(chain.inverse_), as_floats(chain.records_.frequencies)
    rows = spread_evenly(np.flatnonzero(records.trained), MOST_SCORED)
    nominal = as_floats(chain.model.frequencies(np.ones((1, len(chain.parameter_names_)))))[0]
    measured, delta = F[rows], chain.discrepancy_.at(records.inputs)
    predicted = records.modelled[rows] * np.exp(delta[rows])
    mean, seen = np.nanmean(F, axis=0), np.nanmean(as_floats(chain.aligner_.transform(records.frequencies)), axis=0)
    table = {
        "offset": 100 * (mean / nominal - 1),
        "hidden offset": 100 * (mean / seen - 1),
        "MAPE": mape(measured, predicted),
        "MAPE of the mean": mape(measured, np.broadcast_to(mean, measured.shape)),
        "scatter": 100 * np.nan_to_num(robust_deviation(measured / predicted)),
        "noise": 100 * chain.noise_,
        "misfit": 100 * last.noise_ if isinstance(last, PosteriorInverse) else np.nan,
        "weather": 100 * np.nanstd(np.log(records.modelled[records.trained]), axis=0),
        "discrepancy": 100 * np.sqrt((delta[records.trained] ** 2).mean(axis=0)),
    }
    if isinstance(last, InverseSurrogate):
        table["round trip"] = 100 * last.round_trip()
    errors = 100 * chain.noise_ / np.sqrt(np.maximum((~np.isnan(F)).sum(axis=0), 1))
    of_model = chain.simulator_.frequencies(records.learned[rows], chain.n_jobs)
    unexplained = unexplained_offset(table["hidden offset"], of_model, records.temperatures, errors)
    return pd.DataFrame(table, index=chain.mode_names_), unexplained


def doubts_of_modes(modes: pd.DataFrame, unexplained_offset: float) -> Iterator[ModelWarning]:
    """Findings that the model is not calibrated to the records, or that a trained inverse is inexact."""
    reasons, offsets = [], modes["offset"].abs()
    if (offsets > 15).any():
        far = named(modes.index[offsets > 15])
        reasons.append(f"measured modes differ from its nominal frequencies by more than 15 %: {far}")
    if unexplained_offset > 1:
        hidden = named(modes.index[modes["hidden offset"].abs() >= 0.3])
        reasons.append(f"the aligner hides offsets that weather does not explain, of {hidden}")
    # on nine bridges with models that are 2 to 5 % off, the discrepancy is up to 0.26 of what weather does to the
    # model; on the truss, whose thermal zones cut across the groups of its parameters, 1.4 of it
    is_large = modes["discrepancy"] > np.maximum(2 * modes["weather"], 0.5)
    if is_large.any():
        reasons.append(f"it cannot follow what the weather does to {named(modes.index[is_large])}")
    if modes["MAPE"].mean() > 1.2 * modes["MAPE of the mean"].mean():
        worst = (modes["MAPE"] / modes["MAPE of the mean"]).idxmax()
        reasons.append(f"the chain misses its training frequencies by more than their mean does, {worst!r} the most")
    if reasons:
        yield ModelWarning(
            f"the model is not calibrated to these records: {', and '.join(reasons)} (see report_.modes). Simulated "
            "damage moves the modes too much or too little, so that detection rates and severities are wrong by more "
            "than their noise. Give Hz, mass and stiffness of the model in kg and N/m, and its modes in their order; "
            "update the model (ModelUpdater), and give studies models=updater.sample_models(20) or "
            "uncertainty=(..., 'model')",
            "uncalibrated-model",
        )
    if "round trip" in modes:
        shares = modes["round trip"].abs() / modes["scatter"].clip(lower=0.1)  # less is not seen in single records
        if shares.max() > 1:
            yield ModelWarning(
                f"the inverse turns the model's nominal frequencies into parameters that miss {shares.idxmax()!r} "
                "by more than measurements scatter around the predictions (see report_.modes). Detectors take this "
                "error for damage. Raise n_samples, or use the default inverse",
                "uncalibrated-model",
            )


def named(columns: Iterable[Any]) -> str:
    """Names of columns, one after the other."""
    return ", ".join(map(repr, columns))


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
