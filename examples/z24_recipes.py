"""Records of the Z24 bridge, its model and chain, and tables of alarms; for the pages ``plot_z24_*.py``."""

import os
import sys
import warnings
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from page_recipes import command_line
from sklearn.ensemble import GradientBoostingRegressor
from sklearn.multioutput import MultiOutputRegressor

from skthermo.datasets import load_z24, make_z24
from skthermo.detection import CompensatedDetector, MahalanobisDetector, TemperatureCompensator
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

FILES = ("z24_monitoring.csv", "z24/z24_monitoring.csv", "z24.mat", "z24/z24.mat")
NO_DATA = f"""No Z24 data at {{}}.
Expected a CSV or MATLAB file as skthermo.datasets.load_z24 describes it, or a folder with one of
{", ".join(FILES)}. The monitoring data of the Z24 bridge are provided by KU Leuven for
non-commercial use on request: https://bwk.kuleuven.be/bwm/z24. Pass the path, or set SKTHERMO_DATA."""

BLUE, ORANGE, GREY = "#0072B2", "#D55E00", "#777777"
MOTIONS = ["vertical", "lateral", "vertical", "torsion"]
MODES = [f"$f_{i}$ ({kind})" for i, kind in enumerate(MOTIONS, 1)]
FREQUENCIES = ["f1", "f2", "f3", "f4"]
PAVEMENT = "TP"
KINDS = {"baseline": ("healthy, baseline", GREY), "later": ("healthy, hold-out", BLUE), "damaged": ("damaged", ORANGE)}
REGIMES = {"one regime": None, "two regimes": "auto"}


def boosting():
    """The regressor for every input of temperatures."""
    return MultiOutputRegressor(GradientBoostingRegressor(random_state=0))


def bridge_model(track=True):
    """The bridge's FE model, reduced for all multipliers that frost or damage may need."""
    return make_z24(track=track).reduced([[0.4, 4.0]] * 4, random_state=0)


def chain(model, regressor=None):
    """Default chain, or with another regressor for the mapper; frequencies aligned to the model's by their means."""
    return DataInformedFEM(
        model,
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


def hold_out_table(bridge, ways=(True, False)):
    """Errors on the last fifth, in percent of the frequency: direct regression, chains that track or sort modes.

    The ratio is to the same regressor from temperatures straight to frequencies.
    """
    T, F, T_test, F_test = bridge.split()
    rows = {}
    for name, regressor in (("piecewise-linear", None), ("boosted trees", boosting())):
        direct = mape(F_test, TemperatureMapper(regressor).fit(T, F).predict(T_test))
        rows[f"{name}, T to F"] = [*direct, direct.mean(), 1.0]
        for track in ways:
            with warnings.catch_warnings():
                warnings.filterwarnings("ignore", ".*poor-fit")
                fem = chain(bridge_model(track), regressor).fit(T, F)
            errors = mape(F_test, fem.predict(T_test))
            label = f"{name}, chain, {'tracked' if track else 'sorted'}"
            rows[label] = [*errors, errors.mean(), errors.mean() / direct.mean()]
    return pd.DataFrame(rows, [*F, "mean", "ratio"]).T.round(3)


class Records(NamedTuple):
    """What a detector learns from, and the healthy and the damaged records that it evaluates."""

    baseline: pd.DataFrame
    later: pd.DataFrame
    damaged: pd.DataFrame

    def each(self, transform, baseline=None):
        """Records that a transformer makes of them; those of the baseline may be given."""
        first = transform(self.baseline) if baseline is None else baseline
        return Records(first, transform(self.later), transform(self.damaged))

    @property
    def onset(self):
        """Time of the first damaged record."""
        return self.damaged.index[0]

    def stream(self):
        """All records that are evaluated, in order of time."""
        return pd.concat([self.later, self.damaged])

    @classmethod
    def of(cls, bridge):
        """Temperatures and frequencies side by side."""
        T, F, T_test, F_test = bridge.split()
        return cls(T.join(F), T_test.join(F_test), bridge.T_damaged.join(bridge.F_damaged))


def residuals(records, targets=FREQUENCIES):
    """What the default regression leaves of the records, of the baseline out of fold, in percent."""
    compensator = TemperatureCompensator(targets=targets)
    baseline = compensator.fit_transform(records.baseline)
    return records.each(compensator.transform, baseline).each(lambda frame: 100 * np.expm1(frame))


def compensated(detector=None, regressor=None, targets=FREQUENCIES, **options):
    """A detector of residuals, by the Mahalanobis distance where none is named."""
    return CompensatedDetector(detector or MahalanobisDetector(), regressor, targets=targets, **options)


def alarms(detector, frame):
    """Share of records that raise an alarm, in percent."""
    return 100 * float((detector.predict(frame) == -1).mean())


def alarm_table(records, detectors):
    """Alarms on healthy hold-out records and on damaged ones, in percent."""
    rows = {}
    for label, detector in detectors.items():
        detector.fit(records.baseline)
        rows[label] = {
            "false alarms": alarms(detector, records.later),
            "damage found": alarms(detector, records.damaged),
        }
    return pd.DataFrame(rows).T


def found_by_day(records, detector):
    """Number of records on each damaged day, and share of them that raise an alarm, in percent."""
    alarm = pd.Series(detector.fit(records.baseline).predict(records.damaged) == -1)
    days = alarm.groupby(records.damaged.index.floor("D").strftime("%m-%d"))
    return pd.DataFrame({"records": days.size(), "found": 100 * days.mean()}).T


def plot_kinds(ax, x, y, **style):
    """Records of the baseline, of the hold-out and after damage, in their colours."""
    for kind, (label, colour) in KINDS.items():
        ax.plot(getattr(x, kind), getattr(y, kind), ".", color=colour, label=label, **style)


def read_arguments():
    """The bridge's records, and the folder for figures, from the command line."""
    parser = command_line()
    parser.add_argument("data", type=Path, nargs="?", default=os.environ.get("SKTHERMO_DATA"), help="file or folder")
    options = parser.parse_args()
    return Bridge(find(options.data and Path(options.data))), options.figures
