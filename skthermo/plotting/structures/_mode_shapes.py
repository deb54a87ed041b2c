"""Mode shapes of structures."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from skthermo._estimators.arguments import check_theta
from skthermo._tables.arrays import Array
from skthermo.fem import ModalModel, Structure
from skthermo.plotting._axes import panels
from skthermo.plotting._display import Display
from skthermo.plotting._style import LIGHT, ORANGE, pyplot
from skthermo.plotting.structures._members import (
    Cell,
    add_lines,
    add_surfaces,
    check_axes,
    check_structure,
    corners,
    draw_supports,
    height_of,
    set_view,
    sort_members,
    space_axes,
)
from skthermo.plotting.structures._projection import Projection

if TYPE_CHECKING:
    from matplotlib.axes import Axes

GAP = 0.015  # space between the panels of a figure, as a share of it


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
        model: ModalModel | None = None,
        modes: Sequence[int] | None = None,
        theta: ArrayLike | None = None,
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
            Assembled from the structure, with the method ``modes``; by default with its groups as parameters.
        modes : sequence of int, optional
            Columns of the model, from 0; by default all, or the first six of the structure.
        theta : array-like of shape (n_parameters,), optional
            Multipliers of the model's parameters; by default all 1.
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
        if model is None:
            if not structure.groups:
                raise ValueError("structure has no groups; expected model, such as structure.assemble(...)")
            n_modes = min(6, len(structure.dofs)) if modes is None else max(modes) + 1
            model = structure.assemble(sorted(structure.groups), n_modes=n_modes)
        if not hasattr(model, "modes"):
            raise ValueError(f"{model!r:.200} has no method 'modes'; expected a model assembled from the structure")
        names = model.parameter_names
        row = np.ones((1, len(names))) if theta is None else np.atleast_2d(check_theta(theta, names, one_row=True))
        frequencies, shapes = model.modes(row)
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
            Width of their lines in points.
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
        if ax is None:
            cells = self._new_panels(view, n_columns, height_of(points))
        else:
            self.axes_, cells = panels(ax, [f"mode {mode + 1}" for mode in self.modes], (4, 3)), [None] * len(moved)
        groups = [list(self.structure.members)]
        if self.groups is not None:
            groups = [list(self.structure.groups[group]) for group in self.groups]
        parts = [sort_members(self.structure, names)[1:] for names in groups]
        self.lines_ = []
        for ax_, cell, mode, places, frequency in zip(
            self.axes_, cells, self.modes, moved, self.frequencies, strict=True
        ):
            check_axes(ax_, view)
            drawn = []
            for lines, surfaces in parts:
                if surfaces:
                    add_surfaces(ax_, corners(self.structure, surfaces, rest), facecolors=LIGHT, alpha=0.3)
                    add_surfaces(ax_, corners(self.structure, surfaces, places), facecolors=ORANGE, alpha=0.3)
                if lines:
                    add_lines(ax_, corners(self.structure, lines, rest), colors=LIGHT, linewidths=0.8, zorder=1)
                    style = {"colors": ORANGE, "linewidths": linewidth, "zorder": 2}
                    drawn.append(add_lines(ax_, corners(self.structure, lines, places), **style))
            self.lines_.append(drawn)
            draw_supports(ax_, view, size=7)
            set_view(ax_, points, cell)
            title = f"$f_{{{mode + 1}}}$ = {frequency:.{3 if frequency < 10 else 2}f} Hz"
            ax_.set_title(title, fontsize="medium", y=None if cell is None else 1.0)
            if cell is not None:
                ax_.title.set_y(title_height(ax_, cell))  # axes in space would scale it, were it given above
        return self

    def _new_panels(self, view: Projection, n_columns: int, ratio: float) -> list[Cell | None]:
        """Axes of a new figure, and in space the cell of the figure that each of them should fill."""
        n_columns = min(n_columns, len(self.modes))
        n_rows = -(-len(self.modes) // n_columns)
        tall = max(ratio, 1.0)  # panels of tall structures are as high as those of others are wide
        if not view.is_space:
            names = [f"mode {mode + 1}" for mode in self.modes]
            self.axes_ = panels(None, names, (5.0 / tall, 5.0 * ratio / tall + 0.5), n_columns)
            return [None] * len(self.modes)
        inches = 5.5 * ratio / tall + 0.5
        figure = pyplot().figure(figsize=(5.5 / tall * n_columns, inches * n_rows))
        self.axes_ = np.array([space_axes(figure) for _ in self.modes], dtype=object)
        width, height = 1 / n_columns, 1 / n_rows
        places = (divmod(number, n_columns) for number in range(len(self.modes)))
        return [
            (column * width + GAP, 1 - (row + 1) * height + GAP, width - 2 * GAP, (1 - 0.4 / inches) * height - GAP)
            for row, column in places
        ]


def moved_nodes(view: Projection, shape: Array, amplitude: float) -> dict[Hashable, Array]:
    """Places of the nodes in a mode, whose largest displacement is a share of the structure's extent."""
    nodes, axes = view.nodes, view.directions
    moves = {node: np.zeros(len(axes)) for node in nodes}
    for (node, direction), value in zip(view.structure.dofs, shape, strict=True):
        if direction in axes:
            moves[node][axes.index(direction)] = value
    largest = max(np.linalg.norm(move) for move in moves.values())
    places = np.array(list(nodes.values()))
    scale = amplitude * np.linalg.norm(np.ptp(places, axis=0)) / (largest or 1.0)
    return {node: nodes[node] + scale * move for node, move in moves.items()}


def title_height(ax: Axes, cell: Cell) -> float:
    """Height of a title above the cell of a figure in shares of its axes, which may be larger than the cell."""
    place = ax.get_position(original=True)
    return (cell[1] + cell[3] - place.y0) / place.height
