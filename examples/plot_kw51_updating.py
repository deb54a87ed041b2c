"""
KW51: sensitivities and model updating
======================================

Appendix A of Kamali, Ceravolo & Marzani (2026) for our own model of the bridge,
:func:`~skthermo.datasets.make_kw51`, with its Tables A.3, A.4 and A.5 beside ours and a counterpart of Fig. A.2;
:doc:`plot_kw51_model` has that of Fig. A.1. Eleven properties are fitted to six measured frequencies.

Run it with ``python examples/plot_kw51_updating.py`` (``--starts 10`` for the number of starts that gave the updated
model). It needs :download:`kw51_appendix_recipes.py` (the paper's tables, and the fits) and
:download:`page_recipes.py` beside it. The guide is :doc:`/guide/updating`.
"""

import time
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from kw51_appendix_recipes import DESIGN, MEASURED, MODES, NOISE, PAPER_A3, PAPER_A4, PAPER_A5, bounds, bridge, update
from page_recipes import command_line, save_figures

from skthermo.datasets import make_kw51
from skthermo.updating import identifiability, sensitivity

parser = command_line()
parser.add_argument("--starts", type=int, default=3, help="of each fit (default 3)")
options = parser.parse_args()

# %%
# Which properties move which modes?
# ----------------------------------
# Sensitivities of six modes to 21 properties. The paper computes them from differences, eq. (A.2), which takes two
# solves for each property; exact derivatives take one solve for all.

full = make_kw51("all")
found = {}
for method, step in {"exact": None, "central": 0.01}.items():
    began = time.perf_counter()
    found[method] = sensitivity(full, step=step).T
    print(f"{method}: {time.perf_counter() - began:.3f} s")
print(f"largest difference: {(found['exact'] - found['central']).abs().max().max():.1g}")

# %%
# Table A.3, the paper's beside ours. In both models the arch and the pipes carry the modes of the arch, whose
# mass lowers them, and the third mode depends on the bottom of the deck alone.

paper = pd.DataFrame(PAPER_A3, index=MODES).T
both = pd.concat({"paper, Table A.3": paper, "here": found["exact"]}, axis=1).swaplevel(axis=1)
fig, axes = plt.subplots(1, len(MODES), figsize=(12, 7), sharex=True, sharey=True, layout="constrained")
for ax, mode in zip(axes, MODES, strict=True):
    both[mode].plot.barh(ax=ax, title=mode, legend=False, xlabel="sensitivity, eq. (A.1)")
axes[0].invert_yaxis()
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=2, frameon=False)

# %%
# Three fits
# ----------
# Moduli may change by 10 % and all else by 50 %, as in the paper.
#
# - *followed*: each mode keeps its shape while parameters change;
# - *sorted*: modes are compared by rank, as where no shapes are known;
# - *followed, E_bot 30 %*: the third mode, lateral bending of the deck, needs a stiffer deck than these bounds allow.

settings = {
    "followed": (True, bounds()),
    "sorted": (False, bounds()),
    "followed, E_bot 30 %": (True, bounds(E_bot=0.3)),
}
fits = {name: update(bridge(track, limits), limits, options.starts) for name, (track, limits) in settings.items()}

errors = pd.DataFrame({f"paper, {when}": np.divide(f, MEASURED) - 1 for when, f in PAPER_A5.items()}, index=MODES)
errors["here, before"] = fits["followed"][0].table_["error_before"].to_numpy() / 100
for name, (updater, _) in fits.items():
    errors[f"here, {name}"] = updater.table_["error_after"].to_numpy() / 100
errors.loc["mean of absolute values"] = errors.abs().mean()
print("Table A.5, errors of frequencies in %")
print((100 * errors).round(2).T.to_string())

# %%
# The sorted fit looks better than the followed one, but is false: modes have swapped places on the way, and a frequency
# is compared with another mode's. The updater says so.

for message in fits["sorted"][1]:
    print(fill(str(message), 100))

# %%
# What six frequencies cannot tell
# --------------------------------
# Six frequencies cannot determine eleven properties. Most multipliers end at their bounds, in the paper too. The last
# columns show how uncertain each is if all others are known, and if none is, with 0.1 % noise on every frequency.

table = pd.DataFrame({"paper": PAPER_A4}, index=list(DESIGN))
for name, (updater, _) in fits.items():
    table[name] = updater.theta_
known = identifiability(fits["followed"][0].model_, noise=NOISE)
table["deviation alone, %"] = 100 * NOISE / np.sqrt((known.sensitivity**2).sum(axis=0))
table["deviation with the others, %"] = 100 * known.deviations
print("Table A.4, multipliers")
print(table.round(3).to_string())
print(f"\nParameters that these frequencies can tell together to 10 %: {', '.join(known.recommended)}")

# %%
# ``make_kw51(updated=True)`` is the third fit. For the effect of temperature only five moduli stay free, which six
# frequencies can tell; :doc:`plot_kw51_study` goes on from there.

save_figures(options.figures)
