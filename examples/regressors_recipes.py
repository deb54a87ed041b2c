"""Regressors, structures and campaigns that are compared in ``plot_regressors.py``."""

import time
from collections import namedtuple
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
from scipy.signal import lfilter
from sklearn.ensemble import GradientBoostingRegressor, RandomForestRegressor
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.linear_model import RidgeCV
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer, PolynomialFeatures

from skthermo.datasets import load_z24, make_kw51, make_truss, make_truss_campaign, make_z24, steel_modulus
from skthermo.fem import add_noise, evaluate, sample
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner, HingeFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, PosteriorInverse, TemperatureMapper, paper_network

PENALTIES = np.logspace(-6, 4, 21)
BEYOND = 20.0  # degrees Celsius
Z24_FILES = ("z24_monitoring.csv", "z24/z24_monitoring.csv", "z24.mat", "z24/z24.mat")
STYLES = {
    "paper's network": ("#0072B2", "o"),
    "small network": ("#56B4E9", "s"),
    "random forest": ("#009E73", "^"),
    "quadratic": ("#D55E00", "D"),
    "piecewise-linear": ("#CC79A7", "v"),
    "Gaussian process": ("#E69F00", "P"),
    "boosting": ("#777777", "X"),
}
Size = namedtuple("Size", "simulations fresh days")  # rows to learn M1 from and to test it on; days of made-up weather
FULL, SMALL = Size(1000, 500, 365), Size(200, 50, 180)


class FewRows(GaussianProcessRegressor):
    """Learns from at most 500 evenly spaced rows, because the time it takes grows with their cube."""

    def fit(self, X, y):
        step = -(-len(X) // 500)
        return super().fit(X[::step], y[::step])


def quadratic():
    """A quadratic polynomial with a penalty chosen by cross-validation."""
    return make_pipeline(PolynomialFeatures(2), RidgeCV(PENALTIES))


def regressors(network):
    """The regressors by name; the surrogates give them standardised inputs and outputs, and logarithms."""
    kernel = ConstantKernel() * RBF() + WhiteKernel(noise_level_bounds=(1e-8, 10))
    small = {"alpha": 1.0, "learning_rate_init": 0.003, "max_iter": 2000, "n_iter_no_change": 20}
    return {
        "paper's network": paper_network(network),
        "small network": MLPRegressor(hidden_layer_sizes=(64,), **small),
        "random forest": RandomForestRegressor(),
        "quadratic": quadratic(),
        "piecewise-linear": make_pipeline(HingeFeatures(), RidgeCV(np.logspace(-3, 5, 33))),
        "Gaussian process": FewRows(kernel),
        "boosting": MultiOutputRegressor(GradientBoostingRegressor()),
    }


def structures():
    """FE models by name, the box of each, and the paper's network for its inverse; the bridges are reduced models."""
    return {
        "truss": (make_truss(), 0.2, "truss"),
        "KW51": (make_kw51().reduced(0.3, tol=1e-4, random_state=0), 0.3, "kw51-inverse"),
        "Z24": (make_z24().reduced([[0.4, 4.0]] * 4, random_state=0), 0.3, "truss"),
    }


SOLVED = "no regressor, solved"
"""The row of `~skthermo.surrogate.PosteriorInverse`."""


def timed(function: Callable, *arguments) -> tuple[Any, float]:
    """What a function returns, and the seconds that it takes."""
    start = time.perf_counter()
    return function(*arguments), time.perf_counter() - start


def inverse_results(model, bounds, network, noise, seed, size=SMALL):
    """Mean absolute error of ln theta in percent, and times, of every regressor as the inverse surrogate."""
    drawn = sample(model, bounds, size.simulations, random_state=seed)
    fresh = sample(model, bounds, size.fresh, random_state=1000 + seed)
    learned = add_noise(drawn.frequencies, noise, random_state=seed)
    measured = add_noise(fresh.frequencies, noise, random_state=1000 + seed)
    rows = {}
    for name, regressor in regressors(network).items():
        plain = InverseSurrogate(model, regressor, bounds=bounds, noise=noise, random_state=seed)
        _, training = timed(plain.fit, learned, drawn.theta)
        guess, guessing = timed(plain.predict, measured)
        rows[name] = {
            "error": 100 * np.abs(np.log(guess / fresh.theta)).mean(),
            "training, s": training,
            "prediction, ms": 1e6 * guessing / size.fresh,
        }
    inverse = PosteriorInverse(model, noise=noise, prior=bounds / np.sqrt(3))
    theta, solving = timed(inverse.fit_transform, measured)
    errors = 100 * np.abs(np.log(theta / fresh.theta))  # NaN in the few rows that stall where modes cross
    solved = {"error": np.nanmean(errors), "training, s": 0.0}
    rows[SOLVED] = solved | {"prediction, ms": 1e6 * solving / size.fresh}
    return pd.DataFrame(rows).T.rename_axis("regressor")


def chains_by_inverse(campaign, seed):
    """Errors in percent of chains with every regressor as M1, beside the default chain, and seconds of their fits."""
    (T, F), (T_test, F_test), rows = campaign.train, campaign.test, {}
    for name, regressor in (regressors(campaign.network) | {SOLVED: None}).items():
        inverse = None if name == SOLVED else InverseSurrogate(regressor=regressor, bounds=campaign.bounds)
        chain = DataInformedFEM(campaign.model, inverse=inverse, aligner=campaign.aligner, random_state=seed)
        fitted, seconds = timed(chain.fit, T, F)
        rows[name] = {"error": mape(F_test, fitted.predict(T_test)).mean(), "fit, s": seconds}
    return pd.DataFrame(rows).T.rename_axis("regressor")


class Campaign(NamedTuple):
    """Records to learn from and later ones to test on; ``law`` gives the true frequencies at temperatures, if known."""

    model: Any
    train: tuple[pd.DataFrame, pd.DataFrame]
    test: tuple[pd.DataFrame, pd.DataFrame]
    noise: float
    bounds: float
    network: str
    aligner: Any = FunctionTransformer()
    law: Callable | None = None


def truss_campaign(seed, size=SMALL):
    """A year of the truss, and the clean frequencies of a later year."""
    year, later = (make_truss_campaign(samples_per_year=size.days, random_state=s) for s in (seed, 1000 + seed))
    train, test = (year.temperatures, year.frequencies), (later.temperatures, later.clean_frequencies)
    law = lambda T: year.model.frequencies(steel_modulus(T))  # noqa: E731
    return Campaign(make_truss(), train, test, noise=0.01, bounds=0.2, network="truss", law=law)


def weather(days, seed):
    """Temperature of the steel every six hours: season, spells of some days, day and night."""
    random = np.random.default_rng(seed)
    day = np.arange(4 * days) / 4
    spell = lfilter([1], [1, -0.95], random.normal(0, 3.5 * np.sqrt(1 - 0.95**2), len(day)))
    return pd.DataFrame({"steel": 11 - 9 * np.cos(2 * np.pi * day / days) + spell - 4 * np.cos(2 * np.pi * day)})


def kw51_parameters(T):
    """Steel loses 0.04 % of its stiffness per degree; frost adds 0.5 % per degree to the first parameter, E_bot."""
    temperature = np.asarray(T)[:, :1]
    theta = np.repeat(1 - 0.0004 * (temperature - 11), 5, axis=1)
    theta[:, :1] += 0.005 * np.maximum(-temperature, 0)
    return theta


def kw51_campaign(model, seed, size=SMALL):
    """A year of made-up monitoring of KW51 with 0.15 % noise, and the clean frequencies of a later year."""

    def law(T):
        return pd.DataFrame(model.frequencies(kw51_parameters(T)), columns=[f"f{i + 1}" for i in range(6)])

    T, later = weather(size.days, seed), weather(size.days, 1000 + seed)
    F = law(T) * add_noise(np.ones((len(T), 6)), 0.0015, random_state=seed)
    return Campaign(model, (T, F), (later, law(later)), noise=0.0015, bounds=0.3, network="kw51-mapper", law=law)


def z24_campaign(model, file):
    """The healthy records of Z24, the last fifth of them for the test."""
    data = load_z24(file)
    T, F = (frame[data.state == "undamaged"] for frame in (data.temperatures, data.frequencies))
    n = 4 * len(T) // 5
    aligner = BiasAligner(model, method="scale")
    return Campaign(model, (T[:n], F[:n]), (T[n:], F[n:]), noise=0.005, bounds=0.3, network="truss", aligner=aligner)


def fitted_chain(campaign, regressor, seed, bare=False):
    """The whole chain with a regressor as its M2, `bare` or in a `TemperatureMapper`, and for its discrepancy."""
    mapper = TemperatureMapper(regressor)
    parts = {"mapper": regressor if bare else mapper, "aligner": campaign.aligner, "discrepancy": mapper}
    return DataInformedFEM(campaign.model, **parts, random_state=seed).fit(*campaign.train)


def bare_forest_error(campaign, seed):
    """Error in percent of a chain whose M2 is a random forest without a `TemperatureMapper` around it."""
    T, F = campaign.test
    return mape(F, fitted_chain(campaign, RandomForestRegressor(), seed, bare=True).predict(T)).mean()


def fitted_directly(campaign, regressor, seed):
    """The frequencies at temperatures that the same regressor learns without an FE model."""
    T, F = campaign.train
    mapper = TemperatureMapper(regressor, random_state=seed).fit(T, F / F.mean())
    return lambda T: mapper.predict(T) * F.mean()


def beyond(predict, T, sign):
    """Largest change of a frequency, in percent, from the hottest (or coldest) record to 20 °C beyond it."""
    record = T.iloc[[int((sign * T.mean(axis=1)).argmax())]]
    return 100 * np.abs(np.asarray(predict(record + sign * BEYOND)) / np.asarray(predict(record)) - 1).max()


def mapper_results(campaign, seed):
    """Errors in percent, times, and behaviour beyond the data of every regressor as the temperature mapper."""
    (T, _), (T_test, F_test) = campaign.train, campaign.test
    rows = {}
    for name, regressor in regressors(campaign.network).items():
        predict = fitted_chain(campaign, regressor, seed).predict
        predict_directly, training = timed(fitted_directly, campaign, regressor, seed)
        errors = [mape(F_test, p(T_test)).mean() for p in (predict, predict_directly)]
        rows[name] = {
            "chain": errors[0],
            "direct": errors[1],
            "ratio": errors[0] / errors[1],
            "training, s": training,
            "20 °C hotter": beyond(predict, T, 1),
            "20 °C colder": beyond(predict, T, -1),
        }
    return pd.DataFrame(rows).T.rename_axis("regressor")


def limits(campaign):
    """What the results compare with, in percent: the range of the training data and, where it is known, the truth."""
    (T, F), law = campaign.train, campaign.law
    spread = 100 * ((F.quantile(0.99) - F.quantile(0.01)) / F.mean()).max()
    print(f"The middle 98 % of the training records span {spread:.1f} % of the mean in the mode that varies most.")
    if law is not None:
        best = PosteriorInverse(campaign.model, prior=0.1, noise=0.0).fit_transform(campaign.test[1])
        left = mape(campaign.test[1], evaluate(campaign.model, best)).mean()
        print(
            f"The best parameters for each later row would leave an error of {left:.2g} %. 20 °C beyond the data, the"
        )
        print(f"truth changes by {beyond(law, T, 1):.1f} % (hotter) and {beyond(law, T, -1):.1f} % (colder).")


def averaged(tables):
    """Mean of the tables of several seeds, and the standard deviation of their first column."""
    stacked = pd.concat(tables).groupby(level="regressor", sort=False)
    table = stacked.mean()
    table.insert(1, "± over seeds", stacked[table.columns[0]].std(ddof=0))
    return table


def find(path):
    """The file of Z24's data at a path, a file or a folder, or None."""
    return next((file for file in (path, *(path / name for name in Z24_FILES)) if file.is_file()), None)
