"""What users wait for, now and before: processor seconds, peak memory and digits of the same works in one run.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/speed.py --before HEAD~20
    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/speed.py --before 807a281 --rows lags study --digits
    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/speed.py --rows table

``works.py`` has the works. Each runs in a process of its own, by turns with a copy of the code of this folder and of
another revision. Printed are medians of processor seconds (worker processes included), how many times faster it is now,
and the largest peak memory. "beside" is how many times longer another way takes in the same process: a loop of
``scipy.sparse.linalg.eigsh`` over the same matrices, for lags ``pandas.concat`` of shifts, for gaps ``KNNImputer``, for
eight detectors a study for each, for a monitor after ten years its updates after one. "at 37 ms" are the seconds on a
machine on which one turn of the loop of ``eigsh`` over the building frame takes 37 ms. A work that takes more processor
seconds than ``--limit`` is stopped. Rows that need data which SKTHERMO_DATA does not hold are left out.

The exit code is 1 if something beside the table's rows has become slower by more than 10 %: if even the fastest round
takes more than 1.1 times the median of before; and, with ``--digits``, if results differ by more than is allowed.
"""

import argparse
import contextlib
import difflib
import json
import os
import resource
import shutil
import signal
import statistics
import subprocess
import sys
import tempfile
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
GOOD_LOOP = 0.037  # seconds of one solve of the building frame by eigsh on a good machine
SLOWER = 1.1

ROOMS = "fem preprocessing surrogate updating detection metrics datasets studies monitoring plotting reporting"
IMPORT = """
import json, resource, sys, time
import pandas, sklearn.linear_model, sklearn.pipeline
start = time.process_time()
{imports}
seconds = time.process_time() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
print(json.dumps({{"seconds": seconds, "beside": 0.0, "megabytes": peak}}))
"""

TABLE = {
    "frame-1000": "50 times eigsh",
    "frame-10000": "200 times eigsh",
    "frame-linearise": "5 times before",
    "kw51-by-hand": "4 s",
    "kw51-gaps": "8 s",
    "kw51-not-updated": "8 s",
    "frame-chain": "10 s",
    "grid-search": "inversions once",
    "local-whitening": "13 times before",
    "lags": "half of pandas",
    "lags-one": "half of pandas",
    "import surrogate": "0.2 s",
}
ELSEWHERE = [
    *("full-truss", "full-kw51", "full-frame", "full-bridge", "bridge-basis", "kw51-reduced", "tracking"),
    *("truss-chain", "z24-chain", "identify", "study", "monitor-fit", "monitor-update", "updater", "two-jobs"),
    *("ten-minutes", "lags-many", "gaps", "gaps-year", "intervals", "drawn-models", "kw51-damaged"),
    *("study-of-eight", "monitor-later", "study-truss", "study-footbridge", "study-footbridge-all"),
]
IMPORTS = [f"import {room}" for room in ROOMS.split() if room != "surrogate"]
ROWS = {"table": [*TABLE], "elsewhere": ELSEWHERE, "imports": ["import surrogate", *IMPORTS]}
SCRIPTS = {
    "truss_tables.py": ["--seeds", "2"],
    "real_bridges.py": [],
}


@dataclass
class Runs:
    """Rounds of one work with one state of the code."""

    rounds: list = field(default_factory=list)
    stopped: float | None = None
    failed: str | None = None

    def of(self, name):
        return [found[name] for found in self.rounds]

    def median(self, name="seconds"):
        return statistics.median(self.of(name)) if self.rounds else float("nan")

    @property
    def shown(self):
        if self.failed:
            return "failed"
        return f"stopped at {self.stopped:.0f} s" if self.stopped else f"{self.median():.3g}"


def copy_of(revision, folder):
    """A folder with the package at this revision, or as it is here now, ready as if it were installed."""
    folder.mkdir()
    if revision:
        command = ["git", "archive", revision, "skthermo"]
        archive = subprocess.run(command, cwd=ROOT, check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
    else:
        shutil.copytree(ROOT / "skthermo", folder / "skthermo")
    subprocess.run([sys.executable, "-m", "compileall", "-q", folder], check=True)
    return folder


def run(command, package, limit):
    """What a script prints with this state of the package; None if it takes more processor seconds than the limit."""
    environment = os.environ | {"PYTHONPATH": str(package), "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
    seconds = int(limit)
    done = subprocess.run(
        [sys.executable, *command],
        env=environment,
        cwd=package,
        capture_output=True,
        text=True,
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_CPU, (seconds, seconds + 5)),
    )
    if -done.returncode in (signal.SIGXCPU, signal.SIGKILL):
        return None
    if done.returncode:
        errors = done.stderr.strip().splitlines()
        raise RuntimeError(errors[-1] if errors else f"exit code {done.returncode}")
    return done.stdout


def one_round(name, package, options, results=None):
    if name.startswith("import "):
        rooms = ROOMS.split() if name == "import all" else [name.split()[1]]
        command = ["-c", IMPORT.format(imports="; ".join(f"import skthermo.{room}" for room in rooms))]
    else:
        command = [HERE / "works.py", name, *(["--quick"] if options.quick else [])]
        command += ["--results", results] if results else []
    return run(command, package, options.limit)


def measure(name, packages, options, folder):
    """Runs with each state, by turns; and files of their results."""
    runs, files = {state: Runs() for state in packages}, {}
    for _ in range(options.rounds):
        for state, package in packages.items():
            found = runs[state]
            if found.stopped or found.failed:
                continue
            file = folder / f"{name}-{state}.npz"
            try:
                output = one_round(name, package, options, file)
            except RuntimeError as error:
                found.failed = str(error)
                continue
            if output is None:
                found.stopped = options.limit
            else:
                found.rounds.append(json.loads(output.splitlines()[-1]))
                files[state] = file
        if max(sum(found.of("seconds")) for found in runs.values()) > options.long:
            break
    return runs, files


def line(name, runs, loop):
    """One row of the table."""
    now, before = runs["now"], runs.get("before", Runs())
    ratio = (before.stopped or before.median()) / now.median()
    beside = now.median("beside") / now.median()
    good = now.median() * GOOD_LOOP / loop
    memory = [max(state.of("megabytes"), default=float("nan")) for state in (before, now)]
    cells = [
        f"{name:18}",
        f"{before.shown:>16}",
        f"{now.shown:>16}",
        f"{'> ' if before.stopped else ''}{ratio:.2f}".rjust(9),
        f"{beside:8.1f}" if beside else " " * 8,
        f"{good:10.3g}",
        *(f"{megabytes:8.0f}" for megabytes in memory),
        f"  {TABLE.get(name, '')}",
    ]
    return " ".join(cells).replace(" nan", "    ").rstrip()


def is_slower(runs):
    now, before = runs["now"], runs["before"]
    if now.failed or now.stopped:
        return not (before.failed or before.stopped)
    return bool(before.rounds) and min(now.of("seconds")) > SLOWER * before.median()


def differences(name, files):
    """Lines with the largest relative difference of each result, and whether one is too large."""
    if set(files) != {"now", "before"} or name.startswith("import "):
        return [], False
    lines, is_off = [], False
    with np.load(files["now"]) as now, np.load(files["before"]) as before:
        for key in sorted(set(now) & set(before)):
            what, limit = key.split("|")
            if float(limit) == np.inf:
                lines.append(f"{name:18} {what}: {before[key]:.1e} before, {now[key]:.1e} now")
                continue
            if now[key].shape != before[key].shape or (np.isnan(now[key]) != np.isnan(before[key])).any():
                difference = np.inf
            else:
                difference = np.nanmax(np.abs(now[key] / before[key] - 1), initial=0.0)
            is_off |= difference > float(limit)
            verdict = f"at most {limit}" if difference <= float(limit) else f"MORE than {limit}"
            lines.append(f"{name:18} {what}: {difference:.1e}, {verdict}")
    return lines, is_off


def compare_scripts(packages, options):
    """What scripts of tables print with each state of the code."""
    is_off = False
    for script in options.scripts:
        printed = {}
        for state, package in packages.items():
            try:
                output = run([HERE / script, *SCRIPTS[script]], package, 10 * options.limit)
            except RuntimeError as error:
                output = f"failed: {error}"
            printed[state] = (output or "stopped").splitlines()
        changed = [
            row
            for row in difflib.unified_diff(printed["before"], printed["now"], lineterm="", n=0)
            if not row.startswith(("---", "+++", "@@"))
        ]
        is_off |= bool(changed)
        print(f"{script}: {len(printed['now'])} lines, {'the same' if not changed else 'DIFFERENT'}")
        print(*changed, sep="\n", end="\n" if changed else "", flush=True)
    return is_off


def chosen(names):
    """Rows by name, or by the name of their part; those without their data are left out."""
    rows = [row for name in names for row in ROWS.get(name, [name])]
    unknown = set(rows) - {row for part in ROWS.values() for row in part} - {"import all"}
    if unknown:
        sys.exit(f"unknown rows: {', '.join(sorted(unknown))}; expected some of {ROWS}")
    needed = {"frame": "building_frame", "z24": "z24"}
    data = os.environ.get("SKTHERMO_DATA")
    missing = [word for word, name in needed.items() if not (data and (Path(data) / name).is_dir())]
    left_out = [row for row in rows if any(word in row for word in missing)]
    if left_out:
        print(f"left out, without data in SKTHERMO_DATA: {', '.join(left_out)}")
    return [row for row in dict.fromkeys(rows) if row not in left_out]


def loop_seconds(package, options):
    """Seconds of one solve of the building frame by eigsh, here."""
    try:
        return json.loads(run([HERE / "works.py", "loop"], package, options.limit).splitlines()[-1])["seconds"]
    except RuntimeError:
        return float("nan")


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--before", metavar="REF", help="a git revision to compare with")
    parser.add_argument("--now", metavar="REF", help="a git revision in place of the code of this folder")
    parser.add_argument("--rows", nargs="+", default=["table", "elsewhere", "imports"], help="rows or parts of them")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--long", type=float, default=40.0, help="seconds after which no further round begins")
    parser.add_argument("--limit", type=float, default=300.0, help="processor seconds after which a run is stopped")
    parser.add_argument("--quick", action="store_true", help="small works")
    parser.add_argument("--digits", action="store_true", help="differences of the results, and tables of scripts")
    parser.add_argument("--scripts", nargs="*", default=[*SCRIPTS], choices=[*SCRIPTS], help="tables to compare")
    options = parser.parse_args()
    if options.digits and not options.before:
        parser.error("--digits compares with another revision: expected --before REF")
    rows = chosen(options.rows)
    slower, digits, is_off = [], [], False
    with contextlib.ExitStack() as stack:
        folder = Path(stack.enter_context(tempfile.TemporaryDirectory()))
        states = {"before": options.before, "now": options.now} if options.before else {"now": options.now}
        packages = {state: copy_of(revision, folder / state) for state, revision in states.items()}
        print(
            f"{'':18} {'before, s':>16} {'now, s':>16} {'faster':>9} {'beside':>8} {'at 37 ms':>10} {'MB':>8} {'MB':>8}"
            "  asked"
        )
        for row in rows:
            runs, files = measure(row, packages, options, folder)
            print(line(row, runs, loop_seconds(packages["now"], options)), flush=True)
            for state, found in runs.items():
                if found.failed:
                    print(f"{'':18} {state}: {found.failed}")
            if options.before and row not in TABLE and is_slower(runs):
                slower.append(row)
            if options.digits:
                lines, is_too_far = differences(row, files)
                digits += lines
                is_off |= is_too_far
        if options.digits:
            print("\nLargest relative differences of results", *digits, sep="\n")
            is_off |= compare_scripts(packages, options)
    if options.before:
        print(f"\nslower by more than 10 %: {', '.join(slower) or 'nothing'}")
    return 1 if slower or is_off else 0


if __name__ == "__main__":
    sys.exit(main())
