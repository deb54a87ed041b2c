"""Structures with a value for each member, or in their modes, seen in a plane or in space."""

from __future__ import annotations

import itertools
from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array, Label, real_array
from skthermo._core.estimators import last_step
from skthermo.fem import FEModel, Structure
from skthermo.plotting._display import (
    BLACK,
    COLOURS,
    GREY,
    LIGHT,
    ORANGE,
    Display,
    drawing,
    legend_columns,
    panels,
    plain,
    pyplot,
    shortened,
)

if TYPE_CHECKING:
    from matplotlib.artist import Artist
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection
    from matplotlib.colorbar import Colorbar
    from matplotlib.lines import Line2D


@dataclass(eq=False, repr=False)
class StructureDisplay(Display):
    """Members of a structure, coloured by value or by group, or moved by its modes, and its supports.

    A structure whose nodes and motions lie in one plane is drawn in that plane, any other in space. A triangle marks a
    node that is held in a direction in which others move: filled where it is held in every such direction.

    Springs to the ground and point masses are drawn as diamonds, where they have a value or are in one of the groups.

    It is best made by `from_structure`.

    Parameters
    ----------
    structure : Structure
        What is drawn.
    values : ndarray of shape (n_members,), optional
        Value of each member in the order of ``structure.members``; NaN draws a member in grey.
    groups : sequence of str, optional
        Groups that get a colour each, and a line in the legend; with shapes, those whose members are drawn.
    label : str, optional
        Label of the colour bar, with its unit.
    shapes : ndarray of shape (n_dofs, n_modes), optional
        Mode shapes, rows as in ``structure.dofs``: a panel for each, over the structure at rest.
    titles : sequence of str, optional
        Titles of the panels of modes.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    members_ : dict
        Collections of lines, surfaces and points, by ``"lines"``, ``"surfaces"`` and ``"points"``, by group, or of the
        moved lines by mode, from 0.
    colorbar_ : Colorbar or None
        None without values.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import kw51_structure
    >>> from skthermo.plotting import StructureDisplay
    >>> errors = {"arch": 0.2, "girders": 0.5, "braces": 1.4}
    >>> display = StructureDisplay.from_structure(kw51_structure(), errors, label="error (%)")
    >>> display.colorbar_.ax.get_ylabel(), display.members_["lines"].get_clim()
    ('error (%)', (0.2, 1.4))
    >>> plt.close(display.figure_)
    >>> display = StructureDisplay.from_structure(kw51_structure(), modes=[0])
    >>> display.ax_.get_title()
    '$f_{1}$ = 0.477 Hz'
    >>> plt.close(display.figure_)
    """

    structure: Structure
    values: Array | None = None
    _: KW_ONLY
    groups: Sequence[str] | None = None
    label: str | None = None
    shapes: Array | None = None
    titles: Sequence[str] = ()

    @classmethod
    def from_structure(
        cls,
        structure: Structure,
        values: Mapping[Hashable, float] | ArrayLike | None = None,
        *,
        groups: Sequence[str] | None = None,
        label: str | None = None,
        model: FEModel | None = None,
        modes: Sequence[int] | None = None,
        **options: object,
    ) -> StructureDisplay:
        """Draw a structure, or its modes.

        Parameters
        ----------
        structure : Structure
            Nodes, members, groups and supports.
        values : mapping of group or member to float, or array-like of shape (n_members,), optional
            What colours the members. A member's own value comes before its group's; members without a value are grey.
        groups : sequence of str, optional
            Without values: groups that get a colour each; the last is drawn on top. Of modes, groups whose members are
            drawn; by default all members.
        label : str, optional
            Label of the colour bar, with its unit.
        model : FE model, optional
            Assembled from the structure, with the method ``modes``: its modes are drawn, with all parameters 1.
        modes : sequence of int, optional
            Columns of the model, from 0, that are drawn; by default all. Without a model, modes are those of the
            structure with its groups as parameters.
        **options : dict
            Options of `plot`.

        Returns
        -------
        StructureDisplay

        Raises
        ------
        ValueError
            If a group, member or mode is unknown, two groups give a member different values, or the number of values is
            not that of the members; if the model has no mode shapes of the structure's degrees of freedom.
        """
        check_structure(structure, groups)
        if values is not None and not (groups is None and model is None and modes is None):
            raise ValueError("values are given beside groups or modes; expected one of them")
        if model is not None or modes is not None:
            shapes, titles = shapes_of(structure, model, modes)
            return cls(structure, groups=groups, shapes=shapes, titles=titles).plot(**options)
        by_member = None if values is None else values_by_member(structure, values)
        return cls(structure, by_member, groups=groups, label=label).plot(**options)

    @classmethod
    def from_estimator(
        cls, detector: Any, structure: Structure, *, level: float = 0.9, **options: object
    ) -> StructureDisplay:
        """Draw which damage a fitted detector finds: the smallest loss of stiffness of each member's group.

        Members of groups of which not even a whole loss is found are grey, as are those of no group.

        Parameters
        ----------
        detector : DirectionalDetector, CompensatedDetector with one, or Pipeline
            Fitted, with directions of the structure's damage groups.
        structure : Structure
            Nodes, members, groups and supports.
        level : float, default=0.9
            Share of the records that has to raise an alarm.
        **options : dict
            Options of `plot`.

        Returns
        -------
        StructureDisplay

        Raises
        ------
        ValueError
            If the detector has no directions, or the structure lacks groups of these.

        Examples
        --------
        >>> import matplotlib.pyplot as plt
        >>> from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
        >>> from skthermo.detection import DirectionalDetector
        >>> from skthermo.plotting import StructureDisplay
        >>> detector = DirectionalDetector(make_truss()).fit(make_truss_campaign(random_state=0).frequencies)
        >>> display = StructureDisplay.from_estimator(detector, truss_structure())
        >>> display.colorbar_.ax.get_xlabel()
        'smallest loss found (%)'
        >>> plt.close(display.figure_)
        """
        last = last_step(detector)
        if not hasattr(last, "minimum_detectable_damage"):
            raise ValueError(
                f"detector is {detector!r:.200}; expected a fitted DirectionalDetector, or a pipeline with one last"
            )
        found = 100 * last.minimum_detectable_damage(level)
        return cls.from_structure(structure, found, label="smallest loss found (%)", **options)

    def plot(
        self,
        ax: Axes | np.ndarray | None = None,
        *,
        cmap: str = "viridis",
        limits: tuple[float, float] | None = None,
        linewidth: float | Mapping[str, float] | None = None,
        amplitude: float = 0.06,
        n_columns: int = 2,
    ) -> StructureDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each mode; three-dimensional for a structure in space, and where a plane one should be drawn there.
            A new figure by default.
        cmap : str, default="viridis"
            Colour map of the values.
        limits : tuple of float, optional
            Values at the ends of the colour map; by default the lowest and the highest.
        linewidth : float or mapping of group to float, optional
            Width of lines in points; by default 2.5, and 1.5 of modes.
        amplitude : float, default=0.06
            Largest displacement of a mode, as a share of the structure's extent.
        n_columns : int, default=2
            Panels of modes beside each other in a new figure.

        Returns
        -------
        StructureDisplay
            Itself.
        """
        if self.shapes is not None:
            return self._draw_modes(ax, amplitude, 1.5 if linewidth is None else linewidth, n_columns)
        is_own_figure = ax is None
        linewidth = 2.5 if linewidth is None else linewidth
        view = Projection.facing(self.structure, ax)
        nodes = np.array(list(view.nodes.values()))
        self.axes_ = structure_axes(ax, view, ["one display"], nodes, width=9.0, n_columns=1)
        self.members_: dict[str, Collection] = {}
        if self.values is not None:
            width = 2.5 if isinstance(linewidth, Mapping) else float(linewidth)
            self._draw_values(view, self.values, cmap, limits, width)
        else:
            self._draw_groups(view, linewidth)
        supports = draw_supports(self.ax_, view)
        if is_own_figure and view.is_space:
            room = {"left": 0.03, "right": 0.97 if self.values is None else 0.87, "top": 0.97}
            self.ax_.get_gridspec().update(bottom=0.9 / self.figure_.get_figheight(), **room)
        set_view(self.ax_, nodes, is_own_figure)
        is_low = is_own_figure and not view.is_space and height_of(nodes) < 0.4  # no room beside it
        is_beside = is_own_figure and view.is_space
        self.colorbar_ = None if self.values is None else self._draw_colorbar(is_low, is_beside)
        self._draw_legend(view, supports, is_own_figure)
        return self

    def _draw_modes(self, ax: Axes | np.ndarray | None, amplitude: float, width: object, n_columns: int) -> Self:
        """A panel for each mode: moved members over those at rest."""
        view = Projection.facing(self.structure, ax)
        rest, moved = view.nodes, [moved_nodes(view, shape, amplitude) for shape in self.shapes.T]
        points = np.array([place for places in (rest, *moved) for place in places.values()])
        self.axes_ = structure_axes(ax, view, self.titles, points, width=5.0, n_columns=n_columns)
        self.members_: dict[object, Collection] = {}
        self.colorbar_ = None
        all_groups = self.structure.groups
        drawn = self.structure.members if self.groups is None else set().union(*(all_groups[g] for g in self.groups))
        _, lines, surfaces = sort_members(self.structure, [name for name in self.structure.members if name in drawn])
        for mode, (one, places, title) in enumerate(zip(self.axes_, moved, self.titles, strict=True)):
            for nodes, colour in ((rest, LIGHT), (places, ORANGE)) if surfaces else ():
                add_members(one, self.structure, nodes, "surfaces", surfaces, facecolors=colour, alpha=0.3)
            if lines:
                add_members(one, self.structure, rest, "lines", lines, colors=LIGHT, linewidths=0.8, zorder=1)
                style = {"colors": ORANGE, "linewidths": width, "zorder": 2}
                self.members_[mode] = add_members(one, self.structure, places, "lines", lines, **style)
            draw_supports(one, view, size=7)
            place = one.get_position(original=True)
            set_view(one, points, is_own=ax is None)
            one.set_title(title, fontsize="medium")
            if ax is None and view.is_space:  # the enlarged axes would move the title away from the panel
                enlarged = one.get_position(original=True)
                one.set_title(title, fontsize="medium", y=1.0)
                one.title.set_y((place.y1 - enlarged.y0) / enlarged.height)
        return self

    def _draw_values(
        self, view: Projection, values: Array, cmap: str, limits: tuple[float, float] | None, width: float
    ) -> None:
        """Members in the colours of their values; those without are grey and thin, and surfaces among them left out."""
        known = values[np.isfinite(values)]
        low, high = limits or ((known.min(), known.max()) if known.size else (0.0, 1.0))
        colours = pyplot().get_cmap(cmap).with_extremes(bad=LIGHT)
        nodes = view.nodes
        of_member = dict(zip(self.structure.members, values, strict=True))
        points, lines, surfaces = sort_members(
            self.structure, sorted(of_member, key=lambda m: np.nan_to_num(of_member[m], nan=-np.inf))
        )
        surfaces = [name for name in surfaces if np.isfinite(of_member[name])] or surfaces
        for kind, names in (("surfaces", surfaces), ("lines", lines)):
            if names:
                shown = np.ma.masked_invalid([of_member[name] for name in names])
                widths = np.where(np.ma.getmaskarray(shown), 0.8, width)
                style = {"alpha": 0.7} if kind == "surfaces" else {"linewidths": widths}
                drawn = add_members(self.ax_, self.structure, nodes, kind, names, cmap=colours, **style)
                drawn.set_array(shown)
                drawn.set_clim(low, high)
                self.members_[kind] = drawn
        points = [name for name in points if np.isfinite(of_member[name])]
        if points:
            style = {"c": [of_member[name] for name in points], "cmap": colours, "vmin": low, "vmax": high, "zorder": 4}
            self.members_["points"] = add_members(self.ax_, self.structure, nodes, "points", points, **style)

    def _draw_colorbar(self, is_low: bool, is_beside: bool) -> Colorbar:
        """Colour bar; in a new figure above a low structure, or beside the cell that one in space fills."""
        shown = next(self.members_[kind] for kind in ("lines", "surfaces", "points") if kind in self.members_)
        place = {"ax": self.ax_, "shrink": 0.8, "pad": 0.02}
        if is_low:
            self.figure_.set_figheight(self.figure_.get_figheight() + 0.5)
            place = {"ax": self.ax_, "location": "top", "shrink": 0.5, "aspect": 40, "pad": 0.05}
        if is_beside:
            place = {"cax": self.figure_.add_axes((0.91, 0.25, 0.015, 0.6))}
        return self.figure_.colorbar(shown, label=plain(self.label or ""), **place)

    def _draw_groups(self, view: Projection, linewidth: float | Mapping[str, float]) -> None:
        groups, nodes = self.structure.groups, view.nodes
        widths = linewidth if isinstance(linewidth, Mapping) else {}
        width = 2.5 if isinstance(linewidth, Mapping) else float(linewidth)
        coloured = dict(zip(self.groups or (), itertools.cycle(COLOURS), strict=False))
        rest = set(self.structure.members).difference(*(groups[group] for group in coloured))
        parts: dict[str, tuple[Iterable[Hashable], str]] = {"other members": (rest, GREY if not coloured else LIGHT)}
        parts |= {group: (groups[group], colour) for group, colour in coloured.items()}
        for name, (members, colour) in parts.items():
            points, lines, surfaces = sort_members(self.structure, members)
            drawn = {
                "points": (points if name in coloured else [], {"c": colour, "zorder": 4}),
                "surfaces": (surfaces, {"facecolors": colour, "alpha": 0.35}),
                "lines": (lines, {"colors": colour, "linewidths": widths.get(name, width)}),
            }
            for kind, (some, style) in drawn.items():
                if some:
                    added = add_members(self.ax_, self.structure, nodes, kind, some, label=name, **style)
                    self.members_[name] = added

    def _draw_legend(self, view: Projection, supports: Mapping[str, Artist], is_own_figure: bool) -> None:
        handles = [*(self.members_.values() if self.groups else ()), *supports.values()]
        if not handles:
            return
        labels = [shortened(handle.get_label()) for handle in handles]
        style = {"ncols": legend_columns(labels, self.figure_, 5), "frameon": False, "fontsize": "small"}
        if not is_own_figure:
            self.ax_.legend(handles, labels, loc="upper center", bbox_to_anchor=(0.5, 0.0), **style)
        else:
            place = "lower center" if view.is_space else "outside lower center"
            self.figure_.legend(handles, labels, loc=place, **style)


def shapes_of(structure: Structure, model: FEModel | None, modes: Sequence[int] | None) -> tuple[Array, list[str]]:
    """Mode shapes of a model of the structure with all parameters 1, (n_dofs, n_modes), and a title for each."""
    if not structure.dofs:
        raise ValueError(f"{structure!r} has no labels of degrees of freedom; expected (node, direction) of each")
    if model is None:
        if not structure.groups:
            raise ValueError("structure has no groups; expected model, such as structure.assemble(...)")
        model = structure.assemble(sorted(structure.groups), n_modes=max(modes or [0]) + 1)
    if not hasattr(model, "modes"):
        raise ValueError(f"{model!r:.200} has no method 'modes'; expected a model assembled from the structure")
    frequencies, shapes = model.modes(np.ones((1, len(model.parameter_names))))
    if shapes.shape[1] != len(structure.dofs):
        expected = f"expected the structure's {len(structure.dofs)}"
        raise ValueError(f"the model's shapes have {shapes.shape[1]} degrees of freedom; {expected}")
    chosen = list(range(model.n_modes) if modes is None else modes)
    if not chosen or any(mode not in range(model.n_modes) for mode in chosen):
        raise ValueError(f"modes is {chosen}; expected numbers from 0 to {model.n_modes - 1}")
    found = {mode: frequencies[0, mode] for mode in chosen}
    titles = [f"$f_{{{mode + 1}}}$ = {f:.{3 if f < 10 else 2}f} Hz" for mode, f in found.items()]
    return shapes[0][:, chosen], titles


def moved_nodes(view: Projection, shape: Array, amplitude: float) -> dict[Hashable, Array]:
    """Places of the nodes in a mode, whose largest displacement is a share of the structure's extent."""
    nodes, axes = view.nodes, view.directions
    moves = {node: np.zeros(len(axes)) for node in nodes}
    for (node, direction), value in zip(dofs_of(view.structure), shape, strict=True):
        if direction in list(axes) and node in moves:
            moves[node][axes.index(direction)] = value
    largest = max(np.linalg.norm(move) for move in moves.values())
    places = np.array(list(nodes.values()))
    scale = amplitude * np.linalg.norm(np.ptp(places, axis=0)) / (largest or 1.0)
    return {node: nodes[node] + scale * move for node, move in moves.items()}


def values_by_member(structure: Structure, values: Mapping[Hashable, float] | ArrayLike) -> Array:
    """Value of each member, NaN where there is none."""
    members, groups = list(structure.members), structure.groups
    if hasattr(values, "to_dict"):
        values = values.to_dict()
    if not isinstance(values, Mapping):
        array = real_array(values, "values")
        if array.shape != (len(members),):
            raise ValueError(f"values has shape {array.shape}; expected ({len(members)},), one for each member")
        return array
    found: dict[Hashable, float] = {}
    own = [key for key in values if key not in groups]
    for key in [key for key in values if key in groups]:
        for member in groups[key].difference(own):
            if found.setdefault(member, float(values[key])) != float(values[key]):
                raise ValueError(f"member {member!r} is in several groups with different values; expected one value")
    for key in own:
        if key not in structure.members:
            raise ValueError(f"values names {key!r}; expected members, or groups among {sorted(groups)}")
        found[key] = float(values[key])
    return np.array([found.get(member, np.nan) for member in members])


ELEVATION, AZIMUTH = 22, -60


@dataclass(frozen=True)
class Projection:
    """A structure seen along the normal of its plane, or in space."""

    structure: Structure
    directions: str
    """Those of the horizontal and the vertical axis, such as "xz", or "xyz"."""

    @classmethod
    def facing(cls, structure: Structure, ax: Axes | np.ndarray | None = None) -> Projection:
        """In the plane that nodes and motions lie in, if there is one; in space if such axes are given."""
        if structure.dimension == 2:
            return cls(structure, "xy")
        if not any(hasattr(one, "get_zlim") for one in np.ravel(np.asarray(ax, dtype=object))):
            moving = {direction for _, direction in dofs_of(structure)}
            extent = np.ptp(list(structure.nodes.values()), axis=0)
            for normal in "yzx":  # a structure along one line is drawn with z upwards, if it moves there
                plane = "xyz".replace(normal, "")
                if extent["xyz".index(normal)] == 0 and moving <= {*plane, f"r{normal}"}:
                    return cls(structure, plane)
        return cls(structure, "xyz")

    @property
    def is_space(self) -> bool:
        return len(self.directions) == 3

    @property
    def nodes(self) -> dict[Hashable, Array]:
        """Coordinates of every node along the directions."""
        columns = ["xyz".index(direction) for direction in self.directions]
        return {node: place[columns] for node, place in self.structure.nodes.items()}

    @property
    def supports(self) -> dict[Hashable, bool]:
        """Nodes that are held in a direction in which others move, and whether in every such direction."""
        moving = ({direction for _, direction in dofs_of(self.structure)} or set("xyz")).intersection(self.directions)
        held = {node: moving.intersection(along) for node, along in self.structure.supports.items()}
        return {node: fixed == moving for node, fixed in held.items() if fixed}


def dofs_of(structure: Structure) -> list[Label]:
    """Nodes and directions of the degrees of freedom, with directions called "x" to "rz" where they are known."""
    names = ("x", "y", "z", "rx", "ry", "rz")
    others: dict[object, str] = dict(enumerate(names, start=1))  # by which other programs call them
    for name in names:
        rotated, axis = len(name) == 2, name[-1].upper()
        others |= {f"{'ROT' if rotated else 'U'}{axis}": name, f"{'DR' if rotated else 'D'}{axis}": name}
    return [(node, others.get(direction, direction)) for node, direction in structure.dofs]


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
