"""A new bridge learns from the mappers of others."""

import pickle

import numpy as np
import pandas as pd
import pytest
from numpy.testing import assert_allclose
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import FleetMapper, TemperatureMapper

LAW = np.array([[-2.0, -0.5, 1.0], [-1.0, -1.5, 0.0]]) * 1e-3  # of T1, T2 and frost, for two modes
UNLIKE = np.array([[2.0, -4.0, -3.0], [3.0, 2.0, 5.0]]) * 1e-3


def records(seed, days=365, start=0, *, law=None, noise=0.002):
    """Temperatures, noisy and clean frequencies of a bridge."""
    own = np.random.default_rng(seed)
    coefficients, level = LAW * (1 + 0.1 * own.standard_normal(LAW.shape)), own.uniform(2, 6, 2)
    random, t = np.random.default_rng([seed, start]), start + np.arange(days)
    T = 10 - 12 * np.cos(2 * np.pi * t / 365)[:, np.newaxis] + random.normal(0, 3, (days, 2))
    inputs = np.column_stack([T, np.maximum(-T[:, 0], 0)])
    clean = level * np.exp(inputs @ (coefficients if law is None else law).T)
    noisy = clean * np.exp(noise * random.standard_normal(clean.shape))
    index = pd.date_range("2025-01-01", periods=days) + pd.Timedelta(days=start)
    modes = ["f1", "f2"]
    return pd.DataFrame(T, index, ["T1", "T2"]), pd.DataFrame(noisy, index, modes), pd.DataFrame(clean, index, modes)


MAPPERS = {f"bridge {seed}": TemperatureMapper().fit(*records(seed)[:2]) for seed in range(8)}


def error(mapper, seed, **options):
    """Mean error of the clean frequencies of a whole later year."""
    T, _, clean = records(seed, 365, 365, **options)
    return float(np.abs(mapper.predict(T) / clean - 1).to_numpy().mean())


@pytest.mark.nightly
def test_few_records_and_the_fleet_are_better_than_either():
    errors = {"fleet": [], "alone": [], "both": []}
    for seed in range(20, 25):
        T, F, _ = records(seed, 30)
        errors["both"].append(error(FleetMapper(MAPPERS).fit(T, F), seed))
        errors["alone"].append(error(TemperatureMapper().fit(T, F), seed))
        errors["fleet"].append(error(FleetMapper(MAPPERS).fit(T[:2], F[:2]), seed))
    both, alone, fleet = (np.mean(errors[name]) for name in ("both", "alone", "fleet"))
    assert both < 0.7 * fleet
    assert both < 0.6 * alone


def test_many_records_decide():
    T, F, _ = records(70, 365, noise=1e-5)
    assert error(FleetMapper(MAPPERS).fit(T, F), 70, noise=1e-5) < 1e-4


def test_a_bridge_unlike_the_others_loses_little():
    ratios = []
    for seed in range(80, 84):
        T, F, _ = records(seed, 60, law=UNLIKE)
        alone = error(TemperatureMapper().fit(T, F), seed, law=UNLIKE)
        ratios.append(error(FleetMapper(MAPPERS).fit(T, F), seed, law=UNLIKE) / alone)
    assert np.mean(ratios) < 1.1


@pytest.mark.nightly
def test_standard_deviations_are_no_smaller_than_errors():
    inside = []
    for seed in range(30, 45):
        T, F, _ = records(seed, 30)
        later, _, clean = records(seed, 365, 365)
        predicted, std = FleetMapper(MAPPERS).fit(T, F).predict(later[::7], return_std=True)
        inside.append(np.abs(predicted - clean[::7]) < 1.645 * std)
    assert np.mean(inside) >= 0.9


def test_standard_deviations_grow_with_the_distance_from_the_records():
    T, F, _ = records(50, 30)
    weather = pd.DataFrame({"T1": [0.0, 20.0, 60.0, 120.0], "T2": [0.0, 20.0, 60.0, 120.0]})
    std = FleetMapper(MAPPERS).fit(T, F).predict(weather, return_std=True)[1].to_numpy()
    assert (np.diff(std, axis=0) > 0).all()


def test_units_names_and_order_of_bridges_change_nothing():
    T, F, _ = records(50, 40)
    expected = FleetMapper(MAPPERS).fit(T, F).predict(T, return_std=True)
    assert_allclose(FleetMapper(MAPPERS).fit(T, 60 * F).predict(T, return_std=True), 60 * np.array(expected))
    assert_allclose(FleetMapper(list(MAPPERS.values())[::-1]).fit(T, F).predict(T), expected[0])


def test_outputs_are_matched_by_name():
    T, F, _ = records(50, 40)
    both = FleetMapper(MAPPERS).fit(T, F).predict(T)
    assert_allclose(FleetMapper(MAPPERS).fit(T, F[["f2", "f1"]]).predict(T)[["f1", "f2"]], both)
    one = FleetMapper(MAPPERS).fit(T, F["f2"])
    assert one.parameter_names_ == ["f2"]
    assert_allclose(one.predict(T), both["f2"])
    first = {name: TemperatureMapper().fit(*records(seed)[:2]) for seed, name in enumerate("ab")}
    second = TemperatureMapper().fit(records(2)[0], records(2)[1][["f1"]])
    only_two = FleetMapper(first).fit(T, F).predict(T)
    assert_allclose(FleetMapper(first | {"c": second}).fit(T, F).predict(T)["f2"], only_two["f2"], rtol=1e-4)


def test_gaps_are_left_out_output_by_output():
    T, F, _ = records(50, 60)
    gappy = F.copy()
    gappy.iloc[::2, 0] = np.nan
    mapper = FleetMapper(MAPPERS).fit(T, gappy)
    assert_allclose(mapper.predict(T)["f2"], FleetMapper(MAPPERS).fit(T, F).predict(T)["f2"])
    T.iloc[3, 0] = np.nan
    assert mapper.predict(T).isna().all(axis=1).tolist() == [row == 3 for row in range(60)]


def test_a_mapper_is_cloned_and_saved_with_those_of_the_other_bridges():
    T, F, _ = records(50, 60)
    expected = FleetMapper(MAPPERS).fit(T, F).predict(T).to_numpy()
    twin = clone(make_pipeline(LagFeatures([0]), FleetMapper(MAPPERS)))[-1].fit(T, F)
    again = pickle.loads(pickle.dumps(twin))
    assert_allclose(again.predict(T), expected)
    assert_allclose(FleetMapper(MAPPERS).fit(T.to_numpy(), F.to_numpy()).predict(T.to_numpy()), expected, rtol=1e-4)


def signed(seed, days=365):
    """Temperatures, a displacement in mm about 0 and a frequency, with the laws of their family."""
    random = np.random.default_rng(seed)
    stamps = pd.date_range("2025-01-01", periods=days)
    warm = 10 - 12 * np.cos(2 * np.pi * np.arange(days) / 365) + random.normal(0, 3, days)
    d = random.normal(0, 3) + random.normal(0.4, 0.03) * (warm - 10) + random.normal(0, 0.5, days)
    f = 3 * np.exp(random.normal(-0.001, 1e-4) * warm + random.normal(0, 0.002, days))
    return pd.DataFrame({"T": warm}, stamps), pd.DataFrame({"d": d, "f1": f}, stamps)


@pytest.mark.nightly
def test_responses_of_any_sign_are_learned_in_any_unit():
    (T, Y), warm = signed(20, 40), pd.DataFrame({"T": [10.0, 30.0]})
    predicted = []
    for unit in (1.0, 1e-3):
        mappers = [TemperatureMapper().fit(X, y * [unit, 1]) for X, y in map(signed, range(8))]
        mapper = FleetMapper(mappers).fit(T, Y * [unit, 1])
        predicted.append(np.hstack([table / [unit, 1] for table in mapper.predict(warm, return_std=True)]))
    assert_allclose(predicted[0], predicted[1], rtol=1e-6)
    assert np.diff(predicted[0][:, 0])[0] == pytest.approx(0.4 * 20, abs=2.0)


@pytest.mark.parametrize(
    ("mappers", "change", "message"),
    [
        ([Ridge()], lambda T, F: (T, F), "expected fitted TemperatureMappers"),
        ([TemperatureMapper()], lambda T, F: (T, F), "not fitted"),
        (MAPPERS, lambda T, F: (T[["T1"]], F), "X has 1 inputs, and a mapper 2"),
        (MAPPERS, lambda T, F: (T, F.rename(columns={"f2": "f3"})), "no mapper has the outputs"),
        (MAPPERS, lambda T, F: (T, np.hstack([F, F])), "y has 4 outputs without names"),
        (MAPPERS, lambda T, F: (T, F.assign(f2=np.nan)), "expected 2 or more"),
    ],
)
def test_what_does_not_fit_the_fleet_is_refused(mappers, change, message):
    with pytest.raises(ValueError, match=message):
        FleetMapper(mappers).fit(*change(*records(50, 20)[:2]))
