"""
A Gauss-Newton step between the stages
======================================

Each stage of the method can be used alone, and you may change its result before the next stage. As an example, the
inverse surrogate's own refinement is switched off with ``refine=0``; its estimates are improved by one Gauss-Newton
step on the FE model's frequencies and derivatives, and the temperature mapper learns from the improved parameters. A
second step changes little: the misfit that is left is noise, and the effect of temperature on zones that cut across the
model's four parameters.

You need not do this. By default the surrogate takes such steps itself until they converge, and the mapper learns the
result in coordinates of frequencies, without the part that the prior keeps back. The last line that is printed compares
with it.

Run it with ``python examples/plot_gauss_newton_step.py``; the figure goes to the folder ``figures``.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import linearise
from skthermo.plotting import HistoryDisplay
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

NOISE = 0.002  # of the records, relative
SCATTER = 0.005  # the same and what the model cannot follow
WIDTH = 0.2


def gauss_newton_step(model, theta: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    r"""Parameters improved by one Gauss-Newton step, row by row.

    ln f is nearly linear in ln theta: ln f_measured = ln f(theta) + S d, with the normalised sensitivities
    S = theta / f df/dtheta. The step d minimises \|ln f_measured - ln f - S d\|^2 / NOISE^2 +
    \|ln theta + d\|^2 / WIDTH^2: the second sum limits the step of parameters that hardly affect the frequencies.
    """
    frequencies, jacobian = linearise(model, theta)
    S = jacobian * theta.to_numpy()[:, np.newaxis] / frequencies[:, :, np.newaxis]
    residuals = np.log(measured.to_numpy() / frequencies)[:, :, np.newaxis]
    log_theta = np.log(theta.to_numpy())[:, :, np.newaxis]
    information = S.swapaxes(1, 2) @ S / SCATTER**2 + np.eye(S.shape[2]) / WIDTH**2
    steps = np.linalg.solve(information, S.swapaxes(1, 2) @ residuals / SCATTER**2 - log_theta / WIDTH**2)
    return theta * np.exp(steps[:, :, 0])


def misfit(model, theta: pd.DataFrame, measured: pd.DataFrame) -> np.ndarray:
    """Relative difference of the model's frequencies from the measured ones in each row, root mean square, in %."""
    return 100 * np.sqrt(((linearise(model, theta)[0] / measured - 1) ** 2).mean(axis=1))


def main(figures: Path) -> None:
    """Fit the chain without refinement, take the step, refit the mapper, and draw the misfit of every record."""
    model = make_truss()
    year = make_truss_campaign(noise=NOISE, random_state=0)
    inverse = InverseSurrogate(bounds=WIDTH, noise=SCATTER, refine=0)
    fem = DataInformedFEM(model, inverse=inverse, random_state=0).fit(year.temperatures, year.frequencies)

    theta = fem.estimate_parameters(year.frequencies)
    improved = gauss_newton_step(model, theta, year.frequencies)
    twice = gauss_newton_step(model, improved, year.frequencies)
    mapper = clone(fem.mapper_).fit(year.temperatures, improved)

    before, after, again = (misfit(model, parameters, year.frequencies) for parameters in (theta, improved, twice))
    print(f"Misfit of the frequencies, mean of {len(before)} records: {before.mean():.3f} %")
    print(f"After one step: {after.mean():.3f} %; after another: {again.mean():.3f} %")
    later = make_truss_campaign(noise=0.0, random_state=1)
    for name, fitted in (("estimates", fem.mapper_), ("improved estimates", mapper)):
        error = misfit(model, fitted.predict(later.temperatures), later.frequencies)
        print(f"Error over a later year, noise-free, of the mapper fitted to {name}: {error.mean():.3f} %")
    default = clone(fem).set_params(inverse__refine=None).fit(year.temperatures, year.frequencies)
    error = misfit(model, default.predict_parameters(later.temperatures), later.frequencies)
    print(f"The same where the surrogate refines its estimates itself, as by default: {error.mean():.3f} %")

    histories = {"inverse surrogate": before, "after one Gauss-Newton step": after}
    display = HistoryDisplay.from_predictions(histories, unit="%", kind="points", titles=["misfit of six frequencies"])
    display.axes_[0].set_ylim(bottom=0)
    figures.mkdir(exist_ok=True, parents=True)
    display.figure_.savefig(figures / "gauss_newton_step.png", dpi=150)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[1])
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figure")
    main(parser.parse_args().figures)
