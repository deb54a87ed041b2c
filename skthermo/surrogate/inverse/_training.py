"""What an inverse surrogate reads, learns from and inverts: columns, simulations, records of fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from joblib import Memory
from numpy.typing import ArrayLike
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.utils import Bunch

from skthermo._estimators.answers import content_of
from skthermo._estimators.memory import folder_of, identity_of, remembered
from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, as_floats, is_auto, tolerance
from skthermo._tables.frames import Table, column_names
from skthermo._validation import validate_data
from skthermo.exceptions import FewRecordsWarning, ModelWarning
from skthermo.fem import FEModel, add_noise, evaluate, sample, share_reordered
from skthermo.surrogate._simulator import NO_BASIS, SOLVES_PER_ROW, Box, Simulator, reason_of
from skthermo.surrogate.inverse._refinement import Refinement, ResponseSurface, ShapeInputs


@dataclass(frozen=True)
class InverseColumns:
    """How an `InverseSurrogate` reads, names and computes its columns: frequencies and, perhaps, shapes."""

    model: FEModel
    shapes: ShapeInputs | None
    n_jobs: int | None

    @classmethod
    def of(cls, inverse: Any) -> InverseColumns:
        """The columns that the parameters of an `InverseSurrogate` ask for."""
        if inverse.dofs is None:
            return cls(inverse.model, None, inverse.n_jobs)
        if inverse.model is None:
            raise ValueError("dofs are given without a model; expected an FE model whose degrees of freedom they are")
        return cls(inverse.model, ShapeInputs.of(inverse.model, inverse.dofs, inverse.shape_noise), inverse.n_jobs)

    def names(self) -> list[str]:
        modes = [f"f{i + 1}" for i in range(self.model.n_modes)]
        dofs = () if self.shapes is None else self.shapes.dofs
        return modes + [f"shape{i + 1}_dof{dof}" for i in range(self.model.n_modes) for dof in dofs]

    def check(self, inverse: Any, X: Table) -> None:
        """Check number and names of the columns; without X, they are those of an array."""
        n_columns = len(self.names())
        names_only = np.ones((1, n_columns)) if X is None else X
        found = validate_data(inverse, names_only).shape[1]
        if found != n_columns:
            more = f" and their shapes at {self.shapes.n_sensors} sensors, {n_columns} columns" if self.shapes else ""
            raise ValueError(f"X has {found} columns; expected the {self.model.n_modes} modes of {self.model!r}{more}")

    def read(self, inverse: Any, X: ArrayLike) -> Array:
        """Measured columns, with shapes normalised."""
        has_names = hasattr(inverse, "feature_names_in_") or not hasattr(X, "columns")
        values = X if has_names else as_floats(X)
        inputs = validate_data(inverse, values, dtype=np.float64, reset=False)
        frequencies = inputs if self.shapes is None else inputs[:, : self.shapes.n_modes]
        if inverse.inputs_.log and (frequencies <= 0).any():
            row, column = np.argwhere(frequencies <= 0)[0]
            raise ValueError(
                f"row {row} of {column_names(X, 'f')[column]!r} is {frequencies[row, column]:g}; expected positive "
                "frequencies in Hz, NaN where one is missing"
            )
        return inputs if self.shapes is None else self.shapes.normalised(inputs)

    def of_parameters(self, theta: ArrayLike) -> Array:
        """Columns that the model gives for rows of theta, without noise."""
        if self.shapes is None:
            return evaluate(self.model, theta, n_jobs=self.n_jobs)
        return self.shapes.of_parameters(self.model, theta, self.n_jobs)

    def noisy(self, drawn: Bunch, noise: ArrayLike, random: np.random.RandomState) -> Array:
        """Columns of simulated samples with the noise of a measurement."""
        frequencies = add_noise(drawn.frequencies, noise, random_state=random)
        if self.shapes is None:
            return frequencies
        shapes = drawn.shapes.swapaxes(1, 2).reshape(len(frequencies), -1)
        return self.shapes.with_noise(self.shapes.normalised(np.hstack([frequencies, shapes])), random)


class ShapeScores:
    """A few positive scores in place of many components: linear estimates of the parameters from noisy simulations."""

    def __init__(self, n_modes: int, inputs: Array, theta: Array):
        self._n_modes = n_modes
        complete = ~(np.isnan(inputs).any(axis=1) | np.isnan(theta).any(axis=1))
        self._linear = make_pipeline(StandardScaler(), Ridge())
        self._linear.fit(self._columns(inputs[complete]), np.log(theta[complete]))

    def transform(self, inputs: Array) -> Array:
        """Frequencies and scores, (n_samples, n_modes + n_parameters); NaN in rows that are not complete."""
        scores = np.full((len(inputs), self._linear[-1].coef_.shape[0]), np.nan)
        complete = ~np.isnan(inputs).any(axis=1)
        if complete.any():
            scores[complete] = np.exp(self._linear.predict(self._columns(inputs[complete])))
        return np.hstack([inputs[:, : self._n_modes], scores])

    def _columns(self, inputs: Array) -> Array:
        return np.hstack([np.log(inputs[:, : self._n_modes]), inputs[:, self._n_modes :]])


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
    def of(cls, inverse: Any, random: np.random.RandomState, n_refined: int) -> SimulatedTraining:
        """Samples within the bounds of an `InverseSurrogate`; ``n_refined`` records are to be refined afterwards."""
        model, names = inverse.model, tuple(inverse.model.parameter_names)
        if len(names) > model.n_modes:
            warn_user(
                f"{len(names)} parameters and {model.n_modes} modes: frequencies cannot distinguish all parameters. "
                "The prior decides between them. Use more modes, shapes or fewer parameters",
                FewRecordsWarning,
                "underdetermined",
            )
        box = Box.of(inverse.bounds, names)
        n_simulated = (1 + inverse.narrow_bounds) * inverse.n_samples
        tol = tolerance(model, inverse.reduce, n_simulated + SOLVES_PER_ROW * n_refined)
        samples, share_reordered, reduced = _draw(inverse, model, box, random, tol=tol)
        if share_reordered > MANY_REORDERED:
            warn_user(
                f"modes change their order in {share_reordered:.1%} of {min(inverse.n_samples, ORDER_CHECKS)} samples "
                f"within the bounds (expected at most {MANY_REORDERED:.0%}). The model sorts them, so that a column is "
                "not always the same mode. Use narrower bounds, or a model with track=True",
                ModelWarning,
                "modes-cross",
            )
        if reduced is None:
            reason = reason_of(model, inverse.reduce) if tol is None else NO_BASIS
            return cls(box, samples, Simulator(model, reason=reason))
        return cls(box, samples, Simulator(model, reduced, box.bounds, tol))

    def narrower(self, inverse: Any, random: np.random.RandomState, estimates: Array) -> SimulatedTraining:
        """As many samples from the part of the box where records have their parameters, by estimates."""
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
    model: FEModel,
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
    model: FEModel,
    bounds: Any,
    n_samples: int,
    tol: float | None,
    dofs: Any,
    seed: int,
    may_fail: bool,
    *,
    n_jobs: int | None,
) -> tuple[Bunch, float, Any]:
    """Random samples, the share with modes in another order, and the reduced model if ``tol`` is given, else None; it
    is None, too, where no basis is accurate and that ``may_fail``."""
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


@dataclass(frozen=True)
class Inversions:
    """Inversions by a refinement; those of the records of `InverseSurrogate.fit` are read from its memory.

    ``content`` and ``seen`` identify what `fit` saw with and without refinement and guess; empty without a memory.
    """

    refinement: Refinement
    memory: str | Memory | None = None
    content: str = ""
    seen: str = ""

    @classmethod
    def of(cls, memory: str | Memory | None, refinement: Refinement, inputs: Array, guess: Array) -> Inversions:
        """Inversions by a refinement that is adapted to the inputs of `fit` and the regressor's guess."""
        if folder_of(memory) is None:
            return cls(refinement.adapted(inputs, guess))
        content = identity_of(replace(refinement, n_jobs=None), inputs, guess)
        simulator, surface = remembered(
            memory, "adaptation", lambda: _changes(refinement, refinement.adapted(inputs, guess)), lambda: (content,)
        )
        if simulator is not None:
            simulator = replace(simulator, model=refinement.simulator.model)  # not the copy that was read
        adapted = replace(refinement, simulator=simulator or refinement.simulator, surface=surface)
        return cls(adapted, memory, content, content_of(inputs))

    def found(self, inputs: Array, guess: Array, scatter: Array) -> Bunch:
        """What `Refinement.refined` gives."""
        folder = folder_of(self.memory)
        is_kept = folder is not None and folder.is_dir() and content_of(inputs) == self.seen
        return remembered(
            self.memory if is_kept else None,
            "inversion",
            lambda: self.refinement.refined(inputs, guess, scatter),
            lambda: (self.content, self.refinement.noise, guess, scatter),
        )

    def scatter(self, inputs: Array, guess: Array) -> Array:
        """What `Refinement.estimated_scatter` gives for the inputs of `fit`."""
        is_stated = bool(self.refinement.noise.all())
        return remembered(
            None if is_stated else self.memory,
            "scatter",
            lambda: self.refinement.estimated_scatter(inputs, guess),
            lambda: (self.content,),
        )

    def tells_noise(self, inputs: Array) -> bool:
        """Whether the scatter of the inputs of `fit` was estimated from them, and not stated or assumed."""
        n_modes, n_parameters = len(self.refinement.noise), len(self.refinement.prior.mean)
        complete = ~np.isnan(inputs).any(axis=1)
        return not self.refinement.noise.all() and n_modes > n_parameters and complete.sum() > n_parameters

    def with_noise(self, noise: Array) -> Inversions:
        """The same inversions of frequencies with noise."""
        return replace(self, refinement=replace(self.refinement, noise=noise, recent=[]))


def _changes(before: Refinement, after: Refinement) -> tuple[Simulator | None, ResponseSurface | None]:
    """What an adapted refinement has of its own; no simulator where it has the same as before."""
    return None if after.simulator is before.simulator else after.simulator, after.surface
