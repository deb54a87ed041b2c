"""Months of later years that `identify_damage` takes for healthy or damaged, where the weather lasts.

    OMP_NUM_THREADS=1 python tests/benchmarks/identified_months.py
    OMP_NUM_THREADS=1 python tests/benchmarks/identified_months.py --structures soil --seeds 2

The records are those of slow_changes.py: five years, six-hourly, of bridges of the synthetic fleet, girders on slow
soil and arches with moisture; no sensor measures soil or moisture. A chain learns the first year. Of the other four,
every third month is explained, healthy and with a loss of stiffness of one group, another one each month, with the
temperatures before it.

The exit code is 1 if more than 8 % of healthy months have a p value of at most 0.05.
"""

import sys

import numpy as np
import pandas as pd
from harness import arguments, is_missed, shown, split
from slow_changes import DAY, STRUCTURES

from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM

LOSS, BEFORE, MONTH, STEP = 0.02, 120 * DAY, 30 * DAY, 91 * DAY


def explained(name, seed):
    """A row of every month that is explained."""
    records, model = STRUCTURES[name](seed)
    end = records.index[0] + 365 * DAY
    fem = DataInformedFEM(model, random_state=0).fit(*split(records[records.index < end]))
    effects, rows = model.damage_directions(kind="stiffness"), []
    for number, start in enumerate(pd.date_range(end, records.index[-1] - MONTH, freq=STEP)):
        T, F = split(records[(records.index >= start - BEFORE) & (records.index < start + MONTH)])
        F[F.index < start] = np.nan
        group = effects.index[number % len(effects)]
        healthy = identify_damage(fem, T, F, random_state=0)
        damaged = identify_damage(fem, T, F * (1 + LOSS * effects.loc[group].to_numpy()), random_state=0)
        row = {"healthy, p at most .05": healthy.p_value <= 0.05, "healthy, none named": healthy.most_probable == ()}
        row |= {"loss, p at most .05": damaged.p_value <= 0.05, "loss, its group named": group in damaged.most_probable}
        rows.append(row)
    return rows


def main():
    options = arguments(__doc__, structures=(dict(STRUCTURES), "which"), seeds=6)
    found = {
        name: [row for seed in range(options.seeds) for row in explained(name, seed)] for name in options.structures
    }
    table = pd.DataFrame({name: 100 * pd.DataFrame(rows).mean() for name, rows in found.items()}).T
    table["months"] = [len(rows) for rows in found.values()]
    shown(f"Months by identify_damage, healthy and with a loss of {100 * LOSS:.0f} % in a group, in percent", table, 0)
    share = np.average(table["healthy, p at most .05"], weights=table["months"])
    return int(is_missed("% of healthy months with a p value of at most .05", float(share), "<= 8"))


if __name__ == "__main__":
    sys.exit(main())
