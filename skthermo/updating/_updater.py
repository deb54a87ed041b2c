"""FE model updating."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from numbers import Integral, Real
from typing import Any, Literal

import numpy as np
import pandas as pd
from joblib import Parallel, delayed
from numpy.typing import ArrayLike
from sklearn.utils import check_random_state

from skthermo._core.arrays import (
    Array,
    Bounds,
    Reduce,
    as_random_state,
    check_bounds,
    check_model,
    check_names,
    check_prior,
    check_size,
    cramer_rao,
    is_auto,
    positive_integer,
    real_array,
    tolerance,
)
from skthermo._core.estimators import (
    Estimator,
    HasMethods,
    Interval,
    StrOptions,
    _fit_context,
    check_is_fitted,
    validate_data,
)
from skthermo._core.frames import column_names
from skthermo._core.parallel import run_jobs
from skthermo._core.warnings import warn_each
from skthermo.fem import CallableModel, FEModel, ReducedModel
from skthermo.fem.damage import read_groups
from skthermo.updating._diagnostics import (
    doubtful_draws,
    doubtful_optimum,
    false_matches,
    modes_table,
    starts_table,
    undetermined,
    unfinished,
)
from skthermo.updating._residuals import Measured, Outcome, Residuals, optimise, read_measured


class ModelUpdater(Estimator):
    """Estimate the parameters of an FE model from measured frequencies and, if there are any, mode shapes.

    Within bounds on the multipliers theta of the nominal parameters, it minimises

    .. math:: z(\\theta) = \\sum_j \\Bigl(\\frac{f_j(\\theta) - \\tilde f_j}{\\tilde f_j} w_j\\Bigr)^2
              + \\sum_j \\Bigl(\\frac{1 - \\sqrt{\\mathrm{MAC}_j}}{\\sqrt{\\mathrm{MAC}_j}} v_j\\Bigr)^2
              + \\sum_p \\Bigl(\\frac{\\theta_p - 1}{\\sigma_p}\\Bigr)^2 ,

    with measured frequencies, their weights w = measured frequency / standard deviation (or 1), weights v of shapes,
    and standard deviations of a prior. The first sum with unit weights is eq. (A.3) of
    [KCM26]_; see [FM95]_, and for large models [MF98]_.

    Parameters
    ----------
    model : FE model
        Measured mode j is column j of its frequencies. To use shapes, it must have ``local_modes``, ``n_dof`` and
        ``track``, as `~skthermo.fem.AffineModel` has.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        Box of multipliers that contains 1: a half-width, or lowest and highest multiplier of each parameter, or a
        mapping from each parameter to either.
    shape_weight : float or array-like of shape (n_modes,), default=0.0
        Weights v. With 0, measured shapes only tell which mode is which.
    n_starts : int, default=1
        Number of optimisations. The first starts at theta = 1, the others at random points of the box.
    method : {"least_squares", "lbfgs"}, default="least_squares"
        Trust-region Gauss-Newton steps (``scipy.optimize.least_squares``), or L-BFGS-B.
    prior : float, array-like of shape (n_parameters,) or mapping of str to float, optional
        Relative standard deviations of a Gaussian prior on theta about 1. By default there is none.
    max_iter : int, default=200
        Most evaluations (least_squares) or iterations (lbfgs) of one start.
    reduce : "auto", bool or float, default="auto"
        Whether the starts search by a reduced model, as ``reduce`` of `~skthermo.surrogate.InverseSurrogate`. The best
        of them goes on with the model itself, so that ``theta_`` is its optimum.
    n_jobs : int, optional
        Jobs over which starts are spread, through joblib.
    random_state : int, RandomState or None, default=None
        Seed of the starts.

    Attributes
    ----------
    theta_ : ndarray of shape (n_parameters,)
        Multipliers with the smallest objective of all starts.
    model_ : FE model
        The model with these multipliers as its nominal state: theta = 1 is the optimum.
    table_ : DataFrame
        One row for each measured mode: ``measured``, ``before`` (theta = 1) and ``after`` in Hz, ``error_before`` and
        ``error_after`` in percent and, with shapes, ``mac_before`` and ``mac_after``.
    starts_ : DataFrame
        One row for each start: ``start`` (its theta), ``objective``, ``success``, ``n_evaluations``, ``n_failed``
        (those without modes), ``theta`` (where it ended), and ``optimum``, a number for each different one from 0, the
        best.
    covariance_ : ndarray of shape (n_parameters, n_parameters)
        Covariance of ``theta_``, if the weights describe the noise (see Notes). A parameter that the measurements do
        not determine has an infinite variance and NaN covariances.
    measured_ : Measured
        Measurements that `fit` was given, with their weights.
    findings_ : list of SkthermoWarning
        The warnings of `fit`.
    has_deviations_ : bool
        Whether `fit` was given ``frequency_std``, which `sample_models` needs.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of modes and, where `fit` saw a frame with such, their names.

    See Also
    --------
    identifiability : Accuracy to expect, before anything is measured.

    Notes
    -----
    With shapes, each measured mode is paired one to one with the mode of the model that has the highest MAC with it,
    among more modes than ``model.n_modes``; where several look the same at the sensors, the MAC with the nominal mode
    of the same number decides. Without shapes, measured mode j is column j of the model.

    ``covariance_`` holds if ``frequency_std`` and ``shape_weight`` (or 0) describe the noise of the measurement: shapes
    with noise of s times their root mean square at n degrees of freedom have the weight v = sqrt(2 (n - 1)) / s^2.
    Without ``frequency_std`` it serves for comparison only. It takes no account of bounds or of errors of the model
    itself. :doc:`/guide/updating` explains weights, close modes and the steps that are taken.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.updating import ModelUpdater
    >>> truss = make_truss()
    >>> updater = ModelUpdater(truss).fit(truss.frequencies([0.9, 1.1, 0.95, 1.05]))
    >>> updater.theta_.round(4)
    array([0.9 , 1.1 , 0.95, 1.05])
    """

    _parameter_constraints: dict = {
        "model": [HasMethods(["frequencies"])],
        "bounds": [Real, "array-like", dict],
        "shape_weight": [Interval(Real, 0, None, closed="left"), "array-like"],
        "n_starts": [Interval(Integral, 1, None, closed="left")],
        "method": [StrOptions({"least_squares", "lbfgs"})],
        "prior": [Interval(Real, 0, None, closed="neither"), "array-like", dict, None],
        "max_iter": [Interval(Integral, 1, None, closed="left")],
        "reduce": [StrOptions({"auto"}), "boolean", Interval(Real, 0, 1, closed="neither")],
        "n_jobs": [Interval(Integral, None, -1, closed="right"), Interval(Integral, 1, None, closed="left"), None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        model: FEModel,
        *,
        bounds: Bounds = 0.3,
        shape_weight: ArrayLike = 0.0,
        n_starts: int = 1,
        method: Literal["least_squares", "lbfgs"] = "least_squares",
        prior: ArrayLike | Mapping[str, float] | None = None,
        max_iter: int = 200,
        reduce: Reduce = "auto",
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.model = model
        self.bounds = bounds
        self.shape_weight = shape_weight
        self.n_starts = n_starts
        self.method = method
        self.prior = prior
        self.max_iter = max_iter
        self.reduce = reduce
        self.n_jobs = n_jobs
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(
        self,
        F: ArrayLike,
        y: None = None,
        *,
        shapes: ArrayLike | None = None,
        dofs: ArrayLike | None = None,
        frequency_std: ArrayLike | None = None,
    ) -> ModelUpdater:
        """Find the multipliers with which the model comes closest to the measurements.

        Parameters
        ----------
        F : array-like or DataFrame of shape (n_records, n_modes) or (n_modes,)
            Measured frequencies in Hz; their mean over records is fitted. NaN is allowed, and a mode that is NaN in
            all records is left out. Values that are not positive, or farther than half of it from the median of their
            mode, count as missing. With shapes, there may be fewer columns than the model has modes.
        y : None
            Ignored.
        shapes : array-like of shape (n_dofs, n_modes), optional
            Measured mode shapes of any scale and sign; NaN throughout a column means not measured. Complex shapes
            are made real.
        dofs : array-like of int of shape (n_dofs,), or list of (node, direction), optional
            The model's degree of freedom of each row, by position, the first being 0, or by label, as in
            ``model.dofs``.
        frequency_std : float or array-like of shape (n_modes,), optional
            Standard deviations of the mean frequencies in Hz.

        Returns
        -------
        ModelUpdater
            The fitted estimator.

        Raises
        ------
        ValueError
            If the number of modes is not the model's; nothing was measured; bounds exclude 1; shapes are given for a
            model without ``local_modes``, ``n_dof`` or ``track``; or the model has no modes at any start.

        Warns
        -----
        ModelWarning, RecordsWarning, ResultWarning
            If values count as missing, there are more parameters than residuals and no prior, or the optimum is
            doubtful: not converged, at a bound, with frequencies missed by 15 % or far beyond their noise, or with a
            mode paired with another one.
        """
        measured = self._read(F, shapes, dofs, frequency_std)
        bounds = self._read_bounds()
        n_parameters, names = len(bounds), self.model.parameter_names
        prior = np.full(n_parameters, np.inf) if self.prior is None else check_prior(self.prior, names)
        model = quiet(self.model)
        residuals = Residuals(model, measured, prior)
        outcomes = self._run(residuals, bounds)
        best = min(outcomes, key=lambda outcome: outcome.objective)
        if not np.isfinite(best.objective):
            self.model.frequencies(np.ones((1, n_parameters)))  # warns of the reason, if the model knows it
            raise ValueError(
                f"the model has no modes at any of the {self.n_starts} starts; expected some within bounds"
            )

        self.measured_ = measured
        self.has_deviations_ = frequency_std is not None
        self.theta_ = best.theta
        self.model_ = rescaled(self.model, best.theta)
        self.starts_ = starts_table(outcomes)
        self.covariance_ = cramer_rao(residuals.at(best.theta).information())
        self.table_ = modes_table(model, measured, best.theta)
        findings = [*measured.findings, *false_matches(model, measured, best.theta)]
        if self.prior is None:
            findings += undetermined(names, measured.n_residuals, self.covariance_)
        if best.success:
            findings += doubtful_optimum(names, best.theta, bounds, measured, self.table_)
        else:
            findings.append(unfinished(best, residuals))
        if hasattr(self.model, "findings"):  # of the optimum alone, not of all that a search passes through
            findings += self.model.findings(best.theta[np.newaxis], self.table_["after"].to_numpy()[np.newaxis])
        self.findings_ = findings
        warn_each(findings)
        return self

    def sample_models(
        self,
        n: int,
        *,
        spread: float = 0.15,
        groups: Sequence[str] | None = None,
        random_state: int | np.random.RandomState | None = None,
    ) -> list[FEModel]:
        """Models that are as likely as the calibrated one, given the measurements and the prior.

        The stiffness of every damage group is unknown too, also of those that no parameter scales. Where measured modes
        do not determine it, it differs from model to model as much as the prior allows.

        Parameters
        ----------
        n : int
            Number of models.
        spread : float, default=0.15
            Relative standard deviation of the stiffness of each damage group about its nominal value, before anything
            is measured; also of the parameters, if the updater has no ``prior``.
        groups : sequence of str, optional
            Damage groups whose stiffness is unknown. By default all that are not made up of other groups; an empty
            sequence means none. Groups all of whose stiffness the parameters scale are not varied a second time.
        random_state : int, RandomState or None, default=None
            Seed of the draws. The models do not depend on ``n_jobs``.

        Returns
        -------
        list of FE model
            ``n`` models like ``model_``: theta = 1 is the drawn stiffness; with the parameters, damage groups and modes
            of ``model``. A model that has no method ``with_damage_parameters`` varies in its parameters only.

        Raises
        ------
        ValueError
            If the updater was fitted without ``frequency_std``, ``spread`` is not between 0 and 0.5, or a group is
            unknown. Warnings count models whose search has not converged, that lie at a bound, or whose modes swap.

        Notes
        -----
        Randomised maximum a posteriori [Kit95]_, [OHR96]_, with independent Gaussian priors about the nominal model;
        :doc:`/guide/updating` explains the method. Draws end at the bounds if they would pass them: ``bounds`` for the
        parameters, and four standard deviations, or a tenth of the nominal stiffness, for the groups. The mass is taken
        as known, unless a parameter scales it.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> from skthermo.updating import ModelUpdater
        >>> truss = make_truss()
        >>> F = truss.frequencies([0.9, 1.1, 0.95, 1.05])
        >>> updater = ModelUpdater(truss, bounds=0.6, prior=0.15).fit(F, frequency_std=0.005 * F[0])
        >>> drawn = [m.frequencies([1, 1, 1, 1])[0, 0] for m in updater.sample_models(20, random_state=0)]
        >>> round(float(np.std(drawn) / F[0, 0]), 4)
        0.0035
        """
        check_is_fitted(self)
        if not self.has_deviations_:
            raise ValueError(
                "fit was called without frequency_std, and how much models may differ is not known; expected "
                "fit(F, frequency_std=...), standard deviations of the mean frequencies in Hz"
            )
        n = positive_integer(n, "n")
        check_size(spread, "spread", 0, 0.5, "a relative standard deviation above 0 and below 0.5, such as 0.15")
        prior = check_prior(spread if self.prior is None else self.prior, self.model.parameter_names)
        chosen = groups_beside(self.model, groups)
        names = [*self.model.parameter_names, *chosen]
        limits = np.tile([max(1 - 4 * spread, 0.1), 1 + 4 * spread], (len(chosen), 1))
        bounds = np.vstack([self._read_bounds(), limits])
        model = self.model.full if isinstance(self.model, ReducedModel) and chosen else self.model  # faster to extend
        extended = quiet(model.with_damage_parameters(chosen) if chosen else model)
        residuals = Residuals(extended, self.measured_, np.append(prior, np.full(len(chosen), spread)))
        search = bounds, np.append(self.theta_, np.ones(len(chosen))), "least_squares", self.max_iter
        options = {"n_jobs": self.n_jobs, "prefer": getattr(self.model, "prefer", None)}
        drawn = residuals.randomised(n, as_random_state(random_state))
        outcomes = run_jobs((delayed(optimise)(one, *search) for one in drawn), n, unit="models", **options)
        models = Parallel(**options)(delayed(_changed_model)(self.model, chosen, one.theta) for one in outcomes)
        theta = np.array([one.theta for one in outcomes])
        findings = doubtful_draws(outcomes, names, bounds, residuals)
        if hasattr(self.model, "findings"):  # such as bounds of a reduced model
            own = theta[:, : len(self.theta_)]
            findings = [*findings, *self.model.findings(own, extended.frequencies(theta))]
        warn_each(findings)
        return models

    def _read(self, F, shapes, dofs, frequency_std) -> Measured:
        check_model(self.model)
        table = F if isinstance(F, pd.DataFrame) else np.atleast_2d(real_array(F, "F"))
        values = validate_data(self, table, dtype=np.float64)
        n_modes = self.model.n_modes
        if values.shape[1] > n_modes or (shapes is None and values.shape[1] != n_modes):
            raise ValueError(
                f"F has {values.shape[1]} columns; expected the {n_modes} modes of {self.model!r}, "
                "NaN where one was not measured"
            )
        missing = [name for name in ("local_modes", "n_dof", "track") if not hasattr(self.model, name)]
        if shapes is not None and missing:
            raise ValueError(
                f"shapes were given, but {self.model!r} has no {' and no '.join(map(repr, missing))}; expected a model "
                "with local_modes, n_dof and track, such as AffineModel"
            )
        names = column_names(table, "f")
        return read_measured(self.model, values, names, shapes, dofs, frequency_std, self.shape_weight)

    def _read_bounds(self) -> Array:
        names = self.model.parameter_names
        bounds = check_bounds(self.bounds, names)
        for name, (lowest, highest) in zip(names, bounds, strict=True):
            if not lowest <= 1 <= highest:
                raise ValueError(f"bounds of parameter {name!r} are [{lowest}, {highest}]; expected them to contain 1")
        return bounds

    def _run(self, residuals: Residuals, bounds: Array) -> list[Outcome]:
        """The outcome of each start; where a reduced model has searched, the best one goes on with the model itself."""
        drawn = check_random_state(self.random_state).uniform(*bounds.T, size=(self.n_starts - 1, len(bounds)))
        starts = np.vstack([np.ones(len(bounds)), drawn])
        reduced = self._reduced(bounds)
        if reduced is None:
            return self._outcomes(residuals, bounds, starts)
        found = self._outcomes(Residuals(reduced, residuals.measured, residuals.prior), bounds, starts)
        outcomes = [one._replace(objective=residuals.at(one.theta).objective) for one in found]
        best = int(np.argmin([one.objective for one in outcomes]))
        before = outcomes[best]
        last = optimise(residuals, bounds, before.theta, self.method, self.max_iter)
        numbers = {name: getattr(before, name) + getattr(last, name) for name in ("n_evaluations", "n_failed")}
        outcomes[best] = last._replace(start=before.start, **numbers)
        return outcomes

    def _outcomes(self, residuals: Residuals, bounds: Array, starts: Array) -> list[Outcome]:
        jobs = (delayed(optimise)(residuals, bounds, start, self.method, self.max_iter) for start in starts)
        options = {"n_jobs": self.n_jobs, "prefer": getattr(residuals.model, "prefer", None)}
        return run_jobs(jobs, len(starts), unit="starts", **options)

    def _reduced(self, bounds: Array) -> FEModel | None:
        """The reduced model that the starts search by; None without one."""
        tol = tolerance(self.model, self.reduce, 10 * self.n_starts)  # a search takes about ten evaluations
        if tol is None:
            return None
        try:
            return self.model.reduced(bounds, tol=tol, random_state=0).quiet()  # type: ignore[attr-defined]
        except RuntimeError:
            if not is_auto(self.reduce):
                raise
            return None


def quiet(model: Any) -> Any:
    """A model that gives no warnings in a search."""
    return model.quiet() if hasattr(model, "quiet") else model


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


def _changed_model(model: Any, groups: Sequence[str], multipliers: Array) -> FEModel:
    """The model whose theta = 1 has these multipliers of its parameters, then of its damage groups."""
    theta, factors = np.split(multipliers, [len(model.parameter_names)])
    changed = model.damaged(dict(zip(groups, (1 - factors).tolist(), strict=True))) if groups else model
    return rescaled(changed, theta)


def rescaled(model: FEModel, theta: Array) -> FEModel:
    """A model whose nominal state is the given model at theta."""
    if hasattr(model, "rescaled"):
        return model.rescaled(theta)
    function = partial(_frequencies_from, model, theta)
    return CallableModel(function, model.parameter_names, model.n_modes, vectorized=True)


def _frequencies_from(model: FEModel, origin: Array, theta: Array) -> Array:
    return model.frequencies(origin * theta)
