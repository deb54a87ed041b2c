"""
KW51: a railway bridge as an FE model
=====================================

The tied arch of Kamali, Ceravolo & Marzani (2026), Appendix A, as :func:`~skthermo.datasets.make_kw51` builds it:
its groups of members, which parameters multiply and damage weakens, its supports, and its six lowest modes.

Run it with ``python examples/plot_kw51_model.py``; figures go to the folder ``figures``.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt

from skthermo.datasets import kw51_structure, make_kw51
from skthermo.plotting import ModeShapesDisplay, StructureDisplay

WIDTHS = {  # of lines, in points; the last group is drawn on top
    "stiffeners": 0.6,
    "transverse_beams": 1.2,
    "girders": 2.5,
    "connections": 2.6,
    "braces": 1.6,
    "pipes": 2.5,
    "arch": 3.0,
}
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


def draw(structure, model, folder):
    """Groups of members and supports, and mode shapes over the structure at rest."""
    modes = ModeShapesDisplay.from_structure(structure, model, groups=SKELETON, amplitude=0.05, linewidth=1.2)
    for ax, shape in zip(modes.axes_, modes.shapes.T, strict=True):
        ax.title.set_text(f"{ax.get_title()}: {kind(structure, shape)}")
    members = StructureDisplay.from_structure(structure, groups=["plate", *WIDTHS], linewidth=WIDTHS)
    folder.mkdir(parents=True, exist_ok=True)
    for name, display in {"kw51_structure": members, "kw51_modes": modes}.items():
        display.figure_.savefig(folder / f"{name}.png", dpi=130)
        plt.close(display.figure_)
    return [folder / "kw51_structure.png", folder / "kw51_modes.png"]


def main():
    parser = argparse.ArgumentParser(description="The railway bridge KW51 as an FE model.")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figures")
    options = parser.parse_args()
    structure, model = kw51_structure(), make_kw51()
    print(structure, model, "\nFigures:", sep="\n")
    print(*draw(structure, model, folder=options.figures), sep="\n")


if __name__ == "__main__":
    main()
