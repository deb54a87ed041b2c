"""
A step of your own between the stages
=====================================

Each stage of the method can be used alone, and you may change its result before the next stage. As an example, M1 is
the paper's, a regressor that is trained on simulations; its estimates are improved by one Gauss-Newton step on the FE
model's frequencies and derivatives, and the temperature mapper learns from the improved parameters.

You need not do this: the default inverse takes such steps itself until they converge. The page shows where your own
ideas can go.

Run it with ``python examples/plot_gauss_newton_step.py``; it needs :download:`page_recipes.py` beside it. The guide is
:doc:`/guide/method`.
"""

import numpy as np
import pandas as pd
from page_recipes import command_line, save_figures
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import linearise
from skthermo.surrogate import DataInformedFEM, InverseSurrogate

options = command_line().parse_args()

# %%
# The paper's chain
# -----------------
# A year of the truss, measured with 0.2 % noise. The inverse surrogate is a small network that has learned simulated
# frequencies; its estimates are a first guess.

SCATTER = 0.005  # of the records, and what the model cannot follow
WIDTH = 0.2
model = make_truss()
year = make_truss_campaign(noise=0.002, random_state=0)
inverse = InverseSurrogate(bounds=WIDTH, noise=SCATTER)
fem = DataInformedFEM(model, inverse=inverse, random_state=0).fit(year.temperatures, year.frequencies)
theta = fem.estimate_parameters(year.frequencies)
print(theta.describe().loc[["mean", "std", "min", "max"]].round(3))

# %%
# One Gauss-Newton step
# ---------------------
# :func:`~skthermo.fem.linearise` gives the model's frequencies and their exact derivatives for every row of parameters
# at once.


def gauss_newton_step(model, theta: pd.DataFrame, measured: pd.DataFrame) -> pd.DataFrame:
    """Parameters improved by one Gauss-Newton step, row by row.

    ln f is nearly linear in ln theta: ln f_measured = ln f(theta) + S d, with the normalised sensitivities
    S = theta / f df/dtheta. The step d minimises the squares of (ln f_measured - ln f - S d) / SCATTER and of
    (ln theta + d) / WIDTH; the latter limit the step of parameters that hardly affect the frequencies.
    """
    frequencies, jacobian = linearise(model, theta)
    S = jacobian * theta.to_numpy()[:, np.newaxis] / frequencies[:, :, np.newaxis]
    residuals = np.log(measured.to_numpy() / frequencies)[:, :, np.newaxis]
    log_theta = np.log(theta.to_numpy())[:, :, np.newaxis]
    information = S.swapaxes(1, 2) @ S / SCATTER**2 + np.eye(S.shape[2]) / WIDTH**2
    steps = np.linalg.solve(information, S.swapaxes(1, 2) @ residuals / SCATTER**2 - log_theta / WIDTH**2)
    return theta * np.exp(steps[:, :, 0])


improved = gauss_newton_step(model, theta, year.frequencies)
twice = gauss_newton_step(model, improved, year.frequencies)

# %%
# The misfit, row by row
# ----------------------
# How far are the model's frequencies from the measured ones, with the parameters before and after?


def misfit(model, theta: pd.DataFrame, measured: pd.DataFrame) -> np.ndarray:
    """Relative difference of the model's frequencies from the measured ones in each row, root mean square, in %."""
    return 100 * np.sqrt(((linearise(model, theta)[0] / measured - 1) ** 2).mean(axis=1))


before, after, again = (misfit(model, parameters, year.frequencies) for parameters in (theta, improved, twice))
print(f"Misfit of the frequencies, mean of {len(before)} records: {before.mean():.3f} %")
print(f"After one step: {after.mean():.3f} %; after another: {again.mean():.3f} %")

histories = {"inverse surrogate": before, "after one Gauss-Newton step": after}
pd.DataFrame(histories).plot(style=".", xlabel="", ylabel="misfit of six frequencies (%)", ylim=(0, None))

# %%
# A second step changes little: the misfit that is left is noise, and the effect of temperature on zones that cut across
# the model's four parameters.
#
# The mapper learns from the improved parameters
# ----------------------------------------------
# A later year, noise-free, tells whether this helps. The last line is the default chain, whose
# :class:`~skthermo.surrogate.PosteriorInverse` takes steps until they converge, with a prior that the records teach.

mapper = clone(fem.mapper_).fit(year.temperatures, improved)
default = clone(fem).set_params(inverse=None).fit(year.temperatures, year.frequencies)
later = make_truss_campaign(noise=0.0, random_state=1)
predicted = {
    "mapper fitted to the estimates": fem.mapper_.predict(later.temperatures),
    "mapper fitted to the improved estimates": mapper.predict(later.temperatures),
    "default chain": default.predict_parameters(later.temperatures),
}
for name, parameters in predicted.items():
    print(f"Error over a later year, {name}: {misfit(model, parameters, later.frequencies).mean():.3f} %")

# %%
# The same way is open to any other change: what a stage gives is a frame, and the next stage takes any frame.

save_figures(options.figures)
