"""A girder bridge whose soil follows the weather slowly, for benchmarks and tests; its truth is known.

A concrete girder of four spans rests on soil springs below its piers. Soil temperature follows the air with a time
constant of 40 days, and soil stiffness follows soil temperature. Only the air and the steel of the railing are
measured.
"""

from collections import defaultdict
from functools import cache
from itertools import pairwise

import numpy as np
import pandas as pd
from scipy.special import ndtri
from sklearn.utils import Bunch

from skthermo.datasets._fleet_site import Law, SiteClimate, drawn_by_hour, persistent, stream
from skthermo.datasets._kw51_campaign import memory
from skthermo.fem import Beam, Spring, Structure

SPANS = (24.0, 33.0, 38.0, 29.0)  # m
CONCRETE = {"E": 34e9, "G": 14e9, "A": 6.0, "I_yy": 1.8, "I_zz": 30.0, "J": 2.2, "density": 2500.0, "I_p": 40.0}
PAVEMENT = {"E": 34e9, "G": 14e9, "A": 0.3, "I_yy": 0.1, "I_zz": 0.5, "J": 0.05}
BEARING = {"y": 1.8e8, "z": 1.5e9, "rx": 5e9}  # N/m, N m/rad
SOIL = {"y": 1.2e8, "z": 7e8, "rx": 6e9, "ry": 1.2e9}
PARAMETERS = [*(f"span {i + 1}" for i in range(4)), "torsion", "pavement", "bearings", "soil 1", "soil 2", "soil 3"]
GROUPS = [*(f"span {i + 1}" for i in range(4)), "bearings", "soil 1", "soil 2", "soil 3"]
DAMAGES = [{"span 2": 0.2}, {"bearings": 0.2}, {"soil 1": 0.2}, {"soil 2": 0.2}]
MODEL_ERROR = (0.03, 0.08)  # of each parameter of the user's model
N_MODES = 7

CLIMATE = SiteClimate(latitude=47.0, mean=10.0, season=10.0, swing=3.5, scatter=3.5, memory_hours=72.0)
CONCRETE_LAW = Law(slope=-1.5e-3, hours=12.0, sun=4.0)
SOIL_LAW = Law(slope=-8e-3)
LAWS = {
    "concrete west": CONCRETE_LAW,
    "concrete east": Law(slope=-1.5e-3, hours=12.0, sun=8.0),
    "pavement": Law(slope=-2.5e-2, gain=3e-2, limit=0.4, hours=4.0, sun=8.0),
    "bearings": Law(slope=-2.5e-3, hours=6.0),
    **dict.fromkeys(("soil 1", "soil 2", "soil 3"), SOIL_LAW),
}
SENSORS = {"air": (0.0, 0.5), "steel": (2.0, 4.0)}  # thermal inertia in hours, warming by full sunshine in K
HOURS = 2  # from one record to the next
GAP_HOURS = 36.0
OUTAGES = 0.5  # share of the gaps in which no mode is identified
WEATHER, FREQUENCIES, TEMPERATURES, ERRORS = range(4)


def girder(n_elements, factors=None):
    """A structure whose spans have so many elements; ``factors`` multiply the stiffness of what they name."""
    factors = dict.fromkeys(PARAMETERS, 1.0) | (factors or {})
    axes = np.cumsum([0.0, *SPANS])
    line = [x for start, end in pairwise(axes) for x in np.linspace(start, end, n_elements + 1)[:-1]] + [axes[-1]]
    groups = defaultdict(list)
    members = {}
    for i, ends in enumerate(pairwise(line)):
        span = f"span {i // n_elements + 1}"
        bending = {name: factors[span] * CONCRETE[name] for name in ("I_yy", "I_zz")}
        torsion = {"J": factors["torsion"] * CONCRETE["J"]}
        members["concrete", i] = Beam(*ends, **CONCRETE | bending | torsion)
        members["pavement", i] = Beam(*ends, **PAVEMENT | {"E": factors["pavement"] * PAVEMENT["E"]})
        for group in (span, "girder", "concrete west" if i < 2 * n_elements else "concrete east"):
            groups[group].append(("concrete", i))
        groups["pavement"].append(("pavement", i))
    supports = zip(axes, ("bearings", "soil 1", "soil 2", "soil 3", "bearings"), strict=True)
    for x, support in supports:
        for direction, k in (BEARING if support == "bearings" else SOIL).items():
            members[support, x, direction] = Spring(x, direction, factors[support] * k)
            groups[support].append((support, x, direction))
    return Structure({x: (x, 0.0, 0.0) for x in line}, members, dict.fromkeys(line, "x"), groups)


@cache
def truth_model():
    """How the bridge behaves, of 365 degrees of freedom; thermal zones are the parameters."""
    return girder(18).assemble(list(LAWS), groups=GROUPS, n_modes=N_MODES)


@cache
def user_model(seed):
    """The user's model of 205 degrees of freedom, with stiffnesses that are 3 to 8 % off."""
    random = stream(seed, ERRORS)
    off = random.uniform(*MODEL_ERROR, len(PARAMETERS)) * random.choice([-1, 1], len(PARAMETERS))
    bending = {f"span {i + 1}": ("E", f"span {i + 1}") for i in range(4)}
    bound = bending | {"torsion": ("G", "girder")} | {name: name for name in PARAMETERS[5:]}
    structure = girder(10, dict(zip(PARAMETERS, 1 + off, strict=True)))
    return structure.assemble(bound, groups=GROUPS, n_modes=N_MODES)


def slow_soil(
    seed=0,
    start="2024-01-01",
    n_days=425,
    *,
    damage=None,
    noise=0.003,
    correlation=0.5,
    gaps=0.1,
    outliers=0.005,
    soil_days=40.0,
):
    """Two-hourly records of the bridge from a date on.

    Weather, noise, gaps and outliers depend on seed and date alone: damaged records have the weather of healthy ones,
    and those of a later date go on with it.

    Parameters
    ----------
    seed : int
        Seed of the weather, the measurement and the errors of the user's model.
    start, n_days : str, int
        First day and number of days.
    damage : mapping of str to float, optional
        Severity by damage group.
    noise, correlation : float
        Relative standard deviation, and correlation from one record to the next.
    gaps, outliers : float
        Share of frequencies that are missing, for a day or two at a time, and that are wrong by ten times the noise.
    soil_days : float
        Time constant with which the soil follows the air, in days; 0 for soil without memory.

    Returns
    -------
    Bunch
        temperatures (air and steel), frequencies, clean_frequencies, soil (its temperature) and theta (multipliers of
        ``truth``) as frames; model, of the user; truth; noise; groups that can be damaged.
    """
    index = pd.date_range(start, periods=n_days * 24 // HOURS, freq=f"{HOURS}h", name="time")
    weather = CLIMATE.weather(index[0], index[-1] + pd.Timedelta(hours=HOURS), (seed, WEATHER))
    years, rows = weather.index.year.unique(), weather.index.get_indexer(index)

    def means(hourly):
        return hourly[rows[0] : rows[-1] + HOURS].reshape(len(index), HOURS).mean(axis=1)

    soil = means(memory(weather["air"].to_numpy(), 24 * soil_days))
    zones = {name: soil if law is SOIL_LAW else means(law.temperature(weather)) for name, law in LAWS.items()}
    theta = np.exp(np.column_stack([LAWS[name].log_multiplier(values) for name, values in zones.items()]))
    box = np.column_stack([0.99 * theta.min(axis=0), 1.01 * theta.max(axis=0)])
    truth = truth_model()
    clean = truth.damaged(damage or {}).reduced(box, random_state=0).frequencies(theta)
    drawn = drawn_by_hour(years, 3 * N_MODES + 1, (seed, FREQUENCIES))
    measured = spoiled(clean, noise, correlation, gaps, outliers, drawn, rows)
    reading = 0.2 * drawn_by_hour(years, len(SENSORS), (seed, TEMPERATURES))[rows]
    read = {
        name: means(memory((weather["air"] + sun * weather["sun"]).to_numpy(), hours)) + reading[:, i]
        for i, (name, (hours, sun)) in enumerate(SENSORS.items())
    }
    modes = [f"f{mode + 1}" for mode in range(N_MODES)]
    return Bunch(
        temperatures=pd.DataFrame(read, index),
        frequencies=pd.DataFrame(measured, index, modes),
        clean_frequencies=pd.DataFrame(clean, index, modes),
        soil=pd.Series(soil, index, name="soil"),
        theta=pd.DataFrame(theta, index, list(LAWS)),
        model=user_model(seed),
        truth=truth,
        noise=noise,
        groups=GROUPS,
    )


def spoiled(clean, noise, correlation, gaps, outliers, drawn, rows):
    """Frequencies with noise, outliers and gaps from hourly white noise, of which ``rows`` are the records."""
    white, wrong, missing = np.split(drawn[:, : 3 * clean.shape[1]], 3, axis=1)
    lasting = persistent(white[rows[0] % HOURS :: HOURS], -1 / np.log(correlation) if correlation else 1e-3)
    relative = noise * lasting[rows // HOURS]
    is_wrong = np.abs(wrong[rows]) > ndtri(1 - outliers / 2)
    relative += np.where(is_wrong, 10 * noise * np.sign(wrong[rows]), 0.0)
    share = gaps * (1 - OUTAGES) / (1 - gaps * OUTAGES)  # of what is measured at all
    lost = persistent(missing, GAP_HOURS)[rows] < ndtri(share)
    outage = persistent(drawn[:, -1:], GAP_HOURS)[rows] < ndtri(gaps * OUTAGES)
    return np.where(lost | outage, np.nan, clean * (1 + relative))
