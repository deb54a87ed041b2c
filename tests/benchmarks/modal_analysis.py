"""Batched modal analysis of the truss against a loop over samples.

    OMP_NUM_THREADS=1 python tests/benchmarks/modal_analysis.py

Medians of several rounds in one run; the loops and the one-thread batch have one BLAS thread. Peak
memory is what one call allocates beyond its input.
"""

import os

import scipy.linalg
from harness import arguments, median_seconds, peak_megabytes
from threadpoolctl import threadpool_limits

from skthermo.datasets import make_truss
from skthermo.fem import sample


def loop(model, theta, **options):
    """One assembly and one scipy.linalg.eigh for each sample."""
    terms, mass = model._core.stiffness, model.matrices(theta[0])[1].toarray()
    for coefficients in terms.coefficients(theta):
        stiffness = sum(c * matrix for c, matrix in zip(coefficients, terms.matrices, strict=True))
        scipy.linalg.eigh(stiffness, mass, **options)


def main():
    options = arguments(__doc__, samples=10_000, rounds=5)
    model = make_truss()
    theta = sample(model, 0.2, options.samples, random_state=0).theta
    ways = {
        "batch, one thread": lambda: model.frequencies(theta),
        "sample, n_jobs=2": lambda: sample(model, 0.2, options.samples, n_jobs=2, random_state=0),
        "loop, eigh(K, M)": lambda: loop(model, theta),
        "loop, eigh(K, M, eigvals_only=True)": lambda: loop(model, theta, eigvals_only=True),
        "loop, eigh(K, M, eigvals_only=True, subset_by_index=[0, 5])": lambda: loop(
            model, theta, eigvals_only=True, subset_by_index=[0, 5]
        ),
    }
    with threadpool_limits(1):
        medians = median_seconds(ways, options.rounds)
    batch = medians["batch, one thread"]
    print(f"{options.samples} truss solves, {os.cpu_count()} cores, median of {options.rounds} rounds")
    print(f"{'':60s} seconds   over batch   peak MB")
    for name, median in medians.items():
        print(f"{name:60s} {median:7.3f}   {median / batch:10.2f}   {peak_megabytes(ways[name]):7.1f}")
    fastest_loop = min(seconds for name, seconds in medians.items() if name.startswith("loop"))
    print(f"fastest loop over sample, n_jobs=2: {fastest_loop / medians['sample, n_jobs=2']:.2f}")


if __name__ == "__main__":
    main()
