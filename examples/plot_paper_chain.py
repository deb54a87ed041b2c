"""
The paper's own chain on its truss
==================================

Section 3 of Kamali, Ceravolo & Marzani (2026) with their own choices, networks and all:
:func:`~skthermo.surrogate.paper_chain`. :doc:`plot_truss_study` has the same study with the choices of skthermo.

Run it with ``python examples/plot_paper_chain.py``, which takes some ten seconds. It needs
:download:`truss_recipes.py` and :download:`page_recipes.py` beside it. All tables: :doc:`/accuracy_paper`.
"""

import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures
from truss_recipes import GROUPS, NOISE, papers_name

from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
from skthermo.detection import MahalanobisDetector
from skthermo.fem import add_noise, sample
from skthermo.plotting import StructureDisplay
from skthermo.studies import sweep
from skthermo.surrogate import paper_chain

options = command_line().parse_args()

# %%
# Two networks
# ------------
# M1 learns 1000 simulations within 20 % of the nominal moduli, from frequencies to moduli; M2 learns a healthy year,
# from temperatures to the moduli that M1 finds in it. Each network holds out a fifth of its rows, here with R2 of

year = make_truss_campaign(noise=NOISE, random_state=0)
fem = paper_chain(make_truss(), bounds=0.2, random_state=0).fit(year.temperatures, year.frequencies)
for name, part in {"M1": fem.inverse_, "M2": fem.mapper_}.items():
    print(f"{name}: {part.regressor_.validation_score_:.2f}")

# %%
# M2's is low because the moduli that M1 finds in noisy frequencies are mostly noise.
#
# Errors of M1 by member
# ----------------------
# A counterpart of Fig. 5: root mean squares of the errors of M1 on new simulations without noise, in GPa. Verticals,
# which hardly move the six modes, have the largest.

test = sample(make_truss(), 0.2, 200, random_state=1)
found = fem.inverse_.transform(pd.DataFrame(test.frequencies, columns=list(year.frequencies)))
errors = 210 * np.sqrt(((found - test.theta) ** 2).mean())
print(errors.round(1).to_string())
StructureDisplay.from_structure(truss_structure(), errors.to_dict(), label="RMSE of M1 (GPa)")

# %%
# Alarms, data-informed and true
# ------------------------------
# Table 3: the Mahalanobis distance of raw frequencies from the healthy year, and the threshold that 98 % of its records
# stay below, in another year. In percent; one realisation, as the paper's.

later = make_truss_campaign(noise=NOISE, random_state=1)
detector = MahalanobisDetector(threshold="quantile").fit(year.frequencies)
rows = {}
for scenario in sweep(fem, (0.1, 0.2, 0.3), GROUPS):
    clean = later.model.damaged(scenario.damage).frequencies(later.theta)
    records = {
        "thermo-mechanical": add_noise(clean, NOISE, random_state=2),
        "data-informed": fem.simulate(later.temperatures, damage=scenario.damage, noise=NOISE, random_state=3),
    }
    columns = list(year.frequencies)
    tables = {name: pd.DataFrame(np.asarray(table), columns=columns) for name, table in records.items()}
    alarms = {name: detector.predict(table) == -1 for name, table in tables.items()}
    rows[papers_name(scenario.name)] = {name: 100 * found.mean() for name, found in alarms.items()}
print(pd.DataFrame(rows).T.round(1).to_string())

save_figures(options.figures)
