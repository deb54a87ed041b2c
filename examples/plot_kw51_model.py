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
import numpy as np
from matplotlib.lines import Line2D
from mpl_toolkits.mplot3d.art3d import Line3DCollection, Poly3DCollection

from skthermo.datasets import kw51_structure, make_kw51

COLOURS = {  # Okabe and Ito's palette
    "arch": "#D55E00",
    "pipes": "#0072B2",
    "braces": "#009E73",
    "connections": "#000000",
    "girders": "#CC79A7",
    "transverse_beams": "#56B4E9",
    "stiffeners": "#E69F00",
}
WIDTHS = {"arch": 3.0, "pipes": 2.5, "braces": 1.6, "connections": 2.6, "girders": 2.5, "stiffeners": 0.6}
SKELETON = ("transverse_beams", "girders", "connections", "braces", "pipes", "arch")
KINDS = {
    ("arch", "y"): "arches sideways",
    ("deck", "y"): "deck sideways",
    ("deck", "z"): "deck up and down",
    ("arch", "z"): "arches up and down",
}
AMPLITUDE = 6.0  # of the largest displacement drawn, m


def displacements(structure, shape):
    """Translations of every node, (3,), by a mode shape over the structure's degrees of freedom."""
    moved = {node: np.zeros(3) for node in structure.nodes}
    for (node, direction), value in zip(structure.dofs, shape, strict=True):
        if direction in ("x", "y", "z"):
            moved[node]["xyz".index(direction)] = value
    return moved


def kind(moved):
    """Name of a mode by the part that moves most, arches or deck, and its direction."""
    shares = {
        (part, direction): sum(u[axis] ** 2 for node, u in moved.items() if node[0] == part)
        for part in ("arch", "deck")
        for axis, direction in enumerate("xyz")
    }
    return KINDS[max(shares, key=shares.get)]


def segments(structure, group, places):
    """Lines from node to node of a group's members."""
    return [[places[node] for node in structure.members[name].nodes] for name in structure.groups[group]]


def space(fig, places, centre, width):
    """Axes of equal scale around a structure; centre and width in shares of the figure."""
    aspect = fig.get_figwidth() / fig.get_figheight()
    height = width * aspect  # square, as these axes draw inside a square
    ax = fig.add_axes(
        (centre[0] - width / 2, centre[1] - height / 2, width, height),
        projection="3d",
        proj_type="ortho",
        computed_zorder=False,
    )
    points = np.array(list(places.values()))
    low, high = points.min(axis=0), points.max(axis=0)
    ax.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), zlim=(low[2], high[2]))
    ax.set_box_aspect(high - low, zoom=0.97)
    ax.view_init(elev=22, azim=-60)
    ax.set_axis_off()
    ax.patch.set_visible(False)
    return ax


def draw_supports(ax, structure):
    """Triangles below the corners; filled where they also hold along the bridge."""
    free = set(structure.dofs)
    for node, place in structure.nodes.items():
        if (node, "z") not in free:
            fixed = (node, "x") not in free
            ax.plot(*(place - [0, 0, 1.2]), marker="^", ms=11, color="black", mfc="black" if fixed else "white")


def plot_structure(structure):
    """Groups of members and supports."""
    places = structure.nodes
    fig = plt.figure(figsize=(13, 6))
    ax = space(fig, places, centre=(0.5, 0.55), width=1.0)
    plate = segments(structure, "plate", places)
    ax.add_collection3d(Poly3DCollection(plate, facecolor="#BBBBBB", edgecolor="none", alpha=0.35))
    for group, colour in reversed(COLOURS.items()):
        lines = segments(structure, group, places)
        ax.add_collection3d(Line3DCollection(lines, colors=colour, linewidths=WIDTHS.get(group, 1.2)))
    draw_supports(ax, structure)
    handles = [Line2D([], [], color=c, lw=3, label=group.replace("_", " ")) for group, c in COLOURS.items()]
    handles += [
        Line2D([], [], color="#BBBBBB", lw=8, label="plate and ballast"),
        Line2D([], [], ls="", marker="^", ms=9, color="black", label="held in every direction"),
        Line2D([], [], ls="", marker="^", ms=9, color="black", mfc="white", label="free along the bridge"),
    ]
    fig.legend(handles=handles, loc="lower center", ncols=5, frameon=False)
    return fig


def plot_modes(structure, model):
    """Six mode shapes over the structure at rest."""
    frequencies, shapes = model.modes(np.ones((1, len(model.parameter_names))))
    fig = plt.figure(figsize=(13, 9.5))
    for mode in range(model.n_modes):
        row, column = divmod(mode, 2)
        centre = (0.25 + 0.5 * column, 0.8 - 0.32 * row)
        ax = space(fig, structure.nodes, centre, width=0.5)
        moved = displacements(structure, shapes[0, :, mode])
        scale = AMPLITUDE / max(np.abs(u).max() for u in moved.values())
        places = {node: place + scale * moved[node] for node, place in structure.nodes.items()}
        for group in SKELETON:
            width = WIDTHS.get(group, 1.0) / 2
            rest, deformed = segments(structure, group, structure.nodes), segments(structure, group, places)
            if group in ("arch", "girders"):
                ax.add_collection3d(Line3DCollection(rest, colors="#999999", linewidths=1, linestyles="--"))
            ax.add_collection3d(Line3DCollection(deformed, colors=COLOURS[group], linewidths=width))
        title = f"$f_{mode + 1}$ = {frequencies[0, mode]:.3f} Hz: {kind(moved)}"
        fig.text(centre[0], centre[1] + 0.135, title, ha="center", fontsize=12)
    return fig


def draw(structure, model, folder):
    """Both figures."""
    figures = {"kw51_structure": plot_structure(structure), "kw51_modes": plot_modes(structure, model)}
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        figure.savefig(folder / f"{name}.png", dpi=130)
        plt.close(figure)
    return [folder / f"{name}.png" for name in figures]


def main():
    parser = argparse.ArgumentParser(description="The railway bridge KW51 as an FE model.")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figures")
    options = parser.parse_args()
    structure, model = kw51_structure(), make_kw51()
    print(structure, model, "\nFigures:", sep="\n")
    print(*draw(structure, model, folder=options.figures), sep="\n")


if __name__ == "__main__":
    main()
