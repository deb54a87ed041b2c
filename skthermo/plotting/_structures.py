"""How structures are drawn: the plane or space that they are seen in, their members, supports and groups."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from skthermo._core.arrays import Array, Label
from skthermo.fem import Structure
from skthermo.plotting._display import BLACK, drawing, panels, pyplot

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection
    from matplotlib.lines import Line2D

AXES = "xyz"
OTHER_NAMES = {
    "x": (1, "UX", "DX"),
    "y": (2, "UY", "DY"),
    "z": (3, "UZ", "DZ"),
    "rx": (4, "ROTX", "DRX"),
    "ry": (5, "ROTY", "DRY"),
    "rz": (6, "ROTZ", "DRZ"),
}
DIRECTIONS = {name: direction for direction, names in OTHER_NAMES.items() for name in names}
"""Directions by the names that other programs give them."""

ELEVATION, AZIMUTH = 22, -60


@dataclass(frozen=True)
class Projection:
    """A structure seen along the normal of its plane, or in space."""

    structure: Structure
    directions: str
    """Those of the horizontal and the vertical axis, such as "xz", or "xyz"."""

    @classmethod
    def of(cls, structure: Structure, ax: Axes | np.ndarray | None = None) -> Projection:
        """In the plane that nodes and motions lie in, if there is one; in space if such axes are given."""
        if structure.dimension == 2:
            return cls(structure, "xy")
        if not any(hasattr(one, "get_zlim") for one in np.ravel(np.asarray(ax, dtype=object))):
            moving = {direction for _, direction in dofs_of(structure)}
            extent = np.ptp(list(structure.nodes.values()), axis=0)
            for normal in "yzx":  # a structure along one line is drawn with z upwards, if it moves there
                plane = AXES.replace(normal, "")
                if extent[AXES.index(normal)] == 0 and moving <= {*plane, f"r{normal}"}:
                    return cls(structure, plane)
        return cls(structure, AXES)

    @property
    def is_space(self) -> bool:
        return len(self.directions) == 3

    @property
    def nodes(self) -> dict[Hashable, Array]:
        """Coordinates of every node along the directions."""
        columns = [AXES.index(direction) for direction in self.directions]
        return {node: place[columns] for node, place in self.structure.nodes.items()}

    @property
    def supports(self) -> dict[Hashable, bool]:
        """Nodes that are held in a direction in which others move, and whether in every such direction."""
        moving = ({direction for _, direction in dofs_of(self.structure)} or set(AXES)).intersection(self.directions)
        held = {node: moving.intersection(along) for node, along in self.structure.supports.items()}
        return {node: fixed == moving for node, fixed in held.items() if fixed}


def dofs_of(structure: Structure) -> list[Label]:
    """Nodes and directions of the degrees of freedom, with directions called "x" to "rz" where they are known."""
    return [(node, DIRECTIONS.get(direction, direction)) for node, direction in structure.dofs]


def check_structure(structure: object, groups: Iterable[str] | None) -> None:
    """Raise an error for what is not a structure, or for groups that it does not have."""
    if not isinstance(structure, Structure):
        raise ValueError(f"structure is a {type(structure).__name__}; expected a skthermo.fem.Structure")
    for group in groups or ():
        if group not in structure.groups:
            raise ValueError(f"unknown group {group!r}; expected some of {sorted(structure.groups)}")


def structure_axes(
    ax: Axes | np.ndarray | None, view: Projection, names: Sequence[object], points: Array, width: float, n_columns: int
) -> np.ndarray:
    """Axes of a plane or of space for each name: those that are given, or those of a new figure."""
    ratio = height_of(points)
    width /= max(ratio, 1.0)  # tall structures are as high as others are wide
    height = width * ratio + 0.6
    if ax is not None or not view.is_space:
        axes = panels(ax, names, (width, height), n_columns)
        if view.is_space and not all(hasattr(one, "get_zlim") for one in axes):
            raise ValueError("ax is two-dimensional; expected axes of projection='3d' for a structure in space")
        return axes
    n_columns = min(n_columns, len(names))
    n_rows = -(-len(names) // n_columns)
    figure = pyplot().figure(figsize=(width * n_columns, height * n_rows))
    title = 0.4 / height
    room = {"left": 0.02, "right": 0.98, "bottom": 0.02, "top": 1 - title / n_rows, "wspace": 0.04, "hspace": title}
    flat = {"projection": "3d", "proj_type": "ortho", "computed_zorder": False}  # without perspective
    axes = figure.subplots(n_rows, n_columns, squeeze=False, subplot_kw=flat, gridspec_kw=room).ravel()
    for unused in axes[len(names) :]:
        unused.remove()
    return axes[: len(names)]


def height_of(points: Array) -> float:
    """Height of what is seen of points as a share of its width, kept within reason for a figure."""
    if points.shape[1] == 3:
        azimuth, elevation = np.radians([AZIMUTH, ELEVATION])
        across = points[:, 1] * np.cos(azimuth) - points[:, 0] * np.sin(azimuth)
        away = points[:, 0] * np.cos(azimuth) + points[:, 1] * np.sin(azimuth)
        points = np.column_stack([across, points[:, 2] * np.cos(elevation) - away * np.sin(elevation)])
    width, height = np.ptp(points, axis=0)
    return float(np.clip(height / max(width, 1e-9), 0.12, 1.6))


def set_view(ax: Axes, points: Array, is_own: bool) -> None:
    """Equal scales around the points; in space, new axes are enlarged until the points fill their place."""
    ax.set_axis_off()
    if points.shape[1] == 2:
        ax.set_aspect("equal")
        low, high = points.min(axis=0), points.max(axis=0)
        margin = 0.03 * (high - low).max()
        ax.set(xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin))
        return
    low, high = points.min(axis=0), points.max(axis=0)
    extent = np.maximum(high - low, 0.01 * (high - low).max())
    middle = (low + high) / 2
    limits = np.column_stack([middle - extent / 2, middle + extent / 2])
    ax.set(xlim=limits[0], ylim=limits[1], zlim=limits[2])
    ax.set_box_aspect(extent)
    ax.patch.set_visible(False)
    if is_own:
        ax.view_init(elev=ELEVATION, azim=AZIMUTH)
        fill_place(ax, points)


def fill_place(ax: Axes, points: Array) -> None:
    """Enlarge axes so that the projected points fill the place in the figure that these axes had."""
    left, bottom, width, height = ax.get_position(original=True).bounds
    size = ax.figure.get_size_inches()
    ax.set_position((0, 0, *(1 / size)))  # one inch, from the lower left corner
    ax.apply_aspect()
    project = drawing("mpl_toolkits.mplot3d.proj3d").proj_transform
    x, y, _ = project(*points.T, ax.get_proj())
    inches = ax.transData.transform(np.column_stack([x, y])) / ax.figure.dpi
    low, high = inches.min(axis=0), inches.max(axis=0)
    place, room = np.array([left, bottom]) * size, np.array([width, height]) * size
    scale = (room / np.maximum(high - low, 1e-9)).min()
    origin = place + room / 2 - scale * (low + high) / 2
    ax.set_position((*(origin / size), *(scale / size)))


def sort_members(structure: Structure, names: Iterable[Hashable]) -> tuple[list[Hashable], ...]:
    """Names of members that are points, lines and surfaces."""
    elements = structure.members
    points: list[Hashable] = []
    lines: list[Hashable] = []
    surfaces: list[Hashable] = []
    for name in names:
        n_nodes = len(elements[name].nodes)
        (points if n_nodes == 1 else lines if n_nodes == 2 else surfaces).append(name)
    return points, lines, surfaces


def add_members(
    ax: Axes,
    structure: Structure,
    nodes: Mapping[Hashable, Array],
    kind: Literal["points", "lines", "surfaces"],
    names: Iterable[Hashable],
    **style: object,
) -> Collection:
    """Add diamonds, lines or polygons for members with nodes at some places, in two or three dimensions."""
    places = [np.array([nodes[node] for node in structure.members[name].nodes]) for name in names]
    if kind == "points":
        fixed = {"s": 36, "marker": "D", "edgecolors": BLACK, "linewidths": 0.5, "clip_on": False}
        return ax.scatter(*np.vstack(places).T, **fixed, **style)
    name, fixed = (
        ("LineCollection", {"capstyle": "round"}) if kind == "lines" else ("PolyCollection", {"edgecolors": "none"})
    )
    is_space = hasattr(ax, "get_zlim")
    if is_space:
        factory = getattr(drawing("mpl_toolkits.mplot3d.art3d"), name.replace("Coll", "3DColl"))
    else:
        factory = getattr(drawing("matplotlib.collections"), name)
    collection = factory(places, **fixed, **style)
    (ax.add_collection3d if is_space else ax.add_collection)(collection)
    return collection


def draw_supports(ax: Axes, view: Projection, size: float = 11.0) -> dict[str, Line2D]:
    """Triangles below nodes that are held: filled where they are so in every direction, open where some stay free."""
    nodes, supports, drawn = view.nodes, view.supports, {}
    kinds = {True: ("fixed in every direction", BLACK), False: ("free in some direction", "white")}
    for is_fixed, (label, face) in kinds.items():
        places = [nodes[node] for node, fixed in supports.items() if fixed == is_fixed]
        if places:
            drawn[label] = ax.plot(
                *np.array(places).T,
                linestyle="",
                marker=[(0, 0), (-0.7, -1.2), (0.7, -1.2), (0, 0)],  # a triangle with its tip at the node
                markersize=size,
                color=BLACK,
                markerfacecolor=face,
                label=label,
                clip_on=False,
                zorder=3,
            )[0]
    return drawn
