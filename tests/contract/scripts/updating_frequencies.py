"""A model is fitted to mean frequencies, with a prior and several starts."""

import numpy as np

from skthermo.datasets import make_truss
from skthermo.fem import add_noise
from skthermo.updating import ModelUpdater

truss = make_truss()
exact = ModelUpdater(truss).fit(truss.frequencies([0.9, 1.1, 0.95, 1.05]))
records = add_noise(np.repeat(truss.frequencies([[0.9, 1.1, 0.95, 1.0]]), 100, axis=0), 0.01, random_state=0)
updater = ModelUpdater(truss, prior=0.2, n_starts=2, random_state=0)
updater.fit(records, frequency_std=records.std(axis=0) / 10)
RESULTS = {
    "exact": exact.theta_,
    "theta": updater.theta_,
    "errors": updater.table_[["error_before", "error_after"]],
    "deviations": np.sqrt(np.diag(updater.covariance_)),
    "model": updater.model_.frequencies([[1.0] * 4]),
    "starts": len(updater.starts_),
}
TOLERANCES = {"*": {"rtol": 1e-3, "atol": 1e-4}}
