"""From a logger's file to a fitted chain: on a log of known law, and on the real one where it is."""

import importlib.util
import os
import sys
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")

PATH = Path(__file__).parents[2] / "examples" / "plot_your_own_structure.py"
SPEC = importlib.util.spec_from_file_location(PATH.stem, PATH)
EXAMPLE = importlib.util.module_from_spec(SPEC)
SPEC.loader.exec_module(EXAMPLE)

SAID = {
    "rad/s instead of Hz": "rad/s instead of Hz?",
    "frequencies 1.5 times too high": "'f1' by +50 %",
    "two modes swapped": "['f2', 'f3'] look like other modes",
    "2 % of temperatures missing, 24 lags": "a lag reaches into a gap",
    "bounds of 0.5 %": "parameters far outside the bounds",
    "30 records": "30 complete rows train 4 parameters",
    "kelvin in fit": "kelvin? expected degrees Celsius",
    "kelvin in predict": "temperatures far outside",
    "Fahrenheit in predict": "temperatures far outside",
}


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """The synthetic log as it is read, and as it is in the file."""
    path = tmp_path_factory.mktemp("tower") / "tower.csv"
    EXAMPLE.write_synthetic_log(path)
    return EXAMPLE.pd.read_csv(path, parse_dates=["time"]), *EXAMPLE.read_log(path)


@pytest.fixture(scope="module")
def fitted(log):
    _, T, F = log
    n_train = 4 * len(T) // 5
    model = EXAMPLE.update(F[:n_train])
    return model, EXAMPLE.chain(model).fit(T[:n_train], F[:n_train]), n_train


def test_the_log_has_the_defects_of_a_logger_and_is_read_in_order(log):
    raw, T, F = log
    steps = raw["time"].diff().dropna().dt.total_seconds()
    assert (steps < 0).sum() == 1
    assert (steps > 20 * 3600).sum() == 2
    assert raw["time"].dt.second.nunique() > 10
    assert T.index.is_monotonic_increasing
    assert T.index.equals(F.index)
    assert (list(T), list(F)) == (["T1", "T2"], [f"f{i}" for i in range(1, 8)])
    assert len(T) == len(raw)


def test_updating_finds_the_scale_of_the_log(fitted, log):
    model, fem, n_train = fitted
    np.testing.assert_allclose(model.frequencies(np.ones((1, 4)))[0], log[2][:n_train].mean(), rtol=0.002)
    assert fem.report_.left_out.index.tolist() == ["a lag reaches into a gap"]


def test_the_chain_predicts_as_well_as_a_direct_regression(fitted, log):
    _, fem, n_train = fitted
    table = EXAMPLE.hold_out_table(fem, *log[1:], n_train)["mean"]
    assert table["chain"] < 1.1 * table["ridge, T to F"]
    assert table["chain"] < 0.2 * table["training mean"]
    assert table["chain"] < 0.15  # 0.12 is noise alone


def test_every_mistake_is_named_and_nothing_else(fitted, log):
    model, fem, n_train = fitted
    _, T, F = log
    messages = EXAMPLE.provoked(model, fem, T[:n_train], F[:n_train])
    assert messages.pop("nothing wrong") == []
    assert set(messages) == set(SAID)
    for mistake, expected in SAID.items():
        assert any(expected in text for text in messages[mistake]), (mistake, messages[mistake])


def test_without_a_log_it_says_so_and_draws(tmp_path, monkeypatch, capsys):
    monkeypatch.delenv("SKTHERMO_DATA", raising=False)
    monkeypatch.setattr(sys, "argv", [str(PATH), "--figures", str(tmp_path)])
    EXAMPLE.main()
    assert "this one is synthetic" in capsys.readouterr().out
    assert len(list(tmp_path.glob("*.png"))) == 3


def test_the_real_tower_is_predicted_better_than_by_its_mean():
    path = Path(os.environ.get("SKTHERMO_DATA", "")) / "tower" / "tower.csv"
    if "SKTHERMO_DATA" not in os.environ or not path.is_file():
        pytest.skip("SKTHERMO_DATA names no folder with tower/tower.csv")
    T, F = EXAMPLE.read_log(path)
    n_train = 4 * len(T) // 5
    fem = EXAMPLE.chain(EXAMPLE.update(F[:n_train])).fit(T[:n_train], F[:n_train])
    table = EXAMPLE.hold_out_table(fem, T, F, n_train)
    assert (table.loc["chain"] < table.loc["training mean"]).all()
    assert table["mean"]["chain"] < 1.2 * table["mean"]["ridge, T to F"]
