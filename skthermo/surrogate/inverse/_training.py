"""Simulations that the inverse surrogate learns from."""

from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from sklearn.utils import Bunch

from skthermo._estimators.arguments import is_auto, tolerance
from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import FewRecordsWarning, ModelWarning
from skthermo.fem import sample, share_reordered
from skthermo.surrogate._memory import remembered
from skthermo.surrogate._simulator import NO_BASIS, SOLVES_PER_ROW, Box, Simulator, reason_of

ORDER_CHECKS = 256  # number of samples whose modes are looked at for another order
MANY_REORDERED = 0.1  # share of them that gives a warning: 5 % does not harm the truss, 29 % doubles the error of Z24
MIDDLE = (0.5, 99.5)  # percentiles of records that a narrower box is made for: a few wrong ones do not widen it
N_HELD_OUT = 500  # simulations that a score is of
HELD_OUT_SEED = 20_260_000  # of them: the same for all settings that are compared
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
    def of(cls, inverse: Any, random: np.random.RandomState, n_refined: int) -> "SimulatedTraining":
        """Samples within the bounds of an `InverseSurrogate`, with warnings about modes that cannot be told apart.

        ``n_refined`` records are expected to be refined afterwards.
        """
        model, names = inverse.model, tuple(inverse.model.parameter_names)
        if len(names) > model.n_modes:
            warn_user(
                f"{len(names)} parameters and {model.n_modes} modes: frequencies cannot tell the parameters apart; "
                "expected more modes: the prior decides between them",
                FewRecordsWarning,
                "few modes",
            )
        box = Box.of(inverse.bounds, names)
        n_simulated = (1 + inverse.narrow_bounds) * inverse.n_samples
        tol = tolerance(model, inverse.reduce, n_simulated + SOLVES_PER_ROW * n_refined)
        samples, share_reordered, reduced = _draw(inverse, model, box, random, tol=tol)
        if share_reordered > MANY_REORDERED:
            warn_user(
                f"modes change their order in {share_reordered:.1%} of {min(inverse.n_samples, ORDER_CHECKS)} samples "
                "of the box, and the model sorts them: expected narrower bounds, or a model with track=True",
                ModelWarning,
                "order of modes",
            )
        if reduced is None:
            reason = reason_of(model, inverse.reduce) if tol is None else NO_BASIS
            return cls(box, samples, Simulator(model, reason=reason))
        return cls(box, samples, Simulator(model, reduced, box.bounds, tol))

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


def held_out(inverse: Any, noise: ArrayLike) -> tuple[Array, Array]:
    """Noisy columns and parameters of simulations in the box of a fitted inverse that it has not learned from."""
    random, simulator = np.random.RandomState(HELD_OUT_SEED), inverse.simulator_
    model = simulator.reduced or simulator.model
    samples = _draw(inverse, model, inverse.box_, random, tol=None, n_samples=N_HELD_OUT)[0]
    return inverse.columns_.noisy(samples, noise, random), samples.theta


def narrower(bounds: Array, theta: Array) -> Array:
    """The range of the parameters of records and half of it on either side, within the bounds; (n_parameters, 2)."""
    lowest, highest = np.nanpercentile(theta, MIDDLE, axis=0)
    middle = np.clip((lowest + highest) / 2, *bounds.T)
    half = np.maximum(highest - lowest, LEAST_HALF_WIDTH * middle)
    return np.column_stack([np.maximum(middle - half, bounds[:, 0]), np.minimum(middle + half, bounds[:, 1])])


def _draw(
    inverse: Any,
    model: Any,
    box: Box,
    random: np.random.RandomState,
    *,
    tol: float | None,
    n_samples: int | None = None,
) -> tuple[Bunch, float, Any]:
    """Samples, share with modes in another order, reduced model; read from the memory if they are there."""
    n_samples = inverse.n_samples if n_samples is None else n_samples
    seed, may_fail = random.randint(np.iinfo(np.int32).max), is_auto(inverse.reduce)
    settings = (box.bounds, n_samples, tol, inverse.dofs, seed, may_fail)
    make = partial(simulations, model, *settings, n_jobs=inverse.n_jobs)
    return remembered(inverse.memory, "simulations", make, lambda: (model, settings))


def simulations(
    model: Any,
    bounds: Any,
    n_samples: int,
    tol: float | None,
    dofs: Any,
    seed: int,
    may_fail: bool,
    *,
    n_jobs: int | None,
) -> tuple[Bunch, float, Any]:
    """Random samples, the share with modes in another order, and the reduced model if ``tol`` is given, else None.

    If making the reduced model ``may_fail``, it is None too where no basis is accurate.
    """
    reduced = None
    if tol is not None:
        try:
            reduced = model.reduced(bounds, tol=tol, random_state=seed)
        except RuntimeError:
            if not may_fail:
                raise
    model = reduced or model
    drawn = sample(model, bounds, n_samples, dofs=dofs, n_jobs=n_jobs, random_state=seed)
    sorts = not getattr(model, "track", True) and hasattr(model, "modes")
    return drawn, share_reordered(model, drawn.theta[:ORDER_CHECKS]) if sorts else 0.0, reduced
