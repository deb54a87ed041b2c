"""A model is fitted to frequencies and to shapes at six sensors; models that this leaves open."""

import numpy as np

from skthermo.datasets import make_truss
from skthermo.updating import ModelUpdater

truss, truth, dofs = make_truss(), [[0.9, 1.1, 0.95, 1.0]], [1, 5, 9, 13, 17, 21]
frequencies, shapes = truss.modes(truth)
weight = np.sqrt(2 * (len(dofs) - 1)) / 0.01**2
updater = ModelUpdater(truss, shape_weight=weight, random_state=0)
updater.fit(frequencies, shapes=shapes[0][dofs], dofs=dofs, frequency_std=0.001 * frequencies[0])
few = ModelUpdater(truss.with_parameters(["bottom", "diagonal"]), bounds=0.6, prior=0.15)
few.fit(frequencies, frequency_std=0.005 * frequencies[0])
models = few.sample_models(5, random_state=0)
sampled = np.array([model.frequencies(np.ones((1, len(model.parameter_names))))[0] for model in models])
RESULTS = {
    "theta": updater.theta_,
    "open": [len(models), bool(np.abs(sampled / frequencies[0] - 1).max() < 0.03)],
}
TOLERANCES = {"theta": {"rtol": 2e-3}}
