"""
Your own structure: from a logger's file to a fitted chain
==========================================================

A tower is logged every half hour for a month: two temperatures and seven frequencies, with time stamps that are not
round, one stamp that goes back, and gaps of hours and days. Here the log becomes tidy frames, a tower of beams on
rocking springs is updated to the mean frequencies and learns the effect of temperature, predictions get intervals, and
typical defects of records are introduced on purpose. The measured modes are not identified: they are paired with those
of the model by frequency alone, one of them with a vertical mode.

Run it with your log, ``python examples/plot_your_own_structure.py path/to/tower.csv``, or set ``SKTHERMO_DATA`` to
the folder that holds ``tower/tower.csv``. Without either it makes a synthetic log with the same defects. The log has
the columns ``time``, ``T1``, ``T2`` (degrees Celsius) and ``f1`` to ``f7`` (Hz). Figures go to the folder ``figures``.
"""

import argparse
import os
import tempfile
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures, StandardScaler

from skthermo.fem import Beam, Spring, Structure, add_noise, match_modes
from skthermo.metrics import mape
from skthermo.plotting import FrequencyTemperatureDisplay, PredictionDisplay
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper
from skthermo.updating import ModelUpdater, identifiability

HEIGHT, N_BEAMS = 25.0, 12
PARAMETERS = {"E": ("E", "walls"), "G": ("G", "walls"), "rocking_x": "rocking_x", "rocking_y": "rocking_y"}
LAGS, SCATTER = [0, 2, 6, 12, 24], 0.003  # half hours; of one record, relative


def read_log(path):
    """Temperatures and frequencies in the order of time."""
    log = pd.read_csv(path, parse_dates=["time"], index_col="time")
    print(f"{path}: {len(log)} records, {(np.diff(log.index) < np.timedelta64(0)).sum()} stamps go back")
    log = log.sort_index()
    return log[["T1", "T2"]], log.filter(regex=r"^f\d")


def tower(n_modes=9):
    """A tapering tube of masonry that can rock on the soil; an equivalent section, since the real one is not known."""
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


def write_synthetic_log(path, n_days=25):
    """A log of the example's own tower, which stiffens as it warms, with the defects of a real logger."""
    random = np.random.default_rng(0)
    hours = np.arange(48 * n_days) / 2
    day = np.sin(np.pi * hours / 12)
    front = np.cumsum(random.normal(0, 0.12, len(hours)))
    T = np.column_stack([10 + 0.02 * hours / 24 + 0.3 * front + 0.4 * day, 9 + front + 2.5 * day])
    law = np.array([[0.004, 0.006], [0.004, 0.006], [0.004, 0.002], [0.002, 0.004]])
    theta = 1 + (T - [10, 9]) @ law.T
    F = add_noise(tower(7).frequencies(theta), SCATTER / 2, random_state=0) * 1.02
    stamps = pd.Timestamp("2019-02-13 16:02:26") + pd.to_timedelta(hours, unit="h")
    stamps += pd.to_timedelta(random.integers(-15, 16, len(hours)), unit="s")
    early = hours < 0.85 * hours[-1]
    stamps = stamps.where(early, stamps - pd.Timedelta("60min"))  # the logger's clock is set back
    log = pd.DataFrame(np.hstack([T, F]).round(5), columns=["T1", "T2", *(f"f{i}" for i in range(1, 8))])
    log.insert(0, "time", stamps.floor("s"))
    log.drop(index=[*range(55, 100), *range(400, 464)]).to_csv(path, index=False)


def update(F):
    """The tower with the measured modes as its columns, paired by frequency alone, and updated to their means."""
    nominal = tower()
    pairs = match_modes(nominal, F)
    print(f"\nMeasured modes among those of the nominal tower (offset in %)\n{pairs.round(2)}")
    updater = ModelUpdater(nominal.with_modes(pairs["mode"]), bounds=0.5, prior=0.3, n_starts=3, random_state=0)
    updater.fit(F, frequency_std=0.02 * F.mean())  # 2 %: what the model, not the measurement, misses
    print(f"\nModes before and after updating\n{updater.table_.round(2)}")
    print(f"\nMultipliers: {dict(zip(PARAMETERS, updater.theta_.round(3).tolist(), strict=True))}")
    known = identifiability(updater.model_, noise=SCATTER)
    print(f"Smallest deviation from one record, %: {(100 * known.deviations).round(2).to_dict()}")
    return updater.model_


def chain(model, *, lags=LAGS, bounds=0.3):
    """Quadratic inverse, refined on the model; ridge on lagged temperatures; frequencies aligned by their means."""
    quadratic = make_pipeline(PolynomialFeatures(2), LinearRegression())
    return DataInformedFEM(
        model,
        inverse=InverseSurrogate(model, quadratic, bounds=bounds, noise=SCATTER),
        mapper=make_pipeline(LagFeatures(lags, freq="30min"), TemperatureMapper(Ridge())),
        aligner=BiasAligner(model, method="scale"),
        random_state=0,
    )


def hold_out_table(fem, T, F, n_train):
    """Mean absolute percentage error on the records after the first ``n_train`` whose lags are all known."""
    inputs = (
        LagFeatures(LAGS, freq="30min").fit(T[:n_train]).transform(T).dropna()
    )  # scikit-learn's ridge wants no gaps
    known = inputs.index.intersection(T.index[:n_train])
    direct = make_pipeline(StandardScaler(), Ridge()).fit(inputs.loc[known], F.loc[known])
    weather = inputs.drop(index=known)
    test = F.loc[weather.index]
    predicted = {
        "chain": quietly(fem.predict, T[n_train:]).loc[test.index],
        "ridge, T to F": direct.predict(weather),
        "training mean": test * 0 + F[:n_train].mean(),
    }
    table = pd.DataFrame({name: mape(test, values) for name, values in predicted.items()}, index=F.columns).T
    return table.assign(mean=table.mean(axis=1)).round(3)


def share_held(fem, T, F):
    """Share of the measured frequencies that are within their 90 % intervals, where both are known."""
    lowest, highest = quietly(fem.predict_interval, T)
    held = F.gt(lowest) & F.lt(highest)
    return held.to_numpy()[(F.notna() & lowest.notna()).to_numpy()].mean()


def quietly(function, *arguments):
    """Call a function without its warning of unknown weather, which the example has already counted."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", r"\d+ of \d+ rows have temperatures far outside")
        return function(*arguments)


def said(function, *arguments):
    """Warnings of a call, or its error, as text."""
    with warnings.catch_warnings(record=True) as record:
        warnings.simplefilter("always")
        try:
            function(*arguments)
        except ValueError as error:
            return [f"refused: {error}"]
    return [str(warning.message) for warning in record]


def provoked(model, fem, T, F):
    """Warning or error for each mistake, by the name of the mistake."""
    swapped = F.rename(columns={"f2": "f3", "f3": "f2"})[list(F)]
    gappy = T.mask(np.random.default_rng(0).random(T.shape) < 0.02)
    return {
        "rad/s instead of Hz": said(chain(model).fit, T, F * 2 * np.pi),
        "frequencies 1.5 times too high": said(chain(model).fit, T, F * 1.5),
        "two modes swapped": said(chain(model).fit, T, swapped),
        "2 % of temperatures missing, 24 lags": said(chain(model, lags=24).fit, gappy, F),
        "bounds of 0.5 %": said(chain(model, bounds=0.005).fit, T, F),
        "30 records": said(chain(model).fit, T[:30], F[:30]),
        "kelvin in fit": said(chain(model).fit, T + 273.15, F),
        "kelvin in predict": said(fem.predict, T + 273.15),
        "Fahrenheit in predict": said(fem.predict, T * 1.8 + 32),
        "nothing wrong": said(chain(model).fit, T, F),
    }


def draw(T, F, fem, n_train):
    """Figures by name: frequencies over temperature and in time, and parameters over temperature."""
    predicted, learned = quietly(fem.predict, T), quietly(fem.predict_parameters, T)
    shown = ["f1", "f4", "f6"]
    displays = {
        "over_temperature": FrequencyTemperatureDisplay.from_predictions(T["T2"], F, predicted),
        "hold_out": PredictionDisplay.from_predictions(
            F[shown], predicted[shown], marks={"hold-out": F.index[n_train]}
        ),
        "parameters": FrequencyTemperatureDisplay.from_predictions(
            T["T2"],
            fem.parameters_.reindex(T.index),
            learned,
            labels=("from frequencies", "from temperatures"),
            quantity="multiplier of the updated stiffness",
            unit="",
        ),
    }
    return {name: display.figure_ for name, display in displays.items()}


def main():
    parser = argparse.ArgumentParser(description="From a tower's raw log to a fitted chain.")
    data = os.environ.get("SKTHERMO_DATA")
    default = Path(data) / "tower" / "tower.csv" if data else None
    parser.add_argument("log", type=Path, nargs="?", default=default, help="file with time, T1, T2, f1 to f7")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figures")
    options = parser.parse_args()
    if options.log is None or (options.log == default and not default.is_file()):
        print("No log was given: this one is synthetic, from the example's own tower by a known law.")
        with tempfile.TemporaryDirectory() as folder:
            write_synthetic_log(Path(folder) / "synthetic.csv")
            T, F = read_log(Path(folder) / "synthetic.csv")
    else:
        T, F = read_log(options.log)
    n_train = 4 * len(T) // 5
    model = update(F[:n_train])
    fem = chain(model).fit(T[:n_train], F[:n_train])
    print(f"\nThe fit on the first {n_train} records\n{fem.report_}")
    beyond = fem.applicability(T[n_train:]).drop(columns="outside_bounds").max(axis=1)
    print(f"\n{(beyond > 0.25).mean():.0%} of the last fifth lie a quarter of the training range or more outside it")
    print(f"\nMAPE on the last {len(T) - n_train} records, where lags are known, in %")
    print(hold_out_table(fem, T, F, n_train))
    print(f"Intervals of 90 % hold {share_held(fem, T[n_train:], F[n_train:]):.1%} of these frequencies\n")
    for mistake, messages in provoked(model, fem, T[:n_train], F[:n_train]).items():
        print(f"{mistake}:", *(messages or ["no warning"]), sep="\n  ")

    options.figures.mkdir(parents=True, exist_ok=True)
    for name, figure in draw(T, F, fem, n_train).items():
        path = options.figures / f"your_own_structure_{name}.png"
        figure.savefig(path, dpi=110)
        print(f"Figure: {path}")


if __name__ == "__main__":
    main()
