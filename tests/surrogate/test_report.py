"""What is doubtful about records is named, once, with counts."""

import os
import pickle
import re
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import load_z24, make_kw51, make_kw51_campaign, make_truss_campaign, make_z24
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner, KNNGapImputer, LagFeatures
from skthermo.surrogate import DataInformedFEM, TemperatureMapper
from skthermo.updating import ModelUpdater
from tests.surrogate.chains import TRUSS, F, T, inverse, trained

LATER = make_truss_campaign(random_state=1).temperatures


def chain(**options):
    return DataInformedFEM(TRUSS, **({"random_state": 0} | options))


@pytest.fixture(scope="module")
def fitted():
    return chain().fit(T, F)


def caught(function, *arguments):
    with warnings.catch_warnings(record=True) as record:
        warnings.simplefilter("always")
        function(*arguments)
    return record


def test_clean_records_leave_nothing_to_say(fitted):
    report = fitted.report_
    assert (report.rows.given, report.rows.trained, len(report.rows.left_out)) == (365, 365, 0)
    nominal = TRUSS.frequencies(np.ones(4))[0]
    np.testing.assert_allclose(report.modes["offset"], 100 * (F.mean() / nominal - 1), rtol=1e-9)
    np.testing.assert_allclose(report.modes["MAPE"], mape(F, fitted.predict(T)), rtol=1e-9)
    np.testing.assert_allclose(report.modes["MAPE of the mean"], mape(F, F * 0 + F.mean()), rtol=1e-9)
    assert report.parameters.prior is fitted.inverse_.prior_
    assert report.parameters.deviations.idxmax() == "vertical"  # which the modes can hardly tell
    assert report.parameters.deviations["vertical"] > 5 * report.parameters.deviations["bottom"]
    moved = f"all stiffness together by {100 * report.parameters.prior.common:.2g} %"
    assert moved in repr(report)


@pytest.mark.nightly
def test_reasons_for_rows_left_out_are_counted():
    air, measured = T.copy(), F.copy()
    air.iloc[5:8] = np.nan
    measured.iloc[20, 3] = measured.iloc[21, [3, 4]] = np.nan
    lagged = make_pipeline(LagFeatures([0, 1]), TemperatureMapper(Ridge()))
    refined = chain(mapper=lagged).fit(air, measured).report_
    assert refined.rows.trained == 365 - 3 - 1
    temperatures = {f"temperature {name!r} is missing, 2025-01-06 to 2025-01-08": 3 for name in T}
    lag = {"a lag reaches into a gap, 2025-01-09": 1}
    assert refined.rows.left_out.to_dict() == temperatures | lag
    report = chain(inverse=trained(), mapper=lagged).fit(air, measured).report_
    assert report.rows.left_out.to_dict() == temperatures | lag | {
        "frequency 'f4' is missing, 2025-01-21 to 2025-01-22": 2,
        "frequency 'f5' is missing, 2025-01-22": 1,
    }
    assert report.rows.trained == 365 - 3 - 2 - 1
    assert report.rows.filled.empty


def test_gaps_and_gross_errors_are_counted_under_the_names_of_the_data():
    air, measured = T.rename(columns={"T1": "<script>"}), F.copy()
    air.iloc[5:8, 1] = air.iloc[8:13, 0] = np.nan
    measured.iloc[5, 2] = 999.0
    lagged = make_pipeline(LagFeatures([0, 1]), TemperatureMapper(Ridge()))
    with pytest.warns(UserWarning, match="'f3' is 999 Hz in 1 of 365 rows, 2025-01-06.*set-aside"):
        report = chain(mapper=lagged).fit(air, measured).report_
    outliers = report.findings.outliers
    assert outliers.to_numpy().sum() == outliers.iloc[5, 2] == 1
    assert report.rows.trained == 365
    assert report.rows.filled["rows"].to_dict() == {"<script>": 5, "T2": 3}
    others = LinearRegression().fit(T[["T1", "T3"]], T["T2"])
    scatter = np.std(T["T2"] - others.predict(T[["T1", "T3"]]))
    assert report.rows.filled.loc["T2", "standard deviation"] == pytest.approx(scatter, rel=0.1)
    for said in ("'f3' is 999 Hz in 1 of 365 rows", f"3 temperatures of 'T2' (standard deviation {scatter:.1f}"):
        assert said in repr(report)
    html = report._repr_html_()
    assert "<script>" not in html
    assert "&lt;script&gt;" in html


def test_a_sensor_that_is_mostly_filled_is_named_once_whatever_its_lags():
    girder = T.rename(columns={"T1": "girder"}).astype(float)
    girder.iloc[:200, 0] = np.nan
    fem = chain(mapper=TemperatureMapper(Ridge()), inverse=inverse())
    texts = [str(one.message) for one in caught(fem.fit, LagFeatures([0, 2]).fit_transform(girder), F)]
    assert any("of the rows: 'girder'. Repair" in text and "faulty-sensor" in text for text in texts)
    filled = fem.report_.rows.filled
    assert filled.index.tolist() == ["girder"]
    assert filled.loc["girder", ["rows", "when"]].tolist() == [202, "2025-01-01 to 2025-07-21"]


def test_the_report_reads_as_text_and_as_html(fitted):
    text, html = repr(fitted.report_), fitted.report_._repr_html_()
    assert text.startswith("365 of 365 rows trained the temperature mapper.")
    for name in (*F.columns, *TRUSS.parameter_names):
        assert name in text
        assert f"<th>{name}</th>" in html
    assert repr(pickle.loads(pickle.dumps(fitted)).report_) == text


def test_close_modes_that_are_swapped_are_named():
    swapped = F[["f1", "f2", "f3", "f5", "f4", "f6"]][::3]
    texts = [str(one.message) for one in caught(chain(mapper=TemperatureMapper(Ridge())).fit, T[::3], swapped)]
    named = r"\['f5', 'f4'\] look like other modes.*\[0, 1, 2, 4, 3, 5\]"
    assert any(re.search(named, text) for text in texts), texts


def test_gaps_that_lags_multiply_are_counted():
    gappy = T.mask(np.tile(np.random.default_rng(0).random((365, 1)) < 0.05, 3))
    mapper = make_pipeline(LagFeatures(24), TemperatureMapper(Ridge()))
    lagged = chain(mapper=mapper, inverse=inverse(), discrepancy=None)
    assert "few-records" in [warning.message.kind for warning in caught(lagged.fit, gappy, F)]
    assert any(reason.startswith("a lag reaches into a gap") for reason in lagged.report_.rows.left_out.index)
    of_single_sensors = T.mask(np.random.default_rng(0).random(T.shape) < 0.02)
    complete = KNNGapImputer().set_output(transform="pandas").fit_transform(T.mask(T.quantile(0.98) < T))
    for air in (of_single_sensors, complete):
        assert not caught(lagged.fit, air, F)
        assert lagged.report_.rows.trained == 365


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(mode-order|uncalibrated-model|outside-bounds|poor-fit)")
@pytest.mark.parametrize(
    ("offsets", "order", "is_named"),
    [
        ([1.02, 1.01, 1.02, 1.023], [1, 0, 2, 3], True),
        ([1.02, 1.01, 1.02, 1.023], [0, 1, 3, 2], True),  # 7 % apart
        ([0.95, 0.94, 0.95, 0.93], [0, 1, 3, 2], True),  # of a model that is too stiff
        ([1.0, 1.0, 1.03, 0.97], [0, 1, 3, 2], False),  # either order leaves an offset
        ([1.02, 1.01, 1.02, 1.023], [0, 1, 2, 3], False),
    ],
)
def test_close_modes_of_a_model_in_another_order_are_named(offsets, order, is_named):
    z24 = make_z24()
    air = T["T1"].to_frame()
    measured = (1 - 0.0005 * (air - air.mean())).to_numpy() * (z24.frequencies(np.ones(4))[0] * offsets)
    F = pd.DataFrame(measured, T.index).add_prefix("f")
    fem = DataInformedFEM(z24.with_modes(order), mapper=TemperatureMapper(Ridge())).fit(air, F)
    texts = [str(doubt) for doubt in fem.report_.doubts if doubt.kind == "mode-order"]
    assert bool(texts) == is_named
    assert not is_named or "with_modes([0, 1, 2, 3])" in texts[0]  # of which the measured ones are


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(uncalibrated-model|few-records)")
def test_modes_of_the_models_of_measured_bridges_are_in_order():
    campaign = make_kw51_campaign(random_state=0)
    air, modes = campaign.temperatures[::24], campaign.frequencies[::24]
    fem = DataInformedFEM(make_kw51(), mapper=TemperatureMapper(Ridge())).fit(air, modes)
    assert not [doubt for doubt in fem.report_.doubts if doubt.kind == "mode-order"]


@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_a_narrow_box_is_named():
    with pytest.warns(UserWarning, match="'bottom'.*outside-bounds"):
        chain(inverse=trained(bounds=0.05), mapper=TemperatureMapper(Ridge())).fit(T[::2], F[::2])


def test_a_campaign_without_noise_gives_no_warning():
    year = make_truss_campaign(noise=0.0, samples_per_year=180, random_state=3)
    fem = chain()
    assert not caught(fem.fit, year.temperatures, year.frequencies)
    assert not caught(fem.simulate, LATER)
    assert not caught(fem.score, year.temperatures, year.frequencies)


@pytest.mark.nightly
@pytest.mark.skipif("SKTHERMO_DATA" not in os.environ, reason="SKTHERMO_DATA names no folder with the Z24 data")
def test_a_real_bridge_gives_no_warning():
    z24 = load_z24(Path(os.environ["SKTHERMO_DATA"]) / "z24" / "z24_monitoring.csv")
    healthy = (z24.state == "undamaged").to_numpy()
    model = make_z24()
    fem = DataInformedFEM(model, aligner=BiasAligner(model, method="scale"), reduce=True, random_state=0)
    assert not caught(fem.fit, z24.temperatures[healthy], z24.frequencies[healthy])
    assert fem.report_.rows.trained > 2500


def test_foreign_weather_is_counted_once_by_predict_and_simulate(fitted):
    for method in (fitted.predict, fitted.simulate, fitted.predict_parameters):
        (outside,) = (w.message for w in caught(method, LATER + 40) if w.message.kind == "other-weather")
        assert "degrees Celsius" in str(outside)


def test_extrapolation_distance_is_in_units_of_the_training_range(fitted):
    width = T.max() - T.min()
    weather = pd.DataFrame([T.max() + 0.5 * width, T.min(), T.mean(), T.min() - 2 * width], columns=T.columns)
    table = fitted.extrapolation_distance(weather)
    np.testing.assert_allclose(table[T.columns], np.outer([0.5, 0, 0, 2], np.ones(3)), atol=1e-9)


def test_extrapolation_distance_accounts_for_lags_and_gaps():
    mapper = make_pipeline(LagFeatures([0, 2]), TemperatureMapper(Ridge()))
    lagged = chain(mapper=mapper, inverse=inverse(), discrepancy=None).fit(T, F)
    weather = LATER.copy()
    weather.index = weather.index + pd.Timedelta(days=365)
    weather.iloc[5, 0] = T["T1"].max() + (T["T1"].max() - T["T1"].min())
    weather.iloc[9] = np.nan
    table = lagged.extrapolation_distance(weather)
    assert list(table.columns) == [f"T{i}_lag{k}" for i in (1, 2, 3) for k in (0, 2)]
    np.testing.assert_allclose([table["T1_lag0"].iloc[5], table["T1_lag2"].iloc[7]], 1)
    assert table["T2_lag0"].isna().tolist() == [row == 9 for row in range(365)]
    assert table.index.equals(weather.index)


def aligned(model, n=365, factor=1.0):
    parts = {"mapper": TemperatureMapper(), "aligner": BiasAligner(model, method="scale")}
    return DataInformedFEM(model, random_state=0, **parts).fit(T[:n], factor * F[:n])


@pytest.mark.nightly
def test_offsets_that_an_aligner_hides_are_named_unless_weather_or_a_common_factor_explains_them():
    wrong = TRUSS.rescaled([0.95, 1.0, 1.05, 1.0])
    with pytest.warns(UserWarning, match="of 'f1', .*uncalibrated-model") as given:
        fem = aligned(wrong)
    assert len([w for w in given if w.message.kind == "uncalibrated-model"]) == 1
    assert fem.report_.has_hidden_offsets
    text = next(str(w.message) for w in given if w.message.kind == "uncalibrated-model")
    assert text[1:] in repr(fem.report_)
    np.testing.assert_allclose(fem.report_.modes["hidden offset"], fem.report_.modes["offset"], atol=1e-9)
    calibrated = ModelUpdater(wrong, bounds=0.5, prior=0.3).fit(F, frequency_std=0.005 * F.mean()).model_
    assert not aligned(calibrated).report_.has_hidden_offsets
    right, alike = aligned(TRUSS).report_, aligned(TRUSS, factor=1.03).report_
    assert not right.has_hidden_offsets
    assert alike.unexplained_offset == pytest.approx(right.unexplained_offset, rel=0.1)
    assert not aligned(TRUSS, n=60).report_.has_hidden_offsets  # of a winter
