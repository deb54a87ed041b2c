"""Write docs/_inventories: where the sites of NumPy, SciPy, pandas and scikit-learn document their public names.

Sphinx links to these names without a network. Run it in the environment of the docs after a new release of one of them:

    python tools/write_inventories.py
"""

import importlib
import inspect
import zlib
from pathlib import Path

import numpy as np
import pandas as pd
import sklearn
from sklearn.utils import discovery

FOLDER = Path(__file__).parents[1] / "docs" / "_inventories"
SCIPY = ["linalg", "sparse", "sparse.linalg", "stats", "optimize", "signal", "interpolate", "special", "io", "spatial"]
SKLEARN = {
    "sklearn.base": ["BaseEstimator", "TransformerMixin", "RegressorMixin", "OutlierMixin", "clone"],
    "sklearn.utils": ["Bunch", "check_random_state"],
    "sklearn.model_selection": ["GridSearchCV", "RandomizedSearchCV", "KFold", "TimeSeriesSplit", "GroupKFold"],
    "sklearn.pipeline": ["Pipeline", "make_pipeline"],
}


def role(thing):
    return "class" if inspect.isclass(thing) else "function"


def public(module):
    """Documented functions and classes of a module, with their full names."""
    module = importlib.import_module(module)
    names = (name for name in module.__all__ if not name.startswith("_"))
    found = {f"{module.__name__}.{name}": getattr(module, name) for name in names}
    return {name: thing for name, thing in found.items() if callable(thing)}


def numpy_entries():
    pages = dict.fromkeys(public("numpy") | public("numpy.linalg"), "reference/generated/$.html")
    pages |= {
        f"numpy.{name}": "reference/arrays.scalars.html"
        for name, kind in vars(np).items()
        if isinstance(kind, type) and issubclass(kind, np.generic)
    }
    pages["numpy.random.Generator"] = "reference/random/generator.html"
    pages["numpy.random.RandomState"] = "reference/random/legacy.html"
    return {
        name: ("class" if "random" in name or name == "numpy.ndarray" else "function", page)
        for name, page in pages.items()
    }


def scipy_entries():
    found = [public(f"scipy.{name}") for name in SCIPY]
    return {name: (role(thing), "reference/generated/$.html") for each in found for name, thing in each.items()}


def pandas_entries():
    entries = {name: (role(thing), "reference/api/$.html") for name, thing in public("pandas").items()}
    for kind in (pd.DataFrame, pd.Series, pd.DatetimeIndex):
        methods = [f"pandas.{kind.__name__}.{name}" for name in dir(kind) if not name.startswith("_")]
        entries |= dict.fromkeys(methods, ("method", "reference/api/$.html"))
    return entries


def sklearn_entries():
    found = discovery.all_estimators() + discovery.all_functions() + discovery.all_displays()
    things = {
        ".".join([*(part for part in thing.__module__.split(".") if part[0] != "_"), name]): thing
        for name, thing in found
    }
    things |= {
        f"{module}.{name}": getattr(importlib.import_module(module), name)
        for module, names in SKLEARN.items()
        for name in names
    }
    return {name: (role(thing), "modules/generated/$.html") for name, thing in things.items()}


def write(project, version, entries):
    """Sphinx's inventory, version 2: a header, then a compressed line for each name."""
    lines = [f"{name} py:{kind} 1 {page.replace('$', name)}#$ -\n" for name, (kind, page) in sorted(entries.items())]
    header = (
        f"# Sphinx inventory version 2\n# Project: {project}\n# Version: {version}\n"
        "# The remainder of this file is compressed using zlib.\n"
    )
    (FOLDER / f"{project}.inv").write_bytes(header.encode() + zlib.compress("".join(lines).encode(), 9))
    print(f"{project} {version}: {len(lines)} names")


if __name__ == "__main__":
    FOLDER.mkdir(exist_ok=True)
    write("numpy", np.__version__, numpy_entries())
    write("scipy", importlib.import_module("scipy").__version__, scipy_entries())
    write("pandas", pd.__version__, pandas_entries())
    write("sklearn", sklearn.__version__, sklearn_entries())
