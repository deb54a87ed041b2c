"""A monitor with an FE model takes slow drift out of the frequencies; what changes at once stays in."""

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.surrogate import DataInformedFEM, PosteriorInverse

pytestmark = pytest.mark.filterwarnings("ignore:.*few-records")  # a line leaves residuals that follow the season

FIRST, ONSET = 365, pd.Timestamp("2026-06-01")
LOST = 0.03  # of the stiffness of the diagonals, in the second year


def campaign(**changes):
    """A steady year, then one with changes."""
    settings = {"noise": 0.002, "random_state": 0}
    first, later = make_truss_campaign(2, **settings), make_truss_campaign(2, **settings, **changes)
    records = (one.temperatures.join(one.frequencies) for one in (first, later))
    return pd.concat([part[rows] for part, rows in zip(records, (slice(FIRST), slice(FIRST, None)), strict=True)])


def slowly():
    records = campaign()
    share = np.maximum(np.arange(len(records)) - FIRST, 0) / FIRST
    states = {}, {"diagonal": LOST}
    clean = [make_truss_campaign(2, damage=damage, random_state=0).clean_frequencies for damage in states]
    effect = np.log(clean[1] / clean[0]).mean()  # nearly the same in all weather
    records[effect.index] *= np.exp(np.outer(share, effect))
    return records


def in_service(records, parts=1):
    """A monitor of the first year after the second."""
    modes = [name for name in records if name.startswith("f")]
    T, F = (records[:FIRST].drop(columns=modes), records.loc[records.index[:FIRST], modes])
    fem = DataInformedFEM(make_truss(), inverse=PosteriorInverse(noise=0.01), random_state=0).fit(T, F)
    detector = CompensatedDetector(MahalanobisDetector(), LinearRegression(), targets=modes, regimes=None)
    monitor = Monitor(detector, fem=fem, sensors=False, random_state=0).fit(records[:FIRST])
    for part in np.array_split(np.arange(FIRST, len(records)), parts):
        monitor.update(records.iloc[part])
    return monitor


@pytest.fixture(scope="module")
def healthy():
    return in_service(campaign())


@pytest.fixture(scope="module")
def ageing():
    return in_service(slowly())


@pytest.mark.nightly
def test_without_drift_none_is_claimed(healthy):
    assert not healthy.drift_[["significant", "beyond_limit"]].any(axis=None)
    assert (healthy.drift_["p_value"] > 0.05).all()
    assert healthy.days_.filter(like="drift").abs().max().drop("drift vertical").max() < 0.005


@pytest.mark.nightly
def test_slow_drift_is_followed_and_raises_no_alarm(ageing):
    """It begins after the baseline, and the last month waits."""
    drift = ageing.drift_
    assert drift.index[drift["significant"]].tolist() == ["diagonal"]
    row = drift.loc["diagonal"]
    assert abs(row["change"] + LOST) < 3 * row["standard_error"]
    assert -1.1 * LOST < ageing.days_["drift diagonal"].iloc[-1] < -0.5 * LOST
    assert (ageing.evaluations_["state"] == "alarm").mean() < 0.02


def test_sudden_damage_is_not_learned_as_drift(healthy):
    damaged = in_service(campaign(damage={"diagonal": 0.12}, damage_from=ONSET)[:600])
    later = damaged.evaluations_.loc[ONSET + pd.Timedelta("7D") :]
    assert (later["state"] == "alarm").all()
    assert abs(damaged.drift_["change"] - healthy.drift_["change"])["diagonal"] < 0.03 * 0.12


@pytest.mark.nightly
def test_any_batches_give_the_same_drift_over_an_outage():
    records = slowly()[: FIRST + 90].drop(index=slowly().index[FIRST + 40 : FIRST + 60])
    once, parts = in_service(records), in_service(records, parts=7)
    pd.testing.assert_frame_equal(parts.drift_, once.drift_, check_exact=True)
    pd.testing.assert_frame_equal(parts.days_, once.days_, check_exact=True)
