"""
Grid search over the whole chain, and why folds must be contiguous
==================================================================

Every stage is a scikit-learn estimator, so one ``GridSearchCV`` chooses lags, noise and both
networks together. The FE simulations do not change with any of these: ``memory`` keeps them,
and the whole search solves the FE model's Monte Carlo once.

The data are two months of hourly records. The truss follows the air with thermal inertia (an exponential mean of
eight hours), which only lagged temperatures can describe, and an effect that no sensor measures, such as moisture or
traffic, makes its frequencies drift slowly.

**Why random folds flatter lagged features.** Neighbouring hours share 23 of their 24 lagged values and
almost the same drift. With random folds, every tested hour has such neighbours among
the training rows, and a model that is flexible enough memorises the hour instead of learning the effect of
temperature. Contiguous folds test the model on weather that it has not seen, which is its purpose.

Run it with ``python examples/plot_grid_search.py``; the figure goes to the folder ``figures``.
"""

import argparse
import tempfile
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.ensemble import ExtraTreesRegressor
from sklearn.model_selection import GridSearchCV, KFold, cross_validate
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign, steel_modulus
from skthermo.fem import add_noise
from skthermo.metrics import frequency_scorer
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

CONTIGUOUS = KFold(4)
RANDOM = KFold(4, shuffle=True, random_state=0)
BLUE, ORANGE = "#0072B2", "#D55E00"


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


NETWORK = MLPRegressor(alpha=0.5, learning_rate_init=0.003, max_iter=2000)


def chain(model, memory, regressor=NETWORK):
    """Lags, both surrogates and the FE model as one estimator."""
    return DataInformedFEM(
        model,
        inverse=InverseSurrogate(regressor=NETWORK, bounds=0.2, n_samples=500, memory=memory),
        mapper=make_pipeline(LagFeatures(freq="1h"), TemperatureMapper(regressor)),
        random_state=0,
    )


GRID = {
    "mapper__lagfeatures__lags": [1, 6, 24],
    "inverse__noise": [0.0, 0.005],
    "inverse__regressor__hidden_layer_sizes": [(32,), (64,)],
    "mapper__temperaturemapper__regressor__alpha": [0.5, 5.0],
}


def table_of(search):
    """Best first: parameters, MAPE in percent and share of rows scored."""
    results = pd.DataFrame(search.cv_results_)
    columns = {f"param_{name}": name.split("__")[0] + " " + name.split("__")[-1] for name in GRID}
    table = results[list(columns)].rename(columns=columns)
    table["MAPE (%)"] = -results["mean_test_neg_mape"].round(3)
    table["rows scored (%)"] = (100 * results["mean_test_share_scored"]).round(1)
    return table.sort_values("MAPE (%)").reset_index(drop=True)


def compare_folds(model, memory, T, F):
    """MAPE by number of lags for contiguous and random folds, with a regressor that can memorise."""
    rows = {}
    for lags in (1, 2, 6, 12, 24):
        estimator = chain(model, memory, ExtraTreesRegressor(100, min_samples_leaf=2))
        estimator.set_params(mapper__lagfeatures__lags=lags)
        rows[lags] = {
            name: -cross_validate(estimator, T, F, cv=folds, scoring=frequency_scorer)["test_neg_mape"].mean()
            for name, folds in (("contiguous folds", CONTIGUOUS), ("random folds", RANDOM))
        }
    return pd.DataFrame(rows).T.rename_axis("lags")


def plot_folds(table):
    """MAPE over the number of lags."""
    fig, ax = plt.subplots(figsize=(6, 3.8), layout="constrained")
    for name, colour, marker in (("contiguous folds", BLUE, "o"), ("random folds", ORANGE, "s")):
        ax.plot(table.index, table[name], marker=marker, color=colour, label=name)
    ax.set(xlabel="lags (hours, the current one included)", ylabel="MAPE of frequencies (%)")
    ax.set_xticks(table.index)
    ax.legend()
    return fig


def main():
    parser = argparse.ArgumentParser(description="Grid search over the whole chain.")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figure")
    options = parser.parse_args()

    T, F = monitoring()
    model = make_truss()
    with tempfile.TemporaryDirectory() as memory:
        search = GridSearchCV(
            chain(model, memory), GRID, cv=CONTIGUOUS, scoring=frequency_scorer, refit="neg_mape", n_jobs=2
        ).fit(T, F)
        simulations = len(list(Path(memory).rglob("output.pkl")))
        print(f"{len(search.cv_results_['params'])} settings x {CONTIGUOUS.get_n_splits()} contiguous folds, ", end="")
        print(f"{simulations} Monte Carlo of the FE model\n")
        print(table_of(search).head(8).to_string(), end="\n\n")
        folds = compare_folds(model, memory, T, F)
    print("MAPE (%) that folds promise, with extremely randomised trees as temperature mapper:\n")
    print(folds.round(3))
    options.figures.mkdir(parents=True, exist_ok=True)
    path = options.figures / "grid_search_folds.png"
    plot_folds(folds).savefig(path, dpi=130)
    print(f"\nFigure: {path}")


if __name__ == "__main__":
    main()
