"""What figures of a study show: bars of detectors, and a curve with its marks."""

import matplotlib as mpl
import numpy as np

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.plotting import DetectorsDisplay, PODCurveDisplay
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM

mpl.use("Agg")
year = make_truss_campaign(random_state=0)
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
scenarios = sweep(fem, (0.1, 0.2, 0.3), ["bottom"])
detectors = {name: MahalanobisDetector(threshold=name) for name in ("conformal", "quantile")}
study = DetectabilityStudy(fem, detectors, scenarios, n_repeats=2, uncertainty="noise", random_state=0)
study.run(year.temperatures)
bars = DetectorsDisplay.from_estimator(study)
curve = PODCurveDisplay.from_estimator(study, "bottom", detector="conformal")
RESULTS = {
    "labels": sorted({"conformal", "quantile"} & {text.get_text() for text in bars.axes_[0].get_yticklabels()}),
    "marks": sorted(curve.marks_),
    "rises": bool((np.diff(curve.line_.get_ydata()) >= -1e-9).all()),
    "axes": [curve.ax_.get_xlabel(), curve.ax_.get_ylabel()],
}
mpl.pyplot.close("all")
