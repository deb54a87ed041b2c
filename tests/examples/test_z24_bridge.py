"""The Z24 example on a bridge that freezes by a known law, on the real one where its data are, and without data."""

import importlib.util
import os
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.examples.frozen_bridge import SEVERITY, frozen_bridge

pytest.importorskip("matplotlib").use("Agg")

# The last fifth of the healthy records is warmer than the others.
pytestmark = pytest.mark.filterwarnings(r"ignore:\d+ of \d+ rows have temperatures far outside")

PATH = Path(__file__).parents[2] / "examples" / "plot_z24_bridge.py"
SPEC = importlib.util.spec_from_file_location(PATH.stem, PATH)
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)


@pytest.fixture(scope="module")
def frozen(tmp_path_factory):
    """The bridge that freezes, as the example reads it."""
    folder = tmp_path_factory.mktemp("z24")
    frozen_bridge().to_csv(folder / "z24_monitoring.csv", index=False)
    return EXAMPLE.Bridge(EXAMPLE.find(folder))


def test_the_severity_is_found_from_f2_alone_and_the_other_modes_follow(frozen):
    damage = EXAMPLE.Damage(frozen)
    assert damage.severity == pytest.approx(SEVERITY, abs=0.02)
    np.testing.assert_allclose(damage.simulated_drop, damage.measured_drop, atol=0.4)


def test_the_chain_predicts_as_well_as_a_direct_regression(frozen):
    ratio = EXAMPLE.hold_out_table(frozen)["ratio"]
    for regressor in ("broken lines", "boosted trees"):
        tracked, by_rank = (ratio[f"{regressor}, chain, {kind}, bounds 0.5"] for kind in ("tracked", "sorted"))
        assert tracked < 1.05
        assert by_rank > tracked


@pytest.mark.parametrize(
    ("arguments", "message"),
    [([], "No Z24 data at SKTHERMO_DATA, which is not set"), (["no/such/folder"], "No Z24 data at no/such/folder")],
)
def test_without_data_it_says_what_to_get_and_where(arguments, message, monkeypatch):
    monkeypatch.delenv("SKTHERMO_DATA", raising=False)
    monkeypatch.setattr(sys, "argv", [str(PATH), *arguments])
    with pytest.raises(SystemExit) as left:
        EXAMPLE.main()
    assert left.value.code.startswith(message)  # to stderr, with status 1
    assert "https://bwk.kuleuven.be/bwm/z24" in left.value.code


def test_the_real_bridge_is_predicted_as_well_as_by_a_direct_regression():
    if "SKTHERMO_DATA" not in os.environ:
        pytest.skip("SKTHERMO_DATA does not name the folder with z24/z24_monitoring.csv")
    table = EXAMPLE.hold_out_table(EXAMPLE.Bridge(EXAMPLE.find(Path(os.environ["SKTHERMO_DATA"]))))
    tracked = table.index.str.contains("chain, tracked")
    assert tracked.sum() == 4
    assert (table["ratio"][tracked] < 1.03).all()
    assert table["mean"]["broken lines, chain, tracked, bounds 0.3"] < 0.62
