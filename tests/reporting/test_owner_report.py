"""The report for owners: a sound page that says what the study found, whatever names the data have."""

import copy
import re
from importlib.resources import files

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.exceptions import NotFittedError

from skthermo.datasets import truss_structure
from skthermo.preprocessing import LagFeatures
from skthermo.reporting import owner_report
from skthermo.studies import DetectabilityStudy, ProgressiveDamage, Scenario, UncertainDamage, sweep
from tests.reporting.monitors import FakeMonitor
from tests.reporting.pages import (
    HOSTILE,
    MODES,
    QUOTED,
    SENSOR,
    Page,
    assert_sound,
    fitted_chain,
    page_text,
    run_study,
    section_of,
    section_text,
    sections_in,
)
from tests.studies.identified import identified

plt = pytest.importorskip("matplotlib.pyplot")
plt.switch_backend("Agg")

pytestmark = [pytest.mark.filterwarnings("ignore:.*few-records")]
STYLE = files("skthermo.reporting").joinpath("page.css").read_text(encoding="utf-8")
SOMETIMES = "choice"  # the section on several detectors
ALWAYS = [name for name in sections_in("study.html.j2") if name != SOMETIMES]


@pytest.fixture(scope="module")
def chain():
    return fitted_chain()


@pytest.fixture(scope="module")
def study(chain):
    fem, T, _ = chain
    scenarios = [
        *sweep(fem, (0.05, 0.1, 0.2), [HOSTILE]),
        ProgressiveDamage(f"growing {HOSTILE}", {HOSTILE: 0.2}, onset=40, end=80),
        UncertainDamage("uncertain", pd.DataFrame({QUOTED: [0.1, 0.2]})),
        Scenario("retrofit", mass=[1.0, 0.0, 0.0]),
    ]
    return run_study(fem, T, scenarios)


EXPLANATIONS = {
    HOSTILE: (0.9, {HOSTILE: (0.2, 0.012)}),
    f"{HOSTILE} + {QUOTED}": (0.08, {HOSTILE: (0.15, 0.02), QUOTED: (0.03, 0.02)}),
    "no damage": (0.0001, {}),
}


@pytest.fixture(scope="module")
def found():
    return identified(EXPLANATIONS)


@pytest.fixture(scope="module")
def file(study, found, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "bridge.html"
    assert owner_report(study, path, identified=found, title=HOSTILE, structure=truss_structure()) == path
    return path


@pytest.fixture(scope="module")
def page(file):
    return Page(file.read_text(encoding="utf-8"))


def identified_in(*args, **options):
    return section_of(page_text(FakeMonitor(), identified=identified(*args, **options)), "identified")


def test_it_is_one_sound_page_without_network(page):
    assert page.all("html") == [{"lang": "en"}]
    assert_sound(page, [*ALWAYS[:-1], "identified", "settings"])
    assert not re.search(r"url\(|@import|https?:", STYLE)


def test_drawings_have_their_tables(page, study):
    tables = page.tables()
    detected = tables[f"detection_of_{HOSTILE}.csv"]
    rows = study.results_[(study.results_["family"] == HOSTILE) & (study.results_["severity"] > 0)]
    assert detected["detected, observed (%)"].to_numpy() == pytest.approx(100 * rows["rate"].to_numpy(), rel=1e-4)
    measured = tables[f"frequency_{MODES[1]}_over_time.csv"]
    assert len(measured) == 120
    assert list(measured) == ["date", f"{MODES[1]} (Hz)"]
    assert measured.iloc[:, 1].isna().sum() == 4
    assert (
        len(tables) - 1 == len(page.all("output")) == len(page.all("img")) - 2
    )  # of the structure and the identification


def test_names_of_data_are_text_and_nothing_else(page, study, file):
    for name in (HOSTILE, QUOTED, SENSOR, *MODES, *study.results_["scenario"]):
        assert name in page.text
    assert not [tag for tag in page.all("img") if "onerror" in tag or tag["src"] == "x"]
    assert "<title>&lt;script&gt;" in file.read_text(encoding="utf-8")
    tags = {element.tag.split("}")[-1] for drawing in page.drawings() for element in drawing.iter()}
    assert "path" in tags
    assert "script" not in tags


def test_the_page_says_what_the_table_says(page, study):
    limits = study.minimum_detectable_damage()["mdd"].xs("simulated", level="source")
    for family, limit in limits.items():
        cell = page.cells[page.cells.index(next(c for c in page.cells if c.startswith(("damage of", "none up to"))))]
        assert family in page.heads
        assert cell.startswith(f"damage of {100 * limit:g}\xa0%" if limit > 0 else "none up to")
    false_alarms = study.results_.loc[0, "rate"]
    said = re.search(r"Of the records of the healthy structure \(healthy\), ([\d.]+)\xa0% raise an alarm", page.text)
    assert float(said[1]) == pytest.approx(100 * false_alarms, rel=0.05)
    missed = (study.results_["measure"] == "POD") & (study.results_["rate"] < 0.9)
    assert f"{missed.sum()} would not be detected reliably" in page.text
    assert "3.3\xa0%" in page.text  # 4 of 120 records lack the second mode


def test_identified_damage_is_said_first_and_in_full(page):
    said = (
        f"Most probable: a loss of 20\xa0% of stiffness in {HOSTILE} (90\xa0% interval 18\xa0% to 22\xa0%), probability"
    )
    assert page.text.count(said) == 1
    assert page.text.index(said) < page.text.index("False alarms")
    assert f"Less probable: {HOSTILE} 15\xa0%, {QUOTED} " in page.text


def test_groups_that_are_not_seen_have_no_amount():
    page = identified_in(EXPLANATIONS, groups=[HOSTILE, QUOTED, "piers"], unobservable=["piers"])
    assert "piers" in page.heads
    assert page.cells.count("unobservable") == 1
    assert "The measured modes show and distinguish all groups." in identified_in(EXPLANATIONS).text


def test_what_damage_does_not_explain_heads_the_page_and_is_among_the_warnings(study):
    nothing = identified({"something else": (0.93, {}), "no damage": (0.07, {})}, groups=[HOSTILE, QUOTED])
    page = Page(page_text(study, identified=nothing))
    headline = page.text[page.text.index("The structure as it is now") : page.text.index("False alarms")]
    assert "Most probable: something else, probability 93\xa0%." in headline
    assert "Identified damage: the causes that were sought do not" in page.text[page.text.rindex("Warnings") :]


@pytest.mark.filterwarnings("ignore:.*different-rows")  # north_lag3 stands alone
def test_lags_are_no_sensors():
    fem, T, F = fitted_chain()
    lagged = pd.concat([LagFeatures([0, 6]).fit_transform(T), (0.9 * T).rename(columns={SENSOR: "deck"})], axis=1)
    lagged["deck_lag2"], lagged["north_lag3"] = T[SENSOR].shift(2).bfill(), T[SENSOR].shift(3).bfill()
    study = run_study(clone(fem).fit(lagged, F), lagged, [Scenario("healthy")])
    page = section_of(page_text(study), "monitored")
    assert "with 3\xa0temperatures, with lags, and 3\xa0natural frequencies each" in page.text
    sensors = page.heads[page.heads.index("Sensor") :]
    assert [sensor for sensor in sensors if "deck" in sensor or "north" in sensor or SENSOR in sensor] == [
        f"{SENSOR}, with 1\xa0lag",
        "deck, with 1\xa0lag",
        "north_lag3",
    ]


def test_arrays_one_severity_reference_and_no_healthy_scenario():
    fem, T, _ = fitted_chain(index=False)
    scenarios = [Scenario("one", {HOSTILE: 0.2})]
    truth = fem.simulate(T, damage={HOSTILE: 0.2}, noise=0.005, random_state=5)
    study = run_study(fem, T, scenarios, reference={"one": truth})
    study.thresholds_ = dict.fromkeys(study.thresholds_)  # as of some detectors
    page = Page(page_text(study))
    assert "how often alarms are false is not known" in page.text
    assert "one severity was tested" in page.text
    assert "In 1\xa0scenario, the simulations were compared with reference records" in page.text
    assert "What the alarm system sees" not in page.text
    assert [tag["id"] for tag in page.all("section")] == ALWAYS


def test_studies_without_a_family_that_has_a_smallest_damage(chain):
    text = section_of(page_text(run_study(*chain[:2], [Scenario("healthy")])), "answer").text
    assert "No damage was tested." in text
    assert "there is no smallest damage to report" in text
    study = run_study(*chain[:2], [Scenario(f"part {severity}", {HOSTILE: severity}) for severity in (-0.1, 0.2)])
    text = page_text(study)
    assert all("were tested together" in section_of(text, part).text for part in ("answer", "found"))


@pytest.mark.filterwarnings("ignore:.*many-false-alarms")
def test_warnings_of_the_simulations_are_in_it(chain):
    fem, T, _ = chain
    with pytest.warns(UserWarning, match="(outside-bounds|other-weather)") as caught:
        study = run_study(fem, T + 60, [Scenario("healthy")])
    texts = [str(warning.message) for warning in caught]
    assert study.warnings_ == [text for text in texts if "few-records" not in text]
    text = Page(page_text(study)).text
    assert all(warning in text for warning in study.warnings_)
    assert "There was no warning" not in text


@pytest.mark.nightly
def test_drawings_do_not_depend_on_the_users_style_and_none_stays_open(page, found):
    opened = plt.figure()
    with plt.style.context("dark_background"):
        again = section_of(page_text(FakeMonitor(), is_drawn=True, identified=found), "identified").values("src")
    assert plt.get_fignums() == [opened.number]
    plt.close(opened)
    assert again == page.values("src")[-1:]


@pytest.mark.nightly
def test_control_characters_in_names_are_seen_and_harm_nothing():
    names = ["a\x00b", "line\nbreak \x1b[31m\u202e", "\x07bell"]
    explanations = {name: (0.33, {name: (0.2, 0.01)}) for name in names}
    found = identified(explanations, unobservable=names[2:])
    whole = page_text(FakeMonitor(), is_drawn=True, identified=found, title="\ud800")
    assert r"<h1>\ud800</h1>" in whole
    text = section_text(whole, "identified")
    page = Page(text)
    for seen in (r"a\x00b", r"line break \x1b[31m\u202e", r"\x07bell"):
        assert seen in page.text
    assert page.drawings()
    assert not [letter for letter in text if letter != "\n" and not letter.isprintable() and letter != "\xa0"]
    whole.encode("utf-8")


def test_records_that_cannot_be_evaluated_are_counted_and_not_called_healthy(page, study):
    assert "The alarm system evaluated every simulated record." in page.text
    partly = copy.copy(study)
    partly.indices_ = {key: index.where(np.arange(len(index)) >= 30) for key, index in study.indices_.items()}
    page = page_text(partly)
    text = section_of(page, "answer").text
    n_states = len(study.results_)
    assert f"could not evaluate {30 * n_states:,} of {120 * n_states:,}\xa0records of the first simulation" in text
    assert "They count neither as healthy nor as alarms" in text
    assert section_of(page, "found").text.count("(25\xa0% not evaluated)") == n_states


@pytest.mark.parametrize("number", [0, 1], ids=["light", "dark"])
def test_text_has_enough_contrast(number):
    """Contrast of at least 4.5, as WCAG 2 asks of text at level AA."""
    colours = dict(re.findall(r"--(\w+): (#\w{6})", STYLE.split("@media")[number]))
    for text in ("text", "soft", "accent", "healthy", "alarm", "unknown"):
        for ground in ("page", "card"):
            assert contrast(colours[text], colours[ground]) >= 4.5
    assert contrast(colours["text"], colours["bar"]) >= 4.5


def contrast(*both):
    darker, lighter = sorted(luminance(colour) for colour in both)
    return (lighter + 0.05) / (darker + 0.05)


def luminance(colour):
    channels = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255
    linear = np.where(channels <= 0.04045, channels / 12.92, ((channels + 0.055) / 1.055) ** 2.4)
    return linear @ [0.2126, 0.7152, 0.0722]


@pytest.mark.parametrize(
    ("place", "options", "message"),
    [
        ("missing/a.html", {}, "expected a file in a folder"),
        (".", {}, "expected a file in a folder"),
        ("a.html", {"now": "2024-01-01"}, "now given for a DetectabilityStudy"),
        ("a.html", {"settings": "river"}, "settings given for a DetectabilityStudy"),
    ],
)
def test_what_does_not_fit_is_named(study, tmp_path, place, options, message):
    with pytest.raises(ValueError, match=message):
        owner_report(study, tmp_path / place, **options)
    with pytest.raises(ValueError, match="subject is 'study'"):
        owner_report("study", tmp_path / "a.html")
    with pytest.raises(NotFittedError, match="run"):
        owner_report(DetectabilityStudy(None, None, []), tmp_path / "a.html")
