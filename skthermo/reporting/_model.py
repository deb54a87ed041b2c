"""Sections of a report on what was monitored, and on how good the model is."""

import re
from collections.abc import Sequence

import numpy as np
import pandas as pd

from skthermo._estimators.warnings import without_warnings
from skthermo._tables.arrays import as_floats, spread_evenly
from skthermo._tables.frames import column_names
from skthermo._tables.text import SPACE, capital, counted, duration_text, period_text, share_text, significant
from skthermo.fem import Structure
from skthermo.reporting._figures import chosen_sensor, draw_groups, draw_modes
from skthermo.reporting._findings import REFERENCE, SIMULATED
from skthermo.reporting._html import Html, Section, bullets, element, figure, paragraphs, section, table
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM, FitReport

MOST_PREDICTED = 1000  # number of records that are drawn over temperature

LARGE_DEVIATION = 0.5  # of a stiffness, above which it is doubtful


def monitored(study: DetectabilityStudy, structure: Structure | None, families: Sequence[str]) -> Section:
    """Records, period, temperatures and modes, and where the damage groups are."""
    T, F = training_tables(study.fem)
    sensors = _sensors(T)
    has_lags = len(sensors.columns) < len(T.columns)
    when, step = period_text(F.index), ""
    if isinstance(F.index, pd.DatetimeIndex) and len(F) > 1:
        step = duration_text(pd.Series(F.index).diff().abs().median())
    weather = study.indices_[next(key for key in study.indices_ if key[2] == SIMULATED)]
    then = period_text(weather.index)
    text = (
        f"The model learned from {counted(len(F), 'record')}{f' {when}' if when else ''}"
        f"{f', usually {step} apart' if step else ''}, with {counted(sensors.shape[1], 'temperature')}"
        f"{', with lags,' if has_lags else ''} and "
        f"{counted(F.shape[1], 'natural frequency', 'natural frequencies')} each."
    )
    simulated = f"The simulated weather has {counted(len(weather), 'record')}{f' {then}' if then else ''}."
    parts = [
        paragraphs(text, simulated, "A lag is the temperature of a sensor some time before." if has_lags else ""),
        table("Temperatures (°C).", ["Sensor", "Lowest", "Mean", "Highest", "Missing"], _ranges(sensors, 3)),
        paragraphs(
            "A mode is one shape in which the structure vibrates; each has its own natural frequency, in vibrations "
            "per second (Hz). Where a frequency is missing, the mode could not be identified in that record."
        ),
        table("Natural frequencies (Hz).", ["Mode", "Lowest", "Mean", "Highest", "Missing"], _ranges(F, 4)),
        figure("Measured natural frequencies over time.", draw_modes(F)),
    ]
    if structure is not None:
        drawn = draw_groups(structure, families)
        parts.append(figure("The structure, with the groups of members whose damage was studied in colour.", [drawn]))
    return section("monitored", "What was monitored", *parts)


def quality(study: DetectabilityStudy) -> Section:
    """Errors by mode, doubtful data, predicted and measured frequencies, and agreement with reference records."""
    T, F = training_tables(study.fem)
    measured, predicted, temperature = _over_temperature(study.fem, T, F)
    over_temperature = figure(
        f"Frequencies over the temperature {temperature.name}, which goes most closely with them: measured, and "
        "predicted by the model.",
        draw_modes(measured, predicted, temperature),
    )
    report = study.fem.report_
    parts = [*learned(report), over_temperature, *stiffnesses(report), *_agreement(study.results_)]
    return section("model", "How good the model is", *parts)


def learned(report: FitReport) -> list[Html]:
    """From how many records a model has learned, and how well it predicts them."""
    error, mean = (significant(report.errors[name].mean()) for name in ("MAPE", "MAPE of the mean"))
    return [
        paragraphs(
            f"The model predicts the frequencies of these records with a mean error of {error}{SPACE}%; the mean "
            f"frequency as prediction has {mean}{SPACE}%. Errors of records that the model has not learned from are "
            "usually larger.",
            f"Of {counted(report.n_rows, 'record')}, {report.n_trained:,} were complete enough to learn from.",
        ),
        table(
            "Errors of the predicted frequencies, and how far the measured mean is from the model before it learned.",
            ["Mode", "Mean error", "Error of the mean frequency", "Measured mean against the model"],
            _modes(report),
        ),
    ]


def stiffnesses(report: FitReport) -> list[Html]:
    """How well each stiffness is determined, and what is doubtful."""
    return [
        paragraphs(
            "Temperature changes the stiffness of parts of the model. The next table says how accurately one record "
            "determines each of these stiffnesses at best"
            + (
                f", and how much temperature moves each by itself, beside {share_text(report.prior.common)} together."
                if report.prior is not None
                else "."
            )
        ),
        table(
            "Stiffnesses that the model adjusts to temperature.",
            ["Parameter", "Smallest possible standard deviation"] + ["Moved by itself"] * (report.prior is not None),
            _parameters(report),
        ),
        element("h3", "What is doubtful"),
        bullets(_doubts(report)) or paragraphs("Nothing is doubtful about the records, the modes or the stiffnesses."),
    ]


def _modes(report: FitReport) -> list[list[str]]:
    errors = report.errors[["MAPE", "MAPE of the mean"]].to_numpy()
    return [
        [name, *(f"{significant(error)}{SPACE}%" for error in pair), f"{offset:+.1f}{SPACE}%"]
        for (name, offset), pair in zip(report.offsets.items(), errors, strict=True)
    ]


def _parameters(report: FitReport) -> list[list[str]]:
    rows = [
        [name, share_text(deviation) if np.isfinite(deviation) else "not determined"]
        for name, deviation in report.deviations.items()
    ]
    if report.prior is None:
        return rows
    return [[*row, share_text(size)] for row, size in zip(rows, report.prior.own, strict=True)]


def training_tables(fem: DataInformedFEM) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Temperatures and frequencies that the chain learned from, as frames."""
    T, F = fem.training_records_
    index = next((table.index for table in (F, T) if isinstance(table, pd.DataFrame)), None)
    names = column_names(T, "T"), column_names(F, "f")
    first, second = (pd.DataFrame(as_floats(t), index, [str(n) for n in c]) for t, c in zip((T, F), names, strict=True))
    return first, second


def _doubts(report: FitReport) -> list[str]:
    doubts = [f"{counted(int(n), 'record')} left out: {reason}." for reason, n in report.left_out.items()]
    found = [*report.findings.warnings(), *report.warnings()]
    doubts += [f"{capital(warning.args[0])}." for warning in found]
    for name, deviation in report.deviations.items():
        if not deviation < LARGE_DEVIATION:
            doubts.append(f"Hardly any mode depends on the stiffness {name}, so that its values mean little.")
    if report.n_unconverged:
        doubts.append(f"The stiffnesses of {counted(report.n_unconverged, 'record')} could not be found exactly.")
    return doubts


def _sensors(T: pd.DataFrame) -> pd.DataFrame:
    """One column for each sensor: lags, which `~skthermo.preprocessing.LagFeatures` calls sensor_lag1, are counted."""
    columns: dict[str, list[tuple[int, str]]] = {}
    for name in T.columns:
        lagged = re.fullmatch(r"(.+)_lag(\d+)", name)
        sensor, lag = (lagged[1], int(lagged[2])) if lagged else (name, -1)
        columns.setdefault(sensor, []).append((lag, name))
    shown = [min(found)[1] for found in columns.values()]
    n_lags = [sum(lag > 0 for lag, _ in found) if len(found) > 1 else 0 for found in columns.values()]
    whole = zip(columns, shown, n_lags, strict=True)
    return T[shown].set_axis([f"{name}, with {counted(n, 'lag')}" if n else first for name, first, n in whole], axis=1)


def _ranges(values: pd.DataFrame, digits: int) -> list[list[str]]:
    return [
        [name, *(significant(v, digits) for v in (c.min(), c.mean(), c.max())), share_text(c.isna().mean())]
        for name, c in values.items()
    ]


def _over_temperature(
    fem: DataInformedFEM, T: pd.DataFrame, F: pd.DataFrame
) -> tuple[pd.DataFrame, pd.DataFrame, pd.Series]:
    """Measured and predicted frequencies of some rows, evenly spread, and the temperature that they follow."""
    rows = spread_evenly(np.arange(len(T)), MOST_PREDICTED)
    with without_warnings():  # the report of the fit counts the gaps of these records
        frequencies = as_floats(fem.predict(fem.training_records_[0]))[rows]
    measured = F.iloc[rows]
    predicted = pd.DataFrame(frequencies, measured.index, measured.columns)
    return measured, predicted, chosen_sensor(T, F).iloc[rows]


def _agreement(results: pd.DataFrame) -> list[Html]:
    """Rates of simulated and of reference records side by side."""
    rates = results.pivot(index="scenario", columns="source", values="rate").reindex(results["scenario"].unique())
    heading = element("h3", "Do the simulations agree with other records?")
    if REFERENCE not in rates:
        return [heading, paragraphs("No other records were given to compare the simulations with.")]
    both = rates.dropna()
    gaps = 100 * (both[SIMULATED] - both[REFERENCE])
    mean, largest = significant(gaps.abs().mean()), significant(gaps.abs().max())
    text = (
        f"In {counted(len(both), 'scenario')}, the simulations were compared with reference records. Shares of records "
        f"in alarm differ by {mean} percentage points on average, and by {largest} at most."
    )
    single = results[(results["source"] == REFERENCE) & (results["n_repeats"] == 1)].set_index("scenario")["rate"]
    bands = results[results["source"] == SIMULATED].set_index("scenario").reindex(single.index)
    if len(single):
        inside = int(single.between(bands["pi_low"], bands["pi_high"]).sum())
        text += (
            f" Of {counted(len(single), 'reference rate')}, {inside:,} lie in the prediction interval of one campaign."
        )
    return [heading, paragraphs(f"{text} The table of all scenarios, further below, has both.")]
