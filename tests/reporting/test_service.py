"""The page on a monitor: it never calls healthy what nobody has evaluated, and says what the monitor says."""

import copy
import functools
import re
from collections import Counter
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.exceptions import NotFittedError

from skthermo.datasets import truss_structure
from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.reporting import owner_report
from skthermo.reporting.answers import opened_since
from tests.monitoring.nightly import FIRST, truss_records
from tests.reporting.monitors import FakeMonitor, event_row, smallest_changes
from tests.reporting.pages import HOSTILE, QUOTED, Page, assert_sound, page_text, section_of, sections_in

plt = pytest.importorskip("matplotlib.pyplot")
plt.switch_backend("Agg")

SPACE = "\xa0"


def page_of(monitor, now=None, limit=0.1):
    """The page on a monitor five hours after its newest record, unless another time is given, as text."""
    now = monitor.last_ + pd.Timedelta("5h") if now is None else now
    return page_text(monitor, now=now, drift_limit=limit)


@functools.cache
def usual_page():
    """The page on a healthy monitor."""
    return page_of(FakeMonitor())


def part_of(monitor, anchor, now=None):
    return section_of(page_of(monitor, now=now), anchor)


def today_of(monitor, now=None):
    return part_of(monitor, "today", now)


def headline(page):
    """The large line of the first section."""
    return page.paragraphs[0]


def state_of(page):
    (names,) = [a["class"].split() for a in page.all("div") if a.get("class", "").startswith("state ")]
    return names[1]


@pytest.fixture(scope="module")
def real(truss_monitor):
    """The truss in service, with gaps in the records and damage at the end, and as it was fitted."""
    monitor, new = copy.deepcopy(truss_monitor), truss_records()[FIRST : FIRST + 70]
    new.iloc[10:14] = np.nan
    with pytest.warns(UserWarning, match="6 of 66"):
        monitor.update(new.drop(new.index[20:24]))
    return monitor, truss_monitor


@pytest.fixture(scope="module")
def page(real, tmp_path_factory):
    path, now = tmp_path_factory.mktemp("page") / "a.html", real[0].last_ + pd.Timedelta("5h")
    return Page(owner_report(real[0], path, title=HOSTILE, now=now).read_text(encoding="utf-8"))


def test_it_is_one_sound_page_whose_drawings_have_their_tables(page, real):
    sections = sections_in("monitor.html.j2")
    assert sections[:2] == ["today", "events"]
    assert_sound(page, sections)
    assert len(page.drawings()) == 2  # the last month and the last year
    monitor, _ = real
    month, year = page.tables().values()
    assert year["highest of the day"].to_numpy() == pytest.approx(
        monitor.days_["index_max"].to_numpy(), rel=1e-5, nan_ok=True
    )
    evaluated = monitor.evaluations_[monitor.evaluations_.index >= monitor.last_ - pd.Timedelta("31D")]
    assert month["index"].to_numpy() == pytest.approx(evaluated["index"].to_numpy(), rel=1e-5, nan_ok=True)
    assert month["date"].iloc[-1] == f"{monitor.last_:%Y-%m-%d}"
    places = [[float(place) for place in places.split()] for places in page.values("data-x")]
    assert [len(one) for one in places] == [len(month), len(year)]
    assert all((np.diff(one) > 0).all() and one[0] > 0 and one[-1] < 1000 for one in places)


def test_it_says_what_the_real_monitor_says(page, real):
    monitor, _ = real
    assert monitor.status(monitor.last_).state == state_of(page) == "alarm"
    event = monitor.events_.iloc[-1]
    start = event["start"]
    assert f": alarm since {start.day}{SPACE}{start.month_name()}{SPACE}{start.year}" in page.text
    first, *_, last = event["modes"].split(", ")
    assert re.search(f"{first} is .* and {last} .* lower", page.text)
    assert "monitor.acknowledge(" in page.text
    assert f"Of 66{SPACE}records in service, 6 (9.1{SPACE}%) were not evaluated" in page.text
    assert f"There was no record on 4 of 70{SPACE}days." in page.text
    indices = monitor.evaluations_.loc[:, "index"].nlargest(3)
    assert event["peak"] == indices.iloc[2] < indices.iloc[0]  # the level of an event is not the highest index
    assert "Index reached by 3 of 5 records" in page.text
    numbers = [head for head in page.heads if head.isdigit()]
    assert numbers == [str(number) for number in monitor.events_.index[::-1]]


def test_a_monitor_that_has_evaluated_nothing_is_not_called_healthy(real, tmp_path):
    file = owner_report(real[1], tmp_path / "a.html", now=real[1].last_)
    page = Page(file.read_text(encoding="utf-8"))
    assert state_of(page) == "not-evaluated"
    assert "Not evaluated, no record since the baseline" in page.text
    assert "Check the data logger" in page.text
    assert not page.all("img")


def test_healthy_only_as_long_as_records_come():
    monitor = FakeMonitor()
    for wait, state in {"2D": "healthy", "73h": "not-evaluated", "40D": "not-evaluated"}.items():
        page = today_of(monitor, monitor.last_ + pd.Timedelta(wait))
        assert state_of(page) == state
        assert ("Healthy" in headline(page)) == (state == "healthy")
    assert "is 40 days old" in page.text


def test_an_alarm_stays_one_without_records_and_says_so():
    monitor = FakeMonitor(events=[event_row("2025-06-10", None, modes="f2, f1")])
    page = today_of(monitor, monitor.last_ + pd.Timedelta("40D"))
    assert state_of(page) == "alarm"
    assert f"Alarm since 10{SPACE}June{SPACE}2025" in page.text
    assert "most changed: f2 and f1" in page.text
    assert "so that nothing is known of the days since" in page.text


@pytest.mark.parametrize("n_not_evaluated", [3, None], ids=["some", "all"])
def test_what_is_not_evaluated_says_since_when_and_why(n_not_evaluated):
    reason = f"all of {QUOTED} are missing"
    monitor = FakeMonitor(n_not_evaluated=n_not_evaluated, reason=reason)
    monitor.set_aside_ = monitor.set_aside_[:0]
    text = page_of(monitor)
    page = section_of(text, "today")
    assert state_of(page) == "not-evaluated"
    since = monitor.evaluations_.index[-4] if n_not_evaluated else monitor.baseline_.index[-1]
    assert headline(page) == f"Not evaluated since {since.day}{SPACE}{since.month_name()}{SPACE}{since.year}"
    assert f"{reason[1:]}." in page.text
    number = int(monitor.counts_["n_not_evaluated"])
    page = section_of(text, "not_evaluated")
    assert f"{number:,} ({100 if number == 180 else 1.7}{SPACE}%) were not evaluated" in page.text
    assert [page.heads[2], page.heads[-1]] == [reason, "Records that came again, and were counted once"]
    assert page.cells == [str(number), "2"]


def test_records_that_were_evaluated_with_a_remark_are_counted():
    monitor = FakeMonitor()
    before = Counter(re.findall(r"\d+", section_of(usual_page(), "today").text))
    month = monitor.evaluations_.index > monitor.last_ - pd.Timedelta("31D")
    rows = monitor.evaluations_.index[month & (monitor.evaluations_["state"] != "not evaluated")][3:10]
    monitor.evaluations_.loc[rows, "reason"] = "no temperature has a value"
    text = page_of(monitor)
    assert Counter(re.findall(r"\d+", section_of(text, "today").text)) - before == {str(len(rows)): 1}
    assert str(len(rows)) in section_of(text, "not_evaluated").cells


def test_a_new_baseline_after_a_change_of_the_structure_is_said():
    monitor = FakeMonitor()
    assert "The structure was changed" not in usual_page()
    monitor.since_ = pd.Timestamp("2024-12-20")
    text = Page(page_of(monitor)).text
    assert f"as it is since 20{SPACE}December{SPACE}2024, it counts as healthy" in text


def test_values_of_the_baseline_that_were_set_aside_are_listed():
    page = section_of(usual_page(), "not_evaluated")
    assert "'T <1>' is 484.667 °C in 31 of 365 rows" in page.text


def test_a_response_that_was_set_aside_is_named_and_what_to_do():
    event = event_row("2025-06-20", None, kind="fault", modes="f2")
    monitor = FakeMonitor(events=[event], n_not_evaluated=9, reason="f2 is left out (implausible since 2025-06-20)")
    text = page_of(monitor)
    assert state_of(section_of(text, "today")) == "alarm"
    assert "A sensor or the structure has changed" in section_of(text, "today").text
    assert "a sensor failed" in section_of(text, "events").text


def test_a_watch_is_neither_an_alarm_nor_healthy_and_needs_no_explanation():
    ended, opened = (
        event_row(start, end, kind="watch") for start, end in (("2025-03-01", "2025-03-03"), ("2025-06-25", None))
    )
    monitor = FakeMonitor(events=[ended, opened], watch_per_year=12)
    text = page_of(monitor)
    page = section_of(text, "today")
    assert state_of(page) == "watch"
    assert headline(page) == f"Watch since 25{SPACE}June{SPACE}2025, no alarm"
    assert "12 such events a year" in page.text
    assert "nobody has said" not in page.text
    assert "acknowledge" not in page.text
    page = section_of(text, "false_alarms")
    assert [page.heads[3], page.cells[1]] == ["Level above which a watch begins", "2.500"]
    assert state_of(today_of(monitor, monitor.last_ + pd.Timedelta("9D"))) == "not-evaluated"
    both = FakeMonitor(events=[opened, event_row("2025-06-26", None)], watch_per_year=12)
    assert state_of(today_of(both)) == "alarm"


def test_a_slow_change_and_a_known_damage_have_states_of_their_own():
    slow = event_row("2025-06-10", None, kind="drift", modes="f2")
    monitor = FakeMonitor(events=[slow])
    page = Page(page_text(monitor, title="River", settings="river", now=monitor.last_))
    assert state_of(page) == "drift"
    assert f"River: a slow change since 10{SPACE}June{SPACE}2025" in page.text
    assert 'skthermo acknowledge river 1 --damage --note "what was found"' in page.text
    known = event_row("2025-06-10", "2025-06-12", acknowledged=True, note="scour")
    monitor = FakeMonitor(events=[known])
    monitor.evaluations_["state"] = "known damage"
    page = today_of(monitor)
    assert (state_of(page), headline(page)) == (
        "known-damage",
        f"Known damage since 10{SPACE}June{SPACE}2025, nothing new",
    )
    assert "(scour)" in page.text


def monitor_of_shifts(event, rest):
    """A monitor with an open event, of whose records these are the residuals; above 1 %, f1 is in alarm."""
    monitor = FakeMonitor(events=[event])
    monitor.corrected_ = monitor.records_ = monitor.means_ = rest
    monitor.features_ = monitor.targets_ = list(rest)
    monitor.detector_ = SimpleNamespace(residuals=lambda records: rest.loc[records.index])
    high = rest.index[rest.iloc[:, 0].abs() > 0.01]
    monitor.evaluations_.loc[high, "index"] = 4.0
    return monitor


def test_how_far_modes_fell_is_said_in_percent_without_units_of_columns():
    stamps = pd.date_range("2025-05-01", "2025-06-29", freq="1D")
    rest = pd.DataFrame({"f1 [Hz]": -0.021, "f2": 0.004, "f3": -0.03}, stamps)
    rest[:"2025-06-09"] = 0.0
    monitor = monitor_of_shifts(event_row("2025-06-10", None, modes="f1 [Hz], f2"), rest)
    text = f"f1 is 2.1{SPACE}% lower and f2 0.40{SPACE}% higher than in the healthy structure in the same weather."
    assert text in today_of(monitor).text


def test_a_change_is_of_the_records_that_made_its_event():
    stamps = pd.date_range("2025-05-01", "2025-06-29", freq="1D")
    in_frost = np.arange(len(stamps)) % 3 == 0
    rest = pd.DataFrame({"f1": np.where(in_frost, -0.02, 0.001), "f2": 0.0}, stamps)
    damage = monitor_of_shifts(event_row("2025-05-01", None, modes="f1"), rest)
    assert f"f1 is 2.0{SPACE}% lower than" in today_of(damage).text
    rest = pd.DataFrame({"f1": -0.003, "f2": 0.0}, stamps)
    rest.iloc[-1] = 0.009  # the day on which the mean of 30 days shows it
    drift = monitor_of_shifts(event_row("2025-06-29", None, kind="drift", modes="f1"), rest)
    assert f"f1 is 0.26{SPACE}% lower than" in today_of(drift).text
    assert opened_since(damage) == pd.Timestamp("2025-05-01")
    assert opened_since(drift) == pd.Timestamp("2025-05-30")  # what explains a drift is sought in the same records


def test_regimes_are_said_where_there_are_some():
    monitor = FakeMonitor()
    assert "detectors of their own" not in page_of(monitor)
    monitor.detector_ = SimpleNamespace(regime_=("T1", 3.671))
    text = Page(page_of(monitor)).text
    assert f"Records up to 3.671 {monitor.units_['T1']} of 'T1' and above it are evaluated by detectors of" in text


def test_the_smallest_change_that_would_be_seen_is_said():
    text = "A fall of all responses by 1 %, or of one response alone by 2 % (f1) to 3 % (f2) raises an alarm"
    assert text in section_of(usual_page(), "today").text
    page = section_of(usual_page(), "detectable")
    falls = dict(zip(page.heads[-3:], page.cells[-3:], strict=True))
    assert falls == {"all responses by one share": f"1{SPACE}%", "f1 alone": f"2{SPACE}%", "f2 alone": f"3{SPACE}%"}
    monitor = FakeMonitor()
    monitor.smallest_changes_ = smallest_changes(np.nan, {"f1": 0.5, "f2": np.nan}, False)
    page = part_of(monitor, "detectable")
    assert page.cells[-2:] == [f"0.50{SPACE}Hz", "none is seen"]


def test_losses_that_raise_an_alarm_are_listed_and_drawn_on_the_structure():
    monitor = FakeMonitor()
    monitor.smallest_changes_ = smallest_changes(0.01, {"f1": 0.02}, True, {"top": 0.04, "bottom": np.nan})
    text = page_of(monitor)
    assert "a loss of stiffness by 4 % (top)" in section_of(text, "today").text
    drawn = page_text(monitor, is_drawn=True, structure=truss_structure(), now=monitor.last_)
    for page in (section_of(text, "detectable"), section_of(drawn, "detectable")):
        losses = dict(zip(page.heads[-2:], page.cells[-2:], strict=True))
        assert losses == {"loss of stiffness of top": f"4{SPACE}%", "loss of stiffness of bottom": "none is seen"}
    assert len(page.all("img")) == 1


def test_parts_that_explain_an_event_are_where_an_engineer_looks_first():
    event = event_row("2025-06-20", None, groups="top, bottom or diagonal")
    text = page_of(FakeMonitor(events=[event]))
    today = section_of(text, "today")
    assert "A loss of stiffness in top, bottom or diagonal explains most of it." in today.text
    assert "beginning with top, bottom or diagonal," in today.text
    assert "top, bottom or diagonal" in section_of(text, "events").cells


def test_events_that_nobody_has_explained_are_named():
    ended = [event_row(f"2025-0{month}-01", f"2025-0{month}-03") for month in (3, 4)]
    known = event_row("2025-05-01", "2025-05-04", acknowledged=True, harmless=True, note=HOSTILE)
    text = page_of(FakeMonitor(events=[*ended, known]))
    said = f"2{SPACE}events ended, and nobody has said yet what they were: 1 and 2."
    assert said in section_of(text, "today").text
    page = section_of(text, "events")
    assert [cell for cell in page.cells if cell in ("yes, harmless", "not yet")] == [
        "yes, harmless",
        "not yet",
        "not yet",
    ]
    assert HOSTILE in page.text
    page = part_of(FakeMonitor(events=[ended[0]] * 40), "events")
    assert [head for head in page.heads if head.isdigit()] == [str(number) for number in range(40, 10, -1)]


def test_drift_says_how_fast_and_when_a_limit_is_reached():
    found = pd.DataFrame(
        {
            "change": [-0.02, 0.001],
            "standard_error": [0.002, 0.002],
            "per_year": [-0.01, 0.0],
            "per_year_error": [0.001, 0.002],
            "significant": [True, False],
            "p_value": 0.001,
        },
        ["deck", "piers"],
    )
    monitor = FakeMonitor(drift=found)
    page = section_of(page_of(monitor), "drift")
    years = {rate: f"{monitor.last_ + pd.Timedelta(days=365.25 * 0.08 / rate):%Y}" for rate in (0.01, 0.012, 0.008)}
    assert page.cells[:4] == [
        *(f"-2.00{SPACE}% ±{SPACE}0.40{SPACE}%", f"-1.00{SPACE}% ±{SPACE}0.20{SPACE}%", "yes"),
        f"in about {years[0.01]} ({years[0.012]} to {years[0.008]})",
    ]
    assert page.cells[6] == "no"
    assert len(page.tables()) == 1

    def reached(limit=0.1, **changed):
        return section_of(page_of(FakeMonitor(drift=found.assign(**changed)), limit=limit), "drift").cells[3]

    assert reached(limit=0.015) == "has been reached"
    assert reached(per_year_error=0.01).endswith("at the earliest)")
    assert reached(per_year=-1e-4) == "in more than 100 years"
    assert "No slow change of stiffness is certain" in page_of(FakeMonitor(drift=found.assign(significant=False)))


@pytest.mark.parametrize("significant", [True, False])
def test_no_structure_is_healthy_that_has_lost_much_stiffness_slowly(significant):
    columns = {"change": [-0.12], "standard_error": [0.01], "per_year": [-0.01], "per_year_error": [0.001]}
    drift = pd.DataFrame(columns, ["deck"]).assign(significant=significant, p_value=0.001 if significant else 0.2)
    page = today_of(FakeMonitor(drift=drift))
    assert state_of(page) == ("attention" if significant else "healthy")
    assert (f"deck has lost 10{SPACE}% or more of the stiffness" in page.text) == significant
    if significant:
        page = today_of(FakeMonitor(drift=drift, events=[event_row("2025-06-10", None)]))
        assert state_of(page) == "alarm"


def test_sensors_that_fail_are_named_and_those_that_work_again_are_not_called_failed():
    faults = pd.DataFrame(
        {
            "column": ["T1", "f2", "strain"],
            "kind": ["stuck", "swapped", "left out"],
            "since": pd.to_datetime(["2025-03-01", "2025-04-01", "2025-01-01"]),
            "detected": pd.to_datetime(["2025-03-05", "2025-04-02", "2025-01-01"]),
            "until": pd.to_datetime([None, "2025-05-01", None]),
            "detail": ["repeats 7", "", "'strain' is 12"],
        }
    )
    seen = [event_row("2025-03-03", "2025-03-09", note="cold"), event_row("2025-03-20", "2025-03-21")]
    text = page_of(FakeMonitor(faults=faults, events=seen))
    page = section_of(text, "sensors")
    assert f"2{SPACE}sensors do not work" in page.text
    assert page.heads[-3:] == ["strain", "f2", "T1"]
    assert [page.cells[n] for n in (0, 3, -5, -2, -1)] == [
        *("left out", "it lasts", "repeats one value", "it lasts", "repeats 7")
    ]
    notes = section_of(text, "events").text
    assert notes.count("failed at that time") == notes.count("cold; T1 failed at that time") == 1
    assert "All sensors work." in part_of(FakeMonitor(faults=faults[1:2]), "sensors").text
    assert "Sensors are not watched." in part_of(FakeMonitor(sensors=False), "sensors").text


def test_damage_events_are_counted_beside_the_false_alarms_that_were_to_be_expected():
    seen = [event_row("2025-03-01", "2025-03-02"), event_row("2025-04-01", "2025-04-02", kind="watch")]
    seen += [event_row(f"2025-0{month}-01", f"2025-0{month}-20", kind="drift") for month in (5, 6)]
    monitor = FakeMonitor(events=seen, false_alarms_per_year=2.0)
    text = part_of(monitor, "false_alarms").text
    assert "gives 2 false alarms a year on average" in text
    assert f"1{SPACE}damage event and 2{SPACE}drift events opened, and 0 turned out to be harmless" in text
    years = (monitor.last_ - monitor.days_.index[0]) / pd.Timedelta(days=365.25)
    assert float(re.search(r"about ([\d.]+) false alarms were", text)[1]) == pytest.approx(2 * years, rel=0.05)


def test_time_zones_and_the_clock():
    monitor = FakeMonitor(zone="Europe/Brussels", events=[event_row("2025-06-10", None)])
    assert state_of(today_of(monitor)) == "alarm"
    utc = (monitor.last_ + pd.Timedelta("5h")).tz_convert("UTC")
    assert state_of(today_of(monitor, utc)) == "alarm"
    assert state_of(section_of(page_text(monitor), "today")) == "alarm"  # by the clock, long after
    with pytest.raises(ValueError, match="expected a time without a time zone"):
        today_of(FakeMonitor(), utc)
    early = today_of(FakeMonitor(), FakeMonitor().last_ - pd.Timedelta("3D"))
    assert state_of(early) == "not-evaluated"  # records of a time to come
    assert "the dates of the records are wrong" in early.text


@pytest.mark.nightly
def test_ten_years_of_service_are_a_small_page(tmp_path):
    monitor = FakeMonitor(n_days=3650)
    file = owner_report(monitor, tmp_path / "a.html", now=monitor.last_)
    assert len(Page(file.read_text(encoding="utf-8")).drawings()) == 3
    assert file.stat().st_size < 600_000


def test_what_belongs_to_studies_or_is_not_fitted_is_refused(real, tmp_path):
    with pytest.raises(ValueError, match="detector given for a Monitor"):
        owner_report(real[0], tmp_path / "a.html", detector="raw")
    with pytest.raises(NotFittedError, match="fit"):
        owner_report(Monitor(MahalanobisDetector()), tmp_path / "a.html")
    with pytest.raises(ValueError, match="drift_limit is 10; expected a loss of stiffness between 0 and 1"):
        owner_report(real[0], tmp_path / "a.html", drift_limit=10)
