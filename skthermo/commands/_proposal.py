"""Settings that fit some records: what was found in their files, and what was chosen, as a file with comments."""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline

import skthermo
from skthermo._core.files import write_when_complete
from skthermo._core.frames import usual_step
from skthermo._core.text import duration_text
from skthermo._core.warnings import collected, warn_each
from skthermo.commands._settings import (
    CLASSES,
    SECTIONS,
    Files,
    RecordSettings,
    Settings,
    class_named,
    read_settings,
    settings_of,
)
from skthermo.preprocessing import ExponentialMeans, RecordFindings, check_records
from skthermo.preprocessing.loggers.logger_files import NO_TEXT_FILES, PARQUET, CsvFormat, FileLook, read_file
from skthermo.preprocessing.loggers.together import HZ, LoggerRecords
from skthermo.surrogate import TemperatureMapper

BASELINE = "baseline"  # folder to which the files of the baseline are copied
REGRESSION = "sklearn.linear_model.Ridge"
FEATURES = {
    "ExponentialMeans": "Means of earlier temperatures that explain the responses.",
    "HingeFeatures": "Frequencies are piecewise-linear in temperature.",
}
OTHERS = """
# An FE model, which knows how damage moves the frequencies, and by which slow drift of the stiffness is followed:
# a function of a Python file that gives one, or a folder of matrices that another program exported. Other settings
# are those of DataInformedFEM.
# [fem]
# model = "model.py:make_model"
# random_state = 0

# The page for the owner.
# [page]
# title = "Bridge over the river"
# structure = "model.py:make_structure"
# templates = "templates"
# drift_limit = 0.1"""


@dataclass(frozen=True)
class TriedDetector:
    """A detector by its class and settings, what it evaluates, what it finds, and how small changes are that it finds.

    The ``size`` is the geometric mean of the smallest changes of each response alone, infinite where none is found.
    """

    kind: str
    compensator: Mapping[str, Any]
    text: str
    finds: str
    size: float

    def __str__(self) -> str:
        return f"{self.kind}, {self.text}: {self.finds}"


@dataclass(frozen=True)
class Proposal:
    """What was found in files of records, and the settings that are proposed for them."""

    looks: Sequence[FileLook]
    form: CsvFormat
    records: RecordSettings
    baseline: pd.DataFrame
    n_waiting: int
    units: Mapping[str, str]
    findings: RecordFindings
    means: ExponentialMeans | None

    @classmethod
    def found(cls, options: argparse.Namespace) -> Proposal:
        """Look at files, and at their records up to the end of the baseline."""
        read = LoggerRecords.read(
            options.files, options.temperatures, options.responses, options.reference, options.zone, options.stamps
        )
        warn_each(finding for look in read.looks for finding in look.findings)
        looks, roles, table = read.looks, read.roles, read.table
        form = _form_of_all(looks)
        until = options.until
        baseline = table if until is None else table.loc[:until]
        if not len(baseline):
            raise ValueError(f"no record is from before {until}; the first is of {table.index[0]}")
        records = RecordSettings(
            [f"{BASELINE}/{look.file.name}" for look in looks],
            **roles,
            ignore=list(read.ignored),
            convert=read.convert,
            until=until,
        )
        T, F = baseline[roles["temperatures"]], baseline[roles["responses"]]
        unit = next(iter(read.units.values())) if len(set(read.units.values())) == 1 else ""
        chosen = TemperatureMapper().behind_means(T, F)
        means = chosen[0] if isinstance(chosen, Pipeline) else None
        findings = check_records(T, F, unit=unit)
        return cls(looks, form, records, baseline, len(read.waiting), read.units, findings, means)

    @property
    def step(self) -> pd.Timedelta:
        return usual_step(self.baseline.index)

    def account(self) -> Iterator[str]:
        for look in self.looks:
            form, index = look.form, look.records.index
            is_csv = look.file.suffix.lower() not in NO_TEXT_FILES
            shape = f"values with {form.separator!r} between and the decimal sign {form.decimal!r}, " if is_csv else ""
            zone = f" in {index.tz}" if index.tz else ", without a time zone"
            yield f"{look.file}: {len(index)} records, {shape}{index.min()} to {index.max()}{zone}"
            yield from (f"not used: {name!r}, as {why}" for name, why in look.ignored.items())
            yield from (f"see: {note}" for note in look.notes)
        if self.n_waiting:
            yield f"stamps that are not in all files, and are left out: {self.n_waiting}"
        missing = self.baseline.isna().to_numpy().mean()
        yield (
            f"baseline: {len(self.baseline)} records, usually every {duration_text(self.step)}, {missing:.1%} of the "
            "values missing"
        )
        yield f"temperatures: {', '.join(self.records.temperatures)}; responses: {', '.join(self.records.responses)}"
        if self.means is None:
            yield "means of earlier temperatures do not lower the error of the responses in periods held out"
        else:
            yield (
                "the responses depend on earlier temperatures: their means with half-lives of "
                f"{' and '.join(self.means.half_lives)} lower the error in periods held out"
            )

    @cached_property
    def detectors(self) -> list[TriedDetector]:
        """Detectors that are possible, the best first; the single record where nothing speaks for another.

        Of natural frequencies, those that know in which direction damage moves them.
        """
        parts = {"features": [class_named(kind, CLASSES["features"])(**chosen) for kind, chosen in self.features]}
        parts["regression"] = class_named(REGRESSION, CLASSES["regression"])()
        are_frequencies = set(self.units.values()) == {HZ}
        kind = "DirectionalDetector" if are_frequencies else "MahalanobisDetector"
        falls = ", falls of frequencies with more weight than rises" if are_frequencies else ""
        ways = [({}, f"each record for itself{falls}")]
        if self.step <= pd.Timedelta(hours=6):  # a day has enough records
            ways.append(({"window": "1D"}, f"the records of a day together{falls}"))
        parts["detector"], tried = class_named(kind, CLASSES["detector"])(), []
        for chosen, text in ways:
            options = {"compensator": chosen, "monitor": self.monitor_options}
            try:
                made = Settings(Path(), {}, Files(), self.records, self.form, parts, options)
                with collected():  # the fit that follows gives them
                    smallest = made.monitor().fit(self.baseline).smallest_changes_
                size = float(np.exp(np.log(list(smallest.single.values())).mean()))
                tried.append(TriedDetector(kind, chosen, text, str(smallest), size if np.isfinite(size) else np.inf))
            except ValueError as error:
                tried.append(
                    TriedDetector(kind, chosen, text, f"it cannot be fitted to this baseline: {error}", np.inf)
                )
        return sorted(tried, key=lambda one: one.size)

    @property
    def features(self) -> list[tuple[str, dict[str, Any]]]:
        """Classes and settings of what is made of temperatures: means that explain responses, and hinges."""
        if self.means is None:
            return [("HingeFeatures", {})]
        chosen = {"half_lives": list(self.means.half_lives), "sensors": list(self.means.sensors)}
        return [("ExponentialMeans", chosen), ("HingeFeatures", {})]

    @property
    def monitor_options(self) -> dict[str, Any]:
        """Settings of the monitor."""
        several = len(set(self.units.values())) > 1
        units = dict(self.units) if several else next(iter(self.units.values()))
        return {"false_alarms_per_year": 1.0, "watch_per_year": 12.0, "units": units, "random_state": 0}

    def write(self, folder: Path, name: str | None) -> Path:
        """Write the settings into a folder, with copies of the files and a folder for new ones."""
        file = folder / "monitor.toml"
        if file.exists():
            raise FileExistsError(
                f"there is a file {str(file)!r} already; expected another folder, or none of that name"
            )
        (folder / BASELINE).mkdir(parents=True, exist_ok=True)
        (folder / self.records.folder).mkdir(exist_ok=True)
        for look in self.looks:
            copy = folder / BASELINE / look.file.name
            if copy.resolve() != look.file.resolve():
                shutil.copyfile(look.file, copy)
        write_when_complete(file, self.text(name))
        read_settings(file)  # what is written can be read
        return file

    def text(self, name: str | None = None) -> str:
        """The settings as TOML, with what each means."""
        found = [*self.account(), *self.findings.summary().splitlines()]
        found += [str(one) for one in self.detectors]
        best = self.detectors[0]
        calls: list[tuple[str, str | None, Mapping[str, Any], str]] = [
            ("files", None, {"name": name} if name else {}, "What is written."),
            ("records", None, asdict(self.records), "Which records there are."),
            ("csv", None, asdict(self.form), "How CSV files are written."),
            *(("features", kind, chosen, FEATURES[kind]) for kind, chosen in self.features),
            ("regression", REGRESSION, {}, "Predicts the responses from the inputs: any of scikit-learn's regressors."),
            ("compensator", None, best.compensator, f"Takes out what the weather explains, of {best.text}."),
            ("detector", best.kind, {}, "Gives the damage index of what is left."),
            ("monitor", None, self.monitor_options, "The detector in service."),
        ]
        parts = [
            _comment(
                f"Settings of a monitor, written by skthermo {skthermo.__version__}. Lines with # say what else can be "
                "set."
            )
        ]
        parts += [_comment("Found in the records:"), *(_comment(f"- {one}") for one in found)]
        parts += [_section(*call) for call in calls]
        parts.append(OTHERS)
        return "\n".join(parts) + "\n"


def _form_of_all(looks: Sequence[FileLook]) -> CsvFormat:
    """The form by which all files are read as they were: that of the first text, as workbooks need less of it."""
    looks = [look for look in looks if look.file.suffix.lower() not in PARQUET] or looks[:1]
    looks.sort(key=lambda look: look.file.suffix.lower() in NO_TEXT_FILES)
    missing = sorted({marker for look in looks for marker in look.form.missing})
    forms = [replace(look.form, missing=missing) for look in looks]
    other = next((n for n, form in enumerate(forms) if form != forms[0] and not _fits(forms[0], looks[n])), None)
    if other is not None:
        differing = [name for name, value in asdict(forms[0]).items() if value != getattr(forms[other], name)]
        got = ", ".join(f"{name} {getattr(forms[0], name)!r} and {getattr(forms[other], name)!r}" for name in differing)
        raise ValueError(f"{looks[0].file} and {looks[other].file} have different forms: {got}; expected the same")
    return forms[0]


def _fits(form: CsvFormat, look: FileLook) -> bool:
    """Whether a file has the same records by another form."""
    try:
        return read_file(look.file, form, ignore=look.ignored).equals(look.records)
    except ValueError:
        return False


def _section(name: str, kind: str | None, chosen: Mapping[str, Any], text: str) -> str:
    """A section: what is chosen as settings, all others as comments with their defaults."""
    if kind is None:
        maker, without = SECTIONS[name][0](), SECTIONS[name][1]
    else:
        maker, without = class_named(kind, CLASSES[name]), ()
    header = f"[[{name}]]" if name == "features" else f"[{name}]"
    lines = ["", _comment(text), header, *([f"class = {toml(kind)}"] if kind else [])]
    is_own = maker.__module__.startswith("skthermo")
    for key, setting in settings_of(maker, without).items() if is_own else ():
        value = chosen.get(key, setting.default)
        is_chosen = setting.is_required or (
            key in chosen and value is not None and value not in ([], (), {}, setting.default)
        )
        is_chosen |= key in chosen and name == "monitor"
        lines.append(_comment(setting.text, "## "))
        shown = "..." if value is None else toml(value)
        lines.append(f"{key} = {shown}" if is_chosen else f"# {key} = {shown}")
    return "\n".join(lines)


def _comment(text: str, sign: str = "# ") -> str:
    lines = textwrap.wrap(text, 110, initial_indent=sign, subsequent_indent=sign, break_long_words=False)
    return "\n".join(lines)


def toml(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml(str(key))} = {toml(one)}" for key, one in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(toml, value))}]"
    if isinstance(value, int | float):
        return repr(value)
    return json.dumps(str(value), ensure_ascii=False).replace("\x7f", "\\u007f")
