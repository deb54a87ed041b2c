"""Detectors, intervals and surrogates of other packages in this package's chain, on the truss.

    pip install pyod mapie smt
    OMP_NUM_THREADS=1 python tests/benchmarks/other_tools.py

PyOD's nearest neighbours in place of the Mahalanobis distance, on the same residuals, and both beside an
isolation forest on raw frequencies, by their own thresholds and by the one that evaluation-lumo sets, which 1 % of the
training records exceed; MAPIE's split conformal intervals of each frequency, calibrated on a second healthy year,
beside `predict_interval`; SMT's Kriging beside scikit-learn's Gaussian process as inverse surrogate, without refining.
"""

import numpy as np
import pandas as pd
from harness import arguments, compensated, joined, shown
from sklearn.base import BaseEstimator, RegressorMixin
from sklearn.compose import make_column_transformer
from sklearn.ensemble import IsolationForest
from sklearn.gaussian_process import GaussianProcessRegressor
from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import DirectionalDetector, MahalanobisDetector, OutlierDetector
from skthermo.fem import sample
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

CONFIDENCE = 0.9


class OneMode(RegressorMixin, BaseEstimator):
    """One frequency that a fitted chain predicts, as MAPIE takes it."""

    def __init__(self, fem=None, mode=0):
        self.fem = fem
        self.mode = mode

    def fit(self, X, y):
        self.is_fitted_ = True
        return self

    def predict(self, X):
        return np.asarray(self.fem.predict(X))[:, self.mode]


class Kriging(RegressorMixin, BaseEstimator):
    """SMT's Kriging with scikit-learn's methods: one surrogate for each output, as SMT recommends."""

    def fit(self, X, y):
        from smt.surrogate_models import KRG

        self.surrogates_ = []
        for output in np.transpose(y):
            surrogate = KRG(print_global=False, n_start=1, seed=0)
            surrogate.set_training_values(np.asarray(X), output.reshape(-1, 1))
            surrogate.train()
            self.surrogates_.append(surrogate)
        return self

    def predict(self, X):
        return np.hstack([surrogate.predict_values(np.asarray(X)) for surrogate in self.surrogates_])


def records(seed, **damage):
    """A year of temperatures and frequencies side by side."""
    year = make_truss_campaign(damage=damage or None, random_state=seed)
    return joined(year), list(year.frequencies)


def detectors(seed):
    """Alarms without damage, and where the bottom chord has lost 10 and 20 %, in percent of the records."""
    from pyod.models.knn import KNN

    baseline, targets = records(seed)
    found = {}
    raw = make_column_transformer(("passthrough", targets))
    for name, alarm in {
        "compensated, DirectionalDetector": compensated(targets, DirectionalDetector()),
        "compensated, MahalanobisDetector": compensated(targets),
        "compensated, PyOD's KNN": compensated(targets, OutlierDetector(KNN())),
        "raw, MahalanobisDetector": make_pipeline(raw, MahalanobisDetector()),
        "raw, PyOD's KNN of 20": make_pipeline(raw, OutlierDetector(KNN(n_neighbors=20))),
        "raw, isolation forest": make_pipeline(raw, OutlierDetector(IsolationForest(random_state=seed))),
    }.items():
        lumo = np.nanquantile(alarm.fit(baseline).score_samples(baseline), 0.01)
        for severity in (0.0, 0.1, 0.2):
            later = records(1000 + seed, **({"bottom": severity} if severity else {}))[0]
            state = f"{100 * severity:.0f} %" if severity else "no damage"
            found[name, state] = 100 * (alarm.predict(later) == -1).mean()
            if severity < 0.2:
                found[name, f"{state}, 1 % of training"] = 100 * (alarm.score_samples(later) < lumo).mean()
    return pd.Series(found)


def intervals(seed):
    """Share of a later year's frequencies inside intervals of 90 %, mean over modes, in percent."""
    from mapie.regression import SplitConformalRegressor

    train, second, later = (make_truss_campaign(random_state=s) for s in (seed, 1000 + seed, 2000 + seed))
    fem = DataInformedFEM(make_truss(), random_state=0).fit(train.temperatures, train.frequencies)
    measured = later.frequencies.to_numpy()
    bounds = [table.to_numpy() for table in fem.predict_interval(later.temperatures, CONFIDENCE)]
    found = {"predict_interval": bounds}
    both = []
    for mode, name in enumerate(train.frequencies):
        regressor = SplitConformalRegressor(OneMode(fem, mode).fit(None, None), CONFIDENCE, prefit=True)
        regressor.conformalize(second.temperatures, second.frequencies[name])
        both.append(regressor.predict_interval(later.temperatures)[1][:, :, 0])
    found["MAPIE, a second year"] = np.stack(both, axis=2).swapaxes(0, 1)
    shares = {}
    for name, (lowest, highest) in found.items():
        shares[name, "held, %"] = 100 * ((lowest <= measured) & (measured <= highest)).mean()
        shares[name, "mean width, %"] = 100 * ((highest - lowest) / measured).mean()
    return pd.Series(shares)


def surrogates(seed):
    """Mean error of ln theta in percent of inverse surrogates that do not refine."""
    truss, fresh = make_truss(), sample(make_truss(), 0.2, 500, random_state=1000 + seed)
    kernel = ConstantKernel() * RBF(np.ones(6)) + WhiteKernel(noise_level_bounds=(1e-8, 10))
    found = {}
    for name, regressor in {
        "SMT's Kriging": Kriging(),
        "GaussianProcessRegressor": GaussianProcessRegressor(kernel),
    }.items():
        inverse = InverseSurrogate(truss, regressor, bounds=0.2, n_samples=200, random_state=seed).fit()
        found[name, "error, %"] = 100 * np.abs(np.log(inverse.predict(fresh.frequencies) / fresh.theta)).mean()
    return pd.Series(found)


COMPARED = {
    detectors: "Alarms on the truss, % of the records, by what the bottom chord has lost; 2 % false alarms asked for",
    intervals: "Intervals of 90 % on the truss: frequencies of a later year inside, and widths",
    surrogates: "Inverse surrogates of the truss from 200 noise-free simulations, error of ln theta",
}


def main():
    options = arguments(__doc__, seeds=10)
    for compare, title in COMPARED.items():
        found = pd.concat([compare(seed) for seed in range(options.seeds)], axis=1)
        table = found.mean(axis=1).unstack(sort=False).rename_axis("way")
        shown(f"{title}; mean of {options.seeds} realisations", table, 3 if compare is surrogates else 1)


if __name__ == "__main__":
    main()
