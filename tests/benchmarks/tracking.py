"""What following modes costs against sorting them, in one run.

``python tests/benchmarks/tracking.py``, on one core with ``OMP_NUM_THREADS=1``.
"""

import argparse

import numpy as np
from measure import median_seconds

from skthermo.datasets import make_truss, make_z24
from skthermo.fem import AffineModel


def tracked_twin(model):
    """The same model with columns that follow their modes."""
    nominal, mass = model.matrices(np.ones(len(model.parameter_names)))
    terms = {}
    for i, name in enumerate(model.parameter_names):
        doubled = np.ones(len(model.parameter_names))
        doubled[i] = 2
        terms[(name,)] = model.matrices(doubled)[0] - nominal
    terms[()] = nominal - sum(terms.values())
    return AffineModel(terms, mass, n_modes=model.n_modes, track=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--samples", type=int, default=100)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    truss, z24 = make_truss(), make_z24()
    pairs = {
        "truss": (truss, tracked_twin(truss), 50 * options.samples),
        "Z24": (make_z24(track=False), z24, options.samples),
        "Z24 reduced": (
            make_z24(track=False).reduced(0.3, random_state=0),
            z24.reduced(0.3, random_state=0),
            10 * options.samples,
        ),
    }
    for name, (by_rank, by_shape, n_samples) in pairs.items():
        theta = np.random.default_rng(0).uniform(0.7, 1.3, (n_samples, len(by_rank.parameter_names)))
        ways = {
            "sorted": lambda m=by_rank, t=theta: m.frequencies(t),
            "tracked": lambda m=by_shape, t=theta: m.frequencies(t),
        }
        seconds = {way: 1000 * s / n_samples for way, s in median_seconds(ways, options.rounds).items()}
        print(
            f"{name} ({by_rank.n_dof} degrees of freedom): sorted {seconds['sorted']:.3f} ms, tracked "
            f"{seconds['tracked']:.3f} ms a sample, {seconds['tracked'] / seconds['sorted']:.2f} times"
        )


if __name__ == "__main__":
    main()
