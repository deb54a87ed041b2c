"""The bridge behind `make_kw51_campaign`: how weather moves its stiffness and mass."""

from collections.abc import Mapping
from functools import lru_cache

import numpy as np
import pandas as pd

from skthermo.datasets._kw51 import updated_model
from skthermo.datasets._kw51_structure import N_BAYS, N_PANELS, kw51_structure
from skthermo.datasets._kw51_weather import REFERENCE
from skthermo.fem import AffineModel, Element, Spring, Structure

TRUTH = {
    "E_gir": "deck_beams",
    "E_pla": "plate",
    "E_arc": "arch",
    "E_br": "braces",
    "E_con": "connections",
    "E_pip": "pipes",
    "E_b": "ballast",
    "I_33g": ("I_yy", "girders"),
    "K_bea": "bearings",
    "M_b": ("mass", "ballast"),
}
"""Parameters of the healthy bridge, as `Structure.assemble` binds them."""

BOX = {
    **dict.fromkeys(("E_gir", "E_pla", "E_arc", "E_br", "E_pip"), 0.02),
    "E_con": 0.035,
    "E_b": (0.9, 1.7),
    "I_33g": (0.9, 2.2),
    "K_bea": (0.6, 1.6),
    "M_b": 0.015,
}
"""What weather does to them stays within these bounds."""

STEEL, CONNECTIONS, BALLAST, COMPOSITE, BEARINGS = 3.6e-4, 8e-4, 1.5e-3, 1.5e-3, 0.012  # softer by 1/K
FROZEN_BALLAST, FROZEN_COMPOSITE, FROST_DEPTH = 0.5, 1.0, 2.0  # stiffer by (ratios), K
MOISTURE = 0.0018  # standard deviation of the ballast's mass
SLIDING, ROCKING = 1e7, 3e7  # N/m and N m/rad at each bearing


def thermal_multipliers(weather: pd.DataFrame) -> pd.DataFrame:
    """Multipliers of the parameters ``TRUTH`` in every hour."""
    warm = weather[["steel", "sun", "slab"]] - REFERENCE
    frozen = 1 - np.exp(-weather["frost"] / FROST_DEPTH)
    return pd.DataFrame(
        {
            "E_gir": 1 - STEEL * warm["steel"],
            "E_pla": 1 - STEEL * warm["slab"],
            "E_arc": 1 - STEEL * warm["sun"],
            "E_br": 1 - STEEL * warm["sun"],
            "E_con": 1 - CONNECTIONS * warm["sun"],
            "E_pip": 1 - STEEL * warm["sun"],
            "E_b": (1 - BALLAST * warm["slab"]) * (1 + FROZEN_BALLAST * frozen),
            "I_33g": (1 - COMPOSITE * warm["slab"]) * (1 + FROZEN_COMPOSITE * frozen),
            "K_bea": np.exp(-BEARINGS * warm["steel"]),
            "M_b": 1 + MOISTURE * weather["moisture"],
        }
    )


def truth_structure(added: Mapping[object, Element] | None = None) -> Structure:
    """KW51 with bearings that resist sliding and rocking, and with members that are added as the group "added"."""
    bridge, added = kw51_structure(), added or {}
    ends, lines = (0, N_BAYS), (0, N_PANELS)
    bearings = {("bearing", end, "x"): Spring(("deck", end, N_PANELS), "x", SLIDING) for end in ends}
    bearings |= {
        ("bearing", end, line, "ry"): Spring(("deck", end, line), "ry", ROCKING) for end in ends for line in lines
    }
    groups = bridge.groups
    groups["deck_beams"] = groups["girders"] | groups["transverse_beams"] | groups["stiffeners"]
    groups["bearings"] = frozenset(bearings)
    return Structure(
        nodes=bridge.nodes,
        members={**bridge.members, **bearings, **added},
        supports=bridge.supports,
        groups=groups | ({"added": frozenset(added)} if added else {}),
    )


@lru_cache(maxsize=1)
def truth_model() -> AffineModel:
    """The healthy bridge, updated, with the parameters ``TRUTH``."""
    return updated_model(truth_structure(), TRUTH, 6)
