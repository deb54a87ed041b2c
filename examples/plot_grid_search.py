"""
One search over the whole chain
===============================

Every stage is a scikit-learn estimator, so one :class:`~sklearn.model_selection.GridSearchCV` chooses lags, noise and
the settings of both networks together. The FE simulations do not change with any of these, and the parameters behind
the training records do not change with lags or with the mapper's network: ``memory`` keeps them, so that the whole
search solves the FE model's Monte Carlo once, and inverts the records of each fold once for each inverse. The page then
shows why the folds of such a search must be contiguous.

Run it with ``python examples/plot_grid_search.py``. Here the search has four settings and one month of records; with
``--full`` it has 24 settings and two months, and takes some four minutes on one core. It needs
:download:`page_recipes.py` beside it.
"""

# sphinx_gallery_thumbnail_number = 2

import tempfile
from collections import Counter
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.model_selection import GridSearchCV, KFold, cross_validate
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign, steel_modulus
from skthermo.fem import add_noise
from skthermo.metrics import frequency_scorer
from skthermo.plotting import HistoryDisplay
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

parser = command_line()
parser.add_argument("--full", action="store_true", help="24 settings and 60 days of records in place of 4 and 30")
options = parser.parse_args()

# %%
# Records with inertia
# --------------------
# Hourly records. The truss follows the air with thermal inertia (an exponential mean of eight hours), which only lagged
# temperatures can describe, and an effect that no sensor measures, such as moisture or traffic, makes its frequencies
# drift slowly.


def monitoring(n_days=60, noise=0.005, seed=0):
    """Air temperatures, and frequencies of a truss that lags behind them and drifts."""
    random = np.random.RandomState(seed)
    year = make_truss_campaign(samples_per_year=24 * 365, samples_per_day=24, random_state=random)
    air = year.temperatures.iloc[: 24 * n_days]
    steel = air.ewm(halflife=8).mean()
    clean = year.model.frequencies(steel_modulus(steel))
    drift = pd.Series(random.standard_normal(len(air))).ewm(halflife=48).mean().to_numpy()
    drifting = clean * (1 + 0.01 * drift[:, np.newaxis] / drift.std())
    noisy = add_noise(drifting, noise, random_state=random)
    return air, pd.DataFrame(noisy, index=air.index, columns=year.frequencies.columns)


T, F = monitoring(60 if options.full else 30)
ten_days = pd.DataFrame({"air (°C)": T["T1"], "$f_1$ (Hz)": F["f1"]})[:240]
HistoryDisplay.from_predictions(ten_days, unit="", kind="points")

# %%
# The chain as one estimator
# --------------------------
# Parts that are given explicitly nest, so that their settings have names such as ``mapper__lagfeatures__lags``.

NETWORK = MLPRegressor(hidden_layer_sizes=(32,), alpha=0.5, learning_rate_init=0.003, max_iter=2000)
memory = tempfile.TemporaryDirectory()


def chain(regressor=NETWORK):
    """Lags, both surrogates and the FE model."""
    return DataInformedFEM(
        make_truss(),
        inverse=InverseSurrogate(regressor=NETWORK, bounds=0.2, n_samples=500),
        mapper=make_pipeline(LagFeatures(freq="1h"), TemperatureMapper(regressor)),
        memory=memory.name,
        random_state=0,
    )


# %%
# The search
# ----------
# ``frequency_scorer`` gives the error of the predicted frequencies and the share of rows that it could judge. Folds are
# contiguous: each is a stretch of weather that the model has not seen.

grid = {"mapper__lagfeatures__lags": [1, 24], "mapper__temperaturemapper__regressor__alpha": [0.5, 5.0]}
if options.full:
    grid |= {
        "mapper__lagfeatures__lags": [1, 6, 24],
        "inverse__noise": [0.0, 0.005],
        "inverse__regressor__hidden_layer_sizes": [(32,), (64,)],
    }
contiguous = KFold(4)
search = GridSearchCV(chain(), grid, cv=contiguous, scoring=frequency_scorer, refit="neg_mape", n_jobs=2).fit(T, F)

columns = {f"param_{name}": name.split("__")[0] + " " + name.split("__")[-1] for name in grid}
results = pd.DataFrame(search.cv_results_).rename(columns=columns)
table = results[list(columns.values())].assign(
    **{"MAPE (%)": -results["mean_test_neg_mape"], "rows scored (%)": 100 * results["mean_test_share_scored"]}
)
print(table.sort_values("MAPE (%)").head(8).round(3).to_string(index=False))
made = Counter(lock.name.split("-")[0] for lock in Path(memory.name).glob("*.lock"))
print(f"\n{len(table)} settings, {contiguous.get_n_splits()} folds and the refit, {len(table) * 4 + 1} chains fitted")
print(f"{made['simulations']} Monte Carlo of the FE model, {made['inversion']} inversions of training records")

# %%
# Lags matter most: without them, the chain cannot know how warm the steel is.
#
# Why random folds flatter lagged features
# ----------------------------------------
# Neighbouring hours share 23 of their 24 lagged values and almost the same drift. With random folds, every tested hour
# has such neighbours among the training rows, and a model that is flexible enough memorises the hour instead of
# learning the effect of temperature. Here extremely randomised trees, which can memorise, are judged by both kinds of
# folds.

folds = {"contiguous folds": contiguous, "random folds": KFold(4, shuffle=True, random_state=0)}
lags = [1, 6, 24]
promised = pd.DataFrame(index=pd.Index(lags, name="lags"), columns=list(folds), dtype=float)
for n in lags:
    trees = chain(ExtraTreesRegressor(50, min_samples_leaf=2)).set_params(mapper__lagfeatures__lags=n)
    for name, cv in folds.items():
        scores = cross_validate(trees, T, F, cv=cv, scoring=frequency_scorer)
        promised.loc[n, name] = -scores["test_neg_mape"].mean()
memory.cleanup()
print(promised.round(3))

fig, ax = plt.subplots(figsize=(6, 3.8), layout="constrained")
for name, marker in zip(folds, "os", strict=True):
    ax.plot(promised[name], marker=marker, label=name)
ax.set(xlabel="lags (hours, the current one included)", ylabel="MAPE of frequencies (%)", xticks=lags)
ax.legend()

# %%
# Random folds promise less error, and by them more lags seem better. Contiguous folds tell that these trees gain
# nothing from more than six: only they test the model on weather that it has not seen, which is its purpose.
# :doc:`/guide/validation` says more.

save_figures(options.figures)
