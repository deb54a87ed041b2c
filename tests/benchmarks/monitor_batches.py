"""Any division of service into batches gives the evaluations of one pass: detectors, window rules, sensors and drift.

A truss in service, with gaps, missing values, markers, a sensor that dies and damage. Batches are days, weeks, months
or random ones, in which records come late and are sent again. Evaluations, events, daily summaries,
faults and drift have to be those of one batch of all records, bit for bit. Exit code 1 if one differs.
"""

import argparse
import copy
import sys
import time
import warnings

import numpy as np
import pandas as pd
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import (
    FusedDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
    WindowedAlarm,
)
from skthermo.monitoring import Monitor
from skthermo.preprocessing import HingeFeatures, LagFeatures
from skthermo.surrogate import DataInformedFEM

ANSWER = ["state", "index", "threshold", "modes", "reason", "event"]


def records_of(n_per_day, n_days, seed):
    """A baseline of a year, and records in service with faults and damage."""
    campaign = make_truss_campaign(
        2,
        samples_per_year=365 * n_per_day,
        samples_per_day=n_per_day,
        correlation=0.5,
        damage={"top": 0.15},
        damage_from=pd.Timestamp("2026-01-01") + pd.Timedelta(days=n_days * 2 // 3),
        random_state=seed,
    )
    records, rng = campaign.temperatures.join(campaign.frequencies), np.random.default_rng(seed)
    n_baseline = 365 * n_per_day
    service = records[n_baseline : n_baseline + n_days * n_per_day].copy()
    n_temperatures = campaign.temperatures.shape[1]
    service = service.mask(rng.uniform(size=service.shape) < 0.02)
    service.iloc[rng.integers(len(service), size=5), n_temperatures] = -999.0
    service.iloc[len(service) // 3 :, 0] = np.nan
    return records[:n_baseline], service[rng.uniform(size=len(service)) > 0.05], campaign


def detectors(targets):
    """Detectors by name."""
    lags = make_pipeline(LagFeatures([0, 1, 2], freq="6h"), LinearRegression())
    by_name = {"raw": MahalanobisDetector()}
    regressors = {
        "lags": lags,
        "neighbours": KNeighborsRegressor(20),
        "hinges": make_pipeline(HingeFeatures(), LinearRegression()),
    }
    lasts = {
        "records": MahalanobisDetector(),
        "mean 24h": WindowedAlarm("24h"),
        "mean 6": WindowedAlarm(6),
        "m of n": WindowedAlarm(8, rule="m-of-n"),
        "forest": OutlierDetector(IsolationForest(n_estimators=50, random_state=0), block="1D"),
    }
    for regressor, estimator in regressors.items():
        for last, detector in lasts.items():
            by_name[f"{regressor}, {last}"] = make_pipeline(
                TemperatureCompensator(estimator, targets=targets), detector
            )
    local = TemperatureCompensator(lags, targets=targets, whiten="local")
    by_name["lags whitened, mean 24h"] = make_pipeline(local, WindowedAlarm("24h"))
    pair = [("one", by_name["lags, records"]), ("two", by_name["neighbours, mean 24h"])]
    by_name["fused"] = FusedDetector(pair)
    return by_name


def divisions(service, rng):
    """Positions of the records of each batch, by name of the division; the last ones come late and twice."""
    n = len(service)
    for name, freq in {"days": "D", "weeks": "7D", "months": "30D"}.items():
        yield name, [np.flatnonzero(service.index.floor(freq) == start) for start in service.index.floor(freq).unique()]
    for number in range(2):
        order = np.argsort(np.arange(n) + rng.uniform(0, 12, n))
        parts = np.split(order, np.sort(rng.choice(np.arange(1, n), 25, replace=False)))
        yield (
            f"random {number + 1}",
            [np.append(part, rng.choice(part, min(2, len(part)))) for part in parts if len(part)],
        )


def differences(one, answers, other, parts):
    """What differs between one pass and another course."""
    last = pd.concat(parts)
    last = last[~last.index.duplicated(keep="last")].sort_index()
    found = [] if last[ANSWER].equals(answers[ANSWER]) else ["answers"]
    for name in ("events_", "days_", "evaluations_", "faults_", "drift_", "corrected_"):
        left, right = getattr(one, name), getattr(other, name)
        if not (left is None if right is None else left.equals(right)):
            found.append(name)
    return found


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--days", type=int, default=60, help="days in service")
    parser.add_argument("--per-day", type=int, default=4, help="records a day")
    parser.add_argument("--seeds", type=int, default=1, help="campaigns")
    parser.add_argument("--only", default="", help="part of the names of the detectors to try")
    parser.add_argument("--fem", action="store_true", help="follow drift, too (one detector)")
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    n_wrong = n_tried = 0
    for seed in range(args.seeds):
        baseline, service, campaign = records_of(args.per_day, args.days, seed)
        targets, rng = list(campaign.frequencies), np.random.default_rng(seed)
        tried, fem = detectors(targets), None
        if args.fem:
            tried = {"lags, mean 24h": tried["lags, mean 24h"]}
            fem = DataInformedFEM(make_truss(), random_state=0).fit(
                baseline[list(campaign.temperatures)][:: args.per_day], baseline[targets][:: args.per_day]
            )
        for name, detector in tried.items():
            if args.only not in name:
                continue
            begin = time.perf_counter()
            fitted = Monitor(detector, targets=targets, fem=fem).fit(baseline)
            one = copy.deepcopy(fitted)
            answers, wrong = one.update(service), []
            for division, batches in divisions(service, rng):
                other = copy.deepcopy(fitted)
                parts = [other.update(service.iloc[rows]) for rows in batches]
                n_tried += 1
                wrong += [
                    f"{division}: {', '.join(found)}" for found in [differences(one, answers, other, parts)] if found
                ]
            n_wrong += len(wrong)
            n_alarms = (answers["state"] == "alarm").sum()
            seconds = time.perf_counter() - begin
            verdict = "; ".join(wrong) or "the same"
            print(f"{name:26} {len(answers)} records, {n_alarms:3} in alarm, {seconds:4.0f} s: {verdict}", flush=True)
    print(f"{n_tried} divisions, {n_wrong} differ from one pass")
    sys.exit(bool(n_wrong))


if __name__ == "__main__":
    main()
