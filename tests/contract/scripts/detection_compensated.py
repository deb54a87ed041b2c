"""A regression removes the temperature; the Mahalanobis distance and both kinds of directions find 8 % of a chord.

The rate of the model is of 0.3, which looks for losses of section too, and so finds those of stiffness less often.
"""

from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import DirectionalDetector, MahalanobisDetector, TemperatureCompensator
from skthermo.surrogate import TemperatureMapper

healthy, other, damaged = (
    campaign.temperatures.join(campaign.frequencies)
    for campaign in (
        make_truss_campaign(random_state=0),
        make_truss_campaign(random_state=1),
        make_truss_campaign(damage={"bottom": 0.08}, random_state=0),
    )
)
regression = TemperatureCompensator(TemperatureMapper(), targets=[f"f{n}" for n in range(1, 7)])
detectors = {
    "any": MahalanobisDetector(),
    "softening": DirectionalDetector(),
    "model": DirectionalDetector(make_truss()),
}
fitted = {name: make_pipeline(regression, detector).fit(healthy) for name, detector in detectors.items()}
RESULTS = {
    "false alarms": {name: float((one.predict(other) == -1).mean()) for name, one in fitted.items()},
    "found": {name: float((one.predict(damaged) == -1).mean()) for name, one in fitted.items()},
}
TOLERANCES = {"false alarms": {"atol": 0.03}, "found": {"atol": 0.06}}
