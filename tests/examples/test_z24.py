"""The Z24 examples on a bridge that freezes by a known law, and without data."""

import functools
from copy import copy

import pytest

from skthermo.datasets import make_z24
from skthermo.studies import sweep
from tests.examples.frozen_bridge import SEVERITY, frozen_bridge
from tests.examples.pages import recipes, run

Z24, DAMAGE, COMPARISON = recipes("z24"), recipes("z24_damage"), recipes("z24_detector")

pytestmark = [
    pytest.mark.filterwarnings("ignore:.*other-weather"),
    pytest.mark.filterwarnings("ignore:.*(indistinguishable|unobservable)-groups"),
    pytest.mark.filterwarnings("ignore:.*few-records"),  # 240 of them, and windows in ten days
]

FEW = ("raw, Mahalanobis", "raw, 20 neighbours", "piecewise-linear", "piecewise-linear, regimes", "linear regression")


@functools.cache
def small_model():
    """A model of the bridge for parameters within 50 %, which is made fast."""
    return make_z24().reduced(0.5, tol=1e-4, random_state=0)


@pytest.fixture(scope="module", autouse=True)
def _models_made_once():
    with pytest.MonkeyPatch.context() as patch:
        once = functools.cache(Z24.bridge_model)
        for module in (Z24, DAMAGE, COMPARISON):
            patch.setattr(module, "bridge_model", once)
        yield


@pytest.fixture(scope="module")
def frozen(tmp_path_factory):
    """The bridge that freezes, as the examples read it."""
    folder = tmp_path_factory.mktemp("z24")
    frozen_bridge().to_csv(folder / "z24_monitoring.csv", index=False)
    return Z24.Bridge(Z24.find(folder))


@pytest.fixture(scope="module")
def few():
    """Some of the field's detectors, that learn fast."""
    return {name: detector for name, detector in COMPARISON.detectors().items() if name in FEW}


@pytest.fixture(scope="module")
def study_results(frozen, few):
    """The damage that is identified, and what detectors say of it, simulated and measured."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(DAMAGE, "bridge_model", small_model)
        fem, found = DAMAGE.identify(frozen)
    return found, COMPARISON.compare(frozen, fem, found.scenario(COMPARISON.DAMAGED), few, n_repeats=4)


@pytest.mark.nightly
def test_the_damage_is_identified(study_results):
    found, _ = study_results
    assert found.p_value < 0.01
    for group in ("piers", "soil"):
        assert found.severities[group] == pytest.approx(SEVERITY, abs=2 * found.table.loc[group, "standard_error"])
    assert found.severities.drop(["piers", "soil"]).max() < 0.02
    unexplained = (found.shifts["measured"] - found.shifts["explained"]) / found.shifts["standard_error"]
    assert unexplained.abs().max() < 2


@pytest.mark.nightly
def test_its_alarms_are_predicted(study_results):
    table = COMPARISON.side_by_side(study_results[1])
    assert list(table.index) == list(FEW)
    rates = table["damage found"]
    assert (rates["measured"].between(rates["lowest"] - 5, rates["highest"] + 5)).all()
    assert COMPARISON.agreement(table).loc["damage found", "rank correlation"] > 0.7


@pytest.mark.nightly
def test_measured_rates_are_those_of_the_study_by_both_labels(frozen, few, study_results):
    records = Z24.Records.of(frozen)
    table = COMPARISON.measured_table(records, few)
    n, first = len(records.damaged), COMPARISON.FIRST
    parts = table["alarms in the first 12"] * first + table["found of the other 118"] * (n - first)
    assert (parts / n).tolist() == pytest.approx(table["found of 130"].tolist())
    rates = COMPARISON.side_by_side(study_results[1])
    for state, column in (("false alarms", "false alarms"), ("damage found", "found of 130")):
        assert rates[state, "measured"].tolist() == pytest.approx(table[column].tolist())


@pytest.mark.nightly
def test_the_chain_predicts_nearly_as_well_as_a_direct_regression(frozen):
    """Within a tenth, in weather that neither has seen."""
    ratio = Z24.hold_out_table(frozen)["ratio"]
    for regressor in ("piecewise-linear", "boosted trees"):
        for kind in ("tracked", "sorted"):
            assert ratio[f"{regressor}, chain, {kind}"] < 1.1


@pytest.mark.nightly
def test_two_regimes_find_the_damage_at_few_false_alarms(frozen):
    ways = {label: Z24.compensated(regimes=regimes) for label, regimes in Z24.REGIMES.items()}
    table = Z24.alarm_table(Z24.Records.of(frozen), ways)
    assert (table["false alarms"] <= 5).all()
    assert table["damage found"]["two regimes"] > 95


@pytest.mark.nightly
def test_the_parameter_that_was_damaged_falls(frozen):
    measured, names = DAMAGE.in_parameters(Z24.Records.of(frozen))
    fall = DAMAGE.changes(measured, names).damaged.mean()
    assert fall["piers_soil"] == pytest.approx(-100 * SEVERITY, abs=5)
    assert fall.drop("piers_soil").abs().max() < 5


@pytest.mark.nightly
def test_a_choice_sees_training_rows_only(frozen, few, monkeypatch):
    monkeypatch.setattr(COMPARISON, "bridge_model", small_model)
    monkeypatch.setattr(COMPARISON, "sweep", lambda fem: sweep(fem, (0.1, 0.3), groups=["piers", "soil"]))
    some = {name: few[name] for name in FEW[1:4]}
    spoilt = copy(frozen)
    spoilt.T_damaged = spoilt.F_damaged = None
    spoilt.T, spoilt.F = frozen.T.copy(), frozen.F.copy()
    spoilt.T[frozen.n_train :], spoilt.F[frozen.n_train :] = 1e3, 1e3
    chosen, same = (COMPARISON.choose(one, some, n_repeats=2).ranking()["pod"] for one in (frozen, spoilt))
    assert chosen.equals(same)
    assert chosen.index[0].startswith("piecewise-linear")


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
