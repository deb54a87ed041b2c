"""What a section on identified damage is made of."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from skthermo.reporting._figures import draw_identified_damage
from skthermo.reporting._readable import Values, csv_link

if TYPE_CHECKING:
    from skthermo.studies import IdentifiedDamage


def identified_facts(identified: IdentifiedDamage) -> dict[str, Any]:
    """What the template of the section is given."""
    groups = Values("identified damage", identified.table.rename_axis("group"))
    return {
        "found": identified,
        "draw": draw_identified_damage,
        "saved": csv_link(groups, "Table of all groups (CSV)"),
    }
