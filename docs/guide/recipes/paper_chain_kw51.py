from skthermo.datasets import make_kw51, make_kw51_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.metrics import mape
from skthermo.surrogate import paper_chain

seed = 0
campaign = make_kw51_campaign(n_hours=4000, random_state=seed)
T, F, pair = campaign.temperatures, campaign.frequencies, ["f2", "f4"]
fem = paper_chain(make_kw51(updated=True), network="kw51", lags=24, random_state=seed)
fem.set_params(reduce="auto").fit(T[:3200], F[:3200])
predicted = fem.predict(T)[3200:]
errors = mape(F[3200:], predicted)  # Table 8
detector = MahalanobisDetector(threshold="quantile").fit(F[:3200][pair].dropna())
measured, simulated = (detector.predict(table[pair].dropna()) == -1 for table in (F[3200:], predicted))
