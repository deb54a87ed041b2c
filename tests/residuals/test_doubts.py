"""What the weather and the sensors of records leave in doubt, searches of similar records, residuals in new weather."""

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.distance import cdist
from sklearn.linear_model import LinearRegression

from skthermo.detection import CompensatedDetector, TemperatureCompensator
from skthermo.residuals.gaussian import Gaussian, check_invertible
from skthermo.residuals.sensors import SensorRegression, filled_findings
from skthermo.residuals.weather import (
    Extrapolation,
    TrainingRange,
    mean_of_nearest,
    nearest_in_parts,
    one_in_each_part,
    unpredicted_findings,
    unseen_weather,
)
from tests.gappy_rows import records

RANDOM = np.random.default_rng(0)
PLACES, WANTED = RANDOM.normal(size=(60, 2)), RANDOM.normal(size=(25, 2))
AIR = pd.DataFrame({"air": np.linspace(-10.0, 30.0, 100), "deck": 5.0})


def kinds(findings):
    return [one.kind for one in findings]


def test_doubts_name_the_inputs_that_are_far_outside_the_range_and_no_others():
    reach = TrainingRange.spanned(AIR, slice(None))
    assert reach.excess([[40.0, np.nan]])[0, 0] == pytest.approx(10 / 40)
    assert reach.doubts(AIR + [9.0, 0.2]) == []
    (found,) = reach.doubts(AIR + [11.0, 0.0])
    assert (found.kind, "'air'" in str(found), "'deck'" in str(found)) == ("other-weather", True, False)
    assert "kelvin" in str(reach.doubts(AIR + 273.15)[0])


def test_a_fold_in_weather_of_its_own_is_named():
    halves, mixed = np.repeat([0, 1], 50), np.arange(100) % 2
    (found,) = unseen_weather(AIR, halves, "Errors are too large")
    assert (found.kind, "'air'" in str(found), "'deck'" in str(found)) == ("other-weather", True, False)
    assert unseen_weather(AIR, mixed, "") == []
    assert unseen_weather(AIR[40:60], np.repeat([0, 1], 50)[40:60], "") != []  # all ten records of a fold
    assert unseen_weather(AIR[42:58], np.repeat([0, 1], 50)[42:58], "") == []  # eight are too few


def test_rows_without_a_prediction_have_their_causes():
    weather = np.array([[np.nan, np.nan], [1.0, np.nan], [1.0, 2.0]])
    for unknown, parts in (([0], ["without any"]), ([1], ["with lags"]), ([0, 1], ["without any", "with lags"])):
        (found,) = unpredicted_findings(np.isin(np.arange(3), unknown), weather)
        assert found.kind == "not-evaluated"
        assert [part for part in ("without any", "with lags") if part in str(found)] == parts
    assert unpredicted_findings(np.zeros(3, dtype=bool), weather) == []


@pytest.mark.parametrize("number", [7, 100])
def test_the_nearest_places_are_those_of_sorted_distances(number):
    expected = np.argsort(cdist(WANTED, PLACES), axis=1)[:, :number]
    for n_columns in (1, 400_000):  # all rows at once, and one after the other
        found = list(nearest_in_parts(PLACES, WANTED, number, n_columns))
        np.testing.assert_array_equal(np.concatenate([near for _, near in found]), expected)
        np.testing.assert_array_equal(np.concatenate([np.arange(25)[rows] for rows, _ in found]), np.arange(25))


def test_means_of_the_nearest_places_count_those_where_a_column_is_used():
    values = RANDOM.normal(size=(60, 3))
    used = RANDOM.random((60, 3)) < [1.0, 0.6, 0.05]
    found = mean_of_nearest(PLACES, values, used, WANTED, 5)
    for column in range(3):
        own, expected = used[:, column], []
        for distances in cdist(WANTED, PLACES[own]):
            expected.append(values[own, column][np.argsort(distances)[:5]].mean())
        np.testing.assert_allclose(found[:, column], expected)
    assert np.isnan(mean_of_nearest(PLACES[:0], values[:0], used[:0], WANTED, 5)).all()


@pytest.mark.parametrize("most", [7, 100, 1000])
def test_of_many_records_one_in_each_part_is_chosen(most):
    chosen = one_in_each_part(100, most)
    assert len(chosen) == min(most, 100)
    np.testing.assert_array_equal(chosen * len(chosen) // 100, np.arange(len(chosen)))


def sensors_of(n_rows=400):
    air = RANDOM.normal(10, 8, n_rows)
    columns = {"air": air, "girder": 0.8 * air + RANDOM.normal(2, 1, n_rows), "cable": RANDOM.normal(0, 2, n_rows)}
    return pd.DataFrame(columns)


def test_errors_of_filled_values_move_predictions_by_their_deviation():
    T = sensors_of()
    sensors, gappy = SensorRegression.fitted(T), T[:30].copy()
    gappy.loc[::3, "girder"], gappy.loc[0] = np.nan, [np.nan, np.nan, 1.0]
    filled, deviations = sensors.fill(gappy)
    filled = pd.DataFrame(filled, columns=T.columns)
    slopes = np.array([[0.5, -2.0, 1.0]])
    found = sensors.variances_of_fills(gappy, filled, lambda X: np.asarray(X) @ slopes.T, lambda moved: moved)
    covariance = sensors.gaussian.covariance
    single = np.flatnonzero(gappy["girder"].isna() & gappy["air"].notna())
    np.testing.assert_allclose(found[single, 0], (2.0 * deviations[single, 1]) ** 2)
    rest = covariance[:2, :2] - np.outer(covariance[:2, 2], covariance[:2, 2]) / covariance[2, 2]
    assert found[0, 0] == pytest.approx(slopes[0, :2] @ rest @ slopes[0, :2])
    assert not found[gappy.notna().all(axis=1)].any()
    assert not sensors.variances_of_fills(T[:5], T[:5], lambda X: np.asarray(X), lambda moved: moved).any()
    (finding,) = filled_findings(deviations, T.columns, "Errors grow")
    assert (finding.kind, "'cable'" in str(finding)) == ("faulty-sensor", False)
    assert filled_findings(0 * deviations, T.columns, "") == []


def test_the_distribution_without_some_rows_is_that_of_the_others():
    rows = records(80)
    found, expected = Gaussian.fitted(rows).without(rows[:20], 80), Gaussian.fitted(rows[20:])
    np.testing.assert_allclose(found.mean, expected.mean)
    np.testing.assert_allclose(found.covariance, expected.covariance)


@pytest.mark.parametrize(
    ("change", "named"),
    [
        (lambda rows: rows * [1, 1, 0] + [0, 0, 5], "'c'] are constant"),
        (lambda rows: np.column_stack([rows[:, :2], rows[:, 0] - rows[:, 1]]), "copies or combinations"),
        (lambda rows: rows[:3], "3 baseline rows and 3 modes"),
    ],
)
def test_modes_that_leave_no_inverse_are_named(change, named):
    rows = change(records(80))
    normal = Gaussian.fitted(rows)
    with pytest.raises(ValueError, match="singular") as error:
        check_invertible(normal, len(rows), has_gaps=False, names=list("abc"))
    assert named in str(error.value)


WEATHER = np.linspace(-10.0, 30.0, 500)[:, np.newaxis]


def learned(residuals_of):
    return Extrapolation.learned(TrainingRange.spanned(WEATHER, slice(None)), WEATHER, residuals_of)


@pytest.mark.parametrize("growth", [0.0, 4.0, 400.0])
def test_the_growth_of_residuals_at_each_end_is_learned(growth):
    def residuals_of(others, fifth):
        beyond = np.minimum(
            np.abs(WEATHER[fifth] - WEATHER[others].min()), np.abs(WEATHER[fifth] - WEATHER[others].max())
        )
        share = beyond / np.ptp(WEATHER[others])
        is_cold = WEATHER[fifth].mean() < 10
        return np.sqrt(1 + (growth if is_cold else 0.0) * np.log1p(share**2)) * np.ones((len(fifth), 3))

    weight = 0.1  # of the usual growth
    cold, warm = learned(residuals_of).growth
    own = (np.log1p((0.2 / 0.8 * np.linspace(0, 1, 100)) ** 2) ** 2).sum()
    assert cold == pytest.approx((own * growth + weight * 9) / (own + weight), rel=0.05)
    assert warm == pytest.approx(weight * 9 / (own + weight), rel=0.05)


def test_variances_grow_with_the_distance_and_are_one_inside():
    found = learned(lambda others, fifth: np.ones((len(fifth), 1)))
    variances = found.variances(np.array([[np.nan], [-10.0], [10.0], [30.0], [50.0], [70.0], [-30.0]]))
    assert variances[:4] == pytest.approx(1)
    assert variances[4] == pytest.approx(1 + found.growth[1] * np.log(1.25))
    assert variances[5] > variances[4] > 1
    assert variances[6] == pytest.approx(1 + found.growth[0] * np.log(1.25))


def bent(temperature, random):
    """A frequency that stiffens in frost, where a straight line of warm records goes on."""
    return 10 - 0.01 * temperature + 0.1 * np.maximum(-temperature, 0) + random.normal(0, 0.01, len(temperature))


@pytest.mark.filterwarnings("ignore:temperatures are outside")
def test_residuals_of_new_weather_count_less_and_still_grow_with_damage():
    random = np.random.default_rng(0)
    T, colder = random.uniform(-5, 30, 400), random.uniform(-15, -5, 400)
    year, frost = (pd.DataFrame({"air": one, "f": bent(one, random)}) for one in (T, colder))
    detector = CompensatedDetector(regressor=LinearRegression(), targets=["f"], regimes=None).fit(year)
    residuals = TemperatureCompensator(LinearRegression(), targets=["f"]).fit(year).transform(frost)["f"]
    straight = LinearRegression().fit(year[["air"]], year["f"]).predict(frost[["air"]])
    plain = np.log(frost["f"] / straight)
    assert (np.abs(residuals) < np.abs(plain)).all()
    assert (np.sign(residuals) == np.sign(plain)).all()
    index = [detector.damage_index(frost.assign(f=frost["f"] * (1 - loss))) for loss in (0.1, 0.2, 0.3)]
    assert (np.diff(index, axis=0) > 0).all()
