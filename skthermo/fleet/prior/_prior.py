"""A prior that a fleet of bridges gives to a new one."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike

from skthermo._tables.text import counted
from skthermo._validation import Estimator, Interval, check_is_fitted
from skthermo.fleet.prior._basis import FleetBasis, steady_changes
from skthermo.fleet.prior._comparison import LEAST_BRIDGES, PoolingComparison
from skthermo.fleet.prior._covariates import Covariates
from skthermo.fleet.prior._families import Member
from skthermo.fleet.prior._information import FleetNoise, Information
from skthermo.fleet.prior._mapper import FleetKnowledge, FleetMapper
from skthermo.fleet.prior._posterior import OwnPrior
from skthermo.fleet.prior._records import Link, bridges_of, common_inputs, families_by_name, linear_scales, read_bridge


class FleetPrior(Estimator):
    """How weather changes the parameters, or the frequencies, of a fleet's bridges: a prior for a new one.

    Parameters
    ----------
    n_knots : int, default=4
        Knots of each of the largest principal components of the inputs, at quantiles of the weather of all bridges, at
        which lines break; at most 100.
    families : mapping, optional
        Family of each parameter (or mode) by name, or of each bridge's name such a mapping. What belongs to one family
        responds to the weather alike; None as a family is never pooled. By default each name is a family of its own.
    link : {"log", "linear"} or mapping of family to one of these, default="log"
        What is linear in the functions of the weather: "log", the logarithm, for frequencies and other positive
        quantities, so that bridges are compared by relative changes; "linear", the quantity itself, for displacements,
        inclinations or strains of any sign. Those of one family need the same unit on all bridges, and are compared by
        changes in that unit.

    Attributes
    ----------
    comparison_ : DataFrame
        By family: ``n_bridges`` that have it; ``alone`` and ``pooled``, log likelihoods of each bridge's records,
        summed over bridges, by a prior of its own and by what all other bridges say of it; ``gain``, the difference;
        its ``standard_error`` over bridges; and ``is_pooled``.
    bridges_ : DataFrame
        The same by bridge and family, and ``pooling_probability``, that the bridge behaves as the family.
    knowledge_ : FleetKnowledge
        What a mapper needs: functions of the weather, distributions of their coefficients by family, noise.
    reach_ : TrainingRange
        Lowest and highest value of each input in the fleet.
    parameter_names_ : list
        Names of parameters or modes, in order of their appearance.
    bridge_families_ : dict
        By bridge: family of each of its parameters or modes.
    coefficients_ : dict
        By bridge: posterior means of its coefficients, (n_outputs, n_functions).

    See Also
    --------
    FleetMapper : The regressor for a new bridge.

    Notes
    -----
    Empirical Bayes: :ref:`how-a-fleet-prior-learns` has the law of the logarithms, and how families are pooled.

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
        "n_knots": [Interval(Integral, 1, 100, closed="both")],
        "families": [Mapping, None],
        "link": [str, Mapping],
    }

    def __init__(
        self,
        n_knots: int = 4,
        families: Mapping[Hashable, Any] | None = None,
        *,
        link: str | Mapping[Hashable, str] = "log",
    ):
        self.n_knots = n_knots
        self.families = families
        self.link = link

    def __sklearn_clone__(self) -> FleetPrior:
        # A mapper's clones share what the fleet knows: it is not theirs to learn.
        return self if hasattr(self, "knowledge_") else super().__sklearn_clone__()

    def fit(
        self, bridges: Mapping[Hashable, Any] | Sequence[Any], covariates: pd.DataFrame | None = None
    ) -> FleetPrior:
        """Learn from bridges with records.

        Parameters
        ----------
        bridges : mapping or sequence
            Of each bridge's name a fitted `~skthermo.surrogate.DataInformedFEM`, or a pair (T, Y) of temperatures,
            (n_samples, n_inputs), and quantities such as frequencies in Hz, (n_samples, n_outputs); NaN is
            allowed. A sequence is named 0, 1, ...; a `Fleet` counts as the mapping of its fitted chains.
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
        read = {name: read_bridge(name, bridge) for name, bridge in bridges_of(bridges).items()}
        inputs = common_inputs(read)
        of_bridge = {bridge: families_by_name(self.families, one.names, bridge) for bridge, one in read.items()}
        families = [list(by_name.values()) for by_name in of_bridge.values()]
        scales = linear_scales(read, of_bridge, self.link)
        records = [
            one.records(name, inputs, Link.of(self.link, own, one.values, scales))
            for (name, one), own in zip(read.items(), families, strict=True)
        ]
        basis = FleetBasis.of([one.inputs for one in records], self.n_knots, inputs)
        plain = OwnPrior(np.ones(basis.n_functions))
        found = [Information.of(basis, one, own, plain) for one, own in zip(records, families, strict=True)]
        own = OwnPrior.of([one.J for one in found], [one.h for one in found], families, basis.n_functions)
        encoding, Z, unknown = Covariates.of(covariates, list(read))
        members = [
            Member(one, of_output, z, covariance, own.fitted(one.J, one.h, of_output))
            for one, of_output, z, covariance in zip(found, families, Z, unknown, strict=True)
        ]
        names = sorted({family for of_output in families for family in of_output if family is not None}, key=str)
        compared = PoolingComparison.of(members, list(read), names, basis.covariance)
        noise = FleetNoise.of(found, families)
        self.knowledge_ = FleetKnowledge(basis, noise, own, encoding, compared.families, compared.probabilities, scales)
        self.comparison_, self.bridges_ = compared.by_family, compared.by_bridge
        self.coefficients_, self.bridge_families_ = compared.coefficients, of_bridge
        self.parameter_names_ = list(dict.fromkeys(name for by_name in of_bridge.values() for name in by_name))
        self.reach_ = basis.reach
        return self

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

    def effects(
        self, temperatures: ArrayLike, family: Hashable = None, *, reference: float | None = None
    ) -> pd.DataFrame:
        """How ln y (y, if linear) changes from a reference temperature to others, where inputs have been so for long.

        Parameters
        ----------
        temperatures : array-like of shape (n_temperatures,)
            In degrees Celsius.
        family : str, optional
            By default the first.
        reference : float, optional
            Temperature at which the change is 0; by default the middle of the fleet's weather.

        Returns
        -------
        DataFrame
            On an index of temperatures: ``mean`` and ``standard_deviation`` of another bridge of the fleet, of unknown
            covariates (NaN for a family that is not pooled), and a column for each bridge with its own.

        Raises
        ------
        ValueError
            If there is no such family.
        """
        check_is_fitted(self)
        family = self.comparison_.index[0] if family is None else family
        if family not in self.comparison_.index:
            raise ValueError(f"family is {family!r}; expected one of {list(self.comparison_.index)}")
        basis, known = self.knowledge_.basis, self.knowledge_.families
        values, d = steady_changes(basis, temperatures, reference, self.reach_)
        columns = {"mean": np.full(len(d), np.nan), "standard_deviation": np.full(len(d), np.nan)}
        if family in known:
            mean, covariance = known[family].predictive(*self.knowledge_.covariates.row(None))
            columns = {"mean": d @ mean, "standard_deviation": np.sqrt(np.einsum("ti,ij,tj->t", d, covariance, d))}
        for bridge, by_name in self.bridge_families_.items():
            rows = [i for i, of_output in enumerate(by_name.values()) if of_output == family]
            if rows:
                columns[bridge] = d @ self.coefficients_[bridge][rows].mean(axis=0)
        scale = self.knowledge_.scales.get(family, 1.0)
        return scale * pd.DataFrame(columns, index=pd.Index(values, name="temperature"))

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
            n_bridges = counted(row["n_bridges"], "bridge")
            gain = f"gain in log likelihood {row['gain']:+.3g} (standard error {row['standard_error']:.2g})"
            if row["is_pooled"]:
                lines.append(f"{name}: pooled over {n_bridges}, {gain}")
            elif row["n_bridges"] < LEAST_BRIDGES:
                lines.append(f"{name}: not pooled, {n_bridges}; expected at least {LEAST_BRIDGES}")
            else:
                lines.append(
                    f"{name}: not pooled over {n_bridges}, {gain}, not significant; a new bridge learns it from its "
                    "own records alone"
                )
        return "\n".join(lines)
