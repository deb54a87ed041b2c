"""What a further mode would gain."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.studies import DetectabilityStudy, compare_extensions, sweep
from skthermo.surrogate import DataInformedFEM

year, weather = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1).temperatures
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
options = {"n_repeats": 3, "uncertainty": "noise", "random_state": 0}
study = DetectabilityStudy(fem, MahalanobisDetector(), sweep(fem, (0.1, 0.2, 0.3), ["top"]), **options)
study.run(weather)
table = compare_extensions(study, weather, modes=[6, 8])
RESULTS = {
    "candidates": sorted(table["candidate"]),
    "now": table["mdd_now"].iloc[:1],
    "inside": bool(((table["ci_low"] <= table["gain"]) & (table["gain"] <= table["ci_high"])).all()),
}
TOLERANCES = {"now": {"atol": 0.04}}
