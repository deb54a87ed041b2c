"""A reduced model agrees with the full one to the error that it states."""

import numpy as np

from skthermo.datasets import make_truss

truss = make_truss()
reduced = truss.reduced(bounds=0.2, random_state=0)
theta = [[0.9, 1.1, 1.0, 0.85]]
RESULTS = {
    "frequencies": reduced.frequencies(theta),
    "error": bool(reduced.error_ < 1e-5),
    "agrees": bool(np.abs(reduced.frequencies(theta) / truss.frequencies(theta) - 1).max() < 1e-5),
    "damaged": reduced.damaged({"top": 0.1}).frequencies(theta),
}
TOLERANCES = {"*": {"rtol": 2e-5}}
