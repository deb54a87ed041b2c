"""What a fleet knows, and what a bridge's own records make of it."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from skthermo._arrays import Array
from skthermo.fleet.prior._basis import FleetBasis
from skthermo.fleet.prior._covariates import Covariates
from skthermo.fleet.prior._families import Family, Member
from skthermo.fleet.prior._information import FleetNoise, Information
from skthermo.fleet.prior._posterior import Mixture, OwnPrior, mixture
from skthermo.fleet.prior._records import BridgeRecords


@dataclass(frozen=True)
class FleetKnowledge:
    """Functions of the weather, noise, and the prior of coefficients, on a bridge's own and by pooled families."""

    basis: FleetBasis
    noise: FleetNoise | None
    own: OwnPrior
    covariates: Covariates = field(default_factory=lambda: Covariates({}, {}))
    families: Mapping[Hashable, Family] = field(default_factory=dict)
    chances: Mapping[Hashable, float] = field(default_factory=dict)

    @classmethod
    def none(cls, inputs: Array, n_knots: int) -> FleetKnowledge:
        """Without a fleet: functions of a bridge's own weather."""
        basis = FleetBasis.of([inputs], n_knots)
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
