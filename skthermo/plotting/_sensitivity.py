"""Sensitivities as a map."""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass
from typing import Any, Literal

import pandas as pd
from numpy.typing import ArrayLike

from skthermo._arrays import real_array
from skthermo.fem import FEModel
from skthermo.plotting._axes import Axes, draw_heat_map, one_axes
from skthermo.updating import sensitivity


@dataclass(eq=False, repr=False)
class SensitivityDisplay:
    """Normalised sensitivities of frequencies to parameters, a row for each parameter and a column for each mode.

    It is best made by `from_model` or `from_predictions`.

    Parameters
    ----------
    sensitivity : DataFrame of shape (n_modes, n_parameters)
        Percent by which a frequency changes where a parameter changes by 1 %.
    label : str
        Label of the colour bar.

    Attributes
    ----------
    ax_, figure_ : matplotlib's Axes and Figure
        Where it is drawn.
    image_ : AxesImage
        The map.
    colorbar_ : Colorbar or None
        None if it is switched off.

    See Also
    --------
    skthermo.updating.sensitivity : The numbers.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.plotting import SensitivityDisplay
    >>> display = SensitivityDisplay.from_model(make_truss())
    >>> display.image_.get_array().shape
    (4, 6)
    >>> plt.close(display.figure_)
    """

    sensitivity: pd.DataFrame
    _: KW_ONLY
    label: str = "normalised sensitivity"

    @classmethod
    def from_model(
        cls,
        model: FEModel,
        theta: ArrayLike | None = None,
        *,
        method: Literal["exact", "central"] = "exact",
        **options: Any,
    ) -> SensitivityDisplay:
        """Draw the sensitivities of a model.

        Parameters
        ----------
        model : FE model
            Any.
        theta : array-like of shape (n_parameters,), optional
            Multipliers at which they are computed; by default all 1.
        method : {"exact", "central"}, default="exact"
            The model's derivatives, or central differences.
        **options : dict
            Options of `plot`.

        Returns
        -------
        SensitivityDisplay
        """
        return cls.from_predictions(sensitivity(model, theta, method=method), **options)

    @classmethod
    def from_predictions(
        cls, sensitivity: pd.DataFrame, *, label: str = "normalised sensitivity", **options: Any
    ) -> SensitivityDisplay:
        """Draw a table of sensitivities.

        Parameters
        ----------
        sensitivity : DataFrame of shape (n_modes, n_parameters)
            As `~skthermo.updating.sensitivity` gives them.
        label : str, default="normalised sensitivity"
            Label of the colour bar.
        **options : dict
            Options of `plot`.

        Returns
        -------
        SensitivityDisplay

        Raises
        ------
        ValueError
            If it is not a frame of numbers.
        """
        if not isinstance(sensitivity, pd.DataFrame) or sensitivity.empty:
            raise ValueError(
                f"sensitivity is a {type(sensitivity).__name__} of shape {getattr(sensitivity, 'shape', ())}; "
                "expected a DataFrame of modes (rows) and parameters (columns)"
            )
        real_array(sensitivity, "sensitivity")
        return cls(sensitivity, label=label).plot(**options)

    def plot(
        self, ax: Axes = None, *, limit: float | None = None, smallest: float = 0.005, colorbar: bool = True
    ) -> SensitivityDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes, optional
            A new figure by default.
        limit : float, optional
            Value at the ends of the colour map; by default the largest magnitude.
        smallest : float, default=0.005
            Smaller magnitudes are drawn without their number.
        colorbar : bool, default=True
            Whether to draw a colour bar.

        Returns
        -------
        SensitivityDisplay
            Itself.
        """
        n_modes, n_parameters = self.sensitivity.shape
        self.ax_ = one_axes(ax, (2.4 + 0.6 * n_modes, 1.2 + 0.32 * n_parameters))
        self.figure_ = self.ax_.figure
        self.image_ = draw_heat_map(self.ax_, self.sensitivity.T, limit, smallest)
        bar = {"label": self.label, "shrink": 0.9 if n_parameters < 12 else 0.6}
        self.colorbar_ = self.figure_.colorbar(self.image_, ax=self.ax_, **bar) if colorbar else None
        return self
