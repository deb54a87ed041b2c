"""A chain that has learned from a healthy year predicts another one."""

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.metrics import mape
from skthermo.surrogate import DataInformedFEM

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
predicted = fem.predict(later.temperatures)
RESULTS = {
    "columns": list(predicted),
    "predicted": predicted[::73],
    "mape": mape(later.clean_frequencies, predicted),
    "parameters": fem.predict_parameters(later.temperatures).mean()[["bottom", "top", "diagonal"]],
    "noise": fem.noise_,
    "score": fem.score(later.temperatures, later.frequencies),
    "trained": int(fem.report_.rows.trained),
    "index": bool((predicted.index == later.temperatures.index).all()),
}
TOLERANCES = {
    "*": {"rtol": 0.003},
    "mape": {"atol": 0.05},
    "parameters": {"rtol": 0.01},
    "noise": {"rtol": 0.1},
    "score": {"atol": 0.03},
}
