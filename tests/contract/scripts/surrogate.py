import pickle

import numpy as np
from sklearn.base import clone
from sklearn.linear_model import BayesianRidge, LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV, cross_val_score
from sklearn.pipeline import make_pipeline

from skthermo import surrogate
from skthermo.datasets import make_truss
from skthermo.metrics import frequency_scorer, mape
from skthermo.preprocessing import BiasAligner, BlockedKFold, HingeFeatures, KNNGapImputer
from tests.contract.truss import campaign, chain


def surrogate_chain():
    """A chain that has learned from a healthy year predicts another one."""
    fem, later = chain(), campaign(1)
    predicted = fem.predict(later.temperatures)
    return {
        "columns": list(predicted),
        "predicted": predicted[::73],
        "mape": mape(later.clean_frequencies, predicted),
        "parameters": fem.predict_parameters(later.temperatures).mean()[["bottom", "top", "diagonal"]],
        "noise": fem.noise_,
        "score": fem.score(later.temperatures, later.frequencies),
        "trained": int(fem.report_.rows.trained),
        "index": bool((predicted.index == later.temperatures.index).all()),
    }, {
        "*": {"rtol": 0.003},
        "mape": {"atol": 0.05},
        "parameters": {"rtol": 0.01},
        "noise": {"rtol": 0.1},
        "score": {"atol": 0.03},
    }


def surrogate_chain_damage():
    """Damaged records of a chain, with noise as its records have it or as asked for."""
    fem = chain()
    later = campaign(1, damage={"bottom": 0.5})
    T = later.temperatures
    damaged = fem.simulate(T, damage={"bottom": 0.5})
    noisy = fem.simulate(T, damage={"bottom": 0.5}, noise="fitted", random_state=0)
    known = fem.simulate(T, noise=0.01, random_state=0)
    return {
        "damaged": damaged.mean(),
        "mape": mape(later.clean_frequencies, damaged),
        "scatter": (noisy / damaged).std(),
        "scatter asked for": (known / fem.simulate(T)).std(),
        "healthy": bool((fem.simulate(T) - fem.predict(T)).abs().max().max() < 1e-9),
        "again": bool(noisy.equals(fem.simulate(T, damage={"bottom": 0.5}, noise="fitted", random_state=0))),
    }, {"*": {"rtol": 0.003}, "mape": {"atol": 0.1}, "scatter": {"rtol": 0.12}, "scatter asked for": {"rtol": 0.1}}


def surrogate_chain_defects():
    """A chain learns from records with gaps, outliers and markers, and without settings."""
    year, later = campaign(), campaign(1)
    T, F = year.temperatures.copy(), year.frequencies.copy()
    random = np.random.default_rng(0)
    F = F.where(random.random(F.shape) > 0.05)
    T.iloc[10:15, 0] = np.nan
    T.iloc[40:44, 1] = -999.0
    F.iloc[random.choice(365, 6), 2] *= 1.3
    fem = surrogate.DataInformedFEM(make_truss(), random_state=0).fit(T, F)
    gaps = later.temperatures.copy()
    gaps.iloc[5, 0] = np.nan
    gaps.iloc[6] = np.nan
    return {
        "mape": mape(later.clean_frequencies, fem.predict(later.temperatures)),
        "missing": fem.predict(gaps).isna().sum(axis=1).iloc[4:8].to_numpy(),
        "found": sorted({*fem.report_.findings.table["what"]} & {"placeholders", "outliers"}),
    }, {"mape": {"atol": 0.1}}


def surrogate_chain_intervals():
    """Standard deviations, intervals and how far a weather is from that of the records."""
    fem, later = chain(), campaign(1)
    T, F = later.temperatures, later.frequencies
    lowest, highest = fem.predict_interval(T, confidence=0.9)
    hot = T.iloc[:2] + 100
    theta = fem.estimate_parameters(F)
    return {
        "inside": ((lowest < F) & (highest > F)).mean(),
        "width": ((highest - lowest) / F).mean(),
        "known": bool((fem.extrapolation_distance(T).mean() < 0.5).all()),
        "hot": bool((fem.extrapolation_distance(hot).max(axis=1) > 1).all()),
        "estimated": theta.mean()[["bottom", "top", "diagonal"]],
    }, {"inside": {"atol": 0.05}, "width": {"rtol": 0.12}, "estimated": {"rtol": 0.01}}


def surrogate_chain_settings():
    """Other parts of a chain: ridge regressions, a fixed alignment, no discrepancy, gaps filled by neighbours."""
    year, later = campaign(), campaign(1)
    T, F = year.temperatures, year.frequencies.copy()
    F.iloc[::20, 1] = np.nan
    truss = make_truss()
    fem = surrogate.DataInformedFEM(
        truss,
        inverse=surrogate.InverseSurrogate(regressor=Ridge(), bounds=0.2, n_samples=200, noise=0.01, random_state=0),
        mapper=surrogate.TemperatureMapper(LinearRegression()),
        aligner=BiasAligner(truss),
        imputer=KNNGapImputer(),
        discrepancy=None,
        reduce=False,
        random_state=0,
    ).fit(T, F)
    simulated = truss.frequencies(fem.predict_parameters(later.temperatures))
    return {
        "mape": mape(later.clean_frequencies, fem.predict(later.temperatures)),
        "equation": bool(np.allclose(fem.aligner_.inverse_transform(simulated), fem.predict(later.temperatures))),
        "discrepancy": float(np.abs(fem.discrepancy_(T)).max()),
    }, {"mape": {"atol": 0.1}}


def surrogate_chain_variants():
    """The same chain with other records, another model, resampled records; arrays in, arrays out; pickled."""
    year, later, fem = campaign(), campaign(1), chain()
    T = year.temperatures
    arrays = clone(fem).fit(T.to_numpy(), year.frequencies.to_numpy())
    others = {
        "refitted": surrogate.refitted(fem, later.temperatures, later.frequencies),
        "resampled": surrogate.resampled(fem, random_state=1),
        "damaged": surrogate.with_model(fem, make_truss().damaged({"bottom": 0.1})),
    }
    results = {name: (other.predict(T) / fem.predict(T)).mean() for name, other in others.items()}
    results |= {
        "pickled": bool(pickle.loads(pickle.dumps(fem)).predict(T).equals(fem.predict(T))),
        "arrays": bool(np.allclose(arrays.predict(T.to_numpy()), fem.predict(T), rtol=2e-3)),
        "type": type(arrays.predict(T.to_numpy())).__name__,
    }
    return results, {"*": {"rtol": 0.003}}


def surrogate_grid_search():
    """A chain in scikit-learn's searches: parts by name, folds of weeks, errors of frequencies."""
    year = campaign(0, samples_per_year=120)
    fem = surrogate.DataInformedFEM(make_truss(), mapper=surrogate.TemperatureMapper(Ridge()), random_state=0)
    grid = {"mapper__regressor__alpha": [1e-3, 1e6]}
    search = GridSearchCV(fem, grid, cv=BlockedKFold(3), scoring=frequency_scorer, refit="neg_mape")
    search.fit(year.temperatures, year.frequencies)
    return {
        "searched": sorted(search.best_params_),  # both values are as good: the discrepancy follows the weather, too
        "mape": search.cv_results_["mean_test_neg_mape"],
        "r2": cross_val_score(fem, year.temperatures, year.frequencies, cv=BlockedKFold(3)),
    }, {"mape": {"atol": 0.05}, "r2": {"atol": 0.05}}


def surrogate_inverse():
    """The paper's inverse, trained on simulations, and the network's layers."""
    model = make_truss()
    inverse = surrogate.InverseSurrogate(model, Ridge(1e-6), bounds=0.2, n_samples=400, noise=0.0, random_state=0).fit()
    theta = np.array([[0.95, 1.05, 0.9, 1.0], [1.1, 1.0, 0.97, 1.0]])
    return {
        "inverted": inverse.transform(model.frequencies(theta))[:, :3],
        "samples": inverse.samples_.theta[:2],
        "bounds": inverse.bounds_,
        "layers": list(surrogate.paper_network("kw51-inverse", alpha=0.01).hidden_layer_sizes),
    }, {"inverted": {"rtol": 0.003}}


def surrogate_mapper():
    """Temperature to stiffness by the default regression, by one with a standard deviation, and in a grid search."""
    T = np.linspace(-10, 40, 50)[:, np.newaxis]
    theta = np.exp(-0.004 * T) * np.exp(0.001 * np.random.default_rng(0).normal(size=T.shape))
    default = surrogate.TemperatureMapper(random_state=0).fit(T, theta)
    mean, std = surrogate.TemperatureMapper(BayesianRidge()).fit(T, theta[:, 0]).predict(T, return_std=True)
    search = GridSearchCV(
        surrogate.TemperatureMapper(make_pipeline(HingeFeatures(), Ridge())),
        {"regressor__hingefeatures__n_knots": [1, 4]},
        cv=3,
    )
    return {
        "default": default.predict([[20.0], [30.0]]),
        "mean": mean[::10],
        "std": [bool((std > 0).all()), bool((std < 0.01).all())],
        "score": default.score(T, theta),
        "search": search.fit(T, theta).predict([[20.0]]),
    }, {"*": {"rtol": 2e-3}}


def surrogate_posterior_inverse():
    """Stiffness of each record with its standard deviation: prior and noise that the records teach, or given ones."""
    year = campaign()
    model, F = make_truss(), year.frequencies
    learned = surrogate.PosteriorInverse(model).fit(F)
    theta, std = learned.transform(F, return_std=True)
    given = surrogate.PosteriorInverse(model, prior=0.2, noise=0.01).fit(F)
    exact = given.transform(model.frequencies([[0.9, 1.1, 0.95, 1.0]]))
    gaps = F[:3].copy()
    gaps.iloc[0, 2], gaps.iloc[1] = float("nan"), float("nan")
    return {
        "common": learned.prior_.common,
        "mean": theta.mean()[["bottom", "top", "diagonal"]],
        "std": std.mean()[["bottom", "top", "diagonal"]],
        "noise": learned.noise_,
        "given": exact[:, :3],
        "gaps": learned.transform(gaps).isna().sum(axis=1).to_numpy(),
    }, {
        "common": {"rtol": 0.1},
        "mean": {"rtol": 0.005},
        "std": {"rtol": 0.25},
        "noise": {"rtol": 0.15},
        "given": {"rtol": 1e-3},
    }
