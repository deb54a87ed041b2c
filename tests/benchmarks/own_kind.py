"""Records that a chain simulates, evaluated by compensators of the chain's own kind and of others.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=path/to/data python tests/benchmarks/own_kind.py [--bridges truss Z24]

Chains whose temperature mapper is piecewise-linear, boosted trees or a network simulate the healthy and the damaged
structure. Detectors evaluate residuals of regressors of the same three kinds, and raw frequencies. Beside them stand
the same alarms on true records of the truss, and on those of Z24, with the chain of the baseline and assumed damage.
"""

import numpy as np
import pandas as pd
from harness import DATA, arguments, compensated, joined, recipes, shown
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neural_network import MLPRegressor

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import add_noise
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

NOISE, RAW = 0.01, "raw, 20 neighbours"
DAMAGES = {"healthy": {}, "bottom 10 %": {"bottom": 0.1}, "diagonal 5 %": {"diagonal": 0.05}}


def kinds():
    """Regressors for the chain's temperature mapper, and for compensators."""
    network = MLPRegressor(
        hidden_layer_sizes=(64,), alpha=1.0, learning_rate_init=0.003, max_iter=2000, n_iter_no_change=20
    )
    trees = MultiOutputRegressor(GradientBoostingRegressor(random_state=0))
    regressors = {"piecewise-linear": None, "boosted trees": trees, "network": network}
    return {name: TemperatureMapper(regressor, random_state=0) for name, regressor in regressors.items()}


def truss(seed):
    """Chains to fit, a baseline, and for each state the weather, the damage and the true records."""
    year, later = (make_truss_campaign(noise=NOISE, random_state=2 * seed + i) for i in range(2))
    inverse = PosteriorInverse(make_truss())
    chains = {
        name: DataInformedFEM(make_truss(), inverse=inverse, mapper=mapper, random_state=seed)
        for name, mapper in kinds().items()
    }
    states = {}
    for name, damage in DAMAGES.items():
        F = add_noise(later.model.damaged(damage).frequencies(later.theta), NOISE, random_state=1000 + seed)
        true = later.temperatures.join(pd.DataFrame(F, later.temperatures.index, year.frequencies.columns))
        states[name] = later.temperatures, damage, true
    return chains, joined(year), states


def z24(_):
    """The same with measured records."""
    z24 = recipes("z24")
    bridge = z24.Bridge(z24.find(DATA))
    records, model = z24.Records.of(bridge), z24.bridge_model()
    chains = {name: z24.chain(model).set_params(mapper=mapper) for name, mapper in kinds().items()}
    parts = {"healthy": (records.later, {}), "damaged": (records.damaged, {"soil": 0.18})}
    states = {name: (frame[list(bridge.T)], damage, frame) for name, (frame, damage) in parts.items()}
    return chains, records.baseline, states


def alarms(case, seed, whiten):
    """Alarms in percent by detector and source of the records: of healthy ones, and the mean of damaged ones."""
    chains, baseline, states = case(seed)
    temperatures = list(states["healthy"][0])
    targets = [name for name in baseline if name not in temperatures]
    detectors = {name: compensated(targets, regressor=one, whiten=whiten) for name, one in kinds().items()}
    detectors[RAW] = recipes("detector").field_detectors(targets, block="1D" if case is z24 else None)[RAW]
    for name, detector in detectors.items():
        detector.fit(baseline[targets] if name == RAW else baseline)
    rates = {}
    for source, chain in (chains | {"true records": None}).items():
        if chain is not None:
            chain.fit(baseline[temperatures], baseline[targets])
        for state, (T, damage, true) in states.items():
            options = {"damage": damage, "noise": "fitted", "random_state": seed}
            records = true if chain is None else T.join(chain.simulate(T, **options))
            for name, detector in detectors.items():
                decisions = detector.predict(records[targets] if name == RAW else records)
                kind = "false alarms" if state == "healthy" else "damage found"
                rate = 100 * (decisions == -1).sum() / (decisions != 0).sum()
                rates.setdefault((kind, name, source), []).append(rate)
    return pd.Series({key: np.mean(found) for key, found in rates.items()})


BRIDGES = {"truss": (truss, None, range(4), "Truss, four baselines"), "Z24": (z24, "local", range(1), "Z24")}


def main():
    options = arguments(__doc__, bridges=dict.fromkeys(BRIDGES))
    for bridge in options.bridges:
        case, whiten, seeds, words = BRIDGES[bridge]
        mean = sum(alarms(case, seed, whiten) for seed in seeds) / len(seeds)
        for kind in ("false alarms", "damage found"):
            table = mean[kind].unstack(sort=False).rename_axis("detector")
            shown(f"{words}, records that chains of three kinds simulate, and true ones: {kind}, %", table, 1)


if __name__ == "__main__":
    main()
