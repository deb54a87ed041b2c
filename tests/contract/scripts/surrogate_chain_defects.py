"""A chain learns from records with gaps, outliers and markers, and without settings."""

import numpy as np

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.metrics import mape
from skthermo.surrogate import DataInformedFEM

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
T, F = year.temperatures.copy(), year.frequencies.copy()
random = np.random.default_rng(0)
F = F.where(random.random(F.shape) > 0.05)
T.iloc[10:15, 0] = np.nan
T.iloc[40:44, 1] = -999.0
F.iloc[random.choice(365, 6), 2] *= 1.3
fem = DataInformedFEM(make_truss(), random_state=0).fit(T, F)
gaps = later.temperatures.copy()
gaps.iloc[5, 0] = np.nan
gaps.iloc[6] = np.nan
RESULTS = {
    "mape": mape(later.clean_frequencies, fem.predict(later.temperatures)),
    "missing": fem.predict(gaps).isna().sum(axis=1).iloc[4:8].to_numpy(),
    "found": sorted({*fem.report_.findings.table["what"]} & {"placeholders", "outliers"}),
}
TOLERANCES = {"mape": {"atol": 0.1}}
