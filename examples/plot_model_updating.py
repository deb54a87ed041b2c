"""
Model updating, with error bars
===============================

A frame of three storeys on soft soil: the stiffness of its columns, beams and soil is up to 35 % off. Frequencies, and
mode shapes at eight accelerometers, are simulated with noise, so that the truth is known, and
:class:`~skthermo.updating.ModelUpdater` looks for it from thirty starts:

- :func:`~skthermo.updating.identifiability` says *before* anything is measured how accurate each parameter can become;
- the updater's error bars, from one set of measurements, give the same accuracy at the optimum;
- :meth:`~skthermo.updating.ModelUpdater.sample_models` gives the models that the measurements leave possible;
- frequencies alone have many optima, and many parameters fit them: where modes swap places, a frequency is compared
  with another mode's. Mode shapes show which mode is which and where the structure is soft.

Run it with ``python examples/plot_model_updating.py`` (``--starts`` for another number of starts). It needs
:download:`frame_recipes.py` (the frame) and :download:`page_recipes.py` beside it. The guide is :doc:`/guide/updating`.
"""

# sphinx_gallery_thumbnail_number = 3

import warnings

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from frame_recipes import frame
from page_recipes import command_line, save_figures

from skthermo.plotting import StructureDisplay
from skthermo.updating import ModelUpdater, identifiability, sensitivity

parser = command_line()
parser.add_argument("--starts", type=int, default=30, help="of each search (default 30)")
options = parser.parse_args()

# %%
# The frame
# ---------
# Each storey's columns and beams are a group, and so are the springs of the soil. The multipliers of these seven groups
# are sought; the true ones are known here. The four lowest modes of the nominal model:

TRUTH = {
    "columns 1": 0.75, "columns 2": 1.15, "columns 3": 0.95,
    "beams 1": 1.3, "beams 2": 0.85, "beams 3": 1.1, "soil": 0.65,
}  # fmt: skip
N_MODES = 9
structure = frame()
model = structure.assemble(list(TRUTH), n_modes=N_MODES)
print(model)
StructureDisplay.from_structure(structure, model=model, modes=range(4))

# %%
# Which parameters move which modes?
# ----------------------------------
# The normalised sensitivities, eq. (A.1) of the paper: by how many percent a frequency changes where a parameter
# changes by one percent. The soil moves the three lowest modes most, and hardly any mode depends on it alone.

print(sensitivity(model).T.round(3))

# %%
# What can be known before anything is measured
# ---------------------------------------------
# Frequencies will scatter by 0.2 %, and shapes by 2 %. The accelerometers are at one corner of every floor and at the
# opposite one of the roof, along x and y. Their degrees of freedom and the noise are all that the forecast needs.

FREQUENCY_NOISE, SHAPE_NOISE = 0.002, 0.02
nodes = [(1, "sw"), (2, "sw"), (3, "sw"), (3, "ne")]
dofs = [structure.dofs.index((node, direction)) for node in nodes for direction in "xy"]
predicted = {
    "frequencies": identifiability(model, noise=FREQUENCY_NOISE),
    "frequencies and shapes": identifiability(model, noise=FREQUENCY_NOISE, dofs=dofs, shape_noise=SHAPE_NOISE),
}
print("Standard deviations of the parameters, %")
print(pd.DataFrame({name: 100 * known.deviations for name, known in predicted.items()}).round(2))

# %%
# Measure the true frame
# ----------------------

random = np.random.default_rng(0)
frequencies, shapes = (values[0] for values in model.modes([list(TRUTH.values())]))
frequencies = frequencies * (1 + FREQUENCY_NOISE * random.standard_normal(N_MODES))
level = SHAPE_NOISE * np.sqrt(np.mean(shapes[dofs] ** 2, axis=0))
shapes = shapes[dofs] + level * random.standard_normal((len(dofs), N_MODES))

# %%
# Update: from frequencies alone, and with shapes
# -----------------------------------------------
# Without shapes nobody knows which mode is which: the frequencies are sorted. The weight of the shapes follows from
# their noise. The updater warns that modes of the first fit have swapped places; this is silenced here, because the
# table shows it.

std = FREQUENCY_NOISE * frequencies
settings = {"bounds": 0.5, "n_starts": options.starts, "n_jobs": 2, "random_state": 0}
alone = ModelUpdater(model, **settings)
both = ModelUpdater(model, shape_weight=np.sqrt(2 * (len(dofs) - 1)) / SHAPE_NOISE**2, **settings)
with warnings.catch_warnings():
    warnings.filterwarnings("ignore", message=".*mode-order")
    alone.fit(np.sort(frequencies), frequency_std=std[np.argsort(frequencies)])
    both.fit(frequencies, shapes=shapes, dofs=dofs, frequency_std=std)
updaters = {"frequencies": alone, "frequencies and shapes": both}
for name, updater in updaters.items():
    print(f"Modes by {name}, Hz\n{updater.table_.round(3)}\n")

# %%
# Is the optimum the best one?
# ----------------------------
# Each start of the search ends in some optimum. Crosses ended in another one than the best. With frequencies alone,
# most starts do, so that a single start would probably have failed; shapes lead more of them to the same optimum.

fig, axes = plt.subplots(1, 2, figsize=(7.5, 3.4), layout="constrained")
for ax, (name, updater) in zip(axes, updaters.items(), strict=True):
    starts = updater.starts_.sort_values("objective", ignore_index=True)
    starts.index += 1
    for found, marker, label in (starts["optimum"] == 0, "o", "best optimum"), (starts["optimum"] > 0, "x", "others"):
        ax.semilogy(starts["objective"][found], marker, label=f"{label}: {found.sum()} starts")
    ax.set(title=name, xlabel="start, best first")
    ax.grid(axis="y", alpha=0.3)
    ax.legend(frameon=False, fontsize=9, loc="upper left")
axes[0].set_ylabel("objective (log scale)")

# %%
# Estimates beside the truth
# --------------------------
# Standard deviations that were predicted for the nominal model are of the size of those found at the optimum. With
# shapes, error bars are shorter for every parameter, and each hold the truth.

columns = {("", "truth"): pd.Series(TRUTH)}
for name, updater in updaters.items():
    estimate = pd.Series(updater.theta_, list(TRUTH))
    columns[name, "estimate"] = estimate
    columns[name, "predicted, %"] = 100 * predicted[name].deviations
    columns[name, "found, %"] = 100 * np.sqrt(np.diag(updater.covariance_)) / estimate
print(pd.DataFrame(columns).round(2).to_string())

fig, ax = plt.subplots(figsize=(7.5, 4), layout="constrained")
places = np.arange(len(TRUTH))
for shift, (name, updater) in zip((-0.12, 0.12), updaters.items(), strict=True):
    deviations = np.sqrt(np.diag(updater.covariance_))
    ax.errorbar(places + shift, updater.theta_, deviations, fmt="o", capsize=4, label=f"{name}, ± 1 standard deviation")
ax.hlines([*TRUTH.values()], places - 0.32, places + 0.32, color="black", linewidth=2, label="truth")
ax.axhline(1, color="grey", linewidth=0.8, linestyle=":", label="nominal model")
ax.set_xticks(places, list(TRUTH))
ax.set_ylabel("multiplier of stiffness")
ax.grid(axis="y", alpha=0.3)
fig.legend(frameon=False, fontsize=9, ncols=2, loc="outside upper center")

# %%
# What calibration leaves open
# ----------------------------
# The measurements allow other models, too. :meth:`~skthermo.updating.ModelUpdater.sample_models` draws some that are as
# likely as the optimum. What they say of damage, such as a loss of 20 % of the soil, differs as
# much as that is not known: here the change of each frequency in percent, and the range of nine tenths of the models.


def effect(frame_model):
    """Change of the frequencies by damage, in percent."""
    one = np.ones((1, len(TRUTH)))
    healthy, damaged = (m.frequencies(one)[0] for m in (frame_model, frame_model.damaged({"soil": 0.2})))
    return 100 * (damaged / healthy - 1)


effects = np.array([effect(m) for m in both.sample_models(20, spread=0.3, random_state=0)])
true_model = model.rescaled([*TRUTH.values()])
columns = {"before updating": effect(model), "optimum": effect(both.model_), "truth": effect(true_model)}
columns |= {"lowest": np.quantile(effects, 0.05, axis=0), "highest": np.quantile(effects, 0.95, axis=0)}
print(pd.DataFrame(columns, [f"f{i}" for i in range(1, N_MODES + 1)]).round(2).to_string())

# %%
# :class:`~skthermo.updating.ModelUpdater` gives the updated model as ``model_``, whose multipliers are one at the
# optimum: a :class:`~skthermo.surrogate.DataInformedFEM` can take it from there.

save_figures(options.figures)
