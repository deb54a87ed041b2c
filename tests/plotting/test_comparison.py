"""Several detectors beside each other: what is drawn is what the study found, and nothing is left unsaid."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import spearmanr
from sklearn.exceptions import NotFittedError

from skthermo.plotting import AgreementDisplay
from skthermo.studies import DetectabilityStudy

FOUND = "piers 18 %"


def results_of(simulated, measured, scenario="healthy", measure="PFA", half=0.02):
    """Rows of a study with one scenario; a rate that is None is not there."""
    rows = []
    for source, rates in (("data-informed", simulated), ("reference", measured)):
        for detector, rate in rates.items():
            row = {"detector": detector, "scenario": scenario, "source": source, "measure": measure, "rate": rate}
            row |= {"n_records": 200, "n_not_judged": 0, "error": ""}
            if source == "data-informed":
                row |= {"band_lowest": max(rate - half, 0), "band_highest": min(rate + half, 1)}
            rows.append(row)
    return pd.DataFrame(rows)


SIMULATED = {"raw, a": 0.01, "raw, b": 0.2, "whitened": 0.02, "linear": 0.3}
MEASURED = {"raw, a": 0.02, "raw, b": 0.26, "whitened": 0.0, "linear": 0.31}
HEALTHY = results_of(SIMULATED, MEASURED)
DAMAGED = results_of({k: 1 - 2 * v for k, v in SIMULATED.items()}, dict.fromkeys(SIMULATED, 0.9), FOUND, "POD")
BOTH = pd.concat([DAMAGED, HEALTHY], ignore_index=True)
FAILED = pd.DataFrame([{"detector": "cointegration", "error": "LinAlgError: singular"}])


def texts(ax):
    return [text.get_text() for text in ax.texts if text.get_text()]


def rows_named(ax):
    return [text.get_text() for text in ax.get_yticklabels()]


def test_measured_rates_stand_beside_bands_and_are_counted():
    display = AgreementDisplay.from_predictions(BOTH)
    healthy, damaged = display.axes_
    assert healthy.get_title().startswith("false alarms\n3 of 4 in the band")
    assert damaged.get_title().startswith(f"damage found: {FOUND}\n")
    names = rows_named(healthy)
    assert names == ["raw, a", "whitened", "raw, b", "linear"]  # by the damage that they find
    for detector, bar in zip(SIMULATED, display.bands_["healthy"], strict=True):
        row = HEALTHY[(HEALTHY["detector"] == detector) & (HEALTHY["source"] == "data-informed")].iloc[0]
        low, width = bar.get_x(), bar.get_width()
        np.testing.assert_allclose([low, low + width], 100 * row[["band_lowest", "band_highest"]].astype(float))
        assert bar.get_y() + bar.get_height() / 2 == pytest.approx(names.index(detector))
    inside, outside = display.measured_["healthy"]
    drawn = {names[int(y)]: x for line in (inside, outside) for x, y in line.get_xydata()}
    assert drawn == pytest.approx({name: 100 * rate for name, rate in MEASURED.items()})
    assert outside.get_xydata().tolist() == [[26.0, 2.0]]
    assert (inside.get_markerfacecolor(), outside.get_markerfacecolor()) == ("#0072B2", "white")
    row = display.agreement_.loc["healthy"]
    expected = spearmanr(list(SIMULATED.values()), list(MEASURED.values()))[0]
    assert row.tolist() == [4, 3, 4, pytest.approx(expected)]
    assert np.isnan(display.agreement_.loc[FOUND, "rank_correlation"])  # all measured rates are the same


def test_a_band_without_repeats_says_neither_inside_nor_outside():
    display = AgreementDisplay.from_predictions(HEALTHY.assign(band_lowest=np.nan, band_highest=np.nan))
    assert display.agreement_.loc["healthy", ["n_inside", "n_bands"]].tolist() == [0, 0]
    assert "in the band" not in display.axes_[0].get_title()
    assert len(display.measured_["healthy"][1].get_xdata()) == 0


def test_points_of_a_scatter_plot_lie_over_the_simulated_rates():
    groups = {name: "raw" for name in SIMULATED if name.startswith("raw")}
    display = AgreementDisplay.from_predictions(BOTH, groups=groups, kind="scatter")
    raw, others = display.points_["healthy"]
    np.testing.assert_allclose(raw[0].get_xydata(), [[1, 2], [20, 26]])
    np.testing.assert_allclose(others[0].get_xydata(), [[2, 0], [30, 31]])
    np.testing.assert_allclose(raw[2][0].get_segments()[1], [[18, 26], [22, 26]])
    assert raw[0].get_color() != others[0].get_color()
    assert raw[0].get_marker() != others[0].get_marker()
    for ax in display.axes_:
        diagonal = ax.lines[0].get_xydata()
        np.testing.assert_array_equal(diagonal[:, 0], diagonal[:, 1])
        assert ax.get_xlim() == ax.get_ylim()


def test_groups_are_headings():
    groups = {name: "raw" if name.startswith("raw") else "compensated" for name in SIMULATED}
    display = AgreementDisplay.from_predictions(BOTH, groups=groups)
    labels = display.axes_[0].get_yticklabels()
    assert [text.get_text() for text in labels] == ["raw", "raw, a", "raw, b", "compensated", "whitened", "linear"]
    assert [text.get_fontweight() == "bold" for text in labels] == [True, False, False, True, False, False]
    with pytest.raises(ValueError, match=r"groups names the detectors \['other'\]; expected some of"):
        AgreementDisplay.from_predictions(BOTH, groups={"other": "raw"})


@pytest.mark.parametrize("kind", ["rows", "scatter"])
def test_failures_and_records_that_are_not_judged_are_told(kind):
    results = pd.concat([BOTH, FAILED], ignore_index=True)
    results.loc[(results["detector"] == "linear") & (results["source"] == "reference"), "n_not_judged"] = 50
    display = AgreementDisplay.from_predictions(results, kind=kind)
    if kind == "scatter":
        assert texts(display.axes_[0]) == ["1 failed\n1 do not judge all records"]
        return
    assert rows_named(display.axes_[0])[-1] == "cointegration"
    assert texts(display.axes_[0]) == ["20\N{NO-BREAK SPACE}% not judged", "failed: LinAlgError: singular"]
    assert texts(display.axes_[1]) == ["20\N{NO-BREAK SPACE}% not judged"]


def test_scenarios_can_be_chosen_and_those_without_measured_records_are_not_drawn():
    other = results_of(SIMULATED, {}, "deck 5 %", "POD")
    results = pd.concat([BOTH, other], ignore_index=True)
    assert list(AgreementDisplay.from_predictions(results).agreement_.index) == ["healthy", FOUND]
    assert list(AgreementDisplay.from_predictions(results, scenarios=[FOUND]).agreement_.index) == [FOUND]
    with pytest.raises(ValueError, match=r"expected some of \['healthy', 'piers 18 %'\]"):
        AgreementDisplay.from_predictions(results, scenarios=["deck 5 %"])
    with pytest.raises(ValueError, match=r"no scenario of \['deck 5 %'\] has both simulated and measured records"):
        AgreementDisplay.from_predictions(other)


def test_two_rates_of_one_scenario_are_refused():
    with pytest.raises(ValueError, match=r"'raw, a' has 2 rows of scenario 'healthy', source 'data-informed'"):
        AgreementDisplay.from_predictions(pd.concat([BOTH, HEALTHY]))


def test_what_is_no_result_is_named():
    with pytest.raises(ValueError, match=r"the table of results lacks the columns \['detector'\]"):
        AgreementDisplay.from_predictions(BOTH.drop(columns="detector"))
    with pytest.raises(ValueError, match="the table of results is"):
        AgreementDisplay.from_predictions(None)
    with pytest.raises(ValueError, match="kind is 'bars'; expected 'rows' or 'scatter'"):
        AgreementDisplay.from_predictions(BOTH, kind="bars")
    with pytest.raises(ValueError, match="study is None; expected a DetectabilityStudy"):
        AgreementDisplay.from_estimator(None)
    with pytest.raises(NotFittedError):
        AgreementDisplay.from_estimator(DetectabilityStudy(None, None, []))
