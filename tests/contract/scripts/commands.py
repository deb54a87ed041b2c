import contextlib
import io
import json
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

from skthermo.__main__ import main
from tests.contract.truss import campaign, records_of


def run(*arguments):
    """The exit code, and what is printed as results and as errors."""
    given = patch.object(sys, "argv", ["skthermo", *map(str, arguments)])
    with given, contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        return main(), out.getvalue(), err.getvalue()


def commands_bridge():
    """Two CSV files become a monitor; new records come, and the page, the transitions and the metrics are written."""
    records = records_of(campaign(4, 2, damage={"bottom": 0.3}, damage_from="2026-02-01"))
    with tempfile.TemporaryDirectory() as name:
        folder, bridge = Path(name), Path(name) / "river"
        records[:"2025"].filter(regex="^T").to_csv(folder / "T.csv")
        records[:"2025"].filter(regex="^f").to_csv(folder / "F.csv")
        codes = [run("init", folder / "T.csv", folder / "F.csv", "--into", bridge)[0]]
        codes.append(run("fit", bridge / "monitor.toml")[0])
        records["2026-01-01":"2026-01-20"].to_csv(bridge / "new" / "january.csv")
        codes.append(run("update", bridge / "monitor.toml", "--now", "2026-01-20")[0])
        records["2026-01-21":"2026-02-20"].to_csv(bridge / "new" / "february.csv")
        code, text, _ = run(
            "update", bridge / "monitor.toml", "--json", "--now", "2026-02-20", "--metrics", folder / "m.prom"
        )
        said = json.loads(text)["bridges"][0]
        codes += [code, run("status", bridge, "--now", "2026-02-20")[0]]
        event = next(one for one in said["status"]["events"] if one["kind"] == "damage")
        codes.append(run("acknowledge", bridge, event["event"], "--damage", "--note", "chord")[0])
        codes.append(run("report", bridge, "--out", folder / "page.html", "--now", "2026-02-20")[0])
        return {
            "codes": codes[:5],
            "state": [said["name"], said["state"], event["kind"]],
            "since": event["since"][:7],
            "new": said["records"]["new"],
            "transitions": len((bridge / "transitions.jsonl").read_text().splitlines()) > 0,
            "metrics": 'skthermo_state{bridge="river",state="alarm"} 1' in (folder / "m.prom").read_text(),
            "pages": [(bridge / "status.html").exists(), (folder / "page.html").exists()],
        }


def commands_check():
    """What the commands say of files with defects, of files that are not there, and of a folder without settings."""
    year = campaign()
    T = year.temperatures.copy()
    T.loc["2025-12":, "T1"] = 20.0
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for letter, table in (("T", T), ("F", year.frequencies)):
            table.to_csv(folder / f"{letter}.csv", sep=";", decimal=",", date_format="%d.%m.%Y %H:%M")
        code, text, _ = run("check", folder / "T.csv", folder / "F.csv", "--json")
        findings = json.loads(text)["findings"]
        lost, _, said = run("check", folder / "no.csv", folder / "F.csv")
        return {
            "check": [code, [(one["what"], one["column"], one["n_rows"]) for one in findings]],
            "no file": [lost, "no.csv" in said],
            "no folder": run("status", folder / "river")[0],
            "no settings": run("fit", folder)[0],
        }
