"""What solves take beside the least that this core could take, from the flops and bytes of their factorisations.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/roofline.py

The core's rates are those of a matrix product and of adding a number to a long vector, measured in the same run. A full
solve factorises the stiffness once, c^2 flops for each column of c entries, and reads both factors once for each mode
at least; a reduced one adds up its terms and factorises once, in the cache. "bound" is the larger of flops over their
rate and bytes over theirs. Beside it, in ms of processor time, least of some rounds: SciPy's factorisation and its
solution for one vector (of a reduced model, LAPACK's
eigenvalues of a matrix of its size), and a solve of six modes by the library.
"""

import numpy as np
import pandas as pd
import scipy.sparse.linalg
from harness import DATA, arguments, core_rates, draw, shown, timed
from structures import building_frame, frame_bridge

from skthermo.datasets import make_kw51, make_z24

BOUNDS = 0.3
SYMMETRIC = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}


def least_seconds(way, rounds=5):
    return min(timed(way)[0] for _ in range(rounds))


def full(model, n_rows):
    """Flops, bytes, seconds of the bare factorisation, of its solution for a vector, and of a solve."""
    stiffness, _ = model.matrices(np.ones(len(model.parameter_names)))
    stiffness = scipy.sparse.csc_matrix(stiffness)

    def factorise():
        return scipy.sparse.linalg.splu(stiffness, permc_spec="MMD_AT_PLUS_A", **SYMMETRIC)

    factors, vector = factorise(), np.ones(model.n_dof)
    counts, theta = np.diff(factors.L.tocsc().indptr).astype(float), draw(model, n_rows)
    found = [least_seconds(factorise), least_seconds(lambda: factors.solve(vector))]
    solve = least_seconds(lambda: model.frequencies(theta), 3) / n_rows
    return (counts**2).sum(), 2 * 8 * counts.sum() * model.n_modes, found, solve


def reduced(model, n_rows):
    """The same of a reduced model, whose matrices stay in the cache."""
    small = model.reduced(BOUNDS, random_state=0)
    n, n_terms, theta = small.basis_size_, len(small.parameter_names), draw(small, n_rows)
    root = np.random.default_rng(0).standard_normal((n, n))
    lapack = least_seconds(lambda: np.linalg.eigvalsh(root @ root.T))
    solve = least_seconds(lambda: small.frequencies(theta), 3) / n_rows
    return n_terms * n**2 + n**3 / 3, 0.0, [lapack], solve


def main():
    options = arguments(__doc__, rows=(10, "full solves of each model; 100 times as many reduced"))
    rate, bandwidth = core_rates()
    print(f"this core: {rate / 1e9:.1f} Gflop/s in matrix products, {bandwidth / 1e9:.1f} GB/s to and from memory\n")
    models = {"Z24": make_z24(track=False), "KW51": make_kw51()} | (
        {"building frame": building_frame()} if DATA else {}
    )
    for kind, way, n_rows in (("Full", full, options.rows), ("Reduced", reduced, 100 * options.rows)):
        rows = {}
        for name, model in (models | {"tied-arch bridge": frame_bridge()}).items():
            flops, n_bytes, bare, solve = way(model, n_rows)
            bound = max(flops / rate, n_bytes / bandwidth)
            rows[name] = {"degrees of freedom": model.n_dof, "Mflop": flops / 1e6, "MB": n_bytes / 1e6}
            rows[name] |= {"bound (ms)": 1e3 * bound, "a solve (ms)": 1e3 * solve, "solve / bound": solve / bound}
            rows[name]["SciPy or LAPACK (ms)"] = ", ".join(f"{1e3 * seconds:.3g}" for seconds in bare)
        shown(f"{kind} solves", pd.DataFrame(rows).T, "3g")


if __name__ == "__main__":
    main()
