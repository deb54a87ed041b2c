"""Z24's and a tower's last fifth of healthy records, predicted by the recipes and the page of the examples.

OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/later_weather.py
"""

import contextlib
import io
import runpy
import sys
from unittest import mock

import pandas as pd
from harness import DATA, EXAMPLES, arguments, recipes, shown

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


def main():
    arguments(__doc__)
    z24 = recipes("z24")
    bridge = z24.Bridge(DATA / "z24" / "z24_monitoring.csv")
    T, F, T_test, F_test = bridge.split()
    errors = z24.hold_out_table(bridge, ways=(True,)).rename(index=WAYS).drop(columns="ratio")
    shown(f"Z24, {len(T)} records to learn from: error in the {len(T_test)} later ones, %", errors)
    lowest, highest = z24.chain(z24.bridge_model()).fit(T, F).predict_interval(T_test)
    held = {f"Z24, {mode}": share for mode, share in (100 * ((lowest < F_test) & (F_test < highest)).mean()).items()}
    (n_train, n_later), errors, share = tower(DATA / "tower" / "tower.csv")
    title = f"A tower, {n_train} records to learn from: error in the {n_later} later ones, %"
    shown(title, errors.rename(index=WAYS))
    shown("Later frequencies in intervals of 90 %, %", pd.DataFrame([held | {"tower": 100 * share}], ["share"]), 0)


if __name__ == "__main__":
    main()
