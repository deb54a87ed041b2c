"""Regression, regimes, windows and a detector in one estimator."""

import functools
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.ensemble import IsolationForest
from sklearn.linear_model import LinearRegression
from sklearn.model_selection import GridSearchCV
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import (
    CompensatedDetector,
    DirectionalDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
)
from skthermo.preprocessing import BlockedKFold

pytestmark = pytest.mark.filterwarnings("ignore:.*(other-weather|few-records)")


def truss(seed=0, **options):
    campaign = make_truss_campaign(random_state=seed, **options)
    return campaign.temperatures.join(campaign.frequencies)


MODES = [f"f{mode}" for mode in range(1, 7)]
YEAR, LATER, DAMAGED = truss(0), truss(1), truss(2, damage={"bottom": 0.05})


def whole(detector=None, **options):
    return CompensatedDetector(detector, LinearRegression(), **({"targets": MODES} | options))


@functools.cache
def learned(window=None):
    return whole(DirectionalDetector(make_truss()), window=window).fit(YEAR)


def frosty(seed, loss=0.0, start="2025-01-01"):
    """Twelve-hourly records over a year, whose frequencies scatter five times as much in frost."""
    random, n = np.random.default_rng(seed), 730
    T = 9 - 13 * np.cos(2 * np.pi * np.arange(n) / n) + random.normal(0, 3, n)
    noise = 0.002 * np.where(T < 0, 5.0, 1.0)[:, np.newaxis] * random.normal(size=(n, 3))
    F = np.array([3.0, 5.0, 9.0]) * (1 - 1e-3 * T[:, np.newaxis] + noise - loss)
    return pd.DataFrame(np.column_stack([T, F]), pd.date_range(start, periods=n, freq="12h"), ["T", "f1", "f2", "f3"])


def rate(detector, records):
    decisions = detector.predict(records)
    return (decisions == -1).mean() / max((decisions != 0).mean(), 1e-9)


def test_without_regimes_and_windows_it_is_the_pipeline():
    one = whole(MahalanobisDetector(), regimes=None).fit(YEAR)
    other = make_pipeline(TemperatureCompensator(LinearRegression(), targets=MODES), MahalanobisDetector()).fit(YEAR)
    np.testing.assert_array_equal(one.damage_index(LATER), other[-1].damage_index(other[:-1].transform(LATER)))
    assert one.threshold_ == other[-1].threshold_
    np.testing.assert_array_equal(one.baseline_index_, other[-1].baseline_index_)
    np.testing.assert_array_equal(one.residuals(LATER), other[0].transform(LATER))


@pytest.mark.filterwarnings("ignore:.*not-evaluated")
def test_longer_windows_find_smaller_losses_at_the_same_false_alarms():
    rates = {}
    for window in (None, 3):
        rates[window] = [rate(learned(window), records) for records in (LATER, DAMAGED)]
        assert rates[window][0] < 0.05
        assert learned(window).pod([0.05])["bottom"].item() == pytest.approx(rates[window][1], abs=0.15)
    assert rates[None][1] < rates[3][1]


@pytest.mark.nightly
def test_regimes_are_found_where_scatter_changes_and_find_damage_on_warm_days():
    modes = ["f1", "f2", "f3"]
    detectors = {
        regimes: CompensatedDetector(MahalanobisDetector(), targets=modes, regimes=regimes).fit(frosty(0))
        for regimes in ("auto", None)
    }
    name, value = detectors["auto"].regime_
    assert name == "T"
    assert -3 < value < 3
    healthy, damaged = frosty(1, start="2026-01-01"), frosty(2, 0.01, "2026-01-01")
    warm = (healthy["T"] > 3).to_numpy()
    found = {key: (one.predict(damaged)[damaged["T"] > 3] == -1).mean() for key, one in detectors.items()}
    assert found["auto"] > found[None] + 0.3
    false = [(detectors["auto"].predict(healthy)[part] == -1).mean() for part in (warm, ~warm)]
    assert max(false) < 0.06
    given = CompensatedDetector(MahalanobisDetector(), targets=modes, regimes=detectors["auto"].regime_).fit(frosty(0))
    np.testing.assert_array_equal(given.damage_index(healthy), detectors["auto"].damage_index(healthy))
    assert CompensatedDetector(targets=MODES).fit(YEAR).regime_ is None
    creeping = frosty(0)  # an alarm in the regime of little scatter, which with a window has to hold in a later third
    creeping.iloc[487:, 1:] *= 1 - np.linspace(0, 0.005, 243)[:, np.newaxis]
    for window, records, n_regimes in ((None, creeping, 2), ("2D", frosty(0), 2), ("2D", creeping, 1)):
        detector = whole(MahalanobisDetector(), targets=modes, window=window).fit(records)
        assert len(detector.detectors_) == n_regimes == 1 + (detector.regime_ is not None)


def test_a_regime_is_the_same_for_frames_and_arrays():
    """An input has a name in a frame and a position in an array; rows of either kind are evaluated alike."""
    named = whole(MahalanobisDetector(), regimes=("T1", 10.0)).fit(YEAR)
    expected = named.damage_index(LATER)
    polars = pytest.importorskip("polars")
    targets = [YEAR.columns.get_loc(name) for name in MODES]
    bare = whole(MahalanobisDetector(), targets=targets, regimes=(0, 10.0)).fit(YEAR.to_numpy())
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # scikit-learn's, of names that one of both lacks
        for detector, rows in [
            (named, LATER.to_numpy()),
            (named, polars.from_pandas(LATER)),
            (bare, LATER),
            (bare, LATER.to_numpy()),
            (whole(MahalanobisDetector(), regimes=("T1", 10.0)).fit(polars.from_pandas(YEAR)), LATER),
        ]:
            np.testing.assert_array_equal(detector.damage_index(rows), expected)


def test_windows_refuse_stamps_of_another_kind_than_in_fit():
    stamps = pd.date_range("2025", periods=len(YEAR), freq="D")
    zoned = YEAR.set_axis(stamps.tz_localize("UTC"))
    naive = LATER.set_axis(stamps + pd.Timedelta("365D"))
    for records, others in ((zoned, naive), (naive, zoned), (naive, LATER.reset_index(drop=True))):
        with pytest.raises(ValueError, match=r"time zone|DatetimeIndex"):
            whole(MahalanobisDetector(), window="3D", regimes=None).fit(records).predict(others)


def test_the_baseline_is_the_history_of_later_windows_and_batches_are_one_pass():
    stamps = pd.date_range("2025", periods=2 * len(YEAR), freq="D")
    records = pd.concat([YEAR, LATER]).set_axis(stamps)
    detector = whole(MahalanobisDetector(), window="7D", regimes=None).fit(records[: len(YEAR)])
    later = records[len(YEAR) :]
    index = detector.damage_index(later)
    assert index.notna().all()
    for start in range(0, 60, 13):
        batch = later[max(start - 6, 0) : start + 13]
        found = detector.damage_index(batch)[start - max(start - 6, 0) :]
        np.testing.assert_allclose(found, index[found.index], rtol=1e-9)


@pytest.mark.nightly
def test_any_outlier_detector_serves_and_grids_reach_its_parameters():
    forest = whole(IsolationForest(n_estimators=20, random_state=0)).fit(YEAR)
    assert isinstance(forest.detectors_[0], OutlierDetector)
    assert rate(forest, LATER) < 0.06
    assert not hasattr(forest, "pod")
    grid = {"detector__contamination": [0.02], "regressor__n_neighbors": [1, 15]}
    neighbours = CompensatedDetector(MahalanobisDetector(), KNeighborsRegressor(), targets=MODES)
    search = GridSearchCV(neighbours, grid, cv=BlockedKFold(2)).fit(YEAR)
    assert search.best_params_["regressor__n_neighbors"] == 15
    assert clone(whole()).set_params(detector__omnibus=0.5).detector.omnibus == 0.5


def test_severities_are_those_of_the_record_and_nan_in_gaps():
    detector = learned()
    losses = detector.severities(truss(3, damage={"diagonal": 0.2}))
    assert losses["diagonal"].median() == pytest.approx(0.2, abs=0.05)
    assert list(losses.columns) == ["bottom", "top", "diagonal", "vertical"]
    lost = detector.severities(truss(3, damage={"diagonal": 0.2}, kind="section"), kind="section")
    assert lost.median().idxmax() == "diagonal, section"
    holed = LATER.copy()
    holed.loc[holed.index[:3], MODES] = np.nan
    with pytest.warns(UserWarning, match="not-evaluated"):
        assert (detector.predict(holed)[:3] == 0).all()
    assert detector.severities(holed).iloc[:3].isna().all(axis=None)
    assert np.isnan(detector.explained(holed)[:3]).all()
    assert np.isnan(detector.explained(holed, kind="section")[:3]).all()


def test_more_damage_is_never_less_alarm():
    for window in (None, 3):
        detector, record, before = learned(window), LATER[:10], None
        for loss in (0.0, 0.05, 0.2, 0.6, 0.95):
            index = detector.damage_index(record.assign(**{name: record[name] * (1 - loss) for name in ("f1", "f2")}))
            assert before is None or (index[before > detector.threshold_] >= before[before > detector.threshold_]).all()
            before = index
        assert (before[2:] > detector.threshold_).all()


def test_scores_form_one_chain_and_the_report_reads_residuals():
    detector = learned(3)
    index = detector.damage_index(LATER)
    np.testing.assert_array_equal(detector.score_samples(LATER), -index)
    np.testing.assert_array_equal(detector.decision_function(LATER), detector.threshold_ - index)
    with pytest.warns(UserWarning, match="not-evaluated"):
        decisions = detector.predict(LATER)
    np.testing.assert_array_equal(decisions == -1, index > detector.threshold_)
    np.testing.assert_array_equal(decisions == 0, index.isna())
    assert detector.report_["read_as"].tolist() == ["residual"] * 6


@pytest.mark.parametrize(
    ("options", "records", "message"),
    [
        ({"window": "5D"}, YEAR[:60].reset_index(drop=True), "'5D', a time"),
        ({"window": "5D"}, YEAR[60::-1], "order of time"),
        ({"window": 0}, YEAR, "'window' parameter"),
        ({"window_share": 0.0}, YEAR, "'window_share' parameter"),
        ({"regimes": ("T9", 1.0)}, YEAR, "'T9'"),
        ({"regimes": "frost"}, YEAR, "'regimes' parameter"),
        ({"targets": ["f9"]}, YEAR, "'f9'"),
    ],
)
def test_settings_that_cannot_be_are_named(options, records, message):
    with pytest.raises(ValueError, match=message):
        whole(**options).fit(records)
