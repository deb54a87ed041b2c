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
# @@1
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
# @@2
#
# The stiffness of piers and soil falls, where the pier was lowered. Bars are two standard deviations of healthy days
# without frost.

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
#    :alt: Change of four parameters by day; only that of piers and soil leaves the range of healthy days clearly
#
# What damage explains the shifts?
# --------------------------------
# :func:`~skthermo.studies.identify_damage` compares the last month with what the healthy bridge would do in its
# weather, and finds the severities of groups of members that explain the shifts of all modes.

fem, found = identify(bridge)
print(found.summary(), found.table.round(3), sep="\n\n")
print("\nMean shift of every mode in percent, measured and explained")
print((100 * found.shifts.drop(columns="n_records")).round(2))

# %%
# @@3

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
# @@4
#
# The bands hold the measured rates of all detectors that see residuals: with simulations alone, one would have chosen
# the same detector. :doc:`/guide/studies` plans such a study for your own bridge.

save_figures(folder)
