"""Records that a chain simulates, evaluated by compensators of the chain's own kind and of others.

    OMP_NUM_THREADS=1 python tests/benchmarks/own_kind.py
    OMP_NUM_THREADS=1 SKTHERMO_DATA=path/to/data python tests/benchmarks/own_kind.py --bridges Z24

Chains whose temperature mapper is piecewise-linear, boosted trees or a network simulate the healthy and the damaged
structure. Detectors evaluate residuals of regressors of the same three kinds, of the chains themselves, and raw
frequencies. Beside them stand the same alarms on true records of the truss, or on those of Z24, with the chain
of the baseline and assumed damage. The own kind's advantage is the change of its alarms in records of its own kind of
chain, less that of other kinds of compensators there.
"""

import numpy as np
import pandas as pd
from harness import DATA, arguments, compensated, recipes
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neural_network import MLPRegressor

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import add_noise
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

field_detectors = recipes("detector").field_detectors

NOISE = 0.01
RAW = ("raw, Mahalanobis", "raw, 20 neighbours")
DAMAGES = {f"{group} {s:.0%}": {group: s} for group, s in (("bottom", 0.05), ("bottom", 0.1), ("diagonal", 0.05))}


def kinds():
    """Regressors for the chain's temperature mapper, and for compensators."""
    network = MLPRegressor(
        hidden_layer_sizes=(64,), alpha=1.0, learning_rate_init=0.003, max_iter=2000, n_iter_no_change=20
    )
    trees = MultiOutputRegressor(GradientBoostingRegressor(random_state=0))
    regressors = {"piecewise-linear": None, "boosted trees": trees, "network": network}
    return {name: TemperatureMapper(regressor, random_state=0) for name, regressor in regressors.items()}


def detectors_of(targets, chains, whiten, block=None):
    """Detectors that learn the baseline, by name."""
    estimators = kinds() | {f"chain, {name}": chain for name, chain in chains.items()}
    raw = field_detectors(targets, block=block)
    residuals = {name: compensated(targets, regressor=one, whiten=whiten) for name, one in estimators.items()}
    return {name: raw[name] for name in RAW} | residuals


def truss_case(seed):
    """Chains to fit, a baseline, and for each state the weather, the damage and the true records of one repeat."""
    year, later = (make_truss_campaign(noise=NOISE, random_state=2 * seed + i) for i in range(2))
    inverse = PosteriorInverse(make_truss())
    chains = {
        name: DataInformedFEM(make_truss(), inverse=inverse, mapper=mapper, random_state=seed)
        for name, mapper in kinds().items()
    }
    states = {name: (later.temperatures, damage) for name, damage in ({"healthy": {}} | DAMAGES).items()}
    clean = {name: later.model.damaged(damage).frequencies(later.theta) for name, (_, damage) in states.items()}

    def true(state, repeat):
        F = add_noise(clean[state], NOISE, random_state=1000 * seed + repeat)
        return later.temperatures.join(pd.DataFrame(F, later.temperatures.index, year.frequencies.columns))

    return chains, year.temperatures.join(year.frequencies), states, true


def z24_case(seed):
    """The same with measured records, of which there is one repeat."""
    import z24_recipes

    bridge = z24_recipes.Bridge(z24_recipes.find(DATA))
    records, model = z24_recipes.Records.of(bridge), z24_recipes.bridge_model()
    chains = {name: z24_recipes.chain(model).set_params(mapper=mapper) for name, mapper in kinds().items()}
    measured = {"healthy": records.later, "damaged": records.damaged}
    damages = {"healthy": {}, "damaged": {"soil": 0.18}}
    states = {name: (frame[list(bridge.T)], damages[name]) for name, frame in measured.items()}
    return chains, records.baseline, states, lambda state, repeat: measured[state]


def alarms(case, seed, n_repeats):
    """Share of records in alarm, by detector, source and state."""
    chains, baseline, states, true = case(seed)
    on_truss = case is truss_case
    temperatures = list(next(iter(states.values()))[0])
    targets = [name for name in baseline if name not in temperatures]
    fitted = {name: chain.fit(baseline[temperatures], baseline[targets]) for name, chain in chains.items()}
    detectors = detectors_of(targets, chains, None if on_truss else "local", None if on_truss else "1D")
    for name, detector in detectors.items():
        detector.fit(baseline[targets] if name in RAW else baseline)
    rates = {}
    for repeat in range(n_repeats):
        for state, (T, damage) in states.items():
            options = {"damage": damage, "noise": "fitted", "random_state": repeat}
            records = {name: T.join(fem.simulate(T, **options)) for name, fem in fitted.items()}
            records["truth"] = true(state, repeat)
            for source, frame in records.items():
                for name, detector in detectors.items():
                    decisions = detector.predict(frame[targets] if name in RAW else frame)
                    rates.setdefault((name, source, state), []).append((decisions == -1).sum() / (decisions != 0).sum())
    return pd.Series({key: np.mean(found) for key, found in rates.items()}).rename_axis(
        ["detector", "simulated by", "state"]
    )


def by_measure(rates):
    """False alarms, and the mean share of damaged records found, in percent: detectors over sources."""
    table = 100 * rates.unstack("state")
    found = table.drop(columns="healthy").mean(axis=1)
    return pd.concat({"false alarms": table["healthy"], "found": found}, axis=1).unstack("simulated by")


def advantage(table):
    """Points by which a compensator's alarms change in records of its own kind of chain, more than those of others do.

    All detectors raise more alarms in records of some kinds of chain; only what others do not share counts.
    """
    rows = {}
    for kind in kinds():
        for family in ("", "chain, "):
            for measure in ("false alarms", "found"):
                alarms = table[measure].loc[[family + name for name in kinds()], list(kinds())]
                excess = alarms[kind] - alarms.drop(columns=kind).mean(axis=1)
                own = family + kind
                rows.setdefault(own, {})[measure] = excess[own] - excess.drop(own).mean()
    return pd.DataFrame(rows).T


def regret(table):
    """What the detector that finds most in each simulation finds less of true damage than the best, in points."""
    found = table["found"]
    return pd.Series({kind: found["truth"].max() - found["truth"][found[kind].idxmax()] for kind in kinds()})


BRIDGES = {"truss": truss_case, "Z24": z24_case}


def main():
    options = arguments(__doc__, seeds=(10, "of the truss"), repeats=10, bridges=(["truss"], None, list(BRIDGES)))
    for bridge in options.bridges:
        seeds = range(options.seeds if bridge == "truss" else 1)
        tables = [by_measure(alarms(BRIDGES[bridge], seed, options.repeats)) for seed in seeds]
        mean = sum(tables) / len(tables)
        print(f"{bridge}, alarms in percent, {len(tables)} baselines of {options.repeats} repeats\n")
        for measure in ("false alarms", "found"):
            print(f"{mean[[(measure, source) for source in (*kinds(), 'truth')]].round(1).to_string()}\n")
        each = pd.concat([advantage(table) for table in tables], keys=seeds)
        gains = each.groupby(level=1, sort=False).agg(["mean", "sem"])
        print(f"Own kind's advantage, points, and its standard error\n\n{gains.round(2).to_string()}\n")
        lost = pd.DataFrame([regret(table) for table in tables])
        print("True damage found less than by the best, points, where a chain of this kind chooses\n")
        print(f"{lost.mean().round(2).to_string()}\n", flush=True)


if __name__ == "__main__":
    main()
