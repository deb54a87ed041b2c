"""A regressor whose prior a fleet gives, and what a fleet knows."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import RegressorMixin

from skthermo._core.arrays import Array, as_columns, check_flag, spread_evenly
from skthermo._core.estimators import Estimator, HasMethods, _fit_context, check_array, check_is_fitted, validate_data
from skthermo._core.frames import (
    check_same_rows,
    column_names,
    frame_like,
    like_targets,
    row_weights,
)
from skthermo._core.warnings import warn_each
from skthermo.fleet.prior._families import CoefficientFamily, Covariates, Member
from skthermo.fleet.prior._information import FleetBasis, FleetNoise, Information
from skthermo.fleet.prior._posterior import Mixture, OwnPrior, mixture
from skthermo.fleet.prior._records import BridgeRecords, Link, days_of, families_by_name, usable_rows
from skthermo.metrics.errors import complete_r2
from skthermo.preprocessing import set_aside
from skthermo.residuals.weather import TrainingRange, implausible, parts

ROWS_EACH = 1000  # of a bridge, evenly spread: each bridge counts alike
N_KNOTS, LEAST_ALONE = 4, 2  # knots and rows without a fleet
ALLOWED = ("no-rows", "stuck", "implausible-values", "constant")  # findings in rows of any order, of any inputs


@dataclass(frozen=True)
class FleetKnowledge:
    """Functions of the weather, noise, and the prior of coefficients, on a bridge's own and by pooled families.

    ``inputs`` are the names of those of the fleet, None where they have none.
    """

    basis: FleetBasis
    noise: FleetNoise | None
    own: OwnPrior
    covariates: Covariates = field(default_factory=lambda: Covariates({}, {}))
    families: Mapping[Hashable, CoefficientFamily] = field(default_factory=dict)
    chances: Mapping[Hashable, float] = field(default_factory=dict)
    scales: Mapping[Hashable, float] = field(default_factory=dict)
    inputs: Sequence[Hashable] | None = None

    @classmethod
    def none(cls, inputs: Array, n_knots: int) -> FleetKnowledge:
        """Without a fleet: functions of a bridge's own weather."""
        basis = FleetBasis.of(pooled_weather([inputs]), n_knots)
        return cls(basis, None, OwnPrior(np.ones(basis.n_functions)))

    def posterior(
        self, records: BridgeRecords, families: Sequence[Hashable], covariates: Mapping[Hashable, Any] | None
    ) -> tuple[Information, Mixture]:
        """What a bridge's records tell, and that together with the fleet."""
        found = Information.of(self.basis, records, families, self.own, self.noise)
        own = self.own.fitted(found.J, found.h, families)
        member = Member(found, families, *self.covariates.row(covariates), own)
        prior = member.prior(self.families, predictive=True)
        return found, mixture(found.J, found.h, families, prior, own, self.chances)


class FleetMapper(RegressorMixin, Estimator):
    """Frequencies or other quantities of a bridge from the weather, with a prior that a fleet gives.

    Parameters
    ----------
    prior : FleetPrior, optional
        Fitted. Without one, the bridge is on its own: piecewise-linear regression on the weather of its own records,
        and a ridge of the most likely strength.
    covariates : mapping of str to value, optional
        Covariates of this bridge; what is not given counts as unknown.
    families : mapping of str to str, optional
        Family of each parameter or mode by name; by default as for the fleet. None is never pooled.
    link : {"log", "linear"} or mapping of family to one of these, optional
        As in `FleetPrior`, whose link is the default; without a prior, "log".

    Attributes
    ----------
    families_ : dict
        Family of each output by name, None where it is never pooled.
    pooling_probability_ : dict
        By family: probability that this bridge behaves as the fleet does.
    reach_ : TrainingRange
        Lowest and highest value of each input in the fleet and in the bridge's own records.
    own_range_ : TrainingRange
        The same of its own records.
    basis_ : FleetBasis
        Functions of the weather.
    coefficients_ : ndarray of shape (n_outputs, 1 + n_functions)
        Posterior mean of the level and of the coefficients of the fleet's basis, of ln y or, linear, y over its scale.
    link_ : Link
        What is linear in the functions of the weather, with the scales of linear quantities.
    covariance_ : ndarray of shape (n_outputs, 1 + n_functions, n_outputs, 1 + n_functions)
        Their posterior covariance.
    misfit_ : ndarray of shape (n_outputs,)
        Variances of what ln y does with the weather that the basis cannot follow, as bridges of the fleet show it.
    centre_ : ndarray of shape (n_functions,)
        Mean of the basis in the bridge's own records, to which the level belongs.
    parameter_names_ : list or None
        Names of the outputs, where `fit` saw them.
    y_is_vector_ : bool
        Whether `fit` saw one output as a vector.
    n_features_in_ : int
        Number of inputs.
    feature_names_in_ : ndarray of str
        Their names, where `fit` saw a frame with such names.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.fleet import FleetMapper, FleetPrior
    >>> T = np.linspace(-10, 30, 200)[:, np.newaxis]
    >>> bridges = [(T, np.exp(-0.004 * (1 + 0.1 * i) * T)) for i in range(5)]
    >>> prior = FleetPrior().fit(bridges)
    >>> mapper = FleetMapper(prior).fit(T[:40], 2 * np.exp(-0.0044 * T[:40]))
    >>> mapper.predict([[30.0]]).shape
    (1, 1)
    """

    _parameter_constraints: dict = {
        "prior": [HasMethods(["mapper"]), None],
        "covariates": [Mapping, pd.Series, None],
        "families": [Mapping, None],
        "link": [str, Mapping, None],
    }

    def __init__(
        self,
        prior: Any = None,
        *,
        covariates: Mapping[Hashable, Any] | None = None,
        families: Mapping[Hashable, Any] | None = None,
        link: str | Mapping[Hashable, str] | None = None,
    ):
        self.prior = prior
        self.covariates = covariates
        self.families = families
        self.link = link

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> FleetMapper:
        """Learn what the bridge's own records tell, beside the fleet.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_inputs)
            Temperatures in degrees Celsius, lagged as those of the fleet.
        y : array-like, Series or DataFrame of shape (n_samples,) or (n_samples, n_outputs)
            Quantities, positive ones where the link is "log"; NaN is allowed.
        sample_weight : array-like of shape (n_samples,), optional
            Relative precision of each row; a row of weight 0 counts as left out.

        Returns
        -------
        FleetMapper
            The fitted estimator.

        Raises
        ------
        ValueError
            If the prior is not fitted, inputs are not those of the fleet, or no row can be used.
        """
        inputs, values = self._read(X, y)
        weights = row_weights(sample_weight, X)
        trained = usable_rows(inputs, values, weights)
        if not trained.any():
            raise ValueError(f"none of {len(inputs)} rows has all inputs, a quantity and a weight; expected one")
        if self.prior is None and trained.sum() < LEAST_ALONE:
            raise ValueError(
                f"{trained.sum()} of n_samples={len(inputs)} rows are complete; expected {LEAST_ALONE} without a prior"
            )
        known = FleetKnowledge.none(inputs[trained], N_KNOTS) if self.prior is None else self.prior.knowledge_
        names = self._names_of(y, values.shape[1])
        given = getattr(self.prior, "families", None) if self.families is None else self.families
        self.families_ = families_by_name(given, names)
        families = list(self.families_.values())
        link = getattr(self.prior, "link", "log") if self.link is None else self.link
        self.link_ = Link.of(link, families, values[trained], known.scales)
        records = BridgeRecords.of(inputs, values, names, self.link_, weights, days_of(X))
        found, state = known.posterior(records, families, self.covariates)
        self.pooling_probability_ = {family: state.follows.get(family, 0.0) for family in dict.fromkeys(families)}
        self.basis_, self.centre_ = known.basis, found.centre
        self.coefficients_, self.covariance_ = with_levels(found, state)
        self.misfit_ = (FleetNoise() if known.noise is None else known.noise).misfit(found, families)
        self.own_range_ = TrainingRange.spanned(frame_like(X, inputs), trained)
        own = self.own_range_
        fleet = own if self.prior is None else self.prior.reach_
        lowest, highest = np.minimum(own.lowest, fleet.lowest), np.maximum(own.highest, fleet.highest)
        self.reach_ = TrainingRange(lowest, highest, own.names)
        return self

    def predict(self, X: ArrayLike, return_std: bool = False) -> Any:
        """Quantities at the posterior mean of their logarithms, or of themselves with the linear link.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_inputs)
            Inputs; rows with NaN are NaN. The chain or compensator that holds the mapper warns of rows outside
            ``reach_``.
        return_std : bool, default=False
            Whether to return standard deviations, too.

        Returns
        -------
        y : ndarray or DataFrame of shape (n_samples,) or (n_samples, n_outputs)
            The median of the posterior.
        std : ndarray or DataFrame of the same shape
            Only with ``return_std``: roots of the diagonal of `predict_covariance`.

        Warns
        -----
        UserWarning
            If inputs are no temperatures of any weather, such as kelvin or -999.
        """
        values, covariance = self._posterior_at(X, check_flag(return_std, "return_std"))
        warn_each(implausible(self.reach_, X))
        if not return_std:
            return self._as_targets(X, values)
        std = np.sqrt(np.einsum("tii->ti", covariance))
        return self._as_targets(X, values), self._as_targets(X, std)

    def predict_covariance(self, X: ArrayLike) -> NDArray[np.float64]:
        """Covariance of the clean quantities: what coefficients leave open, and what no function of the basis follows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_inputs)
            Inputs; rows with NaN are NaN. The chain or compensator that holds the mapper warns of rows outside
            ``reach_``.

        Returns
        -------
        ndarray of shape (n_samples, n_outputs, n_outputs)
            In the units of `predict`, to first order, without the noise of a measurement.
        """
        return self._posterior_at(X, True)[1]

    def from_fleet(self, X: ArrayLike) -> NDArray[np.bool_]:
        """Rows of weather that the bridge's own records have not seen, but those of the fleet have.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_inputs)
            Inputs.

        Returns
        -------
        ndarray of bool of shape (n_samples,)
            False in rows with NaN.
        """
        inputs = self._inputs(X)
        outside = (self.own_range_.excess(inputs) > 0).any(axis=1)
        return outside & (self.reach_.excess(inputs) == 0).all(axis=1)

    def score(self, X: ArrayLike, y: ArrayLike, sample_weight: ArrayLike | None = None) -> float:
        """Coefficient of determination R2 over complete rows, averaged over outputs.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_inputs)
            Inputs.
        y : array-like or DataFrame of shape (n_samples,) or (n_samples, n_outputs)
            Quantities.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row.

        Returns
        -------
        float
            NaN if fewer than two rows are complete.
        """
        return complete_r2(as_columns(y), as_columns(self.predict(X)), row_weights(sample_weight, X))

    def _read(self, X: ArrayLike, y: ArrayLike) -> tuple[Array, Array]:
        if y is None:
            raise ValueError("This FleetMapper estimator requires y to be passed, but the target y is None")
        inputs = validate_data(self, X, dtype=np.float64)
        values = check_array(y, dtype=np.float64, ensure_2d=False)
        plain_rows = isinstance(y, pd.DataFrame | pd.Series) and y.index.equals(pd.RangeIndex(len(y)))
        check_same_rows(X, values if plain_rows else y, ("inputs", "quantities"))
        found = set_aside(frame_like(X, inputs), exclude=ALLOWED, needs_all=True)
        inputs = np.asarray(found.temperatures)
        self._check_inputs(X)
        self.y_is_vector_ = values.ndim == 1
        self.parameter_names_ = column_names(y, "") if isinstance(y, pd.DataFrame) else None
        return inputs, as_columns(values)

    def _check_inputs(self, X: ArrayLike) -> None:
        if self.prior is None:
            return
        check_is_fitted(self.prior)
        known = self.prior.knowledge_
        n_inputs, names = len(known.basis.middle), getattr(X, "columns", None)
        if self.n_features_in_ != n_inputs:
            raise ValueError(f"X has {self.n_features_in_} inputs; expected the {n_inputs} of the fleet")
        if names is None or known.inputs is None or n_inputs == 1 or list(names) == list(known.inputs):
            return
        raise ValueError(f"X has the inputs {list(names)[:20]}; expected those of the fleet, {list(known.inputs)[:20]}")

    def _names_of(self, y: ArrayLike, n_outputs: int) -> list[Hashable]:
        """Names of the outputs, or those of the fleet in their order."""
        if isinstance(y, pd.DataFrame):
            return list(y.columns)
        if isinstance(y, pd.Series) and y.name is not None:
            return [y.name]
        if self.prior is None and self.families is None:
            return list(range(n_outputs))
        names = self.prior.parameter_names_ if self.families is None else list(self.families)
        if len(names) != n_outputs:
            raise ValueError(f"y has {n_outputs} columns without names; expected names, or {names[:20]}")
        return list(names)

    def _inputs(self, X: ArrayLike) -> Array:
        check_is_fitted(self)
        return validate_data(self, X, dtype=np.float64, reset=False)

    def _posterior_at(self, X: ArrayLike, with_covariance: bool) -> tuple[Array, Array]:
        """Median of the posterior, and its covariance; NaN where an input is missing."""
        inputs = self._inputs(X)
        n_outputs = len(self.coefficients_)
        known = np.flatnonzero(~np.isnan(inputs).any(axis=1))
        values = np.full((len(inputs), n_outputs), np.nan)
        covariance = np.full((len(inputs) if with_covariance else 0, n_outputs, n_outputs), np.nan)
        for part in parts(len(known), self.coefficients_.size * n_outputs):
            rows = known[part]
            x = np.column_stack([np.ones(len(rows)), self.basis_(inputs[rows]) - self.centre_])
            values[rows] = self.link_.inverse(x @ self.coefficients_.T)
            if with_covariance:
                half = np.einsum("ti,aibj->tabj", x, self.covariance_)
                linear = np.einsum("tabj,tj->tab", half, x) + np.diag(self.misfit_)
                slopes = np.broadcast_to(self.link_.slopes(values[rows]), values[rows].shape)
                covariance[rows] = slopes[:, :, np.newaxis] * slopes[:, np.newaxis] * linear
        return values, covariance

    def _as_targets(self, X: ArrayLike, values: Array) -> Array | pd.DataFrame | pd.Series:
        return like_targets(X, values, self.parameter_names_, is_vector=self.y_is_vector_)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.target_tags.multi_output = True
        tags.target_tags.positive_only = True
        return tags


def with_levels(found: Information, state: Mixture) -> tuple[Array, Array]:
    """Mean, (n_outputs, 1 + n_functions), and covariance of levels and coefficients."""
    n_outputs, b, covariance = found.n_outputs, state.mean, state.covariance
    n_functions = len(b) // n_outputs
    whole = np.zeros((n_outputs, 1 + n_functions, n_outputs, 1 + n_functions))
    cross = -found.gain @ covariance
    whole[:, 0, :, 0] = found.level_covariance - cross @ found.gain.T
    whole[:, 0, :, 1:] = cross.reshape(n_outputs, n_outputs, n_functions)
    whole[:, 1:, :, 0] = cross.T.reshape(n_outputs, n_functions, n_outputs)
    whole[:, 1:, :, 1:] = covariance.reshape(n_outputs, n_functions, n_outputs, n_functions)
    return np.column_stack([found.level - found.gain @ b, b.reshape(n_outputs, n_functions)]), whole


def pooled_weather(tables: Sequence[Array]) -> Array:
    """Rows of the weather of some bridges, (n_samples, n_inputs) without gaps, in which each bridge counts alike."""
    return np.concatenate([table[spread_evenly(np.arange(len(table)), ROWS_EACH)] for table in tables])
