"""Z24's and a tower's last fifth of healthy records, predicted by the recipes and the page of the examples.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/later_weather.py

The exit code is 1 if a chain of Z24 errs by more than 0.62 % or by 1 % more than the same regression without a model,
or the tower's chain by more than the mean of its training records, or by a fifth more than the regression.
"""

import contextlib
import io
import runpy
import sys
from unittest import mock

import pandas as pd
from harness import DATA, EXAMPLES, arguments, is_missed, recipes, shown

WAYS = {
    "piecewise-linear, T to F": "piecewise-linear regression, without an FE model",
    "piecewise-linear, chain, tracked": "chain with piecewise-linear regression (default)",
    "boosted trees, T to F": "boosted trees, without an FE model",
    "boosted trees, chain, tracked": "chain with boosted trees",
    "chain": "chain of four stiffnesses with ridge regression",
    "ridge, T to F": "ridge regression, without an FE model",
    "training mean": "mean of the training records",
}


def tower(log):
    """Numbers of records, errors by way and mode, the share of later frequencies in their intervals: of the page."""
    page = str(EXAMPLES / "plot_your_own_structure.py")
    with mock.patch.object(sys, "argv", [page, str(log)]), contextlib.redirect_stdout(io.StringIO()):
        found = runpy.run_path(page)
    n_train, n_records = found["n_train"], len(found["history"])
    return (n_train, n_records - n_train), found["errors"], found["held"].mean()


def targets(of_z24, of_tower):
    """What was found, and its limit."""
    ratios = of_z24["ratio"].drop(["piecewise-linear, T to F", "boosted trees, T to F"])
    yield "error of two chains over that of a direct regression, largest", ratios.max(), "<= 1.01"
    yield "error, piecewise-linear, %", of_z24["mean"]["piecewise-linear, chain, tracked"], "<= 0.62"
    over_mean = of_tower.loc["chain"] / of_tower.loc["training mean"]
    yield "tower, error over that of the training mean, largest", over_mean.max(), "<= 1"
    yield "tower, error over that of ridge", of_tower["mean"]["chain"] / of_tower["mean"]["ridge, T to F"], "<= 1.2"


def main():
    arguments(__doc__)
    z24 = recipes("z24")
    bridge = z24.Bridge(DATA / "z24" / "z24_monitoring.csv")
    T, F, T_test, F_test = bridge.split()
    of_z24 = z24.hold_out_table(bridge, ways=(True,))
    title = f"Z24, {len(T)} records to learn from: error in the {len(T_test)} later ones, %"
    shown(title, of_z24.rename(index=WAYS).drop(columns="ratio"))
    lowest, highest = z24.chain(z24.bridge_model()).fit(T, F).predict_interval(T_test)
    held = {f"Z24, {mode}": share for mode, share in (100 * ((lowest < F_test) & (F_test < highest)).mean()).items()}
    (n_train, n_later), of_tower, share = tower(DATA / "tower" / "tower.csv")
    title = f"A tower, {n_train} records to learn from: error in the {n_later} later ones, %"
    shown(title, of_tower.rename(index=WAYS))
    shown("Later frequencies in intervals of 90 %, %", pd.DataFrame([held | {"tower": 100 * share}], ["share"]), 0)
    return int(sum(is_missed(*target) for target in targets(of_z24, of_tower)) > 0)


if __name__ == "__main__":
    sys.exit(main())
