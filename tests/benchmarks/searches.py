"""A search over the mapper of a chain, without and with a memory: seconds and inversions made.

    OMP_NUM_THREADS=1 python tests/benchmarks/searches.py

Twelve settings of the mapper in five folds of a year of days of the truss, and the refit. The exit code is 1 if a
memory leaves more inversions than one for each set of training records, changes a score, or saves less than half of the
time.
"""

import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from harness import arguments, shown, timed
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import BlockedKFold
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from skthermo.surrogate.inverse._posterior import Posterior

N_FOLDS = 5
MOST = N_FOLDS + 1  # sets of training records: the folds, and all records


def searched(memory, year, counts):
    """Scores, and processor seconds and inversions of several rows that they took."""
    inverse = PosteriorInverse(noise=0.01)
    fem = DataInformedFEM(
        make_truss(), inverse=inverse, mapper=TemperatureMapper(Ridge()), memory=memory, random_state=0
    )
    search = GridSearchCV(fem, {"mapper__regressor__alpha": np.logspace(-2, 3, 12)}, cv=BlockedKFold(N_FOLDS))
    before = sum(counts)
    seconds, search = timed(lambda: search.fit(year.temperatures, year.frequencies))
    return list(search.cv_results_["mean_test_score"]), seconds, sum(counts) - before


def main():
    options = arguments(__doc__, days=(365, "of records"))
    counts, invert = [], Posterior.invert

    def counted(posterior, inputs):
        counts.append(len(inputs) > 1)
        return invert(posterior, inputs)

    Posterior.invert = counted
    year = make_truss_campaign(samples_per_year=options.days, random_state=0)
    with tempfile.TemporaryDirectory() as memory:
        rows = {
            name: searched(place, year, counts)
            for name, place in (("plain", None), ("memory", memory), ("again", memory))
        }
        kept = sum(path.stat().st_size for path in Path(memory).rglob("*") if path.is_file()) / 1e6
    table = pd.DataFrame({name: row[1:] for name, row in rows.items()}, ["seconds", "inversions"]).T
    shown(f"Search; the memory holds {kept:.1f} MB", table)
    same = rows["plain"][0] == rows["memory"][0] == rows["again"][0]
    print(f"the same scores: {'yes' if same else 'no'}; inversions with a memory, at most {MOST} and then none")
    seconds, number = table["seconds"], table["inversions"]
    passed = same and number["memory"] <= MOST and number["again"] == 0 and 2 * seconds["memory"] < seconds["plain"]
    return int(not passed)


if __name__ == "__main__":
    sys.exit(main())
