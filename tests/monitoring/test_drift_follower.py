"""A monitor with an FE model takes slow drift out of the frequencies; what changes at once stays in."""

import copy
from functools import cache

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.surrogate import DataInformedFEM, PosteriorInverse
from tests.monitoring.nightly import joined

pytestmark = pytest.mark.filterwarnings("ignore:.*few-records")  # a line leaves residuals that follow the season

FIRST, ONSET = 365, pd.Timestamp("2026-03-01")
LOST = 0.03  # of the stiffness of the diagonals, in the second year


def campaign(**changes):
    """A steady year, then one with changes."""
    settings = {"noise": 0.002, "random_state": 0}
    first, later = make_truss_campaign(2, **settings), make_truss_campaign(2, **settings, **changes)
    return pd.concat([joined(first)[:FIRST], joined(later)[FIRST:]])


def slowly():
    records = campaign()
    share = np.maximum(np.arange(len(records)) - FIRST, 0) / FIRST
    states = {}, {"diagonal": LOST}
    clean = [make_truss_campaign(2, damage=damage, random_state=0).clean_frequencies for damage in states]
    effect = np.log(clean[1] / clean[0]).mean()  # nearly the same in all weather
    records[effect.index] *= np.exp(np.outer(share, effect))
    return records


@cache
def fitted():
    """A monitor of the first year, which is the same in all records."""
    records = campaign()[:FIRST]
    modes = [name for name in records if name.startswith("f")]
    fem = DataInformedFEM(make_truss(), inverse=PosteriorInverse(noise=0.01), random_state=0)
    fem.fit(records.drop(columns=modes), records[modes])
    detector = CompensatedDetector(MahalanobisDetector(), LinearRegression(), targets=modes, regimes=None)
    return Monitor(detector, fem=fem, sensors=False, random_state=0).fit(records)


def in_service(records, parts=1):
    """A monitor of the first year after the second."""
    monitor = copy.deepcopy(fitted())
    for part in np.array_split(np.arange(FIRST, len(records)), parts):
        monitor.update(records.iloc[part])
    return monitor


@pytest.mark.nightly
def test_without_drift_none_is_claimed():
    healthy = in_service(campaign())
    assert not healthy.drift_[["significant", "beyond_limit"]].any(axis=None)
    assert (healthy.drift_["p_value"] > 0.05).all()
    assert healthy.days_.filter(like="drift").abs().max().drop("drift vertical").max() < 0.005


@pytest.mark.nightly
def test_slow_drift_is_followed_and_raises_no_alarm():
    """It begins after the baseline, and the last month waits."""
    ageing = in_service(slowly())
    drift = ageing.drift_
    assert drift.index[drift["significant"]].tolist() == ["diagonal"]
    row = drift.loc["diagonal"]
    assert abs(row["change"] + LOST) < 3 * row["standard_error"]
    assert -1.1 * LOST < ageing.days_["drift diagonal"].iloc[-1] < -0.5 * LOST
    assert (ageing.evaluations_["state"] == "alarm").mean() < 0.02


@pytest.mark.parametrize("outage", [[], range(440, 470)])
def test_sudden_damage_is_not_learned_as_drift(outage):
    changes = {}, {"damage": {"diagonal": 0.12}, "damage_from": ONSET}
    records = (campaign(**each)[:510] for each in changes)
    healthy, damaged = (in_service(table.drop(index=table.index[outage])) for table in records)
    later = damaged.evaluations_.loc[ONSET + pd.Timedelta("7D") :]
    assert (later["state"] == "alarm").all()
    assert abs(damaged.drift_["change"] - healthy.drift_["change"])["diagonal"] < 0.03 * 0.12


@pytest.mark.nightly
def test_any_batches_give_the_same_drift_over_an_outage():
    records = slowly()[: FIRST + 90]
    records = records.drop(index=records.index[FIRST + 40 : FIRST + 60])
    once, parts = in_service(records), in_service(records, parts=7)
    pd.testing.assert_frame_equal(parts.drift_, once.drift_, check_exact=True)
    pd.testing.assert_frame_equal(parts.days_, once.days_, check_exact=True)
