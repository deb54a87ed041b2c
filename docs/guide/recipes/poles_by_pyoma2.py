import numpy as np
from pyoma2.algorithms import SSI
from pyoma2.algorithms.data.run_params import Clustering, Step1, Step2, Step3
from pyoma2.setup import SingleSetup

from skthermo.preprocessing import ModeTracker


def identify(accelerations, rate):
    setup = SingleSetup(accelerations - accelerations.mean(axis=0), fs=rate)
    ssi = SSI(name="SSI", br=20, ordmax=40, step=2)
    setup.add_algorithms(ssi)
    setup.run_all()
    stable = Step1(sc=True, sc_dict={"err_fn": 0.01, "err_xi": 0.1, "err_phi": 0.02})
    near = Step2(distance=["dfn", "dMAC"], algo="hierarc", linkage="average", dc=0.02)
    often = Step3(post_proc=["1xorder", "min_size_pctg"], min_pctg=0.3, select="avg")
    ssi.add_clustering(Clustering(name="modes", steps=(stable, near, often)))
    ssi.run_clustering("modes")
    return ssi.result.clustering_results["modes"]


def track(measured, rate, model, sensors):
    records = []
    for accelerations in measured:
        found = identify(accelerations, rate)
        records.append({"frequencies": found.Fn, "damping": found.Xi, "shapes": found.Phi.T})
    f, phi = model.modes(np.ones((1, len(model.parameter_names))))
    return ModeTracker((f[0], phi[0, sensors])).fit_transform(records)
