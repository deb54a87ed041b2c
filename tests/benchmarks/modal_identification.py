"""Errors of frequencies that pyOMA-2 identifies in simulated accelerations, for several settings.

    OMP_NUM_THREADS=1 python tests/benchmarks/modal_identification.py

Records of the truss on days spread over a year, as in ``examples/plot_accelerations.py``; poles are assigned by
`ModeTracker`. Errors are root mean squares over the records in which a mode was found. The limit is that of Au (2014),
(damping / (2 pi f duration))^(1/2).
"""

import os

import numpy as np
import pandas as pd
from harness import arguments, recipes, shown

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
MINUTES = 10
SETTINGS = {
    "br=20, four sensors as references": {},
    "all sensors as references": {"ref_ind": None},
    "br=10": {"br": 10},
    "br=30": {"br": 30},
    'method="cov_R"': {"method": "cov_R"},
    "all poles of order 30": {"order": 30},
    'quick="hier_avg"': {"quick": "hier_avg"},
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
    options = arguments(__doc__, records=(8, "for each setting"), settings=SETTINGS)

    truss = make_truss()
    f, phi = truss.modes(np.ones((1, 4)))
    tracker = ModeTracker((f[0], phi[0, SENSORS])).fit()
    year = make_truss_campaign(samples_per_year=options.records, random_state=0)
    rows, found, duration = {}, {name: [] for name in options.settings}, 60 * MINUTES
    for day, theta in enumerate(year.theta.to_numpy()):
        modes = accelerations.modes_below(year.model, theta, RATE / 2)
        random = np.random.default_rng(day)
        record = accelerations.ambient_vibration(*modes, SENSORS, random, n_samples=int(duration * RATE))
        for name, records in found.items():
            records.append(poles(record, **SETTINGS[name]))
    for name, records in found.items():
        tracked = tracker.transform(records).frequencies
        error = 100 * (tracked / year.clean_frequencies.to_numpy() - 1)
        rms = (error**2).mean() ** 0.5
        share = 100 * tracked.notna().to_numpy().mean()
        rows[name] = {"lowest mode, error, %": rms.iloc[0], "highest mode, error, %": rms.iloc[-1], "found, %": share}
    limit = 100 * np.sqrt(DAMPING / (2 * np.pi * f[0] * duration))
    rows["limit"] = {"lowest mode, error, %": limit[0], "highest mode, error, %": limit[-1]}
    title = f"SSI of {options.records} records of {MINUTES} minutes, truss, 8 sensors; one setting changed"
    shown(title, pd.DataFrame(rows).T, "3g")


if __name__ == "__main__":
    main()
