"""Two bridges fitted in one call, one of which cannot be; their monitors together."""

import tempfile

from sklearn.linear_model import Ridge

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor

try:
    from skthermo.monitoring import fit_fleet
except ImportError:  # its room in 0.2
    from skthermo.fleet import fit_fleet


def monitor_of(_):
    return Monitor(MahalanobisDetector(), targets=[f"f{n}" for n in range(1, 7)])


years = {name: make_truss_campaign(samples_per_year=180, random_state=n) for n, name in enumerate(["north", "south"])}
records = {name: (year.temperatures, year.frequencies) for name, year in years.items()} | {"empty": (None, None)}
with tempfile.TemporaryDirectory() as folder:
    fleet = fit_fleet(dict.fromkeys(records, Ridge()), records, folder=folder)
    RESULTS = {
        "fitted": fleet.table["is_fitted"],
        "records": fleet.table["n_records"].loc[["north", "south"]],
        "errors": sorted(set(fleet.errors["bridge"])) if "bridge" in fleet.errors else len(fleet.errors),
    }
