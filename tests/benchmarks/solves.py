"""Solves beside others' and beside bounds: the truss, a frame by PyNite, two workers, reduced models, lower bounds.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/solves.py [--parts truss pynite workers pays bounds]

- truss: batches of solves over a loop of ``scipy.linalg.eigh``.
- pynite: one solve of a space frame over PyNiteFEA's modal analysis. PyNite takes the inertia of twist from the torsion
  constant, so ``I_p`` is that; its solve assembles the structure, as each new theta asks for.
- workers: a bridge of 3600 degrees of freedom by two processes of joblib's or Dask's over one, on an idle machine.
- pays: whether ``reduce="auto"`` knows when a reduced model saves time, for lines and grids of beams with 2 to 20
  parameters. Each record costs three solves beside 1000 simulations.
- bounds: a solve beside the larger of the arithmetic and the traffic to memory of one factorisation, c^2 flops for each
  column of c entries, both factors read once for each mode; a reduced model adds up its terms and factorises once, in
  the cache. Beside it SciPy's factorisation and its solution for one vector, or LAPACK's eigenvalues of that size.

The exit code is 1 if two workers are less than 1.6 times faster than one, or give other bits.
"""

import sys
import time
from itertools import product

import numpy as np
import pandas as pd
import scipy.linalg
import scipy.sparse.linalg
from harness import DATA, arguments, core_rates, draw, is_missed, median_seconds, peak_megabytes, shown, timed
from structures import building_frame, frame_bridge
from threadpoolctl import threadpool_limits

from skthermo.datasets import make_kw51, make_truss, make_z24
from skthermo.fem import Beam, Structure, linearise, sample

BOUNDS = 0.3
COLUMN = {"E": 30e9, "G": 12e9, "A": 0.16, "I_yy": 0.0021, "I_zz": 0.0021, "J": 0.0036, "density": 2500.0}
SECTION = {"E": 30e9, "G": 12e9, "A": 0.6, "I_yy": 0.05, "I_zz": 0.02, "J": 0.03, "density": 2500.0}


def truss(options):
    model, n_samples = make_truss(), 500 if options.quick else 10_000
    theta = sample(model, 0.2, n_samples, random_state=0).theta
    terms, mass = model._core.stiffness, model.matrices(theta[0])[1].toarray()

    def loop(**kinds):
        for coefficients in terms.coefficients(theta):
            stiffness = sum(c * matrix for c, matrix in zip(coefficients, terms.matrices, strict=True))
            scipy.linalg.eigh(stiffness, mass, **kinds)

    ways = {
        "batch, one thread": lambda: model.frequencies(theta),
        "sample, n_jobs=2": lambda: sample(model, 0.2, n_samples, n_jobs=2, random_state=0),
        "loop, eigh(K, M)": loop,
        "loop, eigenvalues alone": lambda: loop(eigvals_only=True),
        "loop, six eigenvalues": lambda: loop(eigvals_only=True, subset_by_index=[0, 5]),
    }
    with threadpool_limits(1):
        seconds = pd.Series(median_seconds(ways, options.rounds))
    shown(
        f"{n_samples} solves of the truss", pd.DataFrame({"s": seconds, "over batch": seconds / seconds.iloc[0]}), "3g"
    )


def pynite(options):
    from Pynite import FEModel3D

    theta, rows = np.random.default_rng(0).uniform(0.7, 1.3, (20, 2)), {}
    solve = {"num_modes": 6, "mass_combo_name": "mass", "gravity": 1.0}
    for n_storeys in (3,) if options.quick else (3, 10, 30):
        nodes = {
            node: (6.0 * node[0], 5.0 * node[1], 3.5 * node[2]) for node in product(*map(range, (3, 3, n_storeys + 1)))
        }
        members = {
            (name, node): (node, end)
            for node in nodes
            for axis, name in enumerate(("x", "y", "column"))
            if (end := tuple(np.add(node, np.eye(3, dtype=int)[axis]).tolist())) in nodes and (axis == 2 or node[2] > 0)
        }
        feet = [node for node in nodes if node[2] == 0]
        beams = {name: Beam(*ends, **COLUMN, I_p=COLUMN["J"]) for name, ends in members.items()}
        groups = {
            "columns": [m for m in members if m[0] == "column"],
            "beams": [m for m in members if m[0] != "column"],
        }
        model = Structure(nodes, beams, dict.fromkeys(feet, "xyz rx ry rz"), groups).assemble(list(groups))
        other = FEModel3D()
        other.add_material("concrete", E=COLUMN["E"], G=COLUMN["G"], nu=0.25, rho=COLUMN["density"])
        other.add_section("square", COLUMN["A"], COLUMN["I_yy"], COLUMN["I_zz"], COLUMN["J"])
        for node, place in nodes.items():
            other.add_node(str(node), *place)
        for name, ends in members.items():
            other.add_member(str(name), *map(str, ends), "concrete", "square")
        for foot in feet:
            other.def_support(str(foot), *[True] * 6)
        other.add_member_self_weight("FZ", -1.0, "weight")
        other.add_load_combo("mass", {"weight": 1.0})
        ways = {"ours": lambda m=model: m.frequencies(theta), "theirs": lambda m=other: m.analyze_modal(**solve)}
        seconds = median_seconds(ways, options.rounds)
        each, difference = (
            seconds["ours"] / len(theta),
            np.sort(other.frequencies) / model.frequencies([[1.0, 1.0]])[0] - 1,
        )
        rows[model.n_dof] = {"skthermo, ms": 1e3 * each, "PyNiteFEA, ms": 1e3 * seconds["theirs"]}
        rows[model.n_dof] |= {"ratio": seconds["theirs"] / each, "difference": np.abs(difference).max()}
    shown("A solve by degrees of freedom", pd.DataFrame(rows).T, "3g")


def workers(options):
    import joblib
    from dask.distributed import Client

    model, n_all = frame_bridge(16, 3, 4), 60 if options.quick else 960

    def drawn(n_samples=n_all, n_jobs=None):
        return sample(model, BOUNDS, n_samples, n_jobs=n_jobs, random_state=0).frequencies

    alone, frequencies = timed(drawn, time.perf_counter)
    drawn(32, n_jobs=2)  # starts the processes
    results = {"joblib's processes": timed(lambda: drawn(n_jobs=2), time.perf_counter)}
    with Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client, joblib.parallel_config("dask"):
        drawn(32)
        results["Dask's workers"] = timed(drawn, time.perf_counter)
        peaks = client.run(peak_megabytes).values()
    print(f"{model}, {n_all} samples: {alone:.1f} s in one process; Dask's workers: {max(peaks):.0f} MB")
    slow = [is_missed(f"two of {name}, times faster", alone / s, ">= 1.6") for name, (s, _) in results.items()]
    return any(slow) or not all(np.array_equal(found, frequencies) for _, found in results.values())


def line(n):
    """Nodes, members and supports of a straight beam clamped at both ends."""
    beams = {i: Beam(i, i + 1, **SECTION) for i in range(n)}
    return {i: (float(i), 0.0, 0.0) for i in range(n + 1)}, beams, (0, n)


def grid(n):
    """The same of a square grillage that is clamped at its corners."""
    nodes = {(i, j): (2.0 * i, 2.0 * j, 0.0) for i in range(n) for j in range(n)}
    beams = {("x", i, j): Beam((i, j), (i + 1, j), **SECTION) for i in range(n - 1) for j in range(n)}
    beams |= {("y", i, j): Beam((i, j), (i, j + 1), **SECTION) for i in range(n) for j in range(n - 1)}
    return nodes, beams, [(i, j) for i in (0, n - 1) for j in (0, n - 1)]


def pays(options):
    shapes = [line(n) for n in (5, 8, 11, 17, 26, 34, 51, 101, 401)] + [grid(n) for n in (4, 6, 8, 16, 32, 58)]
    rows = {}
    for (nodes, beams, clamped), n_parameters in product(shapes[:4] if options.quick else shapes, (2, 5, 10, 20)):
        if len(beams) < n_parameters:
            continue
        zones = np.array_split(np.arange(len(beams)), n_parameters)
        groups = {f"zone {i}": [list(beams)[k] for k in members] for i, members in enumerate(zones)}
        structure = Structure(nodes, beams, dict.fromkeys(clamped, "xyz rx ry rz"), groups)
        model = structure.assemble(list(groups), track=True)
        theta, n_full = draw(model, 1000, bounds=0.98 * BOUNDS), 200 if model.n_dof < 200 else 16
        full = timed(lambda m=model, t=theta[:n_full]: linearise(m, t))[0] / n_full
        basis, reduced = timed(lambda m=model: m.reduced(BOUNDS, random_state=0))
        fast = timed(lambda m=reduced, t=theta: linearise(m, t))[0] / len(theta)
        row = {"full, ms": 1e3 * full, "reduced, ms": 1e3 * fast, "basis, s": basis, "vectors": reduced.basis_size_}
        for n_rows in (365, 2000, 8760, 50_000):
            n_solves = 1000 + 3 * n_rows
            seconds = {False: n_solves * full, True: basis + n_solves * fast}
            choice = model.reduction_pays(n_solves)
            row[f"{n_rows} records"] = (
                f"{'reduced' if choice else 'full'} x {seconds[choice] / min(seconds.values()):.2f}"
            )
        rows[model.n_dof, n_parameters] = row
    table = pd.DataFrame(rows).T.rename_axis(["degrees of freedom", "parameters"])
    shown('What "auto" takes, times as long as the better of the two', table, "3g")


def least_seconds(way, rounds=5):
    return min(timed(way)[0] for _ in range(rounds))


def of_full(model, n_rows):
    """Flops, bytes, seconds of the bare factorisation and of its solution for a vector, and of a solve."""
    stiffness = scipy.sparse.csc_matrix(model.matrices(np.ones(len(model.parameter_names)))[0])
    symmetric = {"diag_pivot_thresh": 0.0, "options": {"SymmetricMode": True}}

    def factorise():
        return scipy.sparse.linalg.splu(stiffness, permc_spec="MMD_AT_PLUS_A", **symmetric)

    factors, vector = factorise(), np.ones(model.n_dof)
    counts, theta = np.diff(factors.L.tocsc().indptr).astype(float), draw(model, n_rows)
    found = [least_seconds(factorise), least_seconds(lambda: factors.solve(vector))]
    solve = least_seconds(lambda: model.frequencies(theta), 3) / n_rows
    return (counts**2).sum(), 2 * 8 * counts.sum() * model.n_modes, found, solve


def of_reduced(model, n_rows):
    """The same of a reduced model."""
    small = model.reduced(BOUNDS, random_state=0)
    n, n_terms, theta = small.basis_size_, len(small.parameter_names), draw(small, n_rows)
    root = np.random.default_rng(0).standard_normal((n, n))
    lapack = least_seconds(lambda: np.linalg.eigvalsh(root @ root.T))
    return n_terms * n**2 + n**3 / 3, 0.0, [lapack], least_seconds(lambda: small.frequencies(theta), 3) / n_rows


def bounds(options):
    rate, bandwidth = core_rates()
    print(f"this core: {rate / 1e9:.1f} Gflop/s in matrix products, {bandwidth / 1e9:.1f} GB/s to and from memory")
    models = {"Z24": make_z24(track=False), "KW51": make_kw51()} | ({"frame": building_frame()} if DATA else {})
    models |= {"tied-arch bridge": frame_bridge(*((6, 2, 1) if options.quick else ()))}
    for kind, way, n_rows in (("Full", of_full, 10), ("Reduced", of_reduced, 1000)):
        rows = {}
        for name, model in models.items():
            flops, n_bytes, bare, solve = way(model, n_rows)
            bound = max(flops / rate, n_bytes / bandwidth)
            rows[name] = {"degrees of freedom": model.n_dof, "Mflop": flops / 1e6, "MB": n_bytes / 1e6}
            rows[name] |= {"bound (ms)": 1e3 * bound, "a solve (ms)": 1e3 * solve, "solve / bound": solve / bound}
            rows[name]["SciPy or LAPACK (ms)"] = ", ".join(f"{1e3 * seconds:.3g}" for seconds in bare)
        shown(f"{kind} solves", pd.DataFrame(rows).T, "3g")


PARTS = {"truss": truss, "pynite": pynite, "workers": workers, "pays": pays, "bounds": bounds}


def main():
    options = arguments(__doc__, parts=PARTS, rounds=5, quick=(False, "at a small size"))
    return int(sum(bool(PARTS[part](options)) for part in options.parts) > 0)


if __name__ == "__main__":
    sys.exit(main())
