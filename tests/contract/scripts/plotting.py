import numpy as np

from skthermo.datasets import make_truss, truss_structure
from skthermo.detection import DirectionalDetector, MahalanobisDetector
from skthermo.plotting import DamageIndexDisplay, DetectorsDisplay, PODCurveDisplay, PredictionDisplay, StructureDisplay
from skthermo.studies import DetectabilityStudy, sweep
from tests.contract.truss import campaign, chain


def plotting_detectors_and_curves():
    """What figures of a study show: bars of detectors, and a curve with its marks."""
    fem = chain()
    scenarios = sweep(fem, (0.1, 0.2, 0.3), ["bottom"])
    detectors = {name: MahalanobisDetector(threshold=name) for name in ("conformal", "quantile")}
    study = DetectabilityStudy(fem, detectors, scenarios, n_repeats=2, uncertainty="noise", random_state=0)
    study.run(campaign().temperatures)
    bars = DetectorsDisplay.from_estimator(study)
    curve = PODCurveDisplay.from_estimator(study, "bottom", detector="conformal")
    return {
        "labels": sorted({"conformal", "quantile"} & {text.get_text() for text in bars.axes_[0].get_yticklabels()}),
        "marks": sorted(curve.marks_),
        "rises": bool((np.diff(curve.line_.get_ydata()) >= -1e-9).all()),
        "axes": [curve.ax_.get_xlabel(), curve.ax_.get_ylabel()],
    }


def plotting_index_and_predictions():
    """What figures of indices and of predictions show: their lines, bands and labels."""
    year, later = campaign(), campaign(1)
    detector = MahalanobisDetector().fit(year.frequencies)
    index = DamageIndexDisplay.from_estimator(detector, {"healthy": later.frequencies, "low": 0.97 * later.frequencies})
    predicted = PredictionDisplay.from_estimator(chain(), later.temperatures, later.frequencies, confidence=0.9)
    drawn = [line.get_ydata() for line in index.threshold_lines_]
    return {
        "threshold": float(np.max(drawn[0])) / detector.threshold_,
        "label": "damage index" in index.ax_.get_ylabel(),
        "panels": len(predicted.axes_),
        "measured": predicted.measured.iloc[0],
        "inside": ((predicted.lowest < predicted.measured) & (predicted.measured < predicted.highest)).mean(),
    }, {"inside": {"atol": 0.05}}


def plotting_structures():
    """A structure in the colours of its groups."""
    errors = {"bottom": 0.2, "top": 0.5, "diagonal": 1.4}
    display = StructureDisplay.from_structure(truss_structure(), errors, label="error (%)")
    detector = DirectionalDetector(make_truss()).fit(campaign().frequencies)
    smallest = StructureDisplay.from_estimator(detector, truss_structure())
    return {
        "label": display.label,
        "limits": display.members_["lines"].get_clim(),
        "members": len(display.members_["lines"].get_segments()),
        "smallest": type(smallest).__name__,
    }
