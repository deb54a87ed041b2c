"""What the checks before a fit say of healthy records, of misplaced columns, and the time that they take.

    OMP_NUM_THREADS=1 python tests/benchmarks/gates.py [FOLDER] [--seeds 20] [--no-times]

FOLDER, by default the one that the environment variable SKTHERMO_DATA names, holds ``z24/z24_monitoring.csv``,
``tower/tower.csv`` and ``kw51/kw51_mode6_daily.csv``; what is not there is left out. Checks by kind of input: the
temperatures and frequencies of a chain; the columns of a compensator; the frequencies of a detector; residuals in Hz
and standardised ones of a detector behind a compensator. The exit code is 1 if healthy records are refused, if a
column is called misplaced that is not, or if checks take more than 2 % of a fit of a chain or a compensator.
"""

import argparse
import os
import sys
import time
import warnings
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np
import pandas as pd
from record_checks import healthy_campaigns, real_records
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.preprocessing import gross_errors
from skthermo.residuals.misplaced import misplaced_columns
from skthermo.surrogate import DataInformedFEM

MOST = 0.02  # of the time of a fit


def healthy(folder, seeds):
    """Names and tables of healthy records, real ones and those of all generators."""
    yield from real_records(folder) if folder else ()
    yield from healthy_campaigns(seeds)
    for seed in range(seeds):
        for bridge in make_fleet(6, random_state=seed).values():
            records = bridge.records(365)
            yield f"fleet, {bridge.kind}", (records.temperatures, records.frequencies)


def residuals(T, F):
    """What a straight line in the temperatures leaves of the frequencies."""
    known = pd.DataFrame(T).fillna(pd.DataFrame(T).mean())
    left = [F[name] - LinearRegression().fit(known[F[name].notna()], F[name].dropna()).predict(known) for name in F]
    return pd.concat(left, axis=1)


def findings(T, F):
    """What each kind of check finds in two frames."""
    left = residuals(T, F)
    both = pd.concat([T, F], axis=1)
    yield "chain", gross_errors(T, F)
    yield "compensator", gross_errors(frequencies=both, unit="")
    yield "detector", gross_errors(frequencies=F, unit="")
    yield "detector, residuals", gross_errors(frequencies=left, unit="")
    yield "detector, standardised", gross_errors(frequencies=left / left.std(), unit="")


def misplaced(T, F):
    """How many modes left out and temperatures put in are named alone, and how many of healthy records."""
    both, found = pd.concat([T, F], axis=1), Counter()
    found["false"] = len(list(misplaced_columns(T, F)))
    sets = [("modes", [*T, mode], [other for other in F if other != mode], mode) for mode in F if F.shape[1] > 1]
    sets += [("sensors", [o for o in T if o != one], [one, *F], one) for one in T if T.shape[1] > 1]
    for kind, inputs, targets, name in sets:
        said = [str(warning) for warning in misplaced_columns(both[inputs], both[targets])]
        found[kind] += 1
        found[f"{kind} named"] += len(said) == 1 and f" [{name!r}] " in said[0]
    return found


def shares_of_time():
    """Name, time of the checks and of the fit, in seconds, the median of five."""
    year, model = make_truss_campaign(random_state=0), make_truss()
    T, F = year.temperatures, year.frequencies
    both = T.join(F)
    chain = DataInformedFEM(model, random_state=0)
    compensator = TemperatureCompensator(LinearRegression(), targets=list(F))
    yield "chain", lambda: (gross_errors(T, F, model=model), list(misplaced_columns(T, F))), lambda: chain.fit(T, F)
    checks = lambda: (gross_errors(frequencies=both, unit=""), list(misplaced_columns(T, F)))  # noqa: E731
    yield "compensator", checks, lambda: compensator.fit(both)
    yield "detector", lambda: gross_errors(frequencies=F, unit=""), lambda: MahalanobisDetector().fit(F)


def seconds(call):
    """Median of five runs."""
    taken = []
    for _ in range(5):
        begun = time.process_time()
        call()
        taken.append(time.process_time() - begun)
    return float(np.median(taken))


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=os.environ.get("SKTHERMO_DATA"))
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--no-times", action="store_true")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    answers, columns, failed = defaultdict(Counter), defaultdict(Counter), False
    for name, (T, F) in healthy(options.folder and Path(options.folder), options.seeds):
        T, F = (pd.DataFrame(table).add_prefix(prefix) for table, prefix in ((T, "T_"), (F, "f_")))
        columns[name].update(misplaced(T, F))
        for kind, found in findings(T, F):
            kinds = found.table.loc[found.table["severity"] == "meaningless", "what"]
            doubtful = {warning.kind for warning in found.warnings()} - set(kinds)
            answers[kind].update({"records": 1, "refused": len(kinds) > 0, "warned of": len(doubtful) > 0})
            answers[kind].update({f"  {what}": 1 for what in (*set(kinds), *doubtful)})
    print(pd.DataFrame(answers).fillna(0).astype(int).to_string())
    print(pd.DataFrame(columns).T.fillna(0).astype(int).to_string())
    failed |= any(count["refused"] for count in answers.values()) | any(count["false"] for count in columns.values())
    for name, checks, fit in () if options.no_times else shares_of_time():
        taken, whole = seconds(checks), seconds(fit)
        print(f"{name}: checks {1e3 * taken:.1f} ms of a fit of {1e3 * whole:.0f} ms, {taken / whole:.1%}")
        failed |= name != "detector" and taken > MOST * whole
    sys.exit(failed)


if __name__ == "__main__":
    main()
