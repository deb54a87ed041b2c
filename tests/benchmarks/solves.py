"""Solves beside others': the truss beside loops of SciPy's, a space frame beside PyNite, two workers beside one.

    OMP_NUM_THREADS=1 python tests/benchmarks/solves.py [--parts truss pynite workers]

- truss: batches of solves beside loops of ``scipy.linalg.eigh``.
- pynite: one solve of a space frame beside PyNiteFEA's modal analysis. PyNite takes the inertia of twist from the
  torsion constant, so ``I_p`` is that; its solve assembles the structure, as each new theta asks for.
- workers: a bridge of 3600 degrees of freedom by two processes of joblib's or Dask's beside one, by the clock. Of
  several rounds the fastest counts, as both cores have to be free.

The exit code is 1 if two workers are less than 1.6 times faster than one, or give other bits.
"""

import sys
import time
from itertools import product

import numpy as np
import pandas as pd
import scipy.linalg
from harness import arguments, median_seconds, peak_megabytes, shown, timed
from structures import frame_bridge

from skthermo.datasets import make_truss
from skthermo.fem import Beam, Structure, sample

BOUNDS = 0.3
LEAST_SPEED_UP = 1.6  # by two workers
COLUMN = {"E": 30e9, "G": 12e9, "A": 0.16, "I_yy": 0.0021, "I_zz": 0.0021, "J": 0.0036, "density": 2500.0}


def truss(options):
    model, n_samples = make_truss(), 500 if options.quick else 10_000
    theta = sample(model, 0.2, n_samples, random_state=0).theta
    terms, mass = model._core.stiffness, model.matrices(theta[0])[1].toarray()

    def loop(**kinds):
        for coefficients in terms.coefficients(theta):
            stiffness = sum(c * matrix for c, matrix in zip(coefficients, terms.matrices, strict=True))
            scipy.linalg.eigh(stiffness, mass, **kinds)

    ways = {
        "frequencies of all samples at once": lambda: model.frequencies(theta),
        "loop of eigh(K, M), modes too": loop,
        "loop of eigh, all eigenvalues alone": lambda: loop(eigvals_only=True),
        "loop of eigh, six eigenvalues alone": lambda: loop(eigvals_only=True, subset_by_index=[0, 5]),
    }
    seconds = pd.Series(median_seconds(ways, options.rounds, time.process_time))
    table = pd.DataFrame({"seconds": seconds, "times as long": seconds / seconds.iloc[0]})
    shown(f"{n_samples:,} solves of the truss of {model.n_dof} degrees of freedom, processor seconds", table, "3g")


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
        seconds = median_seconds(ways, options.rounds, time.process_time)
        each, frequencies = seconds["ours"] / len(theta), model.frequencies([[1.0, 1.0]])[0]
        rows[f"{model.n_dof:,}"] = {
            "skthermo, ms": 1e3 * each,
            "PyNiteFEA, ms": 1e3 * seconds["theirs"],
            "times as long": seconds["theirs"] / each,
            "largest difference of a frequency": np.abs(np.sort(other.frequencies) / frequencies - 1).max(),
        }
    table = pd.DataFrame(rows).T.rename_axis("degrees of freedom")
    shown("One solve of a building's frame for six modes, processor time", table, "3g")


def workers(options):
    import joblib
    from dask.distributed import Client

    model, n_all = frame_bridge(16, 3, 4), 60 if options.quick else 960

    def drawn(n_samples=n_all, n_jobs=None):
        return sample(model, BOUNDS, n_samples, n_jobs=n_jobs, random_state=0).frequencies

    def fastest(**how):
        return min((timed(lambda: drawn(**how), time.perf_counter) for _ in range(options.rounds)), key=lambda r: r[0])

    found = {"one process": fastest()}
    drawn(32, n_jobs=2)  # starts the processes
    found["two processes of joblib"] = fastest(n_jobs=2)
    with Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client, joblib.parallel_config("dask"):
        drawn(32)
        found["two workers of Dask"] = fastest()
        peak = max(client.run(peak_megabytes).values())
    (alone, frequencies), *_ = found.values()
    table = pd.DataFrame({"seconds": {name: seconds for name, (seconds, _) in found.items()}})
    table["times faster"] = alone / table["seconds"]
    table.loc["two workers of Dask", "peak memory of a worker, MB"] = peak
    title = f"{n_all} samples of a bridge of {model.n_dof:,} degrees of freedom, by the clock on two cores"
    shown(f"{title}, the fastest of {options.rounds} rounds", table, "3g")
    is_slow = (table["times faster"].iloc[1:] < LEAST_SPEED_UP).any()
    return is_slow or not all(np.array_equal(other, frequencies) for _, other in found.values())


PARTS = {"truss": truss, "pynite": pynite, "workers": workers}


def main():
    options = arguments(__doc__, parts=PARTS, rounds=5, quick=(False, "at a small size"))
    return int(sum(bool(PARTS[part](options)) for part in options.parts) > 0)


if __name__ == "__main__":
    sys.exit(main())
