"""
A report for the owner of a bridge
==================================

A truss was monitored for a year. The FE model learns how temperature moves its frequencies, a study simulates damage of
three groups of members, and sixty later days, on which the lower chord has lost a quarter of its stiffness, are
compared with what the healthy truss would do. One HTML file says in plain sentences what came out of it, for readers
who are not engineers.

Run it with ``python examples/plot_owner_report.py``; the report goes to the folder ``figures``. It needs
:download:`page_recipes.py` beside it. The guide is :doc:`/guide/report`.
"""

from page_recipes import command_line, save_figures

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.plotting import DetectorsDisplay, PODCurveDisplay
from skthermo.reporting import owner_report
from skthermo.studies import DetectabilityStudy, identify_damage, sweep
from skthermo.surrogate import DataInformedFEM

options = command_line().parse_args()
GROUPS = ["bottom", "top", "diagonal"]

# %%
# A year of monitoring teaches the FE model
# -----------------------------------------

year = make_truss_campaign(random_state=0)
fem = DataInformedFEM(make_truss(), random_state=0)
fem.fit(year.temperatures, year.frequencies)

# %%
# What would be found?
# --------------------
# Damage of 10 to 30 % is simulated in each group, in the weather of that year. The truth is known for this truss, and
# stands beside the simulations as the reference; with your own bridge you leave it out.


def true_records(scenario, seed):
    """Records of the true truss in the same weather, with which simulations are compared."""
    return make_truss_campaign(damage=dict(scenario.damage), random_state=seed).frequencies.to_numpy()


scenarios = sweep(fem, (0.1, 0.15, 0.2, 0.25, 0.3), GROUPS)
study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=10, random_state=0, uncertainty="noise")
study.run(year.temperatures, reference=true_records)
print(study.minimum_detectable_damage())
PODCurveDisplay.from_predictions(study.pod_curve("bottom"), label="damage of the lower chord")

# %%
# What has happened?
# ------------------
# On sixty later days the frequencies are lower than the weather explains. :func:`~skthermo.studies.identify_damage`
# looks for the damage that explains the shifts. The lower chord has in truth lost 25 % of its stiffness.

later = make_truss_campaign(damage={"bottom": 0.25}, random_state=1)
identified = identify_damage(fem, later.temperatures[:60], later.frequencies[:60], GROUPS, random_state=0)
print(identified.summary())
DetectorsDisplay.from_predictions(identified.table)
DetectorsDisplay.from_predictions(identified.shifts)

# %%
# The page for the owner
# ----------------------
# :func:`~skthermo.reporting.owner_report` writes one HTML file that needs nothing else: it can be sent by e-mail and
# printed.

options.figures.mkdir(parents=True, exist_ok=True)
path = owner_report(
    study, options.figures / "truss_report.html", identified=identified, title="Monitoring of the truss bridge"
)
print(f"{path}: {path.stat().st_size / 1e6:.1f} MB")

# %%
# It begins like this:
#
# .. image:: /images/owner_report.png
#    :alt: Beginning of the page: what is damaged, the smallest damage that would be detected reliably, false alarms and
#          times to detection, in plain sentences

save_figures(options.figures)
