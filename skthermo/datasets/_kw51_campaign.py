"""Synthetic monitoring of the railway bridge KW51: weather, retrofit, drift, damage, noise and gaps."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Mapping

import numpy as np
import pandas as pd
import scipy  # which loads scipy.signal once it is used
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri
from scipy.stats import norm

from skthermo._core.arrays import Array, as_random_state, check_flag, check_noise, check_size, positive_integer
from skthermo.datasets._kw51_file import state_of
from skthermo.datasets._kw51_model import N_BAYS, N_PANELS, kw51_sensors, kw51_structure, updated_model
from skthermo.datasets._results import KW51Campaign
from skthermo.datasets._truss import Stamp, stiffness_factors
from skthermo.fem import AffineModel, Element, ReducedModel, Spring, Structure

Bounds = float | tuple[float, float]
KW51_TRUTH: dict[str, tuple[str | tuple[str, str], Bounds, Callable[[pd.DataFrame], pd.Series]]] = {
    "E_gir": ("deck_beams", 0.02, lambda felt: 1 - 3.6e-4 * felt["steel"]),
    "E_pla": ("plate", 0.02, lambda felt: 1 - 3.6e-4 * felt["slab"]),
    "E_arc": ("arch", 0.02, lambda felt: 1 - 3.6e-4 * felt["sun"]),
    "E_br": ("braces", 0.02, lambda felt: 1 - 3.6e-4 * felt["sun"]),
    "E_con": ("connections", 0.035, lambda felt: 1 - 8e-4 * felt["sun"]),
    "E_pip": ("pipes", 0.02, lambda felt: 1 - 3.6e-4 * felt["sun"]),
    "E_b": ("ballast", (0.9, 1.7), lambda felt: (1 - 1.5e-3 * felt["slab"]) * (1 + 0.5 * felt["frozen"])),
    "I_33g": (("I_yy", "girders"), (0.9, 2.2), lambda felt: (1 - 1.5e-3 * felt["slab"]) * (1 + 1.0 * felt["frozen"])),
    "K_bea": ("bearings", (0.6, 1.6), lambda felt: np.exp(-0.012 * felt["steel"])),
    "M_b": (("mass", "ballast"), 0.025, lambda felt: 1 + 0.0033 * felt["moisture"]),
}
"""Parameters of the healthy bridge: what they are, as `Structure.assemble` binds them, the bounds within which weather
keeps them, and their multipliers in the weather that is felt: temperatures above 10 C, the mean before the retrofit,
the share that is frozen, and moisture."""
STIFFENED = {"arch_connections": 0.906, "deck_connections": 0.430}
ADDED_MASSES = {"arch": 353.0, "deck": 837.0}  # kg at each joint of brace and connection


def draw_weather(n_hours: int, random: np.random.RandomState) -> pd.DataFrame:
    """Hourly weather: "steel", "sun" and "slab" in C, "frost" in K below freezing, "moisture" (standard deviation 1).

    "steel" is the temperature below the deck, "sun" the temperature of the members above it, "slab" of the plate and
    the ballast. A longer record begins with the same hours as a shorter one.
    """
    index = pd.date_range("2018-10-01", periods=max(n_hours, 11328), freq="h", name="time")
    *streams, for_spell = map(np.random.RandomState, random.randint(2**31 - 1, size=4))
    anomaly, cloud, moisture = (
        smooth_noise(len(index), 1, hours, stream)[:, 0]
        for hours, stream in zip((30.0, 18.0, 16.0), streams, strict=True)
    )
    day = index.day_of_year.to_numpy() - 1 + index.hour.to_numpy() / 24
    season = -np.cos(2 * np.pi * (day - 18.0) / 365.25)
    steady = 13.2 + 7.75 * season
    anomaly = (3.5 + 0.9 * season) * 2.5 * np.tanh(anomaly / 2.5)  # at most 2.5 standard deviations
    first_winter = slice(1236, 5424)  # from the first temperature to the retrofit
    (a, b), (_, c) = np.cov(steady[first_winter], anomaly[first_winter])
    scale = (np.sqrt(max(b**2 + c * (4.2**2 - a), 0.0)) - b) / c  # with which both together scatter by 4.2 C
    steady += anomaly * np.clip(scale, 0.7, 1.3)
    clear = 0.4 + 1.2 * norm.cdf(cloud)
    swing = clear * (1.0 + 4.0 * (1 + season) / 2)  # from 1 C in winter to 5 C in summer
    hour = index.hour.to_numpy()
    steel = steady + swing * cycle(hour)
    january = np.flatnonzero((index.month == 1) & (index.year == index[0].year + 1))
    coldest, wanted = january[steel[january].argmin()], -2.9 + 0.3 * for_spell.standard_normal()
    spell = (wanted - steel[coldest]) * np.exp(-(((np.arange(len(index)) - coldest) / 60.0) ** 2))  # fades over days
    steel += spell
    sun = steady + spell + 1.4 * swing * cycle(hour + 2.0)
    weather = {
        "steel": steel,
        "sun": sun,
        "slab": memory(steel, 24.0),
        "frost": memory(np.maximum(1.5 - steel, 0.0), 6.0),
        "moisture": moisture,
    }
    return pd.DataFrame(weather, index=index).iloc[:n_hours]


def cycle(hour: Array) -> Array:
    """Daily cycle of mean 0, which is higher in the afternoon (1.25) than low at night (-0.75)."""
    angle = 2 * np.pi * (hour - 16.0) / 24
    return np.cos(angle) + np.cos(2 * angle) / 4


def smooth_noise(n_hours: int, n_columns: int, hours: float, random: np.random.RandomState) -> Array:
    """Stationary Gaussian columns of variance 1, twice smoothed: correlation (1 + t / hours) exp(-t / hours)."""
    decay = np.exp(-1 / hours)
    settled = int(10 * hours)
    noise = random.standard_normal((settled + n_hours, n_columns))
    once = scipy.signal.lfilter([1 - decay], [1, -decay], noise, axis=0)
    twice = scipy.signal.lfilter([1 - decay], [1, -decay], once, axis=0)[settled:]
    variance = (1 - decay) ** 4 * (1 + decay**2) / (1 - decay**2) ** 3
    return twice / np.sqrt(variance)


def memory(values: Array, hours: float) -> Array:
    """Exponentially weighted mean of the past, which starts settled at the first value."""
    if hours == 0:
        return values
    decay = np.exp(-1 / hours)
    return scipy.signal.lfilter([1 - decay], [1, -decay], values, zi=decay * values[:1])[0]


def truth_structure() -> Structure:
    """KW51 with bearings that resist sliding and rocking."""
    bridge, ends, lines = kw51_structure(), (0, N_BAYS), (0, N_PANELS)
    bearings: dict[Hashable, Element] = {
        ("bearing", end, "x"): Spring(("deck", end, N_PANELS), "x", 1e7) for end in ends
    }
    bearings |= {("bearing", end, line, "ry"): Spring(("deck", end, line), "ry", 3e7) for end in ends for line in lines}
    groups = bridge.groups
    groups["deck_beams"] = groups["girders"] | groups["transverse_beams"] | groups["stiffeners"]
    groups["bearings"] = frozenset(bearings)
    return Structure(bridge.nodes, bridge.members | bearings, bridge.supports, groups)


def retrofit_mass() -> Array:
    """Mass at the joints, in kg at each degree of freedom."""
    return np.array(
        [ADDED_MASSES[node[-1]] if node[0] == "joint" and d in "xyz" else 0.0 for node, d in kw51_structure().dofs]
    )


def progress_of(index: pd.DatetimeIndex) -> pd.DataFrame:
    """Shares of the retrofit's mass and stiffness that are there in each hour."""
    days = ["2019-05-15", "2019-06-06", "2019-06-20", "2019-06-28", "2019-09-06", "2019-09-16"]
    shares = {"mass": [0.0, 0.0, 0.5, 0.5, 0.5, 1.0], "stiffness": [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]}
    knots, hours = (pd.to_datetime(days) - index[0]) / pd.Timedelta(hours=1), np.arange(len(index))
    return pd.DataFrame({name: np.interp(hours, knots, share) for name, share in shares.items()}, index)


def simulate(
    truth: AffineModel, theta: pd.DataFrame, mass: pd.Series, factors: pd.DataFrame, dofs: list[int] | None
) -> tuple[Array, Array | None]:
    """Frequencies (n, 6) in Hz and, at ``dofs``, mode shapes (n, 6, n_dofs).

    ``mass`` is the share of the retrofit's mass, and ``factors`` multiply the stiffness of the groups that are its
    columns. The bridge as it was has a model of its own, which is smaller than one of all changes.
    """
    factors = factors.loc[:, (factors != 1).any()]
    is_changed = ((mass > 0) | (factors != 1).any(axis=1)).to_numpy()
    frequencies = np.empty((len(theta), 6))
    shapes = None if dofs is None else np.empty((len(theta), 6, len(dofs)))
    for rows, changes in ((~is_changed, (0 * mass, factors.iloc[:, :0])), (is_changed, (mass, factors))):
        if rows.any():
            model, values = with_changes(truth, theta[rows], *(one[rows] for one in changes))
            if shapes is None:
                frequencies[rows] = model.frequencies(values)
                continue
            places = np.flatnonzero(rows)
            for start in range(0, len(values), 200):  # rows whose shapes are in memory together
                some = slice(start, start + 200)
                frequencies[places[some]], everywhere = model.modes(values[some])
                shapes[places[some]] = everywhere[:, dofs].transpose(0, 2, 1)
    return frequencies, shapes


def with_changes(
    truth: AffineModel, theta: pd.DataFrame, mass: pd.Series, factors: pd.DataFrame
) -> tuple[ReducedModel, Array]:
    """A reduced model whose parameters are those of the weather and the changes, with errors below 1e-5, and its
    theta."""
    model, values = truth, np.column_stack([theta, 1 + mass, factors])
    box = {name: bounds for name, (_, bounds, _) in KW51_TRUTH.items()}
    if mass.any():
        model, box = model.with_mass_parameters({"retrofit": retrofit_mass()}), box | {"1 + retrofit": (1.0, 2.0)}
    else:
        values = np.delete(values, theta.shape[1], axis=1)
    if factors.shape[1]:
        model = model.with_damage_parameters(list(factors))
        ends = zip(factors.min() - 0.001, factors.max() + 0.001, strict=True)
        box |= dict(zip([f"1 - {group}" for group in factors], ends, strict=True))
    return model.reduced(box, tol=1e-4, random_state=0), values


def missing_modes(n_hours: int, random: np.random.RandomState) -> NDArray[np.bool_]:
    """Hours (n_hours, 6) in which a mode was not identified: in blocks, lateral modes of the arches together."""
    coverage, by_wind = np.array([0.30, 0.344, 0.950, 0.503, 0.879, 0.965]), np.array([0.55, 0.55, 0.0, 0.55, 0.0, 0.0])
    outages = 0.02  # share of the hours
    wind, outage, *own = smooth_noise(n_hours, 2 + len(coverage), 4.0, random).T
    excitation = np.sqrt(by_wind) * wind[:, np.newaxis] + np.sqrt(1 - by_wind) * np.array(own).T
    return (excitation < ndtri(1 - coverage / (1 - outages))) | (outage < ndtri(outages))[:, np.newaxis]


def measured_shapes(clean: Array, random: np.random.RandomState) -> NDArray[np.complex128]:
    """Shapes (n, 6, n_sensors) of unit length and random phase, with complex noise."""
    noise = random.standard_normal((2, *clean.shape)) / np.sqrt(2)
    phase = np.exp(2j * np.pi * random.uniform(size=(*clean.shape[:2], 1)))
    level = 0.01 * np.sqrt((clean**2).mean(axis=2, keepdims=True))
    noisy = (clean + level * (noise[0] + 1j * noise[1])) * phase
    return noisy / np.linalg.norm(noisy, axis=2, keepdims=True)


def identification_noise(shape: tuple[int, int], correlation: float, random: np.random.RandomState) -> Array:
    """Columns of variance 1 with heavier tails than a Gaussian's: an autoregression of Student's variables."""
    freedom = 9.0  # hourly residuals of mode 6 have a kurtosis of 3.9
    noise = np.sqrt((freedom - 2) / freedom) * random.standard_t(freedom, shape)
    noise[1:] *= np.sqrt(1 - correlation**2)
    return scipy.signal.lfilter([1.0], [1.0, -correlation], noise, axis=0)


def make_kw51_campaign(
    *,
    n_hours: int = 11328,
    noise: ArrayLike = (0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0013),
    correlation: float = 0.15,
    gaps: bool = True,
    retrofit: bool = True,
    drift: Mapping[str, float] | None = None,
    damage: Mapping[str, float] | None = None,
    damage_from: Stamp = None,
    shapes: bool = False,
    random_state: int | np.random.RandomState | None = None,
) -> KW51Campaign:
    """Synthetic monitoring of the railway bridge KW51: hourly temperatures and modes, through its retrofit.

    The measurements [ML21]_ may not be part of this package. This campaign has their length and gaps and, as far as
    these are known, their correlations with temperature and shifts by the retrofit, and its truth is known.

    Parameters
    ----------
    n_hours : int, default=11328
        Number of hourly records from 2018-10-01 00:00 on. With gaps, the first 1236 have no temperature.
    noise : float or array-like of shape (6,), default=(0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0013)
        Relative standard deviation of the noise on every frequency, of Student's distribution with nine degrees of
        freedom.
    correlation : float, default=0.15
        Correlation of the noise of neighbouring hours, as in `~skthermo.fem.add_noise`.
    gaps : bool, default=True
        Whether temperatures and modes are missing in blocks.
    retrofit : bool, default=True
        Whether the bridge is strengthened from 2019-05-15 00:00 to 2019-09-27 01:00.
    drift : mapping of str to float, optional
        Share of its stiffness that a damage group loses each year, steadily from the first record on.
    damage : mapping of str to float, optional
        Severity by damage group, as in ``model.damaged``: 0.5 halves the stiffness.
    damage_from : str, Timestamp or datetime, optional
        When the damage begins; by default with the first record.
    shapes : bool, default=False
        Whether mode shapes at the sensors are simulated, too.
    random_state : int, RandomState or None, default=None
        Seed. With the same integer, campaigns have the same weather, noise and gaps, whatever else is asked for; a
        longer one begins with the records of a shorter one.

    Returns
    -------
    Bunch
        With these attributes:

        temperatures : DataFrame of shape (n_hours, 1)
            ``tBD31A``, temperature of the steel below the deck in degrees Celsius. It is missing until 2018-11-21
            and in a few blocks.
        frequencies : DataFrame of shape (n_hours, 6)
            ``f1`` to ``f6`` in Hz, with noise; NaN where a mode was not identified.
        damping : DataFrame of shape (n_hours, 6)
            Damping ratios ``xi1`` to ``xi6``; NaN as the frequencies.
        shapes : ndarray of shape (n_hours, 6, 12)
            Only with ``shapes=True``: complex mode shapes at the sensors, of unit length and any phase, with noise
            of 1 % of their root mean square; NaN as the frequencies.
        sensors : list of str
            Labels of the 12 accelerometers, in the order of the shapes.
        state : Series of shape (n_hours,)
            "before", "during" or "after" the retrofit.
        clean_frequencies : DataFrame of shape (n_hours, 6)
            In Hz, without noise and gaps.
        theta : DataFrame of shape (n_hours, 10)
            Effect of the weather: multipliers of the parameters of ``model``. Retrofit, drift and damage, which change
            groups, come on top.
        model : AffineModel
            The bridge before its retrofit. It has the groups of `make_kw51`, and ``bearings`` and ``deck_beams``
            (girders, transverse beams and stiffeners).
        retrofit : dict
            The complete retrofit as keyword arguments of `~skthermo.surrogate.DataInformedFEM.simulate` and
            `~skthermo.studies.Scenario`, for ``model`` and all models of `make_kw51`; its effect was fitted with
            ``updated=True``.

        All frames have the same DatetimeIndex.

    Raises
    ------
    ValueError
        If a group is unknown, drift or damage leave no stiffness, or the damage begins outside the campaign.

    See Also
    --------
    make_kw51 : The FE model, also as updated.

    Notes
    -----
    The bridge is the updated model of `make_kw51` with bearings added. :ref:`campaign-of-kw51` describes the effect of
    weather on its ten multipliers, the changes by the retrofit, and the sources and assumptions behind the
    measurements;
    :doc:`/accuracy_kw51` has statistics of both side by side. A model with the five thermal parameters of `make_kw51`
    as functions of tBD31A can come close to this bridge, but cannot be exact.

    Examples
    --------
    >>> from skthermo.datasets import make_kw51_campaign
    >>> campaign = make_kw51_campaign(n_hours=300, random_state=0)
    >>> campaign.frequencies.shape, campaign.state.unique().tolist()
    ((300, 6), ['before'])
    >>> campaign.clean_frequencies.iloc[0].round(2).tolist()
    [0.51, 1.21, 1.89, 2.51, 2.57, 2.91]
    """
    n_hours = positive_integer(n_hours, "n_hours")
    deviations = check_noise(noise, 6)
    correlation = check_size(correlation, "correlation", -1, 1, "a number between -1 and 1, such as 0.15")
    for what, flag in (("gaps", gaps), ("retrofit", retrofit), ("shapes", shapes)):
        check_flag(flag, what)
    seeds = as_random_state(random_state).randint(2**31 - 1, size=6)
    for_weather, for_noise, for_damping, for_sensor, for_gaps, for_shapes = map(np.random.RandomState, seeds)

    sensors, truth = (
        kw51_sensors(),
        updated_model(truth_structure(), {name: what for name, (what, _, _) in KW51_TRUTH.items()}, 6),
    )
    weather = draw_weather(n_hours, for_weather)
    index, frozen = weather.index, 1 - np.exp(-weather["frost"] / 2.0)
    felt = (weather[["steel", "sun", "slab"]] - 10.0).assign(frozen=frozen, moisture=weather["moisture"])
    theta = pd.DataFrame({name: multiplier(felt) for name, (_, _, multiplier) in KW51_TRUTH.items()})
    progress = retrofit * progress_of(index)
    strengthened = {group: share * progress["stiffness"] for group, share in STIFFENED.items()}
    factors = stiffness_factors(index, 8766.0, truth.groups, drift, damage, damage_from, strengthened)  # hours a year
    clean, clean_shapes = simulate(truth, theta, progress["mass"], factors, list(sensors.values()) if shapes else None)

    frequencies = clean * (1 + deviations * identification_noise(clean.shape, correlation, for_noise))
    at_ten_degrees, deviation = np.array([0.009, 0.007, 0.008, 0.006, 0.005, 0.004]), 0.25
    damping = at_ten_degrees * (1 - 0.006 * (weather[["steel"]].to_numpy() - 10.0))  # lower when it is warm
    damping *= np.exp(deviation * for_damping.standard_normal(damping.shape) - deviation**2 / 2)
    temperatures = weather["steel"].to_frame("tBD31A")
    missing = np.zeros(clean.shape, dtype=bool)
    if gaps:
        is_lost = smooth_noise(n_hours, 1, 8.0, for_sensor)[:, 0] < ndtri(0.0122)
        temperatures[is_lost | (index < "2018-11-21 12:00")] = np.nan  # the sensor was not there yet
        missing = missing_modes(n_hours, for_gaps)
    frequencies[missing], damping[missing] = np.nan, np.nan
    modes, ratios = [[f"{letter}{mode + 1}" for mode in range(6)] for letter in ("f", "xi")]
    campaign = KW51Campaign(
        temperatures=temperatures,
        frequencies=pd.DataFrame(frequencies, index, modes),
        damping=pd.DataFrame(damping, index, ratios),
        sensors=list(sensors),
        state=state_of(index) if retrofit else pd.Series("before", index, name="state"),
        clean_frequencies=pd.DataFrame(clean, index, modes),
        theta=theta,
        model=truth,
        retrofit={"damage": {group: -share for group, share in STIFFENED.items()}, "mass": retrofit_mass()},
    )
    if clean_shapes is not None:
        campaign.shapes = measured_shapes(clean_shapes, for_shapes)
        campaign.shapes[missing] = np.nan
    return campaign
