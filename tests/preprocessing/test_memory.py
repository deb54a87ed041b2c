"""Memory of the weather: found where there is some, of the right length, and not where there is none."""

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import ExponentialMeans, check_records, find_memory


def bridge(seed, days, constant=None, step=0.0, trend=0.0):
    """Six-hourly weather, and two modes of a concrete girder on soil that follows the air with a time constant."""
    random = np.random.default_rng(seed)
    index = pd.date_range("2023-01-01", periods=(days + 300) * 4, freq="6h")
    day = np.arange(len(index)) / 4
    weather = pd.Series(random.normal(0, 1, len(index))).ewm(alpha=0.08).mean() * 18
    air = pd.DataFrame({"air": 10 - 10 * np.cos(2 * np.pi * day / 365.25) + weather.to_numpy()}, index)
    slow = ExponentialMeans([constant]).fit_transform(air).iloc[:, 1] if constant else 0 * air["air"]
    relative = -np.outer(air["air"], [1e-3, 5e-4]) - np.outer(slow, [1e-3, 2e-3])
    relative += 2e-3 * random.standard_normal(relative.shape)
    place = (day - 300) / days
    relative += step * (place > 0.5)[:, np.newaxis] + trend * np.clip(place, 0, None)[:, np.newaxis]
    F = pd.DataFrame([4.0, 6.0] * np.exp(relative), index, ["f1", "f2"])
    wrong = random.random(F.shape) < 0.005
    F = F.mask(random.random(F.shape) < 0.1).mask(wrong, F * 1.2)
    return air[-days * 4 :], F[-days * 4 :]


def days_of(features):
    return [pd.Timedelta(one) / pd.Timedelta("1D") for one in features.time_constants] if features else []


@pytest.mark.parametrize("constant", ["10D", "40D"])
@pytest.mark.parametrize("days", [400, 730])
def test_the_time_constant_is_found(constant, days):
    found = find_memory(*bridge(0, days, constant))
    wanted = pd.Timedelta(constant).days
    assert min(abs(np.log(one / wanted)) for one in days_of(found.features)) <= np.log(2) + 1e-9
    assert found.fall > 0.2
    chosen = found.table[found.table["chosen"]]
    assert (chosen["error_with"] < chosen["error_without"]).all()
    assert set(chosen["mode"]) == {"f1", "f2"}
    assert "'air'" in found.summary()


@pytest.mark.parametrize("days", [90, 180, 400])
@pytest.mark.parametrize("change", [{}, {"step": -0.02}, {"trend": -0.02}])
def test_none_is_found_where_there_is_none(days, change):
    """A step or a trend is no memory."""
    found = find_memory(*bridge(1, days, **change))
    assert found.features is None
    assert found.summary()


def test_a_mode_of_few_values_does_not_hide_the_memory_of_others():
    T, F = bridge(0, 400, "40D")
    expected = find_memory(T, F)
    assert expected.features is not None
    scarce = pd.Series(np.random.default_rng(0).normal(7, 0.1, len(F)), F.index)
    found = find_memory(T, F.assign(f9=scarce.where(np.arange(len(F)) % 20 == 0)))
    assert found.features.get_params() == expected.features.get_params()
    assert found.fall == pytest.approx(expected.fall)
    assert found.table.loc[found.table["mode"] == "f9", "fall"].isna().all()


def test_the_truss_has_none():
    year = make_truss_campaign(random_state=0)
    assert find_memory(year.temperatures, year.frequencies).features is None


def test_rows_may_come_in_any_order():
    T, F = bridge(2, 400, "40D")
    order = np.random.default_rng(0).permutation(len(T))
    pd.testing.assert_frame_equal(find_memory(T, F).table, find_memory(T.iloc[order], F.iloc[order]).table)


def test_records_without_stamps_or_too_few_have_none():
    T, F = bridge(3, 400, "40D")
    assert find_memory(T.to_numpy(), F.to_numpy()).features is None
    assert find_memory(T[:50], F[:50]).features is None


def test_the_mean_halves_the_error_of_a_later_year():
    from skthermo.surrogate import TemperatureMapper

    T, F = bridge(4, 800, "40D")
    first, later = slice(None, 1700), slice(1700, None)
    F = F.ffill()
    features = find_memory(T[first], F[first]).features.fit(T[first])

    def error(inputs):
        return np.abs(TemperatureMapper().fit(inputs[first], F[first]).predict(inputs[later]) / F[later] - 1).median()

    assert (error(features.transform(T)) < 0.8 * error(T)).all()


def test_slow_memory_is_no_fault_of_records():
    findings = check_records(*bridge(5, 730, "40D")).table
    assert set(findings["what"]) <= {"frequency-outliers"}
