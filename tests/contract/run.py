"""Runs the scripts with the skthermo that is imported, and keeps their results.

``PYTHONPATH=FOLDER OMP_NUM_THREADS=1 python tests/contract/run.py FILE [SCRIPT ...]`` writes the results of all
scripts, or of those that are named, to a JSON file; others in the file stay.

A script is a function of a file in ``scripts``, whose name begins with that of the file. It gives a dict of numbers,
arrays, tables and texts, and may add a dict that gives, by name of the result or for all of them ("*"), ``rtol`` and
``atol`` of its numbers.
"""

import functools
import json
import runpy
import sys
import time
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

sys.path.append(str(Path(__file__).parents[2]))  # after PYTHONPATH
TOLERANCE = {"rtol": 1e-6, "atol": 1e-9}


@functools.cache
def scripts():
    """All scripts by name."""
    files = sorted(Path(__file__).with_name("scripts").glob("*.py"))
    named = [(file.stem, runpy.run_path(str(file)).items()) for file in files]
    return {name: one for room, names in named for name, one in names if name.startswith(f"{room}_")}


def run(name):
    """Results of a script by name, as JSON has them, each with its tolerance."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        results = scripts()[name]()
    results, tolerances = results if isinstance(results, tuple) else (results, {})
    if unknown := set(tolerances) - {*results, "*"}:
        raise ValueError(f"{name}: there are tolerances of {unknown}, which are no results")
    return {
        result: {"value": simple(value), **TOLERANCE, **tolerances.get("*", {}), **tolerances.get(result, {})}
        for result, value in results.items()
    }


def simple(value):
    """Numbers of eight digits, texts, lists and dicts of such in place of a result."""
    if isinstance(value, Mapping):
        return {str(key): simple(one) for key, one in value.items()}
    if isinstance(value, pd.DataFrame):
        return {str(name): simple(column.to_numpy()) for name, column in value.items()}
    if isinstance(value, pd.Series):
        return {str(key): simple(one) for key, one in value.items()}
    if isinstance(value, list | tuple | np.ndarray):
        return [simple(one) for one in value]
    if isinstance(value, bool | np.bool_):
        return bool(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        return float(f"{value:.8g}") if np.isfinite(value) else str(float(value))
    if value is None or isinstance(value, str):
        return value
    raise TypeError(f"{type(value).__name__} {value!r:.100}; expected numbers, tables and texts")


def main(file, *names):
    file = Path(file)
    kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {}
    for name in names or sorted(scripts()):
        start = time.process_time()
        results = run(name)
        kept[name] = {"seconds": round(time.process_time() - start, 1), "results": results}
        print(f"{name}: {kept[name]['seconds']} s")
    entries = (f"{json.dumps(name)}: {json.dumps(kept[name], ensure_ascii=False)}" for name in sorted(kept))
    file.write_text("{\n" + ",\n".join(entries) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
