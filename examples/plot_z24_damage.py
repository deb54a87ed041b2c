"""
Z24: where the damage is, and what a simulation would have told
===============================================================

``plot_z24_detection.py`` finds the damage that was done to the Z24 bridge. Here the detector looks at parameters of an
FE model in place of frequencies, and the parameter that changes says where. Then damage is put into the FE model, to
see whether a detector's alarms on simulated records are like those on measured ones.

The data belong to KU Leuven and are not part of this package. Run the example with the folder or the file
that holds them: ``python examples/plot_z24_damage.py path/to/z24_monitoring.csv``, or set
``SKTHERMO_DATA``. Figures go to the folder ``figures``.
"""

import warnings

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from plot_z24_bridge import BLUE, GREY, MODES, ORANGE, boosting, bridge_model, chain, read_arguments, save
from plot_z24_detection import (
    FREQUENCIES,
    PAVEMENT,
    SCALES,
    Records,
    alarm_table,
    alarms,
    compensate,
    plot_kinds,
    show,
)
from scipy.optimize import brentq
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import make_pipeline

from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import InverseSurrogate, TemperatureMapper

FROST = 2.0  # pavement below this, in degrees Celsius, may hold ice
GROUP = "piers_soil"


def in_parameters(records):
    """The records with multipliers of the FE model in place of frequencies, and the names of these."""
    model = bridge_model()
    inverse = InverseSurrogate(model, bounds=0.5, noise=0.005, random_state=0)
    others = [column for column in records.baseline if column not in FREQUENCIES]
    to_parameters = ColumnTransformer(
        [
            ("temperatures", "passthrough", others),
            ("parameters", make_pipeline(BiasAligner(model, method="scale"), inverse), FREQUENCIES),
        ],
        verbose_feature_names_out=False,
    ).set_output(transform="pandas")
    return records.each(to_parameters.fit(records.baseline).transform), list(model.parameter_names)


def changes(measured, names):
    """Change of every parameter from the compensator's prediction, in percent: means of days."""
    residuals, _ = compensate(measured, TemperatureMapper(), targets=names)
    relative = (100 * r / (m[names] - r) for m, r in zip(measured, residuals, strict=True))
    return Records(*(frame.groupby(frame.index.floor("D")).mean() for frame in relative))


def change_table(measured, names):
    """Changes of the parameters on damaged days, beside the scatter of healthy days."""
    days = changes(measured, names)
    frozen = measured.baseline[PAVEMENT].groupby(measured.baseline.index.floor("D")).mean() < FROST
    scatter = {
        "scatter, frosty days": days.baseline[frozen].std(),
        "scatter, other days": days.baseline[~frozen].std(),
        "mean, hold-out days": days.later.mean(),
    }
    damaged = days.damaged.set_axis(days.damaged.index.strftime("damaged, %d %b"))
    return pd.concat([pd.DataFrame(scatter).T, damaged]), days, scatter["scatter, other days"]


class Damage:
    """The bridge's last month, simulated: the severity is fitted to the mean drop of f2 and to nothing else.

    The chain learns from all healthy records, as it stands for the bridge here.
    """

    def __init__(self, bridge):
        self.bridge = bridge
        self.fem = chain(bridge_model()).fit(bridge.T, bridge.F)
        self.expected = self.fem.predict(bridge.T_damaged)
        self.measured_drop = self.mean_drop(bridge.F_damaged)
        self.severity = brentq(lambda s: (self.mean_drop(self.simulate(s)) - self.measured_drop)["f2"], 0.0, 0.9)
        self.simulated_drop = self.mean_drop(self.simulate(self.severity))

    def simulate(self, severity, **noise):
        """Frequencies of the damaged bridge, in the weather of its last month."""
        return self.fem.simulate(self.bridge.T_damaged, damage={GROUP: severity}, **noise)

    def mean_drop(self, frequencies):
        """Mean change of every mode, in percent of the healthy prediction at the same temperatures."""
        return 100 * (frequencies / self.expected - 1).mean()

    def records(self, records, seed):
        """The records that are judged, simulated with noise like that of the measured ones."""
        T = self.bridge.split()[2]
        healthy = self.fem.simulate(T, noise="fitted", random_state=seed)
        damaged = self.simulate(self.severity, noise="fitted", random_state=seed + 1000)
        return Records(records.baseline, T.join(healthy), self.bridge.T_damaged.join(damaged))


def simulation_table(records, damage, n_draws=10):
    """Alarms on measured records and on simulated ones, in percent; the baseline is measured in both."""
    draws = [damage.records(records, seed) for seed in range(n_draws)]
    rows = {}
    for name, estimator in (("broken lines", TemperatureMapper()), ("boosted trees", boosting())):
        for label, scale in SCALES.items():
            residuals, compensator = compensate(records, estimator, scale)
            detector = MahalanobisDetector().fit(residuals.baseline)
            simulated = [draw.each(compensator.transform, residuals.baseline) for draw in draws]
            rows[name, label] = {
                (state, source): np.mean([alarms(detector, getattr(draw, kind)) for draw in among])
                for state, kind in (("false alarms", "later"), ("damage found", "damaged"))
                for source, among in (("measured", [residuals]), ("simulated", simulated))
            }
    return pd.DataFrame(rows).T


def plot_changes(days, scatter):
    """Change of every parameter by day; bars are two standard deviations of the baseline's days without frost."""
    fig, axes = plt.subplots(4, 1, figsize=(10, 8), sharex=True, sharey=True, layout="constrained")
    for ax, name in zip(axes, days.baseline, strict=True):
        values = days.each(lambda frame, name=name: frame[name])
        plot_kinds(ax, days.each(lambda frame: frame.index), values)
        for kind in (values.later, values.damaged):
            ax.errorbar(kind.index, kind, 2 * scatter[name], fmt="none", ecolor=GREY, elinewidth=1, zorder=0)
        ax.axhline(0, color="black", lw=0.7)
        ax.set_ylabel(f"{name.replace('_', ' ')}\n(%)")
    axes[-1].set_xlabel("day, by the hour counter of the records")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)
    return fig


def plot_drops(damage):
    """Effect of damage on each mode; only f2 was fitted."""
    fig, ax = plt.subplots(figsize=(6.5, 3.8), layout="constrained")
    places = np.arange(4)
    ax.bar(places - 0.2, damage.measured_drop, width=0.4, color=BLUE, label="measured")
    ax.bar(places + 0.2, damage.simulated_drop, width=0.4, color=ORANGE, label="simulated, fitted to $f_2$")
    ax.axhline(0, color="black", lw=0.7)
    ax.set_xticks(places, MODES)
    ax.set_ylabel("mean change of frequency (%)")
    ax.legend()
    return fig


def main():
    bridge, folder = read_arguments("The Z24 bridge: where the damage is, measured and simulated.")
    warnings.filterwarnings("ignore", r"\d+ of \d+ rows have temperatures far outside")
    records = Records.of(bridge)
    measured, names = in_parameters(records)
    residuals = {
        ("broken lines", label): compensate(measured, TemperatureMapper(), scale, targets=names)[0]
        for label, scale in SCALES.items()
    }
    show("Alarms in percent, where the detector sees parameters in place of frequencies:", alarm_table(residuals))
    table, days, scatter = change_table(measured, names)
    show("Change of every parameter in percent of its prediction, means of days:", table)

    damage = Damage(bridge)
    drops = pd.DataFrame({"measured": damage.measured_drop, "simulated": damage.simulated_drop}).T
    show(
        f"Damage of {damage.severity:.1%} in {GROUP}, fitted to the mean drop of f2; mean change in percent:", drops, 2
    )
    show("Alarms in percent on measured and on simulated records (10 draws):", simulation_table(records, damage))
    save({"z24_changes": plot_changes(days, scatter), "z24_damage": plot_drops(damage)}, folder)


if __name__ == "__main__":
    main()
