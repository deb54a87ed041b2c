"""
Z24: alarms that see through the weather
========================================

Below 0 °C the frequencies of the Z24 bridge rise by some 2 % a degree, and scatter far more than in mild weather. A
detector that knows only one spread takes the scatter of frost for that of all days, and is blind to damage that comes
in spring. Here the spread follows the weather as well.

Every detector learns from the first four fifths of the healthy records. The last fifth shows its false alarms, the
records after damage began show what it finds. Neither of the two chooses any setting. ``plot_z24_damage.py`` asks
where the damage is, and whether a simulation would have told the same.

The data belong to KU Leuven and are not part of this package. Run the example with the folder or the file
that holds them: ``python examples/plot_z24_detection.py path/to/z24_monitoring.csv``, or set
``SKTHERMO_DATA``. Figures go to the folder ``figures``.
"""

import warnings
from typing import NamedTuple

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from plot_z24_bridge import BLUE, GREY, MODES, ORANGE, boosting, bridge_model, chain, read_arguments, save
from sklearn.ensemble import IsolationForest
from sklearn.model_selection import TimeSeriesSplit
from sklearn.pipeline import make_pipeline

from skthermo.detection import (
    FusedDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
    WindowedAlarm,
)
from skthermo.metrics import time_to_detection
from skthermo.plotting import DamageIndexDisplay
from skthermo.surrogate import TemperatureMapper

FREQUENCIES = ["f1", "f2", "f3", "f4"]
PAVEMENT = "TP"
KINDS = {"baseline": ("healthy, baseline", GREY), "later": ("healthy, hold-out", BLUE), "damaged": ("damaged", ORANGE)}
PLAIN, WHITENED = "residuals", "residuals whitened by weather"
SCALES = {PLAIN: None, WHITENED: "local"}


class Records(NamedTuple):
    """What a detector learns from, and the healthy and the damaged records that it judges."""

    baseline: pd.DataFrame
    later: pd.DataFrame
    damaged: pd.DataFrame

    def each(self, transform, baseline=None):
        """Records that a transformer makes of them; those of the baseline may be given."""
        first = transform(self.baseline) if baseline is None else baseline
        return Records(first, transform(self.later), transform(self.damaged))

    @property
    def onset(self):
        """Time of the first damaged record."""
        return self.damaged.index[0]

    def stream(self):
        """All records that are judged, in order of time."""
        return pd.concat([self.later, self.damaged])

    @classmethod
    def of(cls, bridge):
        """Temperatures and frequencies side by side."""
        T, F, T_test, F_test = bridge.split()
        return cls(T.join(F), T_test.join(F_test), bridge.T_damaged.join(bridge.F_damaged))


def compensate(records, estimator, scale=None, cv=None, targets=FREQUENCIES):
    """Residuals, those of the baseline out of fold, and the compensator."""
    compensator = TemperatureCompensator(estimator, targets=targets, scale=scale, cv=cv)
    return records.each(compensator.transform, compensator.fit_transform(records.baseline)), compensator


def inputs_of_detectors(records):
    """What a detector may look at: raw frequencies, as the paper does, or residuals of three compensators."""
    inputs = {("none", "raw frequencies"): records.each(lambda frame: frame[FREQUENCIES])}
    chained = chain(bridge_model())
    for name, estimator in (("broken lines", TemperatureMapper()), ("boosted trees", boosting()), ("chain", chained)):
        for label, scale in SCALES.items():
            inputs[name, label] = compensate(records, estimator, scale)[0]
    return inputs


def alarms(detector, frame):
    """Share of records that raise an alarm, in percent."""
    return 100 * float((detector.predict(frame) == -1).mean())


def alarm_table(inputs, detector=None):
    """Alarms on healthy hold-out records and on damaged ones, in percent."""
    rows = {}
    for label, (baseline, later, damaged) in inputs.items():
        fitted = (detector or MahalanobisDetector()).fit(baseline)
        rows[label] = {"false alarms": alarms(fitted, later), "damage found": alarms(fitted, damaged)}
    return pd.DataFrame(rows).T


def threshold_table(inputs):
    """The same with other thresholds, and with another detector on whitened residuals."""
    detectors = {kind: MahalanobisDetector(threshold=kind) for kind in ("quantile", "conformal", "chi2")}
    detectors["isolation forest"] = OutlierDetector(IsolationForest(random_state=0))
    whitened = {name: found for (name, label), found in inputs.items() if label == WHITENED}
    tables = {kind: alarm_table(whitened, detector) for kind, detector in detectors.items()}
    return pd.concat(tables, axis=1)


def fused():
    """Two compensators, whose damage indices are averaged."""
    compensators = {
        name: TemperatureCompensator(estimator, targets=FREQUENCIES, scale="local")
        for name, estimator in (("lines", TemperatureMapper()), ("trees", boosting()))
    }
    return FusedDetector([(name, make_pipeline(part, MahalanobisDetector())) for name, part in compensators.items()])


def weather_table(records, inputs):
    """Alarms in percent of records, by the baseline's fifths of the pavement's temperature, and beyond them."""
    pavement = records.baseline[PAVEMENT]
    edges = [-np.inf, *pavement.quantile([0.2, 0.4, 0.6, 0.8, 1.0]), np.inf]
    classes = records.each(lambda frame: pd.cut(frame[PAVEMENT].to_numpy(), edges, precision=1))
    columns = {("records", kind): pd.Series(getattr(classes, kind)).value_counts(sort=False) for kind in KINDS}
    for label in SCALES:
        residuals = inputs["broken lines", label]
        detector = MahalanobisDetector().fit(residuals.baseline)
        for kind in KINDS:
            alarm = pd.Series(detector.predict(getattr(residuals, kind)) == -1)
            columns[label, kind] = 100 * alarm.groupby(getattr(classes, kind), observed=False).mean()
    return pd.DataFrame(columns).rename_axis("pavement, °C")


def found_by_day(inputs):
    """Number of records on each damaged day, and share of them that raise an alarm, in percent."""
    baseline, _, damaged = inputs["broken lines", WHITENED]
    alarm = pd.Series(MahalanobisDetector().fit(baseline).predict(damaged) == -1)
    days = alarm.groupby(damaged.index.floor("D").strftime("%m-%d"))
    return pd.DataFrame({"records": days.size(), "found": 100 * days.mean()}).T


def day_table(records, inputs):
    """Alarms of single records and of a day's records together; a day is judged by its last window."""
    whitened = {name: inputs[name, WHITENED] for name in ("broken lines", "boosted trees")}
    forward = compensate(records, TemperatureMapper(), "local", TimeSeriesSplit(5))[0]
    whitened["broken lines, forward in time"] = forward
    windows = {f"{w}, {rule}": WindowedAlarm(w, rule=rule) for w in ("24h", 24) for rule in ("mean", "m-of-n")}
    rows = {}
    for name, residuals in whitened.items():
        for label, detector in {"single records": MahalanobisDetector(), **windows}.items():
            index = detector.fit(residuals.baseline).damage_index(residuals.stream())
            day = (index > detector.threshold_).groupby(index.index.floor("D")).last()
            healthy = day.index < records.onset.floor("D")
            delay = time_to_detection(index, detector.threshold_, records.onset)
            rows[name, label] = {
                "false days": f"{day[healthy].sum()} of {healthy.sum()}",
                "damaged days found": f"{day[~healthy].sum()} of {(~healthy).sum()}",
                "hours to detection": delay / pd.Timedelta("1h"),
            }
    return pd.DataFrame(rows).T


def season_table(records):
    """Baselines of the first part of the healthy records, and alarms on the fifth of them that follows, in percent."""
    healthy = pd.concat([records.baseline, records.later])
    fifth, rows = len(healthy) // 5, {}
    for share in (0.4, 0.5, 0.6, 0.7):
        n = round(share * len(healthy))
        part = Records(healthy[:n], healthy[n : n + fifth], records.damaged)
        row = {}
        for label, scale in SCALES.items():
            residuals, compensator = compensate(part, TemperatureMapper(), scale)
            detector = MahalanobisDetector().fit(residuals.baseline)
            row[f"false alarms, {label}"] = alarms(detector, residuals.later)
        beyond = (compensator.applicability(part.later) > 0).any(axis=1)
        rows[f"first {share:.0%}"] = {**row, "records beyond known weather": 100 * beyond.mean()}
    return pd.DataFrame(rows).T.rename_axis("baseline")


def plot_kinds(ax, x, y, **style):
    """Records of the baseline, of the hold-out and after damage, in their colours."""
    for kind, (label, colour) in KINDS.items():
        ax.plot(getattr(x, kind), getattr(y, kind), ".", color=colour, label=label, **style)


def plot_spread(records, inputs):
    """Residuals of f2 over temperature, with the standard deviation of all records and that in similar weather."""
    fig, ax = plt.subplots(figsize=(10, 4.6), layout="constrained")
    pavement = records.each(lambda frame: frame[PAVEMENT])
    plot_kinds(ax, pavement, inputs["broken lines", PLAIN].each(lambda frame: frame["f2"]), ms=3)
    degree = pavement.baseline.round()
    for scale, style, label in (
        ("global", "--", "2 deviations, all weather"),
        ("local", "-", "2 deviations, by weather"),
    ):
        compensator = compensate(records, TemperatureMapper(), scale)[1]
        weather = records.baseline.drop(columns=FREQUENCIES)
        deviation = pd.Series(compensator.spread_.deviations(weather)[:, 1], weather.index).groupby(degree).median()
        ax.plot(2 * deviation, style, color="black", label=label)
        ax.plot(-2 * deviation, style, color="black")
    ax.set(xlabel="pavement (°C)", ylabel=f"residual of {MODES[1]} (Hz)")
    fig.legend(loc="outside right upper", markerscale=3)
    return fig


def plot_indices(panels, onset, **options):
    """Damage index over time, a panel for each detector and the records that it sees."""
    indices, thresholds = {}, {}
    for title, (detector, records) in panels.items():
        index = records.each(detector.fit(records.baseline).damage_index)
        indices[title] = {label: getattr(index, kind) for kind, (label, _) in KINDS.items()}
        thresholds[title] = detector.threshold_
    colours = dict(KINDS.values())
    display = DamageIndexDisplay.from_scenarios(indices, thresholds, onset=onset, colours=colours, **options)
    display.axes_[-1].set_xlabel("time, by the hour counter of the records")
    return display.figure_


def show(title, table, digits=1):
    """Print a table below a sentence."""
    print(title, table.round(digits).to_string(), sep="\n\n", end="\n\n")


def main():
    bridge, folder = read_arguments("The Z24 bridge: alarms that see through the weather.")
    warnings.filterwarnings("ignore", r"\d+ of \d+ rows have temperatures far outside")  # the last table counts them
    records = Records.of(bridge)
    print(f"Baseline: {len(records.baseline)} healthy records. Judged: {len(records.later)} later healthy ones and the")
    print(f"{len(records.damaged)} after damage began. Every detector is asked for 2 % false alarms.\n")

    inputs = inputs_of_detectors(records)
    tables = alarm_table(inputs), alarm_table({("lines and trees", "mean of their indices"): records}, fused())
    show("Alarms in percent of the records, by compensator and by what the detector sees:", pd.concat(tables))
    show("The same for whitened residuals, by threshold, and by another detector:", threshold_table(inputs))
    show(
        "Alarms in percent of records, by weather; no baseline record is warmer than the last limit (broken lines):",
        weather_table(records, inputs),
    )
    show("A day's records together; a day is judged by its last window:", day_table(records, inputs))
    show("Damage found by day, in percent of its records (broken lines, whitened):", found_by_day(inputs))
    show("A baseline that lacks a season, in percent (broken lines):", season_table(records))

    mahalanobis = {
        "raw frequencies": inputs["none", "raw frequencies"],
        "residuals of broken lines": inputs["broken lines", PLAIN],
        "the same, whitened by weather": inputs["broken lines", WHITENED],
    }
    windows = {
        title: (WindowedAlarm("24h", rule=rule), inputs["broken lines", WHITENED])
        for rule, title in (("mean", "mean of a day's records"), ("m-of-n", "half of a day's records or more"))
    }
    figures = {
        "z24_detection": plot_indices(
            {title: (MahalanobisDetector(), seen) for title, seen in mahalanobis.items()}, records.onset
        ),
        "z24_days": plot_indices(windows, records.onset, label="damage index of a day"),
        "z24_spread": plot_spread(records, inputs),
    }
    save(figures, folder)


if __name__ == "__main__":
    main()
