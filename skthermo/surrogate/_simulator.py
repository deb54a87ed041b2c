"""Frequencies of many rows: by the reduced model inside its box of parameters, by the full model outside."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pickle import PicklingError
from threading import Lock
from typing import Any

import joblib
import numpy as np
from numpy.typing import NDArray

from skthermo._core.arrays import Array, Reduce, is_auto, tolerance
from skthermo._core.warnings import warn_user
from skthermo.exceptions import ModelWarning
from skthermo.fem import AffineModel, FEModel, FrequencySurface, ReducedModel, evaluate, linearise, linearise_modes

SOLVES_PER_ROW = 3  # for predictions and simulations, and to refine the parameters of a record
MARGIN, LEAST_MARGIN = 0.25, 0.05  # around learned parameters: shares of their range, and of their values
MOST_KEPT = 25_000_000  # numbers, of 8 bytes, in the bases of reduced models that are kept
NO_BASIS = "no reduced model is accurate where the parameters of the records are"
NO_GAIN = "a reduced model would save no time"
NUMBERS_PER_DOF = 100  # that a simulator counts as beside bases, at most
SHARE_OF_SURFACE = 0.4  # of the error that a reduced model may have
ROWS_PER_SOLVE = 4  # rows for which frequencies are wanted, for each row that is solved to make a surface
MARGIN_OF_SEVERITY = 0.02  # margin of severities around those asked for, within which a reduced model is accurate


def box_around(theta: Array) -> Array:
    """Lowest and highest of each parameter in rows of theta, with a margin; (n_parameters, 2)."""
    lowest, highest = np.nanmin(theta, axis=0), np.nanmax(theta, axis=0)
    margin = np.maximum(MARGIN * (highest - lowest), LEAST_MARGIN * lowest)
    return np.column_stack([np.maximum(lowest - margin, lowest / 2), highest + margin])


class KnownChanges:
    """Simulators of changed structures, whose reduced models are made once; copies and other processes begin with none.

    Those asked for last are kept, as many as have `MOST_KEPT` numbers in their bases. ``surfaces`` are those of one
    structure by the degree up to which they may go, None where none is accurate, and ``solved`` counts its rows.
    """

    def __init__(self) -> None:
        self._simulators: dict[str, Simulator] = {}
        self.surfaces: dict[int, FrequencySurface | None] = {}
        self.solved: Counter[str] = Counter()
        self._lock = Lock()

    def __reduce__(self) -> tuple[type[KnownChanges], tuple[()]]:
        return KnownChanges, ()

    def __iter__(self) -> Iterator[Simulator]:
        return iter([*self._simulators.values()])

    def simulator(self, make: Callable[[], Simulator], *change: Any) -> Simulator:
        """What ``make`` gives for a change, made now or before."""
        try:
            key = joblib.hash(change)
        except PicklingError:
            return make()
        found = self._simulators.get(key) or make()
        with self._lock:
            self._simulators.pop(key, None)
            self._simulators[key] = found  # the last one
            size = sum(one.size for one in self._simulators.values())
            while size > MOST_KEPT:
                oldest = next(iter(self._simulators))
                size -= self._simulators.pop(oldest).size
        return found


@dataclass(frozen=True)
class Simulator:
    """An FE model and, where there is one, its reduced model, which is accurate within a box (n_parameters, 2).

    Without one, the ``reason`` says why. Frequencies of many rows come from a `~skthermo.fem.FrequencySurface` near the
    rows of theta that the weather gives, ``usual``, if there are such.
    """

    model: FEModel
    reduced: Any = None
    box: Array | None = None
    tol: float = 1e-5
    reason: str = ""
    usual: Array | None = None
    _known: KnownChanges = field(default_factory=KnownChanges, init=False, repr=False, compare=False)

    @classmethod
    def around(
        cls,
        model: FEModel,
        theta: Array,
        reduce: Reduce,
        known: Simulator | None = None,
        *,
        n_rows: int | None = None,
    ) -> Simulator:
        """The simulator with, if it is to be reduced, a reduced model for a box around rows of theta.

        It will be used for ``n_rows``, by default for these. A known simulator is taken if its reduced model is of the
        same model, as accurate, and covers that box.
        """
        auto, box = is_auto(reduce), box_around(theta)
        tol = tolerance(model, reduce, SOLVES_PER_ROW * (len(theta) if n_rows is None else n_rows))
        allowed = 1e-5 if auto else tol
        usual = theta if reduce and isinstance(model, AffineModel | ReducedModel) else None
        if known is not None and known.model is model and known.box is not None and allowed is not None:
            covers = (known.box[:, 0] <= box[:, 0]).all() and (box[:, 1] <= known.box[:, 1]).all()
            if covers and known.tol <= allowed:
                return replace(known, usual=usual)
        if tol is None:
            reason = NO_GAIN if hasattr(model, "reduction_pays") else "it has no reduced model"
            return cls(model, reason=reason if auto else "reduce=False", usual=usual)
        if known is not None and known.model is model and known.reason == NO_BASIS:
            return replace(known, usual=usual)
        try:
            return cls(model, model.reduced(box, tol=tol, random_state=0), box, tol, usual=usual)
        except RuntimeError as error:
            if not auto:
                ranges = ", ".join(
                    f"{name!r} {low:.3g} to {high:.3g}"
                    for name, (low, high) in zip(model.parameter_names, box, strict=True)
                )
                warn_user(
                    f"no reduced model is accurate to {tol:g} where the parameters of the records are ({ranges}): "
                    f"{error}. The full model solves all rows, which takes long. Update the model to the records",
                    ModelWarning,
                    "no-reduced-model",
                )
            return cls(model, reason=NO_BASIS, usual=usual)

    @property
    def described(self) -> str:
        """One sentence: which model solves, and why."""
        if self.reduced is None:
            return f"Solved by the full model: {self.reason or 'reduce=False'}."
        return (
            f"Solved by a reduced model of {self.reduced.basis_size_} coordinates (of {self.reduced.n_dof}), accurate "
            f"to {self.tol:g}."
        )

    @property
    def size(self) -> int:
        """Number of numbers in the bases of reduced models and in surfaces; 0 for a full model that has none."""
        bases = sum(model.basis_size_ * model.n_dof for model in (self.model, self.reduced) if hasattr(model, "full"))
        own = 0 if self.usual is None else NUMBERS_PER_DOF * getattr(self.model, "n_dof", NUMBERS_PER_DOF)
        return bases + own + sum(one.size for one in self._known.surfaces.values() if one is not None)

    @property
    def solved(self) -> dict[str, int]:
        """How many rows of frequencies came from surfaces, from reduced and from full models, of all structures."""
        counts = [self._known.solved, *(one.solved for one in self._known)]
        return {way: sum(count[way] for count in counts) for way in ("surface", "reduced", "full")}

    def extended(self, theta: Array) -> Simulator:
        """The simulator whose reduced model also covers a box around rows of theta.

        Where no basis is accurate in so wide a box, the reduced model stays as it is.
        """
        if self.box is None or not self.outside(theta).any():
            return self
        wanted = box_around(theta)
        lowest, highest = np.minimum(self.box[:, 0], wanted[:, 0]), np.maximum(self.box[:, 1], wanted[:, 1])
        box = np.column_stack([lowest, highest])
        try:
            return Simulator(self.model, self.reduced.reduced(box, tol=self.tol, random_state=0), box, self.tol)
        except RuntimeError:
            return self

    @property
    def approximate(self) -> Simulator:
        """The simulator that takes the reduced model, if there is one, outside its box as well."""
        return self if self.reduced is None else Simulator(self.reduced.quiet())

    def changed(self, method: str, *args: Any, **options: Any) -> Simulator:
        """The simulator of the structure that a method of the model gives, such as "damaged"."""
        if not hasattr(self.model, method):
            raise ValueError(f"{self.model!r} has no method {method!r}; expected a model with one, such as AffineModel")

        def make() -> Simulator:
            reduced = None if self.reduced is None else getattr(self.reduced, method)(*args, **options)
            model = getattr(self.model, method)(*args, **options)
            return Simulator(model, reduced, self.box, self.tol, self.reason, self.usual)

        return self._known.simulator(make, method, args, options) if self.size else make()

    def damaged(self, damage: Mapping[str, float] | None) -> Simulator:
        """The simulator of the damaged structure; itself without damage."""
        return self.changed("damaged", damage) if damage else self

    def with_damage_parameters(self, groups: list[str], lowest: float, highest: float) -> Simulator:
        """The simulator whose rows of theta end with 1 - severity of each group."""
        severities = (min(lowest, 0.0) - MARGIN_OF_SEVERITY, min(max(highest, 0.0) + MARGIN_OF_SEVERITY, 0.99))
        changed = self.changed("with_damage_parameters", groups, severities=severities)
        if self.box is None:
            return replace(changed, usual=None)
        factors = np.tile([1 - severities[1], 1 - severities[0]], (len(groups), 1))
        return Simulator(changed.model, changed.reduced, np.vstack([self.box, factors]), self.tol)

    def with_columns(self, groups: Sequence[str], masses: Mapping[str, Any], box: Array | None) -> Simulator:
        """The simulator whose rows of theta end with 1 - severity of each group and 1 + amount of each mass.

        Within the box, (n_columns, 2), a reduced model is used, if there is a box.
        """

        def make() -> Simulator:
            model: Any = getattr(self.model, "full", self.model)
            model = model.with_damage_parameters(groups) if groups else model
            model = model.with_mass_parameters(masses) if masses else model
            if box is None:
                return Simulator(model)
            return Simulator(model, model.reduced(box, tol=self.tol, random_state=0), box, self.tol)

        return make() if box is None else self._known.simulator(make, "with_columns", list(groups), dict(masses), box)

    def frequencies(
        self, theta: Array, n_jobs: int | None = None, *, warn: bool = True, n_rows: int | None = None
    ) -> Array:
        """Frequencies in Hz, (n_samples, n_modes); NaN in rows with NaN.

        If frequencies of ``n_rows`` rows will be asked for, they come from a surface where that saves time. By default
        these rows are all, and a model that is not reduced has no surface.
        """
        surface = self._surface(n_rows if n_rows is not None else len(theta) * (self.reduced is not None), n_jobs)
        if surface is None:
            return self._solved(theta, n_jobs, warn)
        known = ~np.isnan(theta).any(axis=1)
        frequencies = np.full((len(theta), self.model.n_modes), np.nan)
        frequencies[known], served = surface.frequencies(theta[known])
        self._known.solved["surface"] += int(served.sum())
        left = np.flatnonzero(known)[~served]
        if len(left):
            frequencies[left] = self._solved(theta[left], n_jobs, warn)
        return frequencies

    def _surface(self, n_rows: int, n_jobs: int | None) -> FrequencySurface | None:
        """The surface that saves time for so many rows; None where there is none."""
        if self.usual is None:
            return None
        surfaces = self._known.surfaces
        degree = FrequencySurface.degree_within(n_rows // ROWS_PER_SOLVE, self.usual.shape[1])
        if degree not in surfaces:
            tol, solve = SHARE_OF_SURFACE * self.tol, partial(self._solved, n_jobs=n_jobs, warn=False)
            try:
                found = FrequencySurface(solve, self.usual, tol=tol, highest_degree=degree, bounds=self.box)
            except RuntimeError:
                found = None
            surfaces[degree] = found
        return surfaces[degree]

    def _solved(self, theta: Array, n_jobs: int | None, warn: bool) -> Array:
        """Frequencies by the reduced model in its box, by the full one elsewhere."""
        outside = self.outside(theta)
        self._known.solved.update(reduced=int((~outside).sum()), full=int(outside.sum()))
        if self.reduced is None:
            return evaluate(self.model, theta, n_jobs=n_jobs)
        frequencies = np.full((len(theta), self.model.n_modes), np.nan)
        frequencies[~outside] = evaluate(self.reduced, theta[~outside], n_jobs=n_jobs)
        if outside.any():
            if warn:
                warn_user(
                    f"{outside.sum()} of {len(theta)} rows are outside the box of the reduced model: their weather is "
                    "outside that of the training rows. The full model solves them, which takes longer. Train on such "
                    "weather, or give reduce=False",
                    ModelWarning,
                    "outside-reduced-model",
                )
            frequencies[outside] = evaluate(self.model, theta[outside], n_jobs=n_jobs)
        return frequencies

    def linearise(
        self, theta: Array, n_jobs: int | None = None, dofs: NDArray[np.intp] | None = None, *, relative: bool = False
    ) -> tuple[Array, ...]:
        """Frequencies, (n_samples, n_modes), and d f / d theta, (n_samples, n_modes, n_parameters), without warnings.

        With ``dofs``, also shapes there, (n_samples, n_dofs, n_modes), and d phi / d theta. If ``relative``,
        derivatives are d ln f / d ln theta and d phi / d ln theta.
        """
        outside = self.outside(theta)
        results: list[Array] = []
        for model, rows in ((self.reduced, ~outside), (self.model, outside)):
            if rows.any():
                quiet = model.quiet() if hasattr(model, "quiet") else model
                if dofs is None:
                    solved: tuple[Array, ...] = linearise(quiet, theta[rows], relative=relative, n_jobs=n_jobs)
                else:
                    f, jacobian, shapes, slopes = linearise_modes(quiet, theta[rows], dofs, n_jobs=n_jobs)
                    if relative:
                        jacobian = jacobian * theta[rows][:, np.newaxis] / f[:, :, np.newaxis]
                        slopes = slopes * theta[rows][:, np.newaxis, np.newaxis]
                    solved = f, jacobian, shapes, slopes
                results = results or [np.full((len(theta), *array.shape[1:]), np.nan) for array in solved]
                for result, array in zip(results, solved, strict=True):
                    result[rows] = array
        return tuple(results)

    def outside(self, theta: Array) -> NDArray[np.bool_]:
        """Which rows the full model solves: those outside the box of the reduced model; all without one."""
        if self.box is None:
            return np.ones(len(theta), dtype=bool)
        lowest, highest = self.box.T
        return ((theta < lowest) | (theta > highest)).any(axis=1)
