"""What users wait for, now and before: processor seconds and peak memory of the same works in one run.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/speed.py --before HEAD~20
    OMP_NUM_THREADS=1 python tests/benchmarks/speed.py --before 807a281 --rows lags study

``works.py`` has the works. Each runs in a process of its own, by turns with a copy of the code of this folder and of
another revision. Printed are medians of processor seconds (worker processes included), how many times faster it is now,
and the largest peak memory. "beside" is how many times longer another way takes in the same process: a loop of
``scipy.sparse.linalg.eigsh`` over the same matrices, for lags ``pandas.concat`` of shifts, for gaps ``KNNImputer``, for
eight detectors a study for each, for a monitor after ten years its updates after one. A work that takes more processor
seconds than ``--limit`` is stopped. Works on the building frame need its file in the folder that SKTHERMO_DATA names.

The exit code is 1 if something has become slower by more than 10 %: if even the fastest round takes more than 1.1 times
the median of before.
"""

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

from harness import DATA, arguments
from works import WORKS

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
SLOWER = 1.1

ROOMS = "fem preprocessing surrogate updating detection metrics datasets studies monitoring plotting reporting"
IMPORT = """
import json, resource, sys, time
import pandas, sklearn.linear_model, sklearn.pipeline
start = time.process_time()
import skthermo.{room}
seconds = time.process_time() - start
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
print(json.dumps({{"seconds": seconds, "beside": 0.0, "megabytes": peak}}))
"""


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


def measure(name, packages, options):
    """Runs with each state, by turns."""
    runs, command = {state: Runs() for state in packages}, [HERE / "works.py", name, *["--quick"][: options.quick]]
    if name.startswith("import "):
        command = ["-c", IMPORT.format(room=name.split()[1])]
    for _ in range(options.rounds):
        for state, package in packages.items():
            found = runs[state]
            if found.stopped or found.failed:
                continue
            try:
                output = run(command, package, options.limit)
            except RuntimeError as error:
                found.failed = str(error)
                continue
            if output is None:
                found.stopped = options.limit
            else:
                found.rounds.append(json.loads(output.splitlines()[-1]))
        if max(sum(found.of("seconds")) for found in runs.values()) > options.long:
            break
    return runs


def line(name, runs):
    """One row of the table."""
    now, before = runs["now"], runs.get("before", Runs())
    ratio, beside = (before.stopped or before.median()) / now.median(), now.median("beside") / now.median()
    memory = (max(state.of("megabytes"), default=float("nan")) for state in (before, now))
    cells = [f"{name:20}", f"{before.shown:>16}", f"{now.shown:>16}", f"{ratio:9.2f}", f"{beside:8.1f}"]
    return " ".join([*cells, *(f"{megabytes:8.0f}" for megabytes in memory)]).replace(" nan", "    ").rstrip()


def is_slower(runs):
    now, before = runs["now"], runs["before"]
    if now.failed or now.stopped:
        return not (before.failed or before.stopped)
    return bool(before.rounds) and min(now.of("seconds")) > SLOWER * before.median()


def main():
    rooms = [f"import {room}" for room in ROOMS.split()]
    options = arguments(
        __doc__,
        before=(str, "a git revision to compare with"),
        rows=(dict.fromkeys([*WORKS, *rooms], 0), "works, and imports of rooms"),
        rounds=5,
        long=(40.0, "seconds after which no further round begins"),
        limit=(300.0, "processor seconds after which a run is stopped"),
        quick=(False, "small works"),
    )
    slower, states = [], {"before": options.before} if options.before else {}
    with tempfile.TemporaryDirectory() as folder:
        states |= {"now": None}
        packages = {state: copy_of(revision, Path(folder) / state) for state, revision in states.items()}
        print(f"{'':20} {'before, s':>16} {'now, s':>16} {'faster':>9} {'beside':>8} {'MB':>8} {'MB':>8}")
        for row in options.rows:
            if row.startswith("frame") and DATA is None:
                print(f"{row}: left out, without data")
                continue
            runs = measure(row, packages, options)
            print(line(row, runs), flush=True)
            for state, found in runs.items():
                if found.failed:
                    print(f"{'':20} {state}: {found.failed}")
            if options.before and is_slower(runs):
                slower.append(row)
    if options.before:
        print(f"\nslower by more than 10 %: {', '.join(slower) or 'nothing'}")
    return int(bool(slower))


if __name__ == "__main__":
    sys.exit(main())
