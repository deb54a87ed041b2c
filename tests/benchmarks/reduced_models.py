"""Large frames, reduced and not, against a loop of scipy.sparse.linalg.eigsh.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/reduced_models.py

On the exported building frame, if SKTHERMO_DATA names the folder that has it, and on a tied-arch bridge. The loop
solves ready-made matrices, some of the samples only, and is scaled up; making the basis and checking it counts as part
of every reduced sample. Medians of several rounds in one run.
"""

import time

import numpy as np
import scipy.sparse.linalg
from harness import DATA, arguments, draw, median_seconds, peak_megabytes
from structures import building_frame, frame_bridge

from skthermo.fem import linearise, sample

BOUNDS = 0.3


def compare(model, options):
    """Accuracy and speed of one frame."""
    reduced = model.reduced(BOUNDS, random_state=0)
    print(f"{reduced}, {len(reduced.snapshot_points_)} snapshots")
    corners = np.where(draw(model, options.fresh, seed=4) < 1, 1 - BOUNDS, 1 + BOUNDS)
    for kind, theta in {"fresh points": draw(model, options.fresh, seed=1), "random corners": corners}.items():
        error = np.abs(reduced.frequencies(theta) / model.frequencies(theta) - 1).max()
        print(f"largest relative error at {options.fresh} {kind}: {error:.1e}")
    theta = draw(model, 1000, seed=2)
    matrices = [model.matrices(row) for row in theta[: options.loop]]
    ways = {
        "loop of eigsh": lambda: [scipy.sparse.linalg.eigsh(K, model.n_modes, M, sigma=0) for K, M in matrices],
        "full model": lambda: model.frequencies(theta[: options.loop]),
        "making the basis": lambda: model.reduced(BOUNDS, random_state=0),
        "1000 reduced samples": lambda: reduced.frequencies(theta),
        "1000 with derivatives": lambda: linearise(reduced, theta),
    }
    seconds = median_seconds(ways, options.rounds, time.process_time)
    loop, full = (seconds[name] / options.loop for name in ("loop of eigsh", "full model"))
    basis, solve = seconds["making the basis"], seconds["1000 reduced samples"] / 1000
    print(f"milliseconds a solve: loop {1e3 * loop:.1f}, full model {1e3 * full:.1f}, reduced {1e3 * solve:.3f}")
    print(f"making the basis: {basis:.2f} s; 1000 with derivatives: {seconds['1000 with derivatives']:.3f} s")
    for n_samples in (1000, 10_000, 100_000):
        ratio = n_samples * loop / (basis + n_samples * solve)
        print(f"{n_samples:6d} samples, basis included: {basis + n_samples * solve:6.2f} s, {ratio:.1f} times the loop")


def main():
    options = arguments(
        __doc__,
        bridge=([40, 4, 9], "bays, elements a member, stringers"),
        fresh=(500, "points, and corners, where the error is measured"),
        loop=(100, "samples of the loop"),
        memory=(1_000_000, "samples whose memory is measured"),
        rounds=5,
    )
    for name, make in {
        "building frame": building_frame,
        "tied-arch bridge": lambda: frame_bridge(*options.bridge),
    }.items():
        if name == "tied-arch bridge" or DATA is not None:
            print(f"\n{name}")
            model = make()
            compare(model, options)
    print(f"\npeak memory of the {name}")
    print(f"making the basis: {peak_megabytes(lambda: model.reduced(BOUNDS, random_state=0)):.0f} MB")
    reduced = model.reduced(BOUNDS, random_state=0)
    peak = peak_megabytes(lambda: sample(reduced, BOUNDS, options.memory, random_state=0))
    result = 8e-6 * options.memory * (len(model.parameter_names) + model.n_modes)
    print(f"{options.memory} reduced samples: {peak:.0f} MB, {result:.0f} MB of them the result")


if __name__ == "__main__":
    main()
