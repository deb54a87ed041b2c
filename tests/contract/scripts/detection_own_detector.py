"""A detector of one's own: three methods."""

import numpy as np

from skthermo.datasets import make_truss_campaign
from skthermo.detection import DamageDetector


class LargestDeviation(DamageDetector):
    def _learn(self, F, times):
        self.mean_, self.std_ = np.nanmean(F, axis=0), np.nanstd(F, axis=0)
        return self._index(F)

    def _limit(self, index):
        return np.quantile(index, 1 - self.contamination)

    def _index(self, F):
        return np.fmax.reduce(np.abs(F - self.mean_) / self.std_, axis=1)


year = make_truss_campaign(random_state=0)
detector = LargestDeviation().fit(year.frequencies)
RESULTS = {"alarms": float((detector.predict(year.frequencies) == -1).mean())}
TOLERANCES = {"alarms": {"atol": 0.005}}
