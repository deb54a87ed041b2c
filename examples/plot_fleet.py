"""
A new bridge learns from a fleet
================================

A monitoring system was switched on in June. What its bridge does in frost, nobody has measured yet; what other bridges
do in frost, the owner knows. Sixteen trusses and girders with a year of records each are fitted, and four new bridges
with 30 days of June predict their next year, alone and with the mappers of the other bridges of their kind. The fleet
is synthetic, so that the truth is known: every bridge has its own span, material, climate and thermometers, and an FE
model that is a little wrong.

Run it with ``python examples/plot_fleet.py``; the figures go to the folder ``figures``. It needs
:download:`page_recipes.py` beside it. The guide is :doc:`/guide/many_bridges`.
"""

from functools import partial

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_fleet
from skthermo.metrics import mape
from skthermo.monitoring import fit_fleet
from skthermo.plotting import PredictionDisplay
from skthermo.preprocessing import SensorMeans
from skthermo.surrogate import DataInformedFEM, FleetMapper, TemperatureMapper

options = command_line().parse_args()

# %%
# Sixteen bridges with a year of records
# --------------------------------------
# Thermometers differ from bridge to bridge: the means of those in the air and of those in the deck are inputs that all
# bridges have. Chains and records, here without gaps and outliers, are made in the workers.

campaign = make_fleet(20, kinds=("truss", "girder"), random_state=0)
known, new = list(campaign)[:16], list(campaign)[16:]


def make_chain(name, mapper=None):
    bridge = campaign[name]
    mapper = make_pipeline(SensorMeans(bridge.roles), TemperatureMapper() if mapper is None else mapper)
    return DataInformedFEM(bridge.model, mapper=mapper, random_state=0)


def load_records(name, days=365, start="2025-01-01"):
    records = campaign[name].records(days, start, gaps=0, outliers=0)
    return records.temperatures, records.frequencies


fleet = fit_fleet(
    {name: partial(make_chain, name) for name in known}, {name: partial(load_records, name) for name in known}
)
print(fleet.summary())

mappers = {kind: [] for kind in ("truss", "girder")}
for name, chain in fleet.chains.items():
    mappers[campaign[name].kind].append(chain.mapper_[-1])

# %%
# Four new bridges
# ----------------
# Mean error in percent of the frequencies of 2026, without their noise: learned from 30 days of June 2025 alone, from
# these days and the fleet, and from an own full year. One of the four has a thermal law of its own, as one bridge in
# twenty of this fleet has.

chains, errors = {}, {}
for name in new:
    later = campaign[name].records(365, "2026-01-01", gaps=0, outliers=0)
    june, year = load_records(name, 30, "2025-06-01"), load_records(name)
    chains[name] = {
        "30 days alone": make_chain(name).fit(*june),
        "30 days and the fleet": make_chain(name, FleetMapper(mappers[campaign[name].kind])).fit(*june),
        "own full year": make_chain(name).fit(*year),
    }
    errors[f"{name} ({campaign[name].kind})"] = {
        label: mape(later.clean_frequencies, chain.predict(later.temperatures)).mean()
        for label, chain in chains[name].items()
    } | {"atypical": campaign[name].is_atypical}
print(pd.DataFrame.from_dict(errors, orient="index").round(2).to_string())

# %%
# What the fleet adds
# -------------------
# Change of two stiffnesses of a new girder with temperature, from their values at the mean temperature of June. The
# band is two standard deviations on either side. Outside the temperatures of its own records (grey), predictions rely
# on the other girders.

girder = next(name for name in new if campaign[name].kind == "girder")
mapper = chains[girder]["30 days and the fleet"].mapper_[-1]
june = np.ravel(load_records(girder, 30, "2025-06-01")[0])
steady = np.linspace(-15, 35, 101)
weather = pd.DataFrame({role: np.append(steady, june.mean()) for role in mapper.feature_names_in_})


def draw_effects(ax, part):
    """Change of a stiffness with temperature: of the other girders and of the new one."""
    for number, other in enumerate(mappers["girder"]):
        theta = other.predict(weather)[part].to_numpy()
        label = "other girders" if number == 0 else None
        ax.plot(steady, 100 * (theta[:-1] / theta[-1] - 1), color="0.6", linewidth=0.7, label=label)
    theta, std = (table[part].to_numpy() for table in mapper.predict(weather, return_std=True))
    low, mean, high = (100 * ((theta + k * std)[:-1] / theta[-1] - 1) for k in (-2, 0, 2))
    ax.fill_between(steady, low, high, color="tab:orange", alpha=0.25, linewidth=0)
    ax.plot(steady, mean, color="tab:orange", label="new girder, ± 2 standard deviations")
    ax.axvspan(june.min(), june.max(), color="0.9", zorder=0, label="its own records")
    change = f"change of {part} stiffness\nfrom its value at {june.mean():.0f} °C (%)"
    ax.set(xlabel="steady temperature (°C)", ylabel=change)
    ax.legend(fontsize="small", frameon=False)


figure, axes = plt.subplots(1, 2, figsize=(11, 4), layout="constrained")
for ax, part in zip(axes, ("deck", "bearings"), strict=True):
    draw_effects(ax, part)

# %%
# The next year
# -------------
# The frequencies rise in frost. Who has seen June only expects that they go on as in June.

later = campaign[girder].records(365, "2026-01-01", gaps=0, outliers=0)
predictions = {label: chain.predict(later.temperatures)[["f1"]] for label, chain in chains[girder].items()}
PredictionDisplay.from_predictions(later.frequencies[["f1"]], predictions)

save_figures(options.figures)
