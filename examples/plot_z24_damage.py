"""
Z24: where the damage is
========================

:doc:`plot_z24_detection` finds the damage that was done to the Z24 bridge. Here the detector looks at parameters of an
FE model in place of frequencies, and the parameter that changes says where. Then the damage that explains the shift of
all four modes is identified, with its uncertainty, and put into the FE model: the rates of alarms that a simulation
promises stand beside the measured ones.

.. note::

   The data belong to KU Leuven and are not part of this package: tables and figures on this page were made once with
   them, by ``python examples/plot_z24_damage.py path/to/z24_monitoring.csv``. :doc:`plot_z24_bridge` says where to get
   them. The page needs :download:`z24_damage_recipes.py`, :download:`z24_recipes.py` and :download:`page_recipes.py`
   beside it.
"""

# sphinx_gallery_thumbnail_path = 'images/z24_damage.png'

import warnings

import matplotlib.pyplot as plt
import pandas as pd
from page_recipes import save_figures
from z24_damage_recipes import FROST, changes, identify, in_parameters, simulation_table
from z24_recipes import GREY, PAVEMENT, SCALES, Records, alarm_table, compensate, plot_kinds, read_arguments

from skthermo.plotting import IdentifiedDamageDisplay
from skthermo.surrogate import TemperatureMapper

bridge, folder = read_arguments()
warnings.filterwarnings("ignore", r"\d+ of \d+ rows have temperatures far outside")
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
residuals = {
    ("broken lines", label): compensate(measured, TemperatureMapper(), scale, targets=names)[0]
    for label, scale in SCALES.items()
}
print("Alarms in percent")
print(alarm_table(residuals).round(1).to_string())

# %%
# .. code-block:: none
#
#    Alarms in percent
#                                                false alarms  damage found
#    broken lines residuals                               0.2          24.6
#                 residuals whitened by weather           0.7          90.8
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
#    scatter, frosty days             2.3         7.8             2.2        4.7
#    scatter, other days              0.6         2.7             1.3        3.6
#    mean, hold-out days              0.9        -1.1             0.3       -1.9
#    damaged, 30 May                  2.8        -9.1             2.2       -7.1
#    damaged, 31 May                  3.7       -15.3             1.9       -8.9
#    damaged, 01 Jun                  7.5       -24.8             1.1       -8.4
#    damaged, 02 Jun                 10.3       -20.6            -1.4      -28.3
#    damaged, 03 Jun                  6.5       -19.6            -1.7      -19.5
#    damaged, 04 Jun                  7.3       -18.6            -0.3      -21.5
#    damaged, 05 Jun                  8.1       -19.0            -0.7      -19.3
#    damaged, 06 Jun                  7.7       -19.3            -0.1      -20.1
#    damaged, 07 Jun                  7.2       -20.6            -0.1      -21.3
#    damaged, 08 Jun                  6.3       -20.9            -1.3      -19.3
#
# Piers and soil lose a fifth of their stiffness, some seven times the scatter of days without frost: the pier was
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
    ax.set_ylabel(f"{name.replace('_', ' ')}\n(%)")
axes[-1].set_xlabel("day, by the hour counter of the records")
fig.legend(*axes[0].get_legend_handles_labels(), loc="outside upper center", ncols=3)

# %%
# .. image:: /images/z24_changes.png
#    :alt: Change of four parameters by day: on damaged days, piers and soil and the abutments fall far below the range
#          of healthy days
#
# What damage explains the shifts?
# --------------------------------
# :func:`~skthermo.studies.identify_damage` compares the last month with what the healthy bridge would do in its
# weather, and finds the severities of groups of members that explain the shifts of all modes. It warns of groups that
# these modes cannot tell apart.

fem, found = identify(bridge)
print(found.summary(), found.table.round(3), sep="\n\n")
print("\nMean shift of every mode in percent, measured and explained")
print((100 * found.shifts.drop(columns="n_records")).round(2))

# %%
# .. code-block:: none
#
#    Damage is evident: a healthy structure shows such a shift with probability 0.002.
#    girder_torsion: 3.5% of its stiffness lost (standard error 1.3%).
#    abutments: 11.4% of its stiffness lost (not significant, standard error 4.3%).
#    soil: 18.5% of its stiffness lost (standard error 3.3%).
#    girder_bending and piers cannot be told apart by these modes.
#
#                    severity  standard_error  error_alone  p_value  significant
#    girder_bending     0.000           0.008        0.007    0.500        False
#    girder_torsion     0.035           0.013        0.011    0.004         True
#    abutments          0.114           0.043        0.039    0.013        False
#    piers              0.000           0.072        0.063    0.500        False
#    soil               0.185           0.033        0.031    0.000         True
#
#    Mean shift of every mode in percent, measured and explained
#        measured  explained  standard_error
#    f1     -0.07      -0.59            0.36
#    f2     -5.06      -5.28            1.05
#    f3     -0.78      -1.09            0.47
#    f4     -1.77      -2.11            0.64

IdentifiedDamageDisplay.from_predictions(found)

# %%
# .. image:: /images/z24_damage.png
#    :alt: Severities of four groups with their standard errors; shifts of four modes, measured and explained; cosines
#          between groups
#
# Would a simulation have told the same?
# --------------------------------------
# The identified damage, drawn with its uncertainty, is put into the FE model, which simulates the weather of the test
# and of the last month with noise like that of the records. A detector learns the measured baseline. Rates of alarms in
# percent, measured, and the mean and the band that holds 95 % of 40 simulated campaigns:

print(simulation_table(bridge, records, fem, found).round(1).to_string())

# %%
# .. code-block:: none
#
#                                                               measured  simulated  lowest  highest
#    false alarms raw frequencies                                    0.2        0.2     0.0      0.5
#    damage found raw frequencies                                    5.4        1.8     0.0      4.6
#    false alarms broken lines, residuals                            0.0        0.0     0.0      0.0
#    damage found broken lines, residuals                           52.3       40.0     1.5     97.6
#    false alarms broken lines, residuals whitened by weather        0.7        2.7     1.1      4.1
#    damage found broken lines, residuals whitened by weather       90.8       93.6    61.6    100.0
#    false alarms boosted trees, residuals                           0.7        0.6     0.2      1.4
#    damage found boosted trees, residuals                          25.4       30.4     6.2     67.6
#    false alarms boosted trees, residuals whitened by weather       1.8        1.8     0.9      2.7
#    damage found boosted trees, residuals whitened by weather      90.8       88.7    40.2    100.0
#
# The bands hold the measured rates of damage found by all detectors that see residuals: simulations alone would have
# led to the same choice of a detector. :doc:`/guide/studies` plans such a study for your own bridge.

save_figures(folder)
