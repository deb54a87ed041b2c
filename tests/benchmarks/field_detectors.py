"""False alarms of the field's detectors, and what they find, on the bridge Z24 and where the truth is known.

    OMP_NUM_THREADS=1 python tests/benchmarks/field_detectors.py [--parts z24 seasons years frost] [--seeds 4]

- z24: the last fifth of the healthy records, and the damaged ones. Detectors of raw frequencies leave out days for
  their thresholds or, by default, five correlation times. SKTHERMO_DATA names the folder of data.
- seasons: the same after baselines that end earlier, on the fifth of the healthy records that follows.
- years: the truss day by day, with noise that is independent or has a correlation of 0.9 from day to day. Its weather
  repeats, is colder in the evaluated year, or the baseline ends after the warm half of its year.
- frost: two-hourly records of a footbridge whose deck freezes; the first year is learned, the second evaluated.

The exit code is 1 if a detector raises more false alarms than asked, and sampling error, where weather repeats and the
noise is independent.
"""

import sys

import numpy as np
import pandas as pd
from harness import DATA, arguments, autoregression, compensated, modes_of, recipes, shown
from structures import Footbridge, lagged

from skthermo.datasets import make_truss_campaign, make_z24, steel_modulus
from skthermo.detection import DirectionalDetector
from skthermo.surrogate import TemperatureMapper

field_detectors = recipes("detector").field_detectors

ASKED, SLACK = 2.0, 0.3
NOISE, DAMAGE = 0.01, {"bottom": 0.2}
HALF = 182  # days, in which the season is warm


def default_residuals(targets, model):
    """Detectors as a user takes them by default, with regimes where the scatter changes."""
    return {
        "directions of the FE model": compensated(targets, DirectionalDetector(model)),
        "falls, no model": compensated(targets, DirectionalDetector()),
        "Mahalanobis": compensated(targets),
    }


def z24_records():
    z24 = recipes("z24")
    return z24.Records.of(z24.Bridge(z24.find(DATA)))


def z24(_):
    recipe = recipes("z24_detector")
    records, candidates = z24_records(), recipe.detectors()
    known = default_residuals(recipe.FREQUENCIES, make_z24()) | candidates
    table = recipe.measured_table(records, known).add_suffix(", %")
    by_default = field_detectors(recipe.FREQUENCIES).items()
    found = recipe.measured_table(records, {name: one for name, one in by_default if name.startswith("raw")})
    table["default blocks, false alarms, %"] = found["false alarms"]
    table["default blocks, found of 130, %"] = found["found of 130"]
    shown("Z24: alarms among 560 later healthy and 130 damaged records", table.rename_axis("detector"), 1)
    return 0


def seasons(_):
    recipe = recipes("z24_detector")
    names = ["piecewise-linear", "piecewise-linear, regimes", "raw, 20 neighbours", "raw, isolation forest"]
    candidates = {name: one for name, one in recipe.detectors().items() if name in names}
    known = default_residuals(recipe.FREQUENCIES, make_z24()) | candidates
    table = recipe.short_baselines(z24_records(), known).rename_axis("detector")
    of = {
        "false alarms": "false alarms in the fifth of the healthy records that follows",
        "damage found": "damage found",
    }
    for what, words in of.items():
        columns = table[what].rename(columns=lambda name: f"{name[:-1]} %")
        shown(f"Z24, baselines of the first part of the healthy records: {words}, %", columns, 1)
    return 0


def year(seed, damage=None, memory=0.0, colder=0.0, n_years=1):
    """Temperatures beside frequencies."""
    clean = make_truss_campaign(n_years, noise=0, random_state=seed)
    noise = autoregression(np.random.default_rng(seed), clean.frequencies.shape, memory, 200)
    T = clean.temperatures - colder
    F = clean.model.damaged(damage or {}).frequencies(steel_modulus(T)) * (1 + NOISE * noise)
    return T.join(pd.DataFrame(F, T.index, clean.frequencies.columns)), clean.model


def daily(seed, memory=0.0, colder=0.0, half=False, n_years=1):
    """Baseline, later healthy records, damaged ones, and the model."""
    (baseline, model), (healthy, _), (damaged, _) = (
        year(4 * seed + i, damage, memory, colder if i else 0.0, 1 if i else n_years)
        for i, damage in enumerate((None, None, DAMAGE))
    )
    return (baseline[:HALF], healthy[HALF:], damaged[HALF:], model) if half else (baseline, healthy, damaged, model)


CASES = {
    "weather repeats": {},
    "noise with a memory": {"memory": 0.9},
    "the same, two years learned": {"memory": 0.9, "n_years": 2},
    "10 °C colder": {"colder": 10.0},
    "after the warm half": {"half": True},
}
FOUND = {"weather repeats": "found", "after the warm half": "found after the half"}


def years(options):
    rates = {}
    for case, settings in CASES.items():
        for seed in range(options.seeds):
            baseline, healthy, damaged, model = daily(seed, **settings)
            targets = modes_of(baseline)
            for name, detector in (default_residuals(targets, model) | field_detectors(targets)).items():
                if "trees" in name or "regimes" in name:
                    continue
                sees = targets if name.startswith("raw") else list(baseline)
                detector.fit(baseline[sees])
                false, found = (
                    100 * float((detector.predict(records[sees]) == -1).mean()) for records in (healthy, damaged)
                )
                rates.setdefault(name, {}).setdefault(case, []).append(false)
                if case in FOUND:
                    rates[name].setdefault(FOUND[case], []).append(found)
    table = pd.DataFrame({name: {case: np.mean(each) for case, each in row.items()} for name, row in rates.items()}).T
    title = f"Truss, {options.seeds} baselines of one year: false alarms where 2 % are asked, and 20 % loss found, %"
    shown(title, table[[*CASES, *FOUND.values()]].rename_axis("detector"), 1)
    errors = {name: np.std(row["weather repeats"], ddof=1) / np.sqrt(options.seeds) for name, row in rates.items()}
    return sum(table["weather repeats"][name] > ASKED + SLACK + 2 * error for name, error in errors.items())


def frost(options):
    rates = {}
    for seed in range(2):
        bridge = Footbridge(seed)
        baseline, healthy = bridge.training(False), bridge.evaluated({})
        damaged = [bridge.evaluated({group: 0.06}) for group in bridge.groups[:4]]
        targets = modes_of(baseline)
        mapper, raw = lagged(TemperatureMapper()), field_detectors(targets, block="1D")
        detectors = {
            "directions of the FE model": compensated(targets, DirectionalDetector(bridge.model), mapper),
            "Mahalanobis": compensated(targets, None, mapper),
            "Mahalanobis, one regime": compensated(targets, None, mapper, regimes=None),
            "Mahalanobis, one regime, contiguous folds": compensated(
                targets, None, mapper, regimes=None, cv="contiguous"
            ),
        }
        detectors |= {f"{name}, days left out": raw[name] for name in ("raw, 20 neighbours", "raw, Gaussian mixture")}
        for name, detector in detectors.items():
            sees = targets if name.startswith("raw") else list(baseline)
            detector.fit(baseline[sees])
            ways = {name: (healthy, damaged)}
            if name == "directions of the FE model":
                ways[f"{name}, girder's thermometer dead"] = (
                    healthy.assign(girder=np.nan),
                    [records.assign(girder=np.nan) for records in damaged],
                )
            for way, (sound, each) in ways.items():
                false, *found = (100 * float((detector.predict(one[sees]) == -1).mean()) for one in (sound, *each))
                rates.setdefault(way, []).append({"false alarms": false, "found": np.mean(found)})
    table = pd.DataFrame({name: pd.DataFrame(each).mean() for name, each in rates.items()}).T
    title = "Two footbridges with frost: records in alarm in the second year, and loss of 6 % in a group found, %"
    shown(title, table.rename_axis("detector"), 1)
    return 0


PARTS = {"z24": z24, "seasons": seasons, "years": years, "frost": frost}


def main():
    options = arguments(__doc__, parts=PARTS, seeds=4)
    return int(sum(PARTS[part](options) for part in options.parts) > 0)


if __name__ == "__main__":
    sys.exit(main())
