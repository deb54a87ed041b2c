"""The Z24 examples on a bridge that freezes by a known law, on the real one where its data are, and without data."""

import os
from pathlib import Path

import pytest

from tests.examples.frozen_bridge import SEVERITY, frozen_bridge
from tests.examples.pages import recipes, run

Z24, DAMAGE = recipes("z24"), recipes("z24_damage")

pytestmark = [
    pytest.mark.filterwarnings(r"ignore:\d+ of \d+ rows have temperatures far outside"),
    pytest.mark.filterwarnings("ignore:groups that these modes cannot tell apart"),
    pytest.mark.filterwarnings(r"ignore:\d+ independent baseline records are too few"),  # of windows, in ten days
]

LINES = [f"broken lines, {label}" for label in Z24.SCALES]


@pytest.fixture(scope="module")
def frozen(tmp_path_factory):
    """The bridge that freezes, as the examples read it."""
    folder = tmp_path_factory.mktemp("z24")
    frozen_bridge().to_csv(folder / "z24_monitoring.csv", index=False)
    return Z24.Bridge(Z24.find(folder))


def test_the_damage_is_identified_and_its_alarms_are_foretold(frozen):
    fem, found = DAMAGE.identify(frozen)
    assert found.p_value < 0.01
    for group in ("piers", "soil"):
        assert found.severities[group] == pytest.approx(SEVERITY, abs=2 * found.standard_errors[group])
    assert found.severities.drop(["piers", "soil"]).max() < 0.02
    unexplained = (found.shifts["measured"] - found.shifts["explained"]) / found.shifts["standard_error"]
    assert unexplained.abs().max() < 2
    table = DAMAGE.simulation_table(frozen, Z24.Records.of(frozen), fem, found, LINES, n_repeats=10)
    found = table.loc["damage found"]
    assert (found["measured"].between(found["lowest"] - 5, found["highest"] + 5)).all()


def test_the_chain_predicts_as_well_as_a_direct_regression(frozen):
    ratio = Z24.hold_out_table(frozen, [(True, 0.5), (False, 0.5)])["ratio"]
    for regressor in ("broken lines", "boosted trees"):
        tracked, by_rank = (ratio[f"{regressor}, chain, {kind}, bounds 0.5"] for kind in ("tracked", "sorted"))
        assert tracked < 1.05
        assert by_rank > tracked


def test_a_spread_by_weather_finds_the_damage_at_few_false_alarms(frozen):
    records = Z24.Records.of(frozen)
    table = Z24.alarm_table(
        {label: Z24.compensate(records, Z24.TemperatureMapper(), scale)[0] for label, scale in Z24.SCALES.items()}
    )
    assert (table["false alarms"] <= 5).all()
    assert table["damage found"][Z24.WHITENED] > 95


def test_the_parameter_that_was_damaged_falls(frozen):
    measured, names = DAMAGE.in_parameters(Z24.Records.of(frozen))
    fall = DAMAGE.changes(measured, names).damaged.mean()
    assert fall["piers_soil"] == pytest.approx(-100 * SEVERITY, abs=5)
    assert fall.drop("piers_soil").abs().max() < 5


@pytest.mark.parametrize("page", ["z24_bridge", "z24_detection", "z24_damage"])
@pytest.mark.parametrize(
    ("arguments", "message"),
    [([], "No Z24 data at SKTHERMO_DATA, which is not set"), (["no/such/folder"], "No Z24 data at no/such/folder")],
)
def test_without_data_it_says_what_to_get_and_where(page, arguments, message, monkeypatch):
    monkeypatch.delenv("SKTHERMO_DATA", raising=False)
    with pytest.raises(SystemExit) as left:
        run(page, *arguments)
    assert left.value.code.startswith(message)  # to stderr, with status 1
    assert "https://bwk.kuleuven.be/bwm/z24" in left.value.code


@pytest.fixture(scope="module")
def real():
    if "SKTHERMO_DATA" not in os.environ:
        pytest.skip("SKTHERMO_DATA does not name the folder with z24/z24_monitoring.csv")
    return Z24.Bridge(Z24.find(Path(os.environ["SKTHERMO_DATA"])))


def test_the_real_bridge_is_predicted_as_well_as_by_a_direct_regression(real):
    table = Z24.hold_out_table(real, [(True, 0.3), (True, 0.5)])
    ratios = table["ratio"].drop(["broken lines, T to F", "boosted trees, T to F"])
    assert len(ratios) == 4
    assert (ratios < 1.03).all()
    assert table["mean"]["broken lines, chain, tracked, bounds 0.3"] < 0.62


def test_the_real_bridges_damage_is_found(real):
    records = Z24.Records.of(real)
    found = {
        name: Z24.compensate(records, estimator, "local")[0]
        for name, estimator in (("broken lines", Z24.TemperatureMapper()), ("trees", Z24.boosting()))
    }
    table = Z24.alarm_table(found)
    assert (table["false alarms"] <= 3).all()
    assert (table["damage found"] >= 80).all()
    days = Z24.found_by_day({("broken lines", Z24.WHITENED): found["broken lines"]}).loc["found"]
    assert (days.iloc[2:] == 100).all()


def test_the_real_bridges_rates_are_within_the_simulated_band(real):
    fem, found = DAMAGE.identify(real)
    unexplained = (found.shifts["measured"] - found.shifts["explained"]) / found.shifts["standard_error"]
    assert unexplained.abs().max() < 2
    assert found.table.loc["soil", "significant"]
    table = DAMAGE.simulation_table(real, Z24.Records.of(real), fem, found, LINES, n_repeats=10)
    found = table.loc["damage found"]
    assert found["measured"].between(found["lowest"], found["highest"]).all()
