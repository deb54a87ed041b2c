"""A page for the owner from a monitor in alarm."""

import re
import tempfile

import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import Monitor
from skthermo.reporting import owner_report

year, later = make_truss_campaign(random_state=0), make_truss_campaign(damage={"bottom": 0.3}, random_state=1)
monitor = Monitor(targets=list(year.frequencies), units="Hz").fit(year.temperatures.join(year.frequencies))
new = later.temperatures.join(later.frequencies)[:20]
monitor.update(new.set_index(new.index + pd.DateOffset(years=1)))
with tempfile.TemporaryDirectory() as folder:
    path = owner_report(monitor, f"{folder}/status.html", title="Bridge over the river", now=monitor.last_)
    page = path.read_text(encoding="utf-8")
RESULTS = {
    "title": re.findall("<h1.*?>(.*?)</h1>", page),
    "alarm": "alarm" in page.lower(),
    "year": "2026" in page,
    "figures": "<svg" in page or "<img" in page,
}
