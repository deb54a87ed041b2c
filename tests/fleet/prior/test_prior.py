"""What a fleet tells of a new bridge."""

import pickle

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skthermo.detection import TemperatureCompensator
from skthermo.exceptions import RecordsWarning, WeatherWarning
from skthermo.fleet import FleetMapper, FleetPrior
from skthermo.preprocessing import LagFeatures
from tests.fleet.prior.fleets import LAW, records

ATYPICAL = np.array([[2.0, -4.0, -3.0], [3.0, 2.0, 5.0]]) * 1e-3
FLEET = {f"bridge {seed}": records(seed)[:2] for seed in range(12)}


@pytest.fixture(scope="module")
def prior():
    return FleetPrior().fit(FLEET)


def later(seed, **options):
    """A whole later year and its clean frequencies."""
    T, _, clean = records(seed, 365, 365, **options)
    return T, clean


def error(mapper, seed, **options):
    T, clean = later(seed, **options)
    return float(np.abs(mapper.predict(T) / clean - 1).to_numpy().mean())


def test_a_fleet_of_one_law_is_pooled(prior):
    assert prior.comparison_["is_pooled"].all()
    assert (prior.bridges_["pooling_probability"] > 0.9).all()
    assert "f1: pooled over 12" in prior.summary()
    assert_allclose(prior.comparison_["gain"], prior.bridges_["gain"].groupby("family").sum())


def test_few_records_and_the_fleet_are_better_than_either(prior):
    errors = {"fleet": [], "alone": [], "both": []}
    for seed in range(20, 28):
        T, F, _ = records(seed, 30)
        errors["both"].append(error(prior.mapper().fit(T, F), seed))
        errors["alone"].append(error(FleetMapper().fit(T, F), seed))
        errors["fleet"].append(error(prior.mapper().fit(T[:1], F[:1]), seed))
    both, alone, fleet = (np.mean(errors[name]) for name in ("both", "alone", "fleet"))
    assert both < 0.6 * fleet
    assert both < 0.5 * alone


def test_intervals_have_their_confidence(prior):
    inside = []
    for seed in range(30, 60):
        T, F, _ = records(seed, 30)
        mapper = prior.mapper().fit(T, F)
        T, clean = later(seed)
        predicted, std = mapper.predict(T[::7], return_std=True)
        inside.append(np.abs(predicted - clean[::7]) < 1.645 * std)
    assert 0.85 <= np.mean(inside) <= 0.97


def test_much_data_decide_and_no_data_leave_the_mean(prior):
    T, F, _ = records(70, 365, noise=1e-5)
    assert error(prior.mapper().fit(T, F), 70, noise=1e-5) < 1.5 * error(FleetMapper().fit(T, F), 70, noise=1e-5) + 1e-5
    one = prior.mapper().fit(T[:1], F[:1])
    T, _ = later(70)
    known = prior.knowledge_
    change = known.basis(T.to_numpy()) - known.basis(T.to_numpy()).mean(axis=0)
    for i, family in enumerate(["f1", "f2"]):
        fleet = change @ known.families[family].M[0]
        logs = np.log(one.predict(T).to_numpy()[:, i])
        follows = one.pooling_probability_[family]
        assert follows > 0.85
        assert_allclose(logs - logs.mean(), follows * fleet, atol=1e-3)


def test_a_unit_changes_nothing_but_the_level(prior):
    T, F, _ = records(50, 40)
    hertz, rpm = (prior.mapper().fit(T, F * unit) for unit in (1.0, 60.0))
    assert_allclose(rpm.predict(T), 60 * hertz.predict(T))
    assert_allclose(rpm.predict_covariance(T), 3600 * hertz.predict_covariance(T), rtol=1e-6)


def test_order_and_names_of_bridges_change_nothing(prior):
    other = FleetPrior().fit([FLEET[name] for name in reversed(FLEET)])
    assert list(other.bridges_.index.get_level_values(0).unique()) == list(range(12))
    T, F, _ = records(50, 40)
    assert_allclose(other.mapper().fit(T, F).predict(T), prior.mapper().fit(T, F).predict(T), rtol=1e-6)
    assert_allclose(other.comparison_["gain"], prior.comparison_["gain"], rtol=1e-3)


def test_an_atypical_bridge_is_distinguished_from_the_fleet_and_loses_little(prior):
    ratios = []
    for seed in range(80, 86):
        T, F, _ = records(seed, 60, law=ATYPICAL)
        mapper = prior.mapper().fit(T, F)
        assert max(mapper.pooling_probability_.values()) < 0.5
        ratios.append(error(mapper, seed, law=ATYPICAL) / error(FleetMapper().fit(T, F), seed, law=ATYPICAL))
    assert np.mean(ratios) < 1.05


def test_atypicals_in_a_fleet_are_found_and_do_not_widen_it(prior):
    atypical = {f"atypical {seed}": records(seed, law=ATYPICAL)[:2] for seed in (90, 91)}
    found = FleetPrior().fit(FLEET | atypical)
    follows = found.bridges_["pooling_probability"].unstack()
    assert (follows.loc[list(atypical)] < 0.1).all(axis=None)
    assert (follows.loc[list(FLEET)] > 0.5).all(axis=None)
    T, F, _ = records(50, 30)
    assert error(found.mapper().fit(T, F), 50) < 1.3 * error(prior.mapper().fit(T, F), 50)


def test_unrelated_bridges_are_not_pooled():
    random = np.random.default_rng(0)
    laws = [LAW * random.normal(0, 1.5, LAW.shape) for _ in range(4)]
    found = FleetPrior().fit([records(seed, law=law)[:2] for seed, law in enumerate(laws)])
    assert not found.comparison_["is_pooled"].any()
    assert "not significant" in found.summary()
    mapper = found.mapper().fit(*records(50, 40)[:2])
    assert set(mapper.pooling_probability_.values()) == {0.0}


def test_two_bridges_are_never_enough():
    found = FleetPrior().fit([records(seed)[:2] for seed in range(2)])
    assert not found.comparison_["is_pooled"].any()
    assert "expected at least 3" in found.summary()


def test_families_join_names_and_none_is_never_pooled():
    other = {"f2": "a", "f1": None}
    found = FleetPrior(families={"f1": "a", "f2": "b", "bridge 3": other}).fit(dict(list(FLEET.items())[:6]))
    assert found.comparison_["n_bridges"].to_dict() == {"a": 6, "b": 5}
    mapper = found.mapper(families={"f1": "a", "f2": None}).fit(*records(50, 40)[:2])
    assert mapper.families_ == {"f1": "a", "f2": None}
    assert mapper.pooling_probability_[None] == 0.0


def test_a_covariate_predicts_what_it_moves():
    spans = np.linspace(20, 60, 12)
    laws = [LAW * span / 40 for span in spans]
    bridges = {i: records(i, law=law)[:2] for i, law in enumerate(laws)}
    table = pd.DataFrame({"span": spans, "material": ["steel", "concrete"] * 6}, index=range(12))
    found = FleetPrior().fit(bridges, table)
    T, F, _ = records(50, 5, law=LAW * 1.5)
    with_span, without = found.mapper({"span": 60.0}).fit(T, F), found.mapper().fit(T, F)
    assert error(with_span, 50, law=LAW * 1.5) < 0.7 * error(without, 50, law=LAW * 1.5)
    stds = [mapper.predict(later(50)[0], return_std=True)[1].mean() for mapper in (with_span, without)]
    assert (stds[0] < stds[1]).all()
    with pytest.raises(ValueError, match=r"'material' is 'wood'; expected one of \['concrete', 'steel'\]"):
        found.mapper({"material": "wood"}).fit(T, F)


def test_rows_of_weight_zero_count_as_left_out(prior):
    T, F, _ = records(50, 60)
    weights = np.repeat([1.0, 0.0], 30)
    spoiled = F.copy()
    spoiled.iloc[30:] *= 2
    assert_allclose(
        prior.mapper().fit(T, spoiled, sample_weight=weights).predict(T), prior.mapper().fit(T[:30], F[:30]).predict(T)
    )


def test_wrong_records_hardly_move_a_new_bridge(prior):
    clean, spoiled = [], []
    for seed in range(100, 106):
        T, F, _ = records(seed, 100)
        wrong = F.copy()
        wrong.iloc[37] *= 1.05
        clean.append(error(prior.mapper().fit(T, F), seed))
        spoiled.append(error(prior.mapper().fit(T, wrong), seed))
    assert np.mean(spoiled) < 1.1 * np.mean(clean)


def test_gaps_are_used_for_what_they_have(prior):
    T, F, _ = records(50, 60)
    gappy = F.copy()
    gappy.iloc[::2, 0] = np.nan
    gappy.iloc[1::2, 1] = np.nan
    mapper = prior.mapper().fit(T, gappy)
    assert error(mapper, 50) < 2 * error(prior.mapper().fit(T, F), 50)
    T.iloc[3, 0] = np.nan
    predicted = mapper.predict(T)
    assert predicted.isna().all(axis=1).tolist() == [row == 3 for row in range(60)]
    assert np.isnan(mapper.predict_covariance(T)[3]).all()


def test_uncertainty_grows_with_what_has_not_been_seen(prior):
    T, F, _ = records(50, 30)
    mapper = prior.mapper().fit(T, F)
    weather = pd.DataFrame({"T1": [0.0, 20.0, 60.0, 120.0], "T2": [0.0, 20.0, 60.0, 120.0]})
    std = mapper.predict(weather, return_std=True)[1].to_numpy()
    assert (np.diff(std, axis=0) > 0).all()
    assert mapper.from_fleet(weather).tolist() == [False, True, False, False]
    assert_allclose(np.einsum("tii->ti", mapper.predict_covariance(weather)), std**2)
    assert (mapper.reach_.highest >= mapper.own_range_.highest).all()


def test_effects_are_changes_of_the_logarithm(prior):
    T, F, _ = records(50, 60)
    mapper = prior.mapper().fit(T, F)
    effects = prior.effects([-10.0, 5.0, 25.0], "f2", mapper=mapper, reference=5.0)
    predicted = mapper.predict(pd.DataFrame({"T1": effects.index, "T2": effects.index}))["f2"]
    assert_allclose(effects["mean"], np.log(predicted / predicted[1]), atol=1e-12)
    assert effects["standard_deviation"].iloc[1] < 1e-12 < effects["standard_deviation"].iloc[0]
    fleet = prior.effects([-10.0, 5.0, 25.0], "f2", reference=5.0)
    assert fleet[list(FLEET)].equals(effects[list(FLEET)])
    assert list(fleet) == ["mean", "standard_deviation", *FLEET]
    assert (np.abs(fleet[list(FLEET)].sub(fleet["mean"], axis=0)).mean(axis=1) <= fleet["standard_deviation"]).all()


def test_a_mapper_is_cloned_searched_and_saved(prior):
    T, F, _ = records(50, 60)
    mapper = prior.mapper()
    twin = clone(make_pipeline(LagFeatures([0]), mapper))[-1]
    assert twin.prior is prior
    fitted = twin.fit(T.to_numpy(), F.to_numpy())
    again = pickle.loads(pickle.dumps(fitted))
    assert_allclose(again.predict(T.to_numpy()), mapper.fit(T, F).predict(T).to_numpy())
    assert len(pickle.dumps(prior)) < 100_000
    search = GridSearchCV(FleetMapper(), {"prior": [None, prior]}, cv=3).fit(T, F)
    assert search.best_params_["prior"] is prior


def test_a_vector_with_a_name_belongs_to_its_family(prior):
    T, F, _ = records(50, 20)
    mapper = prior.mapper().fit(T, F["f2"])
    assert mapper.families_ == {"f2": "f2"}
    assert mapper.predict(T).shape == (20,)
    assert mapper.predict_covariance(T).shape == (20, 1, 1)


@pytest.mark.parametrize(
    ("bridges", "message"),
    [
        ({}, "no bridges"),
        (3, "expected a mapping"),
        ({"a": 3}, "bridge 'a': it is 3"),
        (
            {"a": FLEET["bridge 0"], "b": (np.arange(9.0)[:, np.newaxis], np.ones((9, 2)))},
            "has 2 inputs and bridge 'b' 1",
        ),
        ({"a": (np.arange(9.0), -np.ones(9))}, "bridge 'a': quantity 'f1' falls to -1"),
        ({"a": (np.arange(9.0), np.full(9, np.nan))}, "bridge 'a': a column has no value: 'f1' is NaN in all 9 rows"),
    ],
)
def test_what_is_no_fleet_is_refused(bridges, message):
    with pytest.raises(ValueError, match=message):
        FleetPrior().fit(bridges)


def test_impossible_weather_is_warned_of_once_also_within_a_compensator(prior):
    T, F, _ = records(50, 60)
    kelvin = T.assign(**{T.columns[0]: T.iloc[:, 0] + 273.15})
    mapper = prior.mapper().fit(T, F)
    with pytest.warns(RecordsWarning, match="'T1'.*implausible-temperatures"):
        mapper.predict(kelvin)
    held = TemperatureCompensator(prior.mapper(), targets=list(F.columns), cv="contiguous").fit(T.join(F))
    with pytest.warns(WeatherWarning, match="'T1'.*Give degrees Celsius") as warned:
        held.transform(kelvin.join(F))
    assert len(warned) == 1


def test_inputs_have_the_names_of_the_fleet(prior):
    T, F, _ = records(50, 20)
    with pytest.raises(ValueError, match=r"X has the inputs \['a', 'b'\]; expected those of the fleet"):
        prior.mapper().fit(T.set_axis(["a", "b"], axis=1), F)
    with pytest.raises(ValueError, match="y has 1 columns without names"):
        prior.mapper().fit(T, F["f1"].to_numpy())


def test_a_quantity_without_any_value_is_refused(prior):
    T, F, _ = records(50, 20)
    with pytest.raises(ValueError, match="quantity 'f2' is NaN in all 20 rows that can be used; expected values"):
        prior.mapper().fit(T, F.assign(f2=np.nan))


def signed(seed, days=365):
    """Temperatures and a displacement in mm about 0, with the law of its family and scatter of its own."""
    random = np.random.default_rng(seed)
    stamps = pd.date_range("2025-01-01", periods=days)
    warm = 10 - 12 * np.cos(2 * np.pi * np.arange(days) / 365) + random.normal(0, 3, days)
    d = random.normal(0, 3) + random.normal(0.4, 0.03) * (warm - 10) + random.normal(0, 0.5, days)
    f = 3 * np.exp(random.normal(-0.001, 1e-4) * warm + random.normal(0, 0.002, days))
    return pd.DataFrame({"T": warm}, stamps), pd.DataFrame({"d": d, "f1": f}, stamps)


def test_quantities_of_any_sign_have_a_linear_link_whatever_their_unit():
    with pytest.raises(ValueError, match="link='linear'"):
        FleetPrior().fit({seed: signed(seed) for seed in range(3)})
    winter, warm = signed(20, 40), pd.DataFrame({"T": [10.0, 30.0]})
    predicted, errors = [], []
    for unit in (1.0, 1e-3):
        bridges = {seed: signed(seed) for seed in range(8)}
        bridges = {seed: (T, Y.assign(d=unit * Y["d"])) for seed, (T, Y) in bridges.items()}
        fleet = FleetPrior(link={"d": "linear"}).fit(bridges)
        assert fleet.comparison_.loc["d", "is_pooled"]
        T, Y = winter
        mapper = fleet.mapper().fit(T, Y.assign(d=unit * Y["d"]))
        mean, std = (table.to_numpy() / [unit, 1] for table in mapper.predict(warm, return_std=True))
        change = (fleet.effects([10.0, 30.0], "d", reference=10.0)["mean"] / unit).to_numpy()
        predicted.append(np.concatenate([mean, std, change[:, np.newaxis] * [1, 1]]))
        errors.append(abs(mean[1, 0] - mean[0, 0] - 0.4 * 20))
    assert_allclose(predicted[0], predicted[1], rtol=1e-6, atol=1e-9)
    assert errors[0] < 2.0
    assert predicted[0][-1, 0] == pytest.approx(0.4 * 20, rel=0.1)
