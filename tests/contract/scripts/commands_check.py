"""What the commands say of files with defects, of files that are not there, and of a folder without settings."""

import contextlib
import io
import json
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

from skthermo.__main__ import main
from skthermo.datasets import make_truss_campaign


def run(*arguments):
    given = patch.object(sys, "argv", ["skthermo", *map(str, arguments)])
    with given, contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        return main(), out.getvalue(), err.getvalue()


year = make_truss_campaign(random_state=0)
T = year.temperatures.copy()
T.loc["2025-12":, "T1"] = 20.0
with tempfile.TemporaryDirectory() as name:
    folder = Path(name)
    for letter, table in (("T", T), ("F", year.frequencies)):
        table.to_csv(folder / f"{letter}.csv", sep=";", decimal=",", date_format="%d.%m.%Y %H:%M")
    code, text, _ = run("check", folder / "T.csv", folder / "F.csv", "--json")
    findings = json.loads(text)["findings"]
    lost, _, said = run("check", folder / "no.csv", folder / "F.csv")
    RESULTS = {
        "check": [code, [(one["what"], one["column"], one["n_rows"]) for one in findings]],
        "no file": [lost, "no.csv" in said],
        "no folder": run("status", folder / "river")[0],
        "no settings": run("fit", folder)[0],
    }
