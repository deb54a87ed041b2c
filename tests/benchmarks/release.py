"""Measure anew what README, the home page, the quickstart and the pages of accuracy and costs say.

    python tests/benchmarks/release.py --list
    SKTHERMO_DATA=... python tests/benchmarks/release.py
    SKTHERMO_DATA=... python tests/benchmarks/release.py --only truss scaling --again
    python tests/benchmarks/release.py --quick FOLDER

Each part is the command of a benchmark. ``docs/measured/results/PART.json`` gets its tables, seconds, exit code, date
and git revision, and ``docs/measured/PART.rst`` shows the tables to the pages that include it. What is there is not
run again without ``--again``, so that a run of hours may end and go on; what failed is. Parts that count seconds run
alone, after the others, which run two at a time. With ``--quick``, a few parts run at a small size and write to
another folder. The exit code is 1 if a part fails or misses a target.
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
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
MEASURED = ROOT / "docs" / "measured"


@dataclass
class Part:
    """One command, options of a small run of it, and the file or folder of SKTHERMO_DATA that it needs."""

    options: str
    quick: str | None = None
    needs: str | None = None
    is_timing: bool = False

    @property
    def command(self):
        return f"python tests/benchmarks/{self.options}"


def timing(options, quick=None, **more):
    return Part(options, quick, is_timing=True, **more)


Z24, FRAME = {"needs": "z24"}, {"needs": "building_frame"}
WRONG = "both aligned damage white lasting louder"
PARTS = {
    "readme-study": Part("readme_study.py", "--years 1"),
    "truss": Part("truss_tables.py", "--seeds 1"),
    "directions": Part("directions.py --parts truss fleet footbridge z24", **Z24),
    "smallest-losses": Part("directions.py --parts smallest"),
    "section-losses": Part("section_losses.py"),
    "directions-wrong": Part("directions.py --parts wrong"),
    "field-detectors-z24": Part("field_detectors.py --parts z24 seasons", **Z24),
    "field-detectors": Part("field_detectors.py --parts years frost"),
    "regimes": Part("regimes.py", **Z24),
    "forward": Part("forward.py --against 43ba4fa4", **Z24),
    "thresholds": Part("detection_thresholds.py"),
    "own-kind": Part("own_kind.py", **Z24),
    "detector-choice": Part("detector_choice.py --seeds 10"),
    "detector-choice-wrong": Part(f"detector_choice.py --seeds 2 --wrong {WRONG}"),
    "detector-choice-kw51": Part("detector_choice.py --structure kw51 --seeds 3 --repeats 3"),
    "z24-detectors": Part("z24_detectors.py", **Z24),
    "later-weather": Part("later_weather.py", **Z24),
    "plain-call": Part("plain_call.py"),
    "regressors": Part("regressors.py", **Z24),
    "earlier-weather": Part("earlier_weather.py", "--parts truss", **Z24),
    "sensors": Part("monitor_sensors.py", **Z24),
    "service-causes": Part("service_causes.py --dates 2"),
    "slow-changes": Part("slow_changes.py"),
    "drift": Part("parameter_drift.py --parts tracked"),
    "new-baselines": Part("monitor_retraining.py", "--seeds 1 --only refit", needs="kw51"),
    "fleet-prior": Part("fleet_prior.py --members frequencies --against 43ba4fa4"),
    "fleet-monitors": Part("fleet_monitor.py"),
    "mode-tracker": Part("mode_tracker.py", "--records 50"),
    "modal-identification": Part("modal_identification.py"),
    "shapes": Part("shape_inputs.py", "--rows 20 --models truss"),
    "updating": Part("updating.py", **FRAME),
    "interval-coverage": Part("interval_coverage.py"),
    "record-checks": Part("record_checks.py", **Z24),
    "record-defects": Part("record_defects.py"),
    "study-bands": Part("study_bands.py"),
    "explained-damage": Part("explained_damage.py"),
    "identified-months": Part("identified_months.py"),
    "explained-kw51": Part("explained_damage.py --structures KW51 --designs frequencies shapes"),
    "located-damage": Part("located_damage.py"),
    "z24-damage": Part("z24_damage.py", **Z24),
    "program-calls": Part("program_calls.py"),
    "other-tools": Part("other_tools.py --seeds 5"),
    "kw51-study": Part("kw51_study.py"),
    "paper-truss": Part("paper_tables.py --parts truss", "--seeds 1"),
    "paper-kw51": Part("paper_tables.py --parts kw51"),
    "paper-appendix": Part("paper_tables.py --parts appendix"),
    "paper-lines": timing("paper_tables.py --parts lines"),
    "paper-reduced": timing("paper_tables.py --parts reduced"),
    "false-alarms": Part("false_alarm_rates.py", "--baselines 6 --laws iid --days 365 --asked 1"),
    "nightly-call": timing("nightly_jobs.py --nights 3", "--nights 1 --bridges 2"),
    "solves": timing("solves.py --parts truss", "--quick --rounds 1"),
    "solves-pynite": timing("solves.py --parts pynite"),
    "two-workers": timing("solves.py --parts workers --rounds 3"),
    "speed": timing("speed.py", **FRAME),
    "speed-footbridge": timing("speed.py --rows surface study-footbridge --rounds 1"),
    "speed-year": timing("speed.py --rows detector-year mapper-year chain-year --against 43ba4fa4"),
    "scaling": timing(
        "scaling.py --rounds 1 --most-samples 100000 --most-full 100 --figure docs/images/scaling.png",
        "--most-samples 100 --most-full 100 --sizes 2 --rounds 1",
    ),
    "scale-preparing": timing("scale.py --rows 52560 525600 --parts preprocessing"),
    "scale-records": timing("scale.py --rows 52560 157680 --parts chain"),
    "scale-defaults": timing("scale.py --rows 5256 52560 --parts defaults"),
    "scale-defaults-long": timing("scale.py --rows 52560 525600 --parts defaults --replicates 2"),
    "scale-service": timing("scale.py --rows 525600 --parts service"),
    "scale-fleet": timing("scale.py --bridges 1000 --parts fleet"),
    "large-models": timing("large_models.py", "--models grid-3000 solid-3000 --chains grid-3000"),
    "exports": timing("large_exports.py --dofs 100000", "--dofs 600"),
}


def run(name, measured, quick, again):
    """The result of a part, from its file if it is there and has tables and is not wanted again."""
    part, file, tables = PARTS[name], measured / "results" / f"{name}.json", measured / f"{name}.tables.json"
    if file.exists() and not again:
        found = json.loads(file.read_text())
        if found["exit code"] in (0, 1) and found["tables"]:
            return found
    words = shlex.split(f"{part.options} {part.quick}" if quick else part.options)
    if quick and "--figure" in words:
        words[words.index("--figure") + 1] = str(measured / "figure.png")
    words = [sys.executable, str(ROOT / "tests" / "benchmarks" / words[0]), *words[1:], "--out", str(tables)]
    environment = os.environ | {"OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg", "PYTHONPATH": str(ROOT)}
    start = time.perf_counter()
    done = subprocess.run(words, cwd=ROOT, env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    revision = subprocess.run(["git", "rev-parse", "--short=8", "HEAD"], cwd=ROOT, capture_output=True, text=True)
    found = {"part": name, "command": part.command, "revision": revision.stdout.strip()}
    found |= {"date": time.strftime("%Y-%m-%d"), "seconds": round(time.perf_counter() - start)}
    found |= {"exit code": done.returncode, "tables": json.loads(tables.read_text()) if tables.exists() else {}}
    tables.unlink(missing_ok=True)
    file.write_text(json.dumps(found, indent=1, ensure_ascii=False) + "\n")
    (measured / f"{name}.rst").write_text(page(found))
    if done.returncode:
        print(done.stdout[-3000:], flush=True)
    return found


def page(found):
    """The tables of a part, and how they were measured."""
    tables = []
    for title, text in found["tables"].items():
        (first, *head), *rows = csv.reader(io.StringIO(text))
        lines = io.StringIO()
        csv.writer(lines, lineterminator="\n").writerows([[first or "case", *head], *rows])  # screen readers need one
        body = "".join(f"   {line}\n" for line in lines.getvalue().splitlines())
        tables.append(f".. csv-table:: {title}\n   :header-rows: 1\n\n{body}\n")
    return "".join(tables) + f"``{found['command']}``, revision {found['revision']}, {found['date']}.\n"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", metavar="PART", choices=[*PARTS], default=[*PARTS], help="parts")
    parser.add_argument("--again", action="store_true", help="also what is measured")
    parser.add_argument("--quick", type=Path, metavar="FOLDER", help="a few parts at a small size, to this folder")
    parser.add_argument("--list", action="store_true", help="name the parts, and when they were measured")
    options = parser.parse_args()
    measured = options.quick or MEASURED
    (measured / "results").mkdir(parents=True, exist_ok=True)
    if options.list:
        for name in options.only:
            file = measured / "results" / f"{name}.json"
            found = json.loads(file.read_text()) if file.exists() else {"date": "", "revision": "", "seconds": ""}
            print(f"{name:22} {found['date']:10} {found['revision']:8} {found['seconds']:>5} s  {PARTS[name].command}")
        return 0
    data, missed = Path(os.environ.get("SKTHERMO_DATA") or "no data"), []
    names = [name for name in options.only if PARTS[name].quick is not None or not options.quick]
    there = [name for name in names if PARTS[name].needs is None or (data / PARTS[name].needs).exists()]
    for name in names:
        if name not in there:
            print(f"{name}: left out, without data")
    for is_timing, jobs in ((False, 2), (True, 1)):
        some = [name for name in there if PARTS[name].is_timing == is_timing]
        with ThreadPoolExecutor(jobs) as pool:
            for found in pool.map(lambda name: run(name, measured, options.quick is not None, options.again), some):
                print(f"{found['part']}: exit code {found['exit code']}, {found['seconds']} s", flush=True)
                missed += [found["part"]] * (found["exit code"] != 0)
    print(f"failed, or with a target that is missed: {', '.join(missed) or 'nothing'}")
    return int(bool(missed))


if __name__ == "__main__":
    sys.exit(main())
