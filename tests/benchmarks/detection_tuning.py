"""Tuning a detector on simulated damage: does the winner of a search win on true records, too?

    OMP_NUM_THREADS=1 python tests/benchmarks/detection_tuning.py [--seeds 3]

The steel of a truss follows the air with inertia, and its frequencies, recorded every three hours, scatter more when it
is cold. For each seed, a chain learns one healthy year, and 12 settings of a whitened detector are compared by
simulated records, healthy and damaged, in the weather of a second year. A third year, in which all scenarios are
simulated with fresh noise and are also true, evaluates the winner, the setting that the search began with, and the
best of the 12 by truth. Scores are the share of damaged records found at 2 % false alarms, mean over scenarios.

The exit code is 1 if the winners find more than 2 points less than the best settings by truth, or differ by more than 5
points from what fresh simulation predicted.
"""

import numpy as np
import pandas as pd
from harness import arguments, is_missed, recipes, shown
from sklearn.model_selection import GridSearchCV, ParameterGrid

from skthermo.datasets import make_truss
from skthermo.studies import detection_task, sweep

SCENARIOS = sweep(make_truss(), (0.03, 0.06), ["bottom", "top", "diagonal"])
BEGUN, WINNER, BEST = "where the search began", "winner", "best of 12 by truth"


def one_seed(seed):
    """Simulated and true scores of three settings, in percent, and the rank correlation of those of all."""
    recipe = recipes("tuning")
    first, second, third = (int(number) for number in np.random.SeedSequence(seed).generate_state(3) // 2)
    T, (F,) = recipe.true_year(first, [{}])
    begun, weather = recipe.detector(list(F)), recipe.true_year(second)[0]
    fem = recipe.fitted_chain(T, F, seed)
    task = detection_task(fem, weather, SCENARIOS, n_repeats=4, max_false_alarms=recipe.LIMIT, random_state=seed)
    search = GridSearchCV(begun, recipe.GRID, cv=task.cv, scoring=task.scoring, refit=False).fit(task.X, task.y)

    later, truth = recipe.true_year(third, [one.damage for one in SCENARIOS])
    fresh = task.confirm({WINNER: search, BEGUN: begun}, later, random_state=seed)["fresh"]
    settings = [*ParameterGrid(recipe.GRID)]
    true = {
        str(setting): recipe.true_score(task.refit(begun.set_params(**setting)), later, truth) for setting in settings
    }
    true = pd.DataFrame(true, ["found", "false alarms"]).T
    simulated = pd.Series(search.cv_results_["mean_test_score"], map(str, search.cv_results_["params"]))
    chosen = {BEGUN: simulated.index[0], WINNER: str(search.best_params_), BEST: true["found"].idxmax()}
    rows = {
        name: {
            "found in the search": simulated[setting],
            "in new simulation": fresh.get(name, np.nan),
            "in true records": true["found"][setting],
            "false alarms in true records": true["false alarms"][setting],
        }
        for name, setting in chosen.items()
    }
    return 100 * pd.DataFrame(rows).T, simulated.corr(true["found"], method="spearman")


def main():
    options = arguments(__doc__, seeds=3)
    tables, ranks = zip(*(one_seed(seed) for seed in range(options.seeds)), strict=True)
    mean = sum(tables) / len(tables)
    words = f"rank correlation of simulated and true scores {np.mean(ranks):.2f}"
    shown(f"Truss, {options.seeds} years: damage found at 2 % false alarms, %; {words}", mean.rename_axis("setting"), 1)
    lost = mean["in true records"][BEST] - mean["in true records"][WINNER]
    gap = abs(mean["in new simulation"] - mean["in true records"])[WINNER]
    missed = is_missed("winner less than the best by truth, points", lost, "<= 2")
    raise SystemExit(int(missed + is_missed("fresh simulation and truth differ by, points", gap, "<= 5") > 0))


if __name__ == "__main__":
    main()
