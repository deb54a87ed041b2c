from pyod.models.iforest import IForest
from pyod.models.lof import LOF

from skthermo.detection import OutlierDetector

damaged = make_truss_campaign(damage={"bottom": 0.3}, random_state=1).frequencies
forest = OutlierDetector(IForest(random_state=0), contamination=0.02).fit(F)
factor = OutlierDetector(LOF(n_neighbors=20), contamination=0.02).fit(F)
alarms = (forest.predict(damaged) == -1).mean(), (factor.predict(damaged) == -1).mean()
