"""Measure anew what README, the home page, the quickstart and the pages of accuracy and costs say.

    python tests/benchmarks/release.py --list
    SKTHERMO_DATA=... python tests/benchmarks/release.py results
    SKTHERMO_DATA=... python tests/benchmarks/release.py results --only truss scaling
    python tests/benchmarks/release.py results --quick

Each part is the command of a benchmark or an example. ``results/PART.json`` gets its output, tables, seconds, exit
code, date and revision. What is there is not run again, so that a run of hours may end and go on; what failed is.
Parts that count seconds run alone, after the others, which run two at a time. Tables of the pages are written to
``docs/measured``, or, with ``--quick``, which runs a few parts at a small size, to ``results/measured``. Other tables
and the numbers of the text are entered by hand from the outputs: each says its command. The exit code is 1 if a part
fails or misses a target.
"""

import argparse
import csv
import io
import json
import os
import shlex
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
FILES = {"path/to/z24_monitoring.csv": "z24/z24_monitoring.csv", "path/to/tower.csv": "tower/tower.csv"}


@dataclass
class Part:
    """One command, and the tables of its output that pages include: the beginning of their title by file."""

    command: str
    tables: dict = field(default_factory=dict)
    quick: str | None = None  # options of a small run
    is_timing: bool = False
    needs: str | None = None  # a file or folder of SKTHERMO_DATA


def benchmark(command, quick=None, tables=None, **more):
    return Part(f"python tests/benchmarks/{command}", tables or {}, quick, **more)


def timing(command, quick=None, tables=None, **more):
    return benchmark(command, quick, tables, is_timing=True, **more)


Z24, FRAME = {"needs": "z24"}, {"needs": "building_frame"}
SIZES = {"scaling_samples": "Processor", "scaling_dof": "Costs by degrees", "scaling_parameters": "Costs by parameters"}
BOUNDS = {"bounds": "Full solves", "bounds_reduced": "Reduced solves"}
FLEET = "fleet_prior.py --bridges 18 --groups 3 --newcomers 3 --days 15 30 60 --starts winter --members chains"
BESIDE = "two-files monitor-later lags lags-many gaps gaps-year intervals drawn-models study-of-eight kw51-damaged"
PARTS = {
    "truss": benchmark("truss_tables.py", "--seeds 1", {"truss": "Means over seeds"}),
    "directions": benchmark("directions.py", **Z24),
    "directions-wrong": benchmark("directions.py --parts wrong"),
    "detector-choice": benchmark("detector_choice.py"),
    "z24-detectors": benchmark("z24_detectors.py", **Z24),
    "z24-detection": Part("python examples/plot_z24_detection.py path/to/z24_monitoring.csv", **Z24),
    "z24-damage": Part("python examples/plot_z24_damage.py path/to/z24_monitoring.csv", **Z24),
    "z24-weather": Part("python examples/plot_z24_bridge.py path/to/z24_monitoring.csv", **Z24),
    "tower": Part("python examples/plot_your_own_structure.py path/to/tower.csv", needs="tower"),
    "plain-call": benchmark("plain_call.py --first-seed 200", None, {"plain_call": "Plain call and best"}, **Z24),
    "plain-call-others": benchmark("plain_call.py --first-seed 100", **Z24),
    "fleet-prior": benchmark(FLEET),
    "mode-tracker": benchmark("mode_tracker.py", "--records 50", {"mode_tracker": "Right poles"}),
    "modal-identification": benchmark("modal_identification.py", None, {"modal_identification": "Errors in %"}),
    "shapes": benchmark("shape_inputs.py", "--rows 20 --models truss --boxes 0.3", {"shapes": "Mean errors of"}),
    "updating": benchmark("updating.py", **FRAME),
    "updating-lbfgs": benchmark("updating.py --method lbfgs", **FRAME),
    "record-checks": benchmark("record_checks.py", **Z24),
    "record-defects": benchmark("record_defects.py"),
    "slow-memory": benchmark("slow_memory.py"),
    "service-records": benchmark("service_records.py --seeds 2", None, {"service_records": "Expected and true"}),
    "study-bands": benchmark("study_bands.py --replicates 10 --calibrated --first-seed 1"),
    "smallest-losses": benchmark("directions.py --parts smallest"),
    "false-alarms": benchmark("false_alarm_rates.py", "--quick --laws iid"),
    "quickstart": Part("python -m pytest -q -n0 tests/test_documentation.py -k quickstart -m nightly"),
    "solves": timing("solves.py --parts truss", "--quick --rounds 1"),
    "solves-pays": timing("solves.py --parts pays"),
    "solves-pynite": timing("solves.py --parts pynite"),
    "two-workers": timing("solves.py --parts workers"),
    "reduced-models": timing("reduced_models.py", **FRAME),
    "searches": timing("searches.py"),
    "speed": timing(f"speed.py --rows {BESIDE}"),
    "speed-frame": timing("speed.py --rows frame-1000 frame-10000", **FRAME),
    "speed-studies": timing("speed.py --rows study-footbridge study-footbridge-all"),
    "speed-before": timing("speed.py --before ccaa270a --rows study-truss --rounds 1"),
    "scaling": timing(
        "scaling.py --figure docs/images/scaling.png", "--most-samples 100 --most-full 100 --sizes 2 --rounds 1", SIZES
    ),
    "scale-preparing": timing("scale.py --rows 52560 525600 --parts preprocessing"),
    "scale-records": timing("scale.py --rows 52560 525600 --parts chain", None, {"records": "chain"}),
    "scale-defaults": timing("scale.py --rows 5256 52560 --parts defaults", None, {"defaults": "defaults"}),
    "scale-defaults-long": timing("scale.py --rows 525600 --parts defaults"),
    "scale-service": timing("scale.py --rows 525600 --parts service"),
    "scale-fleet": timing("scale.py --bridges 1000 --parts fleet"),
    "large-grid": timing("large_models.py --kind grid --dof 100000"),
    "large-solid": timing("large_models.py --kind solid --dof 50000"),
    "larger-grid": timing("large_models.py --kind grid --dof 300000"),
    "exports": timing("large_exports.py --dofs 100000", "--dofs 600", {"exports": "Formats"}),
    "roofline": timing("solves.py --parts bounds", None, BOUNDS, **FRAME),
    "all": benchmark("release.py"),
}


def run(name, folder, quick):
    """The result of a part, from its file if it is there and had no error."""
    part, file, tables = PARTS[name], folder / f"{name}.json", folder / f"{name}.tables.json"
    if file.exists() and json.loads(file.read_text())["exit code"] in (0, 1):
        return json.loads(file.read_text())
    data = Path(os.environ.get("SKTHERMO_DATA", ""))
    words = shlex.split(f"{part.command} {part.quick}" if quick else part.command)
    words = [sys.executable, *(str(data / FILES[word]) if word in FILES else word for word in words[1:])]
    if quick and "--figure" in words:
        words[words.index("--figure") + 1] = str(folder / "figure.png")
    words += ["--out", str(tables)] if "benchmarks" in words[1] else []
    environment = os.environ | {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT)}
    start = time.perf_counter()
    done = subprocess.run(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    revision = subprocess.run(["git", "rev-parse", "--short", "HEAD"], cwd=ROOT, capture_output=True, text=True).stdout
    found = {"part": name, "command": part.command, "revision": revision.strip(), "date": time.strftime("%Y-%m-%d")}
    found |= {"seconds": round(time.perf_counter() - start), "exit code": done.returncode, "output": done.stdout}
    found["tables"] = json.loads(tables.read_text()) if tables.exists() else {}
    tables.unlink(missing_ok=True)
    file.write_text(json.dumps(found, indent=1, ensure_ascii=False))
    return found


def written(found, folder):
    """Names of the tables of a part that were written for the pages."""
    names = []
    for name, title in PARTS[found["part"]].tables.items():
        for text in [text for key, text in found["tables"].items() if key.startswith(title)][:1]:
            rows = io.StringIO()
            csv.writer(rows, lineterminator="\n").writerows(csv.reader(io.StringIO(text)))
            body = "".join(f"   {row}\n" for row in rows.getvalue().splitlines())
            head = f".. csv-table:: ``{found['command']}``\n   :header-rows: 1\n\n"
            folder.mkdir(exist_ok=True)
            (folder / f"{name}.rst").write_text(head + body)
            names.append(name)
    return names


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", nargs="?", type=Path, help="where results are, or go")
    parser.add_argument("--only", nargs="+", metavar="PART", choices=[*PARTS][:-1], help="parts")
    parser.add_argument("--quick", action="store_true", help="a few parts at a small size")
    parser.add_argument("--list", action="store_true", help="name the parts, and what is done")
    options = parser.parse_args()
    names = options.only or [*PARTS][:-1]
    if options.list or options.folder is None:
        for name in names:
            file = options.folder / f"{name}.json" if options.folder else None
            print(f"{'done' if file and file.exists() else '':5}{name:22} {PARTS[name].command}")
        return 0
    options.folder.mkdir(parents=True, exist_ok=True)
    data, failed = Path(os.environ.get("SKTHERMO_DATA") or "no data"), []
    names = [name for name in names if PARTS[name].quick is not None or not options.quick]
    there = [name for name in names if PARTS[name].needs is None or (data / PARTS[name].needs).is_dir()]
    print(*(f"{name}: left out, without data" for name in names if name not in there), sep="\n", end="\n")
    target = options.folder / "measured" if options.quick else ROOT / "docs" / "measured"
    for is_timing, jobs in ((False, 2), (True, 1)):
        some = [name for name in there if PARTS[name].is_timing == is_timing]
        with ThreadPoolExecutor(jobs) as pool:
            for found in pool.map(lambda name: run(name, options.folder, options.quick), some):
                tables = written(found, target)
                ending = "done" if found["exit code"] == 0 else f"exit code {found['exit code']}"
                print(
                    f"{found['part']}: {ending}, {found['seconds']} s; {', '.join(tables) or 'no tables'}",
                    flush=True,
                )
                failed += [found["part"]] * (found["exit code"] != 0)
    print(f"failed, or with a target that is missed: {', '.join(failed) or 'nothing'}")
    return int(bool(failed))


if __name__ == "__main__":
    sys.exit(main())
