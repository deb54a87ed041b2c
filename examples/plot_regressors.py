"""
Which regressor for the two surrogates?
=======================================

Any scikit-learn regressor can be the inverse surrogate M1, from frequencies to the parameters of the FE model, and the
temperature mapper M2, from temperatures to these parameters. Seven kinds are compared here: the paper's deep networks,
a small network, a random forest, a quadratic polynomial, piecewise-linear regression, a Gaussian process and gradient
boosting. The small network is M1's default, and piecewise-linear regression is M2's.

Run it with ``python examples/plot_regressors.py``. This page shows few simulations and records and one seed, so that
its times and errors are rough; with ``--full`` it has five times as many and five seeds, which takes about twelve
minutes. The data of Z24 belong to KU Leuven; with the folder or the file that holds them as an argument, M2 is compared
on them, too. The page needs :download:`regressors_recipes.py` and :download:`page_recipes.py` beside it.
"""

# sphinx_gallery_thumbnail_number = 2

import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures
from regressors_recipes import (
    BEYOND,
    FULL,
    SMALL,
    SOLVED,
    STYLES,
    averaged,
    bare_forest_error,
    chains_by_inverse,
    find,
    fitted_chain,
    inverse_results,
    kw51_campaign,
    limits,
    mapper_results,
    regressors,
    structures,
    truss_campaign,
    z24_campaign,
)

parser = command_line()
parser.add_argument("data", type=Path, nargs="?", help="file or folder with the data of Z24")
parser.add_argument("--full", action="store_true", help="five times as many simulations, about twelve minutes")
parser.add_argument("--seeds", type=int, help="repetitions to average over (default 1, with --full 5)")
options = parser.parse_args()
size, seeds = FULL if options.full else SMALL, range(options.seeds or (5 if options.full else 1))
warnings.filterwarnings("ignore")  # of optimisers that stop early, and of extrapolation, which this page is about


def show(table):
    print(table.to_string(float_format="%.3g"), end="\n\n")


# %%
# The regressors
# --------------
# Bare regressors of scikit-learn; the surrogates standardise inputs and outputs and take logarithms for them.
#
# .. literalinclude:: regressors_recipes.py
#    :pyobject: regressors
#
# M1: from frequencies to parameters
# ----------------------------------
# M1 learns simulations of the 28-bar truss and of the bridges KW51 and Z24, without and with 0.5 % noise, and is tested
# on fresh ones. ``error`` is the mean error of the parameters in percent. The last row needs no regressor: the default
# inverse of a chain solves for the parameters of each record, here with the box as its prior.

models, inverse = structures(), {}
for name, (model, bounds, network) in models.items():
    for noise in (0.0, 0.005):
        tables = [inverse_results(model, bounds, network, noise, seed, size) for seed in seeds]
        inverse[name, noise] = averaged(tables)
        print(f"M1, {name}, box of {bounds:.0%}, noise {noise:.1%}")
        show(inverse[name, noise])

# %%
# Without noise, solved estimates are exact; with noise, no regressor errs less.

fig, axes = plt.subplots(1, len(models), figsize=(13, 4.6), sharey=True, layout="constrained")
for ax, name in zip(axes, models, strict=True):
    for regressor, row in inverse[name, 0.0].drop(index=SOLVED).iterrows():
        colour, marker = STYLES[regressor]
        ax.plot(row["training, s"], row["error"], marker, color=colour, ms=9, label=regressor)
    ax.set(xscale="log", yscale="log", xlabel="training time (s, log scale)", title=f"{name}, noise-free")
    ax.grid(alpha=0.3)
axes[0].set_ylabel("mean error of the parameters (%, log scale)")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=len(STYLES))

# %%
# Campaigns: a year of the truss, and a year made up for KW51 (season, spells of some days, day and night, frost). Each
# tests on the year that follows. A chain with any regressor as M1, beside the default chain; both learn what their
# model cannot follow, which makes up for errors of M1 in healthy predictions, not in simulated damage:

campaigns = {
    "truss": lambda seed: truss_campaign(seed, size),
    "KW51": lambda seed: kw51_campaign(models["KW51"][0], seed, size),
}
if options.data:
    file = find(options.data) or parser.error(f"no Z24 data at {options.data}")
    campaigns["Z24"] = lambda seed: z24_campaign(models["Z24"][0], file)
for name, campaign in campaigns.items():
    print(f"chains by their M1, {name}")
    show(averaged(chains_by_inverse(campaign(seed), seed) for seed in seeds))

# %%
# M2: from temperatures to parameters
# -----------------------------------
# The mapper M2, and with it the discrepancy, learn the same campaigns. ``chain`` is the error of the frequencies,
# ``direct`` that of the same regressor from temperatures straight to frequencies. The last columns have the largest
# change of a frequency from the hottest (coldest) record to weather 20 °C beyond it.

for name, campaign in campaigns.items():
    print(f"M2, {name}")
    limits(campaign(0))
    show(averaged(mapper_results(campaign(seed), seed) for seed in seeds))

# %%
# In a ``TemperatureMapper``, a regressor learns what each record says about the parameters, with its noise, which a
# forest hardly smooths. As the ``mapper`` itself, a forest learns the parameters as the inverse estimates them, and
# the inverse's prior has reduced the noise in these. That helps on KW51 only:

print("Error of a random forest as the mapper itself, in percent")
for name, campaign in campaigns.items():
    print(f"{name}: {np.mean([bare_forest_error(campaign(seed), seed) for seed in seeds]):.3g}")

# %%
# On the truss the regressors hardly differ. On KW51 all errors are below the noise of the records, 0.15 %, and come
# from how a regressor follows the knee at 0 °C. Beyond the weather that they have learned, they do differ: trees stay
# at their last value, and piecewise-linear regression goes on straight. The frequency that frost moves most shows it:

campaign = campaigns["KW51"](0)
T, F = campaign.train
lowest, highest = T["steel"].min(), T["steel"].max()
grid = pd.DataFrame({"steel": np.linspace(lowest - BEYOND, highest + BEYOND, 121)})
truth = campaign.law(grid).to_numpy()
mode = int((truth[0] / truth[-1]).argmax())

fig, ax = plt.subplots(figsize=(9, 5), layout="constrained")
ax.axvspan(lowest, highest, color="#777777", alpha=0.12, lw=0)
ax.plot(T["steel"], F.iloc[:, mode], ".", ms=2, color="#bbbbbb", label="training records")
ax.plot(grid, truth[:, mode], color="black", lw=2.5, label="true law")
for name, regressor in regressors(campaign.network).items():
    colour, marker = STYLES[name]
    curve = fitted_chain(campaign, regressor, 0).predict(grid).iloc[:, mode]
    ax.plot(grid, curve, color=colour, marker=marker, markevery=10, ms=5, lw=1.2, label=name)
label = "temperature of the steel (°C); shaded: the range of the training records"
ax.set(xlabel=label, ylabel=f"$f_{mode + 1}$ (Hz)")
ax.legend(ncols=2)

# %%
# :doc:`/accuracy_regressors` says which regressor to choose.

save_figures(options.figures)
