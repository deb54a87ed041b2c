"""What a nightly call of ``skthermo update`` costs, of one bridge and of several, with and without their pages.

    python tests/benchmarks/nightly_jobs.py

A monitor of the truss, fitted to a year of six-hourly records, has 300 days of service behind it. Each night, a file of
four records comes into the folder of each bridge, and the command is run in a process of its own.
"""

import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path
from statistics import median

import pandas as pd
from harness import arguments, joined, shown

from skthermo.datasets import make_truss_campaign

PER_DAY, BEFORE = 4, 300
PAGES = {"without a page": "", "with a page": "status.html"}
CALL = """import re, runpy, sys, time
try:
    runpy.run_module("skthermo", run_name="__main__")
finally:
    peak = re.search(r"VmHWM:\\s+(\\d+)", open("/proc/self/status").read())[1]
    print(time.process_time(), int(peak) / 1000, file=sys.stderr)"""


def called(*words, code="import runpy; runpy.run_module('skthermo', run_name='__main__')"):
    """The last line of a command's messages; 0 to 2 are states of a bridge."""
    words = [sys.executable, "-c", code, *map(str, words)]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode in (0, 1, 2), done.stderr
    return done.stderr.splitlines()[-1] if done.stderr else ""


def bridges(folder, number, records):
    """Folders of monitors that have been in service for some time."""
    records[:"2025"].to_csv(folder / "all.csv")
    first = folder / "bridge 1"
    called("init", folder / "all.csv", "--into", first)
    called("fit", first / "monitor.toml")
    served = records["2026":][: BEFORE * PER_DAY]
    served.to_csv(first / "new" / "served.csv")
    called("update", first / "monitor.toml", "--now", served.index[-1])
    others = [folder / f"bridge {n}" for n in range(2, number + 1)]
    for other in others:
        shutil.copytree(first, other)
    return [first, *others]


def main():
    options = arguments(__doc__, bridges=5, nights=(5, "of each way; the median counts"))
    records = joined(make_truss_campaign(2, samples_per_year=365 * PER_DAY, samples_per_day=PER_DAY, random_state=0))
    nights = (part for _, part in records["2026":][BEFORE * PER_DAY :].groupby(pd.Grouper(freq="D")))
    table = {}
    with tempfile.TemporaryDirectory() as place:
        folders = bridges(Path(place), options.bridges, records)
        for text, page in PAGES.items():
            for folder in folders:
                file = folder / "monitor.toml"
                file.write_text(re.sub(r'(?m)^(# )?page = "[^"]*"', f'page = "{page}"', file.read_text()))
            for some in (folders[:1], folders):
                costs = []
                for _ in range(options.nights):
                    night = next(nights)
                    for folder in folders:
                        night.to_csv(folder / "new" / f"{night.index[0]:%Y-%m-%d}.csv")
                    names = [folder / "monitor.toml" for folder in some]
                    words = called("update", *names, "--now", night.index[-1], code=CALL)
                    costs.append(list(map(float, words.split())))
                seconds, megabytes = map(median, zip(*costs, strict=True))
                what = f"{len(some)} bridge{'s' * (len(some) > 1)}, {text}"
                table[what] = {"processor seconds": round(seconds, 1), "largest memory, MB": f"{megabytes:.0f}"}
    shown(f"A nightly call, median of {options.nights}", pd.DataFrame(table).T, 1)


if __name__ == "__main__":
    main()
