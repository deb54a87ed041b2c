"""From a logger's file to a fitted chain, on a log of known law."""

import numpy as np
import pandas as pd
import pytest

from tests.examples.pages import run

pytestmark = pytest.mark.nightly

SAID = {
    "rad/s instead of Hz": "are about those in rad/s",
    "frequencies 1.5 times too high": "uncalibrated-model",
    "two modes swapped": "mode-order",
    "a thermometer that died": "faulty-sensor",
    "a thermometer that got stuck": "'T1' is 10 °C in 250 of 400 rows",
    "30 records": "few-records",
    "kelvin in fit": "as in kelvin",
    "kelvin in predict": "other-weather",
    "Fahrenheit in predict": "other-weather",
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("tower")


@pytest.fixture(scope="module")
def page(folder):
    return run("your_own_structure", "--figures", folder)


@pytest.fixture(scope="module")
def log(page, folder):
    page["write_synthetic_log"](folder / "tower.csv", page["tower"](7), page["SCATTER"])
    return folder / "tower.csv"


def test_the_log_has_the_defects_of_a_logger_and_is_read_in_order(page, log):
    raw, (T, F) = pd.read_csv(log, parse_dates=["time"]), page["read_log"](log)
    steps = raw["time"].diff().dropna().dt.total_seconds()
    assert (steps < 0).sum() == 1
    assert (steps > 20 * 3600).sum() == 2
    assert raw["time"].dt.second.nunique() > 10
    assert T.index.is_monotonic_increasing
    assert T.index.equals(F.index)
    assert (list(T), list(F)) == (["T1", "T2"], [f"f{i}" for i in range(1, 8)])
    assert len(T) == len(raw)


def test_updating_finds_the_scale_of_the_log(page, log):
    taught = page["read_log"](log)[1][: page["n_train"]]
    found = page["model"].frequencies(np.ones((1, 4)))[0]
    np.testing.assert_allclose(found, taught.mean(), rtol=0.002)
    (left_out,) = page["fem"].report_.rows.left_out.index
    assert left_out.startswith("a lag reaches into a gap")


def test_the_chain_predicts_as_well_as_a_direct_regression(page):
    error = page["errors"]["mean"]
    assert error["chain"] < 1.1 * error["ridge, T to F"]
    assert error["chain"] < 0.2 * error["training mean"]
    assert error["chain"] < 0.15  # 0.12 is noise alone


def test_every_mistake_is_named_and_nothing_else(page):
    messages = dict(page["mistakes"])
    assert messages.pop("nothing wrong") == []
    assert set(messages) == set(SAID)
    for mistake, expected in SAID.items():
        assert any(expected in text for text in messages[mistake]), (mistake, messages[mistake])


def test_three_figures_are_saved(page, folder):
    assert len(list(folder.glob("your_own_structure_*.png"))) == 3
