"""How many runs of a program a chain and a study take, and what an emulator of the program saves and costs.

    OMP_NUM_THREADS=1 python tests/benchmarks/program_calls.py

The truss stands for a program that returns frequencies only. Its runs are counted for a chain on a year of records and
for a chain and a study of one scenario; then with an emulator, cubic polynomials of ln f from 200 runs, in its place.
"""

import numpy as np
import pandas as pd
from harness import arguments, shown
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.fem import CallableModel, sample
from skthermo.studies import DetectabilityStudy, Scenario
from skthermo.surrogate import DataInformedFEM

TRUSS = make_truss()
YEAR = make_truss_campaign(random_state=0)
SCENARIOS = [Scenario("healthy"), Scenario("bottom -10 %", parameters={"bottom": 0.9})]


class Program:
    """The truss as a program that counts its runs."""

    runs = 0

    def __call__(self, row):
        self.runs += 1
        return TRUSS.frequencies([row])[0]


def found(model, uncertainty):
    """Percent of damaged records that a study finds; without uncertainty, there is a chain and no study."""
    fem = DataInformedFEM(model, random_state=0).fit(YEAR.temperatures, YEAR.frequencies)
    if uncertainty is None:
        return np.nan
    study = DetectabilityStudy(
        fem, MahalanobisDetector(), SCENARIOS, uncertainty=uncertainty, n_repeats=2, random_state=0
    )
    return 100 * study.run(YEAR.temperatures, baseline=YEAR.frequencies).set_index("scenario")["rate"].iloc[1]


def emulated(model, n_runs=200):
    """A model whose frequencies are polynomials of theta, from some runs of a program."""
    drawn = sample(model, 0.3, n_runs, method="lhs", random_state=0)
    cubic = make_pipeline(PolynomialFeatures(3), LinearRegression())
    curve = TransformedTargetRegressor(cubic, func=np.log, inverse_func=np.exp).fit(drawn.theta, drawn.frequencies)
    return CallableModel(curve.predict, model.parameter_names, model.n_modes, vectorized=True)


def main():
    arguments(__doc__)
    rows = {}
    for name, uncertainty in (("chain", None), ("chain and study, noise", "noise"), ("chain and study, all", "all")):
        rows[name] = row = {}
        for way in ("program", "emulator"):
            program = Program()
            model = CallableModel(program, TRUSS.parameter_names, TRUSS.n_modes)
            rate = found(emulated(model) if way == "emulator" else model, uncertainty)
            row |= {f"runs, {way}": program.runs, f"damage found, {way}, %": rate}
    table = pd.DataFrame(rows).T.astype({"runs, program": int, "runs, emulator": int}).rename_axis("what, uncertainty")
    shown("Runs of a program on the truss: four parameters, 365 records, bottom chord damaged by 10 %", table, 1)
    model = emulated(CallableModel(Program(), TRUSS.parameter_names, TRUSS.n_modes))
    test = sample(TRUSS, 0.3, 2000, random_state=1)
    errors = 100 * (model.frequencies(test.theta) / test.frequencies - 1)
    rms = np.sqrt(np.mean(errors**2, axis=0))
    values = {"root mean square, best mode": rms.min(), "worst mode": rms.max(), "largest": abs(errors).max()}
    shown("Errors of the emulator's frequencies, parameters within 30 %, %", pd.DataFrame({"truss": values}).T)


if __name__ == "__main__":
    main()
