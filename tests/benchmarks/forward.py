"""Damage found in another year than the one that was learned, at equal measured false alarms, and at own thresholds.

    OMP_NUM_THREADS=1 python tests/benchmarks/forward.py [--parts truss fleet footbridge soil z24] [--windows none 1D]

- truss, fleet, footbridge, soil: a year is learned, another one evaluated, healthy and damaged. Fleet: six-hourly
  records of three bridges with models that are a little wrong. Footbridge: one with frost, gaps and outliers. Soil: a
  girder whose soil follows the air with 40 days.
- z24: the records after the first 50, 65 and 80 % of its healthy ones are evaluated; damage is a fall of one mode by
  1 %. Its data are in the folder that SKTHERMO_DATA names.

Detectors: `CompensatedDetector` with the directions of a model, with "softening", with the Mahalanobis distance (an
earlier version has pipelines behind `TemperatureCompensator` in their place), and 20 neighbours of raw frequencies.
"""

import numpy as np
import pandas as pd
from harness import arguments, compensated, joined, modes_of, raw, recipes, shown, z24_records
from structures import SOIL_GROUPS, Footbridge, slow_soil

from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.detection import DirectionalDetector, OutlierDetector

RATES = (0.005, 0.01, 0.02)


def detectors(model, targets, window):
    found = {} if model is None else {"directions": compensated(targets, DirectionalDetector(model), window=window)}
    found |= {
        "softening": compensated(targets, DirectionalDetector(), window=window),
        "Mahalanobis": compensated(targets, window=window),
    }
    if window is None:
        neighbours = OutlierDetector(recipes("detector").NeighbourDistance())
        found["20 neighbours, raw"] = raw(targets, neighbours)
    return found


def truss():
    year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    damaged = {
        f"{group} {loss:.0%}": joined(make_truss_campaign(damage={group: loss}, random_state=1))
        for group, loss in (("bottom", 0.05), ("bottom", 0.1), ("top", 0.1), ("diagonal", 0.05))
    }
    yield "truss", make_truss(), joined(year), joined(later), damaged


def fleet():
    for name, bridge in make_fleet(3, random_state=100).items():
        options = {"samples_per_day": 4, "random_state": 1}
        year, later = (bridge.records(365, start, **options) for start in ("2023-01-01", "2024-01-01"))
        damaged = {
            group: joined(bridge.records(365, "2024-01-01", damage={group: 0.05}, **options))
            for group in list(bridge.groups)[:3]
        }
        yield f"fleet {name}", bridge.model, joined(year), joined(later), damaged


def footbridge():
    bridge = Footbridge(3)
    damaged = {group: bridge.evaluated({group: 0.05}) for group in ("side span", "main span", "main stays")}
    yield "footbridge", bridge.model, bridge.training(True), bridge.evaluated({}), damaged


def soil():
    year, later = slow_soil(1, n_days=365), slow_soil(1, "2025-01-01", n_days=365)
    damaged = {group: joined(slow_soil(1, "2025-01-01", n_days=365, damage={group: 0.05})) for group in SOIL_GROUPS[:4]}
    yield "girder on slow soil", year.model, joined(year), joined(later), damaged


def z24():
    (T, F), _ = z24_records()
    records = T.join(F)
    for share in (0.5, 0.65, 0.8):
        n = int(share * len(records))
        damaged = {name: records[n:].assign(**{name: 0.99 * records[name][n:]}) for name in F}
        yield f"Z24 after {share:.0%}", None, records[:n], records[n:], damaged


def measured(part, windows):
    rows = []
    for structure, model, baseline, healthy, damaged in PARTS[part]():
        targets = [name for name in modes_of(baseline) if name in baseline]
        for window in windows:
            for name, detector in detectors(model, targets, window).items():
                detector.fit(baseline)
                index = {key: -detector.score_samples(table) for key, table in {"": healthy, **damaged}.items()}
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
                rows.append(row)
    return pd.DataFrame(rows)


PARTS = {"truss": truss, "fleet": fleet, "footbridge": footbridge, "soil": soil, "z24": z24}


def main():
    options = arguments(__doc__, parts=PARTS, windows=(["none", "1D"], "windows of the residuals"))
    windows = [None if window == "none" else window for window in options.windows]
    for part in options.parts:
        own = [w for w in windows if w is None or part not in ("truss", "z24")]
        shown(
            f"{part}: percent of records in alarm",
            measured(part, own).set_index(["structure", "window", "detector"]),
            1,
        )


if __name__ == "__main__":
    main()
