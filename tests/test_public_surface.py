"""How much a user meets: public names, and the parameters, fields and methods of each. A new door has to be argued for.

``python tools/house.py`` prints the present numbers.
"""

import dataclasses
import inspect

import pandas as pd
import pytest
from sklearn.utils import Bunch

from tests.source import public

LIMITS = pd.DataFrame.from_dict(
    {  # of each package, and the most that one of its classes or functions has
        "datasets": (12, 10, 4, 10),
        "detection": (6, 7, 0, 12),
        "fem": (26, 9, 16, 34),
        "metrics": (7, 3, 0, 0),
        "monitoring": (8, 13, 11, 33),
        "plotting": (5, 0, 9, 5),
        "preprocessing": (12, 7, 7, 6),
        "reporting": (1, 12, 0, 0),
        "studies": (13, 18, 11, 24),
        "surrogate": (11, 11, 9, 11),
        "updating": (4, 10, 0, 3),
    },
    orient="index",
    columns=["names", "parameters", "fields", "methods"],
)
MOST = {"parameters": 11, "fields": 11, "methods": 12}
LARGER = {  # what has more, and why
    "fem.AffineModel": "all that a model may offer: what it is, its modes, what can be changed of it",
    "fem.ReducedModel": "an AffineModel, and what was reduced",
    "fem.Beam": "the properties of a section in space, each of which can be a parameter",
    "reporting.owner_report": "one call for studies, monitors and fleets, each with facts of its own",
    "monitoring.Monitor": "a detector in service: its settings, its records, its events, what an owner decides",
    "studies.DetectabilityStudy": "what is simulated, what is uncertain, and every table of the result",
    "studies.detection_task": "the settings of a study, for grid searches",
    "studies.IdentifiedDamage": "the most probable explanation, all others, and what they leave open",
    "studies.identify_damage": "each prior and each doubt about a measurement is a setting",
}


def surface():
    """Parameters, fields and methods of all public classes and functions, in rows such as "fem.Bar"."""
    rows = {}
    for room, name, thing in public():
        of_function = None if inspect.isclass(thing) else (len(inspect.signature(thing).parameters), 0, 0)
        rows[f"{room}.{name}"] = of_function or sizes_of_class(thing)
    return pd.DataFrame.from_dict(rows, orient="index", columns=list(MOST))


def sizes_of_class(thing):
    """Parameters, or fields of what holds data, and public methods and properties, without scikit-learn's own."""
    ours = [base for base in thing.__mro__ if base.__module__.startswith("skthermo")]
    members = {name: member for base in ours for name, member in vars(base).items() if hasattr(type(member), "__get__")}
    requests = {name for name in members if name.startswith("set_") and name.endswith("_request")}
    methods = {name for name in members if name[0] != "_"} - requests
    if dataclasses.is_dataclass(thing):
        return 0, len(dataclasses.fields(thing)), len(methods)
    if issubclass(thing, Bunch):
        return 0, len({name for base in ours for name in inspect.get_annotations(base)}), len(methods)
    n_parameters = 0 if getattr(thing, "_is_protocol", False) else len(inspect.signature(thing).parameters)
    return n_parameters, 0, len(methods)


def by_package(sizes):
    """Number of names of each package, and the most parameters, fields and methods that one has."""
    package = sizes.index.str.partition(".").get_level_values(0)
    return pd.concat([sizes.groupby(package).size().rename("names"), sizes.groupby(package).max()], axis=1)


@pytest.fixture(scope="module")
def sizes():
    return surface()


def test_no_package_has_grown(sizes):
    found = by_package(sizes)
    others = sorted(found.index.symmetric_difference(LIMITS.index))
    assert not others, f"{__file__}: LIMITS has a row for each package with public names; add or remove {others}"
    grown = [
        f"{package}: {size} {what}, limit {LIMITS.at[package, what]}"
        for package, sizes in found.iterrows()
        for what, size in sizes.items()
        if size > LIMITS.at[package, what]
    ]
    assert not grown, f"{__file__}: raise LIMITS, with the reason in the commit, or keep names private: {grown}"


def test_what_is_large_has_a_reason(sizes):
    large = sizes.index[(sizes > pd.Series(MOST)).any(axis=1)]
    without = sizes.loc[large.difference(LARGER)]
    assert without.empty, f"{__file__}: add to LARGER, with a reason, what has more than {MOST}:\n{without}"
    gone = set(LARGER).difference(sizes.index)
    assert not gone, f"{__file__}: remove from LARGER {gone}"
