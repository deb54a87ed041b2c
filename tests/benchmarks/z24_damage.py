"""What is damaged on the Z24 bridge, by its records, and which parameters of the model change.

    OMP_NUM_THREADS=1 python tests/benchmarks/z24_damage.py [DATA]

DATA is the file or folder of Z24, by default the folder that SKTHERMO_DATA names. The recipes are those of
``examples/plot_z24_damage.py``. The exit code is 1 if the soil under the piers, where the damage was done, is not the
group that is most probably damaged.
"""

import sys
from pathlib import Path

import pandas as pd
from explained_damage import least_squares
from harness import arguments, recipes, shown

damage, z24 = map(recipes, ("z24_damage", "z24"))
N_EXPLANATIONS = 6


def alarms(records, targets):
    """False alarms and damage found by the Mahalanobis distance of residuals."""
    return z24.alarm_table(records, {"": z24.compensated(targets=targets)}).iloc[0]


def parameters(measured, names):
    """Changes of means of days beside their scatter on healthy days without frost, in percent."""
    days = damage.changes(measured, names)
    T = measured.baseline[z24.PAVEMENT]
    frozen = T.groupby(T.index.floor("D")).mean() < damage.FROST
    values = {f"damaged day {number}": days.damaged.iloc[number - 1] for number in (1, 2, 3)}
    values[f"days 4 to {len(days.damaged)}, mean"] = days.damaged[3:].mean()
    values["scatter of healthy days"] = days.baseline[~frozen].std()
    return pd.DataFrame(values).rename_axis("parameter")


def main():
    options = arguments(__doc__, folder=Path)
    bridge = z24.Bridge(z24.find(options.folder))
    fem, found = damage.identify(bridge)
    simple = least_squares(
        fem.model, (bridge.T, bridge.F), (bridge.T_damaged, bridge.F_damaged), list(found.table.index)
    )
    table = 100 * found.table[["probability", "severity", "ci_low", "ci_high", "if_damaged"]]
    table.columns = ["probability of damage", "mean loss", "band of 90 %, lowest", "highest", "loss if damaged"]
    table["by least squares"] = ["damaged" if group in simple else "" for group in table.index]
    worth = "{compared:.0f} of {given:.0f} records, worth {independent:.0f}".format(**found.records)
    shown(
        f"Z24: damage of each group, averaged over all explanations, %; {worth} independent ones",
        table.rename_axis("group"),
        0,
    )
    explanations = 100 * found.explanations["probability"].rename("probability, %")
    shown("Z24: most probable explanations", explanations[:N_EXPLANATIONS].to_frame().rename_axis("damaged"), 0)
    shifts = (100 * found.shifts[["measured", "explained", "standard_error"]]).rename_axis("mode")
    shown("Z24: mean shifts, %", shifts.rename(columns={"standard_error": "standard error"}))
    print(found.summary())
    records = z24.Records.of(bridge)
    measured, names = damage.in_parameters(records)
    shown("Z24: parameters from each record, change of day means, %", parameters(measured, names), 1)
    both = {"four parameters": alarms(measured, names), "four frequencies": alarms(records, z24.FREQUENCIES)}
    shown("Z24: alarms of a detector, %", pd.DataFrame(both).T.rename_axis("of"), 1)
    return int(found.table["probability"].idxmax() != "soil")


if __name__ == "__main__":
    sys.exit(main())
