"""Records are checked once, and one cause gives one warning, however many estimators see it."""

import warnings
from functools import partial

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skthermo._core.warnings import checked_once, findings_of, reported_by_caller
from skthermo.datasets import make_truss_campaign
from skthermo.detection import FusedDetector, MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.preprocessing import LagFeatures, check_records
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from tests.detection.compensated import MODES, TRUSS, F, T, X

LATER = make_truss_campaign(random_state=3)
LATER = LATER.temperatures.join(LATER.frequencies)[::5]
STUCK_TEXT = "'T1' is 20"
STUCK = X.assign(T1=X["T1"].mask(np.arange(len(X)) >= 160, 20.0))


def chain():
    """One that is fitted fast."""
    inverse = PosteriorInverse(TRUSS, noise=0.01)
    return DataInformedFEM(TRUSS, inverse=inverse, mapper=TemperatureMapper(LinearRegression()))


@pytest.fixture
def n_checks(monkeypatch):
    """Number of checks so far, of compensators and chains."""
    from skthermo.detection import _compensator
    from skthermo.surrogate.chain import _data_informed

    given = []

    def counted(*tables, **options):
        given.append(tables)
        return check_records(*tables, **options)

    for module in (_compensator, _data_informed):
        monkeypatch.setattr(module, "check_records", counted)
    return lambda: len(given)


def detector(estimator, last=None, **options):
    return make_pipeline(
        TemperatureCompensator(estimator, targets=MODES, **options), last or MahalanobisDetector(0.1, threshold="chi2")
    )


def said(function, *arguments):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        result = function(*arguments)
    return result, [str(warning.message) for warning in caught]


def times_said(texts):
    """How often the values that are stuck are named."""
    return sum(STUCK_TEXT in text for text in texts)


def without(rows, columns, records=LATER):
    holed = records.copy()
    holed.iloc[rows, [records.columns.get_loc(column) for column in columns]] = np.nan
    return holed


class TestChecks:
    @pytest.mark.nightly
    @pytest.mark.parametrize(
        "estimator",
        [
            chain(),
            GridSearchCV(chain(), {"mapper__regressor__positive": [False]}, cv=2),
            LinearRegression(),
        ],
        ids=["chain", "search", "lines"],
    )
    def test_the_outermost_estimator_checks_and_warns_once(self, estimator, n_checks):
        _, texts = said(detector(estimator).fit, STUCK)
        assert n_checks() == 1
        assert times_said(texts) == 1

    @pytest.mark.nightly
    def test_a_chain_within_reports_what_was_found(self):
        fitted, _ = said(detector(chain()).fit, STUCK)
        table = fitted[0].estimator_.report_.findings.table
        assert table[["what", "column", "n_rows"]].to_numpy().tolist() == [["stuck-sensor", "T1", 40]]

    def test_several_compensators_of_the_same_records_share_a_check(self, n_checks):
        parts = [
            ("lines", detector(LinearRegression())),
            ("ridge", detector(Ridge())),
            ("chain", detector(chain(), cv=2)),
        ]
        _, texts = said(FusedDetector(parts).fit, STUCK)
        assert n_checks() == 1
        assert times_said(texts) == 1

    def test_a_study_checks_the_baseline_of_its_detectors_once(self, n_checks):
        fem, _ = said(chain().fit, STUCK[list(T)], STUCK[MODES])
        detectors = {"lines": detector(LinearRegression()), "ridge": detector(Ridge())}
        study = DetectabilityStudy(fem, detectors, [{}], n_repeats=1, random_state=0, uncertainty="noise")
        before = n_checks()
        _, texts = said(study.run, T)
        assert n_checks() == before + 1
        assert times_said(texts) == 0  # the chain has set these values aside, and said so

    def test_other_records_are_checked_too(self, n_checks):
        few = TemperatureCompensator(Ridge(), targets=MODES[:2])
        with checked_once():
            said(TemperatureCompensator(Ridge(), targets=MODES).fit, STUCK)
            _, texts = said(few.fit, STUCK.drop(columns=MODES[2:]))
        assert n_checks() == 2
        assert times_said(texts) == 1

    def test_every_fit_of_its_own_is_checked(self, n_checks):
        for _ in range(2):
            assert times_said(said(detector(Ridge()).fit, STUCK)[1]) == 1
        assert n_checks() == 2

    def test_an_error_leaves_nothing_behind(self, n_checks):
        broken = DataInformedFEM(chain().model, inverse=chain().inverse, mapper=TemperatureMapper("none"))
        for fit in (detector(broken).fit, FusedDetector([("broken", detector(broken))]).fit):
            with pytest.raises(Exception, match="none"):
                said(fit, STUCK)
        before = n_checks()
        _, texts = said(chain().fit, STUCK[list(T)], STUCK[MODES])
        assert n_checks() == before + 1
        assert any(STUCK_TEXT in text for text in texts)

    @pytest.mark.nightly
    @pytest.mark.parametrize("backend", ["loky", "threading"])
    def test_folds_in_workers_check_nothing(self, backend, n_checks):
        alone, _ = said(detector(chain()).fit, STUCK)
        with parallel_config(backend, n_jobs=2):
            fitted, texts = said(detector(chain()).fit, STUCK)
        assert n_checks() == 2
        assert times_said(texts) == 1
        np.testing.assert_array_equal(fitted[0].folds_, alone[0].folds_)

    def test_findings_of_an_estimator_around_are_those_of_its_parts(self):
        with reported_by_caller(["stuck-sensor"], "what was found"):
            assert findings_of(None, T, F) == "what was found"
        with pytest.raises(ValueError, match="broken"), reported_by_caller([], "what was found"):
            raise ValueError("broken")
        outlying = F.assign(f1=F["f1"].where(np.arange(len(F)) != 50, 1.3 * F["f1"]))
        assert said(findings_of, check_records, T, outlying)[1]


class TestRows:
    @pytest.mark.nightly
    @pytest.mark.parametrize("estimator", [chain(), LinearRegression()], ids=["chain", "lines"])
    @pytest.mark.parametrize("data", [lambda table: table, lambda table: table.to_numpy()], ids=["frame", "array"])
    def test_a_day_without_temperatures_gives_one_warning(self, estimator, data):
        positions = [X.columns.get_loc(mode) for mode in MODES]
        compensator = TemperatureCompensator(estimator, targets=positions)
        pipeline = make_pipeline(compensator, MahalanobisDetector(0.1, threshold="chi2"))
        holed = data(without([10], list(T), X))
        texts = [said(function, holed)[1] for function in (pipeline.fit, pipeline.predict, pipeline.score_samples)]
        assert [len(part) for part in texts] == [1, 1, 1]
        for (text,) in texts:
            assert text.startswith("1 of 200 rows cannot be predicted and are NaN: 1 without any temperature")
        assert said(pipeline.predict, holed)[0][10] == 0

    @pytest.mark.parametrize("last", [None, OutlierDetector(MahalanobisDetector(0.1))], ids=["one", "outliers"])
    def test_rows_that_lack_something_else_are_counted_beside(self, last):
        fitted = detector(LinearRegression()).fit(X)
        alarms, texts = said(fitted.predict, without([4], list(MODES), without([3], list(T))))
        for text, expected in zip(
            texts, ("cannot be predicted and are NaN: 1", "are not evaluated (pred"), strict=True
        ):
            assert text.startswith(f"1 of 73 rows {expected}")
        assert f"the first row 4 ({LATER.index[4]})" in texts[1]
        np.testing.assert_array_equal(np.flatnonzero(alarms == 0), [3, 4])

    def test_no_row_with_temperatures_is_reported_once_too(self):
        fitted = detector(LinearRegression()).fit(X)
        alarms, texts = said(fitted.predict, without(slice(None), list(T)))
        assert not alarms.any()
        assert len(texts) == 1
        assert "73 without any temperature" in texts[0]

    def test_residuals_that_are_changed_in_place_are_evaluated_as_they_are(self):
        compensator = TemperatureCompensator(LinearRegression(), targets=MODES)
        detector = MahalanobisDetector().fit(compensator.fit_transform(X))
        gaps = LATER.copy()
        gaps.iloc[:3, : T.shape[1]] = np.nan
        with pytest.warns(UserWarning, match="3 of .*not-predicted"):
            residuals = compensator.transform(gaps)
        residuals.iloc[5] = np.nan
        with pytest.warns(UserWarning, match="^1 of .*not-evaluated"):
            detector.predict(residuals)
        residuals.loc[residuals.index.max() + pd.Timedelta("1D")] = 0.0
        with pytest.warns(UserWarning, match="^4 of .*not-evaluated"):
            assert len(detector.predict(residuals)) == len(LATER) + 1

    def test_lags_that_find_nothing_are_reported_once(self):
        lags = make_pipeline(LagFeatures([0, 1], freq="2D", tolerance="0h", padding="nan"), LinearRegression())
        fitted, _ = said(detector(lags).fit, X)
        alarms, texts = said(fitted.predict, LATER)
        assert [text for text in texts if "rows are not evaluated" in text] == []
        assert any(f"{(alarms == 0).sum()} of 73 rows cannot be predicted" in text for text in texts)

    def test_several_detectors_tell_it_once(self):
        parts = [(f"ridge {alpha}", detector(Ridge(alpha))) for alpha in (0, 1, 2)]
        fused, _ = said(FusedDetector(parts, 0.1).fit, X)
        for holed, message in (
            (without([3], list(T)), "1 without any temperature"),
            (without([3], ["T1"]), "'T1' in 1 of 73 rows"),
        ):
            _, texts = said(fused.predict, holed)
            assert len(texts) == 1
            assert message in texts[0]
            assert "(and 2 times more for other detectors)" in texts[0]

    def test_rows_that_only_one_detector_lacks_are_evaluated_by_the_others(self):
        parts = [("lines", detector(LinearRegression())), ("raw", MahalanobisDetector(0.1))]
        fused, _ = said(FusedDetector(parts, 0.1).fit, X)
        alarms, texts = said(fused.predict, without([3], list(T)))
        assert len(texts) == 1
        assert alarms[3] != 0

    @pytest.mark.nightly
    @pytest.mark.parametrize(
        ("change", "message"),
        [
            (lambda T: T + 60, "outside-training-weather"),
            (lambda T: T.assign(T1=T["T1"] + np.linspace(0, 25, len(T))), "sensor-disagrees"),
        ],
        ids=["hot", "drift"],
    )
    def test_weather_and_sensors_are_reported_once(self, change, message):
        long = make_truss_campaign(2, random_state=5)
        both = [detector(part).fit(long.temperatures.join(long.frequencies)) for part in (LinearRegression(), chain())]
        for fitted in both:
            changed = change(LATER[list(T)]).join(LATER[MODES])
            texts = said(partial(fitted.predict, changed))[1]
            assert sum(message in text for text in texts) == 1
            assert len({text.split(":")[0] for text in texts}) == len(texts)
