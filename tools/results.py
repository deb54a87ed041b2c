"""Numbers that a change of the code's structure must leave as they are.

    SKTHERMO_DATA=FOLDER python tools/results.py --write before.npz [--only truss monitor]
    SKTHERMO_DATA=FOLDER python tools/results.py --compare before.npz [--only truss monitor]

Each work gives named arrays: chains of the truss, Z24 and KW51, a study with ranking, identified damage, a monitor in
batches, the drift of parameters, a fleet. ``--compare`` prints those that are not equal bit for bit, with their largest
relative difference. Reads the skthermo that is imported (``PYTHONPATH`` chooses another tree).
"""

import argparse
import os
import sys
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import (
    load_z24,
    make_fleet,
    make_kw51,
    make_kw51_campaign,
    make_truss,
    make_truss_campaign,
    make_z24,
)
from skthermo.detection import (
    FusedDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
    WindowedAlarm,
)
from skthermo.fleet import FleetPrior
from skthermo.monitoring import Monitor, track_parameters
from skthermo.studies import DetectabilityStudy, identify_damage, sweep
from skthermo.surrogate import DataInformedFEM


def numbers(frame):
    """Numeric columns of a frame."""
    return frame.select_dtypes("number").to_numpy(float)


def chain_results(chain, T, damage):
    """What a chain learned, predicts, draws and is uncertain about."""
    lowest, highest = chain.predict_interval(T)[:2]
    return {
        "parameters": np.asarray(chain.parameters_),
        "noise": chain.noise_,
        "prediction": np.asarray(chain.predict(T)),
        "damaged": np.asarray(chain.simulate(T, damage=damage, noise="fitted", random_state=3)),
        "interval": np.stack([np.asarray(lowest), np.asarray(highest)]),
        "records": np.asarray(chain.recorder_.service.missing),
    }


def truss():
    year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    chain = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    return chain_results(chain, later.temperatures, {"bottom": 0.3})


def kw51():
    campaign = make_kw51_campaign(random_state=0)
    T, F = campaign.temperatures[::12], campaign.frequencies[::12]
    chain = DataInformedFEM(make_kw51(), random_state=0).fit(T, F)
    group = next(iter(make_kw51().groups))
    return chain_results(chain, T[::3], {group: 0.1})


def z24():
    if "SKTHERMO_DATA" not in os.environ:
        return {}
    bridge = load_z24(Path(os.environ["SKTHERMO_DATA"]) / "z24" / "z24_monitoring.csv")
    T, F = bridge.temperatures[:4000:3], bridge.frequencies[:4000:3]
    model = make_z24().with_modes(range(F.shape[1]))
    chain = DataInformedFEM(model, random_state=0).fit(T, F)
    return chain_results(chain, T[::3], {next(iter(model.groups)): 0.1})


def study():
    year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
    chain = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    compensator = TemperatureCompensator(LinearRegression(), targets=list(year.frequencies.columns))
    parts = {"compensated": MahalanobisDetector(), "week": WindowedAlarm(7)}
    detectors = {"raw": MahalanobisDetector()}
    detectors |= {name: make_pipeline(compensator, part) for name, part in parts.items()}
    scenarios = sweep(chain, (0.1, 0.3), groups=["bottom", "diagonal"])
    found = DetectabilityStudy(chain, detectors, scenarios, n_repeats=4, n_replicates=4, random_state=0)
    rates = found.run(later.temperatures, baseline=year.frequencies)
    return {"rates": numbers(rates), "ranking": numbers(found.ranking())}


def identified():
    year = make_truss_campaign(random_state=0)
    chain = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    later = make_truss_campaign(damage={"bottom": 0.2}, random_state=1)
    return {"table": numbers(identify_damage(chain, later.temperatures, later.frequencies, random_state=0).table)}


def records(years=1, damage=None, seed=0):
    """Half-daily records of the truss side by side."""
    campaign = make_truss_campaign(years, samples_per_year=730, samples_per_day=2, damage=damage, random_state=seed)
    return campaign.temperatures, campaign.frequencies


def monitor():
    (T, F), (later_T, later_F) = records(), records(damage={"bottom": 0.3}, seed=1)
    stamps = pd.date_range("2020-01-01", periods=len(T), freq="12h")
    both = pd.concat([T, F], axis=1).set_axis(stamps)
    later = pd.concat([later_T, later_F], axis=1).set_axis(stamps + pd.Timedelta(days=366))
    detector = make_pipeline(TemperatureCompensator(LinearRegression(), targets=list(F.columns)), WindowedAlarm(14))
    service = Monitor(detector).fit(both)
    parts = [service.update(later[start : start + 97]) for start in range(0, len(later), 97)]
    answers = pd.concat(parts)
    states = np.array([{"healthy": 1.0, "alarm": -1.0}.get(state, 0.0) for state in answers["state"]])
    return {"states": states, "index": answers["index"].to_numpy(float), "events": np.array([len(service.events_)])}


def drift():
    T, F = records()
    stamps = pd.date_range("2020-01-01", periods=len(T), freq="12h")
    T, F = T.set_axis(stamps), F.set_axis(stamps)
    chain = DataInformedFEM(make_truss(), random_state=0).fit(T, F)
    later_T, later_F = (table.set_axis(stamps + pd.Timedelta(days=366)) for table in records(seed=1))
    return {"table": numbers(track_parameters(chain, later_T, later_F).table)}


def fleet():
    bridges = make_fleet(4, random_state=0)
    chains = {}
    for name, bridge in bridges.items():
        campaign = bridge.records(365)
        T, F = campaign.temperatures.mean(axis=1).to_frame("mean"), campaign.frequencies
        chains[name] = DataInformedFEM(bridge.model, random_state=0).fit(T, F)
    newcomer = DataInformedFEM(bridge.model, mapper=FleetPrior().fit(chains).mapper(), random_state=0)
    return {"prediction": np.asarray(newcomer.fit(T[:60], F[:60]).predict(T))}


def detectors():
    (T, F), (later_T, later_F) = records(), records(damage={"bottom": 0.2}, seed=1)
    both, later = pd.concat([T, F], axis=1), pd.concat([later_T, later_F], axis=1)
    both.iloc[5:60, -1] = later.iloc[5:60, -2] = np.nan
    results = {}
    for whiten in (None, "global", "local"):
        compensator = TemperatureCompensator(LinearRegression(), targets=list(F.columns), whiten=whiten)
        results[f"residuals {whiten}"] = np.asarray(compensator.fit_transform(both))
        results[f"later {whiten}"] = np.asarray(compensator.transform(later))
    single = {
        "conformal": MahalanobisDetector(),
        "quantile": MahalanobisDetector(threshold="quantile"),
        "forest": OutlierDetector(IsolationForest(random_state=0)),
        "week": WindowedAlarm(7),
    }
    compensator = TemperatureCompensator(LinearRegression(), targets=list(F.columns))
    joined = {name: make_pipeline(compensator, detector) for name, detector in single.items()}
    joined["fused"] = FusedDetector([(name, joined[name]) for name in ("conformal", "week")])
    for name, detector in joined.items():
        results[f"scores {name}"] = np.asarray(detector.fit(both).decision_function(later))
    return results


WORKS = {work.__name__: work for work in (truss, kw51, z24, study, identified, monitor, drift, fleet, detectors)}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--write", type=Path, metavar="FILE")
    parser.add_argument("--compare", type=Path, metavar="FILE")
    parser.add_argument("--only", nargs="+", choices=WORKS, default=list(WORKS), metavar="WORK")
    options = parser.parse_args()
    results = {}
    for name in options.only:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            results |= {f"{name}: {key}": value for key, value in WORKS[name]().items()}
        print(name, "done", file=sys.stderr)
    if options.write:
        np.savez(options.write, **results)
    if options.compare:
        sys.exit(0 if compare(np.load(options.compare), results) else 1)


def compare(before, now):
    """Prints which arrays differ; whether none does."""
    same = True
    for name, values in now.items():
        if name not in before:
            print(f"{name}: not in the file")
        elif np.shape(values) != before[name].shape:
            print(f"{name}: {before[name].shape} before, {np.shape(values)} now")
        elif np.array_equal(values, before[name], equal_nan=True):
            continue
        else:
            size = np.maximum(np.abs(before[name]), np.finfo(float).tiny)
            print(f"{name}: largest relative difference {np.nanmax(np.abs(values - before[name]) / size):.2g}")
        same = False
    print(f"{len(now)} arrays, {'all equal bit for bit' if same else 'some differ'}")
    return same


if __name__ == "__main__":
    main()
