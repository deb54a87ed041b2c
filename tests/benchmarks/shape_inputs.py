"""How much better the inverse surrogate knows parameters if it sees mode shapes at sensors beside frequencies.

    OMP_NUM_THREADS=1 python tests/benchmarks/shape_inputs.py

On the truss and on the railway bridge KW51 with the 12 channels of its monitoring. Test rows come from the full FE
models, with noise on frequencies and on shapes. Both are posterior modes.
"""

import numpy as np
import pandas as pd
from harness import arguments, shown

from skthermo.datasets import kw51_sensors, make_kw51, make_truss
from skthermo.fem import add_noise, sample
from skthermo.surrogate import PosteriorInverse
from skthermo.updating import identifiability

BOTTOM_CHORD = [1, 3, 5, 7]
"""Vertical displacements of the four inner nodes of the truss's bottom chord."""
MARGIN = 1.5
"""Width of the reduced model's box over that of the parameters, since estimates may leave the latter."""


def measured(model, bounds, dofs, options):
    """Parameters, noisy frequencies, and the same with noisy components of shapes."""
    drawn = sample(model, bounds, options.rows, dofs=dofs, random_state=1)
    random = np.random.RandomState(2)
    F = add_noise(drawn.frequencies, options.noise, random_state=random)
    shapes = drawn.shapes.swapaxes(1, 2)
    size = np.sqrt((shapes**2).mean(axis=2, keepdims=True))
    shapes = shapes + options.shape_noise * size * random.standard_normal(shapes.shape)
    return drawn.theta, F, np.hstack([F, shapes.reshape(len(F), -1)])


def errors(parameter, full, model, bounds, dofs, options):
    """Mean error of a parameter from frequencies, and from both; the worst coverage of intervals of any parameter."""
    dofs = list(dofs)
    theta, F, both = measured(full, bounds, dofs, options)
    column, row, stalled = model.parameter_names.index(parameter), {}, []
    settings = {"noise": options.noise, "prior": bounds / np.sqrt(3)}
    shapes = {"dofs": dofs, "shape_noise": options.shape_noise}
    for inputs, X, more in (("frequencies", F, {}), ("frequencies and shapes", both, shapes)):
        found = PosteriorInverse(model, **settings, **more).fit(X).invert(X)
        known = found.converged
        row[f"error from {inputs}, %"] = 100 * np.abs(found.theta / theta - 1)[known, column].mean()
        stalled.append(f"{(~known).sum()}")
        held = 100 * (np.abs(found.theta - theta) < 1.645 * found.std)[known].mean(axis=0)
    row["rows not converged"] = ", ".join(stalled)
    return row | {"parameters in 90 % intervals, %": f"{held.min():.0f} to {held.max():.0f}"}


def more_modes(options):
    """What three further modes bring instead, by Cramer-Rao."""
    sensors = list(kw51_sensors().values())
    known = {
        "six frequencies": identifiability(make_kw51(), noise=options.noise),
        "and their shapes": identifiability(
            make_kw51(), noise=options.noise, dofs=sensors, shape_noise=options.shape_noise
        ),
        "nine frequencies": identifiability(make_kw51(n_modes=9), noise=options.noise),
    }
    return pd.DataFrame({name: 100 * each.deviations for name, each in known.items()}).T


def main():
    options = arguments(
        __doc__,
        rows=(60, "test rows"),
        noise=(0.001, "relative deviation of the noise of frequencies"),
        shape_noise=(0.01, "noise of shapes, a share of their rms"),
        models=["truss", "KW51"],
    )
    rows = {}
    if "truss" in options.models:
        truss = make_truss()
        for where, dofs in (("4 sensors at the bottom chord", BOTTOM_CHORD), ("all 23 degrees of freedom", range(23))):
            rows[f"truss, vertical, within 30 %; {where}"] = errors("vertical", truss, truss, 0.3, dofs, options)
    if "KW51" in options.models:
        full = make_kw51()
        for bounds in (0.3, 0.1):
            reduced = full.reduced(MARGIN * bounds, tol=1e-6, random_state=0)
            name = f"KW51, E_pip, within {bounds:.0%}; its 12 channels"
            rows[name] = errors("E_pip", full, reduced, bounds, kw51_sensors().values(), options)
    title = f"Noise of {options.noise:.1%} of frequencies, {options.shape_noise:.0%} of shapes; {options.rows} records"
    shown(title, pd.DataFrame(rows).T)
    if "KW51" in options.models:
        shown("KW51: smallest standard deviations of the parameters, %", more_modes(options), 1)


if __name__ == "__main__":
    main()
