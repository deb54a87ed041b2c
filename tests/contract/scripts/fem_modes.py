"""Which measured mode is which: MAC, pairs, chosen and tracked modes, shapes at sensors."""

import numpy as np

from skthermo.datasets import make_truss
from skthermo.fem import evaluate_modes, mac, match_modes

truss = make_truss()
nominal, shapes = evaluate_modes(truss, [[1.0] * 4], dofs=[0, 3, 8])
changed, others = evaluate_modes(truss, [[0.7, 1.0, 1.2, 1.0]], dofs=[0, 3, 8])
tracked = make_truss().with_modes([0, 2, 4])
RESULTS = {
    "mac": mac(shapes[0], others[0]),
    "same": np.diag(mac(shapes[0], shapes[0])),
    "pairs": match_modes(truss, [7.6, 27.1, 62.0, 38.0]),
    "by shape": match_modes(truss, nominal[0][[1, 0]], shapes=shapes[0][:, [1, 0]], dofs=[0, 3, 8])["mode"],
    "chosen": tracked.frequencies([[1.0] * 4]),
    "fewer parameters": truss.with_parameters(["bottom", "diagonal"]).frequencies([[0.9, 1.1]]),
}
TOLERANCES = {"*": {"rtol": 1e-6, "atol": 1e-8}}
