"""
Z24: a real bridge and its weather
==================================

The Z24 bridge was monitored for a year and then damaged step by step. Below 0 °C its frequencies rise by
some 2 % a degree, because asphalt and soil freeze; damage lowers them by less than a frosty week raises
them. Here an FE model learns that effect from the first four fifths of the healthy records and is tested on
the last fifth. ``plot_z24_detection.py`` then looks for the damage.

The test is warmer than all training records. The default mapper goes on there in straight lines; boosted trees, which
are compared, stay at their last value; polynomials would extrapolate badly.

The data belong to KU Leuven and are not part of this package. Run the example with the folder or the file
that holds them: ``python examples/plot_z24_bridge.py path/to/z24_monitoring.csv``, or set
``SKTHERMO_DATA``. Figures go to the folder ``figures``.
"""

import argparse
import os
import sys
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.multioutput import MultiOutputRegressor

from skthermo.datasets import load_z24, make_z24
from skthermo.fem import sample
from skthermo.metrics import mape
from skthermo.plotting import FrequencyTemperatureDisplay, HistoryDisplay, PredictionDisplay
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from skthermo.updating import sensitivity

FILES = ("z24_monitoring.csv", "z24/z24_monitoring.csv", "z24.mat", "z24/z24.mat")
NO_DATA = f"""No Z24 data at {{}}.
Expected a CSV or MATLAB file as skthermo.datasets.load_z24 describes it, or a folder with one of
{", ".join(FILES)}. The monitoring data of the Z24 bridge are provided by KU Leuven for
non-commercial use on request: https://bwk.kuleuven.be/bwm/z24. Pass the path, or set SKTHERMO_DATA."""

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#777777"
KINDS = ["vertical", "lateral", "vertical", "torsion"]
MODES = [f"$f_{i}$ ({kind})" for i, kind in enumerate(KINDS, 1)]


def boosting():
    """The regressor for every input of temperatures."""
    return MultiOutputRegressor(GradientBoostingRegressor(random_state=0))


def bridge_model(track=True):
    """The bridge's FE model, reduced for all multipliers that frost or damage may need."""
    return make_z24(track=track).reduced([[0.4, 4.0]] * 4, random_state=0)


def chain(model, bounds=0.3, regressor=None):
    """Default chain, or with another regressor for the mapper; frequencies aligned to the model's by their means.

    The scatter of the measurement, 0.5 %, keeps the inverse from amplifying it.
    """
    return DataInformedFEM(
        model,
        inverse=InverseSurrogate(model, bounds=bounds, noise=0.005),
        mapper=TemperatureMapper(regressor),
        aligner=BiasAligner(model, method="scale"),
        random_state=0,
    )


def find(path):
    """The data file at a path; exits with a message if it is missing."""
    if path is None:
        sys.exit(NO_DATA.format("SKTHERMO_DATA, which is not set"))
    for file in (path, *(path / name for name in FILES)):
        if file.is_file():
            return file
    sys.exit(NO_DATA.format(path))


class Bridge:
    """Healthy records to learn from and to test on, and the records after damage began."""

    def __init__(self, file):
        data = load_z24(file)
        healthy = (data.state == "undamaged").to_numpy()
        self.T, self.F = data.temperatures[healthy], data.frequencies[healthy]
        self.T_damaged, self.F_damaged = data.temperatures[~healthy], data.frequencies[~healthy]
        self.n_train = 4 * len(self.T) // 5

    def split(self):
        """Temperatures and frequencies of the first four fifths, and of the last, without shuffling."""
        n = self.n_train
        return self.T[:n], self.F[:n], self.T[n:], self.F[n:]


def report_model():
    """Properties of the inverse problem, before any data are used."""
    model = bridge_model()
    slopes = sensitivity(model)
    print("d ln f / d ln theta", slopes.round(3), sep="\n")
    print(f"condition number of d ln f / d ln theta: {np.linalg.cond(slopes):.1f}")
    drawn = sample(model, 0.3, 1000, random_state=0)
    swapped = (np.diff(drawn.frequencies, axis=1) < 0).any(axis=1)
    moved = ~np.isclose(drawn.frequencies, bridge_model(track=False).frequencies(drawn.theta)).all(axis=1)
    print(f"1000 samples within +-30 %: in {swapped.mean():.1%} the four modes change their order, and in")
    print(f"{moved.mean():.1%} one of them has another rank than at the nominal state\n")


def hold_out_table(bridge):
    """Errors on the last fifth, in percent of the frequency: direct regression, tracked chain, sorted chain.

    The ratio is to the same regressor from temperatures straight to frequencies.
    """
    T, F, T_test, F_test = bridge.split()
    rows = {}
    for name, regressor in (("broken lines", None), ("boosted trees", boosting())):
        direct = mape(F_test, TemperatureMapper(regressor).fit(T, F).predict(T_test))
        rows[f"{name}, T to F"] = [*direct, direct.mean(), 1.0]
        for track, bounds in ((True, 0.3), (True, 0.5), (False, 0.3), (False, 0.5)):
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", "modes change their order")  # which is what sorting is here for
                warnings.filterwarnings("ignore", ".*rows did not converge")
                warnings.filterwarnings("ignore", ".* far outside the bounds")
                fem = chain(bridge_model(track), bounds, regressor).fit(T, F)
            errors = mape(F_test, fem.predict(T_test))
            label = f"{name}, chain, {'tracked' if track else 'sorted'}, bounds {bounds}"
            rows[label] = [*errors, errors.mean(), errors.mean() / direct.mean()]
    return pd.DataFrame(rows, [*F, "mean", "ratio"]).T.round(3)


def plot_over_time(bridge, fem):
    """Measured and predicted frequencies over the monitored year; the last fifth is hold-out data."""
    fig, axes = plt.subplots(5, 1, figsize=(11, 10), sharex=True, layout="constrained")
    marks = {"hold-out": bridge.T.index[bridge.n_train]}
    PredictionDisplay.from_estimator(fem, bridge.T, bridge.F, ax=axes[:4], titles=MODES, marks=marks)
    HistoryDisplay.from_predictions(bridge.T["TP"], unit="°C", ax=axes[4], titles=["pavement"], marks=marks)
    for ax in axes[:4]:
        ax.set_xlabel("")
    return fig


def plot_over_temperature(bridge, fem):
    """The knee at 0 °C, measured and predicted, in the hold-out records and in all others."""
    display = FrequencyTemperatureDisplay.from_estimator(fem, bridge.T, bridge.F, sensor="TP", titles=MODES)
    return with_freezing_point(display)


def plot_parameters(bridge, fem):
    """Parameters over temperature: M1 estimates them from frequencies, M2 predicts them from temperatures."""
    learned = fem.predict_parameters(bridge.T)
    display = FrequencyTemperatureDisplay.from_predictions(
        bridge.T["TP"],
        fem.parameters_.reindex(bridge.T.index),
        learned,
        labels=("$M_1$, from frequencies", "$M_2$, from temperatures"),
        quantity="multiplier of the nominal stiffness",
        unit="",
    )
    return with_freezing_point(display)


def with_freezing_point(display):
    """The figure of a display over the temperature of the pavement, with a line at 0 °C."""
    for ax in display.axes_:
        ax.axvline(0, color="black", lw=0.7)
        ax.set_xlabel("pavement (°C)")
    return display.figure_


def read_arguments(description):
    """The bridge's records, and the folder for figures, from the command line."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("data", type=Path, nargs="?", default=os.environ.get("SKTHERMO_DATA"), help="file or folder")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figures")
    options = parser.parse_args()
    return Bridge(find(options.data and Path(options.data))), options.figures


def save(figures, folder):
    """Save figures by their names, and say where."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, figure in figures.items():
        figure.savefig(folder / f"{name}.png", dpi=130)
        plt.close(figure)
    print("Figures:", *(folder / f"{name}.png" for name in figures), sep="\n  ")


def main():
    bridge, folder = read_arguments("The Z24 bridge: how weather moves its frequencies.")
    T, F, T_test, F_test = bridge.split()
    fem = chain(bridge_model()).fit(T, F)

    report_model()
    print(f"The fit on the first {len(T)} healthy records:\n\n{fem.report_}\n")
    beyond = fem.applicability(T_test).drop(columns="outside_bounds").max(axis=1)
    share = (beyond > 0.25).mean()
    print(f"Later weather: {share:.0%} of the last {len(T_test)} records have a temperature more than a quarter of the")
    print(f"training range outside it, the warmest {beyond.max():.0%}. Each prediction below would warn of that.\n")
    warnings.filterwarnings("ignore", r"\d+ of \d+ rows have temperatures far outside")
    print(f"MAPE in percent on the last {len(T_test)} of {len(bridge.T)} healthy records, and ratio to the same")
    print("regressor from temperatures straight to frequencies\n")
    print(hold_out_table(bridge).to_string(), end="\n\n")
    lowest, highest = fem.predict_interval(T_test)
    held = ((lowest < F_test) & (F_test < highest)).mean()
    print("Share of these records in the default chain's intervals of 90 %:")
    print("  " + ", ".join(f"{mode} {share:.0%}" for mode, share in held.items()), end="\n\n")

    figures = {
        "z24_over_time": plot_over_time(bridge, fem),
        "z24_over_temperature": plot_over_temperature(bridge, fem),
        "z24_parameters": plot_parameters(bridge, fem),
    }
    save(figures, folder)


if __name__ == "__main__":
    main()
