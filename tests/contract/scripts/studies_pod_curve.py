"""A curve of detection over severity, with the 90 % severity and its bound."""

from skthermo.studies import pod_curve

curves = {log: pod_curve([0.1, 0.2, 0.3, 0.4], [3, 12, 19, 20], [20, 20, 20, 20], log=log) for log in (False, True)}
RESULTS = {
    "a50": [curve.a50 for curve in curves.values()],
    "a90": [curve.a90 for curve in curves.values()],
    "a90/95": [curve.a90_95 for curve in curves.values()],
    "curve": curves[True].predict([0.1, 0.2, 0.3])[0],
    "severity": curves[True].severity_at(0.8),
}
TOLERANCES = {"*": {"rtol": 1e-3}}
