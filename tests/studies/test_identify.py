"""Identified damage: what was put in is found again."""

import copy
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import norm
from scipy.stats import t as student
from sklearn.ensemble import ExtraTreesRegressor

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import BiasAligner
from skthermo.studies import DamagePrior, DetectabilityStudy, identify_damage
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

YEAR, LATER = (make_truss_campaign(random_state=seed) for seed in (0, 1))
WEATHER = LATER.temperatures[::5]
GROUPS = ["bottom", "top", "diagonal"]
TINY = 1e-3
EXACT = DamagePrior(model_error=0, something_else=0)  # the model is right, and nothing else has changed


class WithoutDerivatives:
    """A model that gives frequencies and can be damaged, and no more."""

    def __init__(self, model):
        self.model = model
        self.parameter_names, self.n_modes, self.groups = model.parameter_names, model.n_modes, model.groups

    def frequencies(self, theta):
        return self.model.frequencies(theta)

    def damaged(self, damage):
        return WithoutDerivatives(self.model.damaged(damage))

    def __sklearn_clone__(self):
        return self


def simulated(fem, damage=None, T=WEATHER):
    """Records without noise, with what the fit leaves in such weather."""
    return fem.simulate(T, damage=damage) * (1 + fem.recorder_.residuals.expected(fem.weather(T).inputs))


def most_probable(found):
    """Amounts of the causes of the most probable explanation."""
    if not found.most_probable:
        return {}
    return found.estimates.loc[found.explanations.index[0], "severity"].to_dict()


@pytest.mark.one_case
@pytest.mark.parametrize(
    "damage",
    [{"top": 0.05}, {"diagonal": 0.5}, {"bottom": 0.8}, {"bottom": 0.3, "diagonal": 0.2}, dict.fromkeys(GROUPS, 0.1)],
)
def test_damage_without_noise_is_found_exactly(fem, damage):
    F = simulated(fem, damage)
    found = identify_damage(fem, WEATHER, F, GROUPS, noise=TINY, prior=EXACT, random_state=0)
    expected = {"all groups": 0.1} if len(damage) == len(GROUPS) else damage
    assert most_probable(found) == pytest.approx(expected, abs=2e-3)
    assert found.damage == pytest.approx(damage, abs=2e-3)
    assert found.probability > 0.9
    assert found.probabilities.damage == pytest.approx(1)
    assert found.table["probability"].gt(0.9).to_dict() == {group: group in damage for group in GROUPS}
    assert found.probabilities.p_value < 1e-6
    np.testing.assert_allclose(found.shifts["explained"], found.shifts["measured"], atol=2e-4)


@pytest.mark.one_case
@pytest.mark.parametrize("severity", [0.5, 0.7, 0.88, 0.92])  # modes of the truss swap places at 0.88
def test_severe_damage_of_one_group_is_not_something_else(fem, severity):
    F = simulated(fem, {"diagonal": severity})
    found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert most_probable(found) == pytest.approx({"diagonal": severity}, abs=0.02)
    assert found.probability > 0.8


def test_a_healthy_structure_has_no_damage(fem):
    found = identify_damage(fem, WEATHER, simulated(fem), GROUPS, noise=TINY, random_state=0)
    assert found.most_probable == ()
    assert found.explanations.index[0] == "no damage"
    assert found.probability > 0.9
    assert (found.severities < 1e-3).all()
    assert found.probabilities.p_value > 0.5
    assert found.damage == {}


@pytest.mark.one_case
@pytest.mark.filterwarnings("ignore:.*hidden-offsets")
@pytest.mark.parametrize("method", ["shift", "scale"])
def test_damage_behind_an_aligner(method):
    T, F = YEAR.temperatures[::4], YEAR.frequencies[::4] * 1.1
    fem = DataInformedFEM(make_truss(), aligner=BiasAligner(make_truss(), method=method), random_state=0).fit(T, F)
    F = simulated(fem, {"top": 0.2})
    found = identify_damage(fem, WEATHER, F, GROUPS, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"top": 0.2}, abs=2e-3)


def test_a_reduced_model_finds_the_same(fem, reduced_fem):
    F = simulated(fem, {"top": 0.2, "bottom": 0.4, "diagonal": 0.1})
    found, expected = (
        identify_damage(each, WEATHER, F, GROUPS, noise=0.001, random_state=0) for each in (reduced_fem, fem)
    )
    pd.testing.assert_series_equal(found.severities, expected.severities, atol=0.01)
    pd.testing.assert_series_equal(found.table["probability"], expected.table["probability"], atol=0.02)


def test_differences_replace_exact_derivatives(fem):
    plain = copy.copy(fem).set_params(model=WithoutDerivatives(make_truss()))
    plain.simulator_ = replace(fem.simulator_, model=plain.model)
    F = simulated(fem, {"top": 0.2, "diagonal": 0.4})
    found, expected = (identify_damage(each, WEATHER, F, GROUPS, noise=0.001, random_state=0) for each in (plain, fem))
    pd.testing.assert_series_equal(found.severities, expected.severities, rtol=1e-3, atol=1e-3)
    pd.testing.assert_series_equal(found.table["probability"], expected.table["probability"], atol=1e-3)


def test_frames_and_arrays_alike_and_rows_in_any_order(fem, fem_of_arrays):
    T = LATER.temperatures[:80]
    F = fem.simulate(T, damage={"top": 0.2}, noise="fitted", random_state=0)
    F.iloc[::3, 1] = np.nan
    arrays, order = (T.to_numpy(), F.to_numpy()), np.random.RandomState(0).permutation(len(F))
    expected, stated = (identify_damage(fem, T, F, GROUPS, noise=n, random_state=0) for n in ("fitted", 0.01))
    as_arrays = identify_damage(fem_of_arrays, *arrays, GROUPS, noise=0.01, random_state=0)
    shuffled = identify_damage(fem, T.iloc[order], F.iloc[order], GROUPS, random_state=0)
    np.testing.assert_allclose(as_arrays.explanations["probability"], stated.explanations["probability"], rtol=1e-4)
    np.testing.assert_allclose(as_arrays.shifts, stated.shifts, rtol=1e-4)
    np.testing.assert_allclose(
        shuffled.shifts[["measured", "standard_error"]], expected.shifts[["measured", "standard_error"]]
    )
    assert shuffled.most_probable == expected.most_probable
    pd.testing.assert_series_equal(shuffled.severities, expected.severities, atol=2e-3)  # effects over other rows


def test_same_seed_same_bits(fem):
    F = simulated(fem, {"top": 0.2})
    one, same, other = (identify_damage(fem, WEATHER, F, GROUPS, noise=0.01, random_state=seed) for seed in (0, 0, 1))
    pd.testing.assert_frame_equal(one.draws, same.draws)
    pd.testing.assert_frame_equal(one.table, same.table)
    assert not one.draws.equals(other.draws)
    pd.testing.assert_series_equal(one.explanations["probability"], other.explanations["probability"])
    pd.testing.assert_series_equal(one.severities, other.severities, atol=1e-3)


@pytest.mark.filterwarnings("ignore:.*not-predicted")
def test_records_with_gaps_and_modes_that_were_not_measured(fem):
    F = simulated(fem, {"top": 0.2})
    F.iloc[:, 2], F.iloc[::2, 0], F.iloc[10:20] = np.nan, np.nan, np.nan
    T = WEATHER.copy()
    T.iloc[3] = np.nan
    with pytest.warns(UserWarning, match=r"11 of 73\s.*10 .*1 .*not-compared"):
        found = identify_damage(fem, T, F, GROUPS, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"top": 0.2}, abs=2e-3)
    assert (found.records.n_given, found.records.n_compared) == (73, 62)
    assert "62\xa0records" in next(found.records.sentences())
    counts = (F.notna() & T.notna().all(axis=1).to_numpy()[:, np.newaxis]).sum()
    assert found.shifts["n_records"].tolist() == counts.tolist()
    assert found.shifts.isna().any(axis=1).tolist() == [name == F.columns[2] for name in F]


@pytest.mark.filterwarnings("ignore:.*few-independent-records")
def test_one_record_says_less_than_many(fem):
    record = simulated(fem, {"diagonal": 0.4})[:1]
    found = identify_damage(fem, WEATHER[:1], record, GROUPS, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"diagonal": 0.4}, abs=2e-3)
    wide = identify_damage(fem, WEATHER[:1], record, GROUPS, prior=EXACT, random_state=0)
    many = identify_damage(fem, WEATHER, simulated(fem, {"diagonal": 0.4}), GROUPS, prior=EXACT, random_state=0)
    assert wide.most_probable == many.most_probable == ("diagonal",)
    assert wide.table.loc["diagonal", "standard_error"] > 3 * many.table.loc["diagonal", "standard_error"]
    assert wide.probability < many.probability


@pytest.mark.filterwarnings("ignore:.*not-compared")
def test_outliers_are_left_out_and_counted(fem):
    F = fem.simulate(WEATHER, damage={"top": 0.2}, noise="fitted", random_state=0)
    clean = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert clean.records.left_out == {}
    for i, row in enumerate(range(4, 73, 8)):
        F.iloc[row, i % 6] *= 1.3
    found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert found.records.left_out == {"far from the other records": 9}
    assert found.records.n_compared == 64
    assert found.most_probable == ("top",)
    assert found.severities["top"] == pytest.approx(clean.severities["top"], abs=0.01)


@pytest.mark.filterwarnings("ignore:.*not-compared")
def test_damage_that_has_just_begun_is_not_silence(fem):
    F = fem.simulate(WEATHER, noise="fitted", random_state=0)
    F.iloc[-10:] = fem.simulate(WEATHER[-10:], damage={"diagonal": 0.5}, noise="fitted", random_state=1).to_numpy()
    with pytest.warns(UserWarning, match=r"10\s.*last-records-differ"):
        found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert found.records.n_latest == 10
    last = identify_damage(fem, WEATHER[-10:], F[-10:], GROUPS, random_state=0)
    assert last.most_probable == ("diagonal",)


def test_joined_groups_have_one_severity(fem):
    F = simulated(fem, {"bottom": 0.2, "top": 0.2})
    groups = {"chords": ["bottom", "top"], "web": "diagonal"}
    found = identify_damage(fem, WEATHER, F, groups, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"chords": 0.2}, abs=2e-3)
    assert found.members == {
        "chords": ["bottom", "top"],
        "web": ["diagonal"],
        "all groups": ["bottom", "top", "diagonal"],
    }
    assert found.damage == pytest.approx({"bottom": 0.2, "top": 0.2}, abs=2e-3)


def test_overlapping_groups_multiply(fem):
    F = simulated(fem, {"bottom": 1 - 0.8 * 0.9, "top": 0.2, "diagonal": 0.1})
    groups = {"chords": ["bottom", "top"], "lower": ["bottom", "diagonal"]}
    found = identify_damage(fem, WEATHER, F, groups, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"chords": 0.2, "lower": 0.1}, abs=2e-3)
    assert found.damage == pytest.approx({"bottom": 0.28, "top": 0.2, "diagonal": 0.1}, abs=2e-3)
    assert (found.draws["bottom"] >= found.draws[["top", "diagonal"]].max(axis=1) - 1e-12).all()


def test_known_standard_error_of_a_single_group(fem):
    """With one group, the standard error is that of weighted least squares."""
    F, noise = simulated(fem, {"top": 0.2}), 0.01
    found = identify_damage(fem, WEATHER, F, "top", noise=noise, prior=EXACT, random_state=0)

    def slope_at(severity, step=1e-4):
        higher, lower = (np.log(fem.simulate(WEATHER, damage={"top": severity + h})) for h in (step, -step))
        return np.linalg.norm(((higher - lower) / (2 * step)).mean())

    number = fem.recorder_.residuals.n_expected(fem.weather(WEATHER).inputs)[0]
    deviation = noise * np.sqrt(1 / len(F) + 1 / number)
    two_errors = student.isf(norm.sf(2), len(fem.recorder_.residuals.values)) / 2  # Student's law, not the normal one
    assert found.table.loc["top", "error_alone"] == pytest.approx(two_errors * deviation / slope_at(0.0), rel=0.01)
    assert found.table.loc["top", "standard_error"] == pytest.approx(deviation / slope_at(0.2), rel=0.05)
    assert found.table.loc["top", "if_damaged"] == pytest.approx(0.2, abs=2e-3)
    width = found.table.loc["top", "ci_high"] - found.table.loc["top", "ci_low"]
    assert width == pytest.approx(2 * norm.isf(0.05) * found.table.loc["top", "standard_error"], rel=0.1)


@pytest.mark.filterwarnings("ignore:.*few-baseline-records")
def test_draws_make_a_scenario(fem):
    found = identify_damage(fem, WEATHER, simulated(fem, {"top": 0.2, "bottom": 0.2}), GROUPS, random_state=0)
    scenario = found.scenario("as found")
    assert scenario.draws["top"].mean() == pytest.approx(found.severities["top"], abs=0.005)
    assert scenario.draws["top"].std() == pytest.approx(found.table.loc["top", "standard_error"], rel=0.2)
    study = DetectabilityStudy(fem, MahalanobisDetector(), [scenario], n_repeats=3, random_state=0, uncertainty="noise")
    results = study.run(WEATHER)
    assert results["scenario"].tolist() == ["as found"]
    assert results["rate"].between(0.5, 1).all()


@pytest.mark.nightly
def test_a_mapper_that_has_learned_noise_finds_no_damage_in_healthy_records(fem):
    """Its own residuals are nothing like those of new records."""
    later = make_truss_campaign(random_state=107)
    mapper = TemperatureMapper(ExtraTreesRegressor(20, random_state=0))
    other = DataInformedFEM(make_truss(), mapper=mapper, random_state=0).fit(YEAR.temperatures, YEAR.frequencies)
    found = identify_damage(other, later.temperatures[:60], later.frequencies[:60], GROUPS, random_state=0)
    assert found.most_probable == ()
    expected = identify_damage(fem, later.temperatures[:60], later.frequencies[:60], GROUPS, random_state=0)
    assert (found.shifts["standard_error"] > 0.8 * expected.shifts["standard_error"]).all()
