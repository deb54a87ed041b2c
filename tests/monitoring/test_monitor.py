"""The monitor: divisions of records into batches, late and repeated records, memory, reasons, events and errors."""

import copy
import pickle
from functools import cache

import numpy as np
import pandas as pd
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st
from sklearn.base import BaseEstimator, TransformerMixin
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.detection import CompensatedDetector, MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.monitoring import Monitor
from skthermo.preprocessing import HingeFeatures, LagFeatures
from tests.monitoring.nightly import quietly

TEMPERATURES, MODES = ["T1", "T2", "T3"], ["f1", "f2", "f3"]
N_BASELINE, N_SERVICE = 1000, 100  # six-hourly: 250 and 25 days
ANSWER = ["state", "index", "threshold", "modes", "groups", "reason", "event"]

pytestmark = pytest.mark.filterwarnings("ignore:.*(few-records|doubtful-values|not-evaluated)")


def campaign(n, seed, start="2025-01-01"):
    """Temperatures and frequencies that follow them with delay, six-hourly, with AR(1) noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(n + 4)
    air = 10 - 12 * np.cos(2 * np.pi * t / 1461) + 5 * np.sin(np.pi * t / 2) + rng.normal(0, 2, n + 4)
    noise = rng.normal(0, 0.003, (n + 4, 3))
    for row in range(1, n + 4):
        noise[row] += 0.5 * noise[row - 1]
    late = 0.5 * air[4:] + 0.5 * air[:-4]
    F = np.array([2.0, 3.0, 5.0]) * (1 - 1e-3 * late[:, np.newaxis] + noise[4:])
    T = air[4:, np.newaxis] + [0, 1, -1] + rng.normal(0, 0.3, (n, 3))
    stamps = pd.date_range(start, periods=n, freq="6h").as_unit("ns")
    return pd.DataFrame(np.hstack([T, F]), stamps, [*TEMPERATURES, *MODES])


ALL = campaign(N_BASELINE + N_SERVICE, 0)
BASELINE = ALL[:N_BASELINE]


def in_service():
    """Records with gaps, missing values, markers, a dead thermometer and damage."""
    records, rng = ALL[N_BASELINE:].copy(), np.random.default_rng(1)
    records.iloc[72:, 3:] *= [0.98, 0.985, 1.0]
    records = records.mask(rng.uniform(size=records.shape) < 0.03)
    records.iloc[20, 3:] = np.nan
    records.iloc[25, :3] = np.nan
    records.iloc[30, 4], records.iloc[31, 0] = -999.0, 285.0
    records.iloc[40:, 2] = records.iloc[40, 2]
    records.iloc[50, 3] *= 100  # implausible
    return records.drop(records.index[[5, 6, *range(52, 64)]])


SERVICE = in_service()


def compensator(regressor=None, **options):
    return TemperatureCompensator(regressor or LinearRegression(), targets=MODES, **options)


def whole(regressor, window):
    return CompensatedDetector(MahalanobisDetector(), regressor, targets=MODES, window=window)


def lagged(regressor=None):
    return make_pipeline(LagFeatures([0, 2, 4], freq="6h", tolerance="6h"), regressor or LinearRegression())


HINGES = make_pipeline(HingeFeatures(), LinearRegression())
FOREST = OutlierDetector(IsolationForest(n_estimators=20, random_state=0), block="1D")
DETECTORS = {
    "raw": MahalanobisDetector(),
    "lags": make_pipeline(compensator(lagged()), MahalanobisDetector()),
    "mean by time": whole(lagged(), "36h"),
    "mean by number": whole(KNeighborsRegressor(20), 6),
    "hinges, mean by time": whole(HINGES, "2D"),
    "forest": make_pipeline(compensator(lagged()), FOREST),
}
SETTINGS = settings(
    max_examples=2,
    deadline=None,
    derandomize=True,
    phases=[Phase.generate],  # a smaller example would take minutes
    suppress_health_check=list(HealthCheck),
)


@cache
def of_baseline(name, **options):
    """A fitted monitor, its answers to all records at once, and how it stands then."""
    monitor = quietly(Monitor(DETECTORS[name], targets=MODES, **options).fit, BASELINE)
    after = copy.deepcopy(monitor)
    return monitor, quietly(after.update, SERVICE), after


def fitted(name, **options):
    """The same with a monitor that may be changed."""
    monitor, *others = of_baseline(name, **options)
    return copy.deepcopy(monitor), *others


def last_of_each(parts):
    answers = pd.concat(parts)
    return answers[~answers.index.duplicated(keep="last")].sort_index()


def assert_same_history(monitor, answers, after, parts):
    pd.testing.assert_frame_equal(last_of_each(parts)[ANSWER], answers[ANSWER], check_exact=True)
    for name in ("events_", "days_", "evaluations_", "faults_", "records_", "corrected_", "weeks_"):
        pd.testing.assert_frame_equal(getattr(monitor, name), getattr(after, name), check_exact=True)
    for count in ("n_records", "n_not_evaluated", "n_left_out"):
        assert monitor.counts_[count] == after.counts_[count]
    assert monitor.status(monitor.last_).state == after.status(after.last_).state


@pytest.mark.nightly
@pytest.mark.parametrize("name", DETECTORS)
@settings(SETTINGS)
@given(data=st.data())
def test_any_division_into_batches_gives_the_history_of_one_pass(name, data):
    monitor, answers, after = fitted(name)
    n = len(SERVICE)
    delays = data.draw(st.lists(st.integers(0, 10), min_size=n, max_size=n), "records until each comes")
    order = np.argsort(np.arange(n) + delays, kind="stable")
    cuts = sorted(data.draw(st.sets(st.integers(1, n - 1), min_size=3, max_size=5), "cuts"))
    parts, n_repeated = [], 0
    for batch in np.split(order, cuts):
        again = data.draw(st.lists(st.sampled_from(list(batch)), max_size=3), "rows that are sent twice")
        n_repeated += len(again)
        parts.append(monitor.update(SERVICE.iloc[[*batch, *again]]))
    assert_same_history(monitor, answers, after, parts)
    assert monitor.counts_["n_repeated"] == n_repeated
    assert monitor.counts_["n_too_late"] == 0


@pytest.mark.nightly
@pytest.mark.parametrize("name", ["raw", "lags", "mean by number", "hinges, mean by time"])
def test_indices_are_those_of_the_detector_on_all_records(name):
    monitor, _, _ = fitted(name, sensors=False)
    service = ALL[N_BASELINE:].drop(ALL.index[-50:-40])
    answers = monitor.update(service)
    columns = MODES if name == "raw" else list(ALL)
    expected = -quietly(monitor.detector_.score_samples, pd.concat([BASELINE, service])[columns])
    np.testing.assert_allclose(answers["index"], expected[N_BASELINE:], atol=1e-6)


@pytest.mark.nightly
def test_days_summarise_their_records():
    _, answers, after = fitted("mean by time")
    by_day = answers.groupby(answers.index.normalize())
    assert after.days_["n_records"].tolist() == by_day.size().tolist()
    n_evaluated = (answers["state"] != "not evaluated").groupby(by_day.ngroup()).sum()
    assert after.days_["n_evaluated"].tolist() == n_evaluated.tolist()
    np.testing.assert_array_equal(after.days_["index_max"], by_day["index"].max())
    np.testing.assert_array_equal(after.days_["index_median"], by_day["index"].median())


def test_reasons_say_why_a_record_is_not_evaluated():
    _, answers, after = fitted("lags")
    stamp = ALL.index[N_BASELINE:]
    assert answers.loc[stamp[20], "reason"] == "no mode has a value"
    assert answers.loc[stamp[25], "reason"].startswith("no temperature has a value")
    assert "outage of 3.2 days" in answers.loc[stamp[64], "reason"]
    assert "f2 is -999: taken as missing" in answers.loc[stamp[30], "reason"]
    assert "T1 is 285 °C: taken as missing" in answers.loc[stamp[31], "reason"]
    assert "implausible" in answers.loc[stamp[50], "reason"]
    held = answers["reason"].str.contains("implausible")
    assert (answers["state"] == "not evaluated").equals(answers["index"].isna() | held)
    assert after.counts_["n_left_out"] >= 3


def test_too_late_records_are_reported_and_not_evaluated():
    monitor, _, _ = fitted("lags")
    monitor.update(SERVICE[50:80])
    before = monitor.evaluations_
    with pytest.warns(UserWarning, match="2 of 2 .*not-evaluated"):
        answers = monitor.update(SERVICE[:2])
    assert answers["state"].eq("not evaluated").all()
    assert answers["reason"].str.contains("came too late, more than 7 days after newer records").all()
    early = BASELINE.iloc[[0]].set_axis(BASELINE.index[[0]] + pd.Timedelta("1h"))
    with pytest.warns(UserWarning, match="before the end of the baseline"):
        monitor.update(early)
    assert monitor.counts_["n_too_late"] == 3
    pd.testing.assert_frame_equal(monitor.evaluations_, before)


def test_known_records_are_repeated_or_refused():
    monitor, _, _ = fitted("lags")
    monitor.update(SERVICE[:40])
    again = monitor.update(pd.concat([BASELINE[-3:], SERVICE[30:41]]))
    assert again.index.tolist() == SERVICE.index[40:41].tolist()
    assert monitor.counts_["n_repeated"] == 13
    changed = SERVICE[35:45].copy()
    changed.iloc[2, 4] = 3.1
    saved = pickle.dumps(monitor)
    with pytest.raises(ValueError, match=r"1 of 6 repeated records .* first 2025-09-.*: 'f2' is 3.1"):
        monitor.update(changed)
    twice = pd.concat([SERVICE[41:42], SERVICE[41:42] * 1.01])
    with pytest.raises(ValueError, match="repeated records have other values"):
        monitor.update(twice)
    assert pickle.dumps(monitor) == saved


UNREADABLE = {
    r"lack the columns \['T2'\] of the baseline, and have \['T9'\]": lambda new: new.rename(columns={"T2": "T9"}),
    "expected a DatetimeIndex": lambda new: new.reset_index(drop=True),
    "5 Hz": lambda new: new.astype({"f1": object}).assign(f1="5 Hz"),
    "time zone UTC, the baseline None": lambda new: new.tz_localize("UTC"),
    "of type ndarray; expected a frame": pd.DataFrame.to_numpy,
}


def test_records_that_cannot_be_read_leave_the_monitor_as_it_was():
    monitor, _, _ = fitted("lags")
    monitor.update(SERVICE[:10])
    saved = pickle.dumps(monitor)
    for match, change in UNREADABLE.items():
        with pytest.raises(ValueError, match=match):
            monitor.update(change(SERVICE[10:15]))
    assert pickle.dumps(monitor) == saved


def test_a_batch_without_records_changes_nothing():
    monitor, _, _ = fitted("lags")
    for empty in (SERVICE[:0], pd.DataFrame(columns=list(SERVICE))):
        got = monitor.update(empty)
        assert len(got) == 0
        assert list(got) == [*ANSWER, "revised"]
    assert monitor.status(monitor.last_).state == "not evaluated"
    assert monitor.last_ == BASELINE.index[-1]


class RunningMean(TransformerMixin, BaseEstimator):
    """A user's step that looks back, which no inspection finds."""

    def __init__(self, records=8):
        self.records = records

    def fit(self, X, y=None):
        return self

    def transform(self, X):
        return X.rolling(self.records, min_periods=1).mean()


@pytest.mark.nightly
def test_memory_of_steps_that_are_not_known_is_asked_for():
    detector = make_pipeline(compensator().set_output(transform="pandas"), RunningMean(), MahalanobisDetector())
    with pytest.raises(ValueError, match=r"uses later records, or earlier ones; expected .* lookback='48h'"):
        Monitor(detector).fit(BASELINE)
    monitor = Monitor(detector, lookback="2D", sensors=False).fit(BASELINE)
    other = copy.deepcopy(monitor)
    whole = monitor.update(ALL[N_BASELINE:])
    parts = [other.update(day) for _, day in ALL[N_BASELINE:].resample("D")]
    pd.testing.assert_frame_equal(whole, pd.concat(parts))


@pytest.mark.nightly
def test_what_the_owner_says_of_an_event_stays_with_it():
    monitor, _, _ = fitted("lags")
    held = SERVICE.index[64:68]
    monitor.update(SERVICE[:80].drop(held))
    assert monitor.status(monitor.last_).state == "alarm"
    number = len(monitor.events_)
    monitor.acknowledge(number, harmless=True, note="crane on the deck")
    monitor.update(SERVICE.loc[held])
    event = monitor.events_.iloc[-1]
    assert event[["acknowledged", "harmless", "note"]].tolist() == [True, True, "crane on the deck"]
    assert "acknowledged as harmless (crane on the deck)" in monitor.summary()
    with pytest.raises(ValueError, match="expected the number of one of the"):
        monitor.acknowledge(99, harmless=True)
