"""
KW51: the paper's bridge, end to end
====================================

Section 4 of Kamali, Ceravolo & Marzani (2026): gaps, lags, updating, the two surrogates, verification, retrofit and
detection, with counterparts of Tables 4 to 9 and of Figs. 11 to 18. The measurements may not be part of this package.
This page shows a synthetic campaign with their statistics, :func:`~skthermo.datasets.make_kw51_campaign`, whose truth
is known.

Run it with ``python examples/plot_kw51_study.py``, or on the measurements with
``python examples/plot_kw51_study.py trackedmodes.zip`` (doi 10.5281/zenodo.3745914). It needs
:download:`kw51_recipes.py` (records and chains), :download:`kw51_tables_recipes.py` and :download:`page_recipes.py`
beside it. The guide is :doc:`/accuracy_kw51`; :doc:`/accuracy_paper` has the tables of two campaigns.
"""

# sphinx_gallery_thumbnail_number = 7

from pathlib import Path

import pandas as pd
from kw51_recipes import (
    BASELINE,
    DEFAULT,
    MODES,
    NOISE,
    PAIR,
    PUBLISHED,
    TRAINED,
    Fitted,
    Records,
    bridge,
    quiet,
)
from kw51_tables_recipes import (
    PARAMETERS,
    SETTINGS,
    table_5,
    table_7,
    table_8,
    table_9,
    table_of_gaps,
    table_of_gaps_in_detection,
    table_of_lags,
    table_of_retrofits,
    table_of_updating,
)
from page_recipes import command_line, save_figures

from skthermo.fem import sample
from skthermo.plotting import DamageIndexDisplay, PredictionDisplay
from skthermo.updating import identifiability

parser = command_line()
parser.add_argument("file", type=Path, nargs="?", help="trackedmodes.zip or trackedmodes.mat; else a synthetic one")
parser.add_argument("--seed", type=int, default=0, help="of the synthetic campaign")
options = parser.parse_args()


def show(table):
    print(table.to_string(na_rep=""))


# %%
# Fifteen months of records
# -------------------------
# Modes were tracked every hour, and most records lack some. The first 3200 records teach, the next 800 are the test.
# Months later the bridge was retrofitted.

records = Records.read(options.file, options.seed)
print(f"{records.title}: {len(records.state)} hourly records")
filled = records.imputed()
both = {
    name: pd.concat([part.temperatures.add_suffix(" (°C)"), part.frequencies.add_suffix(" (Hz)")], axis=1)[:BASELINE]
    for name, part in (("measured", records), ("imputed", filled))
}
both["imputed"] = both["imputed"].where(both["measured"].isna())
labels = ("measured", "imputed")
PredictionDisplay.from_predictions(both["measured"], both["imputed"], labels=labels, unit="", kind="points")

# %%
# The paper fills gaps from ten similar records (orange). The other way is to fill none: a record is inverted from the
# modes that it has, with weights that say how much these tell.
#
# Two chains
# ----------
# One makes the paper's choices (:func:`~skthermo.surrogate.paper_chain`): imputed records, and networks for both
# surrogates. The default imputes nothing, solves the FE model for the parameters of each record and maps temperatures
# with piecewise-linear regression. Both see the temperatures of the last day.
#
# .. literalinclude:: kw51_recipes.py
#    :pyobject: chain

for (surrogate, whose), text in SETTINGS.items():
    print(f"{surrogate}, {whose}: {text}")
pair = {name: Fitted.by(records, name) for name in (PUBLISHED, DEFAULT)}
paper, best = pair[PUBLISHED], pair[DEFAULT]
print(f"Seconds of the fits: {', '.join(f'{fitted.seconds:.0f} ({name})' for name, fitted in pair.items())}")
print(f"R2 of M1 on simulations that were held out: {paper.fem.inverse_.regressor_.validation_score_:.3f}")

# %%
# Missing records in percent, and how far imputed values scatter around the chain's predictions beside measured ones.
# Imputed records are too smooth.

show(table_of_gaps(records, best))

# %%
# How many hours does the steel remember? The error of mode 6 in the test, predicted from temperatures of so many hours,
# hardly changes: the sensor is on the steel itself.

show(table_of_lags(records))

# %%
# The model
# ---------
# It was updated to the frequencies before the retrofit (:doc:`plot_kw51_updating`):

show(table_of_updating())

# %%
# One record tells the five moduli that depend on temperature to so many percent of their values:

known = identifiability(bridge(), noise=NOISE)
print((100 * known.deviations).round(2).to_frame().T.to_string(index=False))

# %%
# M1: from frequencies to parameters
# ----------------------------------
# Parameters of test samples, as multiples of nominal, and as M1 finds them with the paper's network.

test = sample(bridge(), 0.3, 200, random_state=1)
with quiet():
    found = paper.fem.inverse_.transform(pd.DataFrame(test.frequencies, columns=MODES))
true = pd.DataFrame(test.theta, columns=PARAMETERS)
PredictionDisplay.from_predictions(true, found, labels=("true", "by M1"), kind="scatter", unit="")

# %%
# Table 5, mean absolute percentage errors. Solved for, parameters are exact where there is no noise.

with quiet():
    show(table_5(bridge(), pair))

# %%
# M2: from temperatures to parameters
# -----------------------------------
# Parameters of the test as M1 finds them, and as M2 predicts them, by the paper's choices.

with quiet():
    history = paper.fem.estimate_parameters(filled.frequencies[:BASELINE])
    mapped = paper.test(paper.fem.predict_parameters(filled.temperatures[:BASELINE]))
labels = ("from frequencies", "from temperatures")
PredictionDisplay.from_predictions(
    paper.test(history), mapped, labels=labels, quantity="over nominal", unit="", n_columns=1
)

# %%
# Table 7, their mean absolute percentage differences:

show(table_7(pair))

# %%
# Verification
# ------------
# Frequencies of the test, measured and predicted by the chain with nothing imputed.

predicted = best.simulated()
PredictionDisplay.from_predictions(best.test(records.frequencies), best.test(predicted))

# %%
# The records that taught it, over the temperature of the steel, and what the chain makes of them:

steel = records.temperatures["tBD31A"]
PredictionDisplay.from_predictions(records.frequencies[:TRAINED], predicted[:TRAINED], temperature=steel[:TRAINED])

# %%
# Table 8, errors of the frequencies in percent. Beside the truth, which a synthetic campaign knows, the errors are far
# smaller than beside noisy measurements.

show(table_8(records, pair))

# %%
# The retrofit
# ------------
# Strengthened connections are stiffness and mass. The paper's 15 % more stiffness raises modes 2 and 4, which were
# measured to fall; the retrofit that explains the shifts adds mass, too. Shifts in percent:

show(table_of_retrofits(records, best))
after = records.after
PredictionDisplay.from_predictions(records.frequencies[after][PAIR], best.simulated("retrofit")[after][PAIR])

# %%
# Detection
# ---------
# The damage index by modes 2 and 4 rises after the retrofit, in simulations as in the records.

indices, threshold = best.detection()
sources = ("measured", "simulated")
by_label = {name: pd.concat([indices[state, name] for state in ("healthy", "retrofit")]) for name in sources}
DamageIndexDisplay.from_predictions(by_label, threshold)

# %%
# Table 9. The paper's networks leave errors in the simulated frequencies; the retrofit is found by either chain.

show(table_9({PUBLISHED: (paper, 0.0), DEFAULT: (best, "fitted")}))

# %%
# An index that needs both modes exists for a fifth of the test's records. One that takes whichever of six modes there
# are exists for nearly all, and finds most changes of 30 % of the retrofit. In percent of the records:

show(table_of_gaps_in_detection(best))

save_figures(options.figures)
