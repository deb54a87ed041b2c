"""What may happen to a structure, and the checks that studies share."""

from skthermo.studies.scenarios._scenarios import (
    BaseScenario,
    ProgressiveDamage,
    Scenario,
    UncertainDamage,
    check_chain,
    check_groups,
    read_scenarios,
    sweep,
)

__all__ = [
    "BaseScenario",
    "ProgressiveDamage",
    "Scenario",
    "UncertainDamage",
    "check_chain",
    "check_groups",
    "read_scenarios",
    "sweep",
]
