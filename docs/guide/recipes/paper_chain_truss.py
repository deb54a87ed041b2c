from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.metrics import mape
from skthermo.surrogate import paper_chain

seed = 0
year, later = (make_truss_campaign(random_state=one) for one in (seed, 1000 + seed))
fem = paper_chain(make_truss(), bounds=0.2, random_state=seed).fit(year.temperatures, year.frequencies)
errors = mape(later.clean_frequencies, fem.predict(later.temperatures))
detector = MahalanobisDetector(threshold="quantile").fit(year.frequencies)
measured = detector.predict(later.frequencies) == -1  # alarms of SH-0, thermo-mechanical
simulated = detector.predict(fem.simulate(later.temperatures, noise=0.01, random_state=seed)) == -1
