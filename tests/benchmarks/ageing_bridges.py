"""Campaigns of bridges that age, and chains that learn from their first year; for benchmarks of monitoring."""

from functools import cache

import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_kw51, make_kw51_campaign, make_truss, make_truss_campaign
from skthermo.preprocessing import BiasAligner, LagFeatures
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper

OFF = 0.05  # by which stiffnesses of a wrong model are too high and too low in turn
KW51_NOISE = (0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0015)


@cache
def kw51_model():
    """The updated model, reduced."""
    return make_kw51(updated=True).reduced(0.3, tol=5e-5, random_state=0)


class Truss:
    """Daily records with 1 % of noise."""

    name = "truss"
    groups = ("bottom", "top", "diagonal")
    hardly_seen = ("vertical",)

    def campaign(self, n_years, seed, correlation=0.0, **changes):
        return make_truss_campaign(n_years, correlation=correlation, random_state=seed, **changes)

    def records(self, campaign):
        """Temperatures and frequencies, and how many of them are the first year."""
        return campaign.temperatures, campaign.frequencies, 365

    def quiet_first(self, n_years, seed, correlation=0.0, **changes):
        """As `records`: a year without changes, and years with them, whose drift begins then."""
        parts = [self.campaign(1, 1000 + seed, correlation), self.campaign(n_years - 1, seed, correlation, **changes)]
        later = parts[1].frequencies.index + pd.Timedelta(days=365)
        T, F = (pd.concat([parts[0][name], parts[1][name].set_axis(later)]) for name in ("temperatures", "frequencies"))
        return T, F, 365

    def chain(self, wrong=False):
        model = make_truss()
        if wrong:
            model = model.damaged({group: OFF * (-1) ** i for i, group in enumerate(model.groups)})
        aligner = BiasAligner(model) if wrong else "passthrough"
        return DataInformedFEM(model, inverse=PosteriorInverse(noise=0.01), aligner=aligner, random_state=0)


class KW51:
    """Every ``every``-th hour, with gaps, from when there is a temperature."""

    name = "KW51"
    groups = ("arch", "girders", "braces", "plate", "arch_connections")
    hardly_seen = ()
    first, year = 1236, 8766

    def __init__(self, every=6):
        self.every = every

    def campaign(self, n_years, seed, correlation=0.0, **changes):
        n_hours = self.first + n_years * self.year
        return make_kw51_campaign(
            n_hours=n_hours, retrofit=False, correlation=correlation, random_state=100 + seed, **changes
        )

    def records(self, campaign):
        """Temperatures and frequencies, and how many of them are the first year."""
        rows = slice(self.first, None, self.every)
        return campaign.temperatures[rows], campaign.frequencies[rows], int(np.ceil(self.year / self.every))

    def chain(self, wrong=False):
        model = kw51_model()
        if wrong:
            model = model.damaged({"arch": OFF, "bottom": -OFF, "braces": OFF, "connections": -OFF})
        mapper = make_pipeline(LagFeatures(24 // self.every, freq=f"{self.every}h"), TemperatureMapper())
        return DataInformedFEM(
            model,
            inverse=PosteriorInverse(noise=KW51_NOISE),
            mapper=mapper,
            aligner=BiasAligner(model),
            random_state=0,
        )


BRIDGES = {"truss": Truss, "KW51": KW51}
