"""Structures of known truth, and campaigns of records of them, that several benchmarks measure.

- `frame_bridge`: a tied-arch bridge, as fine as wanted; `building_frame`: an exported model.
- `Footbridge`: a cable-stayed footbridge with two years of records every two hours. Asphalt, cables that sag, frost in
  the core of the deck, and bearings that stiffen as they freeze move its frequencies, and noise that lasts.
- `slow_soil`: a girder whose soil follows the weather slowly.
- `Site`: a girder whose bearings freeze, and an arch with moisture that nobody measures.
- `Campaign`: records of one of `KNOWN` structures, and a chain that has learned them; later records with damage.
- `AgeingTruss`: campaigns of a truss that ages for years, and chains that learn from their first year.
"""

from collections import defaultdict
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import pairwise

import numpy as np
import pandas as pd
import scipy.io
from harness import DATA, autoregression, joined
from inside import Law, SiteClimate, drawn_by_hour, memory, part_temperature, persistent, stream
from scipy.signal import lfilter
from scipy.special import ndtri
from sklearn.pipeline import make_pipeline
from sklearn.utils import Bunch

from skthermo.datasets import kw51_sensors, make_fleet, make_kw51, make_truss, make_truss_campaign
from skthermo.fem import AffineModel, Bar, Beam, PointMass, Spring, Structure, add_noise
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, PosteriorInverse

STEEL = {"E": 210e9, "G": 81e9, "density": 7850.0}

SPAN, WIDTH, RISE = 120.0, 14.0, 20.0
ARCH = STEEL | {"A": 0.12, "I_yy": 0.025, "I_zz": 0.02, "J": 0.03}
GIRDER = STEEL | {"A": 0.12, "I_yy": 0.08, "I_zz": 0.06, "J": 0.02}
STRINGER = STEEL | {"A": 0.03, "I_yy": 2e-3, "I_zz": 2e-3, "J": 2e-4}
CROSS_BEAM = STEEL | {"A": 0.03, "I_yy": 4e-3, "I_zz": 2e-4, "J": 3e-5}
BRACE = STEEL | {"A": 0.02, "I_yy": 6e-4, "I_zz": 6e-4, "J": 1e-3}
HANGER = {"E": 195e9, "A": 0.0015, "density": 7850.0}
SLAB = 600.0  # mass of the deck's slab, kg for each square metre


def frame_bridge(n_bays=40, n_elements=4, n_stringers=9, n_zones=1, **options):
    """Two arches over a grillage of girders, stringers and cross beams: 5 parameters, 20,940 degrees of freedom.

    Hangers stand at the ends of the ``n_bays`` bays, and every other member is cut into ``n_elements`` beams. The
    deck is ``n_zones`` parameters, one after the other along the bridge.
    """
    decks = ["deck", *(f"deck {zone}" for zone in range(2, n_zones + 1))]
    nodes, members, groups = {}, {}, {g: [] for g in (*decks, "arches", "hangers", "bracing", "bearings")}
    lines = range(n_stringers + 2)
    stations = np.linspace(0, SPAN, n_bays + 1)
    offsets = np.linspace(-WIDTH / 2, WIDTH / 2, len(lines))
    heights = 4 * RISE * stations * (SPAN - stations) / SPAN**2

    def line(group, first, last, section):
        between = [(first, last, i) for i in range(1, n_elements)]
        for i, node in enumerate(between, start=1):
            nodes[node] = tuple(nodes[first] + np.subtract(nodes[last], nodes[first]) * i / n_elements)
        for ends in pairwise([first, *between, last]):
            add(group, ends, Beam(*ends, **section))

    def add(group, name, member):
        members[name] = member
        groups[group].append(name)

    for i, x in enumerate(stations):
        nodes |= {("deck", i, j): (x, y, 0.0) for j, y in enumerate(offsets)}
        if 0 < i < n_bays:
            nodes |= {("arch", i, j): (x, offsets[j], heights[i]) for j in (0, lines[-1])}

    def arch(i, j):
        return ("arch" if 0 < i < n_bays else "deck", i, j)

    def deck(bay):
        return decks[bay * n_zones // n_bays]

    for i in range(n_bays):
        for j in lines:
            line(deck(i), ("deck", i, j), ("deck", i + 1, j), GIRDER if j in (0, lines[-1]) else STRINGER)
        for j in (0, lines[-1]):
            line("arches", arch(i, j), arch(i + 1, j), ARCH)
    for i in range(n_bays + 1):
        for j, k in pairwise(lines):
            line(deck(min(i, n_bays - 1)), ("deck", i, j), ("deck", i, k), CROSS_BEAM)
        for j in lines:
            members["slab", i, j] = PointMass(("deck", i, j), SLAB * SPAN * WIDTH / ((n_bays + 1) * len(lines)))
    for i in range(1, n_bays):
        for j in (0, lines[-1]):
            add("hangers", ("hanger", i, j), Bar(("deck", i, j), ("arch", i, j), **HANGER))
    high = [i for i in range(1, n_bays) if heights[i] > RISE / 2]
    for i in high:
        line("bracing", ("arch", i, 0), ("arch", i, lines[-1]), BRACE)
    for i, k in pairwise(high):
        line("bracing", ("arch", i, 0), ("arch", k, lines[-1]), BRACE)
    for i in (0, n_bays):
        for j in (0, lines[-1]):
            for direction, k in (("x", 4e8), ("y", 4e8), ("z", 4e9)):
                add("bearings", ("bearing", i, j, direction), Spring(("deck", i, j), direction, k))
    return Structure(nodes, members, {}, groups).assemble(list(groups), **options)


def building_frame(**options):
    """An exported model of 2302 degrees of freedom, 913 of them massless, and 14 parameters."""
    content = scipy.io.loadmat(DATA / "building_frame" / "ConcreteBuildingFrame.mat", spmatrix=False)
    names = [f"E_{i}" for i in range(1, 13)] + ["Influence_Link", "Influence_Rebar"]
    return AffineModel({(name,): content[name] for name in names}, content["M0"], **options)


DECK = {"E": 32e9, "G": 13e9, "density": 3400.0, "A": 0.9, "I_yy": 0.022, "I_zz": 0.4, "J": 0.05}
PYLON = STEEL | {"A": 0.06, "I_yy": 0.006, "I_zz": 0.006, "J": 0.01}
STAY = {"E": 165e9, "A": 0.0018, "density": 7850.0}
SIDE, MAIN, TOP, FOOT = 24.0, 42.0, 16.0, -7.0
STEP = 1.5  # length of the deck's beams, m
FOOTBRIDGE_GROUPS = ("side span", "main span", "pylon", "backstays", "main stays", "bearings")


def footbridge(pylon=1.0, stations=None, stiffness=None):
    """The bridge in the plane x-z, 168 degrees of freedom; other stations of the deck and stiffer groups if given."""
    factors = dict.fromkeys(FOOTBRIDGE_GROUPS, 1.0) | {"pylon": pylon} | (stiffness or {})
    nodes, members, groups = {}, {}, {group: [] for group in FOOTBRIDGE_GROUPS}

    def add(group, name, member):
        members[name] = member
        groups[group].append(name)

    def scaled(group, section):
        return section | {"E": factors[group] * section["E"]}

    stations = (np.arange(0, SIDE + MAIN + STEP / 2, STEP) if stations is None else np.asarray(stations)).tolist()
    nodes |= {("deck", x): (x, 0.0, 0.0) for x in stations}
    heights = np.linspace(FOOT, TOP, 12).tolist()
    nodes |= {("pylon", z): (SIDE, 0.0, z) for z in heights}
    for i, k in pairwise(stations):
        group = "side span" if k <= SIDE else "main span"
        add(group, ("deck", i), Beam(("deck", i), ("deck", k), **scaled(group, DECK)))
    for i, k in pairwise(heights):
        add("pylon", ("pylon", i), Beam(("pylon", i), ("pylon", k), **scaled("pylon", PYLON)))
    for group, ends in (("backstays", (0.0, 7.5, 15.0)), ("main stays", (33.0, 42.0, 51.0, 58.5))):
        for x, height in zip(ends, (-1, -2, -3) if group == "backstays" else (-4, -3, -2, -1), strict=True):
            add(group, ("stay", x), Bar(("deck", x), ("pylon", heights[height]), **scaled(group, STAY)))
    for x in (0.0, SIDE, SIDE + MAIN):
        add("bearings", ("bearing", x), Spring(("deck", x), "z", 8e7 * factors["bearings"]))
    add("bearings", "longitudinal", Spring(("deck", 0.0), "x", 3e8 * factors["bearings"]))
    supports = dict.fromkeys(nodes, "y rx rz") | {("pylon", FOOT): "xyz rx ry rz"}
    return Structure(nodes, members, supports, groups)


def footbridge_weather(random, n_years=2):
    """Air, girder and cable, and what no thermometer sees: the core of the deck."""
    times = pd.date_range("2022-01-01", periods=n_years * 365 * 12, freq="2h")
    h = 2 * np.arange(len(times))
    fronts = 11 * pd.Series(random.normal(0, 1, len(h))).ewm(halflife=24).mean().to_numpy()
    day = np.clip(np.sin(2 * np.pi * (h - 6) / 24), 0, None)
    summer = -np.cos(2 * np.pi * (h / 24 - 20) / 365)
    sun = day * (7 + 5 * summer) * random.uniform(0.2, 1.0, len(h) // 12).repeat(12)
    air = 9 + 11 * summer + fronts + 0.45 * sun
    girder = pd.Series(air + 0.8 * sun).ewm(halflife=4).mean().to_numpy()
    cable = pd.Series(air + 0.5 * sun).ewm(halflife=0.7).mean().to_numpy()
    core = pd.Series(girder).ewm(halflife=5).mean().to_numpy()
    T = pd.DataFrame(np.column_stack([air, girder, cable]), times, ["air", "girder", "cable"])
    return T + random.normal(0, 0.15, T.shape), core


def footbridge_properties(T, core):
    """Multipliers of the groups: asphalt, cables that sag, bearings that stiffen as they freeze."""
    air, cable = T["air"].to_numpy(), T["cable"].to_numpy()
    frost = 1 / (1 + np.exp(core / 1.2))
    deck = 1 - 0.0032 * (core - 10) + 0.06 * frost
    stays = 1 - 0.0018 * (cable - 10)
    bearings = np.exp(-0.006 * (air - 10)) * (1 + 0.5 * frost)
    return np.column_stack([deck, deck, 1 - 0.0004 * (air - 10), stays, stays, bearings])


class Footbridge:
    """Two years of records: the first trains, the second is evaluated."""

    groups, modes, sensors = FOOTBRIDGE_GROUPS, [f"f{i}" for i in range(1, 7)], ["air", "girder", "cable"]
    per_day, noise = 12, 0.003  # relative standard deviation of one record

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        model = footbridge().assemble(FOOTBRIDGE_GROUPS, n_modes=len(self.modes))
        self.T, core = footbridge_weather(random)
        theta = footbridge_properties(self.T, core)
        self.n = len(theta) // 2
        slow = (
            0.001
            * pd.DataFrame(random.normal(0, 1, (len(theta), len(self.modes)))).ewm(halflife=6).mean().to_numpy()
            * 4
        )
        self.theta, self.seed, self.slow = theta, seed, slow
        self.model = model.reduced([[0.5, 2.2]] * len(FOOTBRIDGE_GROUPS), random_state=0)
        self.gaps = random.random((len(theta), len(self.modes))) < 0.1
        self.lost = np.repeat(random.random((len(theta), 1)) < 0.02, len(self.sensors), axis=1)
        wrong = random.random((len(theta), len(self.modes))) < 0.01
        self.wrong = np.where(wrong, random.choice([-1, 1], wrong.shape) * random.uniform(0.03, 0.08, wrong.shape), 0)

    def frequencies(self, rows, damage, theta, **kind):
        model = self.model.damaged(damage, **kind) if damage else self.model
        clean = model.frequencies(theta) * (1 + self.slow[rows])
        F = add_noise(clean, self.noise, random_state=self.seed + rows.start)
        return pd.DataFrame(F, self.T.index[rows], self.modes)

    def training(self, dirty):
        rows = slice(0, self.n)
        F, T = self.frequencies(rows, {}, self.theta[rows]), self.T[: self.n]
        if dirty:
            F = (F * (1 + self.wrong[rows])).mask(self.gaps[rows])
            T = T.mask(self.lost[rows])
        return T.join(F)

    def evaluated(self, damage, **kind):
        """The second year, without gaps and outliers."""
        rows = slice(self.n, 2 * self.n)
        return self.T[self.n :].join(self.frequencies(rows, damage, self.theta[rows], **kind))


def lagged(regressor):
    """Now, six hours and a day ago."""
    return make_pipeline(LagFeatures([0, 3, 12], freq="2h"), regressor)


SPANS = (24.0, 33.0, 38.0, 29.0)  # m
CONCRETE = {"E": 34e9, "G": 14e9, "A": 6.0, "I_yy": 1.8, "I_zz": 30.0, "J": 2.2, "density": 2500.0, "I_p": 40.0}
PAVEMENT = {"E": 34e9, "G": 14e9, "A": 0.3, "I_yy": 0.1, "I_zz": 0.5, "J": 0.05}
BEARING = {"y": 1.8e8, "z": 1.5e9, "rx": 5e9}  # N/m, N m/rad
SOIL = {"y": 1.2e8, "z": 7e8, "rx": 6e9, "ry": 1.2e9}
SOIL_PARAMETERS = [
    *(f"span {i + 1}" for i in range(4)),
    "torsion",
    "pavement",
    "bearings",
    "soil 1",
    "soil 2",
    "soil 3",
]
SOIL_GROUPS = [*(f"span {i + 1}" for i in range(4)), "bearings", "soil 1", "soil 2", "soil 3"]
MODEL_ERROR = (0.03, 0.08)  # of each parameter of the user's model
SOIL_MODES = 7

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
SOIL_SENSORS = {"air": (0.0, 0.5), "steel": (2.0, 4.0)}  # thermal inertia in hours, warming by full sunshine in K
SOIL_DAYS = 40.0  # with which the soil follows the air
HOURS = 2  # from one record to the next
GAP_HOURS = 36.0
OUTAGES = 0.5  # share of the gaps in which no mode is identified
WEATHER, FREQUENCIES, TEMPERATURES, ERRORS = range(4)


def soil_girder(n_elements, factors=None):
    """A structure whose spans have so many elements; ``factors`` multiply the stiffness of what they name."""
    factors = dict.fromkeys(SOIL_PARAMETERS, 1.0) | (factors or {})
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
    return soil_girder(18).assemble(list(LAWS), groups=SOIL_GROUPS, n_modes=SOIL_MODES)


@cache
def user_model(seed):
    """The user's model of 205 degrees of freedom, with stiffnesses that are 3 to 8 % off."""
    random = stream(seed, ERRORS)
    off = random.uniform(*MODEL_ERROR, len(SOIL_PARAMETERS)) * random.choice([-1, 1], len(SOIL_PARAMETERS))
    bending = {f"span {i + 1}": ("E", f"span {i + 1}") for i in range(4)}
    bound = bending | {"torsion": ("G", "girder")} | {name: name for name in SOIL_PARAMETERS[5:]}
    structure = soil_girder(10, dict(zip(SOIL_PARAMETERS, 1 + off, strict=True)))
    return structure.assemble(bound, groups=SOIL_GROUPS, n_modes=SOIL_MODES)


def slow_soil(
    seed=0, start="2024-01-01", n_days=425, *, damage=None, noise=0.003, correlation=0.5, gaps=0.1, outliers=0.005
):
    """Two-hourly records of the bridge from a date on.

    Weather, noise, gaps and outliers depend on seed and date alone: damaged records have the weather of healthy ones,
    and those of a later date go on with it.

    ``noise`` is relative, ``gaps`` a share of frequencies that are missing, for a day or two at a time,
    ``outliers`` of those that are wrong by ten times the noise.
    """
    index = pd.date_range(start, periods=n_days * 24 // HOURS, freq=f"{HOURS}h", name="time")
    weather = CLIMATE.weather(index[0], index[-1] + pd.Timedelta(hours=HOURS), (seed, WEATHER))
    years, rows = weather.index.year.unique(), weather.index.get_indexer(index)

    def means(hourly):
        return hourly[rows[0] : rows[-1] + HOURS].reshape(len(index), HOURS).mean(axis=1)

    soil = means(memory(weather["air"].to_numpy(), 24 * SOIL_DAYS))
    zones = {
        name: soil if law is SOIL_LAW else means(part_temperature(weather, law.hours, law.sun))
        for name, law in LAWS.items()
    }
    theta = np.exp(np.column_stack([LAWS[name].log_multiplier(values) for name, values in zones.items()]))
    box = np.column_stack([0.99 * theta.min(axis=0), 1.01 * theta.max(axis=0)])
    clean = truth_model().damaged(damage or {}).reduced(box, random_state=0).frequencies(theta)
    drawn = drawn_by_hour(years, 3 * SOIL_MODES + 1, (seed, FREQUENCIES))
    measured = soil_spoiled(clean, noise, correlation, gaps, outliers, drawn, rows)
    reading = 0.2 * drawn_by_hour(years, len(SOIL_SENSORS), (seed, TEMPERATURES))[rows]
    read = {
        name: means(memory((weather["air"] + sun * weather["sun"]).to_numpy(), hours)) + reading[:, i]
        for i, (name, (hours, sun)) in enumerate(SOIL_SENSORS.items())
    }
    modes = [f"f{mode + 1}" for mode in range(SOIL_MODES)]
    return Bunch(
        temperatures=pd.DataFrame(read, index),
        frequencies=pd.DataFrame(measured, index, modes),
        clean_frequencies=pd.DataFrame(clean, index, modes),
        model=user_model(seed),
        noise=noise,
    )


def soil_spoiled(clean, noise, correlation, gaps, outliers, drawn, rows):
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


class Site:
    """A bridge of ``make_fleet`` under laws of its own, three-hourly; the model that comes with it is a little wrong.

    - "frozen girder": bearings that are seven times as stiff in frost, asphalt, concrete.
    - "moist arch": steel, concrete with moisture of 20 days that no weather tells, and bearings on soil that follows
      the air with 30 days.

    The weather of some years from 2024 on goes on; two thermometers have errors of .2 K.
    """

    KINDS = {"frozen girder": "girder", "moist arch": "arch"}

    def __init__(self, name, seed=0, years=2):
        self.bridge = next(
            one for one in make_fleet(3, atypical=0.0, random_state=seed).values() if one.kind == self.KINDS[name]
        )
        self.name, self.seed, self.model = name, seed, self.bridge.model
        end = pd.Timestamp(2024 + years, 1, 1)
        self.index = pd.date_range("2024-01-01", end, freq="3h", inclusive="left", name="time")
        weather = CLIMATE.weather(self.index[0], self.index[-1] + pd.Timedelta(hours=3), (seed, WEATHER))
        rows = weather.index.get_indexer(self.index)
        self.weather = {
            part: part_temperature(weather, hours, sun)[rows]
            for part, (hours, sun) in {
                "air": (0.0, 0.5),
                "steel": (3.0, 5.0),
                "concrete": (12.0, 6.0),
                "soil": (720.0, 0.0),
            }.items()
        }
        self.theta = self._multipliers()
        random = np.random.default_rng(seed)
        self.noise = 0.003 * random.standard_normal((len(self.index), self.model.n_modes))
        self.missing = random.random(self.noise.shape) < 0.05
        self.temperatures = pd.DataFrame(
            {name: self.weather[name] + 0.2 * random.standard_normal(len(self.index)) for name in ("air", "steel")},
            self.index,
        )

    def _multipliers(self):
        """By zone of the truth."""
        air, steel, concrete, soil = self.weather.values()
        asphalt = 1 - 0.02 * (steel - 10) + 0.3 / (1 + np.exp((steel - 2) / 3))
        if self.name == "frozen girder":
            stiff, bearings = 1 - 0.0012 * (concrete - 10), 1 + 6 / (1 + np.exp((air + 3) / 0.7))
            zones = {
                "west": stiff,
                "east": stiff,
                "pavement": asphalt,
                "bearings": bearings,
                "soil": 1 - 0.001 * (soil - 10),
            }
        else:
            moisture = autoregression(np.random.default_rng(self.seed + 1), (len(self.index), 1), np.exp(-1 / 160))[
                :, 0
            ]
            stiff = 1 - 0.0008 * (steel - 10)
            zones = {"west": stiff, "east": stiff, "pavement": asphalt, "bearings": np.exp(-0.006 * (soil - 10))}
            zones["girder"] = 1 - 0.0015 * (concrete - 10) + 0.01 * moisture
        return np.column_stack([zones[name] for name in self.bridge.truth.parameter_names])

    def records(self, year, damage=None):
        """Temperatures and frequencies of a year side by side."""
        rows = self.index.year == year
        truth = self.bridge.truth.damaged(damage or {})
        box = np.column_stack([0.99 * self.theta.min(axis=0), 1.01 * self.theta.max(axis=0)])
        F = truth.reduced(box, random_state=0).frequencies(self.theta[rows]) * (1 + self.noise[rows])
        modes = [f"f{mode + 1}" for mode in range(F.shape[1])]
        return self.temperatures[rows].join(
            pd.DataFrame(np.where(self.missing[rows], np.nan, F), self.index[rows], modes)
        )


TRAINING_DAYS, LATER_DAYS = 730, 90
WRONG = 0.05  # relative error of each group's stiffness in a wrong model, up or down by chance
CORRELATIONS = (0.0, 0.5, 0.9)
SEVERITIES = (-0.01, 0.5)  # that reduced models of the truth cover
N_SHAPES = 5  # measured shapes that are averaged
SHAPE_NOISE = 0.01


def days(n_records, random):
    """Daily temperatures: a season, and weather that lasts some days."""
    weather = lfilter([1.0], [1.0, -0.7], random.standard_normal(n_records + 50))[50:]
    day = np.arange(n_records) + random.randint(365)
    return pd.DataFrame({"T": 12 - 11 * np.cos(2 * np.pi * day / 365) + 2 * weather})


def law(T, n_parameters):
    """Multipliers that fall with temperature, each at another rate and with another curvature."""
    x = (T.to_numpy() - 12) / 10
    rates, bends = np.linspace(0.01, 0.03, n_parameters), np.linspace(0.004, -0.002, n_parameters)
    return 1 - rates * x + bends * x**2


def memory_of(seed):
    """Correlation of neighbouring records: each structure has campaigns with all three."""
    return CORRELATIONS[seed % len(CORRELATIONS)]


def spoiled(F, seed):
    """Later records as they come: gaps in every third campaign, outliers in every fourth."""
    random, values = np.random.RandomState(seed), F.copy()
    if seed % 3 == 1:
        values = values.mask(random.random_sample(values.shape) < 0.1)
    if seed % 4 == 2:
        wrong = random.random_sample(values.shape) < 0.01
        values = values * (1 + wrong * random.choice([-1, 1], wrong.shape) * random.uniform(0.03, 0.08, wrong.shape))
    return values


@dataclass
class Campaign:
    """One campaign: records that a chain learns, and later ones with damage."""

    structure: object
    seed: int
    wrong: bool = False

    @cached_property
    def fem(self):
        """The fitted chain, made when it is first needed."""
        return self.chain(self.model).fit(*self.records)

    @property
    def model(self):
        """The model that the engineer has."""
        model = self.structure.coarse if self.wrong else self.structure.model
        if not self.wrong:
            return model
        random = np.random.RandomState(9000 + self.seed)
        return model.damaged({group: WRONG * random.choice([-1, 1]) for group in self.structure.groups})

    def chain(self, model):
        """A chain of one model, to be fitted."""
        box = 0.3
        small = model.reduced(box, random_state=0) if self.structure.is_large else model
        return DataInformedFEM(
            model,
            inverse=PosteriorInverse(small, noise=self.structure.noise),
            aligner=BiasAligner(small, method="scale") if self.wrong else "passthrough",
            reduce=self.structure.is_large,
            random_state=self.seed,
        )

    @cached_property
    def records(self):
        """Healthy temperatures and frequencies to learn from."""
        return self.structure.records(TRAINING_DAYS, {}, memory_of(self.seed), 1000 + self.seed)

    def later(self, damage, number):
        """Later records with some damage; another number for other weather and noise."""
        seed = 100_000 + 1000 * self.seed + number
        T, F = self.structure.records(LATER_DAYS, damage, memory_of(self.seed), seed)
        return T, spoiled(F, seed)


@dataclass
class KnownTruss:
    """The truss, by its thermo-mechanical law, in which three thermal zones cut across the groups."""

    name: str = "truss"
    noise: float = 0.01
    is_large: bool = False
    groups: tuple = ("bottom", "top", "diagonal", "vertical")

    @property
    def model(self):
        return make_truss()

    coarse = model

    def records(self, n_records, damage, memory, seed):
        n_years = -(-n_records // 365)
        year = make_truss_campaign(n_years, damage=damage or None, correlation=memory, random_state=seed)
        first = np.random.RandomState(seed).randint(365 * n_years - n_records + 1)
        rows = slice(first, first + n_records)
        return year.temperatures[rows], year.frequencies[rows]


@dataclass
class Smooth:
    """A structure whose parameters vary smoothly with one temperature.

    The truth is a reduced model of its own parameters and damage groups; ``coarse`` is the model of coarser elements
    where there is one.
    """

    name: str
    model: object
    coarse: object
    truth: object
    groups: tuple
    noise: float
    is_large: bool
    sensors: list | None = None

    @classmethod
    def of(cls, name, model, groups, noise, *, fine=None, is_large=True, sensors=None):
        fine = model if fine is None else fine
        n_parameters = len(fine.parameter_names)
        bounds = [[0.88, 1.12]] * n_parameters + [[1 - SEVERITIES[1], 1 - SEVERITIES[0]]] * len(groups)
        truth = fine.with_damage_parameters(groups).reduced(bounds, random_state=0)
        return cls(name, model, model, truth, tuple(groups), noise, is_large, sensors)

    def records(self, n_records, damage, memory, seed):
        random = np.random.RandomState(seed)
        T = days(n_records, random)
        theta = self.theta(T, damage)
        F = self.truth.frequencies(theta)
        F = F * (1 + self.noise * autoregression(random, F.shape, memory, 100))
        return T, pd.DataFrame(F, columns=[f"f{i + 1}" for i in range(F.shape[1])])

    def theta(self, T, damage):
        n_parameters = len(self.truth.parameter_names) - len(self.groups)
        factors = [1 - damage.get(group, 0.0) for group in self.groups]
        return np.hstack([law(T, n_parameters), np.tile(factors, (len(T), 1))])

    def shapes(self, damage, seed):
        """Mode shapes at the sensors, healthy and damaged, each a mean of some measured ones."""
        random, found = np.random.RandomState(seed), []
        mean = pd.DataFrame({"T": [12.0]})
        for state in ({}, damage):
            clean = self.truth.modes(self.theta(mean, state))[1][0][self.sensors]
            error = SHAPE_NOISE / np.sqrt(N_SHAPES) * np.abs(clean).max(axis=0)
            found.append(clean + error * random.standard_normal(clean.shape))
        return tuple(found)


@cache
def known_truss():
    return KnownTruss()


@cache
def known_kw51():
    groups = ("girders", "transverse_beams", "stiffeners", "plate", "ballast", "arch", "deck_connections", "braces")
    model = make_kw51(["E_bot", "E_arc", "E_br"])
    return Smooth.of(
        "KW51", model, (*groups, "arch_connections", "pipes"), 0.002, sensors=list(kw51_sensors().values())
    )


SEVEN_GROUPS = ("side span", "main span", "tip", "pylon", "backstays", "main stays", "bearings")
TIP = 45.0
STAYED = [0, 7.5, 15, 24, 33, 42, 51, 58.5, 66]
"""Stations of the deck where something joins it."""


@cache
def known_footbridge():
    coarse = sorted([*STAYED, *(np.add(STAYED[1:], STAYED[:-1]) / 2).tolist()])
    fine = seven_groups(footbridge()).assemble(SEVEN_GROUPS, n_modes=6, track=True)
    bridge = Smooth.of("footbridge", fine, SEVEN_GROUPS, 0.002, is_large=False)
    bridge.coarse = seven_groups(footbridge(stations=coarse)).assemble(SEVEN_GROUPS, n_modes=6, track=True)
    bridge.is_large = True
    return bridge


def seven_groups(bridge):
    """The main span in two."""
    groups = dict(bridge.groups)
    tip = {("deck", x) for kind, x in groups["main span"] if x >= TIP}
    groups |= {"tip": tip, "main span": groups["main span"] - tip}
    return Structure(bridge.nodes, bridge.members, bridge.supports, groups)


KNOWN = {
    "truss": known_truss,
    "KW51": known_kw51,
    "footbridge": known_footbridge,
}


class AgeingTruss:
    """Daily records with 1 % of noise."""

    groups = ("bottom", "top", "diagonal")

    def campaign(self, n_years, seed, correlation=0.0, **changes):
        """Records, of which a number are the first year."""
        return joined(make_truss_campaign(n_years, correlation=correlation, random_state=seed, **changes)), 365

    def quiet_first(self, n_years, seed, correlation=0.0, **changes):
        """A year without changes, and years with them, whose drift begins then."""
        first, later = (
            self.campaign(1, 1000 + seed, correlation),
            self.campaign(n_years - 1, seed, correlation, **changes),
        )
        return pd.concat([first[0], later[0].set_axis(later[0].index + pd.Timedelta(days=365))]), 365

    def chain(self):
        return DataInformedFEM(
            make_truss(), inverse=PosteriorInverse(noise=0.01), aligner="passthrough", random_state=0
        )
