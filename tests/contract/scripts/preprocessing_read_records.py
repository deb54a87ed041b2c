"""Files of loggers: German decimals and dates, units, markers, two files, Excel's comma file."""

import tempfile
from pathlib import Path

import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import read_records

lines = ["Zeit;Luft [°C];f1 [Hz]", "13.01.2026 22:00;-1,5;4,012", "13.01.2026 23:00;-999;4,015", ""]
year = make_truss_campaign(samples_per_year=40, random_state=0)
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    (folder / "log.csv").write_text("\n".join(lines), encoding="utf-8")
    german = read_records(folder / "log.csv")
    year.temperatures.to_csv(folder / "T.csv")
    year.frequencies.to_csv(folder / "F.csv", sep="\t")
    two = read_records(folder / "T.csv", folder / "F.csv")
RESULTS = {
    "columns": [list(table) for table in german],
    "values": [table.to_numpy() for table in german],
    "stamps": [str(stamp) for stamp in german[0].index],
    "two files": [bool(((two[0] - year.temperatures).abs() < 1e-9).all(axis=None)), list(two[1])],
    "same stamps": bool((pd.DatetimeIndex(two[0].index) == year.temperatures.index).all()),
}
