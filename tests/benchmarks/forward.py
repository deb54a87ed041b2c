"""Damage found in another year than the one that was learned, at equal measured false alarms, and at own thresholds.

    OMP_NUM_THREADS=1 python tests/benchmarks/forward.py [--parts truss fleet footbridge soil girder arch z24]

- truss, fleet, footbridge, soil, girder, arch: a year is learned, a later one evaluated, healthy and damaged. Fleet:
  six-hourly records of bridges with models that are a little wrong, whose later year is the coldest of five.
  Footbridge: one with frost, gaps and outliers. Soil: a girder whose soil follows the air with 40 days. Girder: one
  whose bearings freeze. Arch: one with moisture of 20 days, steel and concrete, and soil of 30 days.
- z24: of its first 2800 healthy records, those after 50, 65 and 80 % are evaluated; damage is a fall of one mode by
  1 %. Its data are in the folder that SKTHERMO_DATA names.

Detectors, of single records and by day:

- directions, softening, Mahalanobis: `CompensatedDetector` with the directions of a model, with "softening", with the
  Mahalanobis distance (an earlier version has pipelines behind `TemperatureCompensator` in their place)
- one regime: the first of these that there is, with ``regimes=None``
- stiffness alone: directions of losses of stiffness, as the damage here is, and as the directions of version 0.2 are
- ridge with lags: ridge regression on squares of temperatures of now, of six hours and of one, three and twelve days
  ago, out of fold by weeks; by day, the median of a day; Mahalanobis distance
- 20 neighbours, raw: of frequencies; by day, of medians of a day

The last table has, by day where records come more often than that, the mean over structures of each detector.
"""

from collections import defaultdict

import numpy as np
import pandas as pd
from harness import arguments, compensated, joined, modes_of, raw, recipes, shown, split, z24_records
from sklearn.covariance import ledoit_wolf
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler
from structures import SOIL_GROUPS, Footbridge, Site, slow_soil

from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.detection import DirectionalDetector, OutlierDetector

RATES = (0.005, 0.01, 0.02)
LAGS = ("0h", "6h", "1D", "3D", "12D")


class RidgeWithLags:
    """Ridge regression on squares of temperatures now and before, the median of a day, the Mahalanobis distance."""

    def __init__(self, window):
        self.window = window

    def fit(self, records):
        T, F = split(records)
        self.history, self.middle, self.centre = records, T.mean(), F.mean()
        X, R = self.inputs(T), np.log(F / self.centre)
        weeks = (T.index - T.index[0]).days.to_numpy() // 7 % 5
        folds = [(np.flatnonzero(weeks != k), np.flatnonzero(weeks == k)) for k in range(5) if (weeks == k).any()]
        left = pd.DataFrame(np.nan, R.index, R.columns)
        self.lines = {}
        for mode in R:
            known = R[mode].notna().to_numpy()
            own = [(np.intersect1d(train, np.flatnonzero(known)), test) for train, test in folds]
            self.lines[mode] = self.line().fit(X[known], R.loc[known, mode])
            for train, test in own:
                left.iloc[test, left.columns.get_loc(mode)] = R[mode].iloc[test] - self.line().fit(
                    X[train], R[mode].iloc[train]
                ).predict(X[test])
        left = self.by_day(left)
        complete = left.dropna().to_numpy()
        middle = np.median(complete, axis=0)
        far = np.abs(complete - middle) > 8 * 1.4826 * np.median(np.abs(complete - middle), axis=0)
        self.mean = complete[~far.any(axis=1)].mean(axis=0)
        self.covariance = ledoit_wolf(complete[~far.any(axis=1)])[0]
        self.level = np.nanquantile(self.distances(left.to_numpy()), 0.98)
        return self

    @staticmethod
    def line():
        return make_pipeline(
            StandardScaler(),
            PolynomialFeatures(2, include_bias=False),
            StandardScaler(),
            RidgeCV(np.logspace(-2, 5, 15)),
        )

    def inputs(self, T):
        earlier = T.fillna(self.middle)
        step = pd.Timedelta(np.median(np.diff(T.index.values)))
        used = [lag for lag in LAGS if lag == "0h" or pd.Timedelta(lag) >= step]
        columns = [earlier.reindex(T.index - pd.Timedelta(lag), method="nearest").to_numpy() for lag in used]
        return np.hstack(columns)

    def by_day(self, left):
        return left if self.window is None else left.rolling(self.window, min_periods=2).median()

    def distances(self, rows):
        """Mahalanobis distances of the modes that are there, as of all of them."""
        found = np.full(len(rows), np.nan)
        masks, pattern = np.unique(~np.isnan(rows), axis=0, return_inverse=True)
        for number, mask in enumerate(masks):
            if mask.any():
                own = np.ravel(pattern) == number
                apart = rows[np.ix_(own, mask)] - self.mean[mask]
                inverse = np.linalg.inv(self.covariance[np.ix_(mask, mask)])
                found[own] = np.sqrt(np.einsum("ij,jk,ik->i", apart, inverse, apart) * len(mask) / mask.sum())
        return found

    def score_samples(self, records):
        T, F = split(records)
        before = self.history[self.history.index < records.index[0]]
        together = pd.concat([split(before)[0], T])
        X = self.inputs(together)[len(before) :]
        left = pd.DataFrame(
            {mode: np.log(F[mode] / self.centre[mode]) - line.predict(X) for mode, line in self.lines.items()}
        )
        return -self.distances(self.by_day(left).to_numpy())

    def predict(self, records):
        index = -self.score_samples(records)
        return np.where(np.isnan(index), 0, np.where(index > self.level, -1, 1))


class RawByDay:
    """An outlier detector of the frequencies themselves; by day, of their medians of a day."""

    def __init__(self, targets, window):
        self.window = window
        neighbours = make_pipeline(StandardScaler(), recipes("detector").NeighbourDistance())
        self.detector = raw(targets, OutlierDetector(neighbours))

    def by_day(self, records):
        return records if self.window is None else records.rolling(self.window, min_periods=2).median()

    def fit(self, records):
        self.detector.fit(self.by_day(records))
        return self

    def score_samples(self, records):
        return self.detector.score_samples(self.by_day(records))

    def predict(self, records):
        return self.detector.predict(self.by_day(records))


def detectors(model, targets, window):
    best = DirectionalDetector() if model is None else DirectionalDetector(model)
    found = {} if model is None else {"directions": compensated(targets, best, window=window)}
    if hasattr(model, "group_mass"):
        alone = DirectionalDetector(model.damage_directions(kind="stiffness"))
        found["stiffness alone"] = compensated(targets, alone, window=window)
    found |= {
        "softening": compensated(targets, DirectionalDetector(), window=window),
        "Mahalanobis": compensated(targets, window=window),
        "one regime": compensated(targets, best, window=window, regimes=None),
        "ridge with lags": RidgeWithLags(window),
        "20 neighbours, raw": RawByDay(targets, window),
    }
    return found


def truss(options):
    year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    damaged = {
        f"{group} {loss:.0%}": joined(make_truss_campaign(damage={group: loss}, random_state=1))
        for group, loss in (("bottom", 0.05), ("bottom", 0.1), ("top", 0.1), ("diagonal", 0.05))
    }
    yield "truss", make_truss(), joined(year), joined(later), damaged


def fleet(options):
    for name, bridge in make_fleet(options.bridges, random_state=100).items():
        of_a_year = {"samples_per_day": 4, "random_state": 1}
        years = {year: bridge.records(365, f"{year}-01-01", **of_a_year) for year in range(2023, 2029)}
        coldest = min(list(years)[1:], key=lambda year: years[year].temperatures.mean().mean())
        damaged = {
            group: joined(bridge.records(365, f"{coldest}-01-01", damage={group: 0.05}, **of_a_year))
            for group in list(bridge.groups)[:3]
        }
        yield f"fleet {name}", bridge.model, joined(years[2023]), joined(years[coldest]), damaged


def footbridge(options):
    bridge = Footbridge(3)
    damaged = {group: bridge.evaluated({group: 0.05}) for group in ("side span", "main span", "main stays")}
    yield "footbridge", bridge.model, bridge.training(True), bridge.evaluated({}), damaged


def soil(options):
    year, later = slow_soil(1, n_days=365), slow_soil(1, "2025-01-01", n_days=365)
    damaged = {group: joined(slow_soil(1, "2025-01-01", n_days=365, damage={group: 0.05})) for group in SOIL_GROUPS[:4]}
    yield "girder on slow soil", year.model, joined(year), joined(later), damaged


def site(name):
    bridge = Site(name)
    damaged = {group: bridge.records(2025, {group: 0.05}) for group in bridge.bridge.groups}
    yield name, bridge.model, bridge.records(2024), bridge.records(2025), damaged


def z24(options):
    (T, F), _ = z24_records()
    records = T.join(F)[:2800]
    for share in (0.5, 0.65, 0.8):
        n = int(share * len(records))
        damaged = {name: records[n:].assign(**{name: 0.99 * records[name][n:]}) for name in F}
        yield f"Z24 after {share:.0%}", None, records[:n], records[n:], damaged


PARTS = {
    "truss": truss,
    "fleet": fleet,
    "footbridge": footbridge,
    "soil": soil,
    "girder": lambda options: site("frozen girder"),
    "arch": lambda options: site("moist arch"),
    "z24": z24,
}


def measured(part, options):
    for structure, model, baseline, healthy, damaged in PARTS[part](options):
        targets = [name for name in modes_of(baseline) if name in baseline]
        for window in (None,) if part == "truss" else (None, "1D"):
            for name, detector in detectors(model, targets, window).items():
                detector.fit(baseline)
                index = {
                    key: -np.asarray(detector.score_samples(table)) for key, table in {"": healthy, **damaged}.items()
                }
                own = index.pop("")
                row = {"structure": structure, "window": window or "", "detector": name}
                for rate in RATES:
                    level = np.nanquantile(own, 1 - rate)
                    row[f"found at {rate:.1%}"] = 100 * np.mean(
                        [np.mean(i[~np.isnan(i)] > level) for i in index.values()]
                    )
                row["own false alarms"] = 100 * np.mean(detector.predict(healthy) == -1)
                row["own found"] = 100 * np.mean([np.mean(detector.predict(table) == -1) for table in damaged.values()])
                row["regime"] = str(getattr(detector, "regime_", None) or "")
                yield row


def main():
    options = arguments(__doc__, parts=PARTS, bridges=(10, "of the fleet"))
    by_detector = defaultdict(list)
    for part in options.parts:
        table = pd.DataFrame(measured(part, options)).set_index(["structure", "window", "detector"])
        shown(f"{part}: percent of records in alarm", table, 1)
        last = table.xs(table.index.get_level_values("window")[-1], level="window").drop(columns="regime")
        means = last.groupby("detector", sort=False).mean()
        for missing in {"directions", "stiffness alone"} - {*means.index}:  # no model: the default
            means.loc[missing] = means.loc["softening"]
        for name, row in means.iterrows():
            by_detector[name].append(row)
    overall = pd.DataFrame({name: pd.DataFrame(rows).mean() for name, rows in by_detector.items()}).T
    shown("mean over structures, by day: percent of records in alarm", overall.rename_axis("detector"), 1)


if __name__ == "__main__":
    main()
