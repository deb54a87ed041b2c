"""Large frames, reduced and not, against a loop of scipy.sparse.linalg.eigsh and against LAPACK on the same basis.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/reduced_models.py

On three smaller models, on the exported building frame, if SKTHERMO_DATA names the folder that has it, and on a
tied-arch bridge. The loop solves ready-made matrices, some of the samples only, and is scaled up; making the basis and
checking it counts as part of every reduced sample. Medians of several rounds in one run.
"""

import argparse
import os
import sys
import time
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse.linalg
from bridges import frame_bridge
from measure import median_seconds, peak_megabytes

from skthermo.datasets import make_kw51, make_z24
from skthermo.fem import AffineModel, linearise, sample

sys.path.append(str(Path(__file__).parents[1] / "fem"))
from frames import FRAME

BOUNDS = 0.3


def building_frame():
    """2302 degrees of freedom, 913 of them massless, and 14 parameters."""
    content = scipy.io.loadmat(Path(os.environ["SKTHERMO_DATA"]) / "building_frame" / "ConcreteBuildingFrame.mat")
    names = [f"E_{i}" for i in range(1, 13)] + ["Influence_Link", "Influence_Rebar"]
    return AffineModel({(name,): content[name] for name in names}, content["M0"])


def draw(model, n_samples, seed, inside=1.0):
    share = np.random.default_rng(seed).uniform(-1, 1, (n_samples, len(model.parameter_names)))
    return 1 + inside * BOUNDS * share


def central_differences(model, theta, step=1e-4):
    differences = [
        (model.frequencies(theta + step * unit) - model.frequencies(theta - step * unit)) / (2 * step)
        for unit in np.eye(theta.shape[1])
    ]
    return np.stack(differences, axis=2)


def by_lapack(reduced, theta, *, derivatives=False):
    """Frequencies, or these and derivatives, from all eigenvalues and shapes of every matrix on the basis."""
    core = reduced._core
    basis = np.linalg.inv(np.linalg.cholesky(core.mass.assemble(theta[:1])[0])).T
    standard = core.stiffness.projected(basis)
    for rows in np.array_split(theta, max(1, len(theta) // 400)):
        if derivatives:
            shapes = np.linalg.eigh(standard.assemble(rows))[1]
            columns = shapes[:, :, : len(core.ranks)]
            standard.quadratic_forms(columns) @ standard.coefficient_gradients(rows)
        else:
            np.linalg.eigvalsh(standard.assemble(rows))


def print_errors(model, reduced, options):
    uniform = draw(model, options.fresh, seed=1)
    corners = np.where(draw(model, options.fresh, seed=4) < 1, 1 - BOUNDS, 1 + BOUNDS)
    for kind, theta in {"fresh points": uniform, "random corners": corners}.items():
        error = np.abs(reduced.frequencies(theta) / model.frequencies(theta) - 1).max()
        print(f"largest relative error at {options.fresh} {kind}: {error:.1e}")


def compare_small(model, options):
    """Accuracy of a reduced model, and what it takes."""
    reduced, theta = model.reduced(BOUNDS, random_state=0), draw(model, 1000, seed=2)
    print(f"{reduced.basis_size_} basis vectors, {len(reduced.snapshot_points_)} snapshots")
    print_errors(model, reduced, options)
    ways = {
        "making the basis": lambda: model.reduced(BOUNDS, random_state=0),
        "1000 reduced samples": lambda: reduced.frequencies(theta),
        "1000 with derivatives": lambda: linearise(reduced, theta),
    }
    print(f"{100 * (1 - reduced._core.certified(theta).mean()):.1f} % of rows go to LAPACK")
    for name, seconds in median_seconds(ways, options.rounds, time.process_time).items():
        print(f"{name}: {seconds:.2f} s")


def compare(model, options):
    """Accuracy and speed of one frame."""
    reduced = model.reduced(BOUNDS, random_state=0)
    print(f"{reduced}, {len(reduced.snapshot_points_)} snapshots")
    print_errors(model, reduced, options)

    theta, inner = draw(model, 1000, seed=2), draw(model, 100, seed=3, inside=0.99)
    matrices = [model.matrices(row) for row in theta[: options.loop]]
    n_modes = model.n_modes
    ways = {
        "loop of eigsh": lambda: [scipy.sparse.linalg.eigsh(K, n_modes, M, sigma=0) for K, M in matrices],
        "full model": lambda: model.frequencies(theta[: options.loop]),
        "making the basis": lambda: model.reduced(BOUNDS, random_state=0),
        "1000 reduced samples": lambda: reduced.frequencies(theta),
        "1000 by LAPACK": lambda: by_lapack(reduced, theta),
        "1000 with derivatives": lambda: linearise(reduced, theta),
        "1000 with derivatives by LAPACK": lambda: by_lapack(reduced, theta, derivatives=True),
        "exact Jacobian": lambda: model.jacobian(inner[:5]),
        "central differences": lambda: central_differences(model, inner[:5]),
        "reduced exact Jacobian": lambda: reduced.jacobian(inner),
        "reduced central differences": lambda: central_differences(reduced, inner),
    }
    seconds = median_seconds(ways, options.rounds, time.process_time)
    loop, full = (seconds[name] / options.loop for name in ("loop of eigsh", "full model"))
    basis, solve = seconds["making the basis"], seconds["1000 reduced samples"] / 1000
    print(f"milliseconds a solve: loop {1e3 * loop:.1f}, full model {1e3 * full:.1f}, reduced {1e3 * solve:.3f}")
    print(f"making the basis: {basis:.2f} s")
    for n_samples in (1000, 10_000, 100_000):
        ratio = n_samples * loop / (basis + n_samples * solve)
        print(f"{n_samples:6d} samples, basis included: {basis + n_samples * solve:6.2f} s, {ratio:.1f} times the loop")
    for name, kind in {"1000 reduced samples": "1000", "1000 with derivatives": "1000 with derivatives"}.items():
        ratio = seconds[f"{kind} by LAPACK"] / seconds[name]
        print(f"{name}: {seconds[name]:.3f} s, {ratio:.1f} times LAPACK's eigh or eigvalsh of every row")
    for kind, rows in {"uniform": theta, "corners": np.where(theta < 1, 1 - BOUNDS, 1 + BOUNDS)}.items():
        print(f"{kind}: {100 * (1 - reduced._core.certified(rows).mean()):.1f} % of rows go to LAPACK")
    for kind in ("", "reduced "):
        ratio = seconds[f"{kind}central differences"] / seconds[f"{kind}exact Jacobian"]
        print(f"{kind}exact Jacobian, {len(model.parameter_names)} parameters: {ratio:.1f} times central differences")


def compare_workers(model, options):
    """Two loky processes against one."""
    ways = {
        n_jobs: lambda n_jobs=n_jobs: sample(model, BOUNDS, options.workers, n_jobs=n_jobs, random_state=0)
        for n_jobs in (1, 2)
    }
    ways[2]()  # starts the processes
    seconds = median_seconds(ways, options.rounds)
    ratio = seconds[1] / seconds[2]
    print(f"{options.workers} full samples: {seconds[1]:.2f} s, two workers {seconds[2]:.2f} s, {ratio:.2f} times")


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--bridge", type=int, nargs=3, default=[40, 4, 9], help="bays, elements a member, stringers")
    parser.add_argument("--fresh", type=int, default=500, help="points, and corners, where the error is measured")
    parser.add_argument("--loop", type=int, default=100, help="samples of the loop")
    parser.add_argument("--workers", type=int, default=400, help="full samples of two workers")
    parser.add_argument("--memory", type=int, default=1_000_000, help="samples whose memory is measured")
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    for name, model in {"portal frame": FRAME, "Z24": make_z24(), "KW51": make_kw51()}.items():
        print(f"\n{name}")
        compare_small(model, options)
    frames = {"tied-arch bridge": frame_bridge(*options.bridge)}
    if os.environ.get("SKTHERMO_DATA"):
        frames = {"building frame": building_frame()} | frames
    for name, model in frames.items():
        print(f"\n{name}")
        compare(model, options)
        compare_workers(model, options)
    print(f"\npeak memory of the {name}")
    print(f"making the basis: {peak_megabytes(lambda: model.reduced(BOUNDS, random_state=0)):.0f} MB")
    reduced = model.reduced(BOUNDS, random_state=0)
    for n_samples in (options.memory // 100, options.memory // 10, options.memory):
        peak = peak_megabytes(lambda n=n_samples: sample(reduced, BOUNDS, n, random_state=0))
        result = 8e-6 * n_samples * (len(model.parameter_names) + model.n_modes)
        print(f"{n_samples} reduced samples: {peak:.0f} MB, {result:.0f} MB of them the result")


if __name__ == "__main__":
    main()
