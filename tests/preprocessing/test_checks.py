"""Faults of records are named, and healthy records have none."""

import re

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_kw51_campaign, make_truss_campaign
from skthermo.preprocessing import LagFeatures, check_records
from skthermo.preprocessing.checks import set_aside

YEAR = make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies


def hourly(n_days=60):
    """A slow temperature by the hour, as smooth as soil."""
    random = np.random.default_rng(0)
    hours = np.arange(24 * n_days)
    return 10 + 3 * np.sin(2 * np.pi * hours / 24) + 0.05 * np.cumsum(random.standard_normal(len(hours)))


def stuck_runs(column):
    """First and last row of each run of a thermometer's column that counts as stuck."""
    frequencies = 4 + 0.01 * np.random.default_rng(0).standard_normal((len(column), 2))
    table = check_records(np.reshape(column, (-1, 1)), frequencies).table
    return table.loc[table["what"] == "stuck", ["from", "to"]].to_numpy().tolist()


def one(findings):
    """The only finding."""
    assert len(findings.table) == 1, findings
    return findings.table.iloc[0]


def exchanged(rows):
    values = F.to_numpy().copy()
    values[np.ix_(rows, [2, 3])] = values[np.ix_(rows, [3, 2])]
    return F.copy().assign(f3=values[:, 2], f4=values[:, 3])


class TestHealthyRecords:
    @pytest.mark.nightly
    @pytest.mark.parametrize("seed", range(4))
    def test_they_have_no_finding(self, seed):
        random, year = np.random.default_rng(seed), make_truss_campaign(random_state=seed)
        temperatures, frequencies = year.temperatures, year.frequencies
        gaps = temperatures.mask(random.random(T.shape) < 0.1), frequencies.mask(random.random(F.shape) < 0.1)
        for tables in ((temperatures, frequencies), gaps, (temperatures.round(0), frequencies.round(1))):
            assert check_records(*tables).table.empty

    @pytest.mark.nightly
    def test_neither_has_a_bridge_by_the_hour_but_for_its_heavy_tails(self):
        campaign = make_kw51_campaign(retrofit=False, random_state=0)
        table = check_records(campaign.temperatures, campaign.frequencies).table
        assert set(table["what"]) <= {"doubtful-values"}
        assert table["n_rows"].sum() <= 3

    def test_few_records_say_nothing_but_that(self):
        found = one(check_records(T[:20].sample(frac=1, random_state=0).set_axis(T.index[:20]), F[:20]))
        assert (found["what"], found["n_rows"]) == ("few-records", 20)


class TestStuck:
    def test_a_thermometer_at_20_degrees_in_december(self):
        stuck = T.copy()
        stuck.loc["2025-12", "T2"] = 20.0
        found = one(check_records(stuck, F))
        assert (found["what"], found["column"], found["n_rows"]) == ("stuck", "T2", 31)
        assert (found["from"], found["to"]) == (pd.Timestamp("2025-12-01"), pd.Timestamp("2025-12-31"))

    def test_a_mode_over_gaps_in_an_array(self):
        stuck = F.to_numpy().copy()
        stuck[100:130, 4] = stuck[100, 4]
        stuck[110:115, 4] = np.nan
        found = one(check_records(T.to_numpy(), stuck))
        assert tuple(found[["what", "column", "n_rows", "from", "to"]]) == ("stuck", "f5", 25, 100, 129)

    @pytest.mark.parametrize("digits", [None, 0])
    def test_rounding_of_slow_temperatures_is_not_stuck(self, digits):
        column = hourly() if digits is None else hourly().round(digits)
        assert stuck_runs(column) == []
        column[500:1000] = column[500]
        ((first, last),) = stuck_runs(column)
        assert first <= 500
        assert last >= 999

    def test_values_that_are_repeated_and_those_at_which_a_sensor_rests_again_and_again_are_not_stuck(self):
        assert stuck_runs(np.repeat(hourly(), 6)) == []
        sun = np.maximum(np.sin(2 * np.pi * np.arange(24 * 100) / 24), 0.0) * np.random.default_rng(0).random(2400)
        assert stuck_runs(sun) == []

    @pytest.mark.parametrize("first", [0, 100])
    def test_values_of_any_stuck_column_are_set_aside_from_the_first_record_on_too(self, first):
        rows = slice(first, first + 40)
        warm, stiff = T.copy(), F.copy()
        warm.iloc[rows, 1], stiff.iloc[rows, 2] = 20.0, F.iloc[first, 2]
        with pytest.warns(UserWarning, match="'T2' is 20 °C in 40 of .*; 'f3' is .* Hz in 40 of "):
            found, _ = set_aside(warm, stiff)
        assert found.table["what"].tolist() == ["stuck", "stuck"]
        assert found.temperatures.isna().to_numpy().sum() == found.frequencies.isna().to_numpy().sum() == 40
        assert check_records(warm, stiff).table["what"].tolist() == ["stuck", "stuck"]

    @pytest.mark.parametrize("kind", [pd.DataFrame, np.asarray])
    def test_lags_of_a_sensor_are_no_sensors_and_not_named_again(self, kind):
        lagged = LagFeatures([0, 24]).fit_transform(T)
        assert check_records(kind(lagged), kind(F)).table.empty
        wrong = T.copy()
        wrong.loc["2025-12", "T1"], wrong.iloc[[4, 9], 1] = 20.0, -999.0
        found = check_records(LagFeatures([0, 2]).fit_transform(wrong), F).table
        assert sorted(found["column"]) == ["T1_lag0", "T1_lag2", "T2_lag0"]


class TestTime:
    @pytest.mark.parametrize("shift", [60, -60])
    def test_a_shift_is_found_with_its_size_and_direction(self, shift):
        found = one(check_records(T, F.shift(shift)))
        assert found["what"] == "different-rows"
        direction = "before" if shift > 0 else "after"
        assert f"temperatures of 60 rows {direction} (about 60 days)" in found["detail"]
        array = one(check_records(T.to_numpy(), F.shift(shift).to_numpy()))
        assert array["detail"] == found["detail"].replace(" (about 60 days)", "")

    @pytest.mark.parametrize("shift", [60, -160])
    def test_a_shift_of_days_is_found_in_three_hourly_records_that_season_and_day_rule(self, shift):
        random = np.random.default_rng(0)
        hours, index = 3 * np.arange(2920), pd.date_range("2025-01-01", periods=2920, freq="3h")
        fronts = 6 * pd.Series(random.standard_normal(2920)).ewm(halflife=12).mean().to_numpy()
        cycles = 4 * np.sin(2 * np.pi * hours / 24) - 11 * np.cos(2 * np.pi * hours / 8760)
        air = 10 + fronts + cycles
        deck = pd.Series(air).ewm(halflife=2).mean().to_numpy()
        modes = 4 - np.outer(deck, [0.005, 0.01]) + 0.015 * random.standard_normal((2920, 2))
        late = np.roll(np.column_stack([air, deck]), shift, axis=0)
        tables = [pd.DataFrame(table, index).iloc[abs(shift) : -abs(shift)] for table in (late, modes)]
        found = one(check_records(*tables))
        assert found["what"] == "different-rows"
        rows, direction = re.search(r"temperatures of (\d+) rows (\w+)", found["detail"]).groups()
        assert abs(int(rows) - abs(shift)) <= 1  # the deck follows the air within a row
        assert direction == ("after" if shift > 0 else "before")

    @pytest.mark.parametrize("lag", [2, 12])
    def test_inertia_is_no_shift(self, lag):
        random = np.random.default_rng(0)
        air = hourly() + 2 * random.standard_normal(24 * 60)  # as rough as weather that no mean of the past replaces
        frequency = np.roll(4 - 0.02 * air, lag) + 0.01 * random.standard_normal(len(air))
        index = pd.date_range("2025-01-01", periods=len(air), freq="h")
        tables = pd.DataFrame({"air": air}, index)[lag:], pd.DataFrame({"f": frequency}, index)[lag:]
        assert check_records(*tables).table.empty

    def test_lags_are_no_shift_and_hide_none(self):
        random = np.random.default_rng(0)
        air = 10 + 12 * np.sin(np.arange(60) / 12) + random.standard_normal(60)
        index = pd.date_range("2025-01-01", periods=60)
        lagged = LagFeatures([0, 3, 24]).fit_transform(pd.DataFrame({"air": air}, index))
        frequencies = np.array([3.0, 5.0, 7.0]) * (1 - 0.002 * air[:, np.newaxis])
        noisy = pd.DataFrame(frequencies * (1 + 0.005 * random.standard_normal((60, 3))), index)
        assert check_records(lagged, noisy).table.empty
        assert one(check_records(lagged, noisy.shift(-10)))["what"] == "different-rows"

    def test_shuffled_temperatures_explain_nothing(self):
        found = one(check_records(T.sample(frac=1, random_state=0).set_axis(T.index), F))
        assert (found["what"], found["n_rows"]) == ("different-rows", 365)

    def test_a_retrofit_is_not_taken_for_temperatures_of_other_days(self):
        random, day = np.random.default_rng(0), np.arange(465)
        air = 11 - 9 * np.cos(2 * np.pi * day / 365) + 2 * random.standard_normal(465)
        mode = 2.92 - 0.001 * air + 0.06 * (day >= 292) + 0.004 * random.standard_normal(465)
        assert check_records(air[:, np.newaxis], mode[:, np.newaxis]).table.empty


class TestExchangedModes:
    @pytest.mark.parametrize("share", [0.5, 0.02])
    def test_rows_are_found(self, share):
        rows = np.random.default_rng(0).random(len(F)) < share
        found = one(check_records(T, exchanged(rows)))
        assert (found["what"], found["column"], found["n_rows"]) == ("mode-order", "'f3' and 'f4'", rows.sum())

    def test_with_gaps_a_value_alone_is_found_too(self):
        rows, random = np.arange(len(F)) < 180, np.random.default_rng(0)
        gappy = exchanged(rows).mask(random.random(F.shape) < 0.2)
        either = gappy[["f3", "f4"]].notna().any(axis=1)
        found = check_records(T, gappy).table.iloc[0]
        assert found["what"] == "mode-order"
        assert found["n_rows"] >= 0.98 * (rows & either).sum()

    def test_modes_that_cross_with_the_weather_are_not_exchanged(self):
        random, air = np.random.default_rng(0), T["T1"].to_numpy()
        slopes = np.array([-0.01, 0.03])
        crossing = 4 + np.outer(air - np.median(air), slopes) + 0.01 * random.standard_normal((len(air), 2))
        assert (np.diff(crossing) > 0).mean() > 0.2
        assert check_records(T, pd.DataFrame(crossing, F.index, ["a", "b"])).table.empty


class TestOutliers:
    def test_values_of_other_poles_are_counted_by_mode(self):
        random = np.random.default_rng(1)
        wrong = random.random(F.shape) < 0.01
        table = check_records(T, F.where(~wrong, F * random.choice([0.8, 1.25], F.shape))).table
        assert set(table["what"]) == {"doubtful-values"}
        assert dict(zip(table["column"], table["n_rows"], strict=True)) == {
            name: count for name, count in zip(F, wrong.sum(axis=0), strict=True) if count
        }

    def test_twice_the_median_is_one_in_few_records_too(self):
        few = F[:20].copy()
        few.iloc[3, 1] *= 2.1
        found = check_records(T[:20], few).table.iloc[1]
        assert (found["what"], found["column"], found["from"]) == ("doubtful-values", "f2", F.index[3])

    def test_a_change_that_lasts_is_none(self):
        changed = F.assign(f1=F["f1"].where(np.arange(len(F)) < 300, 0.8 * F["f1"]))
        assert "doubtful-values" not in set(check_records(T, changed).table["what"])


def test_findings_do_not_depend_on_the_order_of_rows_and_columns():
    stuck = T.copy()
    stuck.loc["2025-12", "T2"] = 20.0
    order = np.random.default_rng(0).permutation(len(T))
    expected = check_records(stuck, F).table
    found = check_records(stuck.iloc[order][["T3", "T1", "T2"]], F.iloc[order]).table
    assert found["what"].tolist() == ["wrong-stamps", "stuck"]
    pd.testing.assert_frame_equal(found[1:].reset_index(drop=True), expected)


def test_each_kind_gives_one_warning_and_the_tables_stay_as_they_are():
    stuck, spoiled = T.copy(), F.copy()
    stuck.iloc[300:, [0, 1]] = 20.0
    spoiled.iloc[[50, 60], [0, 1]] *= 1.3
    before = stuck.copy(), spoiled.copy()
    findings = check_records(stuck, spoiled)
    kinds = [warning.kind for warning in findings.warnings()]
    assert kinds == ["set-aside", "doubtful-values"]
    assert len(findings.table) == sum(": " in line for line in str(findings).splitlines()) == 4
    for table, copy in zip((stuck, spoiled), before, strict=True):
        pd.testing.assert_frame_equal(table, copy)


def test_the_cleaned_tables_are_those_of_set_aside():
    stuck, spoiled = T.copy(), F.copy()
    stuck.loc["2025-12", "T2"] = 20.0
    stuck.iloc[[3, 9], 0], stuck["T3"] = -999.0, 4.0
    spoiled.iloc[7, 1] = 0.0
    found = check_records(stuck, spoiled)
    with pytest.warns(UserWarning, match="set-aside|useless-column"):
        expected, _ = set_aside(stuck, spoiled)
    assert found.temperatures["T1"].isna().sum() == 2
    assert found.left_out == expected.left_out == {"T3": found.left_out["T3"]}
    pd.testing.assert_frame_equal(found.temperatures, expected.temperatures)
    pd.testing.assert_frame_equal(found.frequencies, expected.frequencies)


def other_inputs(T):
    """Beside temperatures: a flag, radiation in W/m2, wind, vehicles a day, powers of a temperature."""
    random, n = np.random.default_rng(0), len(T)
    others = {
        "frost": (T["T1"] < 5).astype(float),
        "radiation": np.maximum(800 * np.sin(np.arange(n)), 0.0),
        "wind": random.gamma(2.0, 3.0, n),
        "vehicles": random.poisson(20_000, n).astype(float),
        "T1^3": T["T1"] ** 3,
    }
    return T.assign(**others)


def test_inputs_that_are_no_temperatures_are_no_findings_and_temperatures_among_them_are_looked_at():
    inputs = other_inputs(T)
    found = check_records(inputs, F)
    assert found.table.empty
    pd.testing.assert_frame_equal(found.temperatures, inputs)
    inputs["T1"] += 273.15
    inputs.loc[inputs.index[7], "T2"] = 400.0
    assert set(check_records(inputs, F).table["column"]) == {"T1", "T2"}
