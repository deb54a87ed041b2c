"""When does a reduced model save time, and does ``reduce="auto"`` know?

    OMP_NUM_THREADS=1 python tests/benchmarks/reduction_pays.py

Lines and grids of beams of 24 to 20,000 degrees of freedom with 2 to 20 parameters within 30 %. For each model: the
milliseconds of frequencies and derivatives by it and by its reduced model, the seconds of the basis and its size. For
each number of records, each of which costs three solves beside 1000 simulations: what "auto" takes, and how much longer
that is than the better of the two. Processor seconds of one core.
"""

import numpy as np
from harness import arguments, timed

from skthermo.fem import Beam, Structure, linearise

SECTION = {"E": 30e9, "G": 12e9, "A": 0.6, "I_yy": 0.05, "I_zz": 0.02, "J": 0.03, "density": 2500.0}
BOUNDS, SAMPLES, SOLVES_PER_ROW = 0.3, 1000, 3
ROWS = (365, 2000, 8760, 50_000)


def line(n_elements):
    """Nodes, members and supports of a straight beam clamped at both ends."""
    beams = {i: Beam(i, i + 1, **SECTION) for i in range(n_elements)}
    return {i: (float(i), 0.0, 0.0) for i in range(n_elements + 1)}, beams, (0, n_elements)


def grid(n):
    """Nodes, members and supports of a square grillage that is clamped at its corners."""
    nodes = {(i, j): (2.0 * i, 2.0 * j, 0.0) for i in range(n) for j in range(n)}
    beams = {("x", i, j): Beam((i, j), (i + 1, j), **SECTION) for i in range(n - 1) for j in range(n)}
    beams |= {("y", i, j): Beam((i, j), (i, j + 1), **SECTION) for i in range(n) for j in range(n - 1)}
    return nodes, beams, [(i, j) for i in (0, n - 1) for j in (0, n - 1)]


def model_of(nodes, beams, clamped, n_parameters):
    """The model whose parameters are the stiffnesses of as many groups of members."""
    groups = {f"zone {i}": list(part) for i, part in enumerate(np.array_split(np.arange(len(beams)), n_parameters))}
    names = list(beams)
    groups = {group: [names[i] for i in members] for group, members in groups.items()}
    structure = Structure(nodes, beams, dict.fromkeys(clamped, "xyz rx ry rz"), groups)
    return structure.assemble(list(groups), track=True)


def main():
    options = arguments(__doc__, most=(20_000, "largest number of degrees of freedom"))
    worst = 0.0
    shapes = [("line", line(n)) for n in (5, 8, 11, 17, 26, 34, 51, 101, 401)]
    shapes += [("grid", grid(n)) for n in (4, 6, 8, 16, 32, 58)]
    for kind, parts in shapes:
        for n_parameters in (2, 5, 10, 20):
            if len(parts[1]) < n_parameters or 6 * len(parts[0]) > options.most + 500:
                continue
            model = model_of(*parts, n_parameters)
            theta = 1 + 0.98 * BOUNDS * np.random.default_rng(0).uniform(-1, 1, (1000, n_parameters))
            n_full = 200 if model.n_dof < 200 else 16
            full = timed(lambda model=model, rows=theta[:n_full]: linearise(model, rows))[0] / n_full
            basis, reduced = timed(lambda model=model: model.reduced(BOUNDS, random_state=0))
            fast = timed(lambda reduced=reduced, theta=theta: linearise(reduced, theta))[0] / len(theta)
            lines = []
            for n_rows in ROWS:
                n_solves = SAMPLES + SOLVES_PER_ROW * n_rows
                ways = {False: n_solves * full, True: basis + n_solves * fast}
                choice = model.reduction_pays(n_solves)
                ratio = ways[choice] / min(ways.values())
                worst = max(worst, ratio)
                lines.append(f"{'reduced' if choice else 'full'} {ways[choice]:.3g} s (x {ratio:.2f})")
            print(
                f"{kind} {model.n_dof:5d} dof, {n_parameters:2d} parameters: {1e3 * full:.3g} and {1e3 * fast:.3g} ms, "
                f"{basis:.2f} s, {reduced.basis_size_} vectors: {', '.join(lines)}",
                flush=True,
            )
    print(f"at {ROWS} rows; worst: {worst:.2f} times the better of the two")


if __name__ == "__main__":
    main()
