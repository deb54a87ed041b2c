"""Defects of records are found: stuck sensors, kelvin, shifted clocks, markers."""

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import check_records

year = make_truss_campaign(random_state=0)
T, F = year.temperatures, year.frequencies
stuck = T.copy()
stuck.loc["2025-12":, "T1"] = 20.0
marked = T.copy()
marked.loc["2025-03", "T1"] = -999.0
high = F.copy()
high.iloc[7, 2] *= 100
aside = check_records(marked, high)
RESULTS = {
    "nothing": len(check_records(T, F).table),
    "stuck": check_records(stuck, F).table[["what", "column", "n_rows"]],
    "kelvin": list(check_records(T[["T1"]] + 273.15).table["what"]),
    "late": list(check_records(T, F.shift(60)).table["what"]),
    "set aside": sorted(aside.table["column"]),
    "missing": [aside.temperatures.isna().sum(), aside.frequencies.isna().sum()],
}
