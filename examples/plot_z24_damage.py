"""
Z24: where the damage is, and what a simulation would have told
===============================================================

``plot_z24_detection.py`` finds the damage that was done to the Z24 bridge. Here the detector looks at parameters of an
FE model in place of frequencies, and the parameter that changes says where. Then the damage that explains the shift of
all four modes is identified, with its uncertainty, and put into the FE model: the rates of alarms that a simulation
promises stand beside the measured ones.

The data belong to KU Leuven and are not part of this package. Run the example with the folder or the file
that holds them: ``python examples/plot_z24_damage.py path/to/z24_monitoring.csv``, or set
``SKTHERMO_DATA``. Figures go to the folder ``figures``.
"""

import warnings

import matplotlib.pyplot as plt
import pandas as pd
from plot_z24_bridge import GREY, boosting, bridge_model, chain, read_arguments, save
from plot_z24_detection import FREQUENCIES, PAVEMENT, SCALES, Records, alarm_table, compensate, plot_kinds, show
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import Pipeline, make_pipeline

from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.plotting import IdentifiedDamageDisplay
from skthermo.preprocessing import BiasAligner
from skthermo.studies import DetectabilityStudy, Scenario, identify_damage
from skthermo.surrogate import InverseSurrogate, TemperatureMapper

FROST = 2.0  # pavement below this, in degrees Celsius, may hold ice


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


def identify(bridge):
    """Chain of all healthy records, as it stands for the bridge here, and the damage that explains its last month."""
    fem = chain(bridge_model()).fit(bridge.T, bridge.F)
    return fem, identify_damage(fem, bridge.T_damaged, bridge.F_damaged, random_state=0)


def detectors():
    """Detectors by what they see: raw frequencies, as in the paper, or residuals of two compensators."""
    found = {"raw frequencies": MahalanobisDetector()}
    for name, estimator in (("broken lines", TemperatureMapper()), ("boosted trees", boosting())):
        for label, scale in SCALES.items():
            compensator = TemperatureCompensator(estimator, targets=FREQUENCIES, scale=scale)
            found[f"{name}, {label}"] = make_pipeline(compensator, MahalanobisDetector())
    return found


def simulation_table(bridge, records, fem, found, names=None, n_repeats=40):
    """Alarms on measured records, and the band of simulated ones, in percent; the baseline is measured in both."""
    later = bridge.split()[2]
    states = {
        "false alarms": (later, Scenario("healthy"), records.later),
        "damage found": (bridge.T_damaged, found.scenario("damaged"), records.damaged),
    }
    rows = {}
    for name in names or detectors():
        detector = detectors()[name]
        for state, (weather, scenario, measured) in states.items():
            study = DetectabilityStudy(fem, detector, [scenario], n_repeats=n_repeats, random_state=0)
            sees = list(records.baseline) if isinstance(detector, Pipeline) else FREQUENCIES
            results = study.run(weather, records.baseline[sees], reference={scenario.name: measured[sees]})
            simulated, true = (
                row for _, row in results.set_index("source").loc[["data-informed", "reference"]].iterrows()
            )
            rows[state, name] = {
                "measured": true["rate"],
                "simulated": simulated["rate"],
                "lowest": simulated["band_lowest"],
                "highest": simulated["band_highest"],
            }
    return 100 * pd.DataFrame(rows).T


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

    fem, found = identify(bridge)
    print(found.summary(), end="\n\n")
    show("Severities of the groups:", found.table, 3)
    show(
        "Mean shift of every mode in percent, measured and explained:", 100 * found.shifts.drop(columns="n_records"), 2
    )
    show(
        "Alarms in percent, measured and simulated (mean and band of 40 draws of damage and noise):",
        simulation_table(bridge, records, fem, found),
    )
    damage = IdentifiedDamageDisplay.from_predictions(found)
    save({"z24_changes": plot_changes(days, scatter), "z24_damage": damage.figure_}, folder)


if __name__ == "__main__":
    main()
