import numpy as np
from mapie.regression import SplitConformalRegressor
from sklearn.base import BaseEstimator, RegressorMixin


class OneMode(RegressorMixin, BaseEstimator):
    fitted_ = True

    def __init__(self, fem, mode):
        self.fem, self.mode = fem, mode

    def fit(self, X, y):
        return self

    def predict(self, X):
        return np.asarray(self.fem.predict(X))[:, self.mode]


fem.fit(T[:240], F[:240])
conformal = SplitConformalRegressor(OneMode(fem, 0), confidence_level=0.9, prefit=True)
conformal.conformalize(T[240:], F["f1"][240:])
frequency, interval = conformal.predict_interval(later.temperatures)  # interval: (n_samples, 2, 1)
