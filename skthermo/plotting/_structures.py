"""Structures with a value for each member, or in their modes, seen in a plane or from a side."""

from __future__ import annotations

from collections.abc import Hashable, Iterable, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

import skthermo.plotting._display as shared
from skthermo._core.arrays import Array, Label, real_array
from skthermo._core.estimators import last_step
from skthermo.fem import FEModel, Structure
from skthermo.plotting._display import BLACK, COLOURS, GREY, LIGHT, ORANGE, Display

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.collections import Collection

Places = Mapping[Hashable, Array]


@dataclass(eq=False, repr=False)
class StructureDisplay(Display):
    """Members of a structure, coloured by value or by group, or moved by its modes, and its supports.

    A structure whose nodes and motions lie in one plane is drawn in that plane, any other as it is seen from a side and
    from above. A triangle marks a node that is held in a direction in which others move: filled where it is held in
    every such direction.

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
    >>> from skthermo.datasets import kw51_structure, truss_structure
    >>> from skthermo.plotting import StructureDisplay
    >>> errors = {"arch": 0.2, "girders": 0.5, "braces": 1.4}
    >>> display = StructureDisplay.from_structure(kw51_structure(), errors, label="error (%)")
    >>> display.colorbar_.ax.get_xlabel(), display.members_["lines"].get_clim()
    ('error (%)', (0.2, 1.4))
    >>> plt.close(display.figure_)
    >>> display = StructureDisplay.from_structure(truss_structure(), modes=[0])
    >>> display.ax_.get_title()
    '$f_{1}$ = 7.485 Hz'
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
        if not isinstance(structure, Structure):
            raise ValueError(f"structure is a {type(structure).__name__}; expected a skthermo.fem.Structure")
        if unknown := [group for group in groups or () if group not in structure.groups]:
            raise ValueError(f"unknown group {unknown[0]!r}; expected some of {sorted(structure.groups)}")
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
        view: tuple[float, float] | None = None,
    ) -> StructureDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each mode. A new figure by default.
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
        view : tuple of float, optional
            Elevation and azimuth in degrees from which a structure in space is seen, as matplotlib counts them. By
            default (22, -60), or along the normal of the plane that its nodes and motions lie in.

        Returns
        -------
        StructureDisplay
            Itself.

        Raises
        ------
        ValueError
            If the axes are not plane ones.
        """
        axes = axes_of_view(self.structure, view)
        rest = {node: place @ axes for node, place in self.structure.nodes.items()}
        shapes = () if self.shapes is None else self.shapes.T
        moved = [moved_nodes(self.structure, shape, amplitude, axes) for shape in shapes]
        seen = np.array([place for places in (rest, *moved) for place in places.values()])
        (width, height), margin = np.ptp(seen, axis=0), 0.03 * np.ptp(seen, axis=0).max()
        low, high = seen.min(axis=0) - margin, seen.max(axis=0) + margin
        ratio = float(np.clip(height / max(width, 1e-9), 0.12, 1.6))
        width = (5.0 if moved else 9.0) / max(ratio, 1.0)  # tall structures are as high as others are wide
        is_low = ax is None and ratio < 0.4  # a colour bar has no room beside it
        size = width, width * ratio + (1.1 if is_low and self.values is not None else 0.6)
        self.axes_ = shared.panels(ax, self.titles if moved else ["one display"], size, n_columns)
        if any(hasattr(one, "get_zlim") for one in self.axes_):
            raise ValueError("ax is three-dimensional; expected plane axes, and view to look from another side")
        self.members_: dict[Any, Collection] = {}
        self.colorbar_ = None
        if moved:
            self._draw_modes(rest, moved, 1.5 if linewidth is None else linewidth)
        elif self.values is not None:
            self._draw_values(rest, cmap, limits, 2.5 if linewidth is None else linewidth)
            shown = next(self.members_[kind] for kind in ("lines", "surfaces", "points") if kind in self.members_)
            place = {"location": "top", "shrink": 0.5, "aspect": 40} if is_low else {"shrink": 0.8, "pad": 0.02}
            self.colorbar_ = self.figure_.colorbar(shown, ax=self.ax_, label=shared.plain(self.label or ""), **place)
        else:
            self._draw_groups(rest, 2.5 if linewidth is None else linewidth)
        for one in self.axes_:
            draw_supports(one, self.structure, rest, axes, size=7.0 if moved else 11.0)
            one.set_axis_off()
            one.set(aspect="equal", xlim=(low[0], high[0]), ylim=(low[1], high[1]))
        if not moved:
            shared.legend(self.axes_, ax is None, n_columns=5, side="lower")
        return self

    def _draw_modes(self, rest: Places, moved: Sequence[Places], width: Any) -> None:
        """A panel for each mode: moved members over those at rest."""
        members, groups = self.structure.members, self.structure.groups
        drawn = members if self.groups is None else set().union(*(groups[name] for name in self.groups))
        by_kind = by_number_of_nodes(self.structure, [name for name in members if name in drawn])
        for mode, (one, places, title) in enumerate(zip(self.axes_, moved, self.titles, strict=True)):
            for kind in [kind for kind in by_kind if kind != "points"]:
                self._add(one, rest, kind, by_kind[kind], LIGHT, width=0.8)
                self.members_[mode] = self._add(one, places, kind, by_kind[kind], ORANGE, width=width)
            one.set_title(title, fontsize="medium")

    def _draw_values(self, rest: Places, cmap: str, limits: tuple[float, float] | None, width: Any) -> None:
        """Members in the colours of their values; those without are grey and thin, and surfaces among them left out."""
        value = dict(zip(self.structure.members, self.values, strict=True))
        known = [one for one in self.values if np.isfinite(one)]
        colours = shared.drawing("matplotlib.pyplot").get_cmap(cmap).with_extremes(bad=LIGHT)
        highest_on_top = sorted(value, key=lambda name: np.nan_to_num(value[name], nan=-np.inf))
        for kind, names in by_number_of_nodes(self.structure, highest_on_top).items():
            valued = [name for name in names if np.isfinite(value[name])]
            shown = {"lines": names, "surfaces": valued or names, "points": valued}[kind]
            if shown:
                array = np.ma.masked_invalid([value[name] for name in shown])
                widths = np.where(np.ma.getmaskarray(array), 0.8, 2.5 if isinstance(width, Mapping) else width)
                self.members_[kind] = self._add(self.ax_, rest, kind, shown, None, width=widths, alpha=0.7)
                clim = limits or ((min(known), max(known)) if known else (0.0, 1.0))
                self.members_[kind].set(array=array, cmap=colours, clim=clim)

    def _draw_groups(self, rest: Places, width: Any) -> None:
        """Members of each group in its colour, in the order of the groups, over all others."""
        names = self.groups or ()
        others = set(self.structure.members).difference(*(self.structure.groups[name] for name in names))
        parts = [("other members", others, LIGHT if names else GREY)]
        parts += [(name, self.structure.groups[name], COLOURS[n % len(COLOURS)]) for n, name in enumerate(names)]
        for name, members, colour in parts:
            own = width.get(name, 2.5) if isinstance(width, Mapping) else width
            in_order = [one for one in self.structure.members if one in members]
            for kind, some in by_number_of_nodes(self.structure, in_order).items():
                if kind != "points" or name in names:
                    label = shared.shortened(name) if names else None
                    self.members_[name] = self._add(self.ax_, rest, kind, some, colour, width=own, label=label)

    def _add(
        self, ax: Axes, at: Places, kind: str, names: Iterable[Hashable], colour: str | None, width: Any, **style: Any
    ) -> Collection:
        """Add diamonds, lines or surfaces for members with nodes at some places."""
        places = [np.array([at[node] for node in self.structure.members[name].nodes]) for name in names]
        alpha = style.pop("alpha", 0.3)
        if kind == "points":
            fixed = {"s": 36, "marker": "D", "edgecolors": BLACK, "linewidths": 0.5, "zorder": 4}
            return ax.scatter(*np.vstack(places).T, c=colour, **fixed, **style)
        collections = shared.drawing("matplotlib.collections")
        if kind == "lines":
            line = collections.LineCollection(places, colors=colour, linewidths=width, capstyle="round", **style)
            return ax.add_collection(line)
        surface = collections.PolyCollection(places, facecolors=colour, edgecolors="none", alpha=alpha, **style)
        return ax.add_collection(surface)


def by_number_of_nodes(structure: Structure, names: Iterable[Hashable]) -> dict[str, list[Hashable]]:
    """Names of members that are surfaces, lines and points; kinds without a member are left out."""
    found: dict[str, list[Hashable]] = {"surfaces": [], "lines": [], "points": []}
    for name in names:
        n_nodes = len(structure.members[name].nodes)
        found["points" if n_nodes == 1 else "lines" if n_nodes == 2 else "surfaces"].append(name)
    return {kind: some for kind, some in found.items() if some}


def shapes_of(structure: Structure, model: FEModel | None, modes: Sequence[int] | None) -> tuple[Array, list[str]]:
    """Mode shapes of a model of the structure with all parameters 1, (n_dofs, n_modes), and a title for each."""
    if not structure.dofs:
        raise ValueError(f"{structure!r} has no labels of degrees of freedom; expected (node, direction) of each")
    if model is None:
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
    found = zip(chosen, frequencies[0, chosen], strict=True)
    return shapes[0][:, chosen], [f"$f_{{{mode + 1}}}$ = {f:.{3 if f < 10 else 2}f} Hz" for mode, f in found]


def moved_nodes(structure: Structure, shape: Array, amplitude: float, axes: Array) -> dict[Hashable, Array]:
    """Places of the nodes in a mode as they are seen; the largest displacement is a share of the structure's extent."""
    moves = {node: np.zeros(structure.dimension) for node in structure.nodes}
    for (node, direction), value in zip(dofs_of(structure), shape, strict=True):
        if direction in "xyz"[: structure.dimension] and node in moves:
            moves[node]["xyz".index(direction)] = value
    extent = np.linalg.norm(np.ptp(list(structure.nodes.values()), axis=0))
    scale = amplitude * extent / (max(np.linalg.norm(move) for move in moves.values()) or 1.0)
    return {node: (place + scale * moves[node]) @ axes for node, place in structure.nodes.items()}


def values_by_member(structure: Structure, values: Mapping[Hashable, float] | ArrayLike) -> Array:
    """Value of each member, NaN where there is none; its own comes before that of its group."""
    members, groups = structure.members, structure.groups
    values = values.to_dict() if hasattr(values, "to_dict") else values
    if not isinstance(values, Mapping):
        array = real_array(values, "values")
        if array.shape != (len(members),):
            raise ValueError(f"values has shape {array.shape}; expected ({len(members)},), one for each member")
        return array
    own = {key: value for key, value in values.items() if key not in groups}
    if unknown := [key for key in own if key not in members]:
        raise ValueError(f"values names {unknown[0]!r}; expected members, or groups among {sorted(groups)}")
    found: dict[Hashable, float] = {}
    for group in [key for key in values if key in groups]:
        for member in groups[group].difference(own):
            if found.setdefault(member, values[group]) != values[group]:
                raise ValueError(f"member {member!r} is in several groups with different values; expected one value")
    return np.array([float((found | own).get(member, np.nan)) for member in members])


def axes_of_view(structure: Structure, view: tuple[float, float] | None) -> Array:
    """Horizontal and vertical direction of what is seen, as columns: the plane's, or those of a view from a side."""
    unit, (elevation, azimuth) = np.eye(structure.dimension), np.radians((22, -60) if view is None else view)
    if structure.dimension == 2:
        return unit
    moving = {direction for _, direction in dofs_of(structure)}
    extent = np.ptp(list(structure.nodes.values()), axis=0)
    for normal in "yzx" if view is None else "":  # a structure along one line has z upwards, if it moves there
        plane = "xyz".replace(normal, "")
        if extent["xyz".index(normal)] == 0 and moving <= {*plane, f"r{normal}"}:
            return unit[:, ["xyz".index(direction) for direction in plane]]
    across = [-np.sin(azimuth), np.cos(azimuth), 0.0]
    back = np.sin(elevation) * np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
    return np.column_stack([across, np.cos(elevation) * unit[2] - back])


def dofs_of(structure: Structure) -> list[Label]:
    """Nodes and directions of the degrees of freedom, with directions called "x" to "rz" where they are known."""
    known: dict[object, str] = {}  # by which other programs call them
    for number, name in enumerate(("x", "y", "z", "rx", "ry", "rz"), start=1):
        known |= {number: name, f"{'ROT' if len(name) == 2 else 'U'}{name[-1].upper()}": name, f"D{name.upper()}": name}
    return [(node, known.get(direction, direction)) for node, direction in structure.dofs]


def draw_supports(ax: Axes, structure: Structure, nodes: Places, axes: Array, size: float) -> None:
    """Triangles below nodes that are held: filled where they are so in every direction, open where some stay free."""
    seen = {direction for direction, row in zip("xyz", axes, strict=False) if row.any()}
    moving = ({direction for _, direction in dofs_of(structure)} or seen) & seen
    held = {node: moving.intersection(along) for node, along in structure.supports.items()}
    for label, face in (("fixed in every direction", BLACK), ("free in some direction", "white")):
        places = [nodes[node] for node, fixed in held.items() if fixed and (fixed == moving) == (face == BLACK)]
        triangle = [(0, 0), (-0.7, -1.2), (0.7, -1.2), (0, 0)]  # with its tip at the node
        style = {"linestyle": "", "marker": triangle, "markersize": size, "color": BLACK, "markerfacecolor": face}
        if places:
            ax.plot(*np.array(places).T, **style, label=label, clip_on=False, zorder=3)
