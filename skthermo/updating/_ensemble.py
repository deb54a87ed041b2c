"""Models that are as likely as a calibrated one, by randomised maximum a posteriori."""

from collections.abc import Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
from joblib import delayed

from skthermo._core.arrays import Array, check_names
from skthermo._core.parallel import run_jobs
from skthermo.exceptions import ModelWarning, SkthermoWarning
from skthermo.fem import CallableModel, FEModel, ReducedModel
from skthermo.fem.damage import read_groups
from skthermo.updating._diagnostics import at_bounds, false_matches
from skthermo.updating._residuals import Measured, Outcome, Residuals, optimise


class Ensemble:
    """Draws of a model's parameters, and of the stiffness of its damage groups, given measured modes.

    ``bounds`` and ``prior`` belong to the parameters. The stiffness of the damage ``groups`` is unknown too, with the
    standard deviation ``spread`` about 1.
    """

    def __init__(
        self, model: FEModel, measured: Measured, bounds: Array, prior: Array, groups: Sequence[str], spread: float
    ):
        self.model, self.measured, self.groups = model, measured, list(groups)
        limits = max(1 - 4 * spread, 0.1), 1 + 4 * spread
        self.bounds = np.vstack([bounds, np.tile(limits, (len(self.groups), 1))])
        prior = np.append(prior, np.full(len(self.groups), spread))
        self.extended: Any = model
        if self.groups:  # a basis for all groups would take longer to make than the searches on the full model
            full: Any = model.full if isinstance(model, ReducedModel) else model
            self.extended = full.with_damage_parameters(self.groups)
        quiet = self.extended.quiet() if hasattr(self.extended, "quiet") else self.extended
        self.residuals = Residuals(quiet, measured, prior)

    @property
    def names(self) -> list[str]:
        """Columns of the multipliers: parameters, then damage groups."""
        return [*self.model.parameter_names, *self.groups]

    def multipliers(
        self, n: int, start: Array, random: np.random.RandomState, max_iter: int, **options: Any
    ) -> list[Outcome]:
        """Most probable multipliers of n randomised problems, each from the same start; options are joblib's."""
        first = np.append(start, np.ones(len(self.groups)))
        search = partial(optimise, bounds=self.bounds, start=first, method="least_squares", max_iter=max_iter)
        drawn = self.residuals.randomised(n, random)
        return run_jobs((delayed(search)(residuals) for residuals in drawn), n, unit="models", **options)

    def model_at(self, multipliers: Array) -> FEModel:
        """The model whose theta = 1 has these multipliers; it has the model's damage groups."""
        n_parameters = len(self.model.parameter_names)
        model: Any = self.model
        if self.groups:
            model = model.damaged(dict(zip(self.groups, (1 - multipliers[n_parameters:]).tolist(), strict=True)))
        return rescaled(model, multipliers[:n_parameters])

    def findings(self, outcomes: Sequence[Outcome]) -> Iterator[SkthermoWarning]:
        """Warnings about the draws, and the model's about their parameters."""
        n = len(outcomes)
        theta = np.array([outcome.theta for outcome in outcomes])
        if unfinished := sum(not outcome.success for outcome in outcomes):
            yield ModelWarning(
                f"the search has not converged for {unfinished} of {n} drawn models. They may be improbable. Raise "
                "max_iter, or narrow the bounds to where the model has modes",
                "not-converged",
            )
        at_bound = np.sum([at_bounds(row, self.bounds) for row in theta], axis=0)
        if (at_bound > 0.1 * n).any():  # 5 % are at a bound of two standard deviations
            counts = zip(self.names, at_bound, strict=True)
            listed = ", ".join(f"{name!r} ({count} of {n})" for name, count in counts if count)
            yield ModelWarning(
                f"drawn models lie at the bounds of {listed}. They differ less than is unknown. Widen the bounds, or "
                "give a narrower prior",
                "poor-fit",
            )
        mismatched = sum(any(false_matches(self.residuals.model, self.measured, row)) for row in theta)
        if mismatched:
            yield ModelWarning(
                f"modes change their order in {mismatched} of {n} drawn models. A measured mode is fitted with another "
                "one there. Use a model with track=True, or give shapes",
                "mode-order",
            )
        if hasattr(self.model, "findings"):  # such as bounds of a reduced model
            own = theta[:, : len(self.model.parameter_names)]
            yield from self.model.findings(own, self.residuals.model.frequencies(theta))


def groups_beside(model: Any, groups: Sequence[str] | None) -> list[str]:
    """Damage groups whose stiffness no parameters scale already; by default those that are not made up of others."""
    if groups is None and not (hasattr(model, "groups") and hasattr(model, "with_damage_parameters")):
        return []
    names = None if groups is None else check_names([groups] if isinstance(groups, str) else groups, "groups")
    if names == []:
        return []
    chosen = list(read_groups(model, names))
    known = getattr(model, "parameter_terms", None)
    if known is None:
        return [name for name in chosen if name not in model.parameter_names]
    parameters = [set(terms) for terms in known.values()]

    def is_scaled(name: str) -> bool:
        own = set(model.groups[name])
        return set().union(*(terms for terms in parameters if terms <= own)) == own

    return [name for name in chosen if not is_scaled(name)]


def rescaled(model: FEModel, theta: Array) -> FEModel:
    """A model whose nominal state is the given model at theta."""
    if hasattr(model, "rescaled"):
        return model.rescaled(theta)
    function = partial(_frequencies_from, model, theta)
    return CallableModel(function, model.parameter_names, model.n_modes, vectorized=True)


def _frequencies_from(model: FEModel, origin: Array, theta: Array) -> Array:
    return model.frequencies(origin * theta)
