"""
Z24: a real bridge and its weather
==================================

The Z24 bridge was monitored for a year and then damaged step by step. Below 0 °C its frequencies rise by some 2 % a
degree, because asphalt and soil freeze; damage lowers them by less than a frosty week raises them. Here an FE model
learns that effect from the first four fifths of the healthy records and is tested on the last fifth.

.. note::

   The data belong to KU Leuven and are not part of this package: tables and figures on this page were made once with
   them. To make them yourself, ask for the data (https://bwk.kuleuven.be/bwm/z24) and run
   ``python examples/plot_z24_bridge.py path/to/z24_monitoring.csv``, or set ``SKTHERMO_DATA`` to the folder that holds
   them. The page needs :download:`z24_recipes.py` and :download:`page_recipes.py` beside it.
"""

# sphinx_gallery_thumbnail_path = 'images/z24_over_temperature.png'

import warnings

import matplotlib.pyplot as plt
import numpy as np
from page_recipes import save_figures
from z24_recipes import MODES, bridge_model, chain, hold_out_table, read_arguments

from skthermo.fem import sample
from skthermo.plotting import PredictionDisplay
from skthermo.updating import sensitivity

bridge, folder = read_arguments()
warnings.filterwarnings("ignore", ".*other-weather")  # counted below

# %%
# The model, before any data
# --------------------------
# :func:`~skthermo.datasets.make_z24` is an FE model of the bridge with four parameters. Sensitivities tell whether four
# frequencies can determine them: the condition number is small, and each parameter has a mode that it moves most.

model = bridge_model()
slopes = sensitivity(model)
print("d ln f / d ln theta", slopes.round(3), sep="\n")
print(f"condition number: {np.linalg.cond(slopes):.1f}")

# %%
# .. code-block:: none
#
#    d ln f / d ln theta
#        girder_bending  piers_soil  girder_torsion  abutments
#    f1           0.418       0.073           0.000      0.008
#    f2           0.182       0.274           0.026      0.018
#    f3           0.376       0.036           0.000      0.088
#    f4           0.009       0.045           0.445      0.000
#    condition number: 10.5
#
# Modes of this bridge swap places where parameters change. A model that sorts them by frequency would mistake one for
# another; this one follows each by its shape.

drawn = sample(model, 0.3, 1000, random_state=0)
swapped = (np.diff(drawn.frequencies, axis=1) < 0).any(axis=1)
moved = ~np.isclose(drawn.frequencies, bridge_model(track=False).frequencies(drawn.theta)).all(axis=1)
print(f"1000 samples within +-30 %: in {swapped.mean():.1%} the four modes change their order, and in")
print(f"{moved.mean():.1%} one of them has another rank than at the nominal state")

# %%
# .. code-block:: none
#
#    1000 samples within +-30 %: in 29.0% the four modes change their order, and in
#    63.0% one of them has another rank than at the nominal state
#
# Learn the effect of frost
# -------------------------
# The chain with its defaults: piecewise-linear regression, which can have a knee at 0 °C, maps seven temperatures to
# the parameters. The model is a reduced one already, so that the chain does not reduce it again.

T, F, T_test, F_test = bridge.split()
fem = chain(model).fit(T, F)
print(fem.report_)

# %%
# .. code-block:: none
#
#    2240 of 2240 rows trained the temperature mapper.
#    Solved by the full model: it has no reduced model.
#    Temperature moves all stiffness together by 4.7 %, 'girder_bending' by itself by 1 %, 'piers_soil' by itself by
#    0.1 %, 'girder_torsion' by itself by 0.1 % and 'abutments' by itself by 8.5 % (standard deviations).
#    MAPE is in-sample, of 365 rows spread evenly over the training rows.
#
#        offset (%)  MAPE (%)  MAPE of the mean (%)  noise (%)  misfit (%)  weather (%)  discrepancy (%)
#    f1        2.50     0.413                 1.841      0.454       0.461        2.273            0.027
#    f2        0.62     0.655                 1.577      0.763       1.380        2.229            0.780
#    f3        2.40     0.647                 1.828      0.885       0.309        2.287            0.025
#    f4        2.40     0.831                 1.911      1.081       1.001        2.191            0.020
#                    smallest deviation (%)  moved by itself (%)
#    girder_bending                    1.38                 1.04
#    piers_soil                        2.91                 0.10
#    girder_torsion                    2.09                 0.10
#    abutments                        10.35                 8.48
#
# What the weather does to the frequencies, 2.2 to 2.3 %, the model can follow with these parameters: the discrepancy,
# which is what it cannot follow, is at most 0.03 %, but for the second mode, 0.8 %. The noise of single records is 0.5
# to 1.1 %.
#
# Frequencies over the temperature of the pavement, measured and predicted: the knee at 0 °C is in the data, and the
# chain has learned it.

display = PredictionDisplay.from_estimator(fem, bridge.T, bridge.F, sensor="TP", titles=MODES)
for ax in display.axes_:
    ax.axvline(0, color="black", lw=0.7)
    ax.set_xlabel("pavement (°C)")

# %%
# .. image:: /images/z24_over_temperature.png
#    :alt: Four frequencies over the temperature of the pavement: flat above 0 °C, steeply rising below, measured and
#          predicted
#
# In the parameters, frost stiffens everything, and the abutments most. ``parameters_`` are estimates from frequencies,
# with the scatter of single records.

display = PredictionDisplay.from_predictions(
    fem.parameters_.reindex(bridge.T.index),
    fem.predict_parameters(bridge.T),
    temperature=bridge.T["TP"],
    labels=("$M_1$, from frequencies", "$M_2$, from temperatures"),
    quantity="multiplier of the nominal stiffness",
    unit="",
)
for ax in display.axes_:
    ax.axvline(0, color="black", lw=0.7)
    ax.set_xlabel("pavement (°C)")

# %%
# .. image:: /images/z24_parameters.png
#    :alt: Four multipliers of stiffness over the temperature of the pavement, from frequencies and from temperatures
#
# Most of the test is warmer than all that was learned
# ----------------------------------------------------
# :meth:`~skthermo.surrogate.DataInformedFEM.extrapolation_distance` says so, and every prediction would warn of it.

beyond = fem.extrapolation_distance(T_test).max(axis=1)
print(f"{(beyond > 0.25).mean():.0%} of the last {len(T_test)} records have a temperature more than a quarter of the")
print(f"training range outside it, the warmest {beyond.max():.0%}")

# %%
# .. code-block:: none
#
#    46% of the last 560 records have a temperature more than a quarter of the
#    training range outside it, the warmest 92%

fig, axes = plt.subplots(5, 1, figsize=(11, 10), sharex=True, layout="constrained")
marks = {"hold-out": bridge.T.index[bridge.n_train]}
PredictionDisplay.from_estimator(fem, bridge.T, bridge.F, ax=axes[:4], titles=MODES, marks=marks)
PredictionDisplay.from_predictions(bridge.T["TP"], unit="°C", ax=axes[4], titles=["pavement"], marks=marks)
for ax in axes[:4]:
    ax.set_xlabel("")

# %%
# .. image:: /images/z24_over_time.png
#    :alt: Four frequencies over a year, measured and predicted, and the temperature of the pavement below; the last
#          fifth, marked as hold-out, is the warmest part
#
# The default mapper goes on there in straight lines. Boosted trees, which are compared, stay at their last value. The
# ratio is to the same regressor from temperatures straight to frequencies, without an FE model. A chain errs less,
# whether modes are tracked by shape or sorted by frequency.

print(hold_out_table(bridge).to_string())

# %%
# .. code-block:: none
#
#                                         f1     f2     f3     f4   mean  ratio
#    piecewise-linear, T to F          0.431  0.548  0.604  0.791  0.594  1.000
#    piecewise-linear, chain, tracked  0.338  0.557  0.611  0.764  0.567  0.955
#    piecewise-linear, chain, sorted   0.338  0.557  0.611  0.764  0.567  0.955
#    boosted trees, T to F             0.402  0.847  0.789  0.858  0.724  1.000
#    boosted trees, chain, tracked     0.284  0.522  0.738  0.807  0.588  0.812
#    boosted trees, chain, sorted      0.285  0.526  0.755  0.855  0.605  0.836
#
# Intervals of 90 % widen where the weather is unknown:

lowest, highest = fem.predict_interval(T_test)
held = ((lowest < F_test) & (F_test < highest)).mean()
print("Share of these records in intervals of 90 %:", ", ".join(f"{mode} {share:.0%}" for mode, share in held.items()))

# %%
# .. code-block:: none
#
#    Share of these records in intervals of 90 %: f1 95%, f2 96%, f3 97%, f4 91%
#
# :doc:`plot_z24_detection` looks for the damage that followed.

save_figures(folder)
