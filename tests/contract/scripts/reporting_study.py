"""A page for the owner from a study: its title, the best detector, the smallest damage."""

import re
import tempfile

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.reporting import owner_report
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM

year = make_truss_campaign(samples_per_year=180, random_state=0)
fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
scenarios = sweep(fem, (0.1, 0.2, 0.3), ["bottom"])
study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=2, uncertainty="noise", random_state=0)
study.run(year.temperatures)
with tempfile.TemporaryDirectory() as folder:
    page = owner_report(study, f"{folder}/bridge.html", title="Truss bridge").read_text(encoding="utf-8")
RESULTS = {
    "title": re.findall("<h1.*?>(.*?)</h1>", page),
    "names the group": "bottom" in page,
    "figures": "<svg" in page or "<img" in page,
    "of itself": "http://" not in page.replace("http://www.w3.org", ""),
}
