"""Two masses on two springs, the second a parameter: frequencies, derivatives, damage, modes."""

import numpy as np

from skthermo.fem import AffineModel

model = AffineModel({(): [[400.0, 0.0], [0.0, 0.0]], ("k",): [[400.0, -400.0], [-400.0, 400.0]]}, np.eye(2), n_modes=2)
frequencies, shapes = model.modes([[1.0]])
RESULTS = {
    "frequencies": model.frequencies([[1.0], [0.5]]),
    "jacobian": model.jacobian([[1.0]]),
    "damaged": model.damaged({"k": 0.5}).frequencies([[1.0]]),
    "shapes": np.abs(shapes),
    "names": [list(model.parameter_names), list(model.groups), model.n_modes, model.n_dof],
}
TOLERANCES = {"*": {"rtol": 1e-8}}
