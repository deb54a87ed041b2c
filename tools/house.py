"""How large each package is, and how many files a reader opens who follows a chain and a study.

    python tools/house.py [--files]

For each package: its files and their lines, packages within it included, and how many of its files are entered by
``DataInformedFEM.fit`` and ``simulate``, ``DetectabilityStudy.run`` and ``Monitor.update`` on the truss, as Python's
profiler sees it; below, how many functions are. At the end, what a user meets: the public names of each package, and
the most parameters, fields and methods that one of them has, beside the limits of ``tests/test_public_surface.py``.
Reads the skthermo that is imported (``PYTHONPATH`` chooses another tree).
"""

import argparse
import sys
import threading
from pathlib import Path

import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

import skthermo
from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.monitoring import Monitor
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.test_public_surface import LIMITS, by_package, surface

PACKAGE = Path(skthermo.__file__).parent


def entered(call, *arguments, **options):
    """Functions of the package that a call enters, as pairs of file and name, and its result."""
    functions = set()

    def note(frame, event, _):
        if event == "call" and frame.f_code.co_name != "<module>":  # imports are not entered
            functions.add((frame.f_code.co_filename, frame.f_code.co_qualname))

    threading.setprofile(note)
    sys.setprofile(note)
    try:
        result = call(*arguments, **options)
    finally:
        sys.setprofile(None)
        threading.setprofile(None)
    inside = {(Path(file).relative_to(PACKAGE), name) for file, name in functions if file.startswith(str(PACKAGE))}
    return inside, result


def actions():
    """Functions that each action enters."""
    year, later = make_truss_campaign(random_state=0), make_truss_campaign(random_state=1)
    chain = DataInformedFEM(make_truss(), random_state=0)
    fit, chain = entered(chain.fit, year.temperatures, year.frequencies)
    damage = {"bottom": 0.2}
    simulate, _ = entered(chain.simulate, later.temperatures, damage=damage, noise="fitted", random_state=0)
    scenarios = sweep(chain, (0.1, 0.2), groups=["bottom"])
    study = DetectabilityStudy(
        chain, MahalanobisDetector(), scenarios, n_repeats=2, random_state=0, uncertainty="noise"
    )
    run, _ = entered(study.run, later.temperatures)
    compensator = TemperatureCompensator(LinearRegression(), targets=list(year.frequencies.columns))
    records, new = year.temperatures.join(year.frequencies), later.temperatures.join(later.frequencies)
    records.index = pd.date_range("2020-01-01", periods=len(records))
    new.index = pd.date_range(records.index[-1] + pd.Timedelta(days=1), periods=len(new))
    monitor = Monitor(make_pipeline(compensator, MahalanobisDetector())).fit(records)
    update, _ = entered(monitor.update, new)
    return {"fit": fit, "simulate": simulate, "run": run, "update": update}


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", action="store_true", help="name the files that are entered")
    by_name = parser.parse_args().files
    files = sorted(path.relative_to(PACKAGE) for path in PACKAGE.rglob("*.py"))
    lines = {file: len((PACKAGE / file).read_text().splitlines()) for file in files}
    functions = actions()
    by_action = {action: {file for file, _ in found} for action, found in functions.items()}
    print(f"{'package':24}{'files':>7}{'lines':>8}" + "".join(f"{action:>10}" for action in by_action))
    packages = sorted({parent for file in files for parent in file.parents if parent != Path()})
    print_row("directly in skthermo", [file for file in files if file.parent == Path()], lines, by_action)
    for package in packages:
        inside = [file for file in files if package in file.parents]
        print_row("  " * (len(package.parts) - 1) + package.name, inside, lines, by_action)
    print_row("all", files, lines, by_action)
    print(f"{'functions':39}" + "".join(f"{len(found):10}" for found in functions.values()))
    found = by_package(surface())
    limits = LIMITS.reindex(found.index).rename(columns="limit of {}".format)
    print("", found.join(limits).to_string(), f"{'all':17}{found['names'].sum():8}", sep="\n")
    for action, found in by_action.items() if by_name else ():
        print(f"\n{action} enters", *(file.as_posix() for file in sorted(found)), sep="\n  ")


def print_row(name, files, lines, by_action):
    counts = "".join(f"{len(found & set(files)):10}" for found in by_action.values())
    print(f"{name:24}{len(files):7}{sum(lines[file] for file in files):8}{counts}")


if __name__ == "__main__":
    main()
