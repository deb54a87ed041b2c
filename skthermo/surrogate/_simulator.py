"""Frequencies of many rows: by the reduced model inside its box of parameters, by the full model outside."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from skthermo._core.arrays import Array, Reduce, is_auto, tolerance
from skthermo.fem import FEModel, FrequencySurface, evaluate, linearise, linearise_modes
from skthermo.fem.damage import LossKind, kind_option

NO_BASIS = "no reduced model is accurate where the parameters of the records are"


def box_around(theta: Array, *, margin: float = 0.25, least_margin: float = 0.05) -> Array:
    """Lowest and highest of each parameter in rows of theta, (n_parameters, 2), with a margin.

    The margin is a share of the parameter's range, and at least a share of its lowest value.
    """
    lowest, highest = np.nanmin(theta, axis=0), np.nanmax(theta, axis=0)
    margin = np.maximum(margin * (highest - lowest), least_margin * lowest)
    return np.column_stack([np.maximum(lowest - margin, lowest / 2), highest + margin])


@dataclass(frozen=True)
class Simulator:
    """An FE model and, where there is one, its reduced model, which is accurate within a box (n_parameters, 2).

    Without one, the ``reason`` says why. ``usual`` rows of theta are given by the weather; near them, a
    `~skthermo.fem.FrequencySurface` of the reduced model solves many rows.
    """

    model: FEModel
    reduced: Any = None
    box: Array | None = None
    tol: float = 1e-5
    reason: str = ""
    usual: Array | None = None

    @classmethod
    def around(
        cls, model: FEModel, theta: Array, reduce: Reduce, known: Simulator | None = None, *, n_rows: int | None = None
    ) -> Simulator:
        """The simulator with, if it is to be reduced, a reduced model for a box around rows of theta.

        It will solve ``n_rows``, by default as many as these, three times: for predictions, for simulations, and to
        refine parameters. The reduced model of a known simulator of the same model serves if its box holds these rows.
        """
        auto, box = is_auto(reduce), box_around(theta)
        tol = tolerance(model, reduce, 3 * (len(theta) if n_rows is None else n_rows))
        allowed = 1e-5 if auto else tol
        serves = known is not None and known.box is not None and allowed is not None and known.tol <= allowed
        if serves and not known.outside(theta).any():  # NaN is nowhere outside
            return replace(known, usual=theta)
        if tol is None:
            return cls(model, reason="a reduced model would save no time" if auto else "reduce=False")
        if known is not None and known.reason == NO_BASIS:
            return known
        try:
            return cls(model, model.reduced(box, tol=tol, random_state=0), box, tol, usual=theta)
        except RuntimeError:
            return cls(model, tol=tol, reason=NO_BASIS)

    @property
    def described(self) -> str:
        """One sentence: which model solves, and why."""
        if self.reduced is None:
            return f"Solved by the full model: {self.reason or 'reduce=False'}."
        return (
            f"Solved by a reduced model of {self.reduced.basis_size_} coordinates (of {self.reduced.n_dof}), accurate "
            f"to {self.tol:g}."
        )

    def changed(self, method: str, *args: Any, **options: Any) -> Simulator:
        """The simulator of the structure that a method of the model gives, such as "damaged"."""
        if not hasattr(self.model, method):
            raise ValueError(f"{self.model!r} has no method {method!r}; expected a model with one, such as AffineModel")
        models = [None if one is None else getattr(one, method)(*args, **options) for one in (self.model, self.reduced)]
        return replace(self, model=models[0], reduced=models[1])

    def damaged(self, damage: Mapping[str, float] | None, kind: LossKind = "stiffness") -> Simulator:
        """The simulator of the damaged structure; itself without damage."""
        options = kind_option(self.model, kind)
        return self.changed("damaged", damage, **options) if damage else self

    def with_damage_parameters(
        self, groups: list[str], lowest: float, highest: float, kind: LossKind = "stiffness"
    ) -> Simulator:
        """The simulator whose rows of theta end with 1 - severity of each group.

        A reduced model is accurate for severities from the lowest to the highest, with a margin.
        """
        severities = (min(lowest, 0.0) - 0.02, min(max(highest, 0.0) + 0.02, 0.99))
        options = kind_option(self.model, kind)
        changed = self.changed("with_damage_parameters", groups, severities=severities, **options)
        if self.box is None:
            return replace(changed, usual=None)
        factors = np.tile([1 - severities[1], 1 - severities[0]], (len(groups), 1))
        return Simulator(changed.model, changed.reduced, np.vstack([self.box, factors]), self.tol)

    def frequencies(self, theta: Array, n_jobs: int | None = None) -> Array:
        """Frequencies in Hz, (n_samples, n_modes); NaN in rows with NaN."""
        frequencies = np.full((len(theta), self.model.n_modes), np.nan)
        left = ~np.isnan(theta).any(axis=1)
        if self.usual is not None and (surface := self._surface(len(theta), n_jobs)) is not None:
            frequencies, served = surface.frequencies(theta)
            left &= ~served
        outside = self.outside(theta)
        for model, rows in ((self.reduced, left & ~outside), (self.model, left & outside)):
            if rows.any():
                is_alone = n_jobs is None and getattr(model, "thread_safe", False)  # and solves chunks on its threads
                solve = model.frequencies if is_alone else partial(evaluate, model, n_jobs=n_jobs)
                frequencies[rows] = solve(theta[rows])
        return frequencies

    def _surface(self, n_rows: int, n_jobs: int | None) -> FrequencySurface | None:
        """The surface that saves time for so many rows; None where there is none.

        It has 0.4 of the error that the reduced model may have, and is made of a solve for four rows at most.
        """
        degree = FrequencySurface.degree_within(n_rows // 4, self.usual.shape[1])
        solve = partial(replace(self, usual=None).frequencies, n_jobs=n_jobs)
        try:
            return FrequencySurface(solve, self.usual, tol=0.4 * self.tol, highest_degree=degree, bounds=self.box)
        except RuntimeError:
            return None

    def linearise(
        self, theta: Array, n_jobs: int | None = None, dofs: NDArray[np.intp] | None = None
    ) -> tuple[Array, ...]:
        """Frequencies, (n_samples, n_modes), and d ln f / d ln theta, (n_samples, n_modes, n_parameters).

        With ``dofs``, also shapes there, (n_samples, n_dofs, n_modes), and d phi / d ln theta.
        """
        outside = self.outside(theta)
        results: list[Array] = []
        for model, rows in ((self.reduced, ~outside), (self.model, outside)):
            if not rows.any():
                continue
            quiet, at = model.quiet() if hasattr(model, "quiet") else model, theta[rows][:, np.newaxis]
            if dofs is None:
                solved: tuple[Array, ...] = linearise(quiet, theta[rows], relative=True, n_jobs=n_jobs)
            else:
                f, jacobian, shapes, slopes = linearise_modes(quiet, theta[rows], dofs, n_jobs=n_jobs)
                solved = f, jacobian * at / f[:, :, np.newaxis], shapes, slopes * at[:, np.newaxis]
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
