"""A truss whose steel follows the air with inertia, and the detector that ``plot_detector_tuning.py`` tunes."""

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign, steel_modulus
from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

PER_DAY = 8  # records
LIMIT = 0.02  # of false alarms
GRID = {
    "regressor__lagfeatures__lags": [1, 4, 8],
    "regimes": [None, ("T2", 5.0)],  # in degrees Celsius
    "window": [None, "24h"],
}


def true_year(seed, damages=()):
    """Air temperatures of a year, and frequencies of the truss with each damage, all with the same noise.

    The steel follows the air with a half-life of eight hours; below 5 degrees, frequencies scatter by 2 % in place of
    0.7 %.
    """
    random = np.random.RandomState(seed)
    campaign = make_truss_campaign(samples_per_year=365 * PER_DAY, samples_per_day=PER_DAY, random_state=random)
    air, columns = campaign.temperatures, campaign.frequencies.columns
    steel = air.ewm(halflife=8 / 24 * PER_DAY).mean()
    cold = steel.mean(axis=1).to_numpy()[:, np.newaxis] < 5
    noise = np.where(cold, 0.02, 0.007) * random.standard_normal(campaign.frequencies.shape)
    clean = [campaign.model.damaged(damage).frequencies(steel_modulus(steel)) for damage in damages]
    return air, [pd.DataFrame(each * (1 + noise), air.index, columns) for each in clean]


def fitted_chain(T, F, seed=0):
    """A chain whose mapper sees the temperatures of a day."""
    mapper = make_pipeline(LagFeatures(8), TemperatureMapper())
    return DataInformedFEM(make_truss(), mapper=mapper, random_state=seed).fit(T, F)


def detector(targets):
    """Before it is tuned: one lag, one regime for all weather, single records."""
    regression = make_pipeline(LagFeatures(1), TemperatureMapper(LinearRegression()))
    return CompensatedDetector(MahalanobisDetector(), regression, targets=targets, regimes=None)


def true_score(fitted, T, tables):
    """Share of damaged true records found at the limit, mean over their tables, and false alarms; healthy ones first.

    As in the score of a task, the threshold is raised where more healthy records than the limit exceed it.
    """
    healthy, *damaged = (fitted.decision_function(T.join(F)) for F in tables)
    known = np.sort(healthy[~np.isnan(healthy)])
    limit = min(known[int(LIMIT * len(known))], 0)
    return np.mean([np.mean(each < limit) for each in damaged]), np.mean(known < 0)
