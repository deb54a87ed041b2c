"""How many runs of a program a chain and a study take, and what an emulator of the program saves and costs.

The truss stands for a program that returns frequencies only. Its runs are counted for a chain on a year of records and
for a study of one scenario; then with an emulator, cubic polynomials of ln f from 200 runs, in its place.

Run it with ``python tests/benchmarks/program_calls.py``; it takes about eight minutes.
"""

from time import perf_counter

import numpy as np
from harness import arguments
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


def rates(model, uncertainty):
    """Alarm rates of a study, and the seconds of chain and study."""
    start = perf_counter()
    fem = DataInformedFEM(model, random_state=0).fit(YEAR.temperatures, YEAR.frequencies)
    fitted = perf_counter()
    if uncertainty is None:
        return None, fitted - start, 0.0
    study = DetectabilityStudy(
        fem, MahalanobisDetector(), SCENARIOS, uncertainty=uncertainty, n_repeats=2, random_state=0
    )
    found = study.run(YEAR.temperatures, baseline=YEAR.frequencies)
    return found.set_index("scenario")["rate"], fitted - start, perf_counter() - fitted


def emulated(model, n_runs=200):
    """A model whose frequencies are polynomials of theta, from some runs of a program."""
    drawn = sample(model, 0.3, n_runs, method="lhs", random_state=0)
    cubic = make_pipeline(PolynomialFeatures(3), LinearRegression())
    curve = TransformedTargetRegressor(cubic, func=np.log, inverse_func=np.exp).fit(drawn.theta, drawn.frequencies)
    return CallableModel(curve.predict, model.parameter_names, model.n_modes, vectorized=True)


def main():
    arguments(__doc__)
    print("model             uncertainty    runs    chain (s)  study (s)  rates")
    for name in ("program", "emulator", "exact model"):
        for uncertainty in (None, "noise", "all"):
            program = Program()
            model = CallableModel(program, TRUSS.parameter_names, TRUSS.n_modes)
            model = {"program": model, "emulator": emulated(model) if name == "emulator" else None}.get(name, TRUSS)
            found, chain, study = rates(model, uncertainty)
            said = "" if found is None else ", ".join(f"{rate:.3f}" for rate in found)
            print(f"{name:16}  {uncertainty or 'no study':12}  {program.runs:6}  {chain:9.1f}  {study:9.1f}  {said}")
    program = Program()
    model = emulated(CallableModel(program, TRUSS.parameter_names, TRUSS.n_modes))
    test = sample(TRUSS, 0.3, 2000, random_state=1)
    errors = model.frequencies(test.theta) / test.frequencies - 1
    rms = np.sqrt(np.mean(errors**2, axis=0))
    largest = abs(errors).max()
    print(f"errors of the emulator within 30 %: rms {rms.min():.3%} to {rms.max():.3%} by mode, at most {largest:.2%}")


if __name__ == "__main__":
    main()
