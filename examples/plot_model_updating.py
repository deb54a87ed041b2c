"""
Model updating: identifiability, and estimates with error bars
==============================================================

A frame of three storeys on soft soil: the stiffness of its columns, beams and soil is up to 35 % off. Frequencies,
and mode shapes at eight accelerometers, are simulated with noise, so that the truth is known, and
:class:`~skthermo.updating.ModelUpdater` looks for it from thirty starts:

- :func:`~skthermo.updating.identifiability` says *before* anything is measured how accurate each parameter can become;
- the updater's error bars, from one set of measurements, give the same accuracy at the optimum;
- frequencies alone have many optima, and many parameters fit them: where modes swap places, a frequency is
  compared with another mode's. Mode shapes show which mode is which and where the structure is soft.

Run it with ``python examples/plot_model_updating.py``; figures go to the folder ``figures``.
"""

import argparse
import warnings
from itertools import pairwise
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skthermo.fem import Beam, Spring, Structure
from skthermo.updating import ModelUpdater, identifiability, sensitivity

CORNERS = {"sw": (0.0, 0.0), "se": (7.0, 0.0), "ne": (7.0, 5.0), "nw": (0.0, 5.0)}
HEIGHT, N_STOREYS, N_ELEMENTS = 3.5, 3, 4
COLUMN = {"E": 30e9, "G": 12e9, "A": 0.16, "I_yy": 2.1e-3, "I_zz": 2.1e-3, "J": 3.6e-3, "density": 2500.0}
BEAM = {**COLUMN, "A": 0.21, "I_yy": 6.3e-3, "I_zz": 1.6e-3, "J": 4.0e-3, "density": 14000.0}  # with the floors
SOIL = {"x": 1.2e8, "y": 1.2e8, "z": 5e8, "rx": 1.5e8, "ry": 1.5e8, "rz": 1e8}  # N/m, N m/rad
TRUTH = {
    "columns 1": 0.75, "columns 2": 1.15, "columns 3": 0.95,
    "beams 1": 1.3, "beams 2": 0.85, "beams 3": 1.1, "soil": 0.65,
}  # fmt: skip
N_MODES, BOUNDS = 9, 0.5
FREQUENCY_NOISE, SHAPE_NOISE = 0.002, 0.02
BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#999999"


def frame():
    """Columns and beams of three storeys on springs, each storey's columns and beams a group."""
    nodes, members, groups = {}, {}, {}

    def line(group, section, first, last):
        places = np.linspace(nodes[first], nodes[last], N_ELEMENTS + 1)
        names = [first, *((first, last, i) for i in range(1, N_ELEMENTS)), last]
        nodes.update(zip(names, map(tuple, places), strict=True))
        for one, other in pairwise(names):
            members[one, other] = Beam(one, other, **section)
            groups.setdefault(group, []).append((one, other))

    for level in range(N_STOREYS + 1):
        nodes.update({(level, corner): (*xy, HEIGHT * level) for corner, xy in CORNERS.items()})
    for level in range(1, N_STOREYS + 1):
        for corner, following in zip(CORNERS, [*list(CORNERS)[1:], "sw"], strict=True):
            line(f"columns {level}", COLUMN, (level - 1, corner), (level, corner))
            line(f"beams {level}", BEAM, (level, corner), (level, following))
    for corner in CORNERS:
        members.update({("soil", corner, d): Spring((0, corner), d, k) for d, k in SOIL.items()})
    groups["soil"] = [name for name in members if name[0] == "soil"]
    return Structure(nodes, members, {}, groups)


def accelerometers(structure):
    """Degrees of freedom of one corner of every floor and of the opposite one of the roof, along x and y."""
    nodes = [(1, "sw"), (2, "sw"), (3, "sw"), (3, "ne")]
    return [structure.dofs.index((node, direction)) for node in nodes for direction in "xy"]


def measure(model, dofs, seed=0):
    """Frequencies and shapes of the true frame, with noise."""
    random = np.random.default_rng(seed)
    frequencies, shapes = (values[0] for values in model.modes([list(TRUTH.values())]))
    at_dofs = shapes[dofs]
    level = SHAPE_NOISE * np.sqrt(np.mean(at_dofs**2, axis=0))
    noisy = frequencies * (1 + FREQUENCY_NOISE * random.standard_normal(N_MODES))
    return noisy, at_dofs + level * random.standard_normal(at_dofs.shape)


def update(structure, n_starts):
    """Updaters from sorted frequencies alone, and from frequencies and shapes."""
    model = structure.assemble(list(TRUTH), n_modes=N_MODES)
    dofs = accelerometers(structure)
    frequencies, shapes = measure(model, dofs)
    std = FREQUENCY_NOISE * frequencies
    shape_weight = np.sqrt(2 * (len(dofs) - 1)) / SHAPE_NOISE**2
    options = {"bounds": BOUNDS, "n_starts": n_starts, "n_jobs": 2, "random_state": 0}
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="modes .* (swap|other modes)")  # this is what the figure shows
        alone = ModelUpdater(model, **options).fit(np.sort(frequencies), frequency_std=std[np.argsort(frequencies)])
        both = ModelUpdater(model, shape_weight=shape_weight, **options)
        both.fit(frequencies, shapes=shapes, dofs=dofs, frequency_std=std)
    predicted = {
        "frequencies": identifiability(model, noise=FREQUENCY_NOISE),
        "frequencies and shapes": identifiability(model, noise=FREQUENCY_NOISE, dofs=dofs, shape_noise=SHAPE_NOISE),
    }
    return model, {"frequencies": alone, "frequencies and shapes": both}, predicted


def parameters_table(updaters, predicted):
    """Truth, estimates and relative standard deviations in percent, predicted and found."""
    columns = {("", "truth"): pd.Series(TRUTH)}
    for name, updater in updaters.items():
        estimate = pd.Series(updater.theta_, list(TRUTH))
        columns[name, "estimate"] = estimate
        columns[name, "predicted"] = 100 * predicted[name].deviations
        columns[name, "found"] = 100 * np.sqrt(np.diag(updater.covariance_)) / estimate
    return pd.DataFrame(columns)


def plot_parameters(updaters):
    """Estimates with their standard deviations beside the truth."""
    fig, ax = plt.subplots(figsize=(7.5, 4), layout="constrained")
    places = np.arange(len(TRUTH))
    for shift, colour, (name, updater) in zip((-0.12, 0.12), (ORANGE, BLUE), updaters.items(), strict=True):
        deviations = np.sqrt(np.diag(updater.covariance_))
        options = {
            "fmt": "o",
            "color": colour,
            "capsize": 4,
            "markersize": 5,
            "label": f"{name}, ± 1 standard deviation",
        }
        ax.errorbar(places + shift, updater.theta_, deviations, **options)
    ax.hlines([*TRUTH.values()], places - 0.32, places + 0.32, color="black", linewidth=2, label="truth")
    ax.axhline(1, color=GREY, linewidth=0.8, linestyle=":", label="nominal model")
    ax.set_xticks(places, list(TRUTH))
    ax.set_ylabel("multiplier of stiffness")
    ax.grid(axis="y", alpha=0.3)
    ax.legend(frameon=False, fontsize=9, ncols=2, loc="upper center", bbox_to_anchor=(0.5, 1.2))
    return fig


def plot_starts(updaters):
    """Final objective of every start, relative to the best."""
    fig, axes = plt.subplots(1, 2, figsize=(7.5, 3.4), layout="constrained")
    for ax, colour, (name, updater) in zip(axes, (ORANGE, BLUE), updaters.items(), strict=True):
        starts = updater.starts_.sort_values("objective", ignore_index=True)
        best = starts["optimum"] == 0
        number = np.arange(1, len(starts) + 1)
        ax.semilogy(
            number[best], starts["objective"][best], "o", color=colour, label=f"best optimum: {best.sum()} starts"
        )
        ax.semilogy(number[~best], starts["objective"][~best], "x", color=GREY, label=f"others: {(~best).sum()} starts")
        ax.set(title=name, xlabel="start, best first")
        ax.grid(axis="y", alpha=0.3)
        ax.legend(frameon=False, fontsize=9, loc="upper left")
    axes[0].set_ylabel("objective")
    return fig


def main():
    parser = argparse.ArgumentParser(description="Model updating of a frame whose parameters are known.")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figures")
    parser.add_argument("--starts", type=int, default=30)
    options = parser.parse_args()
    model, updaters, predicted = update(frame(), options.starts)
    print(f"{model}\n\nNormalised sensitivities, eq. (A.1):\n{sensitivity(model).T.round(3)}\n")
    for name, updater in updaters.items():
        best = (updater.starts_["optimum"] == 0).sum()
        print(f"Modes by {name}, in Hz; {best} of {options.starts} starts found the best optimum:")
        print(updater.table_.round(3).to_string(), end="\n\n")
    print("Parameters, and standard deviations in % as predicted for the nominal model and as found:")
    print(parameters_table(updaters, predicted).round(2).to_string())

    options.figures.mkdir(parents=True, exist_ok=True)
    for name, fig in (("parameters", plot_parameters(updaters)), ("starts", plot_starts(updaters))):
        path = options.figures / f"model_updating_{name}.png"
        fig.savefig(path, dpi=130)
        print(f"Figure: {path}")


if __name__ == "__main__":
    main()
