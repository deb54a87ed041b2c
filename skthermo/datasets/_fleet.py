"""A fleet of synthetic bridges that share their kinds of structure and thermal laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from functools import cached_property

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.special import ndtri

from skthermo._core.arrays import Array, as_random_state, check_noise, is_real, positive_integer
from skthermo.datasets._fleet_site import (
    ATYPICAL_LAWS,
    Law,
    SiteClimate,
    draw_law,
    draw_thermometers,
    drawn_by_hour,
    measured,
    part_temperature,
    persistent,
    stream,
)
from skthermo.datasets._fleet_structures import KINDS, Design, Kind
from skthermo.datasets._results import FleetRecords
from skthermo.fem import AffineModel
from skthermo.fem.damage import LossKind


@dataclass(frozen=True)
class FleetBridge:
    """One bridge of `make_fleet`, drawn from its seed. It pickles in a few hundred bytes.

    Parameters
    ----------
    name : str
        Its name.
    kind : {"truss", "girder", "arch"}
        Its kind.
    seed : tuple of int
        Seed of everything about it.
    atypical_law : {"reversed", "doubled", "knee elsewhere"}, optional
        How its thermal laws differ from its family's.

    See Also
    --------
    make_fleet : Many of them, with a description of the draws.

    Examples
    --------
    >>> from skthermo.datasets import make_fleet
    >>> bridge = make_fleet(3, random_state=0)["bridge 001"]
    >>> bridge.kind, bridge.model.parameter_names, bridge.groups
    ('girder', ('deck', 'torsion', 'bearings', 'soil'), ('girder', 'first span', 'bearings', 'soil'))
    >>> bridge.records(60, damage={"soil": 0.2}).frequencies.shape
    (60, 5)
    """

    name: str
    kind: str
    seed: tuple[int, ...]
    atypical_law: str | None = None

    def __reduce__(self):
        """Leave out parts that can be built again."""
        return FleetBridge, (self.name, self.kind, self.seed, self.atypical_law)

    @property
    def is_atypical(self) -> bool:
        """Whether its thermal laws differ from its family's."""
        return self.atypical_law is not None

    @cached_property
    def covariates(self) -> dict[str, str | float]:
        """Facts that its owner knows: "kind", "material", "span" in m, "latitude" in degrees."""
        random, kind = self._random("who"), KINDS[self.kind]
        return {
            "kind": self.kind,
            "material": kind.materials[random.randint(len(kind.materials))],
            "span": round(random.uniform(*kind.spans), 1),
            "latitude": round(self.climate.latitude, 2),
        }

    @cached_property
    def climate(self) -> SiteClimate:
        """Climate of its place: latitude, mean, seasonal and daily cycle in C, and how its weather varies."""
        return SiteClimate.draw(self._random("climate"))

    @property
    def groups(self) -> tuple[str, ...]:
        """Damage groups, by the names of ``model.groups``."""
        return KINDS[self.kind].groups

    @cached_property
    def roles(self) -> dict[str, str]:
        """Name of each thermometer's column and its role, "air" or "deck"."""
        return {one.name: one.role for one in draw_thermometers(self._random("thermometers"))}

    @cached_property
    def noise(self) -> Array:
        """Relative standard deviation of the noise of each frequency, of shape (n_modes,)."""
        random = self._random("noise")
        of_modes = 0.2 * random.standard_normal(KINDS[self.kind].n_modes)
        return np.clip(0.004 * np.exp(0.3 * random.standard_normal() + of_modes), 0.002, 0.01)

    @cached_property
    def model(self) -> AffineModel:
        """The user's FE model: a coarser mesh, stiffnesses 2 to 5 % off, parameters across the thermal zones."""
        random, kind = self._random("error"), KINDS[self.kind]
        off, wrong = random.uniform(0.02, 0.05), {}
        for name, value in self._design.items():
            error = off if name.startswith(("EI", "EA", "GJ", "k_")) else 0.01 if name.startswith("mass") else 0.0
            wrong[name] = value * np.exp(error * random.standard_normal())
        structure = kind.build(wrong, False)
        return structure.assemble(kind.parameters, groups=kind.groups, n_modes=kind.n_modes)

    @cached_property
    def truth(self) -> AffineModel:
        """How the bridge behaves: its thermal zones are the parameters; damage groups as in ``model``."""
        return assemble_truth(KINDS[self.kind], self._design)

    @cached_property
    def laws(self) -> dict[str, Law]:
        """Thermal law of each zone of ``truth``. Zones of one material share the law, but not the temperature."""
        zones = {
            zone: self.covariates["material"] if what == "own" else what
            for zone, what in KINDS[self.kind].zones.items()
        }
        random = self._random("laws")
        by_material = {what: draw_law(what, self.atypical_law, random) for what in dict.fromkeys(zones.values())}
        return {zone: by_material[what] for zone, what in zones.items()}

    def records(
        self,
        days: int,
        start: str | datetime = "2025-01-01",
        *,
        samples_per_day: int = 1,
        damage: Mapping[str, float] | None = None,
        kind: LossKind = "stiffness",
        noise: ArrayLike | None = None,
        gaps: float = 0.05,
        outliers: float = 0.002,
        random_state: int | np.random.RandomState | None = None,
    ) -> FleetRecords:
        """Temperatures and frequencies from a date on.

        Weather, noise, gaps and outliers of a record depend on its date and the seeds alone: a longer campaign begins
        with a shorter one, one that begins later goes on with its weather, and damaged records have the weather of
        healthy ones.

        Parameters
        ----------
        days : int
            Number of days.
        start : str, Timestamp or datetime, default="2025-01-01"
            First record, at a full hour.
        samples_per_day : int, default=1
            Records a day, a divisor of 24. Temperatures are means of the time from a record to the next one, and so are
            the temperatures inside the bridge, which follow with thermal inertia.
        damage : mapping of str to float, optional
            Severity by damage group, as in ``model.damaged``: 0.2 takes 20 % of its stiffness.
        kind : {"stiffness", "section"}, default="stiffness"
            What damage takes, as in ``model.damaged``.
        noise : float or array-like of shape (n_modes,), optional
            Relative standard deviation of the noise of frequencies, by default the bridge's own ``noise``. Of its
            variance 40 % lasts for two days.
        gaps : float, default=0.05
            Share of frequencies that are missing, for most of a day at a time; a fifth of that share of temperatures is
            missing, too.
        outliers : float, default=0.002
            Share of frequencies that are wrong by 3 to 10 %.
        random_state : int, RandomState or None, default=None
            Seed of another history of the same bridge. None is its own history: every call gives the same records.

        Returns
        -------
        Bunch
            With these attributes:

            temperatures : DataFrame of shape (n_records, n_thermometers)
                In degrees Celsius, with offsets, noise and gaps; the columns are named in ``roles``.
            frequencies : DataFrame of shape (n_records, n_modes)
                ``f1``, ``f2``, ... in Hz, with noise, gaps and outliers.
            clean_frequencies : DataFrame of shape (n_records, n_modes)
                Without these.
            theta : DataFrame of shape (n_records, n_zones)
                Effect of the weather: multipliers of the stiffness of the zones of ``truth``.

        Raises
        ------
        ValueError
            If the samples a day do not divide 24, the start is no full hour or has a time zone, or a share is not
            between 0 and 0.5.
        """
        index = record_times(start, days, samples_per_day)
        gaps, outliers = check_share(gaps, "gaps"), check_share(outliers, "outliers")
        modes = [f"f{i + 1}" for i in range(KINDS[self.kind].n_modes)]
        level = self.noise if noise is None else check_noise(noise, len(modes))
        model = self.truth.damaged({} if damage is None else damage, kind=kind)
        own = 0 if random_state is None else 1 + as_random_state(random_state).randint(2**31 - 1)
        hours = 24 // samples_per_day
        weather = self.climate.weather(index[0], index[-1] + pd.Timedelta(hours=hours - 1), (*self.seed, 100, own))
        years, rows = weather.index.year.unique(), weather.index.get_indexer(index)

        def means(hourly: Array) -> Array:
            return hourly[rows[0] : rows[-1] + hours].reshape(len(index), hours).mean(axis=1)

        offsets = 0.8 * self._random("zones").standard_normal(len(self.laws))
        theta = {
            zone: np.exp(law.log_multiplier(means(part_temperature(weather, law.hours, law.sun)) + offset))
            for (zone, law), offset in zip(self.laws.items(), offsets, strict=True)
        }
        clean = model.frequencies(np.column_stack(list(theta.values())))
        drawn = drawn_by_hour(years, 5 * len(modes) + 1, (*self.seed, 101, own))
        disturbed = measured(clean, level, gaps, outliers, rows, drawn)
        noises, missing = np.split(drawn_by_hour(years, 2 * len(self.roles), (*self.seed, 102, own)), 2, axis=1)
        read = {
            one.name: means(one.offset + part_temperature(weather, one.hours, one.sun)) + one.noise * own_noise
            for one, own_noise in zip(draw_thermometers(self._random("thermometers")), noises[rows].T, strict=True)
        }
        return FleetRecords(
            temperatures=pd.DataFrame(read, index).mask(persistent(missing, 18.0)[rows] < ndtri(0.2 * gaps)),
            frequencies=pd.DataFrame(disturbed, index, modes),
            clean_frequencies=pd.DataFrame(clean, index, modes),
            theta=pd.DataFrame(theta, index),
        )

    @cached_property
    def _design(self) -> Design:
        """Stiffnesses and masses, drawn until the frequencies are so far apart that modes keep their order."""
        random, kind = self._random("design"), KINDS[self.kind]
        for _ in range(100):
            design = kind.design(self.covariates["span"], self.covariates["material"], random)
            nominal = assemble_truth(kind, design, further_modes=1).frequencies(np.ones((1, len(kind.zones))))[0]
            if (np.diff(nominal) > 0.07 * nominal[:-1]).all():
                break
        return design

    def _random(self, what: str) -> np.random.RandomState:
        """Random numbers for one thing that is drawn, whatever else is drawn."""
        drawn = ("who", "design", "error", "laws", "zones", "climate", "thermometers", "noise")
        return stream(*self.seed, drawn.index(what))


def assemble_truth(kind: Kind, design: Design, further_modes: int = 0) -> AffineModel:
    """The model whose parameters are the thermal zones."""
    zones, n_modes = list(kind.zones), kind.n_modes + further_modes
    return kind.build(design, True).assemble(zones, groups=kind.groups, n_modes=n_modes)


def record_times(start: str | datetime, days: int, samples_per_day: int) -> pd.DatetimeIndex:
    """Times of the records."""
    days, samples_per_day = positive_integer(days, "days"), positive_integer(samples_per_day, "samples_per_day")
    if 24 % samples_per_day:
        raise ValueError(f"samples_per_day is {samples_per_day}; expected a divisor of 24, such as 1, 4 or 24")
    first = pd.Timestamp(start)
    if first.tz is not None or first != first.floor("h"):
        raise ValueError(f"start is {start!r}; expected a full hour without time zone, such as '2025-01-01'")
    step = pd.Timedelta(hours=24 // samples_per_day)
    return pd.date_range(first, periods=days * samples_per_day, freq=step, name="time")


def check_share(value: float, what: str, most: float = 0.5) -> float:
    """A share of records or bridges."""
    if not is_real(value) or not 0 <= value <= most:
        raise ValueError(f"{what} is {value!r}; expected a share from 0 to {most:g}, such as 0.05 for 5 %")
    return float(value)


def make_fleet(
    n_bridges: int = 20,
    *,
    kinds: Sequence[str] = ("truss", "girder", "arch"),
    atypical: float = 0.05,
    random_state: int | np.random.RandomState | None = None,
) -> dict[str, FleetBridge]:
    """Synthetic fleet of bridges with known truth: trusses, girders and tied arches under their own climates.

    Every bridge has its own span, material, climate, thermometers, noise and stiffnesses. Bridges of one material share
    their thermal laws, with coefficients that scatter about the material's. The FE model that comes with a bridge is a
    little wrong, as users' models are.

    Parameters
    ----------
    n_bridges : int, default=20
        Number of bridges.
    kinds : sequence of {"truss", "girder", "arch"}, default=("truss", "girder", "arch")
        Kinds, in turn.
    atypical : float, default=0.05
        Share of bridges with thermal laws of their own, spread evenly over each kind: "reversed", "doubled" or with the
        "knee elsewhere".
    random_state : int, RandomState or None, default=None
        Seed. With the same integer and the same kinds and share, a larger fleet begins with the bridges of a smaller
        one.

    Returns
    -------
    dict of str to FleetBridge
        Bridges by name ("bridge 000", ...), each with its FE ``model`` and ``groups``, ``records(days, ...)``, the
        ``roles`` of its thermometers, its ``noise``, ``covariates`` ("kind", "material", "span" in m, "latitude" in
        degrees), and its ``truth``. Bridges are small until their models and records are asked for, so that workers
        make these themselves.

    Raises
    ------
    ValueError
        If a kind is unknown, or the share is not between 0 and 1.

    Notes
    -----
    Kinds, with five modes, mostly between 1 and 30 Hz, and their parameters: trusses (``deck``, ``top``, ``diagonals``,
    ``bearings``), girders over two or three spans (``deck``, ``torsion``, ``bearings``, ``soil``) and tied arches
    (``deck``, ``arch``, ``hangers``, ``bearings``). The user's model has a coarser mesh (but for the truss),
    stiffnesses that are 2 to 5 % off, masses that are 1 % off, and parameters that cut across the thermal zones of the
    truth. :ref:`bridges-of-a-fleet` describes spans, climates and thermal laws.

    Examples
    --------
    >>> from skthermo.datasets import make_fleet
    >>> fleet = make_fleet(20, random_state=0)
    >>> [name for name, bridge in fleet.items() if bridge.is_atypical]
    ['bridge 007']
    >>> fleet["bridge 001"].covariates
    {'kind': 'girder', 'material': 'concrete', 'span': 28.4, 'latitude': 51.71}
    """
    n_bridges = positive_integer(n_bridges, "n_bridges")
    if isinstance(kinds, str) or not kinds or not set(kinds) <= set(KINDS):
        raise ValueError(f"kinds is {kinds!r:.200}; expected some of {tuple(KINDS)}")
    atypical = check_share(atypical, "atypical", 1.0)
    root = int(as_random_state(random_state).randint(2**31 - 1))
    first = stream(root).uniform()
    bridges = []
    for k in range(n_bridges):
        round_, turn = divmod(k, len(kinds))
        phase = first + turn / len(kinds)
        is_atypical = np.floor((round_ + 1) * atypical + phase) > np.floor(round_ * atypical + phase)
        atypical_law = [*ATYPICAL_LAWS][stream(root, k).randint(len(ATYPICAL_LAWS))] if is_atypical else None
        bridges.append(FleetBridge(f"bridge {k:03d}", kinds[turn], (root, k), atypical_law))
    return {bridge.name: bridge for bridge in bridges}
