"""
Detectors of the field, ranked by simulation
============================================

Which detector suits a bridge? The literature has many: some see frequencies only, others temperatures beside them. A
chain that has learned the bridge simulates the damage that is feared, and each detector evaluates the same records.
Here the truth is known: the 28-bar truss, whose thermo-mechanical law gives true records beside the simulated ones.

Run it with ``python examples/plot_detectors.py``. It needs :download:`detector_recipes.py` and
:download:`page_recipes.py` beside it, and statsmodels for cointegration.
"""

# sphinx_gallery_thumbnail_number = 1

import warnings

import matplotlib.pyplot as plt
from detector_recipes import field_detectors
from page_recipes import command_line, save_figures
from sklearn.metrics import RocCurveDisplay

from skthermo.datasets import make_truss, make_truss_campaign, steel_modulus
from skthermo.fem import add_noise
from skthermo.plotting import DetectorsDisplay
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM

options = command_line().parse_args()
year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
baseline = year.temperatures.join(year.frequencies)
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)

# %%
# The detectors
# -------------
# Those named "raw" see frequencies only: Mahalanobis distance, distance to the 20th nearest record of the baseline,
# isolation forest, principal components left out, cointegration and others. The rest see residuals of a regression on
# temperatures. :class:`~skthermo.detection.OutlierDetector` and :class:`~skthermo.detection.MahalanobisDetector` set
# every threshold by records that the detector has not learned, so that each keeps the 2 % of false alarms that it is
# asked for. (Boosted trees are left out here, because they take most of the time.)

detectors = {name: one for name, one in field_detectors(list(year.frequencies)).items() if "trees" not in name}
print(f"{len(detectors)} detectors:", *detectors, sep="\n")

# %%
# One simulation, evaluated by all
# --------------------------------
# A :class:`~skthermo.studies.DetectabilityStudy` simulates each scenario once in every repeat. ``reference`` gives it
# true records, which a real bridge does not have.

scenarios = sweep(fem, (0.05, 0.1, 0.2), groups=["bottom", "diagonal"])
clean = {one.name: later.model.damaged(one.damage).frequencies(later.theta) for one in scenarios}


def truth(scenario, seed):
    """Records of the thermo-mechanical law with 1 % noise."""
    return add_noise(clean[scenario.name], 0.01, random_state=seed)


study = DetectabilityStudy(fem, detectors, scenarios, n_repeats=5, random_state=0, uncertainty="noise")
study.run(later.temperatures, baseline, reference=truth)
ranking = study.ranking(max_false_alarms=0.03)
print((100 * ranking[["false_alarms", "pod", "pod_at_equal_pfa", "pod_deficit"]]).round(1).to_string())

# %%
# The order by simulated records. Detectors whose difference from the best may be chance are not significantly worse.

DetectorsDisplay.from_estimator(study, max_false_alarms=0.03)

# %%
# Damage found over false alarms, for all thresholds.

few = [ranking.index[0], "raw, 20 neighbours", "raw, isolation forest", "raw, less 2 components", "raw, cointegration"]
with plt.style.context("tableau-colorblind10"):
    ax = plt.figure(figsize=(6, 5), layout="constrained").add_subplot()
for name in few:
    RocCurveDisplay.from_predictions(*study.labelled_scores(name), name=name, ax=ax)

# %%
# Would truth have chosen the same?
# ---------------------------------
# Measured rates, here those of true records, beside simulated ones. Found damage agrees, and so does its order. False
# alarms are more than simulated: the simulated noise is drawn from residuals of the baseline, and the detectors have
# learned that very baseline. Leave room below the limit.

results = study.results_
DetectorsDisplay.from_predictions(results[results["scenario"].isin(["healthy", "bottom 10 %", "diagonal 5 %"])])
true = study.ranking(max_false_alarms=0.03, source="reference")
best = true.loc[ranking.index[0], "pod"]
print(f"first by simulation: {ranking.index[0]}, which finds {best:.1%} of the true damaged records")
print(f"first by truth: {true.index[0]}, {true['pod'].iloc[0]:.1%}")
print(f"rank correlation of damage found: {true['pod'].corr(ranking['pod'], method='spearman'):.2f}")

# %%
# Weather that the baseline never saw
# -----------------------------------
# Some of them in a year that is 10 °C colder. Neighbours and forests find frequencies there that no record of the
# baseline had, and call them damage. Principal components left out and cointegration hold as long as frequencies move
# together as before. The simulation predicts that, before the cold year comes. It favours piecewise-linear regression,
# however: the chain, too, is piecewise-linear where it has no records, and so cannot know that they err there.

cold = later.temperatures - 10
clean_cold = later.model.frequencies(steel_modulus(cold))
colder = DetectabilityStudy(
    fem, {name: detectors[name] for name in few}, scenarios[:1], n_repeats=5, random_state=0, uncertainty="noise"
)
with warnings.catch_warnings():
    warnings.filterwarnings("ignore", ".*other-weather")  # as they are meant to be
    colder.run(cold, baseline, reference=lambda scenario, seed: add_noise(clean_cold, 0.01, random_state=seed))
rates = colder.results_.pivot(index="detector", columns="source", values="rate").loc[few]
print((100 * rates.assign(**{"not colder": ranking["false_alarms"]})).round(1).to_string())

save_figures(options.figures)
