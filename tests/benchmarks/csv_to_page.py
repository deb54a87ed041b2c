"""From two CSV files of each dataset to the owner's page, by commands alone.

    python tests/benchmarks/csv_to_page.py [FOLDER OF DATA] [--keep FOLDER]

Each dataset becomes T.csv and F.csv. The commands init, fit and update then make a page; later records than those of
the baseline are new ones. A line for each dataset and command: exit code, CPU time, and the largest memory.
"""

import argparse
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import pandas as pd

from skthermo.datasets import make_truss_campaign


def truss(folder):
    campaign = make_truss_campaign(3, damage={"bottom": 0.3}, damage_from="2027-06-01", random_state=0)
    return campaign.temperatures, campaign.frequencies, "2026-12-31"


def z24(folder):
    table = pd.read_csv(folder / "z24" / "z24_monitoring.csv")
    table.index = pd.Timestamp("1997-11-11") + pd.to_timedelta(table["record"], "h")
    return table.filter(regex="^T"), table.filter(regex="^f"), str(table.index[2700])


def tower(folder):
    table = pd.read_csv(folder / "tower" / "tower.csv", index_col=0, parse_dates=True)
    return table.filter(regex="^T"), table.filter(regex="^f"), "2019-03-03"


def kw51(folder):
    table = pd.read_csv(folder / "kw51" / "kw51_mode6_daily.csv", index_col=0, parse_dates=True)
    return table[["T"]], table[["f"]], "2019-05-14"


def run(*arguments):
    """Run a command: its exit code, CPU seconds, megabytes and output."""
    code = (
        "import sys, resource; from skthermo.commands.main import main; code = main(sys.argv[1:]); "
        "used = resource.getrusage(resource.RUSAGE_SELF); "
        "peak = next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')); "
        "print(used.ru_utime + used.ru_stime, int(peak) / 1024, file=open('cost.txt', 'w')); sys.exit(code)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *map(str, arguments)], capture_output=True, text=True, check=False
    )
    seconds, megabytes = map(float, Path("cost.txt").read_text().split())
    return done.returncode, seconds, megabytes, done


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, nargs="?", default=os.environ.get("SKTHERMO_DATA"))
    parser.add_argument("--keep", type=Path, help="folder in which the bridges stay")
    options = parser.parse_args()
    failed = 0
    with tempfile.TemporaryDirectory() as temporary:
        place = temporary if options.keep is None else options.keep
        data = None if options.folder is None else Path(options.folder).resolve()
        Path(place).mkdir(exist_ok=True)
        os.chdir(place)
        print(f"{'dataset':8}{'command':10}{'exit code':>10}{'CPU s':>8}{'MB':>6}")
        for make in (truss, z24, tower, kw51):
            try:
                T, F, until = make(data)
            except (TypeError, FileNotFoundError):
                print(f"{make.__name__:8}has no data here")
                continue
            name, now = make.__name__, str(T.index[-1])
            T.to_csv("T.csv", index_label="time")
            F.to_csv("F.csv", index_label="time")
            settings = f"{name}/monitor.toml"
            for arguments in (
                ("init", "T.csv", "F.csv", "--into", name, "--until", until),
                ("fit", settings),
                ("update", settings, "--now", now),
                ("status", settings, "--now", now, "--json"),
            ):
                code, seconds, megabytes, done = run(*arguments)
                print(f"{name:8}{arguments[0]:10}{code:>10}{seconds:>8.2f}{megabytes:>6.0f}", flush=True)
                failed += code == 3
                if code == 3:
                    print(done.stdout, done.stderr)
                if arguments[0] == "update":
                    print(
                        "\n".join(f"         {line}" for line in done.stdout.splitlines() if line[:3] in ("new", "sta"))
                    )
            page = Path(name) / "status.html"
            print(f"         {page}: {page.stat().st_size / 1e3:.0f} kB" if page.exists() else "         no page")
            failed += not page.exists()
    return int(failed > 0)


if __name__ == "__main__":
    sys.exit(main())
