"""
From an alarm to the damaged elements
=====================================

A footbridge of three equal spans is monitored for a year. In the next spring, three neighbouring elements of its first
span have lost a part of their stiffness. :func:`~skthermo.studies.identify_damage` says which span has changed and,
given the structure, where in it, element by element, as far as the records tell. The bridge is symmetric, so that
frequencies alone cannot tell the first span from the last; measured mode shapes can.

Run it with ``python examples/plot_located_damage.py``; figures go to the folder ``figures``. It needs
:download:`page_recipes.py` beside it. The guide is :doc:`/guide/identify`.
"""

# sphinx_gallery_thumbnail_number = 2

import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures

from skthermo.fem import Beam, Spring, Structure, add_noise
from skthermo.plotting import StructureDisplay
from skthermo.studies import identify_damage
from skthermo.surrogate import DataInformedFEM

options = command_line().parse_args()
random = np.random.default_rng(0)

# %%
# The structure
# -------------
# A deck of 30 beams on four bearings. Its spans are groups of members, and may be damaged each.

N_SPANS, N_BEAMS, LENGTH = 3, 10, 1.8  # spans, beams in each, and length of a beam in m
DECK = {"E": 34e9, "G": 14e9, "density": 2500.0, "A": 0.55, "I_yy": 0.012, "I_zz": 0.2, "J": 0.03}

nodes = {i: (LENGTH * i, 0.0, 0.0) for i in range(N_SPANS * N_BEAMS + 1)}
members = {f"beam {i + 1}": Beam(i, i + 1, **DECK) for i in range(N_SPANS * N_BEAMS)}
groups = {f"span {k + 1}": [f"beam {i + 1}" for i in range(k * N_BEAMS, (k + 1) * N_BEAMS)] for k in range(N_SPANS)}
for i in range(0, N_SPANS * N_BEAMS + 1, N_BEAMS):
    members[f"bearing {i}"] = Spring(i, "z", 2e8)
groups |= {"deck": list(members)[: N_SPANS * N_BEAMS], "bearings": [m for m in members if m.startswith("bearing")]}
bridge = Structure(nodes, members, dict.fromkeys(nodes, "x y rx rz"), groups)
model = bridge.assemble(["deck", "bearings"], groups=["span 1", "span 2", "span 3", "bearings"], n_modes=6)
print(model.frequencies([[1.0, 1.0]]).round(2))

# %%
# A healthy year, and a spring with damage
# ----------------------------------------
# Temperature softens the deck and stiffens the bearings in frost. ``divide`` gives a model in which beams 4 to 6 are a
# damage group of their own, which takes the place of the real bridge here.

days = pd.date_range("2024-01-01", periods=450, freq="D")
air = 10 - 11 * np.cos(2 * np.pi * np.arange(450) / 366) + pd.Series(random.normal(0, 9, 450)).ewm(4).mean()
T = pd.DataFrame({"air": air.to_numpy(), "deck": air.ewm(2).mean() + random.normal(0, 0.2, 450)}).set_index(days)
theta = np.column_stack([1 - 0.0035 * (T["deck"] - 10), 1 + 0.3 / (1 + np.exp(T["air"]))])
truth = bridge.divide(model, {"span 1": {"damaged": ["beam 4", "beam 5", "beam 6"]}}).damaged({"damaged": 0.3})
columns = [f"f{i + 1}" for i in range(6)]
F = np.vstack([model.frequencies(theta[:366]), truth.frequencies(theta[366:])])
F = pd.DataFrame(add_noise(F, 0.002, random_state=1), days, columns)
fem = DataInformedFEM(model, random_state=0).fit(T[:366], F[:366])

# %%
# Where is the damage?
# --------------------
# Each stretch of neighbouring beams may be damaged, as may whole spans and the bearings. What frequencies cannot tell
# apart stays together: the same place in the first and in the last span, one the mirror image of the other.

located = identify_damage(fem, T[366:], F[366:], structure=bridge, random_state=0)
print(located.summary())
print(located.groups.round(2))
colours = {"cmap": "viridis_r", "limits": (0, 1), "label": "probability of damage"}
StructureDisplay.from_structure(bridge, located.table["probability"], **colours)

# %%
# Mode shapes of both states, measured at nine points of the deck with an error of 2 %, break the symmetry.

dofs = [bridge.dofs.index((i, "z")) for i in range(3, 30, 3)]
shapes = [one.modes(theta[[370]])[1][0][dofs] for one in (model, truth)]
shapes = [shape + 0.02 * np.abs(shape).max(axis=0) * random.normal(size=shape.shape) for shape in shapes]
measured = {"shapes": tuple(shapes), "dofs": dofs, "shape_noise": 0.02}
with_shapes = identify_damage(fem, T[366:], F[366:], structure=bridge, random_state=0, **measured)
print(with_shapes.summary())
StructureDisplay.from_structure(bridge, with_shapes.table["probability"], **colours)

# %%
# Each beam has its own probability and severity; ``likely_members`` gives the fewest that hold the damage with a
# probability of your choice.

print(with_shapes.table.loc[with_shapes.likely_members(), ["element", "probability", "severity"]].round(2))

save_figures(options.figures)
