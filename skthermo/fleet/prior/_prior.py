"""A prior that a fleet of bridges gives to a new one."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd

from skthermo._validation import Estimator, Interval, check_is_fitted
from skthermo.fleet.prior._basis import FleetBasis
from skthermo.fleet.prior._bridges import bridges_of, common_inputs, families_by_name, read_bridge
from skthermo.fleet.prior._comparison import compare
from skthermo.fleet.prior._covariates import Covariates
from skthermo.fleet.prior._families import Member
from skthermo.fleet.prior._mapper import FleetMapper
from skthermo.fleet.prior._posterior import alone
from skthermo.fleet.prior._records import BridgeRecords, FleetNoise, Information


class FleetPrior(Estimator):
    """How weather changes the parameters, or the frequencies, of a fleet's bridges: a prior for a new one.

    Parameters
    ----------
    n_knots : int, default=4
        Knots of each input, at quantiles of the weather of all bridges, at which lines break.
    families : mapping, optional
        Family of each parameter (or mode) by name, or of each bridge's name such a mapping. What belongs to one family
        responds to the weather alike; None as a family is never pooled. By default each name is a family of its own.

    Attributes
    ----------
    comparison_ : DataFrame
        By family: ``n_bridges`` that have it; ``alone`` and ``pooled``, log likelihoods of each bridge's records,
        summed over bridges, by a prior of its own and by what all other bridges say of it; ``gain``, the difference;
        its ``standard_error`` over bridges; and ``is_pooled``.
    bridges_ : DataFrame
        The same by bridge and family, and ``follows``, the probability that the bridge behaves as the family.
    families_ : dict
        Distribution of the coefficients of each family.
    follows_ : dict
        Probability that a new bridge follows a family, before its first record.
    basis_ : FleetBasis
        Functions of the weather.
    reach_ : TrainingRange
        Lowest and highest value of each input in the fleet.
    noise_ : FleetNoise
        Scatter of the records and its memory.
    covariates_ : Covariates
        Encoding of the covariates.
    parameter_names_ : list
        Names of parameters or modes, in order of their appearance.
    bridge_families_ : dict
        Family of each of the bridge's parameters, by bridge.

    Examples
    --------
    >>> import numpy as np
    >>> import pandas as pd
    >>> from skthermo.fleet import FleetPrior
    >>> def records(seed, days):
    ...     random = np.random.default_rng(seed)
    ...     T = 10 - 12 * np.cos(2 * np.pi * np.arange(days) / 365) + random.normal(0, 3, days)
    ...     f = (3 + random.normal(0, 0.1)) * np.exp(random.normal(-0.002, 0.0002) * T + random.normal(0, 0.002, days))
    ...     return pd.DataFrame({"T": T}), pd.DataFrame({"f1": f})
    >>> prior = FleetPrior().fit({f"bridge {i}": records(i, 365) for i in range(8)})
    >>> bool(prior.comparison_.loc["f1", "is_pooled"])
    True
    >>> winter = prior.mapper().fit(*records(9, 20))
    >>> winter.predict(pd.DataFrame({"T": [20.0]})).shape
    (1, 1)
    """

    _parameter_constraints: dict = {
        "n_knots": [Interval(Integral, 1, None, closed="left")],
        "families": [Mapping, None],
    }

    def __init__(self, n_knots: int = 4, families: Mapping[Hashable, Any] | None = None):
        self.n_knots = n_knots
        self.families = families

    def fit(
        self, bridges: Mapping[Hashable, Any] | Sequence[Any], covariates: pd.DataFrame | None = None
    ) -> FleetPrior:
        """Learn from bridges with records.

        Parameters
        ----------
        bridges : mapping or sequence
            Of each bridge's name a fitted `DataInformedFEM`, or a pair (T, Y) of temperatures, (n_samples, n_inputs),
            and positive quantities such as frequencies in Hz, (n_samples, n_outputs); NaN is allowed. A sequence is
            named 0, 1, ...; a `Fleet` counts as the mapping of its fitted chains.
        covariates : DataFrame, optional
            A row for each bridge's name: numbers (span) and categories (material).

        Returns
        -------
        FleetPrior
            The fitted prior.

        Raises
        ------
        ValueError
            If the bridges have different inputs, or tables that are no records; if covariates lack a bridge.
        """
        self._validate_params()
        given = bridges_of(bridges)
        names = list(given)
        read = {name: read_bridge(name, bridge) for name, bridge in given.items()}
        inputs = common_inputs(read)
        records = [one.records(inputs) for one in read.values()]
        self.basis_ = FleetBasis.of([one.inputs for one in records], self.n_knots, inputs)
        self.reach_ = self.basis_.reach
        self.bridge_families_ = {
            name: self._families_of(name, one.names) for name, one in zip(names, records, strict=True)
        }
        self.parameter_names_ = list(dict.fromkeys(name for one in records for name in one.names))
        self.covariates_, Z, unknown = Covariates.of(covariates, names)
        information = [Information.of(self.basis_, one) for one in records]
        families = [list(self.bridge_families_[name].values()) for name in names]
        self.noise_ = noise_of(information, families, records)
        typical = typical_deviations(information, families)
        self.typical_ = typical
        members = []
        for one, of_output, z, covariance in zip(information, families, Z, unknown, strict=True):
            prior = alone(one.J, one.h, one.n_outputs, np.array([typical[family] for family in of_output]))
            members.append(Member(one, of_output, z, covariance, prior))
        pooled = sorted({f for of_output in families for f in of_output if f is not None}, key=str)
        self.families_, self.follows_, self.comparison_, self.bridges_ = compare(members, names, pooled)
        return self

    def _families_of(self, bridge: Hashable, names: Sequence[Hashable]) -> dict[Hashable, Hashable | None]:
        """The family of each of a bridge's parameters."""
        return families_by_name(self.families, names, bridge)

    def mapper(
        self, covariates: Mapping[Hashable, Any] | None = None, families: Mapping[Hashable, Any] | None = None
    ) -> FleetMapper:
        """A regressor for a new bridge.

        Parameters
        ----------
        covariates : mapping of str to value, optional
            Those of the new bridge; what is not given counts as unknown.
        families : mapping, optional
            Family of each parameter by name; by default as for the fleet.

        Returns
        -------
        FleetMapper
            Unfitted.
        """
        check_is_fitted(self)
        return FleetMapper(self, covariates=covariates, families=families)

    def summary(self) -> str:
        """What the comparison says, in sentences.

        Returns
        -------
        str
            A sentence for each family.
        """
        check_is_fitted(self)
        lines = []
        for name, row in self.comparison_.iterrows():
            n = f"{row['n_bridges']} bridges" if row["n_bridges"] != 1 else "1 bridge"
            if row["is_pooled"]:
                gain = f"{row['gain']:.3g} +- {row['standard_error']:.2g}"
                text = f"{name}: pooled over {n}; log likelihood better by {gain}"
            elif row["n_bridges"] < 3:
                text = f"{name}: not pooled: {n}; expected at least 3"
            else:
                text = (
                    f"{name}: not pooled over {n}: other bridges do not foretell its response to the weather (log "
                    f"likelihood {row['gain']:+.3g} +- {row['standard_error']:.2g}); a new bridge learns it alone"
                )
            lines.append(text)
        return "\n".join(lines)


def noise_of(
    information: Sequence[Information], families: Sequence[Sequence[Any]], records: Sequence[BridgeRecords]
) -> FleetNoise:
    """Median scatter and memory of the bridges."""
    by_family: dict[Any, list[float]] = {}
    measured = []
    for one, of_output, given in zip(information, families, records, strict=True):
        if given.is_measured:
            measured.append(float(np.mean(np.diag(one.scatter))))
            continue
        for family, variance in zip(of_output, np.diag(one.scatter), strict=True):
            by_family.setdefault(family, []).append(float(variance))
    variances = {family: float(np.median(values)) for family, values in by_family.items()}
    memory = float(np.median([one.memory for one in information]))
    return FleetNoise(variances, float(np.median(measured)) if measured else 1.0, memory)


def typical_deviations(information: Sequence[Information], families: Sequence[Sequence[Any]]) -> dict[Any, float]:
    """Mean square of the coefficients of a family, from what bridges learn on their own."""
    squares: dict[Any, list[float]] = {}
    for one, of_output in zip(information, families, strict=True):
        own = alone(one.J, one.h, one.n_outputs)
        for family, root in zip(of_output, own.root, strict=True):
            squares.setdefault(family, []).append(float(root[0, 0] ** 2))
    return {family: float(np.median(values)) for family, values in squares.items()}
