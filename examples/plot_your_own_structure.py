"""
Your own structure, from the logger's file
==========================================

A tower is logged every half hour for a month: two temperatures and seven frequencies, with time stamps that are not
round, one stamp that goes back, and gaps of hours and days. Here the log becomes tidy frames, an FE model of the tower
is updated to the mean frequencies and learns the effect of temperature, predictions get intervals, and typical defects
of records are introduced on purpose. The measured modes are not identified: they are paired with those of the model by
frequency alone.

Run it with your log, ``python examples/plot_your_own_structure.py path/to/tower.csv``. The log has the columns
``time``, ``T1``, ``T2`` (degrees Celsius) and ``f1`` to ``f7`` (Hz). Without a log it makes a synthetic one, which this
page shows. It needs :download:`tower_recipes.py` and :download:`page_recipes.py` beside it;
:doc:`/guide/three_steps` is the same way in more words.
"""

# sphinx_gallery_thumbnail_number = 2

import tempfile
from pathlib import Path
from textwrap import fill

import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from tower_recipes import quietly, said, write_synthetic_log

from skthermo.fem import Beam, Spring, Structure, match_modes
from skthermo.metrics import mape
from skthermo.plotting import PredictionDisplay
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import DataInformedFEM, TemperatureMapper
from skthermo.updating import ModelUpdater, identifiability

parser = command_line()
parser.add_argument("log", type=Path, nargs="?", help="file with time, T1, T2, f1 to f7; else a synthetic one")
options = parser.parse_args()
SCATTER = 0.003  # of one record, relative

# %%
# An FE model, roughly
# --------------------
# The tower is a tapering tube of masonry that can rock on the soil. Its real section is not known; an equivalent one is
# enough, since only multipliers of four stiffnesses are estimated: Young's modulus, the shear modulus, and two springs
# for rocking. :class:`~skthermo.fem.Structure` assembles it; :doc:`/guide/fe_programs` says how to bring a model from
# another program.

HEIGHT, N_BEAMS = 25.0, 8
PARAMETERS = {"E": ("E", "walls"), "G": ("G", "walls"), "rocking_x": "rocking_x", "rocking_y": "rocking_y"}


def tower(n_modes=9):
    """Beams on rocking springs."""
    nodes = {i: (0.0, 0.0, HEIGHT * i / N_BEAMS) for i in range(N_BEAMS + 1)}
    members = {}
    for i in range(N_BEAMS):
        width, wall = np.array([13.8, 0.8]) + (i + 0.5) / N_BEAMS * np.array([-10.0, 1.2])  # m
        depth = 1.23 * width
        inner_width, inner_depth = width - 2 * wall, depth - 2 * wall
        members[i] = Beam(
            *(i, i + 1),
            **{"E": 5.2e8, "G": 2.4e8, "density": 1900.0},
            A=width * depth - inner_width * inner_depth,
            I_yy=(depth * width**3 - inner_depth * inner_width**3) / 12,
            I_zz=(width * depth**3 - inner_width * inner_depth**3) / 12,
            J=2 * wall * ((width - wall) * (depth - wall)) ** 2 / (width + depth - 2 * wall),
        )
    members |= {"rocking_x": Spring(0, "ry", 7.5e10), "rocking_y": Spring(0, "rx", 7.5e10)}  # N m/rad
    groups = {"walls": range(N_BEAMS), "rocking_x": ["rocking_x"], "rocking_y": ["rocking_y"]}
    structure = Structure(nodes, members, {0: ["x", "y", "z", "rz"]}, groups)
    return structure.assemble(PARAMETERS, n_modes=n_modes, track=True)


# %%
# The log becomes two frames
# --------------------------
# Temperatures and frequencies share an index of time stamps in ascending order. Nothing is resampled and nothing is
# filled in: the chain copes with stamps that are not round and with gaps. The first four fifths teach, the last fifth
# is the test.


def read_log(path):
    """Temperatures and frequencies in the order of time."""
    log = pd.read_csv(path, parse_dates=["time"], index_col="time")
    print(f"{Path(path).name}: {len(log)} records, {(np.diff(log.index) < np.timedelta64(0)).sum()} stamps go back")
    log = log.sort_index()
    return log[["T1", "T2"]], log.filter(regex=r"^f\d")


if options.log is None:
    with tempfile.TemporaryDirectory() as folder:
        write_synthetic_log(Path(folder) / "synthetic.csv", tower(7), SCATTER)
        T, F = read_log(Path(folder) / "synthetic.csv")
else:
    T, F = read_log(options.log)
n_train = 4 * len(T) // 5

# %%
# Which mode is which?
# --------------------
# :func:`~skthermo.fem.match_modes` pairs the measured modes with those of the model. Where accelerometers give mode
# shapes, pass them; frequencies alone, as here, need a look at the table.

pairs = match_modes(tower(), F[:n_train])
print(pairs.round(2))

# %%
# Update the model to the mean frequencies
# ----------------------------------------
# The model should be right on average before it learns temperature. :class:`~skthermo.updating.ModelUpdater` finds the
# multipliers for which the modes agree; ``frequency_std`` of 2 % is what the model, not the measurement, misses.

updater = ModelUpdater(tower().with_modes(pairs["mode"]), bounds=0.5, prior=0.3, n_starts=3, random_state=0)
updater.fit(F[:n_train], frequency_std=0.02 * F[:n_train].mean())
model = updater.model_
print(updater.table_.round(2))
print(f"\nMultipliers: {dict(zip(PARAMETERS, updater.theta_.round(3).tolist(), strict=True))}")

# %%
# Now the question is what one record can tell: :func:`~skthermo.updating.identifiability` gives the smallest standard
# deviation of every parameter that the scatter of the frequencies allows.

known = identifiability(model, noise=SCATTER)
print(f"Smallest deviation from one record, %: {(100 * known.deviations).round(2).to_dict()}")

# %%
# Learn the effect of temperature
# -------------------------------
# Masonry follows the air slowly, so the mapper sees temperatures of the last half day
# (:class:`~skthermo.preprocessing.LagFeatures`). Any regressor of scikit-learn can be a part of the chain: here a ridge
# regression maps temperatures to parameters. The chain estimates the noise of the records, aligns their means with the
# model's frequencies, and learns what the model cannot follow.

LAGS = [0, 2, 6, 12, 24]  # half hours


def chain(model, *, lags=LAGS):
    """A ridge regression on lagged temperatures; all else by default."""
    mapper = make_pipeline(LagFeatures(lags, freq="30min"), TemperatureMapper(Ridge()))
    return DataInformedFEM(model, mapper=mapper, random_state=0)


fem = chain(model).fit(T[:n_train], F[:n_train])
print(fem.report_)

# %%
# The report counts what was left out and why. Parameters over temperature show what was learned:

learned = quietly(fem.predict_parameters, T)
PredictionDisplay.from_predictions(
    fem.parameters_.reindex(T.index),
    learned,
    temperature=T["T2"],
    labels=("from frequencies", "from temperatures"),
    quantity="multiplier of the updated stiffness",
    unit="",
)

# %%
# Is it right on records that it has not seen?
# --------------------------------------------
# :meth:`~skthermo.surrogate.DataInformedFEM.extrapolation_distance` says how far the weather of the test is outside
# that of the training. Errors are compared with those of a ridge regression from temperatures straight to frequencies,
# which knows nothing of a structure: the chain loses little against it, and can be damaged.

beyond = fem.extrapolation_distance(T[n_train:]).max(axis=1)
print(f"{(beyond > 0.25).mean():.0%} of the last fifth lie a quarter of the training range or more outside it\n")

inputs = LagFeatures(LAGS, freq="30min").fit(T[:n_train]).transform(T).dropna()  # scikit-learn's ridge wants no gaps
first = inputs.index.intersection(T.index[:n_train])
direct = make_pipeline(StandardScaler(), Ridge()).fit(inputs.loc[first], F.loc[first])
weather = inputs.drop(index=first)
test = F.loc[weather.index]
predicted = {
    "chain": quietly(fem.predict, T[n_train:]).loc[test.index],
    "ridge, T to F": direct.predict(weather),
    "training mean": test * 0 + F[:n_train].mean(),
}
errors = pd.DataFrame({name: mape(test, values) for name, values in predicted.items()}, index=F.columns).T
errors = errors.assign(mean=errors.mean(axis=1)).round(3)
print(f"MAPE on the last {len(T) - n_train} records, where lags are known, in %\n{errors}")

lowest, highest = quietly(fem.predict_interval, T[n_train:])
held = (F[n_train:].gt(lowest) & F[n_train:].lt(highest)).to_numpy()[(F[n_train:].notna() & lowest.notna()).to_numpy()]
print(f"\nIntervals of 90 % hold {held.mean():.1%} of these frequencies")

# %%
# Three of the modes over time, with the test behind the dashed line:

shown = ["f1", "f4", "f6"]
history = quietly(fem.predict, T)
PredictionDisplay.from_predictions(F[shown], history[shown], marks={"hold-out": F.index[n_train]})

# %%
# All modes over the outer temperature:

PredictionDisplay.from_predictions(F, history, temperature=T["T2"])

# %%
# What if the records are wrong?
# ------------------------------
# Typical mistakes, made on purpose in the first 400 records. Every one is named by a warning or refused with an error,
# and correct records cause neither. :doc:`/guide/warnings` says what to do about each.

T, F = T[:400], F[:400]
swapped = F.rename(columns={"f2": "f3", "f3": "f2"})[list(F)]
gappy = T.assign(T1=T["T1"].where(np.arange(len(T)) < 150))
stuck = T.assign(T1=T["T1"].where(np.arange(len(T)) < 150, 10.0))
mistakes = {
    "rad/s instead of Hz": said(chain(model).fit, T, F * 2 * np.pi),
    "frequencies 1.5 times too high": said(chain(model).fit, T, F * 1.5),
    "two modes swapped": said(chain(model).fit, T, swapped),
    "a thermometer that died": said(chain(model).fit, gappy, F),
    "a thermometer that got stuck": said(chain(model).fit, stuck, F),
    "30 records": said(chain(model).fit, T[:30], F[:30]),
    "kelvin in fit": said(chain(model).fit, T + 273.15, F),
    "kelvin in predict": said(fem.predict, T + 273.15),
    "Fahrenheit in predict": said(fem.predict, T * 1.8 + 32),
    "nothing wrong": said(chain(model).fit, T, F),
}
for mistake, messages in mistakes.items():
    print(f"{mistake}:", *(fill(text, 110, subsequent_indent="  ") for text in messages or ["no warning"]), sep="\n  ")

# %%
# The same functions are yours for your own bridge: write its model in place of ``tower``, and its columns in place of
# those of ``read_log``.

save_figures(options.figures)
