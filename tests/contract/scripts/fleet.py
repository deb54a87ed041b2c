import tempfile

from sklearn.linear_model import Ridge

from tests.contract.truss import campaign

try:
    from skthermo.monitoring import fit_fleet
except ImportError:  # its room in 0.2
    from skthermo.fleet import fit_fleet


def fleet_monitors():
    """Two bridges fitted in one call, one of which cannot be; their monitors together."""
    years = {name: campaign(n, samples_per_year=180) for n, name in enumerate(["north", "south"])}
    records = {name: (year.temperatures, year.frequencies) for name, year in years.items()} | {"empty": (None, None)}
    with tempfile.TemporaryDirectory() as folder:
        fleet = fit_fleet(dict.fromkeys(records, Ridge()), records, folder=folder)
        return {
            "fitted": fleet.table["is_fitted"],
            "records": fleet.table["n_records"].loc[["north", "south"]],
            "errors": sorted(set(fleet.errors["bridge"])) if "bridge" in fleet.errors else len(fleet.errors),
        }
