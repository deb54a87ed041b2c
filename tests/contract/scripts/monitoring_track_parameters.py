"""A chord that loses 2 % a year, looked at after three years."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.monitoring import track_parameters
from skthermo.surrogate import DataInformedFEM

years = make_truss_campaign(3, drift={"bottom": 0.02}, random_state=0)
healthy = make_truss_campaign(3, random_state=0)
found = {}
for name, one in {"ageing": years, "healthy": healthy}.items():
    T, F = one.temperatures, one.frequencies
    fem = DataInformedFEM(make_truss(), random_state=0).fit(T[:365], F[:365])
    found[name] = track_parameters(fem, T, F, freq="7D")
RESULTS = {
    "drifts": {name: bool(one.has_drift) for name, one in found.items()},
    "rate": float(found["ageing"].rates.loc["bottom", "per_year"]),
    "fastest": found["ageing"].rates["per_year"].idxmin(),
    "change": float(found["ageing"].table["bottom", "estimate"].iloc[-1]),
    "summary": "bottom" in found["ageing"].summary(),
}
TOLERANCES = {"rate": {"atol": 0.006}, "change": {"atol": 0.015}}
