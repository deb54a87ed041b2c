"""Mode shapes of structures."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np

from skthermo._core.arrays import Array
from skthermo.fem import FEModel, Structure
from skthermo.plotting._display import LIGHT, ORANGE, Display
from skthermo.plotting._structures import (
    Projection,
    add_members,
    check_structure,
    dofs_of,
    draw_supports,
    set_view,
    sort_members,
    structure_axes,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes


@dataclass(eq=False, repr=False)
class ModeShapesDisplay(Display):
    """Mode shapes over the structure at rest, with their frequencies, in its plane or in space.

    It is best made by `from_structure`.

    Parameters
    ----------
    structure : Structure
        What is drawn.
    frequencies : ndarray of shape (n_modes,)
        In Hz.
    shapes : ndarray of shape (n_dofs, n_modes)
        Rows as in ``structure.dofs``.
    modes : sequence of int
        Numbers of the modes from 0, for the titles.
    groups : sequence of str, optional
        Groups whose members are drawn; by default all members.

    Attributes
    ----------
    axes_, ax_, figure_ : array of matplotlib's Axes, the first of them, and Figure
        Where it is drawn.
    lines_ : list of collection
        Deformed members of each mode.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.fem import Bar, Structure
    >>> from skthermo.plotting import ModeShapesDisplay
    >>> steel = dict(E=210e9, A=0.01, density=7850.0)
    >>> nodes = {"left": (0, 0), "right": (6, 0), "apex": (3, 2)}
    >>> ends = [("left", "apex"), ("apex", "right"), ("left", "right")]
    >>> bars = {number: Bar(*pair, **steel) for number, pair in enumerate(ends)}
    >>> structure = Structure(nodes, bars, {"left": "xy", "right": "y"}, {"all": list(bars)})
    >>> display = ModeShapesDisplay.from_structure(structure, modes=[0, 1])
    >>> display.axes_[0].get_title()
    '$f_{1}$ = 129.56 Hz'
    >>> plt.close(display.figure_)
    """

    structure: Structure
    frequencies: Array
    shapes: Array
    modes: Sequence[int]
    _: KW_ONLY
    groups: Sequence[str] | None = None

    @classmethod
    def from_structure(
        cls,
        structure: Structure,
        model: FEModel | None = None,
        modes: Sequence[int] | None = None,
        *,
        groups: Sequence[str] | None = None,
        **options: object,
    ) -> ModeShapesDisplay:
        """Draw modes of a structure.

        Parameters
        ----------
        structure : Structure
            Nodes, members and supports.
        model : FE model, optional
            Assembled from the structure, with the method ``modes``, and drawn with all parameters 1; by default with
            the structure's groups as parameters.
        modes : sequence of int, optional
            Columns of the model, from 0; by default all, or the first six of the structure.
        groups : sequence of str, optional
            Groups whose members are drawn; by default all members.
        **options : dict
            Options of `plot`.

        Returns
        -------
        ModeShapesDisplay

        Raises
        ------
        ValueError
            If the model has no mode shapes, or not those of the structure's degrees of freedom, or a mode or group is
            unknown.
        """
        check_structure(structure, groups)
        if not structure.dofs:
            raise ValueError(f"{structure!r} has no labels of degrees of freedom; expected (node, direction) of each")
        if model is None:
            if not structure.groups:
                raise ValueError("structure has no groups; expected model, such as structure.assemble(...)")
            n_modes = min(6, len(structure.dofs)) if modes is None else max(modes) + 1
            model = structure.assemble(sorted(structure.groups), n_modes=n_modes)
        if not hasattr(model, "modes"):
            raise ValueError(f"{model!r:.200} has no method 'modes'; expected a model assembled from the structure")
        frequencies, shapes = model.modes(np.ones((1, len(model.parameter_names))))
        if shapes.shape[1] != len(structure.dofs):
            raise ValueError(
                f"the model's shapes have {shapes.shape[1]} degrees of freedom; expected the structure's "
                f"{len(structure.dofs)}"
            )
        chosen = list(range(model.n_modes) if modes is None else modes)
        unknown = [mode for mode in chosen if mode not in range(model.n_modes)]
        if unknown or not chosen:
            raise ValueError(f"modes is {chosen}; expected numbers from 0 to {model.n_modes - 1}")
        display = cls(structure, frequencies[0, chosen], shapes[0][:, chosen], chosen, groups=groups)
        return display.plot(**options)

    def plot(
        self,
        ax: Axes | np.ndarray | None = None,
        *,
        amplitude: float = 0.06,
        linewidth: float = 1.5,
        n_columns: int = 2,
    ) -> ModeShapesDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes or array of Axes, optional
            One for each mode, three-dimensional for a structure in space. A new figure by default.
        amplitude : float, default=0.06
            Largest displacement drawn, as a share of the structure's extent.
        linewidth : float, default=1.5
            Width of the lines of deformed members in points.
        n_columns : int, default=2
            Panels beside each other in a new figure.

        Returns
        -------
        ModeShapesDisplay
            Itself.
        """
        view = Projection.of(self.structure, ax)
        moved = [moved_nodes(view, shape, amplitude) for shape in self.shapes.T]
        rest = view.nodes
        points = np.array([place for places in (rest, *moved) for place in places.values()])
        names = [f"mode {mode + 1}" for mode in self.modes]
        self.axes_ = structure_axes(ax, view, names, points, width=5.0, n_columns=n_columns)
        groups = [list(self.structure.members)]
        if self.groups is not None:
            groups = [list(self.structure.groups[group]) for group in self.groups]
        parts = [sort_members(self.structure, names)[1:] for names in groups]
        self.lines_ = []
        panels = zip(self.axes_, self.modes, moved, self.frequencies, strict=True)
        for one, mode, places, frequency in panels:
            drawn = []
            for lines, surfaces in parts:
                for nodes, colour in ((rest, LIGHT), (places, ORANGE)) if surfaces else ():
                    style = {"facecolors": colour, "alpha": 0.3}
                    add_members(one, self.structure, nodes, "surfaces", surfaces, **style)
                if lines:
                    style = {"colors": LIGHT, "linewidths": 0.8, "zorder": 1}
                    add_members(one, self.structure, rest, "lines", lines, **style)
                    style = {"colors": ORANGE, "linewidths": linewidth, "zorder": 2}
                    drawn.append(add_members(one, self.structure, places, "lines", lines, **style))
            self.lines_.append(drawn)
            draw_supports(one, view, size=7)
            top = one.get_position(original=True).y1
            set_view(one, points, is_own=ax is None)
            title = f"$f_{{{mode + 1}}}$ = {frequency:.{3 if frequency < 10 else 2}f} Hz"
            if ax is None and view.is_space:  # the axes may be larger than their place in the figure
                place = one.get_position(original=True)
                one.set_title(title, fontsize="medium", y=1.0)
                one.title.set_y((top - place.y0) / place.height)  # axes in space would scale it, were it given above
            else:
                one.set_title(title, fontsize="medium")
        return self


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
