"""The truss study with two seeds, to the targets of the benchmark with many."""

import importlib.util
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("matplotlib").use("Agg")

ROOT = Path(__file__).parents[2]


def load(path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


BENCHMARK = load(ROOT / "tests" / "benchmarks" / "truss_tables.py")
STUDY = BENCHMARK.load_study()


@pytest.fixture(scope="module")
def tables():
    return STUDY.run(range(2))


def test_tables_2_and_3(tables):
    table_2, table_3, pfa, distance = BENCHMARK.summary(STUDY, *tables).values()
    assert table_2 <= 1.25
    assert table_3 <= 1.8
    assert pfa <= 5
    assert distance <= 2


def test_oracle_bounds_what_is_learned(tables):
    """No parameters fit the truth better in each row; noise hides most of the difference."""
    study = STUDY.Study(0)
    truth, *fitted = (model.frequencies(theta) for model, theta in study.sources(study.unseen).values())
    informed, oracle = (np.sqrt(np.mean((frequencies / truth - 1) ** 2)) for frequencies in fitted)
    assert 0.003 < oracle < informed < 1.3 * oracle
    mean = tables[0].groupby("source").mean().mean(axis=1)
    assert mean.to_numpy() == pytest.approx(1.2, abs=0.03)


def test_minimum_detectable_damage_is_the_same_for_simulated_weather(tables):
    assert STUDY.detectable(tables[1], "informed") == STUDY.detectable(tables[1], "thermo")
    assert STUDY.detectable(tables[1], "thermo") == {"SB": 20, "ST": 30, "SD": 20}


def test_oracle_recovers_parameters_that_exist():
    model = STUDY.make_truss()
    theta = np.array([[0.9, 1.1, 1.05, 1.0], [1.2, 0.9, 0.95, 1.0]])
    fitted = STUDY.best_theta(model, model.frequencies(theta), steps=60)
    np.testing.assert_allclose(fitted[:, :3], theta[:, :3], rtol=0.01)


def test_grid_search_example_has_a_truss_that_lags_behind_the_air():
    example = load(ROOT / "examples" / "plot_grid_search.py")
    T, F = example.monitoring(n_days=10)
    assert T.index.equals(F.index)
    assert len(T) == 240
    lagged = T["T1"].ewm(halflife=8).mean()
    assert abs(np.corrcoef(F["f1"], lagged)[0, 1]) > abs(np.corrcoef(F["f1"], T["T1"])[0, 1])
