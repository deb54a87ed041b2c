"""What a user can name of the skthermo that is imported: one item a line, sorted.

``PYTHONPATH=FOLDER python tests/contract/inventory.py`` prints the inventory of the skthermo in a folder. Items are

- ``room.Name``, ``room.Name(parameter)``
- ``room.Name.method``, ``room.Name.method(parameter)``, ``room.Name.attribute``
- ``room.Name.table[column]``: columns and index of a table, keys of a Bunch
- ``command update --json``, ``monitor.toml [monitor] persistence``, ``--json status.state``, ``metric skthermo_up``
- ``load_affine CalculiX``: a form of file that is read
"""

import dataclasses
import importlib
import inspect
import pkgutil
import re
import sys
from pathlib import Path

from sklearn.base import BaseEstimator
from sklearn.utils import Bunch

sys.path.append(str(Path(__file__).parents[2]))  # after PYTHONPATH

import skthermo

COMMON = {name for base in (BaseEstimator, Bunch, tuple, Exception) for name in dir(base)}
OF_SCIKIT_LEARN = re.compile("set_.*_request|set_callbacks|get_metadata_routing")
ATTRIBUTES = re.compile(r"^Attributes\n-+\n(.*?)(?=^\w[^\n]*\n---|\Z)", re.MULTILINE | re.DOTALL)
VARIABLE = inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD


def inventory():
    """All items, sorted."""
    from tests.contract.commands_and_settings import commands_and_settings
    from tests.contract.file_forms import file_forms
    from tests.contract.tables import tables

    named = set(surface())
    return sorted(named | set(tables(named)) | set(commands_and_settings()) | set(file_forms()))


def surface():
    """Names, parameters, methods and attributes."""
    for item, thing in names():
        yield item
        if not inspect.isclass(thing):
            yield from parameters(item, thing)
            continue
        if not holds_data(thing) and not getattr(thing, "_is_protocol", False):
            yield from parameters(item, thing)
        yield from (f"{item}.{name}" for name in {*fields(thing), *documented_attributes(thing)})
        for name in methods(thing):
            yield f"{item}.{name}"
            if callable(method := getattr(thing, name)):
                yield from parameters(f"{item}.{name}", method)


def names():
    """Public names of all rooms, with what they stand for."""
    for module in pkgutil.iter_modules(skthermo.__path__, "skthermo."):
        if "._" in module.name or module.name.endswith("__main__"):
            continue
        room = importlib.import_module(module.name)
        protocols = {name for name, thing in vars(room).items() if getattr(thing, "_is_protocol", False)}
        for name in {*getattr(room, "__all__", ())} | protocols:
            yield f"{module.name.removeprefix('skthermo.')}.{name}", getattr(room, name)


def parameters(item, function):
    for one in inspect.signature(function).parameters.values():
        if one.kind not in VARIABLE and one.name not in ("self", "cls"):
            yield f"{item}({one.name})"


def holds_data(kind):
    """Whether objects of a class come from methods, with fields in place of parameters."""
    return dataclasses.is_dataclass(kind) or issubclass(kind, Bunch | tuple | Exception)


def own_bases(kind):
    return (base for base in kind.__mro__ if base.__module__.startswith("skthermo"))


def fields(kind):
    if holds_data(kind) or getattr(kind, "_is_protocol", False):
        yield from (name for base in own_bases(kind) for name in inspect.get_annotations(base) if name[0] != "_")


def documented_attributes(kind):
    for base in own_bases(kind):
        for part in ATTRIBUTES.findall(inspect.cleandoc(base.__doc__ or "")):
            for line in re.findall(r"^(\w[\w, ]*?)(?: :|$)", part, re.MULTILINE):
                yield from line.split(", ")


def methods(kind):
    """Public methods and properties, without those that all estimators, Bunches, tuples or errors have."""
    return (name for name in dir(kind) if name[0] != "_" and name not in COMMON and not OF_SCIKIT_LEARN.match(name))


if __name__ == "__main__":
    print(*inventory(), sep="\n")
