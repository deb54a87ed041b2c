"""The chain on the Z24 bridge against direct regression: later records, unknown weather, intervals, false alarms, time.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/z24_hold_out.py

The first four fifths of the healthy records train, the last fifth tests, without shuffling. The data belong to KU
Leuven; ``python -m tests.examples.frozen_bridge z24.csv`` writes a synthetic stand-in.
"""

import argparse
import os
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.ensemble import ExtraTreesRegressor, GradientBoostingRegressor
from sklearn.multioutput import MultiOutputRegressor

from skthermo.datasets import load_z24, make_z24
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from skthermo.surrogate._networks import default_network

REGRESSORS = {
    "default (broken lines)": None,
    "network": default_network(),
    "gradient boosting": MultiOutputRegressor(GradientBoostingRegressor()),
    "extra trees": ExtraTreesRegressor(),
}
SETTINGS = [(bounds, noise) for bounds in (0.3, 0.5) for noise in (0.0, 0.01)]
BOOSTING = MultiOutputRegressor(GradientBoostingRegressor(random_state=0))
PAVEMENT = "TP"


class Records:
    """Healthy records in order of time, and their split."""

    def __init__(self, path):
        file = next(path.rglob("z24_monitoring.csv")) if path.is_dir() else path
        data = load_z24(file)
        healthy = (data.state == "undamaged").to_numpy()
        self.T, self.F = data.temperatures[healthy], data.frequencies[healthy]
        self.model = make_z24().reduced([[0.4, 4.0]] * 4, random_state=0)
        later = np.arange(len(self.T)) >= 4 * len(self.T) // 5
        self.T_train, self.F_train, self.T_test, self.F_test = self.without(later)

    def without(self, test):
        """Temperatures and frequencies to train on, and those of the rows held out."""
        return self.T[~test], self.F[~test], self.T[test], self.F[test]

    def chain(self, seed=0, **parts):
        """The chain, with the model's frequencies scaled to the measured ones."""
        return DataInformedFEM(self.model, aligner=BiasAligner(self.model, method="scale"), random_state=seed, **parts)

    def tenths(self):
        """Masks of the tenths of the records with the coldest and the hottest pavement."""
        rank = self.T[PAVEMENT].rank(pct=True).to_numpy()
        return {"coldest": rank <= 0.1, "hottest": rank > 0.9}


def hold_out_errors(records, regressor, seed):
    """Mean error over modes on later records, %: directly from temperatures, and by the chain in every setting."""
    T, F, T_test, F_test = records.T_train, records.F_train, records.T_test, records.F_test
    mapper = TemperatureMapper(regressor, random_state=seed)
    errors = {"direct": mape(F_test, mapper.fit(T, F).predict(T_test)).mean()}
    for bounds, noise in SETTINGS:
        fem = records.chain(seed, inverse=InverseSurrogate(bounds=bounds, noise=noise), mapper=mapper)
        errors[bounds, noise] = mape(F_test, fem.fit(T, F).predict(T_test)).mean()
    return errors


def print_ratios(records, names, n_seeds):
    """Errors of the chain over those of direct regression."""
    rows = {}
    for name in names:
        errors = pd.DataFrame([hold_out_errors(records, REGRESSORS[name], seed) for seed in range(n_seeds)])
        for setting in SETTINGS:
            ratio = errors[setting] / errors["direct"]
            direct = errors["direct"]
            means = direct.mean(), errors[setting].mean()
            rows[name, *setting] = [*means, ratio.mean(), ratio.max(), ratio.min(), direct.max() / direct.mean()]
    columns = ["direct, %", "chain, %", "mean ratio", "worst", "best", "worst direct to its mean"]
    table = pd.DataFrame(rows, columns).T
    table.index.names = ["M2 and direct regression by", "bounds", "noise"]
    print(f"errors on the last {len(records.T_test)} of {len(records.T)} healthy records, means of {n_seeds} seeds\n")
    print(table.round(3).to_string(), end="\n\n")
    for name, part in table.groupby(level=0, sort=False):
        print(f"{name}: largest mean ratio over settings, at most 1.01: {part['mean ratio'].max():.3f}")
        print(f"{name}: largest ratio of any seed, at most 1.03: {part['worst'].max():.3f}")


def print_tenths(records):
    """Errors in weather that was held out, beside those of the mean of the training records."""
    for name, rows in records.tenths().items():
        T, F, T_test, F_test = records.without(rows)
        error = mape(F_test, records.chain().fit(T, F).predict(T_test))
        constant = mape(F_test, np.tile(F.mean(), (len(F_test), 1)))
        print(f"{name} tenth held out, error of the chain, % by mode: {listed(error)}, mean {error.mean():.2f}")
        print(f"  of the training mean: {listed(constant)}, mean {constant.mean():.2f}")
        print(f"  modes in which the chain is worse, none: {(error > constant).sum()}")


def print_coverage(records, fem):
    """Share of later frequencies that the intervals hold."""
    lowest, highest = fem.predict_interval(records.T_test)
    held = ((records.F_test > lowest) & (records.F_test < highest)).mean()
    print(f"coverage of 90 % intervals on later records, 85 to 95 %, by mode: {listed(100 * held, 1)}")
    width = ((highest - lowest) / 2 / records.F_test).mean()
    print(f"  mean half-width, % of the frequency: {listed(100 * width)}; mean coverage {100 * held.mean():.1f}")


def false_alarms(records, fem, regressor, n_draws):
    """Rates on later records, %, at the threshold of the training records: measured, simulated, without noise."""
    T, F, T_test = records.T_train, records.F_train, records.T_test
    baseline, compensator = F, None
    if regressor is not None:
        compensator = TemperatureCompensator(regressor, targets=list(F))
        baseline = compensator.fit_transform(T.join(F))
    detector = MahalanobisDetector(threshold="quantile").fit(baseline)

    def rate(frequencies):
        read = frequencies if compensator is None else compensator.transform(T_test.join(frequencies))
        return 100 * (detector.damage_index(read) > detector.threshold_).mean()

    draws = [rate(fem.simulate(T_test, noise="fitted", random_state=seed)) for seed in range(n_draws)]
    measured = rate(records.F_test)
    return [measured, np.mean(draws), np.std(draws), rate(fem.predict(T_test)), abs(np.mean(draws) - measured)]


def print_false_alarms(records, fem, n_draws):
    """False alarms on later records by kind of index and by the chain's regressor."""
    boosted = records.chain(mapper=TemperatureMapper(BOOSTING)).fit(records.T_train, records.F_train)
    rows = {
        (index, mapper): false_alarms(records, chain, regressor, n_draws)
        for index, regressor in {
            "raw": None,
            "compensated by boosting": BOOSTING,
            "compensated by broken lines": TemperatureMapper(),
        }.items()
        for mapper, chain in {"broken lines (default)": fem, "boosting": boosted}.items()
    }
    columns = ["measured", "simulated", "deviation of draws", "without noise", "difference"]
    table = pd.DataFrame(rows, columns).T
    table.index.names = ["frequencies", "chain with"]
    print(f"false alarms on later records, %; simulated with fitted noise, mean of {n_draws} draws")
    print(table.round(1).to_string())
    for (index, mapper), difference in table["difference"].items():
        print(f"difference in points, at most 2, {index} frequencies, chain with {mapper}: {difference:.1f}")


def print_time(records):
    """Seconds with default settings and the reduced model, from the full model on."""
    model = make_z24()
    fem = DataInformedFEM(model, aligner=BiasAligner(model, method="scale"), reduce=True, random_state=0)
    start = time.perf_counter()
    fem.fit(records.T_train, records.F_train)
    fitted = time.perf_counter()
    fem.predict(records.T_test)
    total = time.perf_counter() - start
    print(f"fit on {len(records.T_train)} records and prediction of {len(records.T_test)}, s, under 10: {total:.1f}")
    print(f"  of which the fit: {fitted - start:.1f}")


def listed(values, digits=2):
    return ", ".join(f"{value:.{digits}f}" for value in values)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path, nargs="?", default=os.environ.get("SKTHERMO_DATA"), help="file or folder")
    parser.add_argument("--seeds", type=int, default=5)
    parser.add_argument("--draws", type=int, default=20, help="draws of fitted noise")
    parser.add_argument("--regressors", nargs="*", default=[*REGRESSORS], help=f"some of {[*REGRESSORS]}, or none")
    options = parser.parse_args()
    if options.data is None:
        parser.error("no data: pass the path of z24_monitoring.csv or of its folder, or set SKTHERMO_DATA")
    warnings.filterwarnings("ignore", r".*(far outside|change their order|did not converge|outside the box)")
    records = Records(Path(options.data))
    print_time(records)
    print_tenths(records)
    fem = records.chain().fit(records.T_train, records.F_train)
    print_coverage(records, fem)
    print_false_alarms(records, fem, options.draws)
    if options.regressors:
        print()
        print_ratios(records, options.regressors, options.seeds)


if __name__ == "__main__":
    main()
