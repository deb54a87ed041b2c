"""The paper's inverse, trained on simulations, and the network's layers."""

import numpy as np
from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss
from skthermo.surrogate import InverseSurrogate, paper_network

model = make_truss()
inverse = InverseSurrogate(model, Ridge(1e-6), bounds=0.2, n_samples=400, noise=0.0, random_state=0).fit()
theta = np.array([[0.95, 1.05, 0.9, 1.0], [1.1, 1.0, 0.97, 1.0]])
RESULTS = {
    "inverted": inverse.transform(model.frequencies(theta))[:, :3],
    "samples": inverse.samples_.theta[:2],
    "bounds": inverse.bounds_,
    "layers": list(paper_network("kw51-inverse", alpha=0.01).hidden_layer_sizes),
}
TOLERANCES = {"inverted": {"rtol": 0.003}}
