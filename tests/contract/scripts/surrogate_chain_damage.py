"""Damaged records of a chain, with noise as its records have it or as asked for."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.metrics import mape
from skthermo.surrogate import DataInformedFEM

year = make_truss_campaign(random_state=0)
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
later = make_truss_campaign(damage={"bottom": 0.5}, random_state=1)
T = later.temperatures
damaged = fem.simulate(T, damage={"bottom": 0.5})
noisy = fem.simulate(T, damage={"bottom": 0.5}, noise="fitted", random_state=0)
known = fem.simulate(T, noise=0.01, random_state=0)
RESULTS = {
    "damaged": damaged.mean(),
    "mape": mape(later.clean_frequencies, damaged),
    "scatter": (noisy / damaged).std(),
    "scatter asked for": (known / fem.simulate(T)).std(),
    "healthy": bool((fem.simulate(T) - fem.predict(T)).abs().max().max() < 1e-9),
    "again": bool(noisy.equals(fem.simulate(T, damage={"bottom": 0.5}, noise="fitted", random_state=0))),
}
TOLERANCES = {
    "*": {"rtol": 0.003},
    "mape": {"atol": 0.1},
    "scatter": {"rtol": 0.12},
    "scatter asked for": {"rtol": 0.1},
}
