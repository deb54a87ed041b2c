"""
Z24: where the damage is
========================

:doc:`plot_z24_detection` finds the damage that was done to the Z24 bridge. Here the detector looks at parameters of an
FE model in place of frequencies, and the parameter that changes says where. Then the damage that explains the shift of
all four modes is identified, with its uncertainty, and put into the FE model: for 26 detectors, the rates of alarms
that a simulation predicts are compared with the measured ones. At last, simulation chooses a detector before any
damage.

.. note::

   The data belong to KU Leuven and are not part of this package: tables and figures on this page were made once with
   them, by ``python examples/plot_z24_damage.py path/to/z24_monitoring.csv``. :doc:`plot_z24_bridge` says where to get
   them. The page needs :download:`z24_damage_recipes.py`, :download:`z24_detector_recipes.py`,
   :download:`detector_recipes.py`, :download:`z24_recipes.py` and :download:`page_recipes.py` beside it.
"""

# sphinx_gallery_thumbnail_path = 'images/z24_detectors.png'

import warnings

import matplotlib.pyplot as plt
import pandas as pd
from page_recipes import save_figures
from z24_damage_recipes import FROST, changes, identify, in_parameters
from z24_detector_recipes import DAMAGED, agreement, choose, compare, detectors, side_by_side
from z24_recipes import GREY, PAVEMENT, REGIMES, Records, alarm_table, compensated, plot_kinds, read_arguments

from skthermo.plotting import DetectorsDisplay

bridge, folder = read_arguments()
warnings.filterwarnings("ignore", ".*other-weather")
warnings.filterwarnings("ignore", ".*set-aside")  # one record, whose abutments would be nine times as stiff
records = Records.of(bridge)

# %%
# Parameters in place of frequencies
# ----------------------------------
# An :class:`~skthermo.surrogate.InverseSurrogate` is a transformer: put before a detector, it turns each record's
# frequencies into multipliers of stiffness. Of these, temperature is compensated as it was of frequencies.
#
# .. literalinclude:: z24_damage_recipes.py
#    :pyobject: in_parameters

measured, names = in_parameters(records)
ways = {label: compensated(targets=names, regimes=regimes) for label, regimes in REGIMES.items()}
print("Alarms in percent")
print(alarm_table(measured, ways).round(1).to_string())

# %%
# .. code-block:: none
#
#    Alarms in percent
#                 false alarms  damage found
#    one regime            0.2          90.8
#    two regimes           2.1          91.5
#
# Which parameter changes?
# ------------------------
# Change of every parameter from what the weather explains, in percent, as means of days. The first rows are the scatter
# of healthy days.

days = changes(measured, names)
frozen = measured.baseline[PAVEMENT].groupby(measured.baseline.index.floor("D")).mean() < FROST
scatter = {
    "scatter, frosty days": days.baseline[frozen].std(),
    "scatter, other days": days.baseline[~frozen].std(),
    "mean, hold-out days": days.later.mean(),
}
damaged = days.damaged.set_axis(days.damaged.index.strftime("damaged, %d %b"))
print(pd.concat([pd.DataFrame(scatter).T, damaged]).round(1).to_string())

# %%
# .. code-block:: none
#
#                          girder_bending  piers_soil  girder_torsion  abutments
#    scatter, frosty days             1.5         4.9             2.3        4.3
#    scatter, other days              0.6         2.3             1.2        3.9
#    mean, hold-out days              0.9        -1.1             0.3       -1.5
#    damaged, 30 May                  2.9        -9.0             2.2       -7.4
#    damaged, 31 May                  3.9       -15.3             1.9       -9.4
#    damaged, 01 Jun                  7.5       -24.8             1.2       -8.3
#    damaged, 02 Jun                 10.5       -20.6            -1.4      -28.9
#    damaged, 03 Jun                  6.7       -19.6            -1.6      -20.3
#    damaged, 04 Jun                  7.5       -18.6            -0.3      -22.3
#    damaged, 05 Jun                  8.3       -19.0            -0.7      -20.1
#    damaged, 06 Jun                  8.0       -19.3            -0.0      -20.9
#    damaged, 07 Jun                  7.5       -20.6            -0.1      -22.1
#    damaged, 08 Jun                  6.6       -21.0            -1.3      -20.1
#
# Piers and soil lose a fifth of their stiffness, some nine times the scatter of days without frost: the pier was
# lowered. The abutments seem to lose as much, and the girder to gain a little, since four modes do not separate these
# parameters sharply. Bars are two standard deviations of healthy days without frost.

fig, axes = plt.subplots(4, 1, figsize=(10, 8), sharex=True, sharey=True, layout="constrained")
for ax, name in zip(axes, names, strict=True):
    values = days.each(lambda frame, name=name: frame[name])
    plot_kinds(ax, days.each(lambda frame: frame.index), values)
    for kind in (values.later, values.damaged):
        bars = 2 * scatter["scatter, other days"][name]
        ax.errorbar(kind.index, kind, bars, fmt="none", ecolor=GREY, elinewidth=1, zorder=0)
    ax.axhline(0, color="black", lw=0.7)
    ax.set_title(f"stiffness of {name.replace('_', ' ')}", fontsize="medium")
fig.supylabel("change of stiffness from what the weather explains (%)")
axes[-1].set_xlabel("day, by the hour counter of the records")
bars = axes[0].errorbar([], [], [], fmt="none", ecolor=GREY, label="± 2 standard deviations of healthy days")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=4)

# %%
# .. image:: /images/z24_changes.png
#    :alt: Change of four parameters by day: on damaged days, piers and soil and the abutments fall far below the range
#          of healthy days
#
# What damage explains the shifts?
# --------------------------------
# :func:`~skthermo.studies.identify_damage` compares the last month with what the healthy bridge would do in its
# weather, and weighs what explains the shifts of all modes: damage of up to three groups of members, alone or beside
# something else. It warns of groups that these modes cannot distinguish.

fem, found = identify(bridge)
print(found.summary())
print("\nEvery group, on average over all explanations")
print(found.table[["probability", "severity", "ci_low", "ci_high", "if_damaged"]].round(3).to_string())
print("\nMean shift of every mode in percent, measured and explained")
print((100 * found.shifts[["measured", "explained", "standard_error"]]).round(2).to_string())

# %%
# .. code-block:: none
#
#    Most probable: a loss of 19 % of stiffness in soil (90 % interval 13 % to 25 %) and something else, probability
#    42 %.
#    Less probable: girder_torsion 3 %, abutments 8.5 %, soil 19 % (12 %); something else (10 %); piers 11 %, soil
#    18 %, something else (9 %); abutments 8.6 %, soil 19 %, something else (9 %).
#    Probability of no change: below 0.1 %.
#    112 records (worth 3.9 independent ones) compared with 2,800 training records (worth 96).
#    These modes do not show which of girder_bending and piers has changed.
#
#    Every group, on average over all explanations
#                    probability  severity  ci_low  ci_high  if_damaged
#    girder_bending        0.031     0.001     0.0    0.000       0.031
#    girder_torsion        0.229     0.007     0.0    0.036       0.032
#    abutments             0.278     0.024     0.0    0.114       0.088
#    piers                 0.151     0.017     0.0    0.133       0.113
#    soil                  0.854     0.159     0.0    0.244       0.186
#
#    Mean shift of every mode in percent, measured and explained
#        measured  explained  standard_error
#    f1     -0.04      -0.55            0.22
#    f2     -4.96      -4.17            0.52
#    f3     -0.71      -0.28            0.19
#    f4     -1.70      -0.81            0.23
#
# That something has changed is sure, and the soil under the piers is where, with a probability of 85 %. What else has
# changed is not: damage of the soil beside something else has a probability of 42 %, that of three groups 12 %. The
# truth, a pier that was lowered, is not a loss of stiffness of one group.

DetectorsDisplay.from_predictions(found.table)

# %%
# .. image:: /images/z24_damage.png
#    :alt: Probabilities of five groups; their mean severities with credible intervals of 90 %, that of the soil the
#          largest
#
# Simulated rates beside measured ones
# ------------------------------------
# The identified damage, drawn with its uncertainty, is put into the FE model, which simulates the weather of the test
# and of the last month with noise like that of the records. The detectors of :doc:`plot_z24_detection` learn the
# measured baseline and evaluate them. Rates of alarms in percent, measured, and the mean of 40 simulated campaigns;
# then how well they agree, and the share of measured rates in the prediction intervals (95 %):

candidates = detectors()
results = compare(bridge, fem, found.scenario(DAMAGED), candidates)
table = side_by_side(results)
print(table.drop(columns=["lowest", "highest"], level=1).round(1).to_string())
print(agreement(table).round(3).to_string())

# %%
# .. code-block:: none
#
#                                       false alarms           damage found
#                                           measured simulated     measured simulated
#    detector
#    raw, Mahalanobis                            0.2       0.1          3.8       0.5
#    raw, isolation forest                       0.4       0.5         89.2      81.5
#    raw, 20 neighbours                          1.2       1.6         91.5      89.8
#    raw, local outlier factor                  16.6      18.2         96.2      98.4
#    raw, one-class SVM                          0.0       0.0         61.5      38.0
#    raw, less 1 component                       0.4       0.5          4.6       1.9
#    raw, less 2 components                      0.4       0.3          4.6       0.3
#    raw, less 3 components                      1.1       0.8          7.7       1.4
#    raw, factor analysis                        0.2       0.4          5.4       1.7
#    raw, Gaussian mixture                       3.0       3.3         83.8      71.7
#    raw, cointegration                          0.9       0.8          4.6       1.3
#    piecewise-linear                            0.0       0.2         90.8      81.9
#    piecewise-linear, regimes                   2.5       3.2         93.1      94.9
#    boosted trees                               0.5       0.4         43.8      31.9
#    boosted trees, regimes                      2.1       2.5         91.5      87.4
#    linear regression                          33.2      33.6        100.0      99.9
#    linear regression, regimes                 45.4      46.1        100.0     100.0
#    chain                                       0.9       1.1         81.5      62.1
#    chain, regimes                              0.9       1.1         81.5      62.1
#    piecewise-linear, isolation forest          0.0       0.2         28.5      15.0
#    piecewise-linear, 20 neighbours             0.0       0.2         90.0      79.5
#    conditional covariance                      3.4       4.0         92.3      94.8
#    softening                                   0.4       0.4         90.8      88.7
#    softening, regimes                          0.7       1.4         94.6      93.1
#    directions of the model                     0.4       0.3         90.8      87.5
#    directions of the model, regimes            0.9       1.3         93.8      92.5
#                  rank correlation  in the band  detectors
#    false alarms             0.961        1.000       26.0
#    damage found             0.983        0.923       26.0

groups = {name: "raw frequencies" if name.startswith("raw") else "with temperatures" for name in candidates}
DetectorsDisplay.from_predictions(results, groups=groups)

# %%
# .. image:: /images/z24_detectors.png
#    :alt: Rates of alarms of 26 detectors, measured as dots on simulated bands: false alarms from 0 to 45 %,
#          damage found from 4 to 100 %; nearly every dot lies in its band or at its end
#
# All measured false alarms lie in their bands, 24 of 26 rates of damage found do, and the detectors stand in nearly the
# same order. Failures are predicted, too: the 17 % false alarms of the local outlier factor, and the 33 and 45 % of
# linear regression. But the bands of found damage are wide, since the severities are uncertain, and the damage was
# identified from the very records that it is compared with. Means of the campaigns are up to 24 points below the
# measured rates.
#
# With an assumed damage and the baseline alone, as before the first alarm, the order is not as good:
# :ref:`z24-simulated`.
#
# Which detector would simulation have chosen?
# --------------------------------------------
# An engineer before the damage knows neither its place nor the weather to come. So every group of the model loses 10 to
# 50 %. Detectors learn the first three quarters of the baseline, and evaluate simulated records in the weather of the
# last, which is ahead of them. They are ranked by the mean probability of detection (POD), those first that keep the
# limit of 2 % false alarms. Percent of records; the last column moves all thresholds to 2 %.

study = choose(bridge, candidates)
ranking = study.ranking(max_false_alarms=0.02)
percent = 100 * ranking[["false_alarms", "pod", "pod_at_equal_pfa"]].astype(float)
print(percent.head(8).round(1).to_string())

# %%
# .. code-block:: none
#
#                                     false_alarms   pod  pod_at_equal_pfa
#    detector
#    softening, regimes                        2.4  84.8              82.1
#    piecewise-linear, regimes                 1.7  80.3              80.8
#    conditional covariance                    1.1  78.9              81.9
#    directions of the model                   0.4  75.3              82.0
#    raw, 20 neighbours                        0.4  74.7              82.9
#    softening                                 0.5  74.3              81.3
#    piecewise-linear, 20 neighbours           0.4  73.0              79.7
#    chain                                     0.5  72.6              79.9
#
# Residuals in two regimes that only look for falls come first. On the real damage they find 94.6 % at 0.7 % false
# alarms, as the best does, and 20 neighbours of raw frequencies find 91.5 % at 1.2 %. The directions of the model in
# two regimes find a little more in simulation, at false alarms above the limit. A margin of 1 or 2 points, with bounds
# that include noise alone, is no reason to choose.
#
# The weather is ahead of the baseline on purpose: in weather that they have learned
# (``choose(bridge, candidates, ahead=False)``), a local outlier factor of the raw frequencies keeps the limit, and it
# raises 17 % in spring.
#
# :doc:`/guide/studies` plans such a study for your own bridge.

save_figures(folder)
