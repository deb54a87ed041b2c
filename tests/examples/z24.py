"""The three Z24 examples as modules; the later two import from the first, as they do when run."""

import sys
from importlib import import_module
from pathlib import Path

import pytest

pytest.importorskip("matplotlib").use("Agg")

EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.append(str(EXAMPLES))  # which Python does itself for a file that it runs

BRIDGE, DETECTION, DAMAGE = (import_module(f"plot_z24_{name}") for name in ("bridge", "detection", "damage"))
