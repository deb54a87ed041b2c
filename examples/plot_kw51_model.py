"""
KW51: a railway bridge as an FE model
=====================================

The tied arch of Kamali, Ceravolo & Marzani (2026), Appendix A, as :func:`~skthermo.datasets.make_kw51` builds it:
its groups of members, which parameters multiply and damage weakens, its supports, and its six lowest modes.

Run it with ``python examples/plot_kw51_model.py``; it needs :download:`page_recipes.py` beside it.
:doc:`/guide/models` says how to build such a model of your own structure.
"""

# sphinx_gallery_thumbnail_number = 2

from textwrap import fill

from page_recipes import command_line, save_figures

from skthermo.datasets import kw51_structure, make_kw51
from skthermo.plotting import StructureDisplay

options = command_line().parse_args()

# %%
# Members in groups
# -----------------
# A :class:`~skthermo.fem.Structure` has nodes, members, supports, and groups of members. Assembled, it becomes a model
# whose parameters multiply the stiffness of groups: here five moduli that depend on temperature.

structure, model = kw51_structure(), make_kw51()
print(fill(str(structure), 100), model, sep="\n")

# %%
# Lines below are as wide as the members are stout; the last group is drawn on top.

WIDTHS = {  # of lines, in points; the last group is drawn on top
    "stiffeners": 0.6,
    "transverse_beams": 1.2,
    "girders": 2.5,
    "connections": 2.6,
    "braces": 1.6,
    "pipes": 2.5,
    "arch": 3.0,
}
StructureDisplay.from_structure(structure, groups=["plate", *WIDTHS], linewidth=WIDTHS)

# %%
# The six lowest modes
# --------------------
# A mode is named here by what moves most. The third mode is of the deck and lies between modes of the arches: where
# parameters change, modes of different kinds may swap their order. The model therefore follows each mode by its shape
# (``track=True``).

SKELETON = ("transverse_beams", "girders", "connections", "braces", "pipes", "arch")
KINDS = {
    ("arch", "y"): "arches sideways",
    ("deck", "y"): "deck sideways",
    ("deck", "z"): "deck up and down",
    ("arch", "z"): "arches up and down",
}


def kind(structure, shape):
    """Name of a mode by the part that moves most, arches or deck, and its direction."""
    squares = dict.fromkeys([(part, direction) for part in ("arch", "deck") for direction in "xyz"], 0.0)
    for (node, direction), value in zip(structure.dofs, shape, strict=True):
        if (node[0], direction) in squares:
            squares[node[0], direction] += value**2
    return KINDS[max(squares, key=squares.get)]


display = StructureDisplay.from_structure(structure, model=model, groups=SKELETON, amplitude=0.05, linewidth=1.2)
for ax, shape in zip(display.axes_, display.shapes.T, strict=True):
    ax.title.set_text(f"{ax.get_title()}: {kind(structure, shape)}")

# %%
# The method solves the model thousands of times. ``reduced`` makes a model of a few basis vectors with the same
# frequencies, within a tolerance, that is much faster; :doc:`/guide/costs` has numbers.

print(model.reduced(0.3, tol=1e-4, random_state=0))
save_figures(options.figures)
