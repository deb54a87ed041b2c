"""Which parameters of the truss six frequencies tell."""

from skthermo.datasets import make_truss
from skthermo.updating import identifiability, select_parameters, sensitivity

truss = make_truss()
known, fewer = identifiability(truss, noise=0.001), identifiability(make_truss(n_modes=3), noise=0.001)
with_shapes = identifiability(truss, noise=0.001, dofs=[1, 5, 9], shape_noise=0.01)
RESULTS = {
    "sensitivity": sensitivity(truss),
    "selected": select_parameters(sensitivity(truss)),
    "deviations": known.deviations,
    "with shapes": with_shapes.deviations,
    "recommended": [list(known.recommended), len(fewer.recommended)],
    "ranks": [known.rank, fewer.rank],
}
TOLERANCES = {"*": {"rtol": 1e-4}, "sensitivity": {"rtol": 1e-7}}
