"""Forces of a strip in tension."""

import numpy as np

from skthermo.fem import Membrane

strip = Membrane(("a", "b", "c", "d"), E=210e9, t=0.015, nu=0.0, density=7850.0)
corners = np.array([[0, 0, 0], [4, 0, 0], [4, 2, 0], [0, 2, 0.0]])
stretch = np.array([0, 0, 0, 1e-3, 0, 0, 1e-3, 0, 0, 0, 0, 0])
RESULTS = {"forces": strip.stiffness(corners)["E", "t"] @ stretch}
TOLERANCES = {"*": {"rtol": 1e-8, "atol": 1e-3}}
