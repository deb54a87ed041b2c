"""``DataInformedFEM(model).fit(T, F)`` beside the same with one setting, and beside a regression.

    OMP_NUM_THREADS=1 python tests/benchmarks/plain_call.py
    OMP_NUM_THREADS=1 python tests/benchmarks/plain_call.py --structures truss --first-seed 100

Mean errors of frequencies without noise in a later year, healthy and damaged, in percent. A regression of frequencies
on temperatures is multiplied by the frequencies of a model, damaged over healthy: the nominal one, or that of the plain
call at the temperatures of each record.
"""

from dataclasses import dataclass

import numpy as np
import pandas as pd
from harness import arguments, shown
from scipy.signal import lfilter

from skthermo.datasets import make_fleet, make_truss, make_truss_campaign
from skthermo.fem import Beam, Spring, Structure
from skthermo.metrics import mape
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from skthermo.updating import ModelUpdater

SEVERITY, HALF = 0.2, 0.5
MEANS = "4D"


@dataclass
class Case:
    """Records to learn from, and damage and true frequencies of later states by name."""

    name: str
    model: object
    T: pd.DataFrame  # of all records, to learn from and later
    F: pd.DataFrame  # to learn from
    states: dict
    noise: object

    def updated_model(self):
        """The model with the multipliers that fit the mean frequencies best."""
        updater = ModelUpdater(self.model, bounds=0.5, prior=0.3, random_state=0)
        return updater.fit(self.F, frequency_std=0.02 * self.F.mean()).model_

    def with_means(self):
        """Temperatures, and their means over some days beside them."""
        return self.T.join(self.T.rolling(MEANS).mean().add_suffix(f", mean of {MEANS}"))

    def errors(self):
        """By way and kind of state, mean over the states."""
        chain = DataInformedFEM(self.model, random_state=0).fit(self.T.loc[self.F.index], self.F)
        ways = {
            "plain call": self.simulated(chain, self.T),
            "noise given": self.of_chain(self.model, self.T, inverse=PosteriorInverse(noise=self.noise)),
            "means of 4 days": self.of_chain(self.model, self.with_means()),
            "no discrepancy": self.of_chain(self.model, self.T, discrepancy=None),
            "model updated": self.of_chain(self.updated_model(), self.T),
        }
        ways |= self.regressions(chain)
        found = {}
        for way, by_state in ways.items():
            for state, (_, truth) in self.states.items():
                kind = "healthy" if state == "healthy" else "damaged"
                found.setdefault((self.name, kind, way), []).append(mape(truth, by_state[state]).mean())
        return {key: np.mean(values) for key, values in found.items()}

    def of_chain(self, model, T, **parts):
        fem = DataInformedFEM(model, random_state=0, **parts).fit(T.loc[self.F.index], self.F)
        return self.simulated(fem, T)

    def simulated(self, fem, T):
        return {
            state: np.asarray(fem.simulate(T.loc[truth.index], damage=damage))
            for state, (damage, truth) in self.states.items()
        }

    def regressions(self, chain):
        """Of frequencies on temperatures, times the effect of damage on the nominal model and on the chain."""
        mapper = TemperatureMapper().fit(self.T.loc[self.F.index], self.F)
        nominal = np.ones((1, len(self.model.parameter_names)))
        found = {"regression times nominal damage": {}, "times the chain's damage": {}}
        for state, (damage, truth) in self.states.items():
            T = self.T.loc[truth.index]
            direct = np.asarray(mapper.predict(T))
            ratio = self.model.damaged(damage).frequencies(nominal) / self.model.frequencies(nominal)
            found["regression times nominal damage"][state] = direct * ratio
            ratio = np.asarray(chain.simulate(T, damage=damage)) / np.asarray(chain.simulate(T))
            found["times the chain's damage"][state] = direct * ratio
        return found


def truss(options):
    for seed in range(options.first_seed, options.first_seed + options.seeds):
        campaign = make_truss_campaign(2, random_state=seed)
        later = campaign.theta[365:]
        damages = {"healthy": {}} | {group: {group: HALF} for group in ("bottom", "top", "diagonal")}
        states = {
            name: (damage, pd.DataFrame(campaign.model.damaged(damage).frequencies(later), later.index))
            for name, damage in damages.items()
        }
        for _, truth in states.values():
            truth.columns = list(campaign.frequencies)
        name = f"truss, a year of days, {options.seeds} campaigns; 50 % of a group lost"
        yield Case(name, make_truss(), campaign.temperatures, campaign.frequencies[:365], states, 0.01)


def bridges(options):
    for bridge in make_fleet(options.bridges, random_state=options.first_seed).values():
        damages = {"healthy": {}} | {group: {group: SEVERITY} for group in bridge.groups}
        later = {state: bridge.records(365, "2026-01-01", damage=damage) for state, damage in damages.items()}
        states = {state: (damages[state], records.clean_frequencies) for state, records in later.items()}
        for training, days in (("a year", 365), ("90 days from January", 90)):
            known = bridge.records(days, "2025-01-01")
            T = pd.concat([known.temperatures, later["healthy"].temperatures])
            name = f"{options.bridges} bridges, {training}; 20 % lost"
            yield Case(name, bridge.model, T, known.frequencies, states, bridge.noise)


def frozen(options):
    """A girder of two spans whose bearings freeze and whose asphalt stiffens the deck in the cold; the model is off.

    The bearings are pots that hardly hold a rotation, and seven times as stiff below -5 °C. No parameter is the
    asphalt's.
    """
    n_left, n_right = 8, 10
    nodes = {i: (3.0 * i, 0, 0) for i in range(n_left + n_right + 1)}
    deck = {"E": 34e9, "G": 14e9, "A": 4.0, "I_yy": 0.8, "I_zz": 20.0, "J": 2.0, "density": 2500.0}
    members = {i: Beam(i, i + 1, **deck) for i in range(n_left + n_right)}
    ends = (0, n_left, n_left + n_right)
    members |= {f"turn {i}": Spring(i, "ry", k=2e8) for i in ends} | {f"pier {i}": Spring(i, "z", k=2e9) for i in ends}
    groups = {"left": range(n_left), "right": range(n_left, n_left + n_right)}
    groups |= {"rotation": [f"turn {i}" for i in ends], "piers": [f"pier {i}" for i in ends]}
    bridge = Structure(nodes, members, dict.fromkeys(nodes, "x y rx rz"), groups)
    model = bridge.assemble(list(groups), n_modes=5)
    off = np.array([0.97, 1.02, 1.1, 0.95])

    def state(T):
        air, asphalt = T["air"].to_numpy(), T["asphalt"].to_numpy()
        stiff = 1 - 0.0004 * (air - 10) + 0.06 / (1 + np.exp((asphalt - 5) / 4))
        turn = 1 + 6 / (1 + np.exp((air + 3) / 0.7))
        return off * np.column_stack([stiff, stiff, turn, np.ones(len(T))])

    for seed in range(options.first_seed, options.first_seed + 2 * options.seeds):
        random = np.random.default_rng(seed)
        days = pd.date_range("2024-01-01", periods=6 * 730, freq="4h")
        spells = lfilter([1], [1, -0.97], random.normal(0, 2.0 * np.sqrt(1 - 0.97**2), len(days)))
        air = 8 - 10 * np.cos(2 * np.pi * days.dayofyear / 365) + spells - 3 * np.cos(2 * np.pi * days.hour / 24)
        asphalt = lfilter([0.3], [1, -0.7], air - 8) + 8 + np.maximum(0, -4 * np.cos(2 * np.pi * days.hour / 24))
        T = pd.DataFrame({"air": air, "asphalt": asphalt}, days)
        n_train = 6 * 365
        theta, later = state(T), state(T)[n_train:]
        names = [f"f{i + 1}" for i in range(5)]
        F = pd.DataFrame(model.frequencies(theta[:n_train]), days[:n_train], names)
        F *= 1 + 0.004 * random.standard_normal(F.shape)
        damages = {"healthy": {}} | {span: {span: SEVERITY} for span in ("left", "right")}
        states = {
            name: (damage, pd.DataFrame(model.damaged(damage).frequencies(later)[::4], days[n_train::4], names))
            for name, damage in damages.items()
        }
        name = f"girder whose bearings freeze, {2 * options.seeds} campaigns; 20 % of a span lost"
        yield Case(name, model, T, F, states, 0.004)


STRUCTURES = {"truss": truss, "bridges": bridges, "frozen": frozen}


def main():
    options = arguments(__doc__, structures=STRUCTURES, first_seed=200, seeds=(3, "of campaigns"), bridges=4)
    rows = [pd.Series(case.errors()) for name in options.structures for case in STRUCTURES[name](options)]
    table = pd.concat(rows).rename_axis(["records", "state", "way"]).groupby(level=[0, 1, 2], sort=False).mean()
    shown("Error of the frequencies of a later year, %, by one setting", table.unstack("way", sort=False), 3)


if __name__ == "__main__":
    main()
