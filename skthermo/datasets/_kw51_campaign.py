"""Synthetic monitoring of the railway bridge KW51."""

from collections.abc import Mapping
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from sklearn.utils import Bunch

from skthermo._arrays import as_random_state, positive_integer
from skthermo.datasets._kw51_monitoring import (
    NOISE,
    SENSORS,
    draw_damping,
    measured_shapes,
    missing_modes,
    missing_temperatures,
    sensor_dofs,
)
from skthermo.datasets._kw51_truth import STIFFENED, retrofit_keywords, simulate, thermal_multipliers, truth_model
from skthermo.datasets._kw51_weather import N_HOURS, draw_weather
from skthermo.fem import check_noise

RETROFIT, FINISHED = pd.Timestamp("2019-05-15 00:00"), pd.Timestamp("2019-09-27 01:00")
PROGRESS = pd.DataFrame(
    {"mass": [0.0, 0.0, 0.5, 0.5, 1.0, 1.0], "stiffness": [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]},
    index=pd.to_datetime(["2019-05-15", "2019-06-06", "2019-06-13", "2019-06-28", "2019-09-06", "2019-09-16"]),
)
"""Shares of the retrofit's mass and stiffness; linear between these times."""

YEAR = 8766.0  # hours


def make_kw51_campaign(
    *,
    n_hours: int = N_HOURS,
    noise: ArrayLike = NOISE,
    gaps: bool = True,
    retrofit: bool = True,
    drift: Mapping[str, float] | None = None,
    damage: Mapping[str, float] | None = None,
    damage_from: Any = None,
    shapes: bool = False,
    random_state: int | np.random.RandomState | None = None,
) -> Bunch:
    """Synthetic monitoring of the railway bridge KW51: hourly temperatures and modes, through its retrofit.

    Parameters
    ----------
    n_hours : int, default=11328
        Number of hourly records from 2018-10-01 00:00.
    noise : float or array-like of shape (6,), default=(0.003, 0.0017, 0.0016, 0.0025, 0.0013, 0.0015)
        Relative standard deviation of the Gaussian noise on every frequency.
    gaps : bool, default=True
        Whether temperatures and modes are missing as they were on the bridge.
    retrofit : bool, default=True
        Whether the bridge is strengthened from 2019-05-15 00:00 to 2019-09-27 01:00.
    drift : mapping of str to float, optional
        Share of the stiffness that a damage group of ``model`` loses each year from the first record on.
    damage : mapping of str to float, optional
        Severity by damage group of ``model``, as in ``model.damaged``.
    damage_from : time, optional
        When damage begins. By default with the first record.
    shapes : bool, default=False
        Whether mode shapes at the sensors are simulated.
    random_state : int, RandomState or None, default=None
        Seed.

    Returns
    -------
    Bunch
        See the code.
    """
    n_hours = positive_integer(n_hours, "n_hours")
    deviations = check_noise(noise, 6)
    random = as_random_state(random_state)
    streams = [np.random.RandomState(seed) for seed in random.randint(2**31 - 1, size=5)]
    weather = draw_weather(n_hours, streams[0])
    index = weather.index
    theta = thermal_multipliers(weather)
    progress = _progress(index) if retrofit else pd.DataFrame(0.0, index, PROGRESS.columns)
    factors = _factors(index, progress["stiffness"], drift, damage, damage_from)
    dofs = sensor_dofs() if shapes else None
    clean, clean_shapes = simulate(theta, factors, progress["mass"].to_numpy(), dofs)
    frequencies = clean * (1 + deviations * streams[1].standard_normal(clean.shape))
    damping = draw_damping(weather["steel"].to_numpy(), streams[2])
    temperatures = weather[["steel"]].set_axis(["tBD31A"], axis=1)
    missing = np.zeros(clean.shape, dtype=bool)
    if gaps:
        temperatures[missing_temperatures(index, streams[3])] = np.nan
        missing = missing_modes(n_hours, streams[3])
    frequencies[missing], damping[missing] = np.nan, np.nan
    campaign = Bunch(
        temperatures=temperatures,
        frequencies=pd.DataFrame(frequencies, index, [f"f{i}" for i in range(1, 7)]),
        damping=pd.DataFrame(damping, index, [f"xi{i}" for i in range(1, 7)]),
        clean_frequencies=pd.DataFrame(clean, index, [f"f{i}" for i in range(1, 7)]),
        theta=theta,
        state=_state(index, retrofit),
        model=truth_model(),
        retrofit=retrofit_keywords(),
        sensors=list(SENSORS),
    )
    if clean_shapes is not None:
        campaign.shapes = measured_shapes(clean_shapes, streams[4])
        campaign.shapes[missing] = np.nan
    return campaign


def _state(index: pd.DatetimeIndex, retrofit: bool) -> pd.Series:
    state = np.full(len(index), "before", dtype=object)
    if retrofit:
        state[index >= RETROFIT] = "during"
        state[index >= FINISHED] = "after"
    return pd.Series(state, index, name="state")


def _progress(index: pd.DatetimeIndex) -> pd.DataFrame:
    knots = (PROGRESS.index - index[0]) / pd.Timedelta(hours=1)
    hours = np.arange(len(index))
    return pd.DataFrame({name: np.interp(hours, knots, shares) for name, shares in PROGRESS.items()}, index)


def _factors(
    index: pd.DatetimeIndex,
    stiffened: pd.Series,
    drift: Mapping[str, float] | None,
    damage: Mapping[str, float] | None,
    damage_from: Any,
) -> pd.DataFrame:
    """Factor of the stiffness of each group in every hour."""
    years = np.arange(len(index)) / YEAR
    onset = _onset(index, damage_from)
    changes = {
        "retrofit": {group: stiffened.to_numpy() * share for group, share in STIFFENED.items()},
        "drift": {group: -years * rate for group, rate in _read(drift, "drift").items()},
        "damage": {group: np.where(index >= onset, -s, 0.0) for group, s in _read(damage, "damage").items()},
    }
    factors = pd.DataFrame(index=index)
    for what, change in changes.items():
        for group, more in change.items():
            if not (more > -1).all():
                raise ValueError(f"{what} of group {group!r} leaves no stiffness; expected less")
            factors[group] = factors.get(group, 1.0) * (1 + more)
    return factors


def _onset(index: pd.DatetimeIndex, damage_from: Any) -> pd.Timestamp:
    if damage_from is None:
        return index[0]
    try:
        onset = pd.Timestamp(damage_from)
        inside = index[0] <= onset <= index[-1]
    except (TypeError, ValueError) as error:
        raise ValueError(f"damage_from is {damage_from!r}; expected a time without a time zone ({error})") from error
    if not inside:
        raise ValueError(f"damage_from is {damage_from!r}; expected a time from {index[0]} to {index[-1]}")
    return onset


def _read(changes: Mapping[str, float] | None, what: str) -> Mapping[str, float]:
    """Values by damage group, checked."""
    changes = {} if changes is None else changes
    groups = truth_model().groups
    if not isinstance(changes, Mapping) or not set(changes) <= set(groups):
        raise ValueError(f"{what} is {changes!r}; expected a mapping of some of the groups {sorted(groups)}")
    for group, value in changes.items():
        if not isinstance(value, Real) or not np.isfinite(value):
            raise ValueError(f"{what} of group {group!r} is {value!r}; expected a finite number")
    return changes
