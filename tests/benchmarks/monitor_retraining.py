"""Retraining a monitor: what more records bring, what a change hides, and how soon after an intervention it evaluates.

    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_retraining.py
    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_retraining.py --only refit --seeds 5

``refit``: the truss, daily records. A detector of half a year's baseline is refitted half a year later, with a healthy
structure, one that is damaged in between without an alarm, and one that loses stiffness slowly. ``truss`` and
``measured``: after an intervention, a new baseline from few days on, beside a detector fitted to these days only and
the old detector with shifted frequencies; on the truss, and on KW51's measured daily medians of one mode, where
``SKTHERMO_DATA`` names their folder. The exit code is 1 if a target is missed.
"""

import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pandas as pd
from harness import DATA, arguments, compensated, is_missed, joined, modes_of, shown
from inside import begun_again, retrained
from sklearn.base import clone
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import HingeFeatures

ASKED = 0.02  # share of healthy records above the threshold
DAYS = (3, 7, 14, 30, 60, 90)
DAMAGE = {"bottom": 0.10}
MOST_REFUSED, LEAST_REFUSED = 0.05, 0.95  # shares of healthy and of changed structures whose refit is refused


def limit(detector):
    """The threshold that the share asked for of a baseline's records exceeds."""
    return float(np.nanquantile(detector.baseline_index_, 1 - ASKED))


def no_events():
    columns = {"kind": object, "start": "M8[ns]", "end": "M8[ns]", "acknowledged": bool, "harmless": bool}
    return pd.DataFrame({name: pd.Series(dtype=kind) for name, kind in columns.items()})


def in_service(detector, baseline, kept, targets):
    """What a retraining reads of a monitor."""
    fitted = clone(detector).fit(baseline)
    return SimpleNamespace(
        detector_=fitted,
        trained_=baseline,
        since_=None,
        prior_=None,
        corrected_=kept,
        last_=kept.index[-1],
        retention="9999D",
        events_=no_events(),
        faults_=pd.DataFrame(),
        targets_=targets,
        features_=list(fitted.feature_names_in_),
        threshold_=limit(fitted),
        lookback_=SimpleNamespace(duration=lambda step: step),
        random_state=0,
    )


def stamped(campaign):
    """Records on stamps in nanoseconds, as a monitor keeps them."""
    records = joined(campaign)
    return records.set_axis(records.index.as_unit("ns"))


def lines(targets):
    return compensated(targets, MahalanobisDetector(ASKED))


def above(detector, threshold, records):
    """Share of records above a threshold, in percent."""
    index = -np.asarray(detector.score_samples(records[list(detector.feature_names_in_)]))
    return 100 * float((index > threshold)[~np.isnan(index)].mean())


def refit(seeds):
    """Half a year's baseline, and a refit half a year later."""
    rows = []
    for seed in range(seeds):
        settings = {"n_years": 2, "random_state": seed}
        healthy = stamped(make_truss_campaign(**settings))
        onset = healthy.index[240]
        kinds = {
            "healthy": healthy,
            "5 % sudden": stamped(make_truss_campaign(**settings, damage={"bottom": 0.05}, damage_from=onset)),
            "10 % sudden": stamped(make_truss_campaign(**settings, damage=DAMAGE, damage_from=onset)),
            "10 % a year": stamped(make_truss_campaign(**settings, drift=DAMAGE)),
        }
        later = stamped(make_truss_campaign(**settings, damage=DAMAGE))[365:]
        targets = list(make_truss_campaign(n_years=1, samples_per_year=20, random_state=0).frequencies)
        for kind, records in kinds.items():
            monitor = in_service(lines(targets), records[:182], records[182:365], targets)
            found = retrained(monitor, None)
            threshold = limit(found.detector)
            row = {"the new half year": kind, "refits refused, %": 100 * (not found.accepted)}
            row["false alarms, old detector, %"] = above(monitor.detector_, monitor.threshold_, healthy[365:])
            row["false alarms, refitted, %"] = above(found.detector, threshold, healthy[365:])
            row["damage found, old detector, %"] = above(monitor.detector_, monitor.threshold_, later)
            row["damage found, refitted, %"] = above(found.detector, threshold, later)
            rows.append(row)
    table = pd.DataFrame(rows).groupby("the new half year", sort=False).mean()
    table.loc[table.index != "healthy", table.columns[1:]] = np.nan
    shown(f"The truss, refitted after half a year with another one; {seeds} campaigns, next year's records", table, 1)
    refused = table["refits refused, %"]
    missed = is_missed("refused, healthy", refused["healthy"], f"<= {100 * MOST_REFUSED}")
    return missed + is_missed("refused, changed", refused.drop("healthy").min(), f">= {100 * LEAST_REFUSED}")


def shifted_only(monitor, own, targets):
    """The old detector on frequencies moved by the mean of what its regression leaves of the new days."""
    left = monitor.detector_.residuals(own).mean()  # relative

    def moved(records):
        return records.assign(**{name: records[name] * np.exp(-left[name]) for name in targets})

    return moved


def after_intervention(detector, before, after, damaged, targets):
    """Records above the threshold after so many days of a new baseline: healthy and damaged, by three ways."""
    rows = []
    for n_days in DAYS:
        end = after.index[0] + pd.Timedelta(days=n_days)
        own, healthy, bad = after[after.index < end], after[after.index >= end], damaged[damaged.index >= end]
        monitor = in_service(detector, before, own, targets)
        found, shares = begun_again(monitor, own.index[0]), {}
        if found.accepted:
            level = limit(found.detector)
            shares["rebaseline"] = above(found.detector, level, healthy), above(found.detector, level, bad)
        try:
            alone = clone(detector).fit(own)
            shares["these days only"] = above(alone, limit(alone), healthy), above(alone, limit(alone), bad)
        except ValueError:
            shares["these days only"] = np.nan, np.nan
        moved, old = shifted_only(monitor, own, targets), monitor.detector_
        shares["old, shifted"] = [above(old, monitor.threshold_, moved(records)) for records in (healthy, bad)]
        false = {f"false alarms, {way}, %": share for way, (share, _) in shares.items()}
        rows.append({"days": n_days} | false | {f"damage found, {way}, %": share for way, (_, share) in shares.items()})
    return pd.DataFrame(rows)


def truss(seeds):
    """A year, an intervention that strengthens the diagonals, and a year after it."""
    tables = []
    for seed in range(seeds):
        settings = {"n_years": 2, "random_state": seed}
        before = stamped(make_truss_campaign(**settings))[:365]
        after = stamped(make_truss_campaign(**settings, damage={"diagonal": -0.1}))[365:]
        damaged = stamped(make_truss_campaign(**settings, damage={"diagonal": -0.1} | DAMAGE))[365:]
        targets = modes_of(before)
        tables.append(after_intervention(lines(targets), before, after, damaged, targets))
    mean = pd.concat(tables).groupby("days").mean()
    title = "The truss, diagonals strengthened by 10 %: days of a new baseline, then a loss of 10 % of the bottom chord"
    shown(f"{title}; {seeds} campaigns, 2 % of false alarms asked for", mean, 1)
    return is_missed("false alarms, %", mean["false alarms, rebaseline, %"].max(), f"<= {100 * 1.5 * ASKED}")


def measured(_):
    """KW51's measured mode 6, daily medians, over its retrofit."""
    path = (DATA or Path()) / "kw51" / "kw51_mode6_daily.csv"
    if not path.exists():
        return False
    daily = pd.read_csv(path, index_col=0, parse_dates=True).dropna()
    daily.index = daily.index.as_unit("ns")
    before, after = daily[:"2019-05-14"], daily["2019-09-28":]
    detector = compensated(["f"], MahalanobisDetector(ASKED), make_pipeline(HingeFeatures(), LinearRegression()))
    damaged = after.assign(f=after["f"] * (1 - 0.01))
    table = after_intervention(detector, before, after, damaged, ["f"])
    title = "Mode 6 of KW51 over its retrofit, measured daily medians; damage is a fall by 1 %"
    shown(f"{title}; 2 % of false alarms asked for", table.set_index("days"), 1)
    return False


PARTS = {"refit": refit, "truss": truss, "measured": measured}


def main():
    options = arguments(__doc__, only=PARTS, seeds=10)
    missed = [PARTS[part](options.seeds) for part in options.only]
    return 1 if any(missed) else 0


if __name__ == "__main__":
    sys.exit(main())
