"""Events of many bridges: and the false discovery rate is the one asked for."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.stats import genpareto, kstest, norm

from skthermo.fleet._discoveries import discover, significant_bridges, tail_shape
from skthermo.monitoring._threshold import Tail

N_PEAKS, RATIO = 60, 0.7


def healthy(random, n=1, common=0.0, is_exponential=False):
    """P values of healthy bridges: squared peaks with an exponential tail, of a baseline and of a time like it.

    The highest new peaks share a normal factor with this correlation.
    """
    p_values = []
    shared = random.normal() if common else 0.0
    for _ in range(n):
        base = np.sort(random.exponential(3.0, random.poisson(N_PEAKS)))[::-1]
        number = random.poisson(RATIO * N_PEAKS)
        z = np.sqrt(common) * shared + np.sqrt(1 - common) * random.normal()
        highest = 3.0 * -np.log(-np.expm1(norm.logcdf(z) / max(number, 1)))  # of so many exponential peaks
        shape = 0.0 if is_exponential else None
        p_values.append(Tail.of(base, 1.0).p_value(highest, RATIO, shape) if number else 1.0)
    return np.array(p_values)


def test_p_values_of_healthy_bridges_are_uniform():
    p = healthy(np.random.default_rng(0), 2000, is_exponential=True)
    assert kstest(p[p < 0.99], "uniform", (0, 0.99)).pvalue > 0.01
    careful = healthy(np.random.default_rng(0), 2000)
    assert (careful >= p).all()
    assert 0.5 < (careful == p).mean() < 0.95


@pytest.mark.parametrize("x", [0.3, 1.0, 3.0])
def test_small_p_values_are_those_of_a_long_simulation(x):
    random, tail, n = np.random.default_rng(1), Tail(10.0, (2.0,) * 4), 400_000
    rate, scale = random.gamma(5, size=n), 8.0 / random.gamma(4, size=n)
    expected = -np.expm1(-2.0 * rate * np.exp(-8.0 * x / scale))
    deviation = expected.std() / np.sqrt(n)
    assert tail.p_value(10.0 + 8.0 * x, 2.0) == pytest.approx(expected.mean(), abs=4 * deviation)


def test_p_values_fall_with_height_and_grow_with_time():
    tail = Tail(10.0, (2.0,) * 20)
    p_values = np.array([[tail.p_value(square, years) for square in (9, 11, 30, 200, 1e4)] for years in (0.1, 1, 10)])
    assert (np.diff(p_values, axis=1) <= 0).all()
    assert (np.diff(p_values[:, 1:], axis=0) > 0).all()
    assert (p_values[:, 0] == 1).all()
    assert 0 < p_values[0, -1] < 1e-20


@pytest.mark.nightly
@pytest.mark.parametrize("common", [0.0, 0.5])
def test_the_false_discovery_rate_is_at_most_the_one_asked_for(common):
    random, false, found = np.random.default_rng(2), [], []
    for _ in range(150):
        p = healthy(random, 40, common)
        p[:6] = 10.0 ** -random.uniform(2, 8, 6)  # damaged
        found_ones = significant_bridges(p, 0.1)[0]
        false.append(found_ones[6:].sum() / max(found_ones.sum(), 1))
        found.append(found_ones[:6].mean())
    error = np.std(false) / np.sqrt(len(false))
    assert np.mean(false) <= 0.1 * 34 / 40 + 2 * error
    assert np.mean(found) > 0.7


def test_a_fleet_of_one_is_significant_by_its_p_value():
    for p, fdr, found, level in (
        ([0.09], 0.1, [True], 0.1),
        ([0.11], 0.1, [False], 0.1),
        ([], 0.1, [], 0.0),
        ([0.001, 0.9, 0.9, 0.9], 0.1, [True, False, False, False], 0.025),
    ):
        is_significant, at = significant_bridges(np.array(p), fdr)
        assert is_significant.tolist() == found
        assert at == pytest.approx(level)


def test_the_shape_of_the_tail_is_that_of_the_excesses_whatever_their_unit():
    random = np.random.default_rng(4)
    for shape in (0.0, 0.3):
        drawn = [random.uniform(1, 9) * genpareto.rvs(shape, size=300, random_state=random) for _ in range(9)]
        assert tail_shape(drawn) == pytest.approx(shape, abs=0.12)
        assert tail_shape([5 * one for one in drawn]) == pytest.approx(tail_shape(drawn), abs=1e-3)
    assert tail_shape([one[:9] for one in drawn[:8]]) is None
    heights = [Tail(10.0, (2.0,) * 16).p_value(60.0, 1.0, shape) for shape in (0.0, 0.1, 0.5)]
    assert heights == sorted(heights)


def test_a_baseline_with_an_outlier_makes_p_values_larger():
    squares = np.sort(np.random.default_rng(3).exponential(3.0, 60))[::-1]
    odd = Tail.of(np.r_[200.0, squares[1:]], 1.0)
    for height in (200.0, 400.0, 2000.0):
        assert odd.p_value(height, 1.0) > 10 * odd.p_value(height, 1.0, 0.0)


class Watched:
    """A monitor after a year, with events that began on 1 December and their p values."""

    def __init__(self, p_value, end=None, acknowledged=False):
        self.p_value, self.last_, self.days_ = p_value, pd.Timestamp("2025-12-31"), [0]
        tail = Tail(10.0, (2.0,) * 16)
        self.false_alarm_estimate_ = SimpleNamespace(tail=tail, expected=1.0)
        event = {"kind": "damage", "start": pd.Timestamp("2025-12-01"), "end": pd.NaT if end is None else end}
        event |= {"peak": 5.0, "modes": "f1", "acknowledged": acknowledged, "harmless": False}
        self.events_ = pd.DataFrame([event], pd.RangeIndex(1, 2, name="event")).astype({"end": "datetime64[ns]"})

    def years_watched(self, since):
        return 1.0

    def event_p_values(self, since, *, tail_shape):
        return pd.Series(self.p_value, self.events_.index)


def test_significant_bridges_are_in_alarm_and_ended_events_wait_for_an_explanation():
    end = pd.Timestamp("2025-12-20")
    monitors = {
        "damaged": Watched(1e-6),
        "by chance": Watched(0.5),
        "ended": Watched(1e-6, end),
        "explained": Watched(1e-6, end, acknowledged=True),
    }
    standings = {name: {"last": one.last_, "state": "healthy"} for name, one in monitors.items()}
    found = discover(monitors, standings, 0.1, 365.25)
    assert found.bridges == ["damaged"]
    assert found.table.loc[found.table["is_discovery"], "end"].isna().all()
    assert found.unexplained["bridge"].tolist() == ["ended"]
    assert found.p_values.to_dict() == {"damaged": 1e-6, "by chance": 0.5, "ended": 1.0, "explained": 1.0}
    assert found.summary().startswith("2 of 4 evaluated bridges are in alarm, 1 of them significantly")
    assert found.false_alarms_per_year == 4.0


def test_the_tail_of_a_bridge_is_learned_from_others(monkeypatch):
    monkeypatch.setattr("skthermo.fleet._discoveries.MOST_TAILS", 4)
    asked, found = [], {}

    class Asks(Watched):
        def event_p_values(self, since, *, tail_shape):
            found[id(self)] = tail_shape
            return super().event_p_values(since, tail_shape=tail_shape)

    def total(excesses):
        asked.append(excesses)
        return sum(one[0] for one in excesses)

    monkeypatch.setattr("skthermo.fleet._discoveries.tail_shape", total)
    monitors = {name: Asks(0.5) for name in range(10)}
    for name, one in monitors.items():
        one.false_alarm_estimate_.tail = Tail(10.0, (2.0**name,))
    discover(monitors, {name: {"last": one.last_, "state": "healthy"} for name, one in monitors.items()}, 0.1, 365.25)
    assert len(asked) == 4
    for name, one in monitors.items():
        of_others = [2.0**other for other in monitors if (other - name) % 4]
        assert found[id(one)] == sum(of_others)
