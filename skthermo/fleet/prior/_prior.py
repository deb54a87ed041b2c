"""A prior that a fleet of bridges gives to a new one."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from numbers import Integral
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from skthermo._arrays import as_columns
from skthermo._frames import check_columns, check_same_rows, check_temperatures, column_names, frame_like
from skthermo._validation import Estimator, Interval, check_array, check_is_fitted, last_step
from skthermo.fleet.prior._basis import FleetBasis
from skthermo.fleet.prior._comparison import compare
from skthermo.fleet.prior._covariates import Covariates
from skthermo.fleet.prior._families import Member
from skthermo.fleet.prior._posterior import alone
from skthermo.fleet.prior._records import BridgeRecords, FleetNoise, Information

if TYPE_CHECKING:
    from skthermo.fleet.prior._mapper import FleetMapper


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
        from skthermo.fleet.prior._mapper import FleetMapper

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


class ReadBridge:
    """Inputs and values of one bridge as they were given."""

    def __init__(
        self, inputs: Any, values: Any, names: list[Any], input_names: list[Any] | None, weights: Any, coordinates: Any
    ):
        self.inputs, self.values, self.names = inputs, values, names
        self.input_names, self.weights, self.coordinates = input_names, weights, coordinates

    def records(self, order: Sequence[Any] | None) -> BridgeRecords:
        """Its records, inputs in a common order."""
        inputs = self.inputs
        if order is not None and self.input_names is not None and self.inputs.shape[1] > 1:
            inputs = inputs[:, [self.input_names.index(name) for name in order]]
        return BridgeRecords.of(inputs, self.values, self.names, self.weights, self.coordinates)


def bridges_of(bridges: Any) -> dict[Hashable, Any]:
    """Bridges by name."""
    bridges = getattr(bridges, "chains", bridges)
    if isinstance(bridges, Mapping):
        found = dict(bridges)
    elif isinstance(bridges, str) or not isinstance(bridges, Sequence):
        raise ValueError(f"bridges is {bridges!r:.100}; expected a mapping of names to fitted chains or pairs (T, Y)")
    else:
        found = dict(enumerate(bridges))
    if not found:
        raise ValueError("there are no bridges; expected at least one")
    return found


def read_bridge(name: Hashable, bridge: Any) -> ReadBridge:
    """Inputs, values and names of a chain's mapper, or of a pair of tables."""
    try:
        if isinstance(bridge, tuple | list):
            return read_pair(*bridge)
        if not hasattr(bridge, "predict_parameters"):
            raise ValueError(f"it is {bridge!r:.100}; expected a fitted DataInformedFEM, or a pair (T, Y) of tables")
        check_is_fitted(bridge)
    except (TypeError, ValueError) as error:
        raise ValueError(f"bridge {name!r}: {error}") from error
    records = bridge.records_
    input_names = list(bridge.training_range_.names) if hasattr(bridge, "feature_names_in_") else None
    coordinates = getattr(last_step(bridge.mapper_), "coordinates", None)
    weights = records.weights if records.weights is None else np.where(records.counted, records.weights, 0.0)
    return ReadBridge(records.inputs, records.targets, list(bridge.parameter_names_), input_names, weights, coordinates)


def read_pair(T: Any, Y: Any) -> ReadBridge:
    """Two tables, checked."""
    options = {"dtype": np.float64, "ensure_all_finite": "allow-nan"}
    T = T.to_frame() if isinstance(T, pd.Series) else T
    inputs = check_array(T, ensure_2d=False, **options)
    values = as_columns(check_array(Y, ensure_2d=False, **options))
    check_same_rows(T, Y, ("temperatures", "quantities"))
    inputs = as_columns(inputs)
    named = frame_like(T, inputs)
    check_temperatures(named)
    check_columns(named, "temperature", varying=True)
    if isinstance(Y, pd.Series):
        names = ["f1" if Y.name is None else Y.name]
    else:
        names = column_names(Y, "f") if np.ndim(Y) == 2 else ["f1"]
    return ReadBridge(inputs, values, list(names), list(T.columns) if hasattr(T, "columns") else None, None, None)


def common_inputs(read: Mapping[Hashable, ReadBridge]) -> list[Any] | None:
    """Names of the inputs that all bridges have; None where one has none."""
    first, one = next(iter(read.items()))
    for name, other in read.items():
        if other.inputs.shape[1] != one.inputs.shape[1]:
            raise ValueError(
                f"bridge {first!r} has {one.inputs.shape[1]} inputs and bridge {name!r} {other.inputs.shape[1]}; "
                "expected the same inputs for all, such as means of the sensors in each part of a bridge"
            )
        if other.inputs.shape[1] == 1 or None in (one.input_names, other.input_names):
            continue
        if set(other.input_names) != set(one.input_names):
            raise ValueError(
                f"bridge {first!r} has the inputs {one.input_names[:20]} and bridge {name!r} {other.input_names[:20]}; "
                "expected the same names for all, such as means of the sensors in each part of a bridge"
            )
    if any(other.input_names is None for other in read.values()):
        return None
    return one.input_names


def families_by_name(
    families: Mapping[Hashable, Any] | None, names: Sequence[Hashable], bridge: Hashable | None = None
) -> dict[Hashable, Hashable | None]:
    """The family of each name: by default the name itself."""
    if families is not None and bridge in families and isinstance(families[bridge], Mapping):
        families = families[bridge]
    known = {} if families is None else families
    return {name: known.get(name, name) for name in names}


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
