"""From how many degrees of freedom on is shift-invert faster than dense batches?

``python tests/benchmarks/dense_or_sparse.py``, on one core with ``OMP_NUM_THREADS=1``.
"""

import argparse
from functools import partial

import numpy as np
from measure import median_seconds
from reduction_pays import grid, line, model_of

from skthermo.fem._terms import DenseTerms, SparseTerms
from skthermo.fem.modal import ShiftInvertSolver, dense_solver


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--samples", type=int, default=64)
    parser.add_argument("--rounds", type=int, default=5)
    options = parser.parse_args()
    theta = np.random.default_rng(0).uniform(0.7, 1.3, (options.samples, 2))
    print("milliseconds a solve of 6 modes, sorted and with shapes of 10")
    for name, shapes in (
        ("line", [line(n) for n in (6, 11, 16, 21, 26, 34, 51, 67)]),
        ("grid", [grid(n) for n in (3, 4, 5, 6, 7, 8)]),
    ):
        for parts in shapes:
            model = model_of(*parts, n_parameters=2)
            forms = both_forms(model)
            ways = {f"{kind} eigenvalues": lambda f=form: f.eigenvalues(theta, 6) for kind, form in forms.items()}
            ways |= {f"{kind} modes": lambda f=form: f.modes(theta, 10) for kind, form in forms.items()}
            seconds = median_seconds(ways, options.rounds)
            times = ", ".join(f"{way} {1000 * s / options.samples:6.3f}" for way, s in seconds.items())
            print(f"{name} {model.n_dof:4d} dof: {times} ({type(forms['dense']).__name__})")


def both_forms(model):
    """The model's eigenproblem, dense and sparse, whichever it chose."""
    (nominal, mass), (first, _), (other, _) = (model.matrices(theta) for theta in ([1, 1], [2, 1], [1, 2]))
    stiffness, forms = [first - nominal, other - nominal], {}
    dense = partial(dense_solver, nominal=np.ones((1, 2)))
    for name, kind, form in (("dense", DenseTerms, dense), ("sparse", SparseTerms, ShiftInvertSolver)):
        exponents = np.eye(2, dtype=int), np.zeros((1, 2), dtype=int)
        forms[name] = form(kind.from_matrices(stiffness, exponents[0]), kind.from_matrices([mass], exponents[1]))
    return forms


if __name__ == "__main__":
    main()
