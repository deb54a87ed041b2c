"""A cable-stayed footbridge of known truth, with two years of records every two hours; for other benchmarks.

Asphalt, cables that sag, frost in the core of the deck, and bearings that stiffen as they freeze move its frequencies,
and noise that lasts. It is built from ``skthermo.fem``.
"""

from itertools import pairwise

import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline

from skthermo.fem import Bar, Beam, Spring, Structure, add_noise
from skthermo.preprocessing import LagFeatures

STEEL = {"E": 210e9, "G": 81e9, "density": 7850.0}
DECK = {"E": 32e9, "G": 13e9, "density": 3400.0, "A": 0.9, "I_yy": 0.022, "I_zz": 0.4, "J": 0.05}
PYLON = STEEL | {"A": 0.06, "I_yy": 0.006, "I_zz": 0.006, "J": 0.01}
STAY = {"E": 165e9, "A": 0.0018, "density": 7850.0}
SIDE, MAIN, TOP, FOOT = 24.0, 42.0, 16.0, -7.0
STEP = 1.5
"""Length of the deck's beams, m."""
GROUPS = ("side span", "main span", "pylon", "backstays", "main stays", "bearings")
MODES = [f"f{i}" for i in range(1, 7)]
SENSORS = ["air", "girder", "cable"]
PER_DAY = 12
NOISE = 0.003  # relative standard deviation of one record


def footbridge(pylon=1.0, stations=None, stiffness=None):
    """The bridge in the plane x-z, 168 degrees of freedom; other stations of the deck and stiffer groups if given."""
    factors = dict.fromkeys(GROUPS, 1.0) | {"pylon": pylon} | (stiffness or {})
    nodes, members, groups = {}, {}, {group: [] for group in GROUPS}

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


def weather(random, n_years=2):
    """Air, girder and cable, and what no thermometer sees: the core of the deck."""
    times = pd.date_range("2022-01-01", periods=n_years * 365 * PER_DAY, freq="2h")
    h = 2 * np.arange(len(times))
    fronts = 11 * pd.Series(random.normal(0, 1, len(h))).ewm(halflife=24).mean().to_numpy()
    day = np.clip(np.sin(2 * np.pi * (h - 6) / 24), 0, None)
    summer = -np.cos(2 * np.pi * (h / 24 - 20) / 365)
    sun = day * (7 + 5 * summer) * random.uniform(0.2, 1.0, len(h) // PER_DAY).repeat(PER_DAY)
    air = 9 + 11 * summer + fronts + 0.45 * sun
    girder = pd.Series(air + 0.8 * sun).ewm(halflife=4).mean().to_numpy()
    cable = pd.Series(air + 0.5 * sun).ewm(halflife=0.7).mean().to_numpy()
    core = pd.Series(girder).ewm(halflife=5).mean().to_numpy()
    T = pd.DataFrame(np.column_stack([air, girder, cable]), times, SENSORS)
    return T + random.normal(0, 0.15, T.shape), core


def properties(T, core):
    """Multipliers of the groups: asphalt, cables that sag, bearings that stiffen as they freeze."""
    air, cable = T["air"].to_numpy(), T["cable"].to_numpy()
    frost = 1 / (1 + np.exp(core / 1.2))
    deck = 1 - 0.0032 * (core - 10) + 0.06 * frost
    stays = 1 - 0.0018 * (cable - 10)
    bearings = np.exp(-0.006 * (air - 10)) * (1 + 0.5 * frost)
    return np.column_stack([deck, deck, 1 - 0.0004 * (air - 10), stays, stays, bearings])


class Bridge:
    """Two years of records: the first trains, the second is evaluated in one condition or another."""

    def __init__(self, seed):
        random = np.random.default_rng(seed)
        model = footbridge().assemble(GROUPS, n_modes=len(MODES))
        self.T, core = weather(random)
        theta = properties(self.T, core)
        self.n = len(theta) // 2
        slow = 0.001 * pd.DataFrame(random.normal(0, 1, (len(theta), len(MODES)))).ewm(halflife=6).mean().to_numpy() * 4
        self.theta, self.seed, self.slow = theta, seed, slow
        self.model = model.reduced([[0.5, 2.2]] * len(GROUPS), random_state=0)
        self.gaps = random.random((len(theta), len(MODES))) < 0.1
        self.lost = np.repeat(random.random((len(theta), 1)) < 0.02, len(SENSORS), axis=1)
        wrong = random.random((len(theta), len(MODES))) < 0.01
        self.wrong = np.where(wrong, random.choice([-1, 1], wrong.shape) * random.uniform(0.03, 0.08, wrong.shape), 0)

    def frequencies(self, rows, damage, theta):
        model = self.model.damaged(damage) if damage else self.model
        clean = model.frequencies(theta) * (1 + self.slow[rows])
        F = add_noise(clean, NOISE, random_state=self.seed + rows.start)
        return pd.DataFrame(F, self.T.index[rows], MODES)

    def training(self, dirty):
        rows = slice(0, self.n)
        F, T = self.frequencies(rows, {}, self.theta[rows]), self.T[: self.n]
        if dirty:
            F = (F * (1 + self.wrong[rows])).mask(self.gaps[rows])
            T = T.mask(self.lost[rows])
        return T.join(F)

    def evaluated(self, damage, condition):
        """The second year "as in training", or as "girder drifts 4 K"."""
        rows = slice(self.n, 2 * self.n)
        T, F = self.T[self.n :].copy(), self.frequencies(rows, damage, self.theta[rows])
        if condition == "girder drifts 4 K":
            T["girder"] += 4 * np.linspace(0, 1, self.n)
        return T.join(F)


def lagged(regressor):
    """Now, six hours and a day ago."""
    return make_pipeline(LagFeatures([0, 3, 12], freq="2h"), regressor)
