"""Structures with a value for each member."""

from collections.abc import Hashable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skthermo._arrays import Array, real_array
from skthermo.fem import Structure
from skthermo.plotting._axes import Axes
from skthermo.plotting._members import add_lines, add_surfaces, corners, draw_supports, set_view, sort_members
from skthermo.plotting._members import structure_axes as new_axes
from skthermo.plotting._style import COLOURS, LIGHT, pyplot


class StructureDisplay:
    """Members of a structure in two or three dimensions, coloured by value or by group, and its supports.

    It is best made by `from_structure`.

    Parameters
    ----------
    structure : Structure
        What is drawn.
    values : ndarray of shape (n_members,), optional
        Value of each member in the order of ``structure.members``; NaN draws a member in grey.
    groups : sequence of str, optional
        Groups that get a colour each, and a line in the legend.
    label : str, optional
        Label of the colour bar, with its unit.

    Attributes
    ----------
    ax_, figure_ : matplotlib's Axes and Figure
        Where it is drawn.
    members_ : dict
        Collections of lines and surfaces, by ``"lines"`` and ``"surfaces"`` or by group.
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
    """

    def __init__(
        self,
        structure: Structure,
        values: Array | None = None,
        *,
        groups: Sequence[str] | None = None,
        label: str | None = None,
    ):
        self.structure = structure
        self.values = values
        self.groups = groups
        self.label = label

    @classmethod
    def from_structure(
        cls,
        structure: Structure,
        values: Mapping[Hashable, float] | ArrayLike | None = None,
        *,
        groups: Sequence[str] | None = None,
        label: str | None = None,
        **options: Any,
    ) -> "StructureDisplay":
        """Draw a structure.

        Parameters
        ----------
        structure : Structure
            Nodes, members, groups and supports.
        values : mapping of group or member to float, or array-like of shape (n_members,), optional
            What colours the members. A member's own value comes before its group's; members without a value are grey.
        groups : sequence of str, optional
            Without values: groups that get a colour each; the last is drawn on top.
        label : str, optional
            Label of the colour bar, with its unit.
        **options : dict
            Options of `plot`.

        Returns
        -------
        StructureDisplay

        Raises
        ------
        ValueError
            If a group or member is unknown, two groups give a member different values, or the number of values is not
            that of the members.
        """
        if not isinstance(structure, Structure):
            raise ValueError(f"structure is a {type(structure).__name__}; expected a skthermo.fem.Structure")
        if values is not None and groups is not None:
            raise ValueError("values and groups are both given; expected one of them to colour the members")
        for group in groups or ():
            if group not in structure.groups:
                raise ValueError(f"unknown group {group!r}; expected some of {sorted(structure.groups)}")
        by_member = None if values is None else values_by_member(structure, values)
        return cls(structure, by_member, groups=groups, label=label).plot(**options)

    def plot(
        self,
        ax: Axes = None,
        *,
        cmap: str = "viridis",
        limits: tuple[float, float] | None = None,
        linewidth: float | Mapping[str, float] = 2.5,
    ) -> "StructureDisplay":
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes, optional
            Three-dimensional for a structure in space. A new figure by default.
        cmap : str, default="viridis"
            Colour map of the values.
        limits : tuple of float, optional
            Values at the ends of the colour map; by default the lowest and the highest.
        linewidth : float or mapping of group to float, default=2.5
            Width of lines in points.

        Returns
        -------
        StructureDisplay
            Itself.
        """
        is_new = ax is None
        self.ax_ = new_axes(ax, self.structure, width=9.0)
        self.figure_ = self.ax_.figure
        self.members_: dict[str, Any] = {}
        self.colorbar_ = None
        widths = linewidth if isinstance(linewidth, Mapping) else {}
        width = 2.5 if isinstance(linewidth, Mapping) else float(linewidth)
        if self.values is not None:
            self._draw_values(self.values, cmap, limits, width)
        else:
            self._draw_groups(widths, width)
        supports = draw_supports(self.ax_, self.structure)
        nodes = np.array(list(self.structure.nodes.values()))
        cell = (0.03, 0.12, 0.84 if self.values is not None else 0.94, 0.84)
        set_view(self.ax_, nodes, cell if is_new else None)
        self._legend(supports)
        return self

    def _draw_values(self, values: Array, cmap: str, limits: tuple[float, float] | None, width: float) -> None:

        known = values[np.isfinite(values)]
        low, high = limits or ((known.min(), known.max()) if known.size else (0.0, 1.0))
        colours = pyplot().get_cmap(cmap).with_extremes(bad=LIGHT)
        of_member = dict(zip(self.structure.members, values, strict=True))
        _, lines, surfaces = sort_members(self.structure, of_member)
        for kind, names, add, style in (
            ("surfaces", surfaces, add_surfaces, {"alpha": 0.6}),
            ("lines", lines, add_lines, {"linewidths": width}),
        ):
            if names:
                places = corners(self.structure, names, self.structure.nodes)
                drawn = add(self.ax_, places, cmap=colours, **style)
                drawn.set_array(np.ma.masked_invalid([of_member[name] for name in names]))
                drawn.set_clim(low, high)
                self.members_[kind] = drawn
        shown = self.members_.get("lines", self.members_.get("surfaces"))
        shrink = 0.6 if self.structure.dimension == 3 else 0.9
        self.colorbar_ = self.figure_.colorbar(shown, ax=self.ax_, label=self.label or "", shrink=shrink, pad=0.02)

    def _draw_groups(self, widths: Mapping[str, float], width: float) -> None:
        groups = self.structure.groups
        coloured = dict(zip(self.groups or (), COLOURS * 9, strict=False))
        rest = set(self.structure.members).difference(*(groups[group] for group in coloured))
        parts = {
            "other members": (rest, LIGHT),
            **{group: (groups[group], colour) for group, colour in coloured.items()},
        }
        for name, (members, colour) in parts.items():
            _, lines, surfaces = sort_members(self.structure, members)
            if surfaces:
                places = corners(self.structure, surfaces, self.structure.nodes)
                self.members_[name] = add_surfaces(self.ax_, places, facecolors=colour, alpha=0.35, label=name)
            if lines:
                places = corners(self.structure, lines, self.structure.nodes)
                style = {"colors": colour, "linewidths": widths.get(name, width), "label": name}
                self.members_[name] = add_lines(self.ax_, places, **style)

    def _legend(self, supports: Mapping[str, Any]) -> None:
        handles = [*(self.members_.values() if self.groups else ()), *supports.values()]
        if handles:
            labels = [handle.get_label().replace("_", " ") for handle in handles]
            self.ax_.legend(
                handles, labels, loc="upper center", bbox_to_anchor=(0.5, 0.0), ncols=5, frameon=False, fontsize="small"
            )


def values_by_member(structure: Structure, values: Any) -> Array:
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
    for key in [key for key in values if key in groups]:
        for member in groups[key]:
            value = float(values[key])
            if found.setdefault(member, value) != value and member not in values:
                raise ValueError(f"member {member!r} is in several groups with different values; expected one value")
    for key in [key for key in values if key not in groups]:
        if key not in structure.members:
            raise ValueError(f"values names {key!r}; expected members, or groups among {sorted(groups)}")
        found[key] = float(values[key])
    return np.array([found.get(member, np.nan) for member in members])
