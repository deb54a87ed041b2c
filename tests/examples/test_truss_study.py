"""The truss study with two seeds: its tables, and the benchmark's targets."""

import numpy as np
import pytest

from tests.benchmarks.truss_tables import NAMES, SingleRecords, best_theta, detectable, run, summary
from tests.examples.pages import recipes

GROUPS = ["bottom", "top", "diagonal"]


EXAMPLE = recipes("truss")

pytestmark = pytest.mark.nightly


@pytest.fixture(scope="module")
def realisations():
    return [EXAMPLE.Realisation(seed) for seed in range(2)]


@pytest.fixture(scope="module")
def studies(realisations):
    return [one.study(n_repeats=5) for one in realisations]


@pytest.fixture(scope="module")
def tables():
    return run(range(2), n_draws=1)


def test_simulated_years_err_little_more_than_noise(realisations):
    table = EXAMPLE.table_2(realisations)
    assert list(table.index) == ["SH-0", "SB-50", "ST-50", "SD-50", "Average"]
    assert 1.1 < table.loc["Average", ("here", "Average")] <= 1.25
    assert table.loc["Average", ("paper", "Average")] == pytest.approx(1.325, abs=0.01)
    noise = np.sqrt(2 / np.pi) * np.hypot(1, 1)  # of two records of one signal
    assert (table["here"] > 0.9 * noise).all(axis=None)


def test_table_3_is_the_studies_mean_beside_the_papers(studies):
    table = EXAMPLE.table_3(studies)
    names = [EXAMPLE.papers_name(name) for name in NAMES]
    assert list(table.index) == names + ["Average"]
    for ours, source in EXAMPLE.SOURCES.items():
        rates = [study.results_.set_index(["source", "scenario"])["rate"].loc[ours] for study in studies]
        np.testing.assert_allclose(table[source, "here"].loc[names], 100 * sum(rates).loc[NAMES] / 2, atol=0.006)
        assert (table[source, "lowest"] <= table[source, "here"] + 0.01)[:-1].all()
        assert (table[source, "here"] <= table[source, "highest"] + 0.01)[:-1].all()
    published = np.subtract(*EXAMPLE.PAPER_RATES.values())
    assert table.loc["Average", ("difference", "paper")] == pytest.approx(np.abs(published).mean(), abs=0.006)
    assert table.loc["Average", ("difference", "here")] < 1.8


def test_minimum_detectable_damage_is_the_papers(studies):
    table = EXAMPLE.smallest(studies)
    assert list(table.index.unique(0)) == GROUPS
    for level in ("POD 90%", "POD 95%"):
        found = table[level, "here"].unstack("years")
        assert (np.abs(found["simulated"] - found["measured"]) <= 5).all()  # half a step of the severities
        assert (table[level, "lowest"] <= table[level, "here"]).all()
        assert (table[level, "here"] <= table[level, "highest"]).all()
    assert table["POD 90%", "here"].unstack("years")["measured"].loc[GROUPS].tolist() == [20, 30, 20]
    assert (table["", "paper"] <= table["POD 95%", "highest"]).all()


def test_single_records_meet_the_targets_of_the_benchmark(tables):
    table_2, table_3, pfa, distance = summary(*tables[:2]).values()
    assert table_2 <= 1.25
    assert table_3 <= 1.8
    assert pfa <= 5
    assert distance <= 2


def test_oracle_bounds_what_is_learned(tables):
    """No parameters fit the truth better in each row; the discrepancy follows what no parameters can."""
    one = SingleRecords(0)
    truth, *fitted = (frequencies({}) for frequencies in one.sources(one.later).values())
    informed, oracle = (np.sqrt(np.mean((frequencies / truth - 1) ** 2)) for frequencies in fitted)
    assert oracle > 0.003
    assert informed < oracle
    mean = tables[0].groupby("source").mean().mean(axis=1)
    assert mean["oracle"] == pytest.approx(1.2, abs=0.03)
    assert mean["informed"] < 1.15
    assert mean["ratio"] == pytest.approx(1.14, abs=0.03)  # a regression times the nominal model's change by damage


def test_minimum_detectable_damage_is_the_same_for_simulated_weather(tables):
    assert detectable(tables[1], "informed") == detectable(tables[1], "thermo")
    assert detectable(tables[1], "thermo") == {"bottom": 20, "top": 30, "diagonal": 20}


def test_oracle_recovers_parameters_that_exist():
    model = EXAMPLE.make_truss()
    theta = np.array([[0.9, 1.1, 1.05, 1.0], [1.2, 0.9, 0.95, 1.0]])
    fitted = best_theta(model, model.frequencies(theta), steps=60)
    np.testing.assert_allclose(fitted[:, :3], theta[:, :3], rtol=0.01)
