"""Records, detectors and studies of the truss that tests of studies share."""

from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import CompensatedDetector, MahalanobisDetector, TemperatureCompensator
from skthermo.studies import DetectabilityStudy

YEAR, LATER = (make_truss_campaign(random_state=seed) for seed in (0, 1))
WEATHER = LATER.temperatures[::3]
SIDE_BY_SIDE = YEAR.temperatures.join(YEAR.frequencies)
MODES = list(YEAR.frequencies)

WITHIN = {"rtol": 0, "atol": 2e-3}
"""Of damage indices: surfaces err by 4e-6, a 2500th of the noise, in each of six modes."""


def compensated(last=None):
    """A detector that compensates for temperature by linear regression."""
    return make_pipeline(TemperatureCompensator(LinearRegression(), targets=MODES), last or MahalanobisDetector())


def windowed(window=None, regression=None, targets=MODES, **options):
    """A detector of trailing means over a window of what linear regression leaves."""
    regression = LinearRegression() if regression is None else regression
    options = {"detector": MahalanobisDetector(), "regimes": None} | options
    return CompensatedDetector(regressor=regression, targets=targets, window=window, **options)


def study_of(fem, detectors, scenarios, **options):
    """A study of two repeats with 1 % of noise alone, unless asked otherwise."""
    options = {"n_repeats": 2, "random_state": 0, "noise": 0.01, "uncertainty": "noise"} | options
    return DetectabilityStudy(fem, detectors, scenarios, **options)


def ran(fem, scenarios, detectors=None, T=WEATHER, **options):
    """Such a study, of the distance alone unless others are named, that has been run."""
    study = study_of(fem, MahalanobisDetector() if detectors is None else detectors, scenarios, **options)
    study.run(T)
    return study
