"""Z24: records that a chain simulates, evaluated by compensators of the chain's own kind and of others.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=path/to/data python tests/benchmarks/own_kind.py

Chains whose temperature mapper is piecewise-linear, boosted trees or a network learn the baseline, and simulate the
later weather, healthy and with an assumed damage of the soil. Detectors evaluate residuals of regressors of the same
three kinds, and raw frequencies. Beside them stand the same alarms on measured records.
"""

import pandas as pd
from harness import DATA, arguments, compensated, recipes, shown
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.neural_network import MLPRegressor

from skthermo.surrogate import TemperatureMapper

RAW = "raw, 20 neighbours"
ASSUMED = {"soil": 0.18}


def kinds():
    """Regressors for the chain's temperature mapper, and for compensators."""
    network = MLPRegressor(
        hidden_layer_sizes=(64,), alpha=1.0, learning_rate_init=0.003, max_iter=2000, n_iter_no_change=20
    )
    trees = GradientBoostingRegressor(random_state=0)  # one for each output
    regressors = {"piecewise-linear": None, "boosted trees": trees, "network": network}
    return {name: TemperatureMapper(regressor, random_state=0) for name, regressor in regressors.items()}


def main():
    arguments(__doc__)
    z24 = recipes("z24")
    bridge = z24.Bridge(z24.find(DATA))
    records, model, targets, sensors = z24.Records.of(bridge), z24.bridge_model(), z24.FREQUENCIES, list(bridge.T)
    chains = {f"simulated, {name}": z24.chain(model).set_params(mapper=mapper) for name, mapper in kinds().items()}
    detectors = {name: compensated(targets, regressor=one) for name, one in kinds().items()}
    detectors[RAW] = recipes("detector").field_detectors(targets, block="1D")[RAW]
    for name, detector in detectors.items():
        detector.fit(records.baseline[targets] if name == RAW else records.baseline)
    states = {"false alarms": (records.later, {}), "damage found": (records.damaged, ASSUMED)}
    rows = {state: {} for state in states}
    for source, chain in (chains | {"measured": None}).items():
        if chain is not None:
            chain.fit(records.baseline[sensors], records.baseline[targets])
        for state, (measured, damage) in states.items():
            T, made = measured[sensors], measured
            if chain is not None:
                made = T.join(chain.simulate(T, damage=damage, noise="fitted", random_state=0))
            for name, detector in detectors.items():
                decisions = detector.predict(made[targets] if name == RAW else made)
                rate = 100 * (decisions == -1).sum() / (decisions != 0).sum()
                rows[state].setdefault(name, {})[source] = rate
    for state, table in rows.items():
        title = f"Z24, records that chains of three kinds simulate, and measured ones: {state}, %"
        shown(title, pd.DataFrame(table).T.rename_axis("compensator"), 1)


if __name__ == "__main__":
    main()
