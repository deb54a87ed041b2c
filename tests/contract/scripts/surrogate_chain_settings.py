"""Other parts of a chain: ridge regressions, a fixed alignment, no discrepancy, gaps filled by neighbours."""

import numpy as np
from sklearn.linear_model import LinearRegression, Ridge

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner, KNNGapImputer
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
T, F = year.temperatures, year.frequencies.copy()
F.iloc[::20, 1] = np.nan
truss = make_truss()
fem = DataInformedFEM(
    truss,
    inverse=InverseSurrogate(regressor=Ridge(), bounds=0.2, n_samples=200, noise=0.01, random_state=0),
    mapper=TemperatureMapper(LinearRegression()),
    aligner=BiasAligner(truss),
    imputer=KNNGapImputer(),
    discrepancy=None,
    reduce=False,
    random_state=0,
).fit(T, F)
simulated = truss.frequencies(fem.predict_parameters(later.temperatures))
RESULTS = {
    "mape": mape(later.clean_frequencies, fem.predict(later.temperatures)),
    "equation": bool(np.allclose(fem.aligner_.inverse_transform(simulated), fem.predict(later.temperatures))),
    "discrepancy": float(np.abs(fem.discrepancy_(T)).max()),
}
TOLERANCES = {"mape": {"atol": 0.1}}
