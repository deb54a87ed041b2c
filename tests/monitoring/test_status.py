"""Status of a monitor and its transitions: plain facts that agree with its tables, at any time, in any batches."""

import copy
import json
from collections import Counter
from dataclasses import fields

import pandas as pd
import pytest

from skthermo.monitoring import load_monitor
from tests.monitoring.nightly import DAMAGED, FIRST, truss_records

SPOILT = slice(FIRST + 5, FIRST + 20)  # records in which a thermometer repeats its value


@pytest.fixture(scope="module")
def records():
    """Records with a thermometer that gets stuck for a while, and damage from some day on."""
    table = truss_records()[: DAMAGED + 60].copy()
    table.iloc[SPOILT, 0] = table.iloc[SPOILT.start, 0]
    return table


@pytest.fixture(scope="module")
def after(truss_monitor, records):
    """With all records, in one batch."""
    monitor = copy.deepcopy(truss_monitor)
    monitor.update(records[FIRST:])
    return monitor


@pytest.mark.nightly
def test_a_status_is_plain_and_says_what_the_tables_say(after):
    status = after.status(after.last_)
    plain = status.as_dict()
    assert json.loads(json.dumps(plain, allow_nan=False)) == plain
    parts = {"records": status.records, "levels": status.levels}
    names = [one.name for part in (status, *parts.values()) for one in fields(part) if one.name not in parts]
    assert sorted(plain) == sorted(names)
    assert status.state == "alarm"
    for part in (str(status.records), str(status.levels), *(f"event {one['event']}:" for one in status.events)):
        assert part in str(status)
    assert f"records: {status.records}" in after.summary()
    assert plain["newest"] == after.last_.isoformat()
    assert status.records.age == pd.Timedelta(0)
    known = after.evaluations_[after.evaluations_["state"] != "not evaluated"]
    assert (status.records.evaluated, status.index) == (known.index[-1], known["index"].iloc[-1])
    is_open = after.events_["end"].isna()
    assert [one["event"] for one in plain["events"]] == after.events_.index[is_open].tolist()
    assert [one["since"] for one in plain["events"]] == [t.isoformat() for t in after.events_.loc[is_open, "start"]]
    assert len(plain["faults"]) == after.faults_["until"].isna().sum()
    assert plain["counts"] == after.counts_


@pytest.mark.one_case
@pytest.mark.parametrize("damaged", [False, True])
def test_silence_is_never_healthy_and_never_ends_an_alarm(monitor, records, damaged):
    assert monitor.status(monitor.last_).state == "not evaluated"  # no record yet
    monitor.update(records[FIRST : DAMAGED + 8 if damaged else FIRST + 3])
    said = "alarm" if damaged else "healthy"
    limit = monitor.status().records.max_age
    for age in (pd.Timedelta("1h"), limit, limit + pd.Timedelta("1s"), pd.Timedelta("700D")):
        status = monitor.status(monitor.last_ + age)
        assert (status.records.age, status.records.is_late) == (age, age > limit)
        assert status.state == ("not evaluated" if status.records.is_late and not damaged else said)
        assert (status.reason != "") or not status.records.is_late
        assert status.at(monitor.last_ + pd.Timedelta("900D")) == monitor.status(monitor.last_ + pd.Timedelta("900D"))
    early = monitor.status(monitor.last_ - pd.Timedelta("3D"))
    assert early.records.is_ahead
    assert early.state == ("alarm" if damaged else "not evaluated")
    assert monitor.status(monitor.last_ + pd.Timedelta("2h"), max_age="1h").records.is_late


def replayed(transitions):
    """Events and faults that are open after some transitions."""
    events, columns = set(), Counter()
    for one in transitions:
        if one["what"] == "opened":
            events.add(one["event"])
        elif one["what"] in ("closed", "withdrawn"):
            events.remove(one["event"])
        elif one["what"] in ("fault", "put back"):
            columns[one["column"]] += 1 if one["what"] == "fault" else -1
    return events, {column for column, number in columns.items() if number}


@pytest.mark.nightly
def test_batches_give_the_transitions_of_one_pass_each_once(monitor, records, after, tmp_path):
    parts, known = [], 0
    for start in range(FIRST, len(records), 25):
        monitor.update(records[start : start + 25])
        parts += monitor.transitions(known)
        known = monitor.status().transition
        monitor.save(tmp_path / "monitor.joblib")
        monitor = load_monitor(tmp_path / "monitor.joblib")
    assert monitor.transitions(known) == []
    assert parts == monitor.transitions()

    def said(transitions):
        return sorted((one["time"], one["what"], one["event"], one["column"]) for one in transitions)

    assert said(parts) == said(after.transitions())


@pytest.mark.filterwarnings("ignore:.*(doubtful-values|undetected-changes|not-evaluated)")
def test_what_an_owner_does_is_a_transition(monitor, records):
    monitor.update(records[DAMAGED - 16 : DAMAGED + 8])
    known = monitor.status().transition
    monitor.acknowledge(1, harmless=True, note="a special transport")
    monitor.refit(force=True)
    found = monitor.transitions(known)
    assert [one["what"] for one in found] == ["acknowledged", "refit"]
    assert found[0]["detail"] == "a special transport"
