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
WANTED = {"truss": ("vertical", 0.30), "KW51": ("E_pip", 0.20)}


def measured(model, bounds, dofs, options):
    """Parameters, noisy frequencies, and the same with noisy components of shapes."""
    drawn = sample(model, bounds, options.rows, dofs=dofs, random_state=1)
    random = np.random.RandomState(2)
    F = add_noise(drawn.frequencies, options.noise, random_state=random)
    shapes = drawn.shapes.swapaxes(1, 2)
    size = np.sqrt((shapes**2).mean(axis=2, keepdims=True))
    shapes = shapes + options.shape_noise * size * random.standard_normal(shapes.shape)
    return drawn.theta, F, np.hstack([F, shapes.reshape(len(F), -1)])


def print_errors(name, title, full, model, bounds, dofs, options):
    """Mean errors of the parameters from frequencies, and from both."""
    dofs = list(dofs)
    theta, F, both = measured(full, bounds, dofs, options)
    settings = {"noise": options.noise, "prior": bounds / np.sqrt(3)}
    shapes = {"dofs": dofs, "shape_noise": options.shape_noise}
    rows, solved = {}, {}
    for inputs, X, more in (("frequencies", F, {}), ("frequencies and shapes", both, shapes)):
        known = identifiability(model, noise=options.noise, **more).deviations
        rows["Cramer-Rao at the nominal state", inputs] = 100 * known
        found = PosteriorInverse(model, **settings, **more).fit(X).invert(X)
        error = 100 * np.abs(found.theta / theta - 1).mean(axis=0)
        rows["posterior mode", inputs] = solved[inputs] = pd.Series(error, known.index)
        held = (np.abs(found.theta - theta) < 1.645 * found.std).mean(axis=0)
        rows["coverage of 90 % intervals", inputs] = pd.Series(100 * held, known.index)
        if not found.converged.all():
            print(f"{(~found.converged).sum()} of {len(X)} rows from {inputs} have not converged")
    shown(f"Mean errors of {name}, box of {bounds:.0%}, {title}, %", pd.DataFrame(rows).T)
    parameter, least = WANTED[name]
    gain = 1 - solved["frequencies and shapes"][parameter] / solved["frequencies"][parameter]
    wanted = f", at least {least:.0%} wanted" if bounds == max(options.boxes) else ""
    print(f"error of {parameter!r}: {gain:.0%} lower with shapes{wanted}")


def print_more_modes(options):
    """What three further modes bring instead, by Cramer-Rao."""
    known = {
        "frequencies of 6 modes": identifiability(make_kw51(), noise=options.noise),
        "the same, with shapes at 12 channels": identifiability(
            make_kw51(), noise=options.noise, dofs=list(kw51_sensors().values()), shape_noise=options.shape_noise
        ),
        "frequencies of 9 modes": identifiability(make_kw51(n_modes=9), noise=options.noise),
    }
    table = pd.DataFrame({name: 100 * each.deviations for name, each in known.items()}).T
    shown("KW51: smallest standard deviations at the nominal state (Cramer-Rao), %", table)


def main():
    options = arguments(
        __doc__,
        rows=(300, "test rows"),
        noise=(0.001, "relative deviation of the noise of frequencies"),
        shape_noise=(0.01, "noise of shapes, a share of their rms"),
        boxes=([0.3, 0.1], "half-widths of the box"),
        models=["truss", "KW51"],
    )
    for bounds in options.boxes:
        if "truss" in options.models:
            truss = make_truss()
            print_errors("truss", "sensors at 4 degrees of freedom", truss, truss, bounds, BOTTOM_CHORD, options)
            print_errors("truss", "sensors at all 23 degrees of freedom", truss, truss, bounds, range(23), options)
        if "KW51" in options.models:
            full, sensors = make_kw51(), kw51_sensors().values()
            reduced = full.reduced(MARGIN * bounds, tol=1e-6, random_state=0)
            print_errors("KW51", "its 12 channels", full, reduced, bounds, sensors, options)
    if "KW51" in options.models:
        print_more_modes(options)


if __name__ == "__main__":
    main()
