"""Simulations that the inverse surrogate learns from."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from sklearn.utils import Bunch

from skthermo._arguments import check_noise
from skthermo._arrays import Array
from skthermo._warnings import warn_user
from skthermo.fem import sample, share_reordered
from skthermo.surrogate._box import Box
from skthermo.surrogate._memory import remembered
from skthermo.surrogate._simulator import Simulator, tolerance

ORDER_CHECKS = 256  # number of samples whose modes are looked at for another order
MANY_REORDERED = 0.1  # share of them that gives a warning: 5 % does not harm the truss, 29 % doubles the error of Z24
MIDDLE = (0.5, 99.5)  # percentiles of records that a narrower box is made for: a few wrong ones do not widen it
LEAST_HALF_WIDTH = 0.02  # smallest half-width of a narrower box, as a share of its middle


@dataclass(frozen=True)
class SimulatedTraining:
    """Samples that an `InverseSurrogate` learns from: ``theta``, ``frequencies`` and, with ``dofs``, ``shapes``.

    The box is where theta is drawn; the simulator holds the model and, with ``reduce``, its reduced model.
    """

    box: Box
    samples: Bunch
    simulator: Simulator

    @classmethod
    def of(cls, inverse: Any, random: np.random.RandomState) -> "SimulatedTraining":
        """Samples within the bounds of an `InverseSurrogate`, with warnings about modes that cannot be told apart."""
        model, names = inverse.model, tuple(inverse.model.parameter_names)
        check_noise(inverse.noise, model.n_modes, getattr(inverse, "feature_names_in_", None))
        if len(names) > model.n_modes:
            warn_user(
                f"{len(names)} parameters and {model.n_modes} modes: frequencies cannot tell the parameters apart; "
                f"expected more modes{'' if np.all(inverse.noise) else ', or the noise of the measurement'}: the prior "
                "decides between them",
                "few modes",
            )
        box = Box.of(inverse.bounds, names)
        tol = tolerance(model, inverse.reduce)
        samples, share_reordered, reduced = _draw(inverse, model, box, random, tol=tol)
        if share_reordered > MANY_REORDERED:
            warn_user(
                f"modes change their order in {share_reordered:.1%} of {min(inverse.n_samples, ORDER_CHECKS)} samples "
                "of the box, and the model sorts them: expected narrower bounds, or a model with track=True",
                "order of modes",
            )
        simulator = Simulator(model) if reduced is None else Simulator(model, reduced, box.bounds, tol)
        return cls(box, samples, simulator)

    def narrower(self, inverse: Any, random: np.random.RandomState, estimates: Array) -> "SimulatedTraining":
        """As many samples from the part of the box where records have their parameters, as far as estimates tell."""
        n_known = np.count_nonzero(~np.isnan(estimates).any(axis=1))
        if n_known < 2:
            raise ValueError(
                f"narrow_bounds is set, but fit got {n_known} records with all modes; expected at least 2, whose "
                "parameters the bounds are narrowed to"
            )
        box = Box(narrower(self.box.bounds, estimates), self.box.names)
        model = self.simulator.reduced or self.simulator.model
        samples = _draw(inverse, model, box, random, tol=None)[0]
        return SimulatedTraining(box, samples, self.simulator)


def narrower(bounds: Array, theta: Array) -> Array:
    """The range of the parameters of records and half of it on either side, within the bounds; (n_parameters, 2)."""
    lowest, highest = np.nanpercentile(theta, MIDDLE, axis=0)
    middle = np.clip((lowest + highest) / 2, *bounds.T)
    half = np.maximum(highest - lowest, LEAST_HALF_WIDTH * middle)
    return np.column_stack([np.maximum(middle - half, bounds[:, 0]), np.minimum(middle + half, bounds[:, 1])])


def _draw(
    inverse: Any, model: Any, box: Box, random: np.random.RandomState, *, tol: float | None
) -> tuple[Bunch, float, Any]:
    """Samples, share with modes in another order, reduced model; read from the memory if they are there."""
    settings = (box.bounds, inverse.n_samples, tol, inverse.dofs, random.randint(np.iinfo(np.int32).max))
    make = partial(simulations, model, *settings, n_jobs=inverse.n_jobs)
    return remembered(inverse.memory, "simulations", make, lambda: (model, settings))


def simulations(
    model: Any, bounds: Any, n_samples: int, tol: float | None, dofs: Any, seed: int, *, n_jobs: int | None
) -> tuple[Bunch, float, Any]:
    """Random samples, the share with modes in another order, and the reduced model if ``tol`` is given, else None."""
    reduced = None if tol is None else model.reduced(bounds, tol=tol, random_state=seed)
    model = reduced or model
    drawn = sample(model, bounds, n_samples, dofs=dofs, n_jobs=n_jobs, random_state=seed)
    sorts = not getattr(model, "track", True) and hasattr(model, "modes")
    return drawn, share_reordered(model, drawn.theta[:ORDER_CHECKS]) if sorts else 0.0, reduced
