"""Settings that fit some records: what was found in their files, and what was chosen, as a file with comments."""

from __future__ import annotations

import argparse
import json
import shutil
import textwrap
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, replace
from functools import cached_property
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from sklearn.pipeline import Pipeline

import skthermo
import skthermo.commands._settings as settings
from skthermo._core.files import write_when_complete
from skthermo._core.frames import usual_step
from skthermo._core.text import duration_text
from skthermo._core.warnings import collected, warn_each
from skthermo.preprocessing import ExponentialMeans, check_records
from skthermo.preprocessing.loggers.logger_files import NO_TEXT_FILES, PARQUET, CsvFormat, FileLook, read_file
from skthermo.preprocessing.loggers.together import HZ, LoggerRecords
from skthermo.reporting.answers import regime_text
from skthermo.surrogate import TemperatureMapper

BASELINE = "baseline"  # folder to which the files of the baseline are copied
REGRESSION = "sklearn.linear_model.Ridge"
FORM = {
    "separator": "sign between values", "decimal": "decimal sign", "encoding": "encoding",
    "names_line": "line with the names", "values_line": "line of the first record",
    "stamp_columns": "columns with the stamp", "stamps": "form of stamps", "time_zone": "time zone",
}  # fmt: skip
"""What the parts of a form are called."""


class Proposal:
    """What was found in files of records up to the end of the baseline, and the settings that are proposed for them."""

    def __init__(self, options: argparse.Namespace):
        roles = options.temperatures, options.responses, options.reference
        self.read = read = LoggerRecords.read(options.files, *roles, options.zone, options.stamps)
        warn_each(finding for look in read.looks for finding in look.findings)
        copies, until = [f"{BASELINE}/{look.file.name}" for look in read.looks], options.until
        self.baseline = read.table if until is None else read.table.loc[:until]
        if not len(self.baseline):
            raise ValueError(f"no record is from before {until}; the first is of {read.table.index[0]}")
        others = {"ignore": list(read.ignored), "convert": read.convert, "until": until}
        self.records = settings.RecordSettings(copies, **read.roles, **others)
        T, F = self.baseline[self.records.temperatures], self.baseline[self.records.responses]
        units = set(read.units.values())
        chosen = TemperatureMapper().behind_means(T, F)
        self.means: ExponentialMeans | None = chosen[0] if isinstance(chosen, Pipeline) else None
        self.findings = check_records(T, F, unit=units.pop() if len(units) == 1 else "")
        self.form, self.step = form_of_all(read.looks), usual_step(self.baseline.index)

    def account(self) -> Iterator[str]:
        for look in self.read.looks:
            form, index = look.form, look.records.index
            is_csv = look.file.suffix.lower() not in NO_TEXT_FILES
            shape = f"values with {form.separator!r} between and the decimal sign {form.decimal!r}, " if is_csv else ""
            zone = f" in {index.tz}" if index.tz else ", without a time zone"
            yield f"{look.file}: {len(index)} records, {shape}{index.min()} to {index.max()}{zone}"
            yield from (f"see: {note}" for note in look.notes)
        yield from (f"not used: {name!r}, as {why}" for name, why in self.read.ignored.items())
        yield from (f"see: {note}" for note in self.read.notes)
        if len(self.read.waiting):
            yield f"stamps that are not in all files, and are left out: {len(self.read.waiting)}"
        usual, missing = duration_text(self.step), self.baseline.isna().to_numpy().mean()
        yield f"baseline: {len(self.baseline)} records, usually every {usual}, {missing:.1%} of the values missing"
        yield from self._gaps()
        yield f"temperatures: {', '.join(self.records.temperatures)}; responses: {', '.join(self.records.responses)}"
        earlier = "none" if self.means is None else f"with half-lives of {' and '.join(self.means.half_lives)}"
        yield f"means of earlier temperatures that lower the error of the responses in periods held out: {earlier}"

    def _gaps(self) -> Iterator[str]:
        """Outages of a day or more, and of ten records or more, the longest first."""
        index = self.baseline.index
        steps = pd.Series(index[1:] - index[:-1], index[:-1])
        long = steps[steps >= max(pd.Timedelta("1D"), 10 * self.step)].sort_values(ascending=False, kind="stable")
        listed = [f"{start} to {start + step} ({duration_text(step)})" for start, step in long[:3].items()]
        if listed:
            yield f"outages: {len(long)}, {'the longest ' if len(long) > 3 else ''}{'; '.join(listed)}"

    @cached_property
    def detectors(self) -> list[dict[str, Any]]:
        """Detectors that are possible, the best first; the single record where nothing speaks for another.

        Of natural frequencies, those that know in which direction damage moves them. The ``size`` is the geometric mean
        of the smallest changes of each response alone that are found, infinite where none is found.
        """
        parts = {"features": [settings.class_named("features", kind)(**chosen) for kind, chosen, _ in self.features]}
        parts["regression"] = settings.class_named("regression", REGRESSION)()
        are_frequencies = set(self.read.units.values()) == {HZ}
        kind = "DirectionalDetector" if are_frequencies else "MahalanobisDetector"
        falls = ", falls of frequencies with more weight than rises" if are_frequencies else ""
        parts["detector"], tried = settings.class_named("detector", kind)(), []
        ways: dict[str, dict[str, Any]] = {"each record for itself": {}}
        if self.step <= pd.Timedelta(hours=6):  # a day has enough records
            ways["the records of a day together"] = {"window": "1D"}
        for text, chosen in ways.items():
            options = {"compensator": chosen, "monitor": self.monitor_options}
            made = settings.Settings(Path(), {}, settings.Files(), self.records, self.form, parts, options)
            try:
                with collected():  # the fit that follows gives them
                    monitor = made.monitor().fit(self.baseline)
                smallest = monitor.smallest_changes_
                size = np.exp(np.log(list(smallest.single.values())).mean())
                finds = "; ".join(filter(None, [str(smallest), regime_text(monitor)]))
            except ValueError as error:
                size, finds = np.inf, f"it cannot be fitted to this baseline: {error}"
            one = {"kind": kind, "compensator": chosen, "text": f"{text}{falls}"}
            one |= {"said": f"{kind}, {text}{falls}: {finds}", "size": size if np.isfinite(size) else np.inf}
            tried.append(one)
        return sorted(tried, key=lambda one: one["size"])

    @property
    def features(self) -> list[tuple[str, dict[str, Any], str]]:
        """Classes and settings of what is made of temperatures, means that explain responses and hinges, and why."""
        found: list[tuple[str, dict[str, Any], str]] = []
        if self.means is not None:
            chosen = {"half_lives": list(self.means.half_lives), "sensors": list(self.means.sensors)}
            found = [("ExponentialMeans", chosen, "Means of earlier temperatures that explain the responses.")]
        return [*found, ("HingeFeatures", {}, "Frequencies are piecewise-linear in temperature.")]

    @property
    def monitor_options(self) -> dict[str, Any]:
        """Settings of the monitor."""
        several = len(set(self.read.units.values())) > 1
        units = dict(self.read.units) if several else next(iter(self.read.units.values()))
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
        for look in self.read.looks:
            copy = folder / BASELINE / look.file.name
            if copy.resolve() != look.file.resolve():
                shutil.copyfile(look.file, copy)
        write_when_complete(file, self.text(name))
        settings.read_settings(file)  # what is written can be read
        return file

    def text(self, name: str | None = None) -> str:
        """The settings as TOML, with what each means."""
        best = self.detectors[0]
        calls: list[tuple[str, str | None, Mapping[str, Any], str]] = [
            ("files", None, {"name": name} if name else {}, "What is written."),
            ("records", None, asdict(self.records), "Which records there are."),
            ("csv", None, asdict(self.form), "How CSV files are written."),
            *(("features", *chosen) for chosen in self.features),
            ("regression", REGRESSION, {}, "Predicts the responses from the inputs: any of scikit-learn's regressors."),
            ("compensator", None, best["compensator"], f"Takes out what the weather explains, of {best['text']}."),
            ("detector", best["kind"], {}, "Gives the damage index of what is left."),
            ("monitor", None, self.monitor_options, "The detector in service."),
        ]
        written = f"Settings of a monitor, written by skthermo {skthermo.__version__}."
        found = [*self.account(), *self.findings.summary().splitlines(), *(one["said"] for one in self.detectors)]
        parts = [_comment(f"{written} Lines with # say what else can be set."), _comment("Found in the records:")]
        parts += [*(_comment(f"- {one}") for one in found), *(_section(*call) for call in calls)]
        optional = files("skthermo.commands").joinpath("optional_sections.toml").read_text(encoding="utf-8")
        return "\n".join([*parts, "", optional])


def form_of_all(looks: Sequence[FileLook]) -> CsvFormat:
    """The form by which all files are read as they were: that of the first text, as workbooks need less of it."""
    looks = [look for look in looks if look.file.suffix.lower() not in PARQUET] or looks[:1]
    first, *others = sorted(looks, key=lambda look: look.file.suffix.lower() in NO_TEXT_FILES)
    missing = sorted({marker for look in looks for marker in look.form.missing})
    form = replace(first.form, missing=missing)
    for look in others:
        own = replace(look.form, missing=missing)
        if own != form and not _fits(form, look):
            pairs = ((name, getattr(form, key), getattr(own, key)) for key, name in FORM.items())
            differing = "; ".join(
                f"{name}: {_words(one)} in {first.file.name}, {_words(other)} in {look.file.name}"
                for name, one, other in pairs
                if one != other
            )
            raise ValueError(
                f"{first.file} and {look.file} are written differently ({differing}), and [csv] has one form for all "
                "files of a bridge. Save both alike, or join them in one file"
            )
    return form


def _words(value: Any) -> str:
    if isinstance(value, list | tuple):
        return " and ".join(value) or "the first"
    return "as usual" if value is None else str(value)


def _fits(form: CsvFormat, look: FileLook) -> bool:
    """Whether a file has the same records by another form."""
    try:
        return read_file(look.file, form, ignore=look.ignored).equals(look.records)
    except ValueError:
        return False


def _section(name: str, kind: str | None, chosen: Mapping[str, Any], text: str) -> str:
    """A section: what is chosen as settings, all others as comments with their defaults."""
    if kind is None:
        maker, without = settings.called_by(name)
    else:
        maker, without = settings.class_named(name, kind), []
    header = f"[[{name}]]" if name == "features" else f"[{name}]"
    lines = ["", _comment(text), header, *([f"class = {toml(kind)}"] if kind else [])]
    known = settings.settings_of(maker, without) if maker.__module__.startswith("skthermo") else {}
    for key, setting in known.items():
        value = chosen.get(key, setting.default)
        is_new = key in chosen and value is not None and value not in ([], (), {}, setting.default)
        is_chosen = setting.default is settings.REQUIRED or is_new or (key in chosen and name == "monitor")
        shown = "..." if value is None else toml(value)
        lines += [_comment(setting.text, "## "), f"{'' if is_chosen else '# '}{key} = {shown}"]
    return "\n".join(lines)


def _comment(text: str, sign: str = "# ") -> str:
    return textwrap.fill(text, 110, initial_indent=sign, subsequent_indent=sign, break_long_words=False)


def toml(value: Any) -> str:
    """A value as TOML has it."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{toml(str(key))} = {toml(one)}" for key, one in value.items()) + "}"
    return json.dumps(value, ensure_ascii=False, default=str).replace("\x7f", "\\u007f")
