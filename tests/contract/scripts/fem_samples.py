"""Samples of the truss, noise on them, and sensitivities."""

import numpy as np

from skthermo.datasets import make_truss
from skthermo.fem import add_noise, evaluate, linearise, sample

truss = make_truss()
drawn = {method: sample(truss, 0.2, 16, method=method, random_state=0) for method in ("uniform", "lhs", "sobol")}
frequencies, slopes = linearise(truss, [[1.0] * 4], relative=True)
RESULTS = {
    "ranges": [[float(one.theta.min()) >= 0.8, float(one.theta.max()) <= 1.2] for one in drawn.values()],
    "uniform": drawn["uniform"].theta[:2],
    "solved": drawn["uniform"].frequencies[:2],
    "gaps": evaluate(truss, [[0.9, np.nan, 1.0, 1.0]]),
    "slopes": slopes,
    "noise": add_noise(np.full((4, 2), 4.0), [0.0, 0.01], random_state=0),
}
TOLERANCES = {"*": {"rtol": 1e-6, "atol": 1e-9}}
