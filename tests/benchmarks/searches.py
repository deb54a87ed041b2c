"""Searches over the mapper and cross-validation of chains, without and with a memory: seconds and inversions made.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/searches.py
    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/searches.py --before ../another/copy --cases truss

Twelve settings of the mapper in five folds, and the refit; then cross-validation of one more mapper with the memory
that the search has left. "truss" has a year of days, "Z24" every eighth healthy record and a reduced model. Seconds are
of the processor. ``--before`` names a copy of the code of another state, which has its turn in a process of its own.

The exit code is 1 if a memory leaves more inversions than one for each set of training records, changes a score, or
saves less than half of the time.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, cross_val_score

from skthermo.datasets import load_z24, make_truss, make_truss_campaign, make_z24
from skthermo.preprocessing import BiasAligner, BlockedKFold
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from skthermo.surrogate.inverse._posterior import Posterior

PENALTIES = np.logspace(-2, 3, 12)
N_FOLDS = 5
MOST = N_FOLDS + 1  # sets of training records: the folds, and all records


def remembering(fem, memory):
    """The chain with a memory, in earlier states that of its inverse alone."""
    return fem.set_params(**{"memory" if "memory" in fem.get_params() else "inverse__memory": memory})


def truss(memory):
    year = make_truss_campaign(random_state=0)
    inverse = PosteriorInverse(noise=0.01)
    fem = DataInformedFEM(make_truss(), inverse=inverse, mapper=TemperatureMapper(Ridge()), random_state=0)
    return remembering(fem, memory), year.temperatures, year.frequencies


def z24(memory):
    bridge = load_z24(Path(os.environ["SKTHERMO_DATA"]) / "z24" / "z24_monitoring.csv")
    rows = np.flatnonzero(bridge.state == "undamaged")[::8]
    model = make_z24()
    inverse = PosteriorInverse(noise=0.005, reduce=True)
    parts = {"mapper": TemperatureMapper(Ridge()), "aligner": BiasAligner(model)}
    fem = DataInformedFEM(model, inverse=inverse, **parts, reduce=True, random_state=0)
    return remembering(fem, memory), bridge.temperatures.iloc[rows], bridge.frequencies.iloc[rows]


CASES = {"truss": truss, "Z24": z24}


class Inversions:
    """Counts calls that invert several rows."""

    def __init__(self):
        self.n, invert = 0, Posterior.invert

        def counted(posterior, inputs):
            self.n += len(inputs) > 1
            return invert(posterior, inputs)

        Posterior.invert = counted


def measured(way, inversions):
    """Scores, and processor seconds and inversions that they took."""
    start, before = time.process_time(), inversions.n
    scores = way()
    return list(scores), time.process_time() - start, inversions.n - before


def searched(case, memory):
    fem, T, F = CASES[case](memory)
    grid = {"mapper__regressor__alpha": PENALTIES}
    return GridSearchCV(fem, grid, cv=BlockedKFold(N_FOLDS)).fit(T, F).cv_results_["mean_test_score"]


def validated(case, memory):
    fem, T, F = CASES[case](memory)
    return cross_val_score(fem.set_params(mapper__regressor__alpha=3.0), T, F, cv=BlockedKFold(N_FOLDS))


def measure(case):
    """Rows of the table of one case, by name."""
    inversions, rows = Inversions(), {}
    with tempfile.TemporaryDirectory() as memory:
        rows["search"] = measured(lambda: searched(case, None), inversions)
        rows["search, memory"] = measured(lambda: searched(case, memory), inversions)
        rows["search again, memory"] = measured(lambda: searched(case, memory), inversions)
        rows["cross-validation"] = measured(lambda: validated(case, None), inversions)
        rows["cross-validation, memory"] = measured(lambda: validated(case, memory), inversions)
        kept = sum(path.stat().st_size for path in Path(memory).rglob("*") if path.is_file()) / 1e6
    return {"rows": rows, "megabytes": kept}


def of_copy(folder, case):
    """The same by the code of another folder."""
    environment = os.environ | {"PYTHONPATH": str(Path(folder).resolve())}
    command = [sys.executable, __file__, "--cases", case, "--json"]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True, text=True).stdout)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--cases", nargs="+", choices=[*CASES], default=[*CASES])
    parser.add_argument("--before", help="folder of another state of the code")
    parser.add_argument("--json", action="store_true", help="print one case as JSON")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    if options.json:
        print(json.dumps(measure(options.cases[0])))
        return
    passed = True
    for case in options.cases:
        if case == "Z24" and "SKTHERMO_DATA" not in os.environ:
            print("Z24 is left out: SKTHERMO_DATA names no folder")
            continue
        now = measure(case)
        table = pd.DataFrame({name: row[1:] for name, row in now["rows"].items()}, ["seconds", "inversions"]).T
        if options.before:
            before = of_copy(options.before, case)["rows"]
            table["before: seconds"] = [before[name][1] for name in table.index]
            table["before: inversions"] = [before[name][2] for name in table.index]
        print(f"\n{case}; the memory holds {now['megabytes']:.1f} MB\n{table.round(2).to_string()}")
        scores = {name: row[0] for name, row in now["rows"].items()}
        same = scores["search"] == scores["search, memory"] == scores["search again, memory"]
        same = same and scores["cross-validation"] == scores["cross-validation, memory"]
        seconds, number = table["seconds"], table["inversions"]
        passed &= same and bool((number.filter(like="again") == 0).all()) and number["search, memory"] <= MOST
        passed &= number["cross-validation, memory"] == 0 and 2 * seconds["search, memory"] < seconds["search"]
        print(f"the same scores: {'yes' if same else 'no'}; inversions with a memory, at most {MOST} and then none")
    sys.exit(0 if passed else 1)


if __name__ == "__main__":
    main()
