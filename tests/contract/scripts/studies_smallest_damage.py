"""How small a loss is found: rates by severity, the smallest damage, a curve."""

from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
detector = make_pipeline(TemperatureCompensator(Ridge(), targets=list(year.frequencies)), MahalanobisDetector())
scenarios = sweep(fem, (0.05, 0.1, 0.15, 0.2), ["bottom"])
study = DetectabilityStudy(fem, {"ridge": detector}, scenarios, n_repeats=4, uncertainty="noise", random_state=0)
results = study.run(later.temperatures)
smallest = study.minimum_detectable_damage()
RESULTS = {
    "scenarios": list(results["scenario"]),
    "rates": results["rate"],
    "inside": bool(((results["ci_low"] <= results["rate"]) & (results["rate"] <= results["ci_high"])).all()),
    "smallest": float(smallest["mdd"].iloc[0]),
    "a90": study.pod_curve("bottom", log=True).a90,
    "found": [study.is_undetected("bottom"), study.detector_name()],
}
TOLERANCES = {"rates": {"atol": 0.05}, "smallest": {"atol": 0.055}, "a90": {"atol": 0.015}}
