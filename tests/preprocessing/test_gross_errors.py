"""Every gross error is named with its columns and rows, and whatever is given, nothing fails."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import check_records
from tests.nights import by_day

YEAR = make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
PLACE = ["what", "column", "n_rows", "from", "to"]
ROWS = st.lists(st.integers(0, len(T) - 1), min_size=3, max_size=40, unique=True).map(sorted)
SENSOR, MODE = st.integers(0, T.shape[1] - 1), st.integers(0, F.shape[1] - 1)
often = settings(max_examples=by_day(5, at_night=25))


def changed(table, rows, column, values):
    table = table.copy()
    table.iloc[rows, column] = values
    return table


def only(found):
    """Kind, column, number of rows, first and last of the only finding."""
    assert len(found.table) == 1, found
    return tuple(found.table.iloc[0][PLACE])


def kinds(found):
    return set(found.table["what"])


class TestValues:
    @given(rows=ROWS, column=SENSOR, value=st.sampled_from([-999.0, 9999.0, 484.667, -127.0, 1e6, 1e30]))
    @often
    def test_markers_of_thermometers_are_named_with_their_rows(self, rows, column, value):
        found = check_records(changed(T, rows, column, value), F)
        assert only(found) == ("placeholders", T.columns[column], len(rows), T.index[rows[0]], T.index[rows[-1]])

    @pytest.mark.nightly
    @given(rows=ROWS, column=MODE, value=st.sampled_from([-999.0, 9999.0, 0.0, -1.0, np.inf, 1e308]))
    @often
    def test_values_that_are_no_frequencies_are_named_with_their_rows(self, rows, column, value):
        found = check_records(T, changed(F, rows, column, value))
        assert only(found) == ("placeholders", F.columns[column], len(rows), F.index[rows[0]], F.index[rows[-1]])

    @given(columns=st.sets(SENSOR, min_size=1), share=st.floats(0.3, 0.9))
    @often
    def test_every_broken_thermometer_is_named_not_the_first_alone(self, columns, share):
        broken, rows = T.copy(), np.arange(int(share * len(T)))
        for number, column in enumerate(columns):
            broken.iloc[rows, column] = (484.667, -999.0, 1e6)[number]
        table = check_records(broken).table
        assert table["column"].tolist() == [T.columns[column] for column in sorted(columns)]
        assert set(table["what"]) == {"placeholders"}

    def test_a_broken_thermometer_is_no_shift_in_time(self):
        for broken in (484.667, np.random.default_rng(0).uniform(-300, 900, 120)):
            found = check_records(changed(T, slice(100, 220), 0, broken), F)
            assert kinds(found) <= {"placeholders", "implausible-values"}

    def test_values_that_bridges_have_are_none(self):
        fire = T.copy()
        fire.iloc[200:212, 0] = np.linspace(30, 90, 12)
        assert check_records(fire, F).table.empty
        offsets = pd.DataFrame(np.random.default_rng(0).normal(-99, 3, (365, 2)), T.index, ["u1", "u2"])
        assert check_records(None, offsets.round(0), unit="mm").table.empty

    def test_a_level_that_repeats_far_from_all_others_is_doubtful(self):
        found = check_records(changed(T, [3, 77, 200], 0, 85.0), changed(F, [5, 6, 200], 0, 25.0))
        assert [tuple(row) for row in found.table[["what", "column", "severity"]].to_numpy()] == [
            ("placeholders", "T1", "doubtful"),
            ("placeholders", "f1", "doubtful"),
        ]

    def test_a_mass_that_warms_while_records_are_left_out_is_at_no_other_level(self):
        rise = np.concatenate([np.linspace(8.0, 8.6, 70), 9.5 + 0.4 * (1 - np.exp(-np.arange(295) / 40))])
        assert check_records(T.assign(T1=rise), None).table.empty

    @pytest.mark.parametrize(
        ("tables", "column"),
        [
            ((T.assign(T2=12.5), F), "T2"),
            ((T, F.assign(f2=5.0)), "f2"),
            ((T, F.assign(f2=(F["f2"] > 27) + 27.0)), "f2"),
            ((T.assign(T2=np.nan), F), "T2"),
            ((T, F.assign(f2=np.nan)), "f2"),
            ((T.assign(T3=T["T1"]), None), "T3"),
            ((T, F.assign(f4=F["f2"])), "f4"),
        ],
    )
    def test_columns_that_say_nothing(self, tables, column):
        assert only(check_records(*tables))[:2] == ("useless-column", column)

    def test_values_far_from_others_are_named_where_no_weather_is_given(self):
        far = changed(F, [17], 2, 250.0)
        assert only(check_records(None, far))[:3] == ("another-level", "f3", 1)
        assert kinds(check_records(T, far)) == {"another-level"}


class TestUnits:
    def test_tenths_of_a_degree_and_kelvin_everywhere_in_a_sensor_and_in_some_rows(self):
        assert check_records(T + 273.15).table["column"].tolist() == list(T)
        assert kinds(check_records((10 * T).round())) == {"wrong-unit"}
        assert only(check_records(T.assign(T2=T["T2"] + 273.15)))[:3] == ("wrong-unit", "T2", 365)
        some = changed(T, slice(0, 100), 1, T.iloc[:100, 1] + 273.15)
        assert only(check_records(some))[:3] == ("wrong-unit", "T2", 100)

    @given(column=SENSOR)
    @often
    def test_one_sensor_in_another_unit_or_of_opposite_sign(self, column):
        name = T.columns[column]
        for hint, values in (("Fahrenheit", 1.8 * T[name] + 32), ("as in", 10 * T[name]), ("another sign", -T[name])):
            found = check_records(T.assign(**{name: values}))
            assert only(found)[:2] == ("wrong-unit", name)
            assert hint in found.table["detail"][0]

    @pytest.mark.one_case
    @pytest.mark.parametrize(
        "spoil",
        [
            lambda t, f: (t, f),
            lambda t, f: (changed(t, slice(330, None), 1, t.iloc[0, 1]), f),
            lambda t, f: (t, f.shift(60)),
            lambda t, f: (t, changed(f, [40, 90], 3, 1.0)),
            lambda t, f: (t.assign(T3=t["T1"]), f),
        ],
    )
    def test_findings_are_the_same_in_fahrenheit_but_for_the_unit(self, spoil):
        expected, found = (check_records(*spoil(unit, F)).table for unit in (T, 1.8 * T + 32))
        assert set(found["what"]) - set(expected["what"]) == {"wrong-unit"}
        same = found[found["what"] != "wrong-unit"].reset_index(drop=True)
        pd.testing.assert_frame_equal(same[PLACE], expected[PLACE], check_dtype=False)

    @pytest.mark.parametrize("factor", [2 * np.pi, 1e-3, 60.0])
    def test_frequencies_in_another_unit_than_the_model(self, factor):
        model = make_truss()
        assert check_records(T, F, model=model).table.empty
        assert kinds(check_records(None, factor * F, model=model)) == {"wrong-unit"}
        assert only(check_records(None, F.assign(f2=factor * F["f2"]), model=model))[:2] == ("wrong-unit", "f2")
        assert check_records(None, factor * F).table.empty

    def test_units_of_mass_and_frequencies_of_no_structure_are_doubtful(self):
        for factor, model in ((np.sqrt(1000.0), make_truss()), (np.sqrt(1e-3), make_truss()), (1000, None)):
            found = check_records(None, factor * F, model=model).table
            assert (found["what"].tolist(), found["severity"].tolist()) == (["wrong-unit"], ["doubtful"])
        assert check_records(T, 1000 * F, unit="kN").table.empty

    def test_periods_and_modes_too_few(self):
        assert kinds(check_records(None, 1 / F, model=make_truss())) == {"wrong-unit"}
        assert kinds(check_records(None, F.iloc[:, 1:], model=make_truss())) == {"mode-order"}


class TestTables:
    def test_exchanged_or_the_same(self):
        assert only(check_records(F, T))[0] == "exchanged-tables"
        assert check_records(F, F).table["column"].tolist() == list(F)
        assert kinds(check_records(T.assign(f1=F["f1"]), F)) == {"exchanged-tables"}

    @pytest.mark.parametrize(
        "stamps",
        [
            pd.DatetimeIndex([T.index[0]] * 365),
            T.index.where(np.arange(365) != 7),
            pd.to_datetime(T.index.strftime("%Y%m%d").astype(int)),
            pd.to_datetime(T.index.as_unit("s").asi8),
            T.index.strftime("%Y-%m-%d"),
            pd.Index(T.index.strftime("%Y%m%d").astype(int)),
            T.index - T.index[0],
        ],
    )
    def test_wrong_times(self, stamps):
        assert kinds(check_records(T.set_axis(stamps), F.set_axis(stamps))) == {"wrong-stamps"}

    def test_repeated_times_and_disorder(self):
        rows = [0, 0, *range(1, 365), 364]
        assert only(check_records(T.iloc[rows], F.iloc[rows])) == ("wrong-stamps", "", 2, T.index[0], T.index[-1])
        assert kinds(check_records(T[::-1], F[::-1])) == {"wrong-stamps"}
        assert check_records(T.to_period("D"), F.to_period("D")).table.empty

    def test_rows_and_names(self):
        late = T.set_axis(T.index + pd.Timedelta("1D"))
        assert only(check_records(late, F))[:3] == ("different-rows", "", 365)
        assert only(check_records(T[:-5], F))[:3] == ("different-rows", "", 5)
        assert kinds(check_records(T[:0], F[:0])) == {"few-records"}
        assert kinds(check_records(T[:1], F[:1])) == {"few-records"}
        twice = T.set_axis(["T1", "T1", "T3"], axis=1)
        assert only(check_records(twice, F))[:2] == ("no-table", "T1")
        assert kinds(check_records(twice[:0], F[:0])) >= {"no-table"}
        assert kinds(check_records(T.set_axis([1, "a", "b"], axis=1), F)) == {"no-table"}
        tuples = pd.MultiIndex.from_product([["a"], list(T)])
        named = T.set_axis(tuples, axis=1), F.set_axis([("f", n) for n in F], axis=1)
        assert kinds(check_records(*named)) == {"no-table"}

    def test_an_array_beside_a_frame_has_its_times(self):
        found = check_records(T[::-1], changed(F, [10], 0, 30.0).to_numpy()[::-1])
        assert kinds(found) == {"wrong-stamps", "another-level"}
        assert np.argwhere(found.outliers.to_numpy()).tolist() == [[354, 0]]
        assert found.table.iloc[1]["from"] == T.index[10]


ANYTHING = st.one_of(
    st.none(),
    st.text(max_size=3),
    st.binary(max_size=3),
    st.floats(),
    st.dictionaries(st.text(max_size=2), st.lists(st.floats(), max_size=3), max_size=2),
    st.lists(st.lists(st.one_of(st.floats(), st.text(max_size=2), st.none()), max_size=3), max_size=3),
    st.sampled_from([float, np.sin, {1, 2}, np.zeros((2, 3, 4)), np.array([1 + 1j]), T.astype(str), T > 0, T["T1"]]),
    st.sampled_from(
        [T.astype("category"), T.astype("Float64"), T.astype("float16"), T.astype(object), T[[]], 1e300 * T]
    ),
    st.sampled_from([T.assign(T1=T.index), T.assign(T1="a"), T.set_axis([1, "a", None], axis=1), T, F, T[:3], -T]),
)


@given(temperatures=ANYTHING, frequencies=ANYTHING)
@settings(max_examples=by_day(25, at_night=60))
@pytest.mark.filterwarnings("error")
def test_nothing_fails_whatever_is_given(temperatures, frequencies):
    found = check_records(temperatures, frequencies)
    given = [warning.kind for warning in found.warnings()]
    assert len(set(given)) == len(given)
    assert isinstance(str(found), str)
    alone = check_records(temperatures), check_records(None, frequencies)
    of_any_table = {"no-table"}  # also of exchanged or equal tables
    assert set().union(*map(kinds, alone)) & of_any_table <= kinds(found)


def test_arguments_that_are_no_tables_are_refused():
    with pytest.raises(ValueError, match="unit"):
        check_records(T, F, unit=3)
    with pytest.raises(ValueError, match="model"):
        check_records(T, F, model="truss")


class TestFindings:
    def test_one_error_lists_all_that_is_meaningless_and_nothing_that_is_doubtful(self):
        wrong = changed(T.assign(T2=T["T2"] + 273.15), [3], 0, -999.0)
        found = check_records(wrong, changed(F.assign(f3=F["f1"]), [8], 1, 0.0))
        with pytest.raises(ValueError, match="kelvin") as error:
            found.refuse_meaningless()
        assert "'T2'" in str(error.value)
        assert not any(name in str(error.value) for name in ("'T1'", "'f2'", "'f3'"))
        check_records(T, F.assign(f3=F["f1"])).refuse_meaningless()

    def test_values_that_were_put_aside_count_as_outliers(self):
        wrong = changed(F, [8, 40], 1, 9999.0)
        assert np.argwhere(check_records(T, wrong).outliers.to_numpy()).tolist() == [[8, 1], [40, 1]]
