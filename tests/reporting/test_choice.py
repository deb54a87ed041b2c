"""The report on a study of several alarm systems: which one is recommended, and what is not certain."""

import re

import pytest
from sklearn.mixture import GaussianMixture

from skthermo.detection import MahalanobisDetector, OutlierDetector
from skthermo.reporting import owner_report
from skthermo.studies import DetectabilityStudy, sweep
from tests.reporting.pages import HOSTILE, QUOTED, Page, fitted_chain

plt = pytest.importorskip("matplotlib.pyplot")
plt.switch_backend("Agg")

pytestmark = pytest.mark.filterwarnings("ignore:.*few-records")
LOUD, FAILING = "loud, 40 %", "too many components"


@pytest.fixture(scope="module")
def study():
    fem, T, _ = fitted_chain()
    detectors = {
        LOUD: MahalanobisDetector(contamination=0.4),
        QUOTED: MahalanobisDetector(contamination=0.05),
        FAILING: OutlierDetector(GaussianMixture(1000)),
        HOSTILE: MahalanobisDetector(contamination=0.02, threshold="quantile"),
    }
    study = DetectabilityStudy(
        fem, detectors, sweep(fem, (0.1, 0.2), [HOSTILE]), n_repeats=2, random_state=0, uncertainty="noise"
    )
    study.run(T)
    return study


def page_of(study, path, **options):
    return Page(owner_report(study, path / "bridge.html", **options).read_text(encoding="utf-8"))


@pytest.mark.nightly
def test_the_first_of_the_ranking_is_recommended_and_reported(study, tmp_path):
    page = page_of(study, tmp_path, max_false_alarms=0.1)
    ranking = study.ranking(0.1)
    best = ranking.index[0]
    assert best in (HOSTILE, QUOTED)
    assert f"Recommended is \N{LEFT DOUBLE QUOTATION MARK}{best}\N{RIGHT DOUBLE QUOTATION MARK}, with" in page.text
    assert all(line in page.text for line in study.summary(0.1).splitlines()[:2])
    assert "as was asked for" not in page.text
    assert "4\N{NO-BREAK SPACE}alarm systems were tested" in page.text
    assert [tag["id"] for tag in page.all("section")][:2] == ["answer", "choice"]
    assert all(name in page.heads for name in ranking.index)
    other = page_of(study, tmp_path, max_false_alarms=0.1, detector=LOUD)
    assert f"This report is on \N{LEFT DOUBLE QUOTATION MARK}{LOUD}" in other.text
    false_alarms = study.results_.set_index(["detector", "scenario"]).loc[(LOUD, "healthy"), "rate"]
    said = re.search(r"Of the records of the healthy structure \(healthy\), ([\d.]+)\xa0% raise an alarm", other.text)
    assert float(said[1]) == pytest.approx(100 * false_alarms, rel=0.05)


def test_detectors_that_are_not_there_are_named(study, tmp_path):
    with pytest.raises(ValueError, match="detector is 'other'; expected the name of one of"):
        owner_report(study, tmp_path / "bridge.html", detector="other")
    with pytest.raises(ValueError, match=f"detector is '{FAILING}'"):
        owner_report(study, tmp_path / "bridge.html", detector=FAILING)
