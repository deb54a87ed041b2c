"""
Z24: alarms that see through the weather
========================================

Below 0 °C the frequencies of the Z24 bridge rise by some 2 % a degree, and scatter far more than in mild weather. A
detector that knows only one spread takes the scatter of frost for that of all days, and is blind to damage that comes
in spring. Here the spread follows the weather as well.

Every detector learns from the first four fifths of the healthy records. The last fifth shows its false alarms, the
records after damage began show what it finds. Neither of the two chooses any setting.

.. note::

   The data belong to KU Leuven and are not part of this package: tables and figures on this page were made once with
   them, by ``python examples/plot_z24_detection.py path/to/z24_monitoring.csv``. :doc:`plot_z24_bridge` says where to
   get them. The page needs :download:`z24_recipes.py` and :download:`page_recipes.py` beside it.
"""

# sphinx_gallery_thumbnail_path = 'images/z24_detection.png'

import warnings

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from page_recipes import save_figures
from sklearn.ensemble import IsolationForest
from sklearn.model_selection import TimeSeriesSplit
from sklearn.pipeline import make_pipeline
from z24_recipes import (
    FREQUENCIES,
    KINDS,
    MODES,
    PAVEMENT,
    PLAIN,
    SCALES,
    WHITENED,
    Records,
    alarm_table,
    alarms,
    boosting,
    bridge_model,
    chain,
    compensate,
    found_by_day,
    plot_kinds,
    read_arguments,
)

from skthermo.detection import (
    FusedDetector,
    MahalanobisDetector,
    OutlierDetector,
    TemperatureCompensator,
    WindowedAlarm,
)
from skthermo.metrics import time_to_detection
from skthermo.plotting import DamageIndexDisplay
from skthermo.surrogate import TemperatureMapper

bridge, folder = read_arguments()
warnings.filterwarnings("ignore", r"\d+ of \d+ rows have temperatures far outside")  # the last table counts them
records = Records.of(bridge)
print(f"Baseline: {len(records.baseline)} healthy records. Judged: {len(records.later)} later healthy ones and the")
print(f"{len(records.damaged)} after damage began. Every detector is asked for 2 % false alarms.")

# %%
# .. code-block:: none
#
#    Baseline: 2240 healthy records. Judged: 560 later healthy ones and the
#    130 after damage began. Every detector is asked for 2 % false alarms.
#
# What a detector sees
# --------------------
# The paper's detector sees raw frequencies. A :class:`~skthermo.detection.TemperatureCompensator` gives it residuals
# instead: what is left of the frequencies when any regressor has explained them by temperatures. With ``scale="local"``
# residuals are divided by their spread in similar weather.

inputs = {("none", "raw frequencies"): records.each(lambda frame: frame[FREQUENCIES])}
compensators = {"broken lines": TemperatureMapper(), "boosted trees": boosting(), "chain": chain(bridge_model())}
for name, estimator in compensators.items():
    for label, scale in SCALES.items():
        inputs[name, label] = compensate(records, estimator, scale)[0]

# %%
# Residuals of the second mode over temperature show why: in frost they scatter several times as much as in mild
# weather.

fig, ax = plt.subplots(figsize=(10, 4.6), layout="constrained")
pavement = records.each(lambda frame: frame[PAVEMENT])
plot_kinds(ax, pavement, inputs["broken lines", PLAIN].each(lambda frame: frame["f2"]), ms=3)
for scale, style, label in (("global", "--", "2 deviations, all weather"), ("local", "-", "2 deviations, by weather")):
    compensator = compensate(records, TemperatureMapper(), scale)[1]
    weather = records.baseline.drop(columns=FREQUENCIES)
    deviation = pd.Series(compensator.spread_.deviations(weather)[:, 1], weather.index)
    deviation = deviation.groupby(pavement.baseline.round()).median()
    ax.plot(2 * deviation, style, color="black", label=label)
    ax.plot(-2 * deviation, style, color="black")
ax.set(xlabel="pavement (°C)", ylabel=f"residual of {MODES[1]} (Hz)")
fig.legend(loc="outside right upper", markerscale=3)

# %%
# .. image:: /images/z24_spread.png
#    :alt: Residuals of the second mode over the temperature of the pavement, with twice the standard deviation of all
#          records and that in similar weather
#
# Alarms
# ------
# In percent of the records, by compensator and by what the detector sees. A
# :class:`~skthermo.detection.FusedDetector` averages the indices of two compensators.

fused = FusedDetector(
    [
        (name, make_pipeline(TemperatureCompensator(part, targets=FREQUENCIES, scale="local"), MahalanobisDetector()))
        for name, part in (("lines", TemperatureMapper()), ("trees", boosting()))
    ]
)
both = alarm_table({("lines and trees", "mean of their indices"): records}, fused)
print(pd.concat([alarm_table(inputs), both]).round(1).to_string())

# %%
# .. code-block:: none
#
#                                                   false alarms  damage found
#    none            raw frequencies                         0.0           0.0
#    broken lines    residuals                               0.0          89.2
#                    residuals whitened by weather           0.9          90.8
#    boosted trees   residuals                               0.2          20.8
#                    residuals whitened by weather           1.1          82.3
#    chain           residuals                               0.0          90.0
#                    residuals whitened by weather           0.7          90.8
#    lines and trees mean of their indices                   0.5          90.8
#
# The damage index over time, for three of them. Raw frequencies hide the damage in the range that frost has opened.
# Residuals show it, and whitened residuals lift nearly all damaged records above the threshold.


def plot_indices(panels, **options):
    """Damage index over time, a panel for each detector and the records that it sees."""
    indices, thresholds = {}, {}
    for title, (detector, seen) in panels.items():
        index = seen.each(detector.fit(seen.baseline).damage_index)
        indices[title] = {label: getattr(index, kind) for kind, (label, _) in KINDS.items()}
        thresholds[title] = detector.threshold_
    options = {"onset": records.onset, "colours": dict(KINDS.values()), **options}
    display = DamageIndexDisplay.from_scenarios(indices, thresholds, **options)
    display.axes_[-1].set_xlabel("time, by the hour counter of the records")


plot_indices(
    {
        "raw frequencies": (MahalanobisDetector(), inputs["none", "raw frequencies"]),
        "residuals of broken lines": (MahalanobisDetector(), inputs["broken lines", PLAIN]),
        "the same, whitened by weather": (MahalanobisDetector(), inputs["broken lines", WHITENED]),
    }
)

# %%
# .. image:: /images/z24_detection.png
#    :alt: Damage index over time in three panels; with whitened residuals, nearly all damaged records lie above the
#          threshold, and healthy ones below it
#
# Does it depend on the threshold or on the detector?
# ---------------------------------------------------
# Whitened residuals, with other thresholds and with an isolation forest of scikit-learn in place of the index:

detectors = {kind: MahalanobisDetector(threshold=kind) for kind in ("quantile", "conformal", "chi2")}
detectors["isolation forest"] = OutlierDetector(IsolationForest(random_state=0))
whitened = {name: found for (name, label), found in inputs.items() if label == WHITENED}
tables = {kind: alarm_table(whitened, detector) for kind, detector in detectors.items()}
print(pd.concat(tables).round(1).to_string())

# %%
# .. code-block:: none
#
#                                    false alarms  damage found
#    quantile         broken lines            1.4          90.8
#                     boosted trees           1.6          86.2
#                     chain                   1.4          90.8
#    conformal        broken lines            0.9          90.8
#                     boosted trees           1.1          82.3
#                     chain                   0.7          90.8
#    chi2             broken lines            6.2          97.7
#                     boosted trees           7.5          91.5
#                     chain                   6.8          97.7
#    isolation forest broken lines            1.2          80.0
#                     boosted trees           2.5          86.9
#                     chain                   1.4          78.5
#
# In which weather?
# -----------------
# Alarms by the baseline's fifths of the pavement's temperature. No baseline record is warmer than the last limit.

pavement = records.baseline[PAVEMENT]
edges = [-np.inf, *pavement.quantile([0.2, 0.4, 0.6, 0.8, 1.0]), np.inf]
classes = records.each(lambda frame: pd.cut(frame[PAVEMENT].to_numpy(), edges, precision=1))
columns = {("records", kind): pd.Series(getattr(classes, kind)).value_counts(sort=False) for kind in KINDS}
for label in SCALES:
    residuals = inputs["broken lines", label]
    detector = MahalanobisDetector().fit(residuals.baseline)
    for kind in KINDS:
        alarm = pd.Series(detector.predict(getattr(residuals, kind)) == -1)
        columns[label, kind] = 100 * alarm.groupby(getattr(classes, kind), observed=False).mean()
print(pd.DataFrame(columns).rename_axis("pavement, °C").round(1).to_string())

# %%
# .. code-block:: none
#
#                  records               residuals               residuals whitened by weather
#                 baseline later damaged  baseline later damaged                      baseline later damaged
#    pavement, °C
#    (-inf, -0.2]      450     0       0       4.0   NaN     NaN                           2.0   NaN     NaN
#    (-0.2, 2.9]       447     0       0       2.9   NaN     NaN                           2.7   NaN     NaN
#    (2.9, 4.9]        447     4       0       0.4   0.0     NaN                           0.9   0.0     NaN
#    (4.9, 6.9]        448    45       0       0.2   0.0     NaN                           0.7   0.0     NaN
#    (6.9, 14.6]       448   204       0       0.0   0.0     NaN                           0.9   0.5     NaN
#    (14.6, inf]         0   307     130       NaN   0.0    89.2                           NaN   1.3    90.8
#
# A day's records together
# ------------------------
# A :class:`~skthermo.detection.WindowedAlarm` judges the records of a day together, and a day by its last window. For
# comparison, one of the compensators has learned forward in time, from the past alone.

forward = compensate(records, TemperatureMapper(), "local", TimeSeriesSplit(5))[0]
seen = {name: inputs[name, WHITENED] for name in ("broken lines", "boosted trees")}
seen["broken lines, forward in time"] = forward
windows = {f"{width}, {rule}": WindowedAlarm(width, rule=rule) for width in ("24h", 24) for rule in ("mean", "m-of-n")}
rows = {}
for name, residuals in seen.items():
    for label, detector in {"single records": MahalanobisDetector(), **windows}.items():
        index = detector.fit(residuals.baseline).damage_index(residuals.stream())
        day = (index > detector.threshold_).groupby(index.index.floor("D")).last()
        healthy = day.index < records.onset.floor("D")
        delay = time_to_detection(index, detector.threshold_, records.onset)
        rows[name, label] = {
            "false days": f"{day[healthy].sum()} of {healthy.sum()}",
            "damaged days found": f"{day[~healthy].sum()} of {(~healthy).sum()}",
            "hours to detection": delay / pd.Timedelta("1h"),
        }
print(pd.DataFrame(rows).T.to_string())

# %%
# .. code-block:: none
#
#                                                 false days damaged days found hours to detection
#    broken lines                  single records    0 of 32            9 of 10               38.0
#                                  24h, mean         0 of 32            8 of 10               52.0
#                                  24h, m-of-n       0 of 32            8 of 10               52.0
#                                  24, mean          0 of 32            7 of 10               82.0
#                                  24, m-of-n        0 of 32            7 of 10               70.0
#    boosted trees                 single records    0 of 32            9 of 10               14.0
#                                  24h, mean         0 of 32            7 of 10               86.0
#                                  24h, m-of-n       0 of 32            3 of 10               86.0
#                                  24, mean          0 of 32            6 of 10               99.0
#                                  24, m-of-n        0 of 32            4 of 10               91.0
#    broken lines, forward in time single records    0 of 32            7 of 10               38.0
#                                  24h, mean         0 of 32            8 of 10               52.0
#                                  24h, m-of-n       0 of 32            8 of 10               52.0
#                                  24, mean          0 of 32            1 of 10               88.0
#                                  24, m-of-n        0 of 32            4 of 10               77.0

plot_indices(
    {
        title: (WindowedAlarm("24h", rule=rule), inputs["broken lines", WHITENED])
        for rule, title in (("mean", "mean of a day's records"), ("m-of-n", "half of a day's records"))
    },
    label="damage index of a day",
)

# %%
# .. image:: /images/z24_days.png
#    :alt: Damage index of days, by the mean of a day's records and by half of them; damaged days lie above the
#          threshold
#
# Damage was done little by little. By day, in percent of its records:

print(found_by_day(inputs).round(1).to_string())

# %%
# .. code-block:: none
#
#    time     05-30  05-31  06-01  06-02  06-03  06-04  06-05  06-06  06-07  06-08
#    records   10.0    5.0    8.0   12.0   19.0   17.0   19.0   18.0   19.0    3.0
#    found      0.0   60.0  100.0  100.0  100.0  100.0  100.0  100.0  100.0  100.0
#
# A baseline that lacks a season
# ------------------------------
# What if monitoring had ended earlier? Baselines of the first part of the healthy records, and alarms on the fifth of
# them that follows. A baseline that ends before the longest frost misfires in it, with or without whitening. The last
# column says so beforehand: it counts the records whose weather the compensator does not know.

healthy = pd.concat([records.baseline, records.later])
fifth, rows = len(healthy) // 5, {}
for share in (0.4, 0.5, 0.6, 0.7):
    n = round(share * len(healthy))
    part, row = Records(healthy[:n], healthy[n : n + fifth], records.damaged), {}
    for label, scale in SCALES.items():
        residuals, compensator = compensate(part, TemperatureMapper(), scale)
        row[f"false alarms, {label}"] = alarms(MahalanobisDetector().fit(residuals.baseline), residuals.later)
    beyond = (compensator.applicability(part.later) > 0).any(axis=1)
    rows[f"first {share:.0%}"] = {**row, "records beyond known weather": 100 * beyond.mean()}
print(pd.DataFrame(rows).T.rename_axis("baseline").round(1).to_string())

# %%
# .. code-block:: none
#
#               false alarms, residuals  false alarms, residuals whitened by weather  records beyond known weather
#    baseline
#    first 40%                     22.1                                         24.8                          36.4
#    first 50%                      8.9                                         10.5                          48.2
#    first 60%                      0.2                                          0.5                          34.5
#    first 70%                      0.0                                          0.0                          28.2
#
# :doc:`plot_z24_damage` asks where the damage is, and whether a simulation would have told the same;
# :doc:`/guide/detection` explains the detectors.

save_figures(folder)
