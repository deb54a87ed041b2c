"""Piecewise-linear features go on straight outside the records."""

import numpy as np
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.preprocessing import HingeFeatures

T = np.linspace(-10.0, 10.0, 41)[:, np.newaxis]
frequency = 4.0 + 0.05 * np.maximum(-T[:, 0], 0.0)
lines = make_pipeline(HingeFeatures(n_knots=1), LinearRegression()).fit(T, frequency)
RESULTS = {"outside": lines.predict([[-20.0], [20.0]]), "knots": HingeFeatures(4).fit(T).knots_}
