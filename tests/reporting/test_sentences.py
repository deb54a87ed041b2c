"""What a report says of numbers, and of families of scenarios."""

import numpy as np
import pandas as pd
import pytest

from skthermo._core.text import duration_text, percent, probability_text, share_text
from skthermo.reporting._findings import SIMULATED, findings_of
from skthermo.reporting._html import Html, element
from skthermo.reporting._templates import environment_of
from skthermo.studies import DetectabilityStudy
from skthermo.studies.detectability._findings import StudyFindings


@pytest.mark.parametrize("share", [0, 1e-6, 0.00042, 0.0274, 0.099, 0.1, 0.5, 0.936, 0.9949, 0.996, 0.9994, 1])
def test_shares_are_said_to_two_digits_and_only_all_is_100_percent(share):
    text = share_text(share)
    assert float(text.removesuffix("\xa0%")) == pytest.approx(100 * share, rel=0.05)
    assert ("100" in text) == (share == 1)


def test_shares_that_are_nearly_1_or_not_known():
    assert share_text(0.9999) == "over\xa099.9\xa0%"
    assert share_text(np.nan) == percent(np.nan) == "not known"
    assert probability_text(0.0001) == "less than 0.001"


def test_times_are_said_in_fitting_units():
    waits = [*map(pd.Timedelta, ("0D", "20min", "5h", "1h", "24h", "93.5D")), pd.NaT, 12.0, np.nan]
    said = ["first record", "20 minutes", "5 hours", "1 hour", "1 day", "94 days", "no alarm", "12 records", "no alarm"]
    assert [duration_text(wait) for wait in waits] == said


def test_only_html_is_not_escaped():
    inner = element("b", "<&>")
    assert inner == "<b>&lt;&amp;&gt;</b>"
    assert element("p", inner, "<", title='"') == '<p title="&quot;"><b>&lt;&amp;&gt;</b>&lt;</p>'
    assert isinstance(inner, Html)


def finding(severities, rates, n_records=200, false_alarms=np.nan):
    """The finding for one family with given rates, with Wald bounds."""
    error = 2 * np.sqrt(np.multiply(rates, np.subtract(1, rates)) / n_records)
    common = {"detector": "one", "source": SIMULATED, "error": ""}
    rows = common | {
        "family": "deck",
        "severity": severities,
        "measure": "POD",
        "rate": rates,
        "ci_low": np.clip(rates - error, 0, 1),
        "ci_high": np.clip(rates + error, 0, 1),
        "n_effective": n_records,
    }
    healthy = common | {"measure": "PFA", "rate": false_alarms, "ci_high": false_alarms + 0.01}
    study = DetectabilityStudy(None, None, [])
    study.findings_ = StudyFindings(pd.concat([pd.DataFrame([healthy]), pd.DataFrame(rows)], ignore_index=True))
    return findings_of(study)


def said(found, macro, *args):
    """What the page on a study says of a finding."""
    return str(getattr(environment_of().get_template("findings.html.j2").module, macro)(found, *args))


@pytest.mark.parametrize(
    ("severities", "rates", "smallest", "bounds", "remark"),
    [
        ([0.3, 0.1, 0.2], [0.99, 0.3, 0.88], "damage of 30 %", "20 % to 30 %", ""),
        ([0.1, 0.2, 0.3], [0.02, 0.1, 0.4], "none up to damage of 30 %", "above 30 %", ""),
        ([0.1, 0.2, 0.3], [0.0, 1.0, 1.0], "damage of 20 %", "20 %", "no severity between 10 % and 20 % was tested"),
        ([0.2], [0.95], "damage of 20 %; less was not tested", "20 %", "one severity"),
        ([-0.1, -0.2, -0.4], [0.2, 0.7, 0.96], "strengthening of 40 %", "40 %", ""),
        ([0.1, 0.2, 0.3], [0.5, 0.4, 0.3], "none up to damage of 30 %", "above 30 %", "does not increase"),
        ([0.1, 0.2, 0.3], [0.3, 0.88, 0.99], "damage of 30 %", "20 % to 30 %", ""),
    ],
)
def test_smallest_severities_their_bounds_and_doubts(severities, rates, smallest, bounds, remark):
    (found,) = finding(severities, rates)
    cells = [said(found, name).replace("\xa0", " ") for name in ("smallest_change", "bounds", "remark")]
    assert cells[:2] == [smallest, bounds]
    assert remark in cells[2]
    assert bool(remark) == bool(cells[2])


def test_severities_on_the_curve_are_not_extrapolated():
    (found,) = finding([0.1, 0.2, 0.3], [0.3, 0.88, 0.99])
    numbers = [float(said(found, "on_curve", place).removesuffix("\xa0%")) for place in (0, 1)]
    assert numbers == pytest.approx([100 * found.curve.a90, 100 * found.curve.a90_95], abs=0.06)
    (beyond,) = finding([0.1, 0.2, 0.3], [0.02, 0.1, 0.4])
    assert beyond.curve.a90 > 0.3
    assert said(beyond, "on_curve", 0) == "more than 30\xa0%"
    (below,) = finding([0.2, 0.3], [0.93, 0.99])
    assert said(below, "on_curve", 0) == "less than 20\xa0%"


def test_a_curve_beside_its_points_is_doubtful_and_one_without_detections_is_not_drawn():
    (found,) = finding([0.02, 0.05, 0.1, 0.3], [0.05, 0.6, 0.65, 0.97], 2000)
    assert found.curve.n_missed == 2
    assert "2 of 4" in said(found, "remark")
    (blind,) = finding([0.1, 0.2, 0.3], [0.0, 0.01, 0.02], false_alarms=0.01)
    assert blind.curve is None
    assert "as rare as" in said(blind, "remark")
    assert finding([0.1, 0.2, 0.3], [0.01, 0.01, 0.3], false_alarms=0.01)[0].curve is not None
    assert finding([-0.1, 0.1], [0.5, 0.95]) == []  # damage and strengthening in one family
