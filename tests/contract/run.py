"""Runs the scripts with the skthermo that is imported, and keeps their results.

``PYTHONPATH=FOLDER OMP_NUM_THREADS=1 python tests/contract/run.py FILE [SCRIPT ...]`` writes the results of all
scripts, or of those that are named, to a JSON file; others in the file stay.

A script ends with ``RESULTS``, a dict of numbers, arrays, tables and texts. ``TOLERANCES`` gives, by name of the result
or for all of them ("*"), ``rtol`` and ``atol`` of its numbers.
"""

import json
import runpy
import sys
import time
import warnings
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pandas as pd

SCRIPTS = Path(__file__).with_name("scripts")
TOLERANCE = {"rtol": 1e-6, "atol": 1e-9}


def run(name):
    """Results of a script by name, as JSON has them, each with its tolerance."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        left = runpy.run_path(str(SCRIPTS / f"{name}.py"), run_name="__main__")
    tolerances = left.get("TOLERANCES", {})
    if unknown := set(tolerances) - {*left["RESULTS"], "*"}:
        raise ValueError(f"{name}: there are tolerances of {unknown}, which are no results")
    return {
        result: {"value": simple(value), **TOLERANCE, **tolerances.get("*", {}), **tolerances.get(result, {})}
        for result, value in left["RESULTS"].items()
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
    for name in names or sorted(path.stem for path in SCRIPTS.glob("*.py")):
        start = time.process_time()
        results = run(name)
        kept[name] = {"seconds": round(time.process_time() - start, 1), "results": results}
        print(f"{name}: {kept[name]['seconds']} s")
    entries = (f"{json.dumps(name)}: {json.dumps(kept[name], ensure_ascii=False)}" for name in sorted(kept))
    file.write_text("{\n" + ",\n".join(entries) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    main(*sys.argv[1:])
