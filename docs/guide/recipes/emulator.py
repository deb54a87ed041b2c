import numpy as np
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.fem import CallableModel, sample

runs = sample(model, 0.3, 200, method="lhs", random_state=0)  # of the program; kept in its cache
cubic = make_pipeline(PolynomialFeatures(3), LinearRegression())
curve = TransformedTargetRegressor(cubic, func=np.log, inverse_func=np.exp).fit(runs.theta, runs.frequencies)
fast = CallableModel(curve.predict, model.parameter_names, model.n_modes, vectorized=True)
