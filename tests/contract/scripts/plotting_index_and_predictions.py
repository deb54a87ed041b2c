"""What figures of indices and of predictions show: their lines, bands and labels."""

import matplotlib as mpl
import numpy as np

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.plotting import DamageIndexDisplay, PredictionDisplay
from skthermo.surrogate import DataInformedFEM

mpl.use("Agg")
year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
detector = MahalanobisDetector().fit(year.frequencies)
index = DamageIndexDisplay.from_estimator(detector, {"healthy": later.frequencies, "low": 0.97 * later.frequencies})
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
predicted = PredictionDisplay.from_estimator(fem, later.temperatures, later.frequencies, confidence=0.9)
drawn = [line.get_ydata() for line in index.threshold_lines_]
RESULTS = {
    "threshold": float(np.max(drawn[0])) / detector.threshold_,
    "label": "damage index" in index.ax_.get_ylabel(),
    "panels": len(predicted.axes_),
    "measured": predicted.measured.iloc[0],
    "inside": ((predicted.lowest < predicted.measured) & (predicted.measured < predicted.highest)).mean(),
}
TOLERANCES = {"inside": {"atol": 0.05}}
mpl.pyplot.close("all")
