"""Outliers of frequencies become missing, alone and beside the weather."""

import numpy as np

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import HampelFilter

year = make_truss_campaign(samples_per_year=120, noise=0.002, random_state=0)
records = year.temperatures.join(year.frequencies)
records.iloc[50, 4] *= 1.2
F = np.random.default_rng(0).normal(4.0, 0.02, (200, 2))
F[50, 1] = 4.8
alone = HampelFilter().fit(F)
beside = HampelFilter(targets=list(year.frequencies)).fit(records)
RESULTS = {
    "removed": alone.n_removed_,
    "missing": np.isnan(alone.transform(F)).sum(axis=0),
    "beside the weather": bool(np.isnan(beside.transform(records).iloc[50, 4])),
    "temperatures": int(beside.transform(records)[list(year.temperatures)].isna().to_numpy().sum()),
}
