"""A synthetic fleet of bridges."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property

import numpy as np
import pandas as pd

from skthermo._tables.arrays import as_random_state, is_real, positive_integer
from skthermo.datasets.fleet._bridge import FleetBridge
from skthermo.datasets.fleet._climate import stream
from skthermo.datasets.fleet._laws import ALIENS
from skthermo.datasets.fleet._structures import KINDS


class BridgeFleet(Mapping[str, FleetBridge]):
    """The bridges of `make_fleet` by name.

    Parameters
    ----------
    bridges : sequence of FleetBridge
        In order.

    Attributes
    ----------
    covariates : DataFrame
        A row for each bridge: "kind", "material", "span" in m and "latitude" in degrees.

    See Also
    --------
    make_fleet : How to make one.

    Examples
    --------
    >>> from skthermo.datasets import make_fleet
    >>> [name for name, bridge in make_fleet(20, random_state=0).items() if bridge.is_atypical]
    ['bridge 007']
    """

    def __init__(self, bridges: Sequence[FleetBridge]):
        self._bridges = {bridge.name: bridge for bridge in bridges}

    def __getitem__(self, name: str) -> FleetBridge:
        return self._bridges[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._bridges)

    def __len__(self) -> int:
        return len(self._bridges)

    def __repr__(self) -> str:
        kinds = pd.Series([bridge.kind for bridge in self.values()]).value_counts(sort=False)
        counts = ", ".join(f"{count} {kind}" for kind, count in kinds.items())
        atypical = sum(bridge.is_atypical for bridge in self.values())
        return f"BridgeFleet({counts}; {atypical} with thermal laws of their own)"

    @cached_property
    def covariates(self) -> pd.DataFrame:
        """What the owner knows of each bridge, a row for each name."""
        return pd.DataFrame.from_dict({name: bridge.covariates for name, bridge in self.items()}, orient="index")


def make_fleet(
    n_bridges: int = 20,
    *,
    kinds: Sequence[str] = ("truss", "girder", "arch"),
    atypical: float = 0.05,
    random_state: int | np.random.RandomState | None = None,
) -> BridgeFleet:
    """Synthetic fleet of bridges with known truth: trusses, girders and tied arches under their own climates.

    Every bridge has its own span, material, climate, thermometers, noise and stiffnesses. Those of one material share
    their thermal laws, but for coefficients that scatter about the material's. The FE model that comes with a bridge is
    a little wrong, as users' models are.

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
    BridgeFleet
        A mapping of names ("bridge 000", ...) to `FleetBridge`; its ``covariates`` are a table. Bridges are small until
        their models and records are asked for, so that workers make these themselves.

    Raises
    ------
    ValueError
        If a kind is unknown, or the share is not between 0 and 1.

    Notes
    -----
    Kinds, with five modes, mostly between 1 and 30 Hz:

    - truss: the 28-bar truss scaled to spans of 26 to 58 m, with a floor and pavement on its bottom chord; parameters
      ``deck``, ``top``, ``diagonals`` and ``bearings``;
    - girder: continuous over two or three spans of at most 20 to 45 m, of concrete or composite, in bending and
      torsion, its piers on soil; parameters ``deck``, ``torsion``, ``bearings`` and ``soil``;
    - arch: a tied arch of 50 to 120 m in its plane, with a steel or composite deck; parameters ``deck``, ``arch``,
      ``hangers`` and ``bearings``.

    The user's model has a coarser mesh (but for the truss), stiffnesses that are 2 to 5 % off, masses that are 1 % off,
    and parameters that cut across the thermal zones of the truth.

    Climates lie between 43 and 60 degrees of latitude, maritime to continental. Parts follow the air with thermal
    inertia (steel 2 h, concrete 15 h, soil four days) and are warmed by the sun. The logarithm of the stiffness of a
    part changes in proportion to its temperature, and rises below a knee near 0 C, up to a limit, where water freezes
    or elastomers stiffen. The coefficients scatter by 10 to 30 % about those of the material, the knee by 0.5 C.

    Examples
    --------
    >>> from skthermo.datasets import make_fleet
    >>> fleet = make_fleet(20, random_state=0)
    >>> fleet
    BridgeFleet(7 truss, 7 girder, 6 arch; 1 with thermal laws of their own)
    >>> fleet.covariates.head(3)
                  kind  material  span  latitude
    bridge 000   truss     steel  41.5     47.52
    bridge 001  girder  concrete  28.4     51.71
    bridge 002    arch     steel  90.6     53.14
    """
    n_bridges = positive_integer(n_bridges, "n_bridges")
    if isinstance(kinds, str) or not kinds or not set(kinds) <= set(KINDS):
        raise ValueError(f"kinds is {kinds!r:.200}; expected some of {tuple(KINDS)}")
    if not is_real(atypical) or not 0 <= atypical <= 1:
        raise ValueError(f"atypical is {atypical!r}; expected a share from 0 to 1")
    root = int(as_random_state(random_state).randint(2**31 - 1))
    first = stream(root).uniform()
    bridges = []
    for k in range(n_bridges):
        round_, turn = divmod(k, len(kinds))
        phase = first + turn / len(kinds)
        is_atypical = np.floor((round_ + 1) * atypical + phase) > np.floor(round_ * atypical + phase)
        alien = ALIENS[stream(root, k).randint(len(ALIENS))] if is_atypical else None
        bridges.append(FleetBridge(f"bridge {k:03d}", kinds[turn], (root, k), alien))
    return BridgeFleet(bridges)
