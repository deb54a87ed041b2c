"""
In service, for years
=====================

A truss is monitored every four hours. Its first year is the baseline. Then a
:class:`~skthermo.monitoring.Monitor` evaluates what comes in day by day, for two years, in which four things happen: a
thermometer dies for ten weeks, another one jumps by 5 °C and is repaired in January, the lower chord loses 1 % of its
stiffness a year, and in the last month the upper chord loses 12 % at once. The page shows what the owner sees of each.

Run it with ``python examples/plot_in_service.py``; figures and the owner's page go to the folder ``figures``. It needs
:download:`page_recipes.py` beside it. The guide is :doc:`/guide/in_service`.
"""

from page_recipes import command_line, save_figures
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import CompensatedDetector, MahalanobisDetector
from skthermo.monitoring import Monitor, load_monitor, track_parameters
from skthermo.plotting import DamageIndexDisplay, PredictionDisplay
from skthermo.preprocessing import HingeFeatures
from skthermo.reporting import owner_report
from skthermo.surrogate import DataInformedFEM

options = command_line().parse_args()
options.figures.mkdir(parents=True, exist_ok=True)

# %%
# Three years of records, of which the truth is known
# ---------------------------------------------------
# The drift goes on in the baseline, too. The noise of neighbouring records is alike, as in reality.

campaign = make_truss_campaign(
    3,
    samples_per_year=6 * 365,
    samples_per_day=6,
    noise=0.005,
    correlation=0.5,
    drift={"bottom": 0.01},
    damage={"top": 0.12},
    damage_from="2027-12-01",
    random_state=0,
)
modes = list(campaign.frequencies)
records = campaign.temperatures.join(campaign.frequencies)
records.loc["2026-04-10":"2026-06-20", "T2"] = float("nan")
records.loc["2026-10-05":"2027-01-20", "T3"] += 5.0
baseline, later = records[:"2025"], records["2026":]

# %%
# A detector, an FE model, a number of false alarms
# -------------------------------------------------
# The detector is any of ``skthermo.detection``: here the Mahalanobis distance of residuals of piecewise-linear
# regression, as means of a day. The chain lets the monitor follow slow drift in the stiffness of the groups. The
# threshold is not a share of the records, but what an owner asks for: one false alarm a year.

fem = DataInformedFEM(make_truss(), random_state=0)
fem.fit(baseline[campaign.temperatures.columns], baseline[modes])
regression = make_pipeline(HingeFeatures(), Ridge())
detector = CompensatedDetector(MahalanobisDetector(), regression, targets=modes, window="1D")
monitor = Monitor(detector, fem=fem, false_alarms_per_year=1)
monitor.fit(baseline)
print(monitor.false_alarm_estimate_)

# %%
# Day by day
# ----------
# :meth:`~skthermo.monitoring.Monitor.update` takes whatever has come since the last call. Once a month, this script
# asks how things are.

for day, new in later.groupby(later.index.normalize()):
    answers = monitor.update(new)
    if day.is_month_end:
        print(f"{day:%Y-%m-%d}: {monitor.status(day).state}, {len(monitor.events_)} events")

# %%
# The last day, again: what was known already is counted and ignored. A saved monitor goes on where it stopped.

monitor.save(options.figures / "truss.joblib")
again = load_monitor(options.figures / "truss.joblib")
again.update(new)
print(again.counts_)

# %%
# What the owner sees
# -------------------
# Two sensors failed, and came back. The thermometers of this truss scatter by several degrees beside each other, so
# that it takes three weeks to see that T3 is 5 °C too high. Alarms of these weeks then become an event of kind "fault".
# The drift is followed, but opens an event, too, and the sudden damage is in alarm within a day.

print(monitor.summary())
print(monitor.events_[["kind", "start", "end", "peak", "modes"]].to_string())
print(monitor.faults_[["column", "kind", "since", "detected", "until"]].to_string())
DamageIndexDisplay.from_estimator(monitor)

# %%
# The page for the owner says it in sentences (:func:`~skthermo.reporting.owner_report`).

path = owner_report(monitor, options.figures / "truss_status.html", title="Truss bridge in service", now=monitor.last_)
print(f"{path.name}: {path.stat().st_size / 1e6:.1f} MB")

# %%
# How fast does it age?
# ---------------------
# :func:`~skthermo.monitoring.track_parameters` looks back over all records until the damage, and separates ageing from
# weather and noise. Changes of stiffness are since the first day. Records of the days on which a sensor failed are left
# out first: this truss's thermometers are so independent of each other that they predict little of one that is missing.

trusted = records[:"2027-11"]
for _, fault in monitor.faults_.iterrows():
    trusted = trusted.drop(trusted[fault["since"] : fault["until"]].index)
history = track_parameters(fem, trusted[list(campaign.temperatures)], trusted[modes])
print(history.summary())
print(history.rates[["per_year", "standard_error", "drifts"]].round(4).to_string())
change = 100 * (history.table - 1)
estimate, *band = (change.xs(side, axis=1, level=1) for side in ("estimate", "ci_low", "ci_high"))
labels = {"labels": ("estimate", ""), "interval_label": "interval, 95 %"}
PredictionDisplay.from_predictions(
    estimate, None, *band, kind="lines", quantity="change of stiffness", unit="%", **labels
)

save_figures(options.figures)
