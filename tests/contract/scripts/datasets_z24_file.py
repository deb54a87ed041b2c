"""Records in the form of the published ones of Z24, as CSV."""

import tempfile
from pathlib import Path

import pandas as pd

from skthermo.datasets import load_z24

sensors = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
rows = [[0, 4.0, 5.2, 10.1, 10.8, *range(7), "undamaged"], [3, 3.9, 5.1, 10.0, 10.7, *range(7), "damaged"]]
table = pd.DataFrame(rows, columns=["record", "f1", "f2", "f3", "f4", *sensors, "state"])
with tempfile.TemporaryDirectory() as folder:
    table.to_csv(Path(folder) / "z24.csv", index=False)
    z24 = load_z24(Path(folder) / "z24.csv")
RESULTS = {
    "temperatures": z24.temperatures,
    "frequencies": z24.frequencies,
    "state": list(z24.state),
    "stamps": [str(stamp) for stamp in z24.state.index],
}
