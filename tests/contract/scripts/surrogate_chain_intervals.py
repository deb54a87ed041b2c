"""Standard deviations, intervals and how far a weather is from that of the records."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
T, F = later.temperatures, later.frequencies
lowest, highest = fem.predict_interval(T, confidence=0.9)
hot = T.iloc[:2] + 100
theta = fem.estimate_parameters(F)
RESULTS = {
    "inside": ((lowest < F) & (highest > F)).mean(),
    "width": ((highest - lowest) / F).mean(),
    "known": bool((fem.extrapolation_distance(T).mean() < 0.5).all()),
    "hot": bool((fem.extrapolation_distance(hot).max(axis=1) > 1).all()),
    "estimated": theta.mean()[["bottom", "top", "diagonal"]],
}
TOLERANCES = {"inside": {"atol": 0.05}, "width": {"rtol": 0.12}, "estimated": {"rtol": 0.01}}
