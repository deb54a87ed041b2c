"""Time and memory of exported models of 50,000 to 300,000 degrees of freedom, from the files to a fitted chain.

    OMP_NUM_THREADS=1 python tests/benchmarks/large_models.py
    OMP_NUM_THREADS=1 python tests/benchmarks/large_models.py --models grid-3000 solid-3000

A slab bridge as a grillage of beams (two-dimensional, 6 degrees of freedom a node) or as a lattice of solid elements
(three-dimensional, 3 a node), with 5 parameters: three thirds of the deck, its pavement or cross beams, and its
bearings. The matrices are written as a folder of .npz files, as an FE program would, and read by `load_affine`. Each
model is solved by SuperLU and, where it is installed, by rslab, in processes of their own. A chain is fitted to the
models that ``--chains`` names.
"""

import importlib.util
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.sparse
from harness import arguments, peak_megabytes, shown, timed

from skthermo.fem import linearise, load_affine
from skthermo.surrogate import DataInformedFEM, PosteriorInverse

SPAN, WIDTH, DEPTH = 48.0, 12.0, 1.2
E, POISSON, DENSITY, BEARING = 35e9, 0.2, 2500.0, 5e9
BOUNDS = 0.2


def assembled(matrices, places, n_dof):
    """The sum of element matrices, one for all or one for each, at rows of places."""
    size = places.shape[1]
    rows, columns = np.repeat(places, size, axis=1), np.tile(places, size)
    data = np.broadcast_to(np.reshape(matrices, (-1, size * size)), rows.shape)
    return scipy.sparse.coo_array((data.ravel(), (rows.ravel(), columns.ravel())), shape=(n_dof, n_dof)).tocsc()


def brick(edges):
    """Stiffness for a unit modulus and mass for a unit density of an 8-node brick, by 2 x 2 x 2 Gauss points."""
    corners = np.array([(i, j, k) for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    shear = (1 - 2 * POISSON) / 2
    law = np.diag([1 - 2 * POISSON] * 3 + [shear] * 3)
    law[:3, :3] += POISSON
    law /= (1 + POISSON) * (1 - 2 * POISSON)
    stiffness, mass, volume = np.zeros((24, 24)), np.zeros((24, 24)), np.prod(edges)
    for point in corners / np.sqrt(3):
        factors = 1 + corners * point
        shapes = factors.prod(axis=1) / 8
        slopes = np.stack([corners[:, d] * factors[:, np.arange(3) != d].prod(axis=1) / 8 for d in range(3)])
        dx, dy, dz = slopes * 2 / np.reshape(edges, (3, 1))
        strain = np.zeros((6, 24))
        strain[0, 0::3], strain[1, 1::3], strain[2, 2::3] = dx, dy, dz
        strain[3, 0::3], strain[3, 1::3] = dy, dx
        strain[4, 1::3], strain[4, 2::3] = dz, dy
        strain[5, 0::3], strain[5, 2::3] = dz, dx
        stiffness += strain.T @ law @ strain * volume / 8
        mass += np.kron(np.outer(shapes, shapes), np.eye(3)) * volume / 8
    return stiffness, mass


def beam(length, direction):
    """Stiffness of a square beam between two nodes of 6 degrees of freedom, along x (0) or y (1)."""
    area, inertia, torsion, shear = DEPTH**2, DEPTH**4 / 12, 0.14 * DEPTH**4, E / (2 * (1 + POISSON))
    local = np.zeros((12, 12))
    for i, k in ((0, E * area), (3, shear * torsion)):
        local[np.ix_([i, i + 6], [i, i + 6])] = k / length * np.array([[1, -1], [-1, 1]])
    for i, j, sign in ((1, 5, 1), (2, 4, -1)):
        a = sign * length
        bending = [[12, 6 * a, -12, 6 * a], [6 * a, 4 * a * a, -6 * a, 2 * a * a]]
        bending += [[-12, -6 * a, 12, -6 * a], [6 * a, 2 * a * a, -6 * a, 4 * a * a]]
        places = [i, j, i + 6, j + 6]
        local[np.ix_(places, places)] = E * inertia / length**3 * np.array(bending)
    turn = np.kron(np.eye(4), np.eye(3) if direction == 0 else np.array([[0, 1, 0], [-1, 0, 0], [0, 0, 1]]))
    return turn.T @ local @ turn


def bearings(places, n_dof):
    data = np.bincount(places, minlength=n_dof) * BEARING / max(len(places) / 6, 1)
    return scipy.sparse.diags_array(data).tocsc()


def solid(n_dof):
    """A slab of brick elements: terms and mass."""
    n = max(2, round((n_dof / 3 / 32) ** (1 / 3)))
    shape = np.array([16 * n, 4 * n, n // 2 + 1])
    edges = np.array([SPAN, WIDTH, DEPTH]) / shape
    numbers = np.arange(np.prod(shape + 1)).reshape(shape + 1)
    corners = [
        numbers[i : i + shape[0], j : j + shape[1], k : k + shape[2]].ravel()
        for i in (0, 1)
        for j in (0, 1)
        for k in (0, 1)
    ]
    places = (3 * np.stack(corners, axis=1)[:, :, np.newaxis] + np.arange(3)).reshape(-1, 24)
    stiffness, mass = brick(edges)
    x, _, z = np.unravel_index(np.arange(len(places)), shape)
    zones = np.where(z == shape[2] - 1, 3, x * 3 // shape[0])
    size = 3 * numbers.size
    held = (3 * numbers[[0, -1], :, 0].reshape(-1, 1) + np.arange(3)).ravel()
    names = ("E_west", "E_middle", "E_east", "E_pavement")
    terms = {name: assembled(E * stiffness, places[zones == zone], size) for zone, name in enumerate(names)}
    return terms | {"bearings": bearings(held, size)}, assembled(DENSITY * mass, places, size)


def grid(n_dof):
    """A grillage of beams: terms and lumped mass."""
    n = max(2, round(np.sqrt(n_dof / 6) / 2))
    shape = np.array([4 * n, n])
    numbers = np.arange(shape.prod()).reshape(shape)
    steps = np.array([SPAN, WIDTH]) / (shape - 1)
    size = 6 * numbers.size
    along = [np.stack([numbers[:-1].ravel(), numbers[1:].ravel()], axis=1), 0]
    across = [np.stack([numbers[:, :-1].ravel(), numbers[:, 1:].ravel()], axis=1), 1]
    places = [(6 * ends[:, :, np.newaxis] + np.arange(6)).reshape(-1, 12) for ends, _ in (along, across)]
    zones = along[0][:, 0] // shape[1] * 3 // (shape[0] - 1)
    first = beam(steps[0], 0) / shape[1]
    names = ("E_west", "E_middle", "E_east")
    terms = {name: assembled(first, places[0][zones == zone], size) for zone, name in enumerate(names)}
    terms["E_cross"] = assembled(beam(steps[1], 1) / shape[0], places[1], size)
    held = (6 * numbers[[0, -1]].reshape(-1, 1) + np.arange(3)).ravel()
    each = DENSITY * SPAN * WIDTH * DEPTH / numbers.size
    mass = scipy.sparse.diags_array(np.tile([each] * 3 + [0.0] * 3, numbers.size)).tocsc()
    return terms | {"bearings": bearings(held, size)}, mass


KINDS = {"grid": grid, "solid": solid}
SOLVERS = {"superlu": "SuperLU", "rslab": "rslab"}


def write(folder, terms, mass):
    for name, matrix in (terms | {"M0": mass}).items():
        scipy.sparse.save_npz(Path(folder) / f"{name}.npz", scipy.sparse.csc_matrix(matrix), compressed=False)


def records(model, n_days):
    """A year of temperatures and frequencies: the deck loses 0.4 % of its stiffness a degree, effects multiply."""
    random, nominal = np.random.default_rng(0), np.ones((1, 5))
    days = pd.date_range("2021-01-01", periods=n_days, freq="D")
    season = 10 - 12 * np.cos(2 * np.pi * np.arange(n_days) / 365)
    T = pd.DataFrame({"air": season + random.normal(0, 3, n_days)}, index=days)
    theta = np.clip(1 - 0.004 * (T.to_numpy() - 10) * np.array([1.0, 1.0, 1.0, 1.2, 0.3]), 0.82, 1.18)
    first, slopes = linearise(model, nominal, relative=True)
    frequencies = first * np.exp(np.log(theta) @ slopes[0].T)
    return T, frequencies * (1 + 0.001 * random.standard_normal(frequencies.shape))


def one(kind, n_dof, n_days):
    """Steps of one model by one solver: their processor seconds, and the peak memory."""
    found = {}

    def step(name, way):
        found[f"{name}, s"], result = timed(way)
        return result

    with tempfile.TemporaryDirectory() as folder:
        terms, mass = KINDS[kind](n_dof)
        write(folder, terms, mass)
        found["degrees of freedom"] = mass.shape[0]
        found["million entries of the stiffness"] = sum(matrix.nnz for matrix in terms.values()) / 1e6
        del terms, mass
        model = step("reading with all checks", lambda: load_affine(folder))
    theta = 1 + BOUNDS * np.random.default_rng(1).uniform(-1, 1, (2, 5))
    model.frequencies(theta[:1])  # orders the elimination
    step("frequencies at one theta", lambda: model.frequencies(theta[1:]))
    step("frequencies with derivatives", lambda: model.linearised(theta[1:]))
    found["peak memory so far, MB"] = peak_megabytes()
    if n_days:
        T, F = records(model, n_days)
        chain = DataInformedFEM(model, inverse=PosteriorInverse(noise=0.001), reduce=True, random_state=0)
        step(f"fit of a chain to {n_days} records", lambda: chain.fit(T, F))
        step("its predictions", lambda: chain.predict(T))
        found["peak memory with a chain, MB"] = peak_megabytes()
    print(json.dumps(found))


def main():
    options = arguments(
        __doc__,
        models=["grid-100000", "grid-300000", "solid-50000"],
        chains=(["grid-100000"], "models to which a chain is fitted"),
        days=(365, "records of the chain"),
        one=(False, "in this process, for the script itself"),
    )
    if options.one:
        kind, n_dof = options.models[0].split("-")
        one(kind, int(n_dof), options.days)
        return
    table = {}
    for model in options.models:
        for solver in ["superlu", *["rslab"][: importlib.util.find_spec("rslab") is not None]]:
            n_days = options.days if model in options.chains else 0
            command = [sys.executable, __file__, "--one", "--models", model, "--days", str(n_days)]
            environment = os.environ | {"SKTHERMO_SOLVER": solver}
            done = subprocess.run(command, env=environment, check=True, stdout=subprocess.PIPE, text=True)
            found = json.loads(done.stdout.splitlines()[-1])
            name = {"grid": "grillage", "solid": "solid"}[model.split("-")[0]]
            title = f"{name} of {found.pop('degrees of freedom'):,}, {SOLVERS[solver]}"
            table[title] = found
            print(title, found, flush=True)
    shown("Slab bridges by degrees of freedom and solver, processor seconds of one core", pd.DataFrame(table), "3g")


if __name__ == "__main__":
    main()
