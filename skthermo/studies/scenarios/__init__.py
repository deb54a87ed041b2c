"""What may happen to a structure, and the checks that studies share."""

from skthermo.studies.scenarios._base import BaseScenario, check_chain, check_groups
from skthermo.studies.scenarios._progressive import ProgressiveDamage
from skthermo.studies.scenarios._scenario import Scenario, read_scenarios, sweep
from skthermo.studies.scenarios._uncertain import UncertainDamage

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
