"""A detector is tuned by simulated damage in scikit-learn's search, and confirmed in other weather."""

from sklearn.model_selection import GridSearchCV

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.studies import detection_task
from skthermo.surrogate import DataInformedFEM

year, weather, later = (make_truss_campaign(random_state=seed) for seed in range(3))
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
options = {"columns": fem.mode_names_, "n_repeats": 2, "random_state": 0}
task = detection_task(fem, weather.temperatures, [{}, {"bottom": 0.2}], **options)
grid = {"threshold": ["conformal", "quantile"]}
search = GridSearchCV(MahalanobisDetector(), grid, cv=task.cv, scoring=task.scoring, refit=False).fit(task.X, task.y)
detector = task.refit(search)
confirmed = task.confirm({"tuned": search}, later.temperatures, random_state=0)
RESULTS = {
    "shape": list(task.X.shape),
    "labels": task.y.value_counts().to_dict(),
    "states": task.states["scenario"].value_counts().to_dict(),
    "scores": search.cv_results_["mean_test_score"],
    "false alarms": float((detector.predict(later.frequencies) == -1).mean()),
    "fresh": confirmed[["tuned", "fresh"]],
}
TOLERANCES = {"scores": {"atol": 0.05}, "false alarms": {"atol": 0.04}, "fresh": {"atol": 0.05}}
