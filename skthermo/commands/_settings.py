"""Settings of a monitor in a TOML file: what they are called, what they mean, and what they make.

Names, defaults and descriptions of settings are those of the classes that they are for, from their signatures and
docstrings: a section of the file is a call.
"""

from __future__ import annotations

import datetime
import inspect
import json
import re
import runpy
import sys
import tomllib
import traceback
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from difflib import get_close_matches
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple
from zoneinfo import ZoneInfo

import pandas as pd
from sklearn.base import clone
from sklearn.pipeline import make_pipeline

from skthermo.detection import CompensatedDetector, DirectionalDetector
from skthermo.fem import load_affine
from skthermo.monitoring import Monitor
from skthermo.preprocessing.loggers.logger_files import CsvFormat, unit_called

HOW_TO_BEGIN = "skthermo init T.csv F.csv --into {}"
REQUIRED = inspect.Parameter.empty  # the default of what has none
NONE = "none"  # in a file, where a parameter may be None and is not by default


@dataclass(frozen=True)
class Files:
    """What the bridge is called, and which files are written, beside the settings if no folder is named.

    Parameters
    ----------
    name : str, optional
        Name of the bridge in pages, JSON and metrics; by default that of the folder.
    monitor : str, default="monitor.joblib"
        File of the fitted monitor, .joblib or .skops.
    page : str, default="status.html"
        Page for the owner, within the folder of the settings; "" for none.
    transitions : str, default="transitions.jsonl"
        File within that folder to which each change of state is appended, a line of JSON for each; "" for none.
    metrics : str, optional
        File in Prometheus' text format, for a textfile collector; by default none.
    max_age : str, optional
        Age of the newest record beyond which nothing is healthy, such as "2D"; by default two days and the usual time
        between records.
    """

    name: str | None = None
    monitor: str = "monitor.joblib"
    page: str = "status.html"
    transitions: str = "transitions.jsonl"
    metrics: str | None = None
    max_age: str | None = None


@dataclass(frozen=True)
class RecordSettings:
    """Which files hold records, and which of their columns are what.

    Parameters
    ----------
    baseline : list of str
        Files of the baseline. Those with other columns are joined by their stamps.
    temperatures : list of str
        Columns with temperatures, in degrees Celsius.
    responses : list of str
        Columns with natural frequencies, or other responses of the structure.
    reference : list of str, optional
        Columns with temperatures from elsewhere, such as a weather station. They check the thermometers and fill their
        gaps, and are no inputs of the detector.
    ignore : list of str, optional
        Columns that are not used.
    convert : mapping of str to str, optional
        Columns in another unit than degrees Celsius or Hz, and that unit: "K", "°F", "mHz", "kHz" or "rad/s".
    until : str, optional
        Last moment of the baseline; later records of these files are new ones. By default all of them are the
        baseline.
    folder : str, default="new"
        Folder of new records: `update` without names of files takes what is new there.
    """

    baseline: Sequence[str]
    temperatures: Sequence[str]
    responses: Sequence[str]
    reference: Sequence[str] = ()
    ignore: Sequence[str] = ()
    convert: Mapping[str, str] = field(default_factory=dict)
    until: str | None = None
    folder: str = "new"

    @property
    def columns(self) -> list[str]:
        return [*self.temperatures, *self.reference, *self.responses]


class Setting(NamedTuple):
    """A parameter by which something is called: its default, what it is, and the type as its docstring has it."""

    default: Any
    text: str
    kind: str


SECTIONS: dict[str, tuple[str, str]] = {
    "files": ("skthermo.commands._settings.Files", ""),
    "records": ("skthermo.commands._settings.RecordSettings", ""),
    "csv": ("skthermo.preprocessing.loggers.logger_files.CsvFormat", ""),
    "compensator": ("skthermo.detection.CompensatedDetector", "detector regressor targets"),
    "monitor": ("skthermo.monitoring.Monitor", "detector targets reference fem"),
    "fem": ("skthermo.surrogate.DataInformedFEM", "inverse mapper imputer"),
    "page": ("skthermo.reporting.owner_report", "subject path identified detector max_false_alarms now settings"),
}
"""What each section calls, imported when it is needed, and which parameters come from elsewhere."""

CLASSES: dict[str, tuple[str, ...]] = {
    "features": ("skthermo.preprocessing", "sklearn"),
    "regression": ("sklearn",),
    "detector": ("skthermo.detection", "sklearn"),
}
"""Sections that name the class they call, and the packages of these; ``features`` are several, one after the other."""

OF_A_FIT = ("records", "features", "regression", "compensator", "detector", "monitor", "fem")
"""Sections of which changes take effect with the next fit."""


def called_by(section: str) -> tuple[Callable[..., Any], list[str]]:
    """What a section calls, and which parameters come from elsewhere."""
    maker, without = SECTIONS[section]
    module, _, name = maker.rpartition(".")
    return getattr(import_module(module), name), without.split()


def settings_of(maker: Callable[..., Any], without: Sequence[str] = ()) -> dict[str, Setting]:
    """Parameters of a class or function by name, as its numpydoc docstring describes them in their first paragraphs;
    defaults made by a factory are empty."""
    doc, many = inspect.getdoc(maker) or "", re.MULTILINE
    part = re.search(r"^Parameters\n-+\n(.*?)(?=^\w[^\n]*\n---|\Z)", doc, re.DOTALL | many)
    one_of_them = r"^(\w[\w, ]*?) ?: (.*)\n((?:[ \t]+.*\n?)*)"
    said: dict[str, tuple[str, str]] = {}
    for names, of_type, lines in re.findall(one_of_them, part[1] if part else "", many):
        kind = re.sub(r", (optional|default=.*)$", "", of_type)
        text = re.sub(r"`+~?([^`]*)`+", r"\1", " ".join(lines.split()))
        said |= {name.strip(): (f"{text} {kind}" if text.endswith(":") else text, kind) for name in names.split(",")}
    return {
        name: Setting({} if "factory" in repr(one.default) else one.default, *said.get(name, ("", "")))
        for name, one in inspect.signature(maker).parameters.items()
        if name not in without and one.kind not in (one.VAR_POSITIONAL, one.VAR_KEYWORD)
    }


@dataclass(frozen=True)
class Settings:
    """Settings of one monitor, checked.

    ``content`` is what the file says, ``parts`` are unfitted estimators by section, ``options`` the values of the other
    sections.
    """

    file: Path
    content: Mapping[str, Any]
    files: Files
    records: RecordSettings
    csv: CsvFormat
    parts: Mapping[str, Any]
    options: Mapping[str, Mapping[str, Any]]

    @property
    def name(self) -> str:
        return self.files.name or self.file.resolve().parent.name

    @property
    def of_a_fit(self) -> dict[str, Any]:
        """Sections that a fit takes over, as JSON has them."""
        return json.loads(json.dumps({name: self.content.get(name) for name in OF_A_FIT}, default=str))

    def changed_since(self, before: Mapping[str, Any]) -> list[str]:
        """Names of settings that were others when the monitor was fitted, such as "[detector] window"."""

        def flat(content: Mapping[str, Any]) -> dict[str, Any]:
            sections = {name: one if isinstance(one, dict) else {"": one} for name, one in content.items()}
            return {f"[{name}] {key}".strip(): one for name, values in sections.items() for key, one in values.items()}

        now, then = flat(self.of_a_fit), flat(before)
        return [name for name in now | then if now.get(name) != then.get(name) and name != "[records] folder"]

    @property
    def code(self) -> list[str]:
        """Functions of Python files that the settings name: programs, which a command runs."""
        named = {"fem": "model", "page": "structure"}
        given = [str(self.options[section].get(key, "")) for section, key in named.items()]
        return [name for name in dict.fromkeys(given) if ".py:" in name]

    def path(self, name: str) -> Path:
        """A file that the settings name: beside them, if it has no folder of its own."""
        return self.file.parent / name

    def monitor(self, fem: Any = None) -> Monitor:
        """The monitor that the settings describe, unfitted."""
        steps = [*self.parts["features"], self.parts["regression"]]
        regression = make_pipeline(*steps) if len(steps) > 1 else steps[0]
        targets, reference = list(self.records.responses), list(self.records.reference) or None
        last = self.parts["detector"]
        if fem is not None and isinstance(last, DirectionalDetector) and isinstance(last.directions, str):
            last = clone(last).set_params(directions=fem)  # which knows more than "softening"
        detector = CompensatedDetector(last, regression, targets=targets, **self.options["compensator"])
        return Monitor(detector, reference=reference, fem=fem, **self.options["monitor"])

    def fem(self, T: pd.DataFrame, F: pd.DataFrame) -> Any:
        """The chain of the FE model that the settings name, fitted; None without one."""
        options = dict(self.options["fem"])
        if not options:
            return None
        path = self.path(options.pop("model"))
        is_code = ".py:" in str(path)  # or matrices that other programs exported
        model = _made_by(path, f"{self.file}: [fem] model", "a model") if is_code else load_affine(path)
        return called_by("fem")[0](model, **options).fit(T, F)

    def page(self) -> dict[str, Any]:
        """Arguments of the owner's page."""
        options = {"title": self.name} | self.options["page"]
        if "templates" in options:
            options["templates"] = self.path(options["templates"])
        if "structure" in options:
            setting = f"{self.file}: [page] structure"
            options["structure"] = _made_by(self.path(options["structure"]), setting, "a Structure")
        return options


def _made_by(path: Path, setting: str, what: str) -> Any:
    """What a function of a Python file gives, as in "bridge.py:make_model".

    It can import the files beside it, as when Python runs a script; another bridge may have files with the same names.
    """
    file, _, function = str(path).rpartition(":")
    if not file.endswith(".py") or not Path(file).is_file():
        raise ValueError(
            f"{setting} is {str(path)!r}; expected a Python file and its function, such as 'bridge.py:make'"
        )
    folder, before = Path(file).resolve().parent, set(sys.modules)
    sys.path.insert(0, str(folder))
    try:
        names = runpy.run_path(file, run_name=Path(file).stem)
        if callable(names.get(function)):
            return names[function]()
    except Exception as error:  # code of users may raise anything
        raise ValueError(f"{setting}: {_place_of(error, file)}: {type(error).__name__}: {error}") from error
    finally:
        sys.path.remove(str(folder))
        for name in set(sys.modules) - before:
            if Path(getattr(sys.modules[name], "__file__", None) or "").parent == folder:
                del sys.modules[name]
    raise ValueError(f"{setting}: {file} has no function {function!r}; expected one that gives {what}")


def _place_of(error: Exception, file: str) -> str:
    """File and line of an error in a Python file, or in one beside it: the last line there that was run."""
    if isinstance(error, SyntaxError):
        return f"{error.filename}, line {error.lineno}"
    steps, folder = traceback.extract_tb(error.__traceback__), Path(file).resolve().parent
    own = [step for step in steps if Path(step.filename).resolve().parent == folder]
    return f"{own[-1].filename}, line {own[-1].lineno}" if own else file


class SettingError(ValueError):
    """What is wrong with a setting: the name of its section, its number among those of that name, and its key."""

    def __init__(self, text: str, section: str, key: str = "", number: int = 0):
        super().__init__(text)
        self.place = section, number, key


def read_settings(file: Path) -> Settings:
    """Read and check a file of settings; errors name the line."""
    try:
        text = file.read_text(encoding="utf-8")
        content = tomllib.loads(text)
    except FileNotFoundError as error:
        how = HOW_TO_BEGIN.format(file.parent)
        missing = f"file {str(file)!r}" if file.parent.is_dir() else f"folder {str(file.parent)!r}"
        raise FileNotFoundError(f"there is no {missing}; expected settings, from: {how}") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ValueError(f'{file} is no TOML: {error}; expected lines such as name = "value"') from error
    try:
        return _checked(file, content)
    except SettingError as error:
        (section, number, _), lines = error.place, dict(_places(text))
        line = lines.get(error.place) or lines.get((section, number, ""))
        raise ValueError(f"{file}{f', line {line}' if line else ''}: {error}") from error


def _checked(file: Path, content: Mapping[str, Any]) -> Settings:
    """Settings of a file with this content."""
    known = [*SECTIONS, *CLASSES]
    for name, given in content.items():
        steps, wants_list = given if isinstance(given, list) else [given], name == "features"
        if name not in known:
            raise SettingError(f"there is no section [{name}]{_nearest(name, known)}", name)
        if isinstance(given, list) != wants_list or not all(isinstance(one, dict) for one in steps):
            expected = f"[[{name}]], once for each step" if wants_list else f"[{name}], once"
            raise SettingError(f"{name!r} is no section; expected {expected}", name)
    if lacking := [name for name in ("regression", "detector") if name not in content]:
        raise SettingError(f"there is no section [{lacking[0]}]; expected one, with class = a name", lacking[0])
    values = {
        name: _known(name, content.get(name, {}), settings_of(*called_by(name)))
        for name in SECTIONS
        if name in content or name not in ("fem", "page")
    }
    for name in ("files", "records", "csv"):
        known_settings = settings_of(called_by(name)[0])
        for key, value in values[name].items():
            if not fits(value, kind := known_settings[key].kind):
                raise SettingError(f"[{name}] {key} is {value!r:.100}; expected {kind}", name, key)
    files, records, form = (called_by(name)[0](**values[name]) for name in ("files", "records", "csv"))
    parts: dict[str, Any] = {name: _made(name, content[name]) for name in ("regression", "detector")}
    parts["features"] = [_made("features", one, number) for number, one in enumerate(content.get("features", ()))]
    options = {name: values.get(name, {}) for name in ("compensator", "monitor", "fem", "page")}
    found = Settings(file, content, files, records, form, parts, options)
    _check_columns(records)
    try:
        ZoneInfo(form.time_zone or "UTC")
    except (KeyError, ValueError, OSError) as error:
        text = f"[csv] time_zone is {form.time_zone!r}; expected a name such as 'Europe/Brussels' or 'UTC'"
        raise SettingError(text, "csv", "time_zone") from error
    for key in ("page", "transitions"):
        name = getattr(files, key)
        if Path(name).is_absolute() or ".." in Path(name).parts:
            text = f"[files] {key} is {name!r}; expected a file in the folder of the settings"
            raise SettingError(text, "files", key)
    monitor = found.monitor()
    _validate("monitor", monitor)
    _validate("compensator", monitor.detector)
    return found


def _known(name: str, given: Mapping[str, Any], known: Mapping[str, Setting], number: int = 0) -> dict[str, Any]:
    """Values of a section, which are parameters of what it calls: times as text, and None by a word."""
    for key in given:
        if key not in known:
            raise SettingError(f"[{name}] has no setting {key!r}{_nearest(key, known)}", name, key, number)
    if lacking := [key for key, one in known.items() if one.default is REQUIRED and key not in given]:
        raise SettingError(f"[{name}] lacks {', '.join(lacking)}", name, "", number)
    is_time = datetime.date, datetime.time
    plain = {key: value.isoformat() if isinstance(value, is_time) else value for key, value in given.items()}
    return {key: None if one == NONE and known[key].default is not None else one for key, one in plain.items()}


def _made(name: str, given: Mapping[str, Any], number: int = 0) -> Any:
    """An estimator of the class that a section names, and its parts."""
    values = dict(given)
    try:
        maker = class_named(name, values.pop("class", None))
    except ValueError as error:
        raise SettingError(f"[{name}] class {error}", name, "class", number) from error
    known = _known(name, values, settings_of(maker), number)
    is_part = {key: isinstance(one, dict) and "class" in one for key, one in known.items()}
    made = maker(**{key: _made(name, one, number) if is_part[key] else one for key, one in known.items()})
    _validate(name, made, number)
    return made


def _validate(name: str, estimator: Any, number: int = 0) -> None:
    """The checks of parameters that every estimator has."""
    try:
        estimator._validate_params()
    except ValueError as error:
        key = re.search(r"'(\w+)' parameter", str(error))
        raise SettingError(f"[{name}] {error}", name, key[1] if key else "", number) from error


def _check_columns(records: RecordSettings) -> None:
    """Raise an error for columns that are named twice, for roles without any, and for unknown units."""
    if again := sorted({name for name in records.columns if records.columns.count(name) > 1}):
        raise SettingError(f"[records] names {again} twice; expected each column once", "records")
    for key in ("temperatures", "responses"):
        if not getattr(records, key):
            raise SettingError(f"[records] {key} is empty; expected names of columns", "records", key)
    for column, unit in records.convert.items():
        found = unit_called(unit)
        if found is None or (found.factor == 1 and not found.zero) or column not in records.columns:
            expected = "a column that is used, in 'K', '°F', 'mHz', 'kHz' or 'rad/s'"
            text = f"[records] convert has {column!r}: {unit!r}; expected {expected}"
            raise SettingError(text, "records", "convert")


def class_named(section: str, name: Any) -> type:
    """A class that a section may call: of skthermo by its name, of scikit-learn by its module and name."""
    packages = CLASSES[section]
    rooms = [import_module(package) for package in packages if package.startswith("skthermo")]
    own = {one: getattr(room, one) for room in rooms for one in room.__all__}
    own = {one: found for one, found in own.items() if hasattr(found, "get_params")}
    if name in own:
        return own[name]
    module, _, last = str(name).rpartition(".")
    if module.split(".")[0] in packages:
        with suppress(ImportError, AttributeError):
            found = getattr(import_module(module), last)
            if isinstance(found, type) and hasattr(found, "get_params"):
                return found
    expected = [*own, "one of scikit-learn, such as 'sklearn.linear_model.Ridge'"]
    raise ValueError(f"is {name!r}{_nearest(str(name), list(own), expected)}")


def fits(value: Any, kind: str) -> bool:
    """Whether a value is of a kind, such as "str", "list of float" or "mapping of str to str"."""
    outer, _, inner = kind.partition(" of ")
    types = {"str": str, "int": int, "float": (int, float), "list": list, "mapping": dict}
    parts = value.values() if isinstance(value, dict) else value if isinstance(value, list) else ()
    is_right = isinstance(value, types[outer]) and not isinstance(value, bool)
    return is_right and all(fits(one, inner.removeprefix("str to ")) for one in parts)


def _nearest(name: str, known: Sequence[str] | Mapping[str, Any], expected: Sequence[str] | None = None) -> str:
    """What may have been meant, and else all that there is."""
    near = get_close_matches(name, list(known), 1, 0.6)
    return f"; did you mean {near[0]!r}?" if near else f"; expected one of {', '.join(expected or known)}"


def _places(text: str) -> Iterator[tuple[tuple[str, int, str], int]]:
    """Lines of sections and their settings, by the name of the section, its number among those and the setting."""
    counts: dict[str, int] = {}
    section = ""
    for line, content in enumerate(text.splitlines(), start=1):
        if header := re.match(r"\s*\[\[?\s*([\w-]+)", content):
            section = header[1]
            counts[section] = counts.get(section, -1) + 1
            yield (section, counts[section], ""), line
        elif key := re.match(r"""\s*["']?([\w-]+)["']?\s*(\.\s*[^=]+)?=""", content):
            yield (section, counts.get(section, 0), key[1]), line
