"""More change is never less alarm, whatever changes; responses of any unit, wrong clocks, other targets."""

import copy
import pickle
import warnings
from functools import cache, partial

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss
from skthermo.detection import CompensatedDetector, DirectionalDetector, MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.preprocessing import HampelFilter
from tests.monitoring.nightly import quietly, six_hourly
from tests.nights import by_day

PER_DAY, N_BASELINE = 4, 4 * 365
SETTLED = 3 * PER_DAY  # records after which also a window of two days has to see a change
KINDS = {"damage", "fault"}

pytestmark = pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values|not-evaluated)")


MODES = ["f1", "f2", "f3", "f4", "f5", "f6"]


def detector(targets, last=None, window=None, **options):
    last = MahalanobisDetector() if last is None else last
    return CompensatedDetector(last, LinearRegression(), targets=targets, window=window, **options)


TESTS = {
    "any direction": MahalanobisDetector,
    "softening": DirectionalDetector,
    "model": partial(DirectionalDetector, make_truss()),
}
ALARMS = by_day(
    [("2D", "any direction"), (None, "softening"), (None, "model")],
    at_night=[(window, test) for window in (None, "2D") for test in TESTS],
)


@cache
def saved(window=None, test="any direction", **options):
    """A monitor of the truss after its baseline."""
    monitor = Monitor(detector(MODES, TESTS[test](), window, regimes=None), **options)
    return pickle.dumps(quietly(monitor.fit, six_hourly()[:N_BASELINE]))


def fitted(window=None, test="any direction", **options):
    return pickle.loads(saved(window, test, **options))


def changed(factors, n_days=20, start=0):
    """Records of the truss in service in which modes are multiplied."""
    begin = N_BASELINE + PER_DAY * start
    new = six_hourly()[begin : begin + PER_DAY * n_days].copy()
    return new.assign(**{name: new[name] * factor for name, factor in factors.items()})


SIGNS = st.sampled_from([-1, 1])
SIZES = st.builds(lambda sign, size: float(np.exp(sign * size)), SIGNS, st.floats(0.05, 12.0))
SHIFTS = st.builds(lambda sign, size: sign * float(np.exp(size)), SIGNS, st.floats(0.5, np.log(1000)))

some = settings(
    max_examples=by_day(4, at_night=18),
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],
    suppress_health_check=[*HealthCheck],
)


@pytest.mark.one_case
@pytest.mark.parametrize("options", [{}, {"sensors": False}], ids=["with sensors", "without"])
@some
@given(
    factors=st.dictionaries(st.sampled_from(MODES), SIZES | st.just(0.0) | st.just(-1.0), min_size=1),
    alarm=st.sampled_from(ALARMS),
    start=st.integers(0, 300),
    n_days=st.integers(4, by_day(9, at_night=20)),
)
def test_no_change_of_any_size_or_pattern_is_healthy(options, factors, alarm, start, n_days):
    monitor = fitted(*alarm, **options)
    answers = monitor.update(changed(factors, n_days, start))[SETTLED:]
    assert set(answers["state"]) <= {"alarm", "not evaluated"}
    assert answers.loc[answers["state"] == "not evaluated", "reason"].ne("").all()
    assert monitor.status(monitor.last_).state == "alarm"
    opened = monitor.events_[monitor.events_["end"].isna()]
    assert set(opened["kind"]) & KINDS


@cache
def about_zero():
    """The truss's records as responses of any sign, about 0 mm, and a monitor of them."""
    records = six_hourly().copy()
    records[MODES] = 3 * (records[MODES] / records[MODES].mean() - 1)
    return records, pickle.dumps(quietly(Monitor(targets=MODES, units="mm").fit, records[:N_BASELINE]))


@pytest.mark.nightly
@some
@given(
    shifts=st.dictionaries(st.sampled_from(MODES), SHIFTS, min_size=1),
    start=st.integers(0, 300),
    n_days=st.integers(4, 20),
)
def test_responses_of_any_sign_that_move_by_up_to_a_thousand_times_their_range_are_in_alarm(shifts, start, n_days):
    records, saved = about_zero()
    monitor, begin, baseline = pickle.loads(saved), N_BASELINE + PER_DAY * start, records[:N_BASELINE]
    usual = baseline.max() - baseline.min()
    new = records[begin : begin + PER_DAY * n_days].copy()
    for name, shift in shifts.items():
        new[name] += shift * usual[name]
    answers = monitor.update(new)[SETTLED:]
    assert set(answers["state"]) <= {"alarm", "not evaluated"}
    assert monitor.status(monitor.last_).state == "alarm"


@pytest.mark.nightly
def test_a_change_that_comes_and_goes_is_one_event_and_never_healthy():
    monitor, records = fitted(), changed({}, 20)
    records["f3"] *= np.resize([0.6, 1.0, 0.6, 0.6, 1.0], len(records))
    answers = monitor.update(records)
    assert set(answers["state"].iloc[5:]) <= {"alarm", "not evaluated"}
    assert (monitor.events_["kind"] == "fault").sum() == 1


@pytest.mark.nightly
def test_an_alarm_stays_when_the_damage_grows_beyond_what_is_plausible():
    monitor = fitted()
    monitor.update(changed({"f3": 0.8}, 5))
    assert monitor.status(monitor.last_).state == "alarm"
    answers = monitor.update(changed({"f3": 0.6}, 30, start=5))
    assert set(answers["state"]) == {"alarm"}
    answers = monitor.update(changed({}, 5, start=35))
    assert answers["state"].iloc[-1] == "healthy"
    assert monitor.events_["end"].notna().all()


@pytest.mark.nightly
def test_what_is_set_aside_is_healthy_only_once_it_is_acknowledged_or_comes_back():
    monitor = fitted("2D")
    answers = monitor.update(changed({"f3": 0.6}, 10))
    assert answers["state"].tolist() == 2 * ["not evaluated"] + (len(answers) - 2) * ["alarm"]
    assert answers["modes"].iloc[2:].eq("f3").all()
    assert answers["reason"].str.contains("f3").all()
    assert monitor.status(monitor.last_).state == "alarm"
    event = monitor.events_.loc[1]
    assert (event["kind"], event["modes"], event["peak"]) == ("fault", "f3", 1.0)
    other = copy.deepcopy(monitor)
    monitor.acknowledge(1, harmless=True, note="loose cable")
    assert monitor.status(monitor.last_).state != "alarm"
    parts = [monitor.update(changed({"f3": 0.6}, 1, start=day)) for day in range(10, 14)]
    assert set(pd.concat(parts)["state"]) == {"healthy"}
    assert pd.concat(parts)["reason"].str.contains("f3 is left out").all()
    assert monitor.events_["end"].notna().all()
    assert other.update(changed({}, 3, start=10))["state"].tolist()[-1] == "healthy"
    assert other.events_["end"].notna().all()
    n_values = (14 + 0) * PER_DAY
    assert monitor.counts_["n_left_out"] == n_values
    assert monitor.days_["n_left_out"].sum() == n_values


class DropsOutliers(TransformerMixin, BaseEstimator):
    """A step that leaves out what is far from the baseline."""

    def fit(self, X, y=None):
        self.centre_, self.deviation_ = X.median(), X.std()
        return self

    def transform(self, X):
        return X.mask((X - self.centre_).abs() > 8 * self.deviation_)


class Bounded(MahalanobisDetector):
    """A detector whose index does not grow beyond most of the baseline."""

    def score_samples(self, X):
        return np.maximum(super().score_samples(X), -np.nanquantile(self.baseline_index_, 0.9))


def test_a_detector_that_drops_large_changes_is_refused_and_a_blind_one_is_reported():
    drops = make_pipeline(DropsOutliers(), detector(MODES))
    with pytest.raises(ValueError, match="drops or fills large changes"):
        Monitor(drops, sensors=False).fit(six_hourly()[:400])
    blind = Monitor(detector(MODES, Bounded()), sensors=False, persistence=1, false_alarms_per_year=0.5)
    with pytest.warns(UserWarning, match="undetected-changes"):
        blind.fit(six_hourly()[:400])


def with_displacement():
    """Beside the modes a displacement about 0 mm, and two strains."""
    table, random = six_hourly().copy(), np.random.default_rng(1)
    weather = table["T1"] - table["T1"].mean()
    table["d"] = 0.02 * weather + random.normal(0, 0.5, len(table))
    table["e1"] = 80 + 3 * weather + random.normal(0, 4, len(table))
    table["e2"] = -60 - 2 * weather + random.normal(0, 4, len(table))
    return table


@pytest.mark.nightly
def test_responses_may_have_any_sign_and_unit():
    records, targets = with_displacement(), [*MODES, "d", "e1", "e2"]
    units = dict.fromkeys(MODES, "Hz") | {"d": "mm", "e1": "µm/m", "e2": "µm/m"}
    monitor = Monitor(detector(targets), units=units).fit(records[:N_BASELINE])
    assert monitor.units_ == units | {"T1": "°C", "T2": "°C", "T3": "°C"}
    new = records[N_BASELINE : N_BASELINE + 30 * PER_DAY]
    healthy = copy.deepcopy(monitor)
    assert (healthy.update(new)["state"] == "healthy").mean() > 0.97
    assert healthy.faults_.empty
    new = new[: 15 * PER_DAY]
    moved = copy.deepcopy(monitor)
    assert set(moved.update(new.assign(d=new["d"] - 10.0))["state"][SETTLED:]) == {"alarm"}
    assert moved.faults_.empty
    stuck = copy.deepcopy(monitor)
    assert stuck.update(new.assign(d=0.0))["reason"].str.contains("d is left out").all()
    assert "repeats 0 mm" in stuck.faults_["detail"].iloc[0]
    monitor.update(new[:1].assign(d=500.0))
    assert "d is 500 mm: implausible" in monitor.evaluations_["reason"].iloc[0]


@pytest.mark.nightly
def test_a_new_baseline_moves_responses_of_any_sign_by_their_change():
    records, targets = with_displacement(), [*MODES, "d"]
    records = records.drop(columns=["e1", "e2"])
    monitor = Monitor(detector(targets), sensors=False).fit(records[:N_BASELINE])
    new = records[N_BASELINE : N_BASELINE + 60 * PER_DAY]
    monitor.update(new.assign(d=new["d"] + 3.0))
    assert monitor.status(monitor.last_).state == "alarm"
    retraining = monitor.rebaseline(new.index[0])
    assert retraining.table.loc["d", "change"] == pytest.approx(3.0, abs=0.2)
    assert retraining.table.loc[MODES, "change"].abs().max() < 0.002
    later = records[N_BASELINE + len(new) :][: 20 * PER_DAY]
    assert (monitor.update(later.assign(d=later["d"] + 3.0))["state"] == "healthy").mean() > 0.9
    assert set(monitor.update(records[N_BASELINE + len(new) + len(later) :][:40])["state"][SETTLED:]) == {"alarm"}


@pytest.mark.nightly
def test_records_of_a_wrong_clock_are_set_aside_and_true_ones_are_not_late():
    monitor, new = fitted(), changed({}, 10)
    ahead = new[:20].set_axis(new.index[:20] + pd.Timedelta("800D"))
    answers = monitor.update(pd.concat([new[20:24], ahead]))
    assert answers["state"].tolist() == ["healthy"] * 4 + ["not evaluated"] * 20
    assert answers["reason"][4:].str.contains("set aside").all()
    assert set(monitor.update(new[24:])["state"]) == {"healthy"}
    assert monitor.counts_["n_too_late"] == 0
    assert (monitor.counts_["n_ahead"], monitor.counts_["n_not_evaluated"]) == (20, 20)
    assert len(monitor.update(ahead)) == 0  # known, and still set aside
    assert monitor.last_ == new.index[-1]
    assert "20 set aside" in monitor.summary()
    monitor.update(new[:0], confirm=True)
    assert monitor.last_ == ahead.index[-1]
    assert monitor.counts_["n_ahead"] == 0


def test_a_logger_that_was_silent_for_months_is_taken_in_once_records_confirm_each_other():
    (parts, whole), new = (fitted(None, "softening") for _ in range(2)), changed({}, 4, start=120)
    first = parts.update(new[:9])
    assert set(first["state"]) == {"not evaluated"}
    rest = parts.update(new[9:])
    assert rest.index.equals(new.index)
    pd.testing.assert_frame_equal(rest, whole.update(new))
    assert set(rest["state"]) == {"healthy"}


@pytest.mark.nightly
def test_a_record_of_the_present_needs_no_confirmation():
    now = pd.Timestamp.now().floor("h")
    records = six_hourly().set_axis(pd.date_range(end=now - pd.Timedelta("100D"), periods=len(six_hourly()), freq="6h"))
    monitor = Monitor(detector(MODES), sensors=False).fit(records[-N_BASELINE:])
    new = records[-1:].set_axis(pd.DatetimeIndex([now]))
    assert monitor.update(new)["state"].tolist() == ["healthy"]


@pytest.mark.nightly
def test_modes_are_named_whatever_the_order_of_targets():
    own = ["f6", "f1", "f3", "f2", "f5", "f4"]
    monitor = Monitor(detector(own), sensors=False, targets=MODES[::-1]).fit(six_hourly()[:N_BASELINE])
    monitor.update(changed({"f6": 0.9}, 2))
    assert monitor.targets_ == MODES
    assert monitor.events_["modes"].iloc[-1].split(",")[0] == "f6"


@pytest.mark.nightly
@pytest.mark.parametrize(("value", "kind"), [(300.0, "implausible"), (-999.0, "dead")])
def test_a_thermometer_that_gives_what_no_weather_gives_is_implausible_and_a_marker_is_a_missing_value(value, kind):
    monitor, new = fitted(), changed({})
    name = new.columns[0]
    new[name] = value
    monitor.update(new)
    faults = monitor.faults_.set_index("column")
    assert faults.loc[name, "kind"] == kind
    assert list(faults.index) == [name]


@pytest.mark.filterwarnings("ignore:.*(faulty-sensor|undetected-changes)")
@pytest.mark.parametrize("scale", [1.0, 1e-3], ids=["in hertz", "about zero"])
def test_values_of_a_baseline_that_are_no_measurements_are_set_aside_and_named(scale):
    wrong = six_hourly()[:240].copy()
    wrong[MODES] = scale * (wrong[MODES] - (0 if scale == 1 else wrong[MODES].mean()))  # also of responses about zero
    places = {"T1": (60, 1e6), "f2": (120, 1e6), "f5": (180, -1e9)}
    for name, (row, value) in places.items():
        wrong.iloc[row, wrong.columns.get_loc(name)] = value
    missing = wrong.copy()
    for name, (row, _) in places.items():
        missing.iloc[row, missing.columns.get_loc(name)] = np.nan
    with pytest.warns(UserWarning, match="set-aside") as caught:
        monitor = Monitor(MahalanobisDetector(), targets=MODES, random_state=0).fit(wrong)
    (said,) = (str(one.message) for one in caught if "set-aside" in str(one.message))
    assert said.startswith("3 values")
    assert monitor.set_aside_[["column", "n_rows", "from"]].to_numpy().tolist() == [
        [name, 1, wrong.index[row]] for name, (row, _) in places.items()
    ]
    expected = quietly(Monitor(MahalanobisDetector(), targets=MODES, random_state=0).fit, missing)
    assert monitor.threshold_ == expected.threshold_


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*few-records")
def test_a_column_that_says_nothing_is_left_out_and_named():
    records = six_hourly()
    baseline = records[:N_BASELINE].assign(f2=records["f2"].iloc[0], T1=np.where(np.arange(N_BASELINE) % 4, 484.6, 5))
    with pytest.warns(UserWarning, match="useless-column"):
        monitor = Monitor(detector(MODES), targets=MODES, random_state=0).fit(baseline)
    assert list(monitor.left_out_) == ["T1", "f2"]
    assert monitor.faults_["column"].tolist() == ["T1", "f2"]
    assert {one["column"] for one in monitor.status().faults} == {"T1", "f2"}
    assert monitor.targets_ == [name for name in MODES if name != "f2"]
    answers = monitor.update(records[N_BASELINE : N_BASELINE + 40].assign(f2=np.inf))
    assert (answers["state"] == "healthy").all()
    others = [name for name in records if name not in ("T1", "f2")]
    alone = Monitor(detector([name for name in MODES if name != "f2"]), random_state=0).fit(baseline[others])
    pd.testing.assert_frame_equal(answers, alone.update(records[N_BASELINE : N_BASELINE + 40][others]))


@pytest.mark.parametrize("first_day", [1, 2])
def test_a_mode_that_is_missing_for_a_whole_month_of_the_baseline_is_named_with_the_month(first_day):
    baseline = six_hourly()[:N_BASELINE]
    is_missing = (baseline.index.month == 5) & (baseline.index.day >= first_day)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        Monitor(detector(MODES, regimes=None)).fit(baseline.assign(f2=baseline["f2"].mask(is_missing)))
    is_named = any("'f2'" in str(one.message) and "May" in str(one.message) for one in caught)
    assert is_named == (first_day == 1)


@pytest.mark.parametrize(
    ("options", "change", "match"),
    [
        ({"targets": MODES[:4]}, {}, r"compensator \["),
        ({"targets": [*MODES, "T1"]}, {}, r"compensator \["),
        ({"detector": MahalanobisDetector()}, {}, "expected targets="),
        ({"detector": make_pipeline(HampelFilter(5), detector(MODES))}, {}, "compares records with later ones"),
        ({}, {"T1": 273.15, "T2": 273.15}, "kelvin"),
    ],
)
def test_settings_and_records_that_do_not_fit_each_other_are_refused(options, change, match):
    baseline = six_hourly()[:N_BASELINE].copy()
    for name, shift in change.items():
        baseline[name] += shift
    with pytest.raises(ValueError, match=match):
        Monitor(**{"detector": detector(MODES)} | options).fit(baseline)
    with pytest.raises(ValueError, match="the baseline has no records"):
        Monitor(detector(MODES)).fit(baseline[:0])
