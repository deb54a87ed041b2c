"""The report on a study of several alarm systems: which one is recommended, and what is not certain."""

import pytest
from sklearn.mixture import GaussianMixture

from skthermo._core.text import share_text
from skthermo.detection import MahalanobisDetector, OutlierDetector
from skthermo.reporting import owner_report
from skthermo.reporting._choice import Choice
from skthermo.reporting._study import study_facts
from skthermo.studies import DetectabilityStudy, sweep
from tests.reporting.pages import HOSTILE, QUOTED, Page, fitted_chain, section_of, written

plt = pytest.importorskip("matplotlib.pyplot")
plt.switch_backend("Agg")

pytestmark = pytest.mark.filterwarnings("ignore:.*few-baseline-records")
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
        fem, detectors, sweep(fem, (0.1, 0.2), [HOSTILE]), n_repeats=5, random_state=0, uncertainty="noise"
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
    assert f"Of the records of the healthy structure, {share_text(false_alarms)} raise an alarm" in other.text


def test_the_rest_is_that_of_a_study_with_this_detector_alone(study):
    choice = Choice.of(study, LOUD, 0.1)
    alone = DetectabilityStudy(
        study.fem, study.detectors[LOUD], study.scenarios, n_repeats=5, random_state=0, uncertainty="noise"
    )
    alone.run(fitted_chain()[1])
    one = choice.only()
    columns = ["scenario", "source", "rate", "ci_low", "ci_high"]
    assert one.results_[columns].equals(alone.results_[columns])
    assert one.detector_name() == LOUD
    assert {key[0] for key in one.indices_} == {LOUD}
    assert study.results_["detector"].nunique() == 4  # the study itself is as it was


def test_none_is_recommended_if_none_keeps_the_limit(study):
    def facts():
        made = study_facts(study, None, None, None, 0.1)
        made["choice"].ranking["within_limit"] = False
        return made

    assert "None is recommended" in section_of(written("study", facts), "choice").text


def test_detectors_that_are_not_there_are_named(study, tmp_path):
    with pytest.raises(ValueError, match="detector is 'other'; expected the name of one of"):
        owner_report(study, tmp_path / "bridge.html", detector="other")
    with pytest.raises(ValueError, match=f"detector is '{FAILING}'"):
        owner_report(study, tmp_path / "bridge.html", detector=FAILING)
