"""
A detector tuned on simulated damage
====================================

Lags, windows and regimes decide what a detector finds, and no damaged record tells which to take. A chain simulates
damage, :func:`~skthermo.studies.detection_task` makes labelled records of it, and a search of scikit-learn chooses.
Here the truth is known, and says whether the choice was right.

Run it with ``python examples/plot_detector_tuning.py``. It needs :download:`tuning_recipes.py` and
:download:`page_recipes.py` beside it, and takes a minute or two.
"""

# sphinx_gallery_thumbnail_number = 1

import warnings

import matplotlib.pyplot as plt
import pandas as pd
from page_recipes import command_line, save_figures
from sklearn.base import clone
from sklearn.model_selection import GridSearchCV
from tuning_recipes import GRID, LIMIT, detector, fitted_chain, true_score, true_year

from skthermo.studies import detection_task, sweep

options = command_line().parse_args()
warnings.filterwarnings("ignore", message=".*outside-prior")  # some of the coldest records, by their noise
warnings.filterwarnings("ignore", message=".*few-records")  # one cold season scatters more than the rest

# %%
# A baseline
# ----------
# A healthy year of the 28-bar truss, recorded every three hours. Its steel follows the air with inertia, so that lagged
# temperatures should help, and its frequencies scatter more when it is cold, so that two regimes should.

T, (F,) = true_year(seed=0, damages=[{}])
fem = fitted_chain(T, F)
scenarios = sweep(fem, (0.03, 0.06), groups=["bottom", "top", "diagonal"])

# %%
# The search
# ----------
# Simulated records, healthy and damaged, in the weather of a second year. Every setting learns the measured baseline.
# ``refit=False``, since no detector may learn the damaged records of the task: ``task.refit`` fits the best to the
# baseline.

task = detection_task(fem, true_year(seed=1)[0], scenarios, n_repeats=4, max_false_alarms=LIMIT, random_state=0)
before = detector(fem.mode_names_)
search = GridSearchCV(before, GRID, cv=task.cv, scoring=task.scoring, refit=False).fit(task.X, task.y)
tuned = task.refit(search)

columns = {f"param_{name}": name.split("__")[-1] for name in GRID} | {"mean_test_score": "found (%)"}
results = pd.DataFrame(search.cv_results_)[[*columns]].rename(columns=columns)
results["found (%)"] = (100 * results["found (%)"]).round(1)
print(results.sort_values("found (%)", ascending=False).to_string(index=False))

# %%
# Is it true?
# -----------
# A third year evaluates the winner, with weather and noise that took no part. The optimism is what the search predicted
# too much.

later, truth = true_year(seed=2, damages=[one.damage for one in scenarios])
table = task.confirm({"tuned": search, "before": before}, later, random_state=0)
shown = ["tuned", "fresh", "fresh_ci_low", "fresh_ci_high", "optimism", "false_alarms"]
print((100 * table[shown]).round(1).to_string())

# %%
# All settings on the true records of that year, which no real bridge would have:

fitted = [clone(before).set_params(**setting).fit(task.baseline) for setting in search.cv_results_["params"]]
true = [100 * true_score(one, later, truth)[0] for one in fitted]
found, false_alarms = true_score(tuned, later, truth)
print(f"true records: {found:.1%} of the damaged ones found at {false_alarms:.1%} false alarms")

fig, ax = plt.subplots(figsize=(4.5, 4.2), layout="constrained")
ax.axline((0, 0), slope=1, color="0.7", linewidth=1)
ax.scatter(results["found (%)"], true)
ax.set(xlabel="damaged records found, simulated (%)", ylabel="damaged records found, true (%)")

# %%
# Simulation puts the settings in the order of truth.

save_figures(options.figures)
