"""Monitoring and fleets: valid calls, with bad values of their arguments."""

from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo import monitoring
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from tests.bad_input.examples import BOTH, CHAIN, MODES, F, T
from tests.bad_input.registry import NOT_CALLED, use
from tests.bad_input.values import bad, durations, flag, frequencies, instead, names, number, weather

DETECTOR = make_pipeline(TemperatureCompensator(Ridge(), targets=MODES), MahalanobisDetector())


def monitored(X, **values):
    return monitoring.Monitor(**values).fit(X).update(X[:0])


use(
    "monitoring.Monitor",
    monitored,
    usual="random_state",
    detector=(DETECTOR, instead(DETECTOR.fit)),
    targets=(MODES, names(MODES, "None")),
    max_delay=("7D", durations("zero")),
    retention=("400D", durations()),
    false_alarms_per_year=(1.0, number(0, -1)),
    persistence=(3, number(0, -1, 1.5)),
    direction=("both", bad("up", 3, None, True)),
    sensors=(True, flag()),
    X=(BOTH, frequencies(BOTH, in_hertz=False, fixed=False, rows=False, fitting=True)),
)
use(
    "monitoring.track_parameters",
    lambda **a: monitoring.track_parameters(**a).rates,
    usual="random_state",
    fem=(CHAIN, instead()),
    T=(T, weather(T, rows=True)),
    F=(F, frequencies(F, rows=True)),
    groups=(["top"], names(["top"], "None")),
    freq=("1D", durations("half", "negative number")),
    significance=(0.01, number(0, 1, -0.1)),
)
NOT_CALLED |= {
    "monitoring.MonitorStatus": "made by a monitor's status",
    "monitoring.ParameterHistory": "made by track_parameters",
    "monitoring.Retraining": "made by a monitor's refit",
}
