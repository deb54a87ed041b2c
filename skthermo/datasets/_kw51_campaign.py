"""Synthetic monitoring of the railway bridge KW51: weather, retrofit, drift, damage, noise and gaps."""

from __future__ import annotations

from collections.abc import Hashable, Mapping
from functools import lru_cache

import numpy as np
import pandas as pd
import scipy  # which loads scipy.signal once it is used
from numpy.typing import ArrayLike, NDArray
from scipy.special import ndtri
from scipy.stats import norm

from skthermo._core.arrays import Array, as_random_state, check_flag, check_noise, positive_integer
from skthermo.datasets._kw51_file import state_of
from skthermo.datasets._kw51_model import N_BAYS, N_PANELS, kw51_sensors, kw51_structure, updated_model
from skthermo.datasets._results import KW51Campaign
from skthermo.datasets._truss import Stamp, stiffness_factors
from skthermo.fem import AffineModel, Element, PointMass, ReducedModel, Spring, Structure, add_noise

START = pd.Timestamp("2018-10-01")
N_HOURS = 11328
REFERENCE = 10.0  # C, near the mean before the retrofit
MEAN, SEASON, COLDEST_DAY = 13.2, 7.75, 18.0  # C, C, day of the year
ANOMALY, ANOMALY_SEASON, ANOMALY_HOURS, LIMIT = 3.5, 0.9, 30.0, 2.5
SCATTER, SCALES, FIRST_WINTER = 4.2, (0.7, 1.3), slice(1236, 5424)  # C; from the first temperature to the retrofit
SWING_WINTER, SWING_SUMMER, CLOUDED, CLOUD_HOURS = 1.0, 5.0, 0.4, 18.0
WARMEST_HOUR = 16.0
SUN_SWING, SUN_LEAD = 1.4, 2.0
SLAB_HOURS = 24.0
COLD_SPELL, COLD_SPELL_SCATTER, COLD_SPELL_HOURS = -2.9, 0.3, 60.0
FROST_BELOW, FROST_HOURS = 1.5, 24.0
MOISTURE_HOURS = 36.0
TRUTH = {
    "E_gir": "deck_beams",
    "E_pla": "plate",
    "E_arc": "arch",
    "E_br": "braces",
    "E_con": "connections",
    "E_pip": "pipes",
    "E_b": "ballast",
    "I_33g": ("I_yy", "girders"),
    "K_bea": "bearings",
    "M_b": ("mass", "ballast"),
}
"""Parameters of the healthy bridge, as `Structure.assemble` binds them."""
BOX: dict[str, float | tuple[float, float]] = {
    **dict.fromkeys(("E_gir", "E_pla", "E_arc", "E_br", "E_pip"), 0.02),
    "E_con": 0.035,
    "E_b": (0.9, 1.7),
    "I_33g": (0.9, 2.2),
    "K_bea": (0.6, 1.6),
    "M_b": 0.015,
}
"""What weather does to them stays within these bounds."""
STEEL, CONNECTIONS, BALLAST, COMPOSITE, BEARINGS = 3.6e-4, 8e-4, 1.5e-3, 1.5e-3, 0.012  # softer by 1/K
FROZEN_BALLAST, FROZEN_COMPOSITE, FROST_DEPTH = 0.5, 1.0, 2.0  # stiffer by (ratios), K
MOISTURE = 0.0018  # standard deviation of the ballast's mass
SLIDING, ROCKING = 1e7, 3e7  # N/m and N m/rad at each bearing
STIFFENED = {"arch_connections": 0.906, "deck_connections": 0.430}
ADDED = {"arch": 353.0, "deck": 837.0}  # kg at each joint of brace and connection
PROGRESS = pd.DataFrame(
    {"mass": [0.0, 0.0, 0.5, 0.5, 0.5, 1.0], "stiffness": [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]},
    index=pd.to_datetime(["2019-05-15", "2019-06-06", "2019-06-20", "2019-06-28", "2019-09-06", "2019-09-16"]),
)
TOLERANCE = 1e-4  # errors were found to be below 1e-5 at simulated states
LASTING = 500  # hours
NO_MASS = 1e-9  # multipliers are positive
ROWS = 200  # whose shapes are in memory together
NOISE = (0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0015)
COVERAGE = np.array([0.30, 0.344, 0.950, 0.503, 0.879, 0.965])
WIND = np.array([0.55, 0.55, 0.0, 0.55, 0.0, 0.0])
OUTAGE = 0.02
BLOCK_HOURS = 4.0
FIRST_TEMPERATURE = pd.Timestamp("2018-11-21 12:00")
TEMPERATURE_GAPS = 0.0122
DAMPING = np.array([0.009, 0.007, 0.008, 0.006, 0.005, 0.004])
DAMPING_BY_KELVIN, DAMPING_SCATTER = 0.006, 0.25
SHAPE_NOISE = 0.01
YEAR = 8766.0  # hours


def draw_weather(n_hours: int, random: np.random.RandomState) -> pd.DataFrame:
    """Hourly weather: "steel", "sun" and "slab" in C, "frost" in K below freezing, "moisture" (standard deviation 1).

    "steel" is the temperature below the deck, "sun" that of the members above it, "slab" that of the plate and the
    ballast. A longer record begins with the same hours as a shorter one.
    """
    index = pd.date_range(START, periods=max(n_hours, N_HOURS), freq="h", name="time")
    *streams, for_spell = map(np.random.RandomState, random.randint(2**31 - 1, size=4))
    memories = (ANOMALY_HOURS, CLOUD_HOURS, MOISTURE_HOURS)
    anomaly, cloud, moisture = (
        smooth_noise(len(index), 1, hours, stream)[:, 0] for hours, stream in zip(memories, streams, strict=True)
    )
    day = index.day_of_year.to_numpy() - 1 + index.hour.to_numpy() / 24
    season = -np.cos(2 * np.pi * (day - COLDEST_DAY) / 365.25)
    steady = MEAN + SEASON * season
    anomaly = (ANOMALY + ANOMALY_SEASON * season) * LIMIT * np.tanh(anomaly / LIMIT)
    steady += anomaly * scale_for_scatter(steady[FIRST_WINTER], anomaly[FIRST_WINTER])
    clear = CLOUDED + 2 * (1 - CLOUDED) * norm.cdf(cloud)
    swing = clear * (SWING_WINTER + (SWING_SUMMER - SWING_WINTER) * (1 + season) / 2)
    hour = index.hour.to_numpy()
    steel = steady + swing * cycle(hour)
    spell = cold_spell(index, steel, for_spell)
    steel += spell
    sun = steady + spell + SUN_SWING * swing * cycle(hour + SUN_LEAD)
    weather = {
        "steel": steel,
        "sun": sun,
        "slab": memory(steel, SLAB_HOURS),
        "frost": memory(np.maximum(FROST_BELOW - steel, 0.0), FROST_HOURS),
        "moisture": moisture,
    }
    return pd.DataFrame(weather, index=index).iloc[:n_hours]


def cycle(hour: Array) -> Array:
    """Daily cycle of mean 0, which is higher in the afternoon (1.25) than low at night (-0.75)."""
    angle = 2 * np.pi * (hour - WARMEST_HOUR) / 24
    return np.cos(angle) + np.cos(2 * angle) / 4


def scale_for_scatter(season: Array, anomaly: Array) -> float:
    """What to multiply anomalies with so that season and anomalies together scatter by ``SCATTER``, within limits."""
    (a, b), (_, c) = np.cov(season, anomaly)
    scale = (np.sqrt(max(b**2 + c * (SCATTER**2 - a), 0.0)) - b) / c
    return float(np.clip(scale, *SCALES))


def cold_spell(index: pd.DatetimeIndex, steel: Array, random: np.random.RandomState) -> Array:
    """What brings the coldest hour of the first January to about -3 C, fading over days before and after it."""
    january = np.flatnonzero((index.month == 1) & (index.year == START.year + 1))
    coldest = january[steel[january].argmin()]
    wanted = COLD_SPELL + COLD_SPELL_SCATTER * random.standard_normal()
    hours = np.arange(len(index)) - coldest
    return (wanted - steel[coldest]) * np.exp(-((hours / COLD_SPELL_HOURS) ** 2))


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


def thermal_multipliers(weather: pd.DataFrame) -> pd.DataFrame:
    """Multipliers of the parameters ``TRUTH`` in every hour."""
    warm = weather[["steel", "sun", "slab"]] - REFERENCE
    frozen = 1 - np.exp(-weather["frost"] / FROST_DEPTH)
    return pd.DataFrame(
        {
            "E_gir": 1 - STEEL * warm["steel"],
            "E_pla": 1 - STEEL * warm["slab"],
            "E_arc": 1 - STEEL * warm["sun"],
            "E_br": 1 - STEEL * warm["sun"],
            "E_con": 1 - CONNECTIONS * warm["sun"],
            "E_pip": 1 - STEEL * warm["sun"],
            "E_b": (1 - BALLAST * warm["slab"]) * (1 + FROZEN_BALLAST * frozen),
            "I_33g": (1 - COMPOSITE * warm["slab"]) * (1 + FROZEN_COMPOSITE * frozen),
            "K_bea": np.exp(-BEARINGS * warm["steel"]),
            "M_b": 1 + MOISTURE * weather["moisture"],
        }
    )


def truth_structure(added: Mapping[Hashable, Element] | None = None) -> Structure:
    """KW51 with bearings that resist sliding and rocking, and with members that are added as the group "added"."""
    bridge, added = kw51_structure(), added or {}
    ends, lines = (0, N_BAYS), (0, N_PANELS)
    bearings: dict[Hashable, Element] = {
        ("bearing", end, "x"): Spring(("deck", end, N_PANELS), "x", SLIDING) for end in ends
    }
    bearings |= {
        ("bearing", end, line, "ry"): Spring(("deck", end, line), "ry", ROCKING) for end in ends for line in lines
    }
    groups = bridge.groups
    groups["deck_beams"] = groups["girders"] | groups["transverse_beams"] | groups["stiffeners"]
    groups["bearings"] = frozenset(bearings)
    return Structure(
        nodes=bridge.nodes,
        members={**bridge.members, **bearings, **added},
        supports=bridge.supports,
        groups=groups | ({"added": frozenset(added)} if added else {}),
    )


@lru_cache(maxsize=1)
def truth_model() -> AffineModel:
    """The healthy bridge, updated, with the parameters ``TRUTH``."""
    return updated_model(truth_structure(), TRUTH, 6)


def joint_masses() -> dict[Hashable, PointMass]:
    """A point mass at every joint."""
    joints = [node for node in kw51_structure().nodes if node[0] == "joint"]
    return {("mass", node): PointMass(node, ADDED[node[-1]]) for node in joints}


def retrofit_mass() -> Array:
    """The same, in kg at each degree of freedom."""
    return np.array(
        [ADDED[node[-1]] if node[0] == "joint" and d in "xyz" else 0.0 for node, d in kw51_structure().dofs]
    )


def progress_of(index: pd.DatetimeIndex, retrofit: bool) -> pd.DataFrame:
    """Shares of the retrofit's mass and stiffness that are there in each hour."""
    if not retrofit:
        return pd.DataFrame(0.0, index, PROGRESS.columns)
    knots = (PROGRESS.index - index[0]) / pd.Timedelta(hours=1)
    hours = np.arange(len(index))
    return pd.DataFrame({name: np.interp(hours, knots, shares) for name, shares in PROGRESS.items()}, index)


def simulate(
    theta: pd.DataFrame, mass: pd.Series, factors: pd.DataFrame, dofs: NDArray[np.intp] | None
) -> tuple[Array, Array | None]:
    """Frequencies (n, 6) in Hz and, at ``dofs``, mode shapes (n, 6, n_dofs).

    ``mass`` is the share of the retrofit's mass, and ``factors`` multiply the stiffness of the groups that are its
    columns. A state that lasts has a model of its own, which is smaller than one of all states.
    """
    factors = factors.loc[:, (factors != 1).any()]
    changes = np.column_stack([mass, factors])
    states, state, counts = np.unique(changes, axis=0, return_inverse=True, return_counts=True)
    state = state.ravel()
    lasting = (counts >= LASTING) | (states == [0.0, *np.ones(factors.shape[1])]).all(axis=1)
    frequencies = np.empty((len(theta), 6))
    shapes = None if dofs is None else np.empty((len(theta), 6, len(dofs)))
    for number in [*np.flatnonzero(lasting), -1]:
        rows = ~lasting[state] if number < 0 else state == number
        if not rows.any():
            continue
        values = theta[rows].to_numpy()
        if number < 0:
            model, values = _varying(values, changes[rows], tuple(factors.columns))
        else:
            share, *fixed = states[number]
            changed = zip(factors.columns, fixed, strict=True)
            model = fixed_truth(float(share), tuple((group, factor) for group, factor in changed if factor != 1))
        if shapes is None or dofs is None:
            frequencies[rows] = model.frequencies(values)
        else:
            frequencies[rows], shapes[rows] = _modes_at(model, values, dofs)
    return frequencies, shapes


@lru_cache(maxsize=6)
def fixed_truth(mass: float, factors: tuple[tuple[str, float], ...]) -> ReducedModel:
    """The bridge with a share of the retrofit's mass and with groups whose stiffness is multiplied."""
    model = truth_model().damaged({group: 1 - factor for group, factor in factors})
    if mass > 0:
        model = model.with_added(mass=mass * retrofit_mass())
    return model.reduced(BOX, tol=TOLERANCE, random_state=0)


@lru_cache(maxsize=4)
def varying_truth(has_mass: bool, bounds: tuple[tuple[str, float, float], ...]) -> ReducedModel:
    """The bridge with these as further parameters, within bounds."""
    structure = truth_structure(joint_masses() if has_mass else None)
    parameters = TRUTH | ({"added": ("mass", "added")} if has_mass else {})
    model = updated_model(structure, parameters, 6).with_damage_parameters([group for group, _, _ in bounds])
    box = BOX | ({"added": (NO_MASS, 1.0)} if has_mass else {})
    box |= {f"1 - {group}": (lowest, highest) for group, lowest, highest in bounds}
    return model.reduced(box, tol=TOLERANCE, random_state=0)


def _varying(theta: Array, changes: Array, groups: tuple[str, ...]) -> tuple[ReducedModel, Array]:
    """The model whose parameters are the changes, too, and its theta."""
    mass, factors = np.maximum(changes[:, :1], NO_MASS), changes[:, 1:]
    has_mass = bool((mass > NO_MASS).any())
    lowest, highest = _floor(factors.min(axis=0)), -_floor(-factors.max(axis=0))
    bounds = tuple(zip(groups, lowest.tolist(), highest.tolist(), strict=True))
    return varying_truth(has_mass, bounds), np.hstack([theta, mass, factors] if has_mass else [theta, factors])


def _floor(values: Array) -> Array:
    """Rounded down to three digits, so that like campaigns share a reduced model."""
    return np.floor(1000 * values - 1e-6) / 1000


def _modes_at(model: ReducedModel, theta: Array, dofs: NDArray[np.intp]) -> tuple[Array, Array]:
    frequencies, shapes = np.empty((len(theta), 6)), np.empty((len(theta), 6, len(dofs)))
    for start in range(0, len(theta), ROWS):
        rows = slice(start, start + ROWS)
        frequencies[rows], everywhere = model.modes(theta[rows])
        shapes[rows] = everywhere[:, dofs].transpose(0, 2, 1)
    return frequencies, shapes


def missing_temperatures(index: pd.DatetimeIndex, random: np.random.RandomState) -> NDArray[np.bool_]:
    """Hours without temperature: until the sensor was installed, and a few blocks later."""
    block = smooth_noise(len(index), 1, 2 * BLOCK_HOURS, random)[:, 0] < ndtri(TEMPERATURE_GAPS)
    return block | (index < FIRST_TEMPERATURE)


def missing_modes(n_hours: int, random: np.random.RandomState) -> NDArray[np.bool_]:
    """Hours (n_hours, 6) in which a mode was not identified: in blocks, lateral modes of the arches together."""
    wind, outage, *own = smooth_noise(n_hours, 2 + len(COVERAGE), BLOCK_HOURS, random).T
    excitation = np.sqrt(WIND) * wind[:, np.newaxis] + np.sqrt(1 - WIND) * np.array(own).T
    return (excitation < ndtri(1 - COVERAGE / (1 - OUTAGE))) | (outage < ndtri(OUTAGE))[:, np.newaxis]


def draw_damping(steel: Array, random: np.random.RandomState) -> Array:
    """Damping ratios (n_hours, 6), lower when it is warm, with the scatter of an identification."""
    mean = DAMPING * (1 - DAMPING_BY_KELVIN * (steel[:, np.newaxis] - REFERENCE))
    scatter = DAMPING_SCATTER * random.standard_normal(mean.shape)
    return mean * np.exp(scatter - DAMPING_SCATTER**2 / 2)


def measured_shapes(clean: Array, random: np.random.RandomState) -> NDArray[np.complex128]:
    """Shapes (n, 6, n_sensors) of unit length and random phase, with complex noise."""
    noise = random.standard_normal((2, *clean.shape)) / np.sqrt(2)
    phase = np.exp(2j * np.pi * random.uniform(size=(*clean.shape[:2], 1)))
    level = SHAPE_NOISE * np.sqrt((clean**2).mean(axis=2, keepdims=True))
    noisy = (clean + level * (noise[0] + 1j * noise[1])) * phase
    return noisy / np.linalg.norm(noisy, axis=2, keepdims=True)


def make_kw51_campaign(
    *,
    n_hours: int = N_HOURS,
    noise: ArrayLike = NOISE,
    correlation: float = 0.0,
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
    noise : float or array-like of shape (6,), default=(0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0015)
        Relative standard deviation of the Gaussian noise on every frequency.
    correlation : float, default=0.0
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
            What the weather does: multipliers of the parameters of ``model``. Retrofit, drift and damage, which change
            groups, come on top.
        model : AffineModel
            The bridge before its retrofit. Its groups are those of `make_kw51`, and ``bearings`` and ``deck_beams``
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
    The bridge is the updated model of `make_kw51` with bearings added. :ref:`campaign-of-kw51` says how weather moves
    its ten multipliers, what the retrofit changes, and what is known or assumed of the measurements;
    :doc:`/accuracy_kw51` has statistics of both side by side. A model with the five thermal parameters of `make_kw51`
    as functions of tBD31A can come close to this bridge, but cannot be exact.

    Examples
    --------
    >>> from skthermo.datasets import make_kw51_campaign
    >>> campaign = make_kw51_campaign(n_hours=3000, random_state=0)
    >>> campaign.frequencies.shape, campaign.state.unique().tolist()
    ((3000, 6), ['before'])
    >>> campaign.clean_frequencies.iloc[0].round(2).tolist()
    [0.51, 1.21, 1.89, 2.51, 2.58, 2.92]
    """
    n_hours = positive_integer(n_hours, "n_hours")
    deviations = check_noise(noise, 6)
    for what, flag in (("gaps", gaps), ("retrofit", retrofit), ("shapes", shapes)):
        check_flag(flag, what)
    seeds = as_random_state(random_state).randint(2**31 - 1, size=6)
    for_weather, for_noise, for_damping, for_sensor, for_gaps, for_shapes = map(np.random.RandomState, seeds)

    sensors = kw51_sensors()
    weather = draw_weather(n_hours, for_weather)
    index, theta = weather.index, thermal_multipliers(weather)
    progress = progress_of(index, retrofit)
    strengthened = {group: share * progress["stiffness"] for group, share in STIFFENED.items()}
    factors = stiffness_factors(index, YEAR, truth_model().groups, drift, damage, damage_from, strengthened)
    clean, clean_shapes = simulate(theta, progress["mass"], factors, list(sensors.values()) if shapes else None)

    frequencies = add_noise(clean, deviations, correlation=correlation, random_state=for_noise)
    damping = draw_damping(weather["steel"].to_numpy(), for_damping)
    temperatures = weather["steel"].to_frame("tBD31A")
    missing = np.zeros(clean.shape, dtype=bool)
    if gaps:
        temperatures[missing_temperatures(index, for_sensor)] = np.nan
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
        model=truth_model(),
        retrofit={"damage": {group: -share for group, share in STIFFENED.items()}, "mass": retrofit_mass()},
    )
    if clean_shapes is not None:
        campaign.shapes = measured_shapes(clean_shapes, for_shapes)
        campaign.shapes[missing] = np.nan
    return campaign
