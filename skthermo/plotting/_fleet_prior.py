"""How temperature changes a parameter or a frequency in a fleet, and in a new bridge."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import KW_ONLY, dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator

from skthermo._tables.arrays import Array, as_floats
from skthermo._validation import last_step
from skthermo.plotting._display import Display
from skthermo.plotting._style import BLACK, BLUE, GREY, ORANGE, SKY, label_of, with_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from skthermo.fleet import FleetMapper, FleetPrior
    from skthermo.residuals.weather import TrainingRange

N_DEVIATIONS = 2  # half width of the bands in standard deviations
MOST_SOLID = 12  # bridges above which their lines are fainter
N_TEMPERATURES = 120
MOMENTS = ["mean", "standard_deviation"]


@dataclass(eq=False, repr=False)
class FleetPriorDisplay(Display):
    """Change of a parameter or a frequency with temperature: the fleet, its single bridges, and a new bridge.

    All thermometers show the same steady temperature, lagged ones too. Changes are relative to their values at one
    reference temperature, since bridges have levels of their own. Bands are two standard deviations of the logarithm:
    that of the fleet holds about 95 % of its bridges, that of a new bridge what its records and the fleet leave open.

    It is best made by `from_estimator`.

    Parameters
    ----------
    fleet : DataFrame
        On temperatures in degrees Celsius: ``mean`` and ``standard_deviation`` of the logarithm's change, and a column
        for each bridge of the fleet.
    own : DataFrame, optional
        The same of a new bridge: ``mean`` and ``standard_deviation``.
    own_range : tuple of float, optional
        Lowest and highest temperature of the new bridge's own records.
    name : str, optional
        Of the parameter, the mode or the family.
    is_pooled : bool, default=True
        Whether the fleet tells a new bridge anything; if not, the title says so.

    Attributes
    ----------
    ax_, axes_, figure_ : matplotlib's Axes, array that holds them, and Figure
        Where it is drawn.
    fleet_line_, own_line_ : Line2D
        Means; the latter is None without a new bridge.
    fleet_band_, own_band_ : PolyCollection
        Bands.
    bridge_lines_ : dict of str to Line2D
        Single bridges.

    Examples
    --------
    >>> import matplotlib.pyplot as plt
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.plotting import FleetPriorDisplay
    >>> T = np.array([-10.0, 0.0, 30.0])
    >>> fleet = pd.DataFrame({"mean": -0.002 * T, "standard_deviation": abs(0.0002 * T), "A7": -0.0018 * T}, T)
    >>> display = FleetPriorDisplay(fleet, name="deck").plot()
    >>> display.ax_.get_ylabel()
    'change of deck (%)'
    >>> plt.close(display.figure_)
    """

    fleet: pd.DataFrame
    own: pd.DataFrame | None = None
    own_range: tuple[float, float] | None = None
    _: KW_ONLY
    name: Hashable | None = None
    is_pooled: bool = True

    @classmethod
    def from_estimator(
        cls,
        estimator: FleetPrior | FleetMapper | BaseEstimator,
        name: Hashable | None = None,
        *,
        temperatures: ArrayLike | None = None,
        reference: float | None = None,
        **options: object,
    ) -> FleetPriorDisplay:
        """Draw what a fleet knows, and what a new bridge makes of it.

        Parameters
        ----------
        estimator : FleetPrior, FleetMapper or an estimator with one
            A fitted `~skthermo.fleet.FleetPrior`; or, for a new bridge, a fitted `~skthermo.fleet.FleetMapper`, a
            chain with one as its mapper, or a pipeline that ends with one.
        name : str, optional
            Of the family, for a prior; of the parameter or the mode, for a new bridge. By default the first.
        temperatures : array-like of shape (n_temperatures,), optional
            In degrees Celsius; by default the whole weather of the fleet.
        reference : float, optional
            Temperature whose values changes are relative to; by default the middle of the bridge's own records, or of
            the fleet's weather.
        **options : dict
            Options of `plot`.

        Returns
        -------
        FleetPriorDisplay

        Raises
        ------
        ValueError
            If the estimator has no fitted prior of a fleet, or the name is unknown.
        """
        found = _with_effects(estimator)
        if found is None:
            raise ValueError(
                f"estimator is {estimator!r:.200}; expected a fitted FleetPrior or FleetMapper, or a chain with one"
            )
        is_prior = hasattr(found, "comparison_")
        prior = found if is_prior else found.prior
        pooled = {} if prior is None else prior.comparison_["is_pooled"].to_dict()
        families = {family: family for family in pooled} if is_prior else dict(found.families_)
        name = next(iter(families), None) if name is None else name
        if name not in families:
            raise ValueError(f"name is {name!r}; expected one of {list(families)}")
        family = families[name]
        lowest, highest = _steady(found.reach_, whole=True)
        grid = np.linspace(lowest, highest, N_TEMPERATURES)
        grid = grid if temperatures is None else np.sort(as_floats(temperatures))
        own_range = None if is_prior else _steady(found.own_range_)
        if reference is None:
            reference = float(np.mean((lowest, highest) if own_range is None else own_range))
        fleet = pd.DataFrame(np.nan, grid, MOMENTS)  # of what is never pooled
        if family in pooled:
            fleet = prior.effects(grid, family, reference=reference)
        own = None if is_prior else found.effects(grid, name, reference=reference)
        return cls(fleet, own, own_range, name=name, is_pooled=bool(pooled.get(family, False))).plot(**options)

    def plot(self, ax: Axes | None = None) -> FleetPriorDisplay:
        """Draw into axes.

        Parameters
        ----------
        ax : matplotlib's Axes, optional
            A new figure by default.

        Returns
        -------
        FleetPriorDisplay
            Itself.
        """
        (ax,) = self._take_axes(ax, ["one display"], (6.4, 4.2))
        temperatures = as_floats(self.fleet.index)
        bridges = self.fleet.columns.difference(MOMENTS, sort=False)
        faint = {"color": GREY, "linewidth": 0.7, "alpha": 0.7 if len(bridges) <= MOST_SOLID else 0.35}
        self.bridge_lines_ = {
            bridge: ax.plot(temperatures, _percent(self.fleet[bridge]), **faint, zorder=1)[0] for bridge in bridges
        }
        if len(bridges):
            self.bridge_lines_[bridges[0]].set_label("single bridges")
        mean, low, high = _band(self.fleet)
        self.fleet_band_ = ax.fill_between(temperatures, low, high, color=SKY, alpha=0.3, linewidth=0, zorder=0)
        label = "fleet, with its band" if np.isfinite(mean).any() else "_"
        style = {"color": BLUE, "linestyle": "--", "linewidth": 1.8, "label": label}
        self.fleet_line_ = ax.plot(temperatures, mean, **style)[0]
        self.own_line_, self.own_band_ = None, None
        if self.own is not None:
            self._draw_own(ax)
        ax.axhline(0, color=BLACK, linewidth=0.6)
        label = "change" if self.name is None else f"change of {label_of(self.name)}"
        ax.set(xlabel="steady temperature (°C)", ylabel=with_unit(label, "%"))
        if not self.is_pooled:
            ax.set_title("not pooled: the fleet does not foretell this", fontsize="medium")
        ax.margins(x=0)
        ax.legend(frameon=False, fontsize="small")
        return self

    def _draw_own(self, ax: Axes) -> None:
        """The new bridge, and where its own records end."""
        temperatures = as_floats(self.own.index)
        mean, low, high = _band(self.own)
        self.own_band_ = ax.fill_between(temperatures, low, high, color=ORANGE, alpha=0.25, linewidth=0, zorder=2)
        style = {"color": ORANGE, "linewidth": 2.2, "label": "new bridge, with its band", "zorder": 4}
        self.own_line_ = ax.plot(temperatures, mean, **style)[0]
        if self.own_range is None:
            return
        for number, end in enumerate(self.own_range):
            label = {"label": "its own records end"} if number == 0 else {}
            ax.axvline(end, color=BLACK, linestyle=":", linewidth=1.2, **label)


def _with_effects(estimator: object) -> FleetPrior | FleetMapper | None:
    """The fitted prior, or the mapper with one, that an estimator is or has; None without any."""
    last = last_step(estimator)
    if hasattr(last, "effects"):
        return last if hasattr(last, "comparison_") or hasattr(last, "own_range_") else None
    parts = (getattr(last, name, None) for name in ("mapper_", "regressor_", "estimator_"))
    return next((found for part in parts if part is not None and (found := _with_effects(part)) is not None), None)


def _steady(reach: TrainingRange, *, whole: bool = False) -> tuple[float, float]:
    """Lowest and highest temperature that all inputs have seen, or any of them."""
    ends = as_floats(reach.lowest), as_floats(reach.highest)
    if whole:
        return float(ends[0].min()), float(ends[1].max())
    low, high = float(ends[0].max()), float(ends[1].min())
    return (low, high) if low <= high else (float(ends[0].mean()), float(ends[1].mean()))


def _band(effects: pd.DataFrame) -> tuple[Array, Array, Array]:
    """Mean and both ends of the band in percent."""
    mean, deviation = (effects[name].astype(float) for name in MOMENTS)
    return _percent(mean), _percent(mean - N_DEVIATIONS * deviation), _percent(mean + N_DEVIATIONS * deviation)


def _percent(logs: pd.Series) -> Array:
    """Change in percent of what has this change of its logarithm."""
    return 100 * np.expm1(logs.to_numpy(dtype=float))
