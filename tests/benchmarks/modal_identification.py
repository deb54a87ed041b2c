"""Errors of frequencies that pyOMA-2 identifies in simulated accelerations, for several settings.

    OMP_NUM_THREADS=1 python tests/benchmarks/modal_identification.py

Records of the truss on days spread over a year, as in ``examples/plot_accelerations.py``; poles are assigned by
`ModeTracker`. Errors are root mean squares over the records in which a mode was found. The limit is that of Au (2014),
(damping / (2 pi f duration))^(1/2). Seconds are those of the processor for one record.
"""

import os
from functools import partial

import numpy as np
import pandas as pd
from harness import arguments, recipes, shown, timed

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import ModeTracker

os.environ |= {"PYOMA_LOG_LEVEL": "ERROR", "TQDM_DISABLE": "1"}

from pyoma2.algorithms import SSI
from pyoma2.algorithms.data.run_params import Clustering, Step1, Step2, Step3
from pyoma2.setup import SingleSetup

accelerations = recipes("accelerations")
DAMPING, RATE = accelerations.DAMPING, accelerations.RATE
SENSORS = np.linspace(0, 22, 8).astype(int)
REFERENCES = [0, 3, 5, 7]
SETTINGS = {
    "10 minutes, br=20, 4 of 8 sensors as references": {},
    "all sensors as references": {"ref_ind": None},
    "br=10": {"br": 10},
    "br=30": {"br": 30},
    "br=20, cov_R": {"method": "cov_R"},
    "br=40, cov_R": {"br": 40, "method": "cov_R"},
    "all poles of order 30": {"order": 30},
    "hier_avg": {"quick": "hier_avg"},
    "2.5 minutes": {"minutes": 2.5},
}


def poles(accelerations, *, order=None, quick=None, br=20, ref_ind=REFERENCES, method="cov"):
    """Poles of one record as `ModeTracker` takes them."""
    setup = SingleSetup(accelerations, fs=RATE)
    ssi = SSI(name="SSI", br=br, ordmax=40, step=2, ref_ind=ref_ind, method=method)
    setup.add_algorithms(ssi)
    setup.run_all()
    if order is not None:
        result, column = ssi.result, order // 2
        is_pole = ~np.isnan(result.Fn_poles[:, column])
        return {"frequencies": result.Fn_poles[is_pole, column], "shapes": result.Phi_poles[is_pole, column]}
    steps = (
        Step1(sc=True, sc_dict={"err_fn": 0.01, "err_xi": 0.1, "err_phi": 0.02}),
        Step2(distance=["dfn", "dMAC"], algo="hierarc", linkage="average", dc=0.02),
        Step3(post_proc=["1xorder", "min_size_pctg"], min_pctg=0.3, select="avg"),
    )
    ssi.add_clustering(Clustering(name="modes", quick=quick, steps=None if quick else steps))
    ssi.run_clustering("modes")
    found = ssi.result.clustering_results["modes"]
    return {"frequencies": found.Fn, "shapes": found.Phi.T}


def main():
    options = arguments(__doc__, records=(12, "for each setting"), settings=SETTINGS)

    truss = make_truss()
    f, phi = truss.modes(np.ones((1, 4)))
    tracker = ModeTracker((f[0], phi[0, SENSORS])).fit()
    year = make_truss_campaign(samples_per_year=options.records, random_state=0)
    rows = {}
    for name in options.settings:
        given = dict(SETTINGS[name])
        duration, spent, records = 60 * given.pop("minutes", 10), 0, []
        for day, theta in enumerate(year.theta.to_numpy()):
            modes = accelerations.modes_below(year.model, theta, RATE / 2)
            random = np.random.default_rng(day)
            record = accelerations.ambient_vibration(*modes, SENSORS, random, n_samples=int(duration * RATE))
            seconds, found = timed(partial(poles, record, **given))
            spent += seconds
            records.append(found)
        found = tracker.transform(records)
        error = 100 * (found.frequencies / year.clean_frequencies.to_numpy() - 1)
        limit = 100 * np.sqrt(DAMPING / (2 * np.pi * f[0] * duration))
        rows[name] = {
            **(error**2).mean() ** 0.5,
            "limit f1": limit[0],
            "limit f6": limit[-1],
            "found": 100 * found.frequencies.notna().to_numpy().mean(),
            "left over": found.left_over.mean(),
            "seconds": spent / options.records,
        }
        shown(
            f"Errors in %, modes found in %, poles left over in a record; {len(rows)} settings", pd.DataFrame(rows).T, 3
        )


if __name__ == "__main__":
    main()
