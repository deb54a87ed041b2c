"""How cost grows with samples, degrees of freedom and parameters: tables, and the guide's figure.

    OMP_NUM_THREADS=1 python tests/benchmarks/scaling.py --figure docs/images/scaling.png

Tied-arch bridges of all sizes, and the 28-bar truss, with bounds of 30 %, in processor seconds of one core.
"""

import time
from pathlib import Path

import numpy as np
import pandas as pd
from harness import arguments, median_seconds, shown
from structures import frame_bridge

from skthermo.datasets import make_truss
from skthermo.fem import sample

BOUNDS = 0.3
WITHIN = f"within {100 * BOUNDS:.0f} %"
SIZES = [(4, 1, 1), (6, 2, 1), (10, 2, 3), (16, 3, 4), (24, 4, 5), (40, 4, 9), (48, 5, 9)]
ZONES = (1, 4, 8, 16)
BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"


def seconds_of(way, rounds):
    return median_seconds({"way": way}, rounds, time.process_time)["way"]


def by_samples(most, most_full, bridge, rounds):
    """Seconds of n samples: {name: [(n, seconds), ...]}, the basis included; the largest n is solved once."""
    model = frame_bridge(*bridge)
    basis = seconds_of(lambda: model.reduced(BOUNDS, random_state=0), rounds)
    reduced = model.reduced(BOUNDS, random_state=0)
    runs = (
        (f"truss, {make_truss().n_dof} DOF", make_truss(), most, 0.0),
        (f"bridge, {model.n_dof:,} DOF, reduced", reduced, most, basis),
        (f"bridge, {model.n_dof:,} DOF", model, most_full, 0.0),
    )
    table = {}
    for name, solver, limit, before in runs:
        counts = [10**k for k in range(1, 7) if 10**k <= limit]
        ways = {n: lambda n=n, solver=solver: sample(solver, BOUNDS, n, random_state=0) for n in counts}
        seconds = {n: seconds_of(way, rounds if n < limit else 1) for n, way in ways.items()}
        table[name] = [(n, before + passed) for n, passed in seconds.items()]
    return table


def costs_of(model, rounds, n_samples):
    """Milliseconds of a solve, without and with derivatives, and reduced; seconds of the basis and its size."""
    theta = 1 + 0.99 * BOUNDS * np.random.default_rng(0).uniform(-1, 1, (n_samples, len(model.parameter_names)))
    reduced = model.reduced(BOUNDS, random_state=0)
    ways = {
        "full": lambda: model.frequencies(theta),
        "derivatives": lambda: model.linearised(theta),
        "reduced": lambda: reduced.frequencies(np.tile(theta, (20, 1))),
        "basis": lambda: model.reduced(BOUNDS, random_state=0),
    }
    seconds = median_seconds(ways, rounds, time.process_time)
    return {
        "degrees of freedom": model.n_dof,
        "parameters": len(model.parameter_names),
        "full (ms)": 1e3 * seconds["full"] / n_samples,
        "with derivatives (ms)": 1e3 * seconds["derivatives"] / n_samples,
        "reduced (ms)": 1e3 * seconds["reduced"] / (20 * n_samples),
        "basis (s)": seconds["basis"],
        "basis vectors": reduced.basis_size_,
    }


def plot(samples, sizes, zones):
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, 3, figsize=(12, 3.8), layout="constrained")
    for (name, points), marker, colour in zip(samples.items(), "os^", (BLUE, GREEN, ORANGE), strict=True):
        axes[0].loglog(*zip(*points, strict=True), marker=marker, color=colour, label=name)
    axes[0].set(xlabel="samples (log scale)", ylabel="seconds, basis included (log scale)")
    for ax, rows, x in ((axes[1], sizes, "degrees of freedom"), (axes[2], zones, "parameters")):
        for column, marker, colour in (
            ("full (ms)", "^", ORANGE),
            ("with derivatives (ms)", "v", BLUE),
            ("reduced (ms)", "s", GREEN),
        ):
            ax.loglog([r[x] for r in rows], [r[column] for r in rows], marker=marker, color=colour, label=column[:-5])
        ax.set(xlabel=f"{x} (log scale)", ylabel="milliseconds a solve of 6 modes (log scale)")
    axes[2].set(xscale="linear", xlabel="parameters")
    axes[2].set_title(f"{zones[0]['degrees of freedom']} degrees of freedom", fontsize="medium")
    for ax in axes:
        ax.legend(fontsize="small")
        ax.grid(alpha=0.3)
    return fig


def main():
    options = arguments(
        __doc__,
        most_samples=1_000_000,
        most_full=(1000, "samples of the bridge that is not reduced"),
        sizes=(len(SIZES), "how many sizes of the bridge"),
        rounds=3,
        figure=(Path, "where the figure goes"),
    )
    sizes = SIZES[: options.sizes]

    samples = by_samples(options.most_samples, options.most_full, sizes[-2], options.rounds)
    table = pd.DataFrame({name: {f"{n:,} samples": s for n, s in points} for name, points in samples.items()}).T
    shown(f"Processor seconds of samples {WITHIN}, making the reduced model included", table, "3g")
    by_size = [costs_of(frame_bridge(*size), options.rounds, n_samples=20) for size in sizes]
    by_dof = pd.DataFrame(by_size).set_index("degrees of freedom").drop(columns="parameters")
    shown(f"A solve by degrees of freedom, bridges of 5 parameters {WITHIN}", by_dof, "3g")
    middle = sizes[len(sizes) // 2]
    by_parameters = [costs_of(frame_bridge(*middle, n_zones=n), options.rounds, 20) for n in ZONES if n <= middle[0]]
    by_number = pd.DataFrame(by_parameters).set_index("parameters").drop(columns="degrees of freedom")
    n_dof = by_parameters[0]["degrees of freedom"]
    shown(f"A solve by parameters {WITHIN}, a bridge of {n_dof:,} degrees of freedom", by_number, "3g")
    if options.figure:
        options.figure.parent.mkdir(parents=True, exist_ok=True)
        plot(samples, by_size, by_parameters).savefig(options.figure, dpi=110)
        print(f"Figure: {options.figure}")


if __name__ == "__main__":
    main()
