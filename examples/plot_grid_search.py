"""
Searches over the inverse and over the whole chain
==================================================

Every stage is a scikit-learn estimator, so :class:`~sklearn.model_selection.GridSearchCV` tunes it. Two questions need
two searches. Which network inverts the FE model best? The score of an
:class:`~skthermo.surrogate.InverseSurrogate` answers it on simulations that were held out. Which lags and which mapper
predict the records best? A search over the chain answers that on contiguous folds. The page then shows why the folds of
such a search must be contiguous. :doc:`/guide/detection` tunes a detector without damaged records in the same way.

Run it with ``python examples/plot_grid_search.py``. Here the searches have few simulations, four settings of the chain
and one month of records; with ``--full`` they are as large as in the paper, with 12 settings and two months, and take
some minutes on one core. It needs :download:`page_recipes.py` beside it.
"""

# sphinx_gallery_thumbnail_number = 1

import tempfile
from collections import Counter
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, KFold, ShuffleSplit, cross_validate
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_kw51, make_truss, make_truss_campaign, steel_modulus
from skthermo.fem import add_noise, sample
from skthermo.metrics import frequency_scorer
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper, paper_network

parser = command_line()
parser.add_argument(
    "--full", action="store_true", help="1000 simulations, 12 settings and 60 days in place of 200, 4 and 30"
)
options = parser.parse_args()

# %%
# A search over the inverse
# -------------------------
# Table 4 of the paper is the network that inverts the FE model of the railway bridge KW51: hidden layers of 256, 128,
# 64, 32 and 16 neurons. Beside it are networks with its first layers only, and two small ones. Without targets, the
# score of an inverse is the R2 of its regressor on 500 new simulations. The measured records do not matter, so that one
# fold is enough; here the nominal frequencies stand for them.

LAYERS = paper_network(4).hidden_layer_sizes
networks = [(4,), (16,), *(LAYERS[:n] for n in range(1, len(LAYERS) + 1))]
bridge = make_kw51().reduced(0.3, random_state=0)  # frequencies to 3e-6, in a hundredth of the time
nominal = np.repeat(bridge.frequencies([[1.0] * len(bridge.parameter_names)]), 4, axis=0)
memory = tempfile.TemporaryDirectory()
inverse = InverseSurrogate(
    bridge, paper_network(4), n_samples=1000 if options.full else 200, memory=memory.name, random_state=0
)
grid = {"regressor__hidden_layer_sizes": networks}
search = GridSearchCV(inverse, grid, cv=ShuffleSplit(1)).fit(nominal)

# %%
# Is the best network the one that errs least? Other simulations tell, parameter by parameter.

new = sample(bridge, inverse.bounds, 300, random_state=1)
names = ["-".join(map(str, sizes)) for sizes in networks]
errors = [
    100 * np.abs(inverse.set_params(regressor__hidden_layer_sizes=sizes).fit().predict(new.frequencies) / new.theta - 1)
    for sizes in networks
]
architectures = pd.DataFrame([one.mean(axis=0) for one in errors], index=names, columns=bridge.parameter_names)
architectures.insert(0, "score", search.cv_results_["mean_test_score"])
architectures.insert(1, "error (%)", [one.mean() for one in errors])
print(architectures.round(3).to_string())
print("chosen:", "-".join(map(str, search.best_params_["regressor__hidden_layer_sizes"])))

fig, ax = plt.subplots(figsize=(6, 3.8), layout="constrained")
bars = ax.bar(names, architectures["error (%)"], color="0.75")
bars[search.best_index_].set_color("C0")
ax.bar_label(bars, [f"{score:.3f}" for score in architectures["score"]], fontsize="small")
ax.margins(y=0.1)
ax.set(ylabel="error of the parameters (%)", title="Networks by their error, with the score above each")
ax.set_xticks(range(len(names)), names, rotation=30, ha="right")

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
fig, axes = plt.subplots(2, figsize=(9, 5), layout="constrained", sharex=True)
for ax, name in zip(axes, ten_days, strict=True):
    ten_days[name].plot(ax=ax, style=".", xlabel="", ylabel=name)

# %%
# The chain as one estimator
# --------------------------
# Parts that are given explicitly nest, so that their settings have names such as ``mapper__lagfeatures__lags``.


def chain(regressor=None):
    """Lags, both surrogates and the FE model."""
    return DataInformedFEM(
        make_truss(),
        mapper=make_pipeline(LagFeatures(freq="1h"), TemperatureMapper(Ridge() if regressor is None else regressor)),
        memory=memory.name,
        random_state=0,
    )


# %%
# A search over the chain
# -----------------------
# The FE simulations do not change with lags or with the mapper, nor do the parameters behind the training records:
# ``memory`` keeps them, so that the search solves the FE model's Monte Carlo once and inverts the records of each fold
# once.
#
# ``frequency_scorer`` gives the error of the predicted frequencies and the share of rows that it could evaluate. Folds
# are contiguous: each is a stretch of weather that the model has not seen.

grid = {"mapper__lagfeatures__lags": [1, 24], "mapper__temperaturemapper__regressor__alpha": [0.5, 50.0]}
if options.full:
    grid |= {"mapper__lagfeatures__lags": [1, 6, 24], "inverse__noise": ["auto", 0.005]}
contiguous = KFold(4)
search = GridSearchCV(chain(), grid, cv=contiguous, scoring=frequency_scorer, refit="neg_mape").fit(T, F)

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
# learning the effect of temperature. Here extremely randomised trees, which can memorise, are evaluated by both kinds
# of folds.

folds = {"contiguous folds": contiguous, "random folds": KFold(4, shuffle=True, random_state=0)}
lags = [1, 6, 24] if options.full else [1, 24]
expected = pd.DataFrame(index=pd.Index(lags, name="lags"), columns=list(folds), dtype=float)
for n in lags:
    trees = chain(ExtraTreesRegressor(50, min_samples_leaf=2)).set_params(mapper__lagfeatures__lags=n)
    for name, cv in folds.items():
        scores = cross_validate(trees, T, F, cv=cv, scoring=frequency_scorer)
        expected.loc[n, name] = -scores["test_neg_mape"].mean()
memory.cleanup()
print(expected.round(3))

fig, ax = plt.subplots(figsize=(6, 3.8), layout="constrained")
for name, marker in zip(folds, "os", strict=True):
    ax.plot(expected[name], marker=marker, label=name)
ax.set(xlabel="lags (hours, the current one included)", ylabel="MAPE of frequencies (%)", xticks=lags)
ax.legend()

# %%
# Random folds predict less error. Only contiguous folds test the model on weather that it has not seen, which is its
# purpose. :doc:`/guide/validation` says more.

save_figures(options.figures)
