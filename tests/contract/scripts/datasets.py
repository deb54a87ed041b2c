import tempfile
from pathlib import Path

import pandas as pd

from skthermo import datasets


def datasets_fleet():
    """Bridges of a fleet: their kinds, and records of one with a softer soil."""
    fleet = datasets.make_fleet(3, random_state=0)
    bridge = fleet["bridge 001"]
    records = bridge.records(60, damage={"soil": 0.2})
    return {
        "names": list(fleet),
        "parameters": list(bridge.model.parameter_names),
        "groups": list(bridge.groups),
        "shapes": [list(records.temperatures.shape), list(records.frequencies.shape)],
        "falls": bool(records.frequencies.mean().lt(bridge.records(60).frequencies.mean()).any()),
    }


def datasets_kw51_model():
    """The model of the bridge KW51, its sensors, and its calibrated state."""
    model = datasets.make_kw51(["E_arc", "M_a"], n_modes=2)
    structure = datasets.kw51_structure()
    return {
        "frequencies": model.frequencies([[1.0, 1.0], [1.1, 1.0], [1.0, 1.1]]),
        "sensor": [str(part) for part in structure.dofs[datasets.kw51_sensors()["aBD17Az"]]],
        "dofs": len(structure.dofs),
        "braces": len(structure.groups["braces"]),
    }, {"*": {"rtol": 1e-7}}


def datasets_truss():
    """The truss of the paper: nominal frequencies, a damaged chord, the modulus of steel."""
    truss = datasets.make_truss()
    return {
        "parameters": list(truss.parameter_names),
        "nominal": truss.frequencies([[1.0] * 4]),
        "SB-50": truss.damaged({"bottom": 0.5}).frequencies([[1.0] * 4]),
        "modulus": datasets.steel_modulus([-10.0, 20.0, 40.0]),
        "bottom chord": sorted(datasets.truss_structure().groups["bottom"], key=int),
        "degrees of freedom": len(datasets.truss_structure().dofs),
    }, {"*": {"rtol": 1e-8}}


def datasets_truss_campaign():
    """Records of the truss: the same seed gives the same bits, damage and drift begin where they are asked for."""
    year = datasets.make_truss_campaign(random_state=0)
    chord = {"drift": {"bottom": 0.01}, "damage": {"bottom": 0.12}, "damage_from": "2028-01-01"}
    f1 = datasets.make_truss_campaign(4, **chord, random_state=0).clean_frequencies["f1"]
    hourly = datasets.make_truss_campaign(
        samples_per_year=48, samples_per_day=24, noise=0.005, correlation=0.5, random_state=1
    )
    return {
        "columns": [*year.temperatures, *year.frequencies],
        "stamps": [str(year.temperatures.index[n]) for n in (0, 1, -1)],
        "first temperatures": year.temperatures[:3],
        "first frequencies": year.frequencies[:3],
        "clean": year.clean_frequencies.mean(),
        "means of years": f1.groupby(f1.index.year).mean(),
        "hourly": hourly.frequencies.iloc[-1],
    }, {"*": {"rtol": 1e-8}}


def datasets_z24_file():
    """Records in the form of the published ones of Z24, as CSV."""
    sensors = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
    rows = [[0, 4.0, 5.2, 10.1, 10.8, *range(7), "undamaged"], [3, 3.9, 5.1, 10.0, 10.7, *range(7), "damaged"]]
    table = pd.DataFrame(rows, columns=["record", "f1", "f2", "f3", "f4", *sensors, "state"])
    with tempfile.TemporaryDirectory() as folder:
        table.to_csv(Path(folder) / "z24.csv", index=False)
        z24 = datasets.load_z24(Path(folder) / "z24.csv")
    return {
        "temperatures": z24.temperatures,
        "frequencies": z24.frequencies,
        "state": list(z24.state),
        "stamps": [str(stamp) for stamp in z24.state.index],
    }


def datasets_z24_model():
    """The model of the bridge Z24, and a settled pier."""
    model = datasets.make_z24()
    return {
        "parameters": list(model.parameter_names),
        "frequencies": model.frequencies([[1.0] * 4]),
        "softer soil": model.damaged({"soil": 0.3}).frequencies([[1.0] * 4]),
    }, {"*": {"rtol": 1e-7}}
