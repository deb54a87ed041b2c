"""Model updating of a building frame from frequencies and shapes at few degrees of freedom.

    SKTHERMO_DATA=... OMP_NUM_THREADS=1 python tests/benchmarks/updating.py

Needs ``building_frame/ConcreteBuildingFrame.mat`` (2302 degrees of freedom, 14 parameters) in the folder that
SKTHERMO_DATA names. Without it, only the second part runs: a synthetic frame with 17 parameters.
"""

import argparse
import os
import time
import warnings
from itertools import pairwise
from pathlib import Path
from unittest import mock

import numpy as np
import scipy.io

from skthermo.fem import AffineModel, Beam, Spring, Structure
from skthermo.updating import ModelUpdater, identifiability
from skthermo.updating._residuals import Point

FREQUENCY_NOISE, SHAPE_NOISE, N_DOFS = 0.001, 0.01, 40
SHAPE_WEIGHT = np.sqrt(2 * (N_DOFS - 1)) / SHAPE_NOISE**2
NEAR_BEST = 1.01
"""Objective, over the smallest one, up to which a start has found the optimum."""


def building_frame(folder):
    """K = sum of theta_j times influence matrices, M constant and singular."""
    data = scipy.io.loadmat(Path(folder) / "building_frame" / "ConcreteBuildingFrame.mat")
    names = [f"E_{i}" for i in range(1, 13)] + ["Influence_Link", "Influence_Rebar"]
    return AffineModel({(name,): data[name] for name in names}, data["M0"], n_modes=5)


def tower(n_storeys=8, n_elements=3):
    """A frame of 16 storey parameters (columns and beams) and one of the soil: 984 degrees of freedom."""
    section = {"E": 30e9, "G": 12e9, "A": 0.2, "I_yy": 0.005, "I_zz": 0.003, "J": 0.005, "density": 2500.0}
    corners = [(0.0, 0.0), (6.0, 0.0), (6.0, 4.0), (0.0, 4.0)]
    nodes, members, groups = {}, {}, {}

    def line(group, first, last):
        start, end = nodes[first], nodes[last]
        names = [first, *((group, first, i) for i in range(1, n_elements)), last]
        for i, name in enumerate(names):
            nodes[name] = tuple(np.add(start, np.subtract(end, start) * i / n_elements))
        for one, other in pairwise(names):
            members[one, other] = Beam(one, other, **section)
            groups.setdefault(group, []).append((one, other))

    for level in range(n_storeys + 1):
        nodes |= {(level, c): (*corners[c], 3.0 * level) for c in range(4)}
    for level in range(n_storeys):
        for c in range(4):
            line(f"columns {level + 1}", (level, c), (level + 1, c))
            line(f"beams {level + 1}", (level + 1, c), (level + 1, (c + 1) % 4))
    directions = {"x": 3e8, "y": 2e8, "z": 1e9, "rx": 2e9, "ry": 2e9, "rz": 1e9}
    for c in range(4):
        for direction, k in directions.items():
            members["soil", c, direction] = Spring((0, c), direction, k)
            groups.setdefault("soil", []).append(("soil", c, direction))
    return Structure(nodes, members, {}, groups).assemble(list(groups), n_modes=8)


def measure(model, dofs, random):
    """Noisy frequencies and shapes of a model somewhere in the box, and the truth."""
    truth = random.uniform(0.7, 1.3, len(model.parameter_names))
    frequencies, shapes = (values[0] for values in model.modes([truth]))
    noisy = frequencies * (1 + FREQUENCY_NOISE * random.standard_normal(len(frequencies)))
    at_dofs = shapes[dofs]
    level = SHAPE_NOISE * np.sqrt(np.mean(at_dofs**2, axis=0))
    return truth, noisy, at_dofs + level * random.standard_normal(at_dofs.shape)


def moving(model):
    """Degrees of freedom with mass."""
    mass = model.matrices(np.ones(len(model.parameter_names)))[1]
    return np.flatnonzero(mass.diagonal() > 0)


def forward(point):
    """Forward differences of the residuals, in the place of exact derivatives."""
    step = 1e-6
    moved = (point._residuals.at(point._theta + step * unit).values for unit in np.eye(len(point._theta)))
    return np.stack([(values - point.values) / step for values in moved], axis=1)


def central(point):
    """Central differences, as in the paper's eq. (A.2)."""
    step = 1e-4
    ends = [
        point._residuals.at(point._theta + way * step * unit).values
        for unit in np.eye(len(point._theta))
        for way in (1, -1)
    ]
    return np.stack(
        [(raised - lowered) / (2 * step) for raised, lowered in zip(ends[::2], ends[1::2], strict=True)], axis=1
    )


def fit(model, dofs, frequencies, shapes, **options):
    """A fitted updater and its seconds."""
    updater = ModelUpdater(model, bounds=0.3, shape_weight=SHAPE_WEIGHT, random_state=1, **options)
    started = time.perf_counter()
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message=".*(modes-cross|mode-order)")
        updater.fit(frequencies, shapes=shapes, dofs=dofs, frequency_std=FREQUENCY_NOISE * frequencies)
    return updater, time.perf_counter() - started


def report(model, options):
    random = np.random.default_rng(options.seed)
    dofs = np.sort(random.choice(moving(model), N_DOFS, replace=False))
    truth, frequencies, shapes = measure(model, dofs, random)
    known = identifiability(model, truth, noise=FREQUENCY_NOISE, dofs=dofs, shape_noise=SHAPE_NOISE)
    updater, seconds = fit(model, dofs, frequencies, shapes, n_starts=options.starts, method=options.method)
    starts = updater.starts_
    found = (starts["objective"] <= NEAR_BEST * starts["objective"].min()).to_numpy()
    deviations = known.deviations.to_numpy()
    errors = (np.stack(starts["theta"]) / truth - 1) / deviations
    print(f"{model}, {N_DOFS} degrees of freedom measured, {options.starts} starts: {found.sum()} at the best optimum")
    print(f"{seconds / options.starts:.2f} s and {starts['n_evaluations'].median():.0f} evaluations a start")
    print("\nparameter        truth   found   Cramer-Rao %   error / deviation   starts within 3 deviations")
    best = int(starts["objective"].argmin())
    for j, name in enumerate(model.parameter_names):
        within = (np.abs(errors[:, j]) <= 3).sum()
        below = "*" if deviations[j] < 0.01 else " "
        print(
            f"{name:15s} {truth[j]:6.3f}  {updater.theta_[j]:6.3f}   {100 * deviations[j]:11.2f} {below}"
            f"   {errors[best, j]:17.2f}   {within:10d}"
        )
    precise = deviations < 0.01
    good = (np.abs(errors[:, precise]) <= 3).all(axis=1).sum()
    print(f"* {precise.sum()} parameters known to better than 1 %: all within 3 deviations from {good} starts\n")
    return dofs, frequencies, shapes


def compare_gradients(model, dofs, frequencies, shapes, rounds):
    """One start with exact derivatives, and with differences."""
    ways = {"exact": Point.jacobian, "forward differences": forward, "central differences": central}
    seconds, fitted = {name: [] for name in ways}, {}
    for _ in range(rounds):
        for name, jacobian in ways.items():
            with mock.patch.object(Point, "jacobian", jacobian):
                fitted[name], elapsed = fit(model, dofs, frequencies, shapes)
            seconds[name].append(elapsed)
    medians = {name: np.median(values) for name, values in seconds.items()}
    for name, median in medians.items():
        start = fitted[name].starts_.iloc[0]
        print(
            f"{name:20s} {median:6.2f} s a start, {median / medians['exact']:4.1f} times exact, "
            f"{start.n_evaluations} evaluations, objective {start.objective:.6f}"
        )
    print()


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--starts", type=int, default=20)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--method", choices=["least_squares", "lbfgs"], default="least_squares")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    if folder := os.environ.get("SKTHERMO_DATA"):
        model = building_frame(folder)
        compare_gradients(model, *report(model, options), options.rounds)
    frame = tower()
    report(frame, options)


if __name__ == "__main__":
    main()
