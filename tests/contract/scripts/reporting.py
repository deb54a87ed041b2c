import re
import tempfile

from skthermo.detection import MahalanobisDetector
from skthermo.monitoring import Monitor
from skthermo.reporting import owner_report
from skthermo.studies import DetectabilityStudy, sweep
from tests.contract.truss import campaign, fitted, next_year, records_of


def reporting_monitor():
    """A page for the owner from a monitor in alarm."""
    year = campaign()
    monitor = Monitor(targets=list(year.frequencies), units="Hz").fit(records_of(year))
    monitor.update(next_year({"bottom": 0.3})[:20])
    with tempfile.TemporaryDirectory() as folder:
        path = owner_report(monitor, f"{folder}/status.html", title="Bridge over the river", now=monitor.last_)
        page = path.read_text(encoding="utf-8")
    return {
        "title": re.findall("<h1.*?>(.*?)</h1>", page),
        "alarm": "alarm" in page.lower(),
        "year": "2026" in page,
        "figures": "<svg" in page or "<img" in page,
    }


def reporting_study():
    """A page for the owner from a study: its title, the best detector, the smallest damage."""
    year = campaign(0, samples_per_year=180)
    fem = fitted(year)
    scenarios = sweep(fem, (0.1, 0.2, 0.3), ["bottom"])
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=2, uncertainty="noise", random_state=0)
    study.run(year.temperatures)
    with tempfile.TemporaryDirectory() as folder:
        page = owner_report(study, f"{folder}/bridge.html", title="Truss bridge").read_text(encoding="utf-8")
    return {
        "title": re.findall("<h1.*?>(.*?)</h1>", page),
        "names the group": "bottom" in page,
        "figures": "<svg" in page or "<img" in page,
        "of itself": "http://" not in page.replace("http://www.w3.org", ""),
    }
