"""A prior that a fleet of bridges gives to a new one, and whether pooling helps."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from numbers import Integral
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike
from scipy.stats import t as student

from skthermo._core.arrays import Array, real_array
from skthermo._core.estimators import Estimator, Interval, check_is_fitted
from skthermo._core.text import counted
from skthermo.fleet.prior._families import CoefficientFamily, Covariates, Member, expect, learn_families
from skthermo.fleet.prior._information import FleetBasis, FleetNoise, Information
from skthermo.fleet.prior._mapper import FleetKnowledge, FleetMapper, pooled_weather
from skthermo.fleet.prior._posterior import ATYPICAL, CoefficientPosterior, Mixture, OwnPrior, follow_chance, mixture
from skthermo.fleet.prior._records import Link, bridges_of, common_inputs, families_by_name, linear_scales, read_bridge
from skthermo.residuals.weather import TrainingRange

LEAST_BRIDGES = 3
LEAST_DEVIATION = 1.0  # of a bridge's gain: that a few are alike is chance
LEVEL = 0.95  # probability with which a gain must be one
COUNT = 10.0  # bridges as which it counts that few are atypical
MOST_LEFT_OUT = 50  # bridges that are left out one at a time; of more, groups are
FEW = 60  # bridges of which one changes little of what is known of the others: fewer take more steps without it
FAR, FEW_MEMBERS = 3.0, 5  # times the median distance from the median: atypical, among at least so many
SETTLED = 0.05
ROUNDS = 3  # in which atypical are found, and the families learned without them


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
        weather = pooled_weather([one.inputs for one in records])
        basis = FleetBasis.of(weather, self.n_knots)
        plain = OwnPrior(np.ones(basis.n_functions))
        found = [Information.of(basis, one, own, plain) for one, own in zip(records, families, strict=True)]
        own = OwnPrior.of([one.J for one in found], [one.h for one in found], families, basis.n_functions)
        encoding, Z, unknown = Covariates.of(covariates, list(read))
        members = [
            Member(one, of_output, z, covariance, own.fitted(one.J, one.h, of_output))
            for one, of_output, z, covariance in zip(found, families, Z, unknown, strict=True)
        ]
        names = sorted({family for of_output in families for family in of_output if family is not None}, key=str)
        covariance = np.atleast_2d(np.cov(basis(weather), rowvar=False))
        pooled, chances, self.comparison_, self.bridges_, self.coefficients_ = compare_pooling(
            members, list(read), names, covariance
        )
        noise = FleetNoise.of(found, families)
        self.knowledge_ = FleetKnowledge(basis, noise, own, encoding, pooled, chances, scales, inputs)
        self.bridge_families_ = of_bridge
        self.parameter_names_ = list(dict.fromkeys(name for by_name in of_bridge.values() for name in by_name))
        ends = np.array([end(one.inputs, axis=0) for one in records for end in (np.min, np.max)])
        self.reach_ = TrainingRange.spanned(ends if inputs is None else pd.DataFrame(ends, columns=inputs), slice(None))
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
        self,
        temperatures: ArrayLike,
        family: Hashable = None,
        *,
        mapper: FleetMapper | None = None,
        reference: float | None = None,
    ) -> pd.DataFrame:
        """How ln y (y, if linear) changes from a reference temperature to others, where inputs have been so for long.

        Parameters
        ----------
        temperatures : array-like of shape (n_temperatures,)
            In degrees Celsius.
        family : str, optional
            By default the first.
        mapper : FleetMapper, optional
            Fitted to the records of a bridge: the change of that bridge, and not of any other one.
        reference : float, optional
            Temperature at which the change is 0; by default the middle of the fleet's weather.

        Returns
        -------
        DataFrame
            On an index of temperatures: ``mean`` and ``standard_deviation`` of the mapper's bridge or, without one, of
            another bridge of the fleet, of unknown covariates (NaN for a family that is not pooled), and a column for
            each bridge of the fleet with its own.

        Raises
        ------
        ValueError
            If there is no such family, or the mapper's bridge has none of it.
        """
        check_is_fitted(self)
        values = np.atleast_1d(real_array(temperatures, "temperatures"))
        if values.ndim != 1 or not values.size or not np.isfinite(values).all():
            raise ValueError(f"temperatures are {temperatures!r:.100}; expected finite degrees Celsius in one row")
        family = self.comparison_.index[0] if family is None else family
        if family not in self.comparison_.index:
            raise ValueError(f"family is {family!r}; expected one of {list(self.comparison_.index)}")
        middle = np.mean([self.reach_.lowest, self.reach_.highest]) if reference is None else reference
        known, at = self.knowledge_, np.append(values, middle)
        places = known.basis.steady(at)
        changes = own = places[:-1] - places[-1]
        size = changes.shape[1]
        mean, covariance = np.full(size, np.nan), np.full((size, size), np.nan)
        if mapper is not None:
            check_is_fitted(mapper)
            rows = [row for row, of_output in enumerate(mapper.families_.values()) if of_output == family]
            if not rows:
                raise ValueError(f"family is {family!r}; expected one of the mapper's, {mapper.families_}")
            places = mapper.basis_.steady(at)
            own = places[:-1] - places[-1]
            mean = mapper.coefficients_[rows, 1:].mean(axis=0)
            covariance = mapper.covariance_[rows, 1:][:, :, rows, 1:].mean(axis=(0, 2))
        elif family in known.families:
            mean, covariance = known.families[family].predictive(*known.covariates.row(None))
        columns = {"mean": own @ mean, "standard_deviation": np.sqrt(np.einsum("ti,ij,tj->t", own, covariance, own))}
        for bridge, by_name in self.bridge_families_.items():
            rows = [i for i, of_output in enumerate(by_name.values()) if of_output == family]
            if rows:
                columns[bridge] = changes @ self.coefficients_[bridge][rows].mean(axis=0)
        return known.scales.get(family, 1.0) * pd.DataFrame(columns, index=pd.Index(values, name="temperature"))

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


def compare_pooling(
    members: Sequence[Member], bridges: Sequence[Hashable], names: Sequence[Hashable], covariance: Array
) -> tuple[dict[Hashable, CoefficientFamily], dict[Hashable, float], pd.DataFrame, pd.DataFrame, dict[Hashable, Array]]:
    """Pooled families, the probability of following each, tables by family and by bridge, and bridges' coefficients.

    Families are learned, bridges left out, and families learned again without the weight of atypical ones.
    """
    probabilities = dict.fromkeys(names, 1 - ATYPICAL)
    several = [name for name in names if sum(name in member.families for member in members) > 1]
    follows = seem_to_follow(members, several, covariance)
    families = learn_families(members, names, follows)
    for _ in range(ROUNDS):
        before = follows
        chances = {name: probabilities[name] for name in several}
        found = left_out(members, several, follows, families, chances)
        follows = {(i, name): share for i, one in enumerate(found) for name, share in one.follows.items()}
        for name in several:
            shares = [follows[i, name] for i, member in enumerate(members) if name in member.families]
            probabilities[name] = (sum(shares) + (1 - ATYPICAL) * COUNT) / (len(shares) + COUNT)
        families = learn_families(members, names, follows, expect(members, families))
        if max((abs(share - before.get(key, 1.0)) for key, share in follows.items()), default=0.0) < SETTLED:
            break
    table = by_bridge(found, bridges, probabilities)
    comparison = by_family(table, members, names)
    pooled = {name: families[name] for name in names if comparison.loc[name, "is_pooled"]}
    chances = {name: probabilities[name] for name in pooled}
    coefficients = {
        bridge: mixture(
            member.information.J, member.information.h, member.families, member.prior(pooled), member.own, chances
        ).mean.reshape(member.information.n_outputs, -1)
        for bridge, member in zip(bridges, members, strict=True)
    }
    return pooled, chances, comparison, table, coefficients


def seem_to_follow(
    members: Sequence[Member], names: Sequence[Hashable], covariance: Array
) -> dict[tuple[int, Hashable], float]:
    """1, or 0 for bridges that on their own respond far from the median of their family, in the fleet's weather."""
    own = [
        CoefficientPosterior(m.information.J, m.information.h, *m.own).mean.reshape(len(m.families), -1)
        for m in members
    ]
    follows = {}
    for name in names:
        of_family = [(i, own[i][j]) for i, m in enumerate(members) for j, f in enumerate(m.families) if f == name]
        b = np.array([coefficients for _, coefficients in of_family])
        away = b - np.median(b, axis=0)
        distances = np.sqrt(np.einsum("ij,jk,ik->i", away, covariance, away))
        far = (distances > FAR * np.median(distances)) & (len(b) >= FEW_MEMBERS)
        for (i, _), is_far in zip(of_family, far, strict=True):
            follows[i, name] = min(follows.get((i, name), 1.0), 0.0 if is_far else 1.0)
    return follows


def left_out(
    members: Sequence[Member],
    names: Sequence[Hashable],
    follows: Mapping[tuple[int, Hashable], float],
    families: Mapping[Hashable, CoefficientFamily],
    probabilities: Mapping[Hashable, float],
) -> list[Mixture]:
    """Every bridge's posterior by families that are learned without it."""
    found: dict[int, Mixture] = {}
    moments, n_steps = expect(members, families), FEW // len(members)
    for group in groups(len(members)):
        kept = [i for i in range(len(members)) if i not in group]
        others = {(place, name): follows.get((i, name), 1.0) for place, i in enumerate(kept) for name in names}
        rest = [members[i] for i in kept]
        known = [name for name in names if sum(name in member.families for member in rest) > 0]
        without = learn_families(rest, known, others, [moments[i] for i in kept], n_steps)
        for i in group:
            member = members[i]
            prior = member.prior(without, predictive=True)
            chances = {name: p for name, p in probabilities.items() if name in without}
            found[i] = mixture(member.information.J, member.information.h, member.families, prior, member.own, chances)
    return [found[i] for i in range(len(members))]


def groups(n_bridges: int) -> list[list[int]]:
    """Bridges that are left out together."""
    n_groups = min(n_bridges, MOST_LEFT_OUT)
    return [list(range(i, n_bridges, n_groups)) for i in range(n_groups)]


def by_bridge(
    found: Sequence[Mixture], bridges: Sequence[Hashable], probabilities: Mapping[Hashable, float]
) -> pd.DataFrame:
    """Log likelihoods alone, and by the mixture of following the others and being on its own."""
    rows = []
    for bridge, one in zip(bridges, found, strict=True):
        for name, share in one.follows.items():
            alone, chance = one.without_family[name], follow_chance(probabilities[name])
            pooled = float(np.logaddexp(np.log(chance) + one.with_family[name], np.log1p(-chance) + alone))
            rows.append((bridge, name, alone, pooled, pooled - alone, share))
    columns = ["bridge", "family", "alone", "pooled", "gain", "pooling_probability"]
    return pd.DataFrame(rows, columns=columns).set_index(["bridge", "family"])


def by_family(table: pd.DataFrame, members: Sequence[Member], names: Sequence[Hashable]) -> pd.DataFrame:
    """Sums over bridges; a family is pooled where its gain is clearly positive and enough bridges have it."""
    rows = []
    for name in names:
        n_bridges = sum(name in member.families for member in members)
        part = table[table.index.get_level_values("family") == name]
        gain, error = float(part["gain"].sum()), np.nan
        if n_bridges > 1:
            error = float(max(part["gain"].std(), LEAST_DEVIATION) * np.sqrt(n_bridges))
        is_pooled = n_bridges >= LEAST_BRIDGES and gain > student.ppf(LEVEL, n_bridges - 1) * error
        rows.append((name, n_bridges, part["alone"].sum(), part["pooled"].sum(), gain, error, bool(is_pooled)))
    columns = ["family", "n_bridges", "alone", "pooled", "gain", "standard_error", "is_pooled"]
    return pd.DataFrame(rows, columns=columns).set_index("family")
