"""Means of earlier temperatures that a mapper chooses: where responses remember the weather, and nowhere else."""

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import TemperatureCompensator
from skthermo.preprocessing import BlockedKFold, ExponentialMeans, LagFeatures
from skthermo.surrogate import DataInformedFEM, TemperatureMapper
from tests.surrogate.chains import TRUSS


def bridge(seed, days, half_life=None, step=0.0, trend=0.0):
    """Six-hourly weather, and two modes of a concrete girder on soil that follows the air with a half-life.

    The second mode follows the soil four times as much as the first.
    """
    random = np.random.default_rng(seed)
    index = pd.date_range("2023-01-01", periods=(days + 300) * 4, freq="6h")
    day = np.arange(len(index)) / 4
    weather = pd.Series(random.normal(0, 1, len(index))).ewm(alpha=0.08).mean() * 18
    air = pd.DataFrame({"air": 10 - 10 * np.cos(2 * np.pi * day / 365.25) + weather.to_numpy()}, index)
    soil = 0.0 * air["air"]
    if half_life:
        soil = air["air"].ewm(halflife=pd.Timedelta(half_life), times=index).mean()
    relative = -np.outer(air["air"], [1e-3, 5e-4]) - np.outer(soil, [5e-4, 2e-3])
    noise = 2e-3 * random.standard_normal(relative.shape)
    place = (day - 300) / days
    relative += step * (place > 0.5)[:, np.newaxis] + trend * np.clip(place, 0, None)[:, np.newaxis]
    F, clean = (pd.DataFrame([4.0, 6.0] * np.exp(one), index, ["f1", "f2"]) for one in (relative + noise, relative))
    return air[-days * 4 :], F[-days * 4 :], clean[-days * 4 :]


def spoiled(F, seed=0):
    """With a tenth of the values missing, and some far off."""
    random = np.random.default_rng(seed)
    return F.mask(random.random(F.shape) < 0.1).mask(random.random(F.shape) < 0.003, F * 1.2)


@pytest.mark.parametrize(("half_life", "days", "most"), [("1D", 365, 0.5), ("28D", 365, 0.8), ("28D", 730, 0.5)])
def test_means_lower_the_error_of_a_later_season(half_life, days, most):
    T, F, clean = bridge(0, days + 120, half_life)
    then, later = slice(None, 4 * days), slice(4 * days, None)
    fitted, without = (TemperatureMapper(means=means).fit(T[then], F[then]) for means in ("auto", None))
    assert fitted.means_.sensors == ["air"]
    assert without.means_ is None
    errors = [np.abs(one.predict(T[later]) / clean[later] - 1).mean() for one in (fitted, without)]
    assert (errors[0] < most * errors[1]).all()


@pytest.mark.parametrize("days", [180, 365, 730])
@pytest.mark.parametrize(("seed", "change"), enumerate([{}, {"step": -0.02}, {"trend": -0.02}]))
@pytest.mark.filterwarnings("ignore:.*set-aside")
def test_a_step_or_a_drift_is_no_memory(seed, days, change):
    T, F, _ = bridge(seed, days, **change)
    assert TemperatureMapper().fit(T, F).means_ is None
    assert TemperatureMapper().fit(T, spoiled(F)).means_ is None


def test_a_mode_that_remembers_is_not_hidden_by_others_that_do_not():
    T, F, _ = bridge(0, 400, "28D")
    random = np.random.default_rng(0)
    others = {f"g{n}": 5 * np.exp(-1e-3 * T["air"] + 2e-3 * random.standard_normal(len(T))) for n in range(6)}
    fitted = TemperatureMapper().fit(T, F[["f2"]].assign(**others))
    assert "30D" in fitted.means_.half_lives


def test_the_truss_and_records_without_stamps_or_of_few_seasons_have_none():
    year = make_truss_campaign(random_state=0)
    assert TemperatureMapper().fit(year.temperatures, year.frequencies).means_ is None
    T, F, _ = bridge(3, 400, "28D")
    assert TemperatureMapper().fit(T.to_numpy(), F.to_numpy()).means_ is None
    assert TemperatureMapper().fit(T[:800], F[:800]).means_ is None


def test_rows_may_come_in_any_order_and_means_may_be_given():
    T, F, _ = bridge(2, 400, "28D")
    order = np.random.default_rng(0).permutation(len(T))
    first, second = TemperatureMapper().fit(T, F), TemperatureMapper().fit(T.iloc[order], F.iloc[order])
    np.testing.assert_allclose(second.predict(T), first.predict(T), rtol=1e-9)
    given = TemperatureMapper(means=first.means_.half_lives).fit(T, F)
    np.testing.assert_allclose(given.predict(T), first.predict(T), rtol=1e-9)
    by_hand = make_pipeline(clone(first.means_), TemperatureMapper(means=None)).fit(T, F)
    np.testing.assert_allclose(by_hand.predict(T), first.predict(T), rtol=1e-9)
    with pytest.raises(ValueError, match="half-life is '3D', but X has no DatetimeIndex"):
        TemperatureMapper(means=["3D"]).fit(T.to_numpy(), F.to_numpy())


def test_rows_after_an_outage_have_no_prediction_until_means_know_the_weather():
    T, F, _ = bridge(2, 400, "28D")
    fitted = TemperatureMapper(means=["5D"]).fit(T[:1200], F[:1200])
    known = fitted.predict(T[1300:]).notna().all(axis=1)  # 25 days are missing
    assert not known[:30].any()
    assert known[40:].all()
    assert fitted.predict(T[1200:]).notna().all(axis=None)


@pytest.mark.filterwarnings("ignore:.*set-aside")
def test_folds_of_a_compensator_have_means_of_all_records():
    T, F, _ = bridge(5, 400, "28D")
    compensator = TemperatureCompensator(targets=["f1", "f2"], cv=BlockedKFold(5, block="7D"))
    residuals = compensator.set_output(transform="pandas").fit_transform(T.join(spoiled(F)))
    assert residuals.notna().mean().min() > 0.85
    assert 1.48 * residuals[200:].abs().median().max() < 2.6e-3  # the noise is 2e-3; means lack the weather before
    assert isinstance(compensator.estimator_[0], ExponentialMeans)
    by_lags = TemperatureCompensator(make_pipeline(LagFeatures(2), TemperatureMapper(Ridge())), targets=["f1", "f2"])
    assert by_lags.fit(T.join(F)).estimator_[-1].means_ is None  # lags are the past already


@pytest.mark.nightly
def test_a_chain_chooses_by_its_frequencies():
    stamps = pd.date_range("2023-01-01", periods=500, freq="D")
    random = np.random.default_rng(0)
    air = pd.DataFrame({"air": 10 - 10 * np.cos(2 * np.pi * np.arange(500) / 365.25)}, stamps)
    air["air"] += pd.Series(random.standard_normal(500)).ewm(alpha=0.2).mean().to_numpy() * 8
    soil = air["air"].ewm(halflife=pd.Timedelta("28D"), times=stamps).mean()
    theta = np.exp(-1e-3 * np.outer(air["air"] - 10, [1, 1, 1, 1]) - 4e-3 * np.outer(soil - 10, [1, 0, 1, 0]))
    clean = pd.DataFrame(TRUSS.frequencies(theta), stamps).add_prefix("f")
    F = clean * (1 + 2e-3 * random.standard_normal(clean.shape))
    fem = DataInformedFEM(TRUSS, random_state=0).fit(air[60:440], F[60:440])
    assert isinstance(fem.mapper_[0], ExponentialMeans)
    without = DataInformedFEM(TRUSS, mapper=TemperatureMapper(means=None), random_state=0).fit(air[60:440], F[60:440])
    errors = [np.abs(one.predict(air[440:]) / clean[440:] - 1).mean().mean() for one in (fem, without)]
    assert errors[0] < 0.6 * errors[1]
