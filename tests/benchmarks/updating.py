"""Model updating of a building frame from frequencies and shapes at few degrees of freedom, by two methods.

    SKTHERMO_DATA=... OMP_NUM_THREADS=1 python tests/benchmarks/updating.py

Needs ``building_frame/ConcreteBuildingFrame.mat`` (2302 degrees of freedom, 14 parameters) in the folder that
SKTHERMO_DATA names.
"""

import numpy as np
import pandas as pd
from harness import arguments, shown
from structures import building_frame

from skthermo.updating import ModelUpdater

FREQUENCY_NOISE, SHAPE_NOISE, N_DOFS = 0.001, 0.01, 40
SHAPE_WEIGHT = np.sqrt(2 * (N_DOFS - 1)) / SHAPE_NOISE**2
NEAR_BEST = 1.01  # objective, over the smallest one, up to which a start has found the optimum
METHODS = {"least squares": "least_squares", "L-BFGS-B": "lbfgs"}


def measure(model, dofs, random):
    """Noisy frequencies and shapes somewhere in the box."""
    truth = random.uniform(0.7, 1.3, len(model.parameter_names))
    frequencies, shapes = (values[0] for values in model.modes([truth]))
    noisy = frequencies * (1 + FREQUENCY_NOISE * random.standard_normal(len(frequencies)))
    at_dofs = shapes[dofs]
    level = SHAPE_NOISE * np.sqrt(np.mean(at_dofs**2, axis=0))
    return noisy, at_dofs + level * random.standard_normal(at_dofs.shape)


def main():
    options = arguments(__doc__, starts=10, seed=1)
    model, random = building_frame(n_modes=5), np.random.default_rng(options.seed)
    mass = model.matrices(np.ones(len(model.parameter_names)))[1]
    dofs = np.sort(random.choice(np.flatnonzero(mass.diagonal() > 0), N_DOFS, replace=False))
    frequencies, shapes = measure(model, dofs, random)
    measured = {"shapes": shapes, "dofs": dofs, "frequency_std": FREQUENCY_NOISE * frequencies}
    rows, starts = {}, {}
    for name, method in METHODS.items():
        search = {"n_starts": options.starts, "method": method, "random_state": 1}
        updater = ModelUpdater(model, bounds=0.3, shape_weight=SHAPE_WEIGHT, **search)
        starts[name] = updater.fit(frequencies, **measured).starts_
    best = min(table["objective"].min() for table in starts.values())
    for name, table in starts.items():
        rows[name] = {
            "starts at the best optimum": (table["objective"] <= NEAR_BEST * best).sum(),
            "evaluations a start, median": int(table["n_evaluations"].median()),
        }
    title = f"Building frame, 14 parameters, shapes at {N_DOFS} degrees of freedom, {options.starts} random starts"
    shown(title, pd.DataFrame(rows).T)


if __name__ == "__main__":
    main()
