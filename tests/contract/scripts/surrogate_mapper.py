"""Temperature to stiffness by the default regression, by one with a standard deviation, and in a grid search."""

import numpy as np
from sklearn.linear_model import BayesianRidge, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline

from skthermo.preprocessing import HingeFeatures
from skthermo.surrogate import TemperatureMapper

T = np.linspace(-10, 40, 50)[:, np.newaxis]
theta = np.exp(-0.004 * T) * np.exp(0.001 * np.random.default_rng(0).normal(size=T.shape))
default = TemperatureMapper(random_state=0).fit(T, theta)
mean, std = TemperatureMapper(BayesianRidge()).fit(T, theta[:, 0]).predict(T, return_std=True)
search = GridSearchCV(
    TemperatureMapper(make_pipeline(HingeFeatures(), Ridge())), {"regressor__hingefeatures__n_knots": [1, 4]}, cv=3
)
RESULTS = {
    "default": default.predict([[20.0], [30.0]]),
    "mean": mean[::10],
    "std": [bool((std > 0).all()), bool((std < 0.01).all())],
    "score": default.score(T, theta),
    "search": search.fit(T, theta).predict([[20.0]]),
}
TOLERANCES = {"*": {"rtol": 2e-3}}
