"""What the benchmarks share: command line, data, tables, targets, clocks, noise, regression with a detector."""

import argparse
import atexit
import importlib
import io
import json
import os
import resource
import statistics
import sys
import tempfile
import time
import tracemalloc
import warnings
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.signal import lfilter
from sklearn.compose import ColumnTransformer
from sklearn.impute import SimpleImputer
from sklearn.pipeline import make_pipeline
from versions import OtherVersion, has_failed, side_by_side

from skthermo import detection
from skthermo.datasets import load_z24
from skthermo.surrogate import TemperatureMapper

DATA = Path(os.environ["SKTHERMO_DATA"]) if os.environ.get("SKTHERMO_DATA") else None
EXAMPLES = Path(__file__).parents[2] / "examples"
sys.path.append(str(EXAMPLES))  # whose recipes some benchmarks measure, by imports after that of this module
TABLES = {}  # what was shown, by title, as CSV
OTHER = {}  # tables of another version that were not shown yet, by title, with its commit


def recipes(name):
    """Recipes of the examples, where imports in their order would come before this module."""
    return importlib.import_module(f"{name}_recipes")


def arguments(text, /, *, takes_turns=False, **options):
    """Options of the command line, by name: a default, or a tuple of it, a help, choices; warnings are off from here.

    A mapping is the choices, all by default; a list takes several values, a type has no default, and False is a flag.
    Without a flag: ``name``, and ``folder`` of the data, by default the one that SKTHERMO_DATA names. With
    ``--against COMMIT`` the benchmark is run with that version first, unless it ``takes_turns`` with it by itself.
    """
    parser = argparse.ArgumentParser(
        description=text, formatter_class=argparse.RawDescriptionHelpFormatter, allow_abbrev=False, parents=[shared()]
    )
    for name, given in options.items():
        default, help_, choices = (*given, None, None)[:3] if isinstance(given, tuple) else (given, None, None)
        flags, more = [f"--{name.replace('_', '-')}"], {"help": help_}
        if name == "folder":
            flags, more = ["folder"], more | {"nargs": "?", "type": Path, "default": DATA}
        elif name == "name":
            flags, more = ["name"], more | {"choices": choices}
        elif default is False:
            more["action"] = "store_true"
        elif isinstance(default, type):
            more |= {"type": default, "choices": choices}
        elif isinstance(default, list | dict):
            values = list(default)
            choices = list(default if choices is None else choices) if isinstance(default, dict) or choices else None
            more |= {"nargs": "+", "type": type(values[0]), "default": values, "choices": choices}
        else:
            more |= {"type": type(default), "default": default, "choices": choices}
        parser.add_argument(*flags, **more)
    found = parser.parse_args()
    if found.out is not None:
        atexit.register(lambda: found.out.write_text(json.dumps(TABLES)))
    if found.against is not None and not takes_turns:
        run_other(OtherVersion.built(found.against))
        atexit.register(show_rest)
    warnings.simplefilter("ignore")  # of weather, gaps and models that are meant to be so
    return found


def shared():
    """Options of every benchmark."""
    parser = argparse.ArgumentParser(add_help=False, allow_abbrev=False)
    parser.add_argument("--out", type=Path, help="a file for the tables that are printed, as JSON")
    parser.add_argument("--against", metavar="COMMIT", help="run also with the package at this commit, as 43ba4fa4")
    return parser


def run_other(version):
    """Run this benchmark with another version of the package on the same data and options, and keep its tables."""
    _, words = shared().parse_known_args()
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "tables.json"
        done = version.run(sys.argv[0], [*words, "--out", str(out)])
        if has_failed(done):
            sys.exit(f"{version.commit}: {done.stderr[-3000:]}")
        tables = json.loads(out.read_text())
    OTHER.update({title: (version.commit, table) for title, table in tables.items()})


def show_rest():
    """Show the tables that only the other version has."""
    for title, (commit, table) in OTHER.items():
        print_and_keep(f"{title} ({commit})", as_text(table, [0]))


def shown(title, table, digits=2):
    """Print a table, rounded or, as "3g", to some digits in all, and keep it for ``--out``.

    With ``--against``, columns of the other version follow it.
    """
    table = table.to_frame("") if isinstance(table, pd.Series) else table
    form = f".{digits}" if isinstance(digits, str) else f".{digits}f"
    table = table.map(lambda value: format(value, form) if isinstance(value, float) and value == value else value)
    if title in OTHER:
        commit, other = OTHER.pop(title)
        levels = list(range(table.index.nlevels))
        table = side_by_side(*(as_text(one, levels) for one in (table.to_csv(), other)), commit)
    print_and_keep(title, table)


def as_text(table, levels):
    """A table whose numbers stay as they were written."""
    table = pd.read_csv(io.StringIO(table), index_col=levels, dtype=str, keep_default_na=False)
    return table.rename_axis([None if str(name).startswith("Unnamed") else name for name in table.index.names])


def print_and_keep(title, table):
    print(f"\n{title}\n{table.to_string(na_rep='')}", flush=True)
    TABLES[title] = table.to_csv()


def is_missed(what, found, target, *, known=False):
    """Print whether a number is within its target, such as ">= 90"; whether it is missed and not known to be."""
    relation, limit = target.split()
    is_met = found >= float(limit) if relation == ">=" else found <= float(limit)
    verdict = "met" if is_met else "missed as known" if known else "MISSED"
    print(f"{verdict:15} {what}: {found:.3g}, target {target}", flush=True)
    return not (is_met or known)


def median_seconds(ways, rounds, clock=time.perf_counter):
    """Median over rounds, in each of which every way has its turn; `time.process_time` counts this process alone."""
    seconds = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            seconds[name].append(timed(way, clock)[0])
    return {name: statistics.median(values) for name, values in seconds.items()}


def timed(way, clock=time.process_time):
    """Seconds of a call, and what it gives."""
    start = clock()
    result = way()
    return clock() - start, result


def processor_seconds():
    """Of this process and of those that it has waited for."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def peak_megabytes(way=None):
    """What one call allocates beyond its input; without a call, the largest memory of this process so far."""
    if way is None:
        status = Path("/proc/self/status")  # where Linux counts from exec on, unlike ru_maxrss
        if status.exists():
            return int(status.read_text().partition("VmHWM:")[2].split()[0]) / 1e3
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / (1e6 if sys.platform == "darwin" else 1e3)
    tracemalloc.start()
    way()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6


def draw(model, n_samples, seed=0, bounds=0.3):
    """Parameters that are uniform within bounds."""
    return 1 + bounds * np.random.default_rng(seed).uniform(-1, 1, (n_samples, len(model.parameter_names)))


def autoregression(random, shape, correlation, burn_in=0):
    """Normal numbers of unit variance, whose neighbours along the first axis are correlated."""
    shocks = random.standard_normal((shape[0] + burn_in, *shape[1:]))
    shocks[0 if burn_in else 1 :] *= np.sqrt(1 - correlation**2)
    return lfilter([1.0], [1.0, -correlation], shocks, axis=0)[burn_in:]


def joined(campaign):
    """Temperatures and frequencies side by side."""
    return campaign.temperatures.join(campaign.frequencies)


def split(records):
    """Temperatures, and frequencies."""
    modes = modes_of(records)
    return records.drop(columns=modes), records[modes]


def modes_of(records):
    """Names of the frequencies among the columns."""
    return [name for name in records if str(name).startswith("f")]


def raw(targets, *steps):
    """An outlier detector of raw frequencies, of which missing ones count as the mean."""
    return make_pipeline(ColumnTransformer([("frequencies", "passthrough", targets)]), SimpleImputer(), *steps)


def compensated(targets, last=None, regressor=None, **options):
    """A detector, by default by the Mahalanobis distance, of what a regression on temperatures leaves.

    Options are those of `CompensatedDetector`; version 0.2 has a pipeline in its place.
    """
    regressor = TemperatureMapper() if regressor is None else regressor
    last = detection.MahalanobisDetector() if last is None else last
    if hasattr(detection, "CompensatedDetector"):
        return detection.CompensatedDetector(last, regressor, targets=list(targets), **options)
    if options.get("window") is not None:
        last = detection.WindowedAlarm(options["window"], detector=last)
    return make_pipeline(detection.TemperatureCompensator(regressor, targets=list(targets)), last)


def last_step(detector):
    """A detector, or the last step of a pipeline."""
    return detector[-1] if hasattr(detector, "steps") else detector


def z24_records(folder=DATA):
    """Temperatures and frequencies of the bridge Z24, healthy and damaged."""
    data = load_z24(Path(folder or ".") / "z24" / "z24_monitoring.csv")
    healthy = (data.state == "undamaged").to_numpy()
    return [(data.temperatures[rows], data.frequencies[rows]) for rows in (healthy, ~healthy)]


def tower_records(folder=DATA):
    """Temperatures and frequencies of a masonry tower, in order of time, no stamp twice."""
    log = pd.read_csv(Path(folder or ".") / "tower" / "tower.csv", index_col=0, parse_dates=True).sort_index()
    log = log[~log.index.duplicated()]
    return log[["T1", "T2"]], log.filter(regex="^f")
