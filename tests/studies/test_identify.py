"""Identified damage: what was put in is found again."""

import copy
import warnings

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from scipy.stats import norm
from sklearn.exceptions import NotFittedError

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.fem import AffineModel, CallableModel
from skthermo.preprocessing import BiasAligner
from skthermo.studies import DamagePrior, DetectabilityStudy, identify_damage
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, with_model
from tests.residuals.series import autoregressive
from tests.studies.identified import identified

TRUSS = make_truss()
YEAR, LATER = (make_truss_campaign(random_state=seed) for seed in (0, 1))
WEATHER = LATER.temperatures[::5]
GROUPS = ["bottom", "top", "diagonal"]
TINY = 1e-3
EXACT = DamagePrior(model_error=0, something_else=0)  # the model is right, and nothing else has changed
N_MASSES = 9
MEAN = WEATHER.mean()
STILL = MEAN.to_numpy() + 0.02 * (WEATHER - MEAN)  # damage has the same effect on each record


def simulated(fem, damage=None, T=WEATHER):
    """Records without noise, with what the chain leaves in such weather."""
    return fem.simulate(T, damage=damage) * (1 + fem.recorder_.residuals.expected(fem.weather(T).inputs))


@pytest.fixture(scope="module")
def healthy(fem):
    return simulated(fem)


def most_probable(found):
    """Amounts of the causes of the most probable explanation."""
    return found.estimates.loc[found.explanations.index[0], "severity"].to_dict() if found.most_probable else {}


# What was put in is found again


@pytest.mark.one_case
@pytest.mark.parametrize(
    "damage",
    [{"top": 0.05}, {"diagonal": 0.5}, {"bottom": 0.8}, {"bottom": 0.3, "diagonal": 0.2}, dict.fromkeys(GROUPS, 0.1)],
)
def test_damage_without_noise_is_found_exactly(fem, damage):
    prior = DamagePrior(model_error=0.005, something_else=0)  # effects between those that were solved err by less
    found = identify_damage(fem, STILL, simulated(fem, damage, STILL), GROUPS, noise=TINY, prior=prior, random_state=0)
    expected = {"all groups": 0.1} if len(damage) == len(GROUPS) else damage
    assert most_probable(found) == pytest.approx(expected, abs=2e-4)
    assert found.damage == pytest.approx(damage, abs=2e-4)
    assert found.probability > 0.9
    assert found.probability_of_damage == pytest.approx(1)
    assert found.table["probability"].gt(0.9).to_dict() == {group: group in damage for group in GROUPS}
    assert found.p_value < 1e-6
    np.testing.assert_allclose(found.shifts["explained"], found.shifts["measured"], atol=5e-5)
    assert found.misfit_p_value > 0.99


@pytest.mark.one_case
@pytest.mark.filterwarnings("ignore:.*undetermined")  # with so weak diagonals, top and bottom act alike
@pytest.mark.parametrize("severity", [0.5, 0.7, 0.88, 0.92])  # modes of the truss swap places at 0.88
def test_severe_damage_of_one_group_is_not_something_else(fem, severity):
    found = identify_damage(fem, WEATHER, simulated(fem, {"diagonal": severity}), GROUPS, random_state=0)
    assert most_probable(found) == pytest.approx({"diagonal": severity}, abs=0.02)


def test_a_healthy_structure_has_no_damage(fem, healthy):
    found = identify_damage(fem, WEATHER, healthy, GROUPS, noise=TINY, random_state=0)
    assert found.most_probable == ()
    assert found.probability > 0.9
    assert (found.severities < 1e-3).all()
    assert found.p_value > 0.5
    assert found.damage == {}


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
@pytest.mark.parametrize("method", ["shift", "scale"])
def test_damage_behind_an_aligner(method):
    T, F = YEAR.temperatures[::4], YEAR.frequencies[::4] * 1.1
    fem = DataInformedFEM(TRUSS, aligner=BiasAligner(TRUSS, method=method), random_state=0).fit(T, F)
    F = simulated(fem, {"top": 0.2})
    found = identify_damage(fem, WEATHER, F, GROUPS, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"top": 0.2}, abs=2e-3)


def test_a_program_that_gives_frequencies_alone_has_its_parameters_as_groups(fem):
    program = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    F = simulated(fem, {"bottom": 0.15})
    tables = [identify_damage(one, WEATHER, F, GROUPS, random_state=0).table for one in (fem, with_model(fem, program))]
    columns = ["probability", "severity"]
    np.testing.assert_allclose(tables[1][columns], tables[0][columns], atol=2e-3)


@pytest.mark.nightly
def test_a_reduced_model_and_rows_in_any_order_give_the_same(fem, reduced_fem):
    T = LATER.temperatures[:80]
    F = fem.simulate(T, damage={"top": 0.2}, noise="fitted", random_state=0)
    F.iloc[::3, 1] = np.nan
    order = np.random.RandomState(0).permutation(len(F))
    expected = identify_damage(fem, T, F, GROUPS, random_state=0)
    shuffled = identify_damage(fem, T.iloc[order], F.iloc[order], GROUPS, random_state=0)
    pd.testing.assert_frame_equal(shuffled.table, expected.table, rtol=1e-6, atol=1e-6)
    reduced = identify_damage(reduced_fem, T, F, GROUPS, random_state=0)
    pd.testing.assert_series_equal(reduced.severities, expected.severities, atol=0.01)


def test_same_seed_same_bits(fem):
    F = simulated(fem, {"top": 0.2})
    one, same, other = (
        identify_damage(fem, WEATHER, F, ["top", "bottom"], noise=0.01, random_state=seed) for seed in (0, 0, 1)
    )
    pd.testing.assert_frame_equal(one.draws, same.draws)
    pd.testing.assert_frame_equal(one.table, same.table)
    assert not one.draws.equals(other.draws)
    pd.testing.assert_series_equal(one.explanations["probability"], other.explanations["probability"])
    pd.testing.assert_series_equal(one.severities, other.severities, atol=5e-3)


def test_known_standard_error_of_a_single_group(fem):
    """With one group, the standard error is that of weighted least squares."""
    F, noise = simulated(fem, {"top": 0.2}), 0.01
    found = identify_damage(fem, WEATHER, F, "top", noise=noise, prior=EXACT, random_state=0)
    higher, lower = (np.log(fem.simulate(WEATHER, damage={"top": 0.2 + h})) for h in (1e-4, -1e-4))
    slope = np.linalg.norm(((higher - lower) / 2e-4).mean())
    deviation = noise * np.sqrt(1 / len(F) + 1 / len(YEAR.frequencies))
    assert found.table.loc["top", "standard_error"] == pytest.approx(deviation / slope, rel=0.1)
    width = found.table.loc["top", "ci_high"] - found.table.loc["top", "ci_low"]
    assert width == pytest.approx(2 * norm.isf(0.05) * found.table.loc["top", "standard_error"], rel=0.1)


def test_evidence_is_the_integral_over_the_prior(fem):
    """One cause beside none: their odds are those of the integral of Student's likelihood over severities."""
    F = simulated(fem, {"top": 0.02})
    theta = np.nanmean(fem.predict_parameters(WEATHER), axis=0, keepdims=True)
    severities = np.linspace(0, 0.95, 401)
    base = np.log(TRUSS.frequencies(theta))
    effects = np.vstack([np.log(TRUSS.damaged({"top": s}).frequencies(theta)) - base for s in severities])
    variance = 0.05**2 * (1 / len(F) + 1 / len(YEAR.frequencies))
    densities = {"half-normal": np.exp(-((severities / 0.3) ** 2) / 2), "uniform": (severities <= 0.3).astype(float)}
    for law, density in densities.items():
        prior = DamagePrior(numbers=(0.5, 0.5), severity=0.3, law=law, something_else=0, model_error=0)
        found = identify_damage(fem, WEATHER, F, "top", noise=0.05, prior=prior, random_state=0)
        freedom, shift = len(YEAR.frequencies) - 1, np.log1p(found.shifts["measured"].to_numpy())
        misfits = ((shift - effects) ** 2).sum(axis=1) / variance
        likelihood = (1 + misfits / freedom) ** (-(freedom + 6) / 2)
        odds = (likelihood * density).sum() / density.sum() / likelihood[0]
        probable = found.explanations["probability"]
        assert probable["top"] / probable["no damage"] == pytest.approx(odds, rel=0.05)


@pytest.mark.filterwarnings("ignore:.*unexplained-shifts")  # by as little as effects differ with the weather
def test_joined_and_overlapping_groups(fem):
    F = simulated(fem, {"bottom": 0.2, "top": 0.2})
    groups = {"chords": ["bottom", "top"], "web": "diagonal"}
    found = identify_damage(fem, WEATHER, F, groups, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"chords": 0.2}, abs=2e-3)
    assert found.damage == pytest.approx({"bottom": 0.2, "top": 0.2}, abs=2e-3)
    F = simulated(fem, {"bottom": 1 - 0.8 * 0.9, "top": 0.2, "diagonal": 0.1})
    groups = {"chords": ["bottom", "top"], "lower": ["bottom", "diagonal"]}
    found = identify_damage(fem, WEATHER, F, groups, noise=TINY, prior=EXACT, random_state=0)
    assert most_probable(found) == pytest.approx({"chords": 0.2, "lower": 0.1}, abs=2e-3)
    assert found.damage == pytest.approx({"bottom": 0.28, "top": 0.2, "diagonal": 0.1}, abs=2e-3)


@pytest.mark.filterwarnings("ignore:.*few-records")
def test_draws_make_a_scenario(fem):
    found = identify_damage(fem, WEATHER, simulated(fem, {"top": 0.2, "bottom": 0.2}), GROUPS, random_state=0)
    scenario = found.scenario("as found")
    assert scenario.draws["top"].mean() == pytest.approx(found.severities["top"], abs=0.01)
    study = DetectabilityStudy(fem, MahalanobisDetector(), [scenario], n_repeats=3, random_state=0, uncertainty="noise")
    assert study.run(WEATHER)["rate"].between(0.5, 1).all()


# Other causes


@pytest.mark.nightly
def test_stiffening_parameters_and_mass_are_causes_of_their_own(fem):
    asphalt, T = np.full(TRUSS.n_dof, 200.0), WEATHER
    causes = {"stiffening": ["top"], "parameters": ["diagonal"], "added_mass": {"asphalt": asphalt}}
    stiffer = TRUSS.damaged({"top": -0.3})
    theta = np.nanmean(fem.predict_parameters(T), axis=0, keepdims=True)
    changes = {
        "top stiffer": (stiffer.frequencies(theta) / TRUSS.frequencies(theta), -0.3),
        "asphalt": (TRUSS.with_added(mass=0.5 * asphalt).frequencies(theta) / TRUSS.frequencies(theta), 0.5),
        "diagonal higher": (TRUSS.frequencies(theta * [1, 1, 1.2, 1]) / TRUSS.frequencies(theta), 0.2),
    }
    for name, (ratio, amount) in changes.items():
        found = identify_damage(fem, T, simulated(fem) * ratio, GROUPS, noise=TINY, random_state=0, **causes)
        assert found.most_probable == (name,)
        assert found.severities[name] == pytest.approx(amount, rel=0.05)
        assert found.table.loc[name, "kind"] in ("stiffening", "mass", "parameter")


@pytest.mark.one_case
@pytest.mark.parametrize(("stiffness", "amount"), [(1e7, 0.5), (1e9, 1.0)])  # N/m: as mode 1 feels, nearly rigid
def test_a_bearing_that_locks_is_the_spring_that_was_named(fem, healthy, stiffness, amount):
    spring = np.zeros(TRUSS.n_dof)
    spring[list(TRUSS.dofs).index(("7", "x"))] = stiffness
    options = {"groups": GROUPS, "added_stiffness": {"bearing": spring}, "noise": TINY, "random_state": 0}
    theta = np.nanmean(fem.predict_parameters(WEATHER), axis=0, keepdims=True)
    locked = TRUSS.with_added(stiffness=np.diag(amount * spring)).frequencies(theta) / TRUSS.frequencies(theta)
    found = identify_damage(fem, WEATHER, healthy * locked, **options)
    assert found.most_probable == ("bearing",)
    assert found.probability > 0.7
    assert found.severities["bearing"] == pytest.approx(amount, rel=0.05)
    assert found.table.loc["bearing", "kind"] == "spring"
    for damage in ({"top": 0.05}, {"diagonal": 0.3}):
        softer = identify_damage(fem, WEATHER, simulated(fem, damage), **options)
        assert most_probable(softer) == pytest.approx(damage, rel=0.1)
        assert softer.table.loc["bearing", "probability"] < 0.2


def test_what_rises_several_times_is_found_by_the_rise_that_is_likely(fem, healthy):
    theta = np.nanmean(fem.predict_parameters(WEATHER), axis=0, keepdims=True)
    ratio = TRUSS.frequencies(theta * [1, 1, 4.0, 1]) / TRUSS.frequencies(theta)
    for name, word in {"parameters": "higher", "stiffening": "stiffer"}.items():
        options = {"groups": GROUPS, "noise": TINY, "random_state": 0, name: {"diagonal": 2.0}}
        found = identify_damage(fem, WEATHER, healthy * ratio, **options)
        assert found.most_probable == (f"diagonal {word}",)
        assert abs(found.severities[f"diagonal {word}"]) == pytest.approx(3.0, rel=0.05)
        with pytest.raises(ValueError, match=r"expected a relative rise above 0"):
            identify_damage(fem, WEATHER, healthy, **{name: {"diagonal": -1.0}})


def test_a_group_is_not_both_weaker_and_stiffer(fem):
    found = identify_damage(fem, WEATHER, simulated(fem, {"top": 0.2}), ["top"], stiffening=True, random_state=0)
    assert found.most_probable == ("top",)
    assert "top + top stiffer" not in found.explanations.index


@pytest.mark.filterwarnings("ignore:.*unexplained-shifts")
def test_shifts_that_no_group_makes_are_something_else(fem, healthy):
    found = identify_damage(fem, WEATHER, healthy * [1, 1, 1, 1.03, 1, 1], GROUPS, random_state=0)
    assert found.most_probable == ("something else",)
    assert found.probability_other > 0.9
    assert found.damage == {}
    F = simulated(fem, {"top": 0.4})
    F.iloc[:, 5] *= 1.02
    found = identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert found.most_probable == ("top", "something else")
    assert found.estimates.loc[("top + something else", "top"), "severity"] == pytest.approx(0.4, abs=0.05)
    forced = identify_damage(fem, WEATHER, F, GROUPS, prior=DamagePrior(something_else=0), random_state=0)
    assert forced.probability_other == 0
    assert forced.misfit_p_value < 0.05


# What these modes do not tell


def springs(places):
    """Stiffness of springs between neighbours of a row of masses, fixed at both ends."""
    stretch = np.zeros((N_MASSES + 1, N_MASSES))
    for place in places:
        stretch[place, place : place + 1] = 1
        stretch[place, max(place - 1, 0) : place] = -1
    return 1e4 * stretch.T @ stretch


@pytest.fixture(scope="module")
def symmetric():
    """A row of masses whose left and right springs mirror each other; all stiffness falls with temperature."""
    places = {"left": range(3), "middle": range(3, 7), "right": range(7, 10)}
    terms = {("E", name): springs(part) for name, part in places.items()}
    model = AffineModel(terms, np.eye(N_MASSES), n_modes=5).with_parameters(["E"])
    random = np.random.RandomState(0)
    T = pd.DataFrame({"T": 10 + 12 * np.sin(np.arange(200) / 30) + random.standard_normal(200)})
    F = model.frequencies(1 - 0.002 * (T.to_numpy() - 10)) * (1 + 0.01 * random.standard_normal((200, 5)))
    return DataInformedFEM(model, inverse=PosteriorInverse(noise=0.01), random_state=0).fit(T, F), T[::5]


def test_mirrored_groups_are_named_and_share_the_probability(symmetric):
    fem, T = symmetric
    F = simulated(fem, {"left": 0.1}, T)
    with pytest.warns(UserWarning, match="left and right.*undetermined"):
        found = identify_damage(fem, T, F, ["left", "middle", "right"], random_state=0)
    assert found.indistinguishable == [("left", "right")]
    assert found.similarity.loc["left", "right"] == pytest.approx(1, abs=0.01)
    probable = found.explanations["probability"]
    assert probable["left"] == pytest.approx(probable["right"], rel=0.2)
    joined = {"sides": ["left", "right"], "middle": ["middle"]}
    together = identify_damage(fem, T, F, joined, random_state=0)
    assert together.most_probable == ("sides",)
    assert together.indistinguishable == []


@pytest.mark.one_case
@pytest.mark.parametrize("side", ["left", "right"])
def test_shapes_tell_mirrored_groups_apart(symmetric, side):
    fem, T = symmetric
    sensors, damage, F = [0, 2, 4, 6, 8], {side: 0.2}, simulated(fem, {side: 0.2}, T)
    theta = fem.predict_parameters(T).to_numpy().mean(axis=0, keepdims=True)
    healthy = fem.model.modes(theta)[1][0][sensors]
    turned = fem.model.damaged(damage).modes(theta)[1][0][sensors] * np.array([2, -1, 1j, 0.5, 1])
    missing = turned.copy()
    missing[:, 1], missing[2, 3] = np.nan, np.nan
    for damaged in (turned, missing):
        measured = {"shapes": (healthy, damaged), "dofs": sensors, "prior": DamagePrior(model_error=0.01)}
        found = identify_damage(fem, T, F, shape_noise=0.01, random_state=0, **measured)
        assert found.indistinguishable == []
        assert found.severities.to_dict() == pytest.approx({"left": 0, "middle": 0, "right": 0} | damage, abs=6e-3)
        assert found.most_probable == (side,)


def test_shapes_show_what_frequencies_hardly_show(fem):
    later = make_truss_campaign(damage={"vertical": 0.3}, samples_per_year=120, random_state=1)
    records, random, dofs = (later.temperatures, later.frequencies), np.random.RandomState(2), [1, 3, 5, 10, 16, 22]
    shapes = [model.modes(np.ones((1, 4)))[1][0][dofs] for model in (TRUSS, TRUSS.damaged({"vertical": 0.3}))]
    shapes = [s + 0.01 * np.abs(s).max(axis=0) * random.standard_normal((8, *s.shape)) for s in shapes]
    with pytest.warns(UserWarning, match="vertical"):
        without = identify_damage(fem, *records, random_state=0)
    found = identify_damage(fem, *records, shapes=tuple(shapes), dofs=dofs, shape_noise="fitted", random_state=0)
    assert found.most_probable == ("vertical",)
    ends = found.table.loc["vertical", ["ci_low", "ci_high"]]
    assert ends["ci_low"] < 0.3 < ends["ci_high"]
    assert (found.table["error_together"] < without.table["error_together"]).all()
    assert found.table.loc["vertical", "error_alone"] < 0.5 * without.table.loc["vertical", "error_alone"]


def test_one_solve_gives_frequencies_and_shapes(fem, monkeypatch):
    later, dofs = make_truss_campaign(samples_per_year=120, random_state=1), [1, 3, 5, 10, 16, 22]
    shape, solved = TRUSS.modes(np.ones((1, 4)))[1][0][dofs], []

    def counted(solve):
        return lambda model, theta: solved.append(model) or solve(model, theta)

    for name in ("frequencies", "modes"):
        monkeypatch.setattr(AffineModel, name, counted(getattr(AffineModel, name)))
    identify_damage(fem, later.temperatures, later.frequencies, ["top", "diagonal"], random_state=0)
    without = len(solved)
    measured = {"shapes": (shape, shape), "dofs": dofs}
    identify_damage(fem, later.temperatures, later.frequencies, ["top", "diagonal"], random_state=0, **measured)
    assert len(solved) - without < 1.2 * without


def test_groups_that_cannot_be_seen_keep_their_prior_probability(fem, healthy):
    with pytest.warns(UserWarning, match="vertical.*undetermined"):
        found = identify_damage(fem, WEATHER[::2], healthy[::2], random_state=0)
    assert found.unobservable == ["vertical"]
    # of the explanations that remain, those with or without it: 1/5 of single causes, one of which is all groups
    expected = 0.3 / 5 / (0.5 + 0.3 / 5)
    assert expected / 3 < found.table.loc["vertical", "probability"] < 1.5 * expected
    assert found.table.loc["vertical", "if_damaged"] == pytest.approx(0.2 * np.sqrt(2 / np.pi), rel=0.6)
    with pytest.raises(ValueError, match=r"no group can be seen; .* vertical "):
        identify_damage(fem, WEATHER[::8], healthy[::8], ["vertical"])


# Records


@pytest.mark.filterwarnings("ignore:.*not-evaluated")
def test_gaps_outliers_and_what_has_just_begun_are_counted(fem):
    F = fem.simulate(WEATHER, damage={"top": 0.2}, noise="fitted", random_state=0)
    T, worse = WEATHER.copy(), F.copy()
    T.iloc[3], worse.iloc[10:20], worse.iloc[::2, 0] = np.nan, np.nan, np.nan
    worse.iloc[30, 2] *= 1.3
    with pytest.warns(UserWarning, match=r"12 of 73\s.*10 without.*1 without.*1 far from.*not-evaluated"):
        found = identify_damage(fem, T, worse, GROUPS, random_state=0)
    assert found.records["compared"] == 61
    assert found.most_probable == ("top",)
    assert found.severities["top"] == pytest.approx(0.2, abs=0.03)
    last = fem.simulate(WEATHER[-10:], damage={"diagonal": 0.5}, noise="fitted", random_state=1)
    F.iloc[-10:] = last.to_numpy()
    with pytest.warns(UserWarning, match="may have just changed.*not-evaluated"):
        identify_damage(fem, WEATHER, F, GROUPS, random_state=0)
    assert identify_damage(fem, WEATHER[-10:], last, GROUPS, random_state=0).most_probable == ("diagonal",)


@pytest.mark.filterwarnings("ignore:.*few-records")
def test_one_record_says_less_than_many(fem):
    record = simulated(fem, {"diagonal": 0.4})
    groups = ["top", "diagonal"]
    one, many = (identify_damage(fem, WEATHER[:n], record[:n], groups, random_state=0) for n in (1, 73))
    assert one.most_probable == many.most_probable == ("diagonal",)
    assert one.table.loc["diagonal", "standard_error"] > many.table.loc["diagonal", "standard_error"]


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*few-records")
def test_records_that_depend_on_those_before_count_less():
    errors = {}
    for correlation in (0.0, 0.9):
        year = make_truss_campaign(2, correlation=correlation, random_state=0)
        fem = DataInformedFEM(TRUSS, random_state=0).fit(year.temperatures, year.frequencies)
        found = identify_damage(fem, WEATHER, simulated(fem), GROUPS, random_state=0)
        errors[correlation] = found.shifts["standard_error"].mean()
    assert errors[0.9] > 2 * errors[0.0]


@pytest.mark.filterwarnings("ignore:.*(few-records|undetermined)")
@pytest.mark.parametrize("seed", [4, pytest.param(2, marks=pytest.mark.nightly)])
def test_moisture_that_lasts_for_weeks_is_rarely_taken_for_a_change(seed):
    years = make_truss_campaign(3, random_state=seed)
    moisture = autoregressive(len(years.frequencies), np.exp(-1 / 20), seed)
    T, F = years.temperatures, years.frequencies * np.exp(0.003 * moisture)
    fem = DataInformedFEM(TRUSS, random_state=0).fit(T[:365], F[:365])
    months = [slice(start, start + 30) for start in range(365, len(T) - 30, 45)]
    p_values = np.array([identify_damage(fem, T[month], F[month], GROUPS, random_state=0).p_value for month in months])
    assert np.mean(p_values <= 0.05) <= 0.1


def test_records_in_foreign_weather_are_not_compared(fem, healthy):
    F, foreign = healthy, WEATHER.copy()
    foreign.iloc[:5] += 60
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = identify_damage(fem, foreign, F, "top", random_state=0)
    assert sorted(one.message.kind for one in caught) == ["not-evaluated", "other-weather"]
    assert {one.filename for one in caught} == {__file__}
    expected = identify_damage(fem, WEATHER[5:], F[5:], "top", random_state=0)
    pd.testing.assert_series_equal(found.severities, expected.severities, atol=1e-3)
    with pytest.raises(ValueError, match=r"none of 73\srecords can be compared .*: 73 in weather far outside"):
        identify_damage(fem, WEATHER + 60, F, GROUPS)


# Ensembles


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*unexplained-shifts")  # of wrong models
def test_severities_are_averages_over_models(fem):
    later = make_truss_campaign(samples_per_year=120, damage={"diagonal": 0.1}, random_state=1)
    records, groups = (later.temperatures, later.frequencies), ["top", "diagonal"]
    whole, half = (model.matrices(np.ones(4))[0] for model in (TRUSS, TRUSS.damaged({"diagonal": 0.5})))
    models = [TRUSS.with_added(stiffness=2 * factor * (whole - half)) for factor in (0.3, 0.1)]
    one, other, both = (
        identify_damage(fem, *records, groups, models=some, random_state=0).table.loc["diagonal"]
        for some in (models[:1], models[1:], models)
    )
    assert both["severity"] == pytest.approx((one["severity"] + other["severity"]) / 2, rel=0.05)
    assert both["standard_error"] > max(one["standard_error"], other["standard_error"])
    same = [identify_damage(fem, *records, groups, models=[TRUSS, TRUSS], n_jobs=n, random_state=0) for n in (1, None)]
    with parallel_config("threading"):
        same.append(identify_damage(fem, *records, groups, models=[TRUSS, TRUSS], n_jobs=2, random_state=0))
    for found in same[1:]:
        np.testing.assert_array_equal(found.draws, same[0].draws)


# What is said


def test_silence_is_never_healthy():
    healthy = {"no damage": (0.94, {}), "deck": (0.06, {"deck": (0.02, 0.01)})}
    found = identified(healthy, groups=["deck", "vertical"], unobservable=["vertical"], p_value=0.01)
    assert "no damage observable in these modes, probability 94 %" in found.summary()
    assert (
        f"undetected losses of stiffness: {100 * found.table.loc['deck', 'highest_if_damaged']:.2g} %"
        in found.summary()
    )
    assert "do not show damage of vertical" in found.summary()
    assert "rare in a healthy structure (p value 0.01)" in found.summary()


# Errors


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"groups": ["bottom", "deck"]}, r"unknown damage groups \['deck'\]; expected some of \['bottom', "),
        ({"groups": {"chords": []}}, r"expected one or more of"),
        ({"noise": "gaussian"}, "noise is 'gaussian'; expected \"fitted\" or relative standard deviations"),
        ({"noise": 0.0}, "noise is 0.0; expected standard deviations above 0"),
        ({"groups": {"something else": ["top"]}}, r"causes have the names \['something else'\]; expected names"),
        ({"n_jobs": 0}, "n_jobs is 0; expected an integer"),
        ({"prior": 0.5}, "prior is 0.5; expected a DamagePrior"),
        ({"structure": 0.5}, "structure is 0.5; expected the Structure"),
        ({"models": []}, "expected a list of FE models"),
        ({"models": [TRUSS, TRUSS.with_parameters(["top"])]}, "model 1 of models is .* expected the chain.s"),
        ({"shapes": (np.ones((2, 6)), np.ones((2, 6)))}, "one of shapes and dofs came without the other"),
        ({"dofs": [0, 1]}, "one of shapes and dofs came without the other"),
        ({"shapes": (np.ones((2, 6)),) * 2, "dofs": [0, 99]}, "dofs holds 99; expected 0 to 22"),
        ({"shapes": (np.ones((3, 6)),) * 2, "dofs": [0, 1]}, "expected a row for each of 2 sensors"),
    ],
)
def test_bad_options(fem, healthy, change, message):
    with pytest.raises(ValueError, match=message):
        identify_damage(fem, WEATHER, healthy, **{"groups": GROUPS, **change})


def test_a_program_that_fails_under_heavy_damage_is_named(fem, healthy):
    def program(row):
        return TRUSS.frequencies(row[np.newaxis])[0] if row[0] > 0.4 else np.full(6, np.nan)

    failing = with_model(fem, CallableModel(program, TRUSS.parameter_names, 6))
    with pytest.raises(ValueError, match="NaN where bottom"):
        identify_damage(failing, WEATHER, healthy)


def test_bad_records(fem, healthy):
    F = healthy
    with pytest.raises(ValueError, match="temperatures"):
        identify_damage(fem, WEATHER, F[:-1], GROUPS)
    with pytest.raises(ValueError, match=r"have the columns \['a', .*expected \['f1'"):
        identify_damage(fem, WEATHER, F.set_axis(list("abcdef"), axis=1), GROUPS)
    with pytest.raises(ValueError, match=r"have the columns \[0, 1, 2, 3\]; expected \['f1'"):
        identify_damage(fem, WEATHER, F.to_numpy()[:, :4], GROUPS)
    with pytest.raises(ValueError, match="feature names should match"):
        identify_damage(fem, WEATHER.set_axis(list("abc"), axis=1), F)
    zero = F.copy()
    zero.iloc[3, 2] = 0.0
    with pytest.warns(UserWarning, match="'f3' is 0 Hz in 1 of 73 rows.*set-aside"):
        found = identify_damage(fem, WEATHER, zero, "top", random_state=0)
    expected = identify_damage(fem, WEATHER, zero.where(zero > 0), "top", random_state=0)
    pd.testing.assert_frame_equal(found.table, expected.table)
    for factors, message in ((2 * np.pi, "rad/s"), (0.001, "kHz"), ([1, 1, 1, 1, 1, 5], "1 of 6 modes are .*, f6 ")):
        with pytest.raises(ValueError, match=message):
            identify_damage(fem, WEATHER, F * factors, GROUPS)


def test_what_is_no_fitted_chain_or_cannot_be_damaged_is_named(fem, healthy):
    F = healthy
    with pytest.raises(ValueError, match=r"fem is AffineModel.*expected a fitted DataInformedFEM"):
        identify_damage(TRUSS, WEATHER, F)
    with pytest.raises(NotFittedError):
        identify_damage(DataInformedFEM(TRUSS), WEATHER, F)

    class OwnModel:
        """A user's model that offers frequencies alone."""

        parameter_names, n_modes, frequencies = TRUSS.parameter_names, 6, TRUSS.frequencies

    other = copy.copy(fem).set_params(model=OwnModel())
    with pytest.raises(ValueError, match="has no damage groups; expected a model that can be damaged"):
        identify_damage(other, WEATHER, F)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"numbers": (0.5, 0.6)}, "expected probabilities of none, one, two and at most three causes"),
        ({"numbers": (0.2,) * 5}, "numbers is"),
        ({"numbers": {0: 0.5, 1: 0.5}}, "numbers is {0: 0.5, 1: 0.5}; expected numbers"),
        ({"law": np.array(["uniform", "uniform"])}, "expected 'half-normal' or 'uniform'"),
        ({"severity": 0}, "severity is 0; expected a number between 0 and 1"),
        ({"something_else": 1.5}, "something_else is 1.5"),
    ],
)
def test_bad_priors(options, message):
    with pytest.raises(ValueError, match=message):
        DamagePrior(**options)
