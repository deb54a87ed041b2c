"""Posterior modes of ln theta given ln f, all rows at once."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo.surrogate.refinement._shapes import MeasuredShapes

Linearise = Callable[[Array], tuple[Array, ...]]
"""Frequencies (n_samples, n_modes) and d ln f / d ln theta (n_samples, n_modes, n_parameters) at theta; where shapes
are measured, also shapes (n_samples, n_sensors, n_modes) and d phi / d ln theta."""

REACH = 3.0  # half-widths of the box, in ln theta, from its middle to the limits of an estimate
LEAST_DAMPING = 1e-14  # share of the diagonal added to precision matrices, which rounding could make singular
LONGEST_STEP = 0.5  # largest change of ln theta in one step


def deviations(information: Array) -> Array:
    """Standard deviations, (n_samples, n_parameters), of Gaussians with these precision matrices."""
    diagonal = np.einsum("spp->sp", information)
    regular = information + np.eye(diagonal.shape[1]) * (LEAST_DAMPING * diagonal)[:, np.newaxis]
    return np.sqrt(np.abs(np.einsum("spp->sp", np.linalg.inv(regular))))


@dataclass(frozen=True)
class Prior:
    """Gaussian prior of ln theta, within limits; each (n_parameters,)."""

    mean: Array
    width: Array
    lowest: Array
    highest: Array

    @classmethod
    def of_box(cls, bounds: Array, width: Array | None = None) -> "Prior":
        """The prior about the middle of a box and, without a width, with the variance of ln theta spread over it."""
        lowest, highest = np.log(bounds).T
        mean, half = np.log(bounds.mean(axis=1)), (highest - lowest) / 2
        return cls(mean, half / np.sqrt(3) if width is None else width, mean - REACH * half, mean + REACH * half)

    @property
    def limits(self) -> Array:
        """Lowest and highest multiplier of an estimate, (n_parameters, 2)."""
        return np.exp(np.column_stack([self.lowest, self.highest]))

    def information(self, sensitivity: Array, noise: Array) -> Array:
        """Precision of ln theta given derivatives of the observations and the noise, infinite where one is missing."""
        scaled = sensitivity / noise[:, :, np.newaxis]
        return scaled.swapaxes(1, 2) @ scaled + np.diag(self.width**-2.0)

    def deviations(self, sensitivity: Array, noise: Array) -> Array:
        """Posterior standard deviations of ln theta (Laplace's approximation), (n_samples, n_parameters)."""
        return deviations(self.information(sensitivity, noise))


@dataclass(frozen=True)
class Objective:
    """Half of the squared misfits of ln f, of shapes and of ln theta, in standard deviations of noise and prior.

    ``log_measured`` is NaN where a mode is missing; ``noise``, (n_samples, n_observations), holds standard deviations
    of ln f and, mode by mode, of the components of shapes of unit length.
    """

    linearise: Linearise
    log_measured: Array
    noise: Array
    prior: Prior
    shapes: MeasuredShapes | None = None

    @property
    def missing(self) -> NDArray[np.bool_]:
        """Which observations are missing, (n_samples, n_observations)."""
        missing = np.isnan(self.log_measured)
        return missing if self.shapes is None else np.hstack([missing, self.shapes.missing])

    def at(self, x: Array) -> "Local":
        """The objective of every row, and its Gauss-Newton model, at ln theta = x."""
        (frequencies, sensitivity, *modes), missing = self.linearise(np.exp(x)), self.missing
        residual = self.log_measured - np.log(frequencies)
        if self.shapes is not None:
            misfit, change = self.shapes.misfit(*modes)
            residual, sensitivity = np.hstack([residual, misfit]), np.hstack([sensitivity, change])
        residual = np.where(missing, 0.0, residual)
        distance = (x - self.prior.mean) / self.prior.width
        value = 0.5 * (((residual / self.noise) ** 2).sum(axis=1) + (distance**2).sum(axis=1))
        gradient = -np.einsum("smp,sm->sp", sensitivity, residual / self.noise**2) + distance / self.prior.width
        hessian = self.prior.information(sensitivity, np.where(missing, np.inf, self.noise))
        return Local(x, np.where(np.isfinite(value), value, np.inf), gradient, hessian, residual, sensitivity)

    def of(self, rows: NDArray) -> "Objective":
        """The objective of some rows."""
        shapes = None if self.shapes is None else self.shapes.of(rows)
        return replace(self, log_measured=self.log_measured[rows], noise=self.noise[rows], shapes=shapes)

    def without_shapes(self) -> "Objective":
        """The objective of frequencies alone."""
        return replace(self, noise=self.noise[:, : self.log_measured.shape[1]], shapes=None)

    def with_modes(self, order: NDArray) -> "Objective":
        """The objective with the measured modes in another order."""
        shapes = None if self.shapes is None else self.shapes.with_modes(order)
        n_modes, n_observations = self.log_measured.shape[1], self.noise.shape[1]
        later = np.arange(n_modes, n_observations).reshape(n_modes, -1)[order]
        noise = self.noise[:, np.append(order, later)]
        return replace(self, log_measured=self.log_measured[:, order], noise=noise, shapes=shapes)


@dataclass
class Local:
    """An `Objective` at ln theta = x, row by row, with residuals and derivatives of the observations."""

    x: Array
    value: Array
    gradient: Array
    hessian: Array
    residual: Array
    sensitivity: Array

    def step(self, prior: Prior, damping: Array) -> Array:
        """Damped Gauss-Newton step within the limits; parameters that it would carry beyond stop there."""
        held = ((self.x <= prior.lowest) & (self.gradient > 0)) | ((self.x >= prior.highest) & (self.gradient < 0))
        n_parameters = self.x.shape[1]
        diagonal = np.einsum("spp->sp", self.hessian)
        shares = np.maximum(damping, LEAST_DAMPING)[:, np.newaxis]
        damped = self.hessian + np.eye(n_parameters) * (shares * diagonal)[:, np.newaxis]
        fixed, step = np.zeros_like(self.x), np.zeros_like(self.x)
        for _ in range(n_parameters):
            free = ~held
            pull = -self.gradient - np.einsum("spq,sq->sp", damped, fixed)
            matrix = damped * (free[:, :, np.newaxis] & free[:, np.newaxis])
            matrix += np.eye(n_parameters) * (held * diagonal)[:, np.newaxis]
            step = np.where(held, fixed, np.linalg.solve(matrix, np.where(free, pull, 0.0)[:, :, np.newaxis])[:, :, 0])
            there = self.x + step
            beyond = free & ((there < prior.lowest) | (there > prior.highest))
            if not beyond.any():
                break
            at_limit = np.clip(there, prior.lowest, prior.highest) - self.x
            held, fixed = held | beyond, np.where(beyond, at_limit, fixed)
        longest = np.abs(step).max(axis=1, keepdims=True)
        step *= np.minimum(1.0, LONGEST_STEP / np.maximum(longest, LONGEST_STEP))
        return np.clip(self.x + step, prior.lowest, prior.highest) - self.x

    def gain(self, step: Array) -> Array:
        """How much a step would lower the objective if it were quadratic."""
        return -(self.gradient * step).sum(axis=1) - 0.5 * np.einsum("sp,spq,sq->s", step, self.hessian, step)

    def moved(self, step: Array, missing: NDArray[np.bool_]) -> "Local":
        """These rows after a small step: residuals and objective are those of the linearised model."""
        residual = self.residual - np.einsum("smp,sp->sm", self.sensitivity, step)
        value = self.value - self.gain(step)
        return replace(self, x=self.x + step, value=value, residual=np.where(missing, 0.0, residual))

    def put(self, rows: NDArray, other: "Local") -> None:
        """Replace some rows."""
        for mine, theirs in zip(vars(self).values(), vars(other).values(), strict=True):
            mine[rows] = theirs

    def beside(self, other: "Local") -> "Local":
        """These rows, and then others."""
        return Local(*(np.concatenate(pair) for pair in zip(vars(self).values(), vars(other).values(), strict=True)))

    def of(self, rows: NDArray) -> "Local":
        """Some rows."""
        return Local(*(values[rows] for values in vars(self).values()))
