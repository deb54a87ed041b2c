"""How far ``DataInformedFEM(model).fit(T, F)`` without any setting is from the best settings.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/plain_call.py
    OMP_NUM_THREADS=1 python tests/benchmarks/plain_call.py --structures truss bridges --first-seed 100

Mean errors of frequencies without noise in a later year, healthy and damaged, in percent; of the tower and of Z24,
errors of measured frequencies that were held out. Variants:

plain        ``DataInformedFEM(model, random_state=0).fit(T, F)``
true, auto   noise stated to the inverse surrogate, as it is or as estimated from residuals of a regression on the
             temperatures; frequencies scaled to the model's; large models reduced
memory       with lags or rolling means of the temperatures
updated      with the FE model updated to the mean frequencies before
no delta     with ``discrepancy=None``: the paper's chain
regression   of frequencies on temperatures, times the nominal model's frequencies, damaged over healthy

Errors are those of the records that all variants of a case can predict.
"""

import contextlib
import io
import sys
from dataclasses import dataclass, field
from functools import partial

import numpy as np
import pandas as pd
from harness import DATA, EXAMPLES, KW51_NOISE, arguments, shown, timed, z24_records
from scipy.signal import lfilter
from sklearn.model_selection import PredefinedSplit, cross_val_predict
from sklearn.pipeline import make_pipeline
from structures import SOIL_DAMAGES, slow_soil

from skthermo.datasets import make_fleet, make_kw51, make_kw51_campaign, make_truss, make_truss_campaign, make_z24
from skthermo.fem import Beam, Spring, Structure
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from skthermo.updating import ModelUpdater

SEVERITY, HALF = 0.2, 0.5
LARGE = 100  # degrees of freedom from which on the guide asks for reduced models
KW51_START, KW51_GROUPS = 1236, ("arch_connections", "deck_connections", "ballast", "pipes")


@dataclass
class Case:
    """Records to learn from, and damage and true frequencies of later states by name."""

    table: str  # over which errors are averaged
    name: str
    model: object
    T: pd.DataFrame  # of all records, to learn from and later
    F: pd.DataFrame  # to learn from
    states: dict
    noise: object = None
    lags: LagFeatures | None = None
    means: str | None = None  # duration of rolling means of the temperatures
    computed: dict = field(default_factory=dict)

    @property
    def is_large(self):
        return self.model.n_dof >= LARGE

    @property
    def has_memory(self):
        return self.lags is not None or self.means is not None

    def temperatures(self, memory):
        """All temperatures, with their rolling means beside them if these are asked for."""
        if not memory or self.means is None:
            return self.T
        return self.T.join(self.T.rolling(self.means).mean().add_suffix(f", mean of {self.means}"))

    def mapper(self, memory):
        return (
            make_pipeline(self.lags, TemperatureMapper()) if memory and self.lags is not None else TemperatureMapper()
        )

    def remembered(self, what, compute):
        """What several variants need, computed once."""
        if what not in self.computed:
            self.computed[what] = compute()
        return self.computed[what]

    def estimated_noise(self, memory):
        """Robust standard deviation of each mode about a regression that has learned other weeks."""
        week = (self.F.index - self.F.index[0]) // pd.Timedelta("7D")
        folds, T = PredefinedSplit(week % 5), self.temperatures(memory).loc[self.F.index]
        columns = [cross_val_predict(self.mapper(memory), T, self.F[[mode]], cv=folds) for mode in self.F]
        off = self.F / np.column_stack(columns) - 1
        return 1.4826 * (off - off.median()).abs().median().to_numpy()

    def updated_model(self):
        """The model with the multipliers that fit the mean frequencies best."""
        updater = ModelUpdater(self.model, bounds=0.5, prior=0.3, random_state=0)
        return updater.fit(self.F, frequency_std=0.02 * self.F.mean()).model_


def plain(case, **parts):
    """The call without any setting."""
    return predictions(DataInformedFEM(case.model, random_state=0, **parts), case, case.T)


def settings(case, *, noise, memory=False, updated=False, **parts):
    """The chain with what the guide asks for."""
    model = case.remembered("updated model", case.updated_model) if updated else case.model
    estimate = partial(case.estimated_noise, memory)
    level = case.noise if noise == "true" else case.remembered(("noise", memory), estimate)
    fem = DataInformedFEM(
        model,
        inverse=PosteriorInverse(noise=level),
        mapper=case.mapper(memory),
        aligner=BiasAligner(method="scale"),
        reduce=case.is_large,
        random_state=0,
        **parts,
    )
    return predictions(fem, case, case.temperatures(memory))


def regression(case, *, memory=False, at_theta=False):
    """Frequencies from temperatures directly; damage changes them as it changes the model's.

    The model's are those of its nominal state, or those of the plain chain at the temperatures of each record.
    """
    T = case.temperatures(memory)
    mapper = case.mapper(memory).fit(T.loc[case.F.index], case.F)
    found, nominal = {}, np.ones((1, len(case.model.parameter_names)))
    for name, (damage, truth) in case.states.items():
        direct = np.asarray(mapper.predict(T.loc[truth.index]))
        if at_theta:
            chain = case.remembered("plain chain", lambda: DataInformedFEM(case.model, random_state=0))
            if not hasattr(chain, "report_"):
                chain.fit(case.T.loc[case.F.index], case.F)
            changed, healthy = (
                np.asarray(chain.simulate(case.T.loc[truth.index], damage=change)) for change in (damage, {})
            )
        else:
            changed, healthy = (model.frequencies(nominal) for model in (case.model.damaged(damage), case.model))
        found[name] = direct * (changed / healthy)
    return found


def predictions(fem, case, T):
    """Frequencies of each state by a chain that learns the case's records."""
    fem.fit(T.loc[case.F.index], case.F)
    return {
        name: np.asarray(fem.simulate(T.loc[truth.index], damage=damage))
        for name, (damage, truth) in case.states.items()
    }


VARIANTS = {
    "plain": (plain, {}),
    "plain, no delta": (plain, {"discrepancy": None}),
    "true": (settings, {"noise": "true"}),
    "true, no delta": (settings, {"noise": "true", "discrepancy": None}),
    "auto": (settings, {"noise": "estimated"}),
    "auto, memory": (settings, {"noise": "estimated", "memory": True}),
    "auto, updated": (settings, {"noise": "estimated", "updated": True}),
    "auto, memory, updated": (settings, {"noise": "estimated", "memory": True, "updated": True}),
    "regression": (regression, {}),
    "regression, memory": (regression, {"memory": True}),
    "regression, ratio at theta": (regression, {"at_theta": True}),
    "regression, ratio at theta, memory": (regression, {"at_theta": True, "memory": True}),
}
QUICK = ("plain", "auto", "auto, memory", "regression")


def is_for(case, options):
    """Whether the case has the memory or the true noise that a variant with these options needs."""
    has_truth = case.noise is not None or options.get("noise") != "true"
    return has_truth and (case.has_memory or not options.get("memory"))


def truss(options):
    for seed in seeds(options, 1 if options.quick else 3):
        campaign = make_truss_campaign(2, random_state=seed)
        later = campaign.theta[365:]
        damages = {"healthy": {}} | {f"{group} 50 %": {group: HALF} for group in ("bottom", "top", "diagonal")}
        states = {
            name: (
                damage,
                pd.DataFrame(
                    campaign.model.damaged(damage).frequencies(later), later.index, list(campaign.frequencies)
                ),
            )
            for name, damage in damages.items()
        }
        T, F = campaign.temperatures, campaign.frequencies[:365]
        yield Case("truss, a year", f"seed {seed}", make_truss(), T, F, states, noise=0.01)


def bridges(options):
    trainings = {"a year": ("2025-01-01", 365)}
    if not options.quick:
        trainings |= {"90 days from January": ("2025-01-01", 90), "180 days from April": ("2025-04-01", 180)}
    n_bridges = 3 if options.quick else options.bridges
    for name, bridge in make_fleet(n_bridges, random_state=options.first_seed).items():
        damages = {"healthy": {}} | {f"{group} 20 %": {group: SEVERITY} for group in bridge.groups}
        later = {state: bridge.records(365, "2026-01-01", damage=damage) for state, damage in damages.items()}
        states = {state: (damages[state], records.clean_frequencies) for state, records in later.items()}
        for training, (start, days) in trainings.items():
            known = bridge.records(days, start)
            T = pd.concat([known.temperatures, later["healthy"].temperatures])
            options_of = {"noise": bridge.noise, "means": "4D"}
            yield Case(f"bridges, {training}", name, bridge.model, T, known.frequencies, states, **options_of)


def tower(options):
    """The tower, as the page for a structure of one's own reads and models it."""
    page = (EXAMPLES / "plot_your_own_structure.py").read_text(encoding="utf-8").partition("# Update the model")[0]
    known = {"__name__": "tower"}
    with contextlib.redirect_stdout(io.StringIO()), replaced_arguments(DATA / "tower" / "tower.csv"):
        exec(compile(page, "plot_your_own_structure.py", "exec"), known)
    T, F, n = known["T"], known["F"], known["n_train"]
    lags = LagFeatures([0, 2, 6, 12, 24], freq="30min")
    model = known["tower"]().with_modes(known["pairs"]["mode"])
    yield Case("tower, trained on four fifths", "tower", model, T, F[:n], {"healthy": ({}, F[n:])}, lags=lags)


@contextlib.contextmanager
def replaced_arguments(*arguments):
    """Command line of a page that is run in this process."""
    before, sys.argv, path = sys.argv, ["page", *map(str, arguments)], list(sys.path)
    sys.path.append(str(EXAMPLES))
    try:
        yield
    finally:
        sys.argv, sys.path[:] = before, path


def z24(options):
    (T, F), _ = z24_records()
    for label, share in (("four fifths", 0.8), ("60 %", 0.6))[: 1 if options.quick else None]:
        n = int(share * len(T))
        yield Case(f"Z24, trained on {label}", "Z24", make_z24(), T, F[:n], {"healthy": ({}, F[n:])})


def kw51(options):
    """A campaign of two years with the real one's gaps; every sixth week of the second is predicted."""
    first = KW51_START
    n_train, n_later = (800, 400) if options.quick else (8760, 8760)
    for seed in seeds(options, 1):
        common = {"n_hours": first + n_train + n_later, "retrofit": False, "random_state": seed}
        campaign = make_kw51_campaign(**common)
        week = np.arange(n_later) // 168
        rows = campaign.temperatures.index[first + n_train :][week % 6 == 0]
        damages = {"healthy": {}} | {f"{group} 20 %": {group: SEVERITY} for group in KW51_GROUPS}
        states = {
            name: (damage, make_kw51_campaign(**common, damage=damage).clean_frequencies.loc[rows])
            for name, damage in damages.items()
        }
        T, F = campaign.temperatures[first:], campaign.frequencies[first : first + n_train]
        noise = np.array(KW51_NOISE)
        yield Case("KW51, a year of hours", f"seed {seed}", make_kw51(), T, F, states, noise=noise)


def girder(options):
    """The girder on slow soil; every fourth week of the later year is predicted."""
    known = {"n_days": 90} if options.quick else {"n_days": 425}
    for seed in seeds(options, 1):
        records = slow_soil(seed, **known)
        start = records.frequencies.index[-1].floor("D") + pd.Timedelta("1D")
        days = 90 if options.quick else 365
        damages = {"healthy": {}} | {f"{group} 20 %": {group: s} for one in SOIL_DAMAGES for group, s in one.items()}
        later = {name: slow_soil(seed, start, days, damage=damage) for name, damage in damages.items()}
        week = np.arange(len(later["healthy"].temperatures)) // (7 * 12)
        states = {name: (damages[name], year.clean_frequencies[week % 4 == 0]) for name, year in later.items()}
        T = pd.concat([records.temperatures, later["healthy"].temperatures])
        about = {"noise": records.noise, "means": "30D"}
        yield Case("girder on slow soil", f"seed {seed}", records.model, T, records.frequencies, states, **about)


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

    for seed in seeds(options, 1 if options.quick else 3):
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
        damages = {"healthy": {}} | {f"{span} 20 %": {span: SEVERITY} for span in ("left", "right")}
        states = {
            name: (damage, pd.DataFrame(model.damaged(damage).frequencies(later)[::4], days[n_train::4], names))
            for name, damage in damages.items()
        }
        yield Case("girder, frozen bearings", f"seed {seed}", model, T, F, states, noise=0.004)


STRUCTURES = {
    "truss": truss,
    "bridges": bridges,
    "tower": tower,
    "z24": z24,
    "kw51": kw51,
    "girder": girder,
    "frozen": frozen,
}
REAL = ("tower", "z24")


def seeds(options, n):
    return range(options.first_seed, options.first_seed + n)


def evaluated(case, names):
    """Rows of errors by variant and state, over what all of them predict."""
    found, seconds = {}, {}
    for name in names:
        predict, options = VARIANTS[name]
        if is_for(case, options):
            seconds[name], found[name] = timed(partial(predict, case, **options))
    rows = []
    for state, (_, truth) in case.states.items():
        known = np.logical_and.reduce([truth.notna(), *(~np.isnan(values[state]) for values in found.values())])
        kind = "healthy" if state == "healthy" else "damaged"
        shared = {"table": case.table, "case": case.name, "state": kind, "predicted": known.mean()}
        for name, spent in seconds.items():
            error = mape(truth.where(known), found[name][state]).mean()
            rows.append(shared | {"variant": name, "error": error, "seconds": spent})
    return rows


def summary_of(rows):
    """One row for each table and state: plain, the best settings, the regression, and the ratios."""
    found = {}
    for (table, state), part in rows.groupby(["table", "state"], sort=False):
        errors = part.groupby("variant")["error"].mean()
        by_hand = [name for name in errors.index if name != "plain" and not name.startswith("regression")]
        direct, best = errors[errors.index.str.startswith("regression")].min(), errors[by_hand].min()
        found[table, state] = {"plain": errors["plain"], "best": best, "regression": direct}
        found[table, state] |= {"plain / best": errors["plain"] / best, "best settings": errors[by_hand].idxmin()}
    return pd.DataFrame(found).T


def compare(options):
    """Tables of all structures, and their summary."""
    rows = []
    for structure in options.structures:
        if structure in REAL and DATA is None:
            print(f"{structure} is left out: SKTHERMO_DATA is not set\n")
            continue
        for case in STRUCTURES[structure](options):
            rows += evaluated(case, options.variants)
    rows = pd.DataFrame(rows)
    errors = rows.pivot_table(index="variant", columns=["table", "state"], values="error", sort=False)
    shown("Mean errors by variant, %", errors.T, 3)
    shown("Processor seconds of fit and predictions", rows.groupby("variant", sort=False)["seconds"].mean(), 1)
    summary = summary_of(rows)
    shown("Plain call and best settings: mean error, %", summary, 3)
    better = summary[["best", "regression"]].astype(float).min(axis=1)
    close = summary["plain"].astype(float) <= 1.05 * better
    print(f"plain within 5 % of the better of settings and regression in {close.sum()} of {len(close)} rows")


def main():
    options = arguments(
        __doc__,
        structures=STRUCTURES,
        first_seed=(0, "of campaigns and of the fleet"),
        bridges=9,
        quick=(False, "fewer seeds, bridges and records"),
    )
    options.variants = QUICK if options.quick else list(VARIANTS)
    compare(options)


if __name__ == "__main__":
    main()
