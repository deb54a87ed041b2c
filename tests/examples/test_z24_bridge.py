"""The Z24 example on a bridge that freezes by a known law, and without data."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_z24
from skthermo.fem import add_noise

pytest.importorskip("matplotlib").use("Agg")

EXAMPLE = Path(__file__).parents[2] / "examples" / "plot_z24_bridge.py"
SENSORS = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
SEVERITY = 0.25


def run(*arguments, **environment):
    return subprocess.run(
        [sys.executable, EXAMPLE, *map(str, arguments)],
        env={name: value for name, value in os.environ.items() if name != "SKTHERMO_DATA"}
        | {"MPLBACKEND": "Agg"}
        | environment,
        capture_output=True,
        text=True,
    )


def frozen_bridge(n_healthy=500, n_damaged=80):
    """Monitoring of a bridge whose stiffness rises below 0 C, and whose piers and soil are damaged in the end."""
    random = np.random.default_rng(0)
    n = n_healthy + n_damaged
    air = 8 + 12 * np.sin(np.arange(n) / 15) + random.normal(0, 2, n)
    sensors = air[:, np.newaxis] + random.normal(0, 0.5, (n, 7))
    frost = np.clip(-sensors[:, 0], 0, None)[:, np.newaxis]
    theta = 1 + frost * [0.01, 0.02, 0.01, 0.03] - 0.001 * sensors[:, [0]]
    damaged = np.arange(n) >= n_healthy
    F = make_z24().frequencies(theta)
    F[damaged] = make_z24().damaged({"piers_soil": SEVERITY}).frequencies(theta[damaged])
    table = pd.DataFrame(
        np.hstack([add_noise(F, 0.003, random_state=0), sensors]), columns=["f1", "f2", "f3", "f4", *SENSORS]
    )
    table.insert(0, "record", np.arange(n))
    return table.assign(state=np.where(damaged, "damaged", "undamaged"))


@pytest.fixture(scope="module")
def output(tmp_path_factory):
    folder = tmp_path_factory.mktemp("z24")
    frozen_bridge().to_csv(folder / "z24_monitoring.csv", index=False)
    done = run("--figures", folder / "figures", SKTHERMO_DATA=str(folder))
    assert not done.returncode, done.stderr
    return done.stdout, folder


def row(text, start):
    """Numbers of the first line that starts so."""
    line = next(line for line in text.splitlines() if line.startswith(start))
    return [float(word.rstrip("%;")) for word in line[len(start) :].split()]


def test_the_severity_is_found_from_f2_alone_and_the_other_modes_follow(output):
    text, _ = output
    found = float(text.split("fitted to the mean drop of f2: ")[1].split("%")[0]) / 100
    assert found == pytest.approx(SEVERITY, abs=0.02)
    np.testing.assert_allclose(row(text, "simulated"), row(text, "measured "), atol=0.4)


def test_the_chain_predicts_as_well_as_a_direct_regression(output):
    ratio = row(output[0], "chain, tracked, bounds 0.3")[5]
    assert ratio < 1.1
    assert row(output[0], "chain, sorted, bounds 0.3")[5] > ratio


def test_all_figures_are_drawn(output):
    drawn = {file.stem for file in (output[1] / "figures").glob("*.png")}
    assert drawn == {
        f"z24_{name}" for name in ("over_time", "over_temperature", "parameters", "damage_index", "damage")
    }


@pytest.mark.parametrize(
    ("arguments", "message"),
    [((), "No Z24 data at SKTHERMO_DATA, which is not set"), (("no/such/folder",), "No Z24 data at no/such/folder")],
)
def test_without_data_it_says_what_to_get_and_where(arguments, message):
    done = run(*arguments)
    assert done.returncode == 1
    assert message in done.stderr
    assert "https://bwk.kuleuven.be/bwm/z24" in done.stderr
    assert "Traceback" not in done.stderr


def test_the_real_bridge_is_predicted_as_well_as_by_a_direct_regression():
    if "SKTHERMO_DATA" not in os.environ:
        pytest.skip("SKTHERMO_DATA does not name the folder with z24/z24_monitoring.csv")
    spec = importlib.util.spec_from_file_location(EXAMPLE.stem, EXAMPLE)
    example = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(example)
    table = example.hold_out_table(example.Bridge(example.find(Path(os.environ["SKTHERMO_DATA"]))))
    tracked = table.index.str.startswith("chain, tracked")
    assert tracked.sum() == 2
    assert (table["ratio"][tracked] < 1.10).all()
