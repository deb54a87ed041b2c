"""Commands and their options, settings of ``monitor.toml``, keys of what ``--json`` prints, names of metrics."""

import argparse
import contextlib
import importlib.resources
import io
import json
import re
import sys
import tempfile
from pathlib import Path
from unittest.mock import patch

from skthermo.__main__ import main
from skthermo.datasets import make_truss_campaign

SECTION, KEY = re.compile(r"(?:# )?(\[.*\])"), re.compile(r"(?:# )?(\w+) = ")


def commands_and_settings():
    with tempfile.TemporaryDirectory() as folder:
        yield from commands()
        yield from settings(written_settings(Path(folder)))
        yield from metrics(Path(folder))
    yield from keys_of_json()


def commands():
    """Each command, its arguments and options."""
    whole = whole_parser()
    for name, parser in {"": whole, **subcommands(whole)}.items():
        for action in parser._actions:
            if action.dest not in ("help", argparse.SUPPRESS):
                argument = action.option_strings[-1] if action.option_strings else action.dest
                yield f"command {name} {argument}".replace("  ", " ")


def whole_parser():
    """The parser that the program makes."""

    class Made(Exception):
        pass

    def give(parser, *_):
        raise Made(parser)

    with patch.object(argparse.ArgumentParser, "parse_args", give):
        try:
            run("status")
        except Made as made:
            return made.args[0]
    raise AssertionError("the program has no parser")


def subcommands(parser):
    return next(action for action in parser._actions if isinstance(action, argparse._SubParsersAction)).choices


def run(*arguments):
    with contextlib.ExitStack() as inside:
        inside.enter_context(contextlib.redirect_stdout(io.StringIO()))
        inside.enter_context(contextlib.redirect_stderr(io.StringIO()))
        inside.enter_context(patch.object(sys, "argv", ["skthermo", *map(str, arguments)]))
        return main()


def written_settings(folder):
    """The settings that ``init`` writes, with all that can be set in comments."""
    year = make_truss_campaign(samples_per_year=120, random_state=0)
    files = folder / "T.csv", folder / "F.csv"
    for table, file in zip((year.temperatures, year.frequencies), files, strict=True):
        table.to_csv(file)
    assert run("init", *files, "--into", folder / "bridge") == 0
    return (folder / "bridge" / "monitor.toml").read_text(encoding="utf-8")


def settings(text):
    """Sections and their keys; of sections that name a class, whose parameters are its own, the class."""
    for part in re.split(r"\n\n", text):
        section = next(filter(None, map(SECTION.fullmatch, part.splitlines())), None)
        keys = [found[1] for line in part.splitlines() if (found := KEY.match(line))]
        if section:
            keys = ["class"] if "class" in keys else keys
            yield from (f"monitor.toml {section[1]} {key}" for key in keys)


def metrics(folder):
    """Metrics of a bridge whose monitor is fitted."""
    run("fit", folder / "bridge", "--metrics", folder / "metrics.prom")
    text = (folder / "metrics.prom").read_text(encoding="utf-8")
    yield from {f"metric {name}" for name in re.findall(r"^# TYPE (\w+)", text, re.MULTILINE)}


def keys_of_json():
    schema = json.loads((importlib.resources.files("skthermo.commands") / "output.schema.json").read_text())
    for name, definition in {"": schema, **schema["$defs"]}.items():
        yield from (f"--json {key}" for key in keys_of(definition, name))


def keys_of(definition, path):
    for key, one in definition.get("properties", {}).items():
        inner = f"{path}.{key}".strip(".")
        yield inner
        yield from keys_of(one, inner)
    if "items" in definition:
        yield from keys_of(definition["items"], path)
