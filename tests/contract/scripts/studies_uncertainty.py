"""Bands that hold the error of the baseline, the weather and the model."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.studies import DetectabilityStudy
from skthermo.surrogate import DataInformedFEM

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
options = {"n_repeats": 3, "n_replicates": 4, "random_state": 0}
study = DetectabilityStudy(fem, MahalanobisDetector(), [{}, {"bottom": 0.3}], **options)
results = study.run(later.temperatures)
RESULTS = {
    "rates": results["rate"],
    "wider": bool((results["pi_high"] - results["pi_low"] >= 0).all()),
    "parts": bool(study.uncertainty_.loc[:, "together"].ge(0).all()),
}
TOLERANCES = {"rates": {"atol": 0.05}}
