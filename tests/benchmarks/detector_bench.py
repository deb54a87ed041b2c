"""One study of several detectors on the truss, beside a loop of studies with one detector each.

    OMP_NUM_THREADS=1 python tests/benchmarks/detector_bench.py

Eight detectors of ``examples/detector_recipes.py``, of which four see temperatures, judge a healthy year of 365 records
and twelve damaged ones, each with 20 realisations of the noise. The study has to take less than a minute on two idle
cores, and to solve the FE model for no more rows than the study of one detector does. Times on a loaded machine count
its load: the ratio to the loop of the same run is what compares and, with ``--jobs 1``, the time of the processor. Exit
code 1 if a target is missed, or if a detector decides otherwise in company than alone.
"""

import argparse
import sys
import time
import warnings
from pathlib import Path

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM

sys.path.insert(0, str(Path(__file__).parents[2] / "examples"))
from detector_recipes import field_detectors

NAMES = [
    "raw, Mahalanobis",
    "raw, isolation forest",
    "raw, 20 neighbours",
    "raw, Gaussian mixture",
    "linear regression",
    "broken lines",
    "broken lines, whitened",
    "conditional covariance",
]
MOST_SECONDS = 60.0


class Counted:
    """A model whose solved rows are counted."""

    def __init__(self, fem):
        self.n_rows = 0
        solve = fem.simulator_.__class__.frequencies

        def frequencies(simulator, theta, *arguments, **options):
            self.n_rows += len(theta)
            return solve(simulator, theta, *arguments, **options)

        fem.simulator_.__class__.frequencies = frequencies


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--repeats", type=int, default=20)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--alone", type=int, default=len(NAMES), help="number of detectors in the loop")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    year, later = (make_truss_campaign(random_state=seed) for seed in range(2))
    fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    everyone = field_detectors(list(year.frequencies))
    detectors = {name: everyone[name] for name in NAMES}
    scenarios = sweep(fem, (0.1, 0.2, 0.3))
    solved, rows, decisions = Counted(fem), {}, {}

    def run(chosen):
        study = DetectabilityStudy(
            fem,
            chosen,
            scenarios,
            n_repeats=options.repeats,
            n_jobs=options.jobs,
            random_state=0,
            uncertainty="noise",
        )
        before, cpu, start = solved.n_rows, time.process_time(), time.perf_counter()
        study.run(later.temperatures)
        seconds = time.perf_counter() - start, time.process_time() - cpu
        return study, {"seconds": seconds[0], "CPU seconds here": seconds[1], "rows solved": solved.n_rows - before}

    run({NAMES[0]: detectors[NAMES[0]]})  # workers start
    together, rows["all in one study"] = run(detectors)
    for name in NAMES[: options.alone]:
        alone, rows[name] = run({name: detectors[name]})
        decisions[name] = all(
            np.array_equal(decided, together.decisions_[key], equal_nan=True)
            for key, decided in alone.decisions_.items()
        )
    table = pd.DataFrame.from_dict(rows, orient="index")
    whole, each = table.iloc[0], table.iloc[1:]
    table.loc["sum of the loop"] = each.sum()
    print(f"{len(NAMES)} detectors, {len(scenarios)} scenarios, {options.repeats} repeats, {options.jobs} jobs\n")
    print(table.round(2).to_string(), end="\n\n")
    ratio = whole["seconds"] / each["seconds"].sum()
    print(f"one study takes {ratio:.2f} of the time of the loop of {options.alone}")
    targets = {
        f"under {MOST_SECONDS:.0f} s": whole["seconds"] < MOST_SECONDS,
        "simulated once": whole["rows solved"] == each["rows solved"].iloc[0],
        "faster than the loop": options.alone < len(NAMES) or whole["seconds"] < each["seconds"].sum(),
        "same decisions": all(decisions.values()),
    }
    print(", ".join(f"{what}: {'yes' if kept else 'NO'}" for what, kept in targets.items()))
    return 0 if all(targets.values()) else 1


if __name__ == "__main__":
    sys.exit(main())
