"""Structures of known truth for ``explained_damage.py``, each with chains that have learned records of it."""

import os
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
from blind_bridge import footbridge as footbridge_structure
from scipy.signal import lfilter
from slow_soil import GROUPS as GIRDER_GROUPS
from slow_soil import girder as girder_structure

from skthermo.datasets import kw51_sensors, make_kw51, make_truss, make_truss_campaign
from skthermo.fem import Structure, load_affine
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, PosteriorInverse

TRAINING_DAYS, LATER_DAYS = 730, 90
WRONG = 0.05  # relative error of each group's stiffness in a wrong model, up or down by chance
CORRELATIONS = (0.0, 0.5, 0.9)
SEVERITIES = (-0.01, 0.5)  # that reduced models of the truth cover
N_SHAPES = 5  # measured shapes that are averaged
SHAPE_NOISE = 0.01
LAG_DAYS = 3.0  # after which half of a change of the weather has reached the parameters that lag


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


def autoregression(n_records, n_modes, memory, random):
    """Unit normal noise, correlated with that of the record before."""
    shocks = random.standard_normal((n_records + 100, n_modes)) * np.sqrt(1 - memory**2)
    return lfilter([1.0], [1.0, -memory], shocks, axis=0)[100:]


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
    memory: float | None = None
    is_plain: bool = False
    n_days: int = TRAINING_DAYS
    chains: dict = field(default_factory=dict)

    def __post_init__(self):
        self.memory = memory_of(self.seed) if self.memory is None else self.memory

    @property
    def fem(self):
        """The fitted chain, made when it is first needed."""
        if "fem" not in self.chains:
            self.chains["fem"] = self.chain(self.model).fit(*self.records)
        return self.chains["fem"]

    @property
    def model(self):
        """The model that the engineer has."""
        model = self.structure.coarse if self.wrong else self.structure.model
        if not self.wrong:
            return model
        random = np.random.RandomState(9000 + self.seed)
        return model.damaged({group: WRONG * random.choice([-1, 1]) for group in self.structure.groups})

    def chain(self, model):
        """A chain of one model, to be fitted; a plain one has no settings."""
        if self.is_plain:
            return DataInformedFEM(model, random_state=self.seed)
        box = 0.3
        small = model.reduced(box, random_state=0) if self.structure.is_large else model
        return DataInformedFEM(
            model,
            inverse=PosteriorInverse(small, noise=self.structure.noise),
            aligner=BiasAligner(small, method="scale") if self.wrong else "passthrough",
            reduce=self.structure.is_large,
            random_state=self.seed,
        )

    @property
    def records(self):
        """Healthy temperatures and frequencies to learn from."""
        return self.structure.records(self.n_days, {}, self.memory, 1000 + self.seed)

    def later(self, damage, number):
        """Later records with some damage; another number for other weather and noise."""
        seed = 100_000 + 1000 * self.seed + number
        T, F = self.structure.records(LATER_DAYS, damage, self.memory, seed)
        return T, spoiled(F, seed)


@dataclass
class Truss:
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
        F = F * (1 + self.noise * autoregression(*F.shape, memory, random))
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


@dataclass
class Lagging(Smooth):
    """The same, but the last two parameters follow means of earlier weather, which no thermometer shows."""

    def theta(self, T, damage):
        theta = super().theta(T, damage)
        n_parameters = theta.shape[1] - len(self.groups)
        earlier = super().theta(T.ewm(halflife=LAG_DAYS).mean(), damage)
        theta[:, n_parameters - 2 : n_parameters] = earlier[:, n_parameters - 2 : n_parameters]
        return theta


@cache
def truss():
    return Truss()


@cache
def kw51():
    groups = ("girders", "transverse_beams", "stiffeners", "plate", "ballast", "arch", "deck_connections", "braces")
    model = make_kw51(["E_bot", "E_arc", "E_br"])
    return Smooth.of(
        "KW51", model, (*groups, "arch_connections", "pipes"), 0.002, sensors=list(kw51_sensors().values())
    )


@cache
def frame():
    folder = os.environ.get("SKTHERMO_DATA")
    model = load_affine(Path(folder) / "building_frame" / "ConcreteBuildingFrame.mat")
    return Smooth.of("frame", model.with_parameters(["E_5", "E_11", "E_12"]), tuple(sorted(model.groups)), 0.002)


GROUPS = ("side span", "main span", "tip", "pylon", "backstays", "main stays", "bearings")
TIP = 45.0
STAYED = [0, 7.5, 15, 24, 33, 42, 51, 58.5, 66]
"""Stations of the deck where something joins it."""


@cache
def footbridge():
    coarse = sorted([*STAYED, *(np.add(STAYED[1:], STAYED[:-1]) / 2).tolist()])
    fine = seven_groups(footbridge_structure()).assemble(GROUPS, n_modes=6, track=True)
    bridge = Smooth.of("footbridge", fine, GROUPS, 0.002, is_large=False)
    bridge.coarse = seven_groups(footbridge_structure(stations=coarse)).assemble(GROUPS, n_modes=6, track=True)
    bridge.is_large = True
    return bridge


def seven_groups(bridge):
    """The main span in two."""
    groups = dict(bridge.groups)
    tip = {("deck", x) for kind, x in groups["main span"] if x >= TIP}
    groups |= {"tip": tip, "main span": groups["main span"] - tip}
    return Structure(bridge.nodes, bridge.members, bridge.supports, groups)


@cache
def girder():
    parameters = ["girder", "pavement", "bearings"]
    return Lagging.of("girder", girder_structure(6).assemble(parameters, groups=GIRDER_GROUPS), GIRDER_GROUPS, 0.002)


STRUCTURES = {"truss": truss, "KW51": kw51, "frame": frame, "footbridge": footbridge, "girder": girder}
