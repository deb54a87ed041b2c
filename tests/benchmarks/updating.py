"""Model updating of a building frame from frequencies and shapes at few degrees of freedom.

    SKTHERMO_DATA=... OMP_NUM_THREADS=1 python tests/benchmarks/updating.py [--method lbfgs]

Needs ``building_frame/ConcreteBuildingFrame.mat`` (2302 degrees of freedom, 14 parameters) in the folder that
SKTHERMO_DATA names.
"""

import sys

import numpy as np
from harness import DATA, arguments, timed
from structures import building_frame

from skthermo.updating import ModelUpdater, identifiability

FREQUENCY_NOISE, SHAPE_NOISE, N_DOFS = 0.001, 0.01, 40
SHAPE_WEIGHT = np.sqrt(2 * (N_DOFS - 1)) / SHAPE_NOISE**2
NEAR_BEST = 1.01  # objective, over the smallest one, up to which a start has found the optimum


def measure(model, dofs, random):
    """The truth somewhere in the box, and noisy frequencies and shapes."""
    truth = random.uniform(0.7, 1.3, len(model.parameter_names))
    frequencies, shapes = (values[0] for values in model.modes([truth]))
    noisy = frequencies * (1 + FREQUENCY_NOISE * random.standard_normal(len(frequencies)))
    at_dofs = shapes[dofs]
    level = SHAPE_NOISE * np.sqrt(np.mean(at_dofs**2, axis=0))
    return truth, noisy, at_dofs + level * random.standard_normal(at_dofs.shape)


def main():
    options = arguments(__doc__, starts=20, method=("least_squares", None, ["least_squares", "lbfgs"]), seed=1)
    if DATA is None:
        sys.exit("expected the folder of data in SKTHERMO_DATA")
    model, random = building_frame(n_modes=5), np.random.default_rng(options.seed)
    mass = model.matrices(np.ones(len(model.parameter_names)))[1]
    dofs = np.sort(random.choice(np.flatnonzero(mass.diagonal() > 0), N_DOFS, replace=False))
    truth, frequencies, shapes = measure(model, dofs, random)
    known = identifiability(model, truth, noise=FREQUENCY_NOISE, dofs=dofs, shape_noise=SHAPE_NOISE)
    search = {"n_starts": options.starts, "method": options.method, "random_state": 1}
    updater = ModelUpdater(model, bounds=0.3, shape_weight=SHAPE_WEIGHT, **search)
    measured = {"shapes": shapes, "dofs": dofs, "frequency_std": FREQUENCY_NOISE * frequencies}
    seconds, _ = timed(lambda: updater.fit(frequencies, **measured))
    starts, deviations = updater.starts_, known.deviations.to_numpy()
    found = (starts["objective"] <= NEAR_BEST * starts["objective"].min()).sum()
    errors = (np.stack(starts["theta"]) / truth - 1) / deviations
    print(f"{model}, {N_DOFS} degrees of freedom measured, {options.starts} starts: {found} at the best optimum")
    print(f"{seconds / options.starts:.2f} s and {starts['n_evaluations'].median():.0f} evaluations a start")
    precise = deviations < 0.01
    good = (np.abs(errors[:, precise]) <= 3).all(axis=1).sum()
    print(f"{precise.sum()} parameters known to better than 1 %: all within 3 deviations from {good} starts")


if __name__ == "__main__":
    main()
