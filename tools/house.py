"""How large each package is, how many files and functions a call enters, and how plain the source is.

    python tools/house.py [--files]
    python tools/house.py --draw

With ``--draw``, only writes ``docs/_static/house.svg``: the packages, in rows above those that they import. Else, for
each package: its files and their lines, packages within it included, and how many of its files the calls below enter,
as Python's profiler sees it; then how many functions they enter. Of the source of all rooms and of the ground rooms:
files, lines, lines of code, constants, constructors called ``of``, kinds of warnings, uses of hidden state. At the end,
what a user meets: the public names of each package, and the most parameters, fields and methods that one of them has,
beside the limits of ``tests/test_public_surface.py``; and the lines of the tests.
Reads the skthermo that is imported (``PYTHONPATH`` chooses another tree).

======== ==========================================================
fit      ``DataInformedFEM.fit``, truss
raw fit  the same, KW51: inputs with a memory, outliers
simulate ``DataInformedFEM.simulate``
run      ``DetectabilityStudy.run``
update   ``Monitor.update``
mapper   ``TemperatureMapper.fit``
detector ``MahalanobisDetector.fit``, residuals
whole    ``CompensatedDetector.fit``, where the package has it
======== ==========================================================
"""

import argparse
import ast
import re
import sys
import threading
from pathlib import Path

import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from threadpoolctl import threadpool_limits

import skthermo
from skthermo import detection
from skthermo.datasets import make_kw51, make_kw51_campaign, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.monitoring import Monitor
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

sys.path.insert(0, str(Path(__file__).parents[1]))
from tests.source import (
    GROUND,
    built_on,
    constants,
    constructors_called_of,
    floors,
    hidden_state,
    kinds_of_warnings,
    lines_of_code,
    names_in_two_files,
    packages_imported,
    private_imports,
    trees,
)
from tests.test_public_surface import LIMITS, by_package, surface

PACKAGE = Path(skthermo.__file__).parent
DRAWN = Path(__file__).parents[1] / "docs" / "_static" / "house.svg"
MOST_FUNCTIONS = {"raw fit": 150, "detector": 25, "whole": 120}
MOST_FRAMES = 6


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
    mapper, _ = entered(TemperatureMapper().fit, year.temperatures, chain.parameters_)
    records, new = year.temperatures.join(year.frequencies), later.temperatures.join(later.frequencies)
    records.index = pd.date_range("2020-01-01", periods=len(records))
    new.index = pd.date_range(records.index[-1] + pd.Timedelta(days=1), periods=len(new))
    residuals = compensator.fit_transform(records)
    detector, _ = entered(MahalanobisDetector().fit, residuals)
    monitor = Monitor(make_pipeline(compensator, MahalanobisDetector())).fit(records)
    update, _ = entered(monitor.update, new)
    whole = set()
    if hasattr(detection, "CompensatedDetector"):
        whole, _ = entered(detection.CompensatedDetector(targets=list(year.frequencies)).fit, records)
    bridge = make_kw51_campaign(random_state=0)
    T, F = bridge.temperatures[::4], bridge.frequencies[::4]
    raw, _ = entered(DataInformedFEM(make_kw51(), random_state=0).fit, T, F)
    found = {"fit": fit, "raw fit": raw, "simulate": simulate, "run": run, "update": update}
    return found | {"mapper": mapper, "detector": detector, "whole": whole}


def frames_above_eigenvalues():
    """Frames of the package, that of the call included, from ``DataInformedFEM.predict`` to ``eigvalsh``."""
    year = make_truss_campaign(random_state=0)
    chain = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    deepest = []

    def note(frame, event, _):
        nonlocal deepest
        if event == "call" and frame.f_code.co_name == "eigvalsh":
            stack = []
            while frame is not None:
                if frame.f_code.co_filename.startswith(str(PACKAGE)):
                    stack.insert(0, frame.f_code.co_qualname)
                frame = frame.f_back
            deepest = max(deepest, stack, key=len)

    with threadpool_limits(1):  # in this thread
        sys.setprofile(note)
        try:
            chain.predict(year.temperatures)
        finally:
            sys.setprofile(None)
    return deepest


def plainness(rooms=None):
    """What the source of some rooms, or of all, holds."""
    found = trees(PACKAGE, rooms)
    texts = [(PACKAGE / file).read_text() for file in found]
    return {
        "files": len(found),
        "lines": sum(len(text.splitlines()) for text in texts),
        "lines of code": sum(map(lines_of_code, texts)),
        "constants": sum(len([*constants(tree, in_tuples=False)]) for tree in found.values()),
        "constants assigned as tuples": sum(
            len([*constants(tree)]) - len([*constants(tree, in_tuples=False)]) for tree in found.values()
        ),
        "constructors called of": sum(len(constructors_called_of(tree)) for tree in found.values()),
        "names of classes and constants in two files": len(names_in_two_files(found)),
        "kinds of warnings": len({kind for tree in found.values() for _, kind, _ in kinds_of_warnings(tree)}),
        "uses of hidden state": sum(len(hidden_state(tree)) for tree in found.values()),
    }


def drawing():
    """An SVG of the packages in rows above those that they import, each with what it is built on."""
    width, height, gap = 390, 44, 10
    imports = packages_imported(PACKAGE)
    given = built_on(imports) | {"_core": set()}
    boxes, said = [], []
    rows = [*reversed(floors(imports)), ["_core"]]
    for row, rooms in enumerate(rows):
        labels = {room: ", ".join(sorted(given[room])) for room in rooms}
        letters = {room: 5 + max(len(room), len(label)) for room, label in labels.items()}
        x, y = gap, gap + row * (height + gap)
        for room, label in labels.items():
            wide = (width - gap * (len(rooms) + 1)) * letters[room] / sum(letters.values())
            kind, middle = "ours" if given[room] else "given", f"{x + wide / 2:.0f}"
            boxes.append(f'<rect class="box {kind}" x="{x:.0f}" y="{y}" width="{wide:.0f}" height="{height}" rx="8"/>')
            boxes.append(f'<text x="{middle}" y="{y + (19 if label else 27)}">{room}</text>')
            boxes += [f'<text x="{middle}" y="{y + 36}" class="small">{label}</text>'] if label else []
            said += [f"{room} on {' and '.join(sorted(given[room]))}"] if given[room] else []
            x += wide + gap
    high = gap + len(rows) * (height + gap)
    style = re.search(r"<style>.*?</style>", DRAWN.with_name("method.svg").read_text(), re.DOTALL)[0]
    return "\n".join(
        [
            f'<svg class="method" style="min-width: 0; max-width: 560px" viewBox="0 0 {width} {high}" role="img"'
            f' aria-label="The packages, each above those that it is built on: {"; ".join(said)}; all use _core"'
            ' xmlns="http://www.w3.org/2000/svg">',
            style,
            f'<rect class="band" width="{width}" height="{high}" rx="10"/>',
            *boxes,
            "</svg>\n",
        ]
    )


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", action="store_true", help="name the files that are entered")
    parser.add_argument("--draw", action="store_true", help=f"write docs/_static/{DRAWN.name}, and nothing else")
    asked = parser.parse_args()
    if asked.draw:
        DRAWN.write_text(drawing())
        return
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
    print(f"{'functions':39}" + "".join(f"{len(found) or 'none':>10}" for found in functions.values()))
    print(f"{'functions at most':39}" + "".join(f"{MOST_FUNCTIONS.get(name, ''):>10}" for name in functions))
    frames = frames_above_eigenvalues()
    print(f"\nframes from predict to eigvalsh: {len(frames)}, at most {MOST_FRAMES}", *frames, sep="\n  ")
    print("", pd.DataFrame({"all rooms": plainness(), "ground rooms": plainness(GROUND)}).to_string(), sep="\n")
    found = by_package(surface())
    limits = LIMITS.reindex(found.index).rename(columns="limit of {}".format)
    print("", found.join(limits).to_string(), f"{'all':17}{found['names'].sum():8}", sep="\n")
    tests = [path.read_text() for path in sorted((Path(__file__).parents[1] / "tests").rglob("*.py"))]
    inside = sum(any(private_imports(ast.parse(text))) for text in tests)
    lines_of_tests = sum(len(text.splitlines()) for text in tests)
    print(f"\ntests: {len(tests)} files, {lines_of_tests} lines, {inside} files with private imports")
    for action, found in by_action.items() if asked.files else ():
        print(f"\n{action} enters", *(file.as_posix() for file in sorted(found)), sep="\n  ")


def print_row(name, files, lines, by_action):
    counts = "".join(f"{len(found & set(files)):10}" for found in by_action.values())
    print(f"{name:24}{len(files):7}{sum(lines[file] for file in files):8}{counts}")


if __name__ == "__main__":
    main()
