"""A truss that is monitored by commands alone: files of a logger, and the folder that init makes of them."""

import contextlib
import io
import json
from types import SimpleNamespace

from skthermo.commands.main import main
from tests.monitoring.nightly import FIRST


def run(*arguments):
    """Run a command: its exit code, what it prints, and its JSON if that was asked for."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = main([str(one) for one in arguments])
    text = out.getvalue()
    said = json.loads(text) if "--json" in arguments else None
    return SimpleNamespace(code=code, out=text, err=err.getvalue(), json=said)


def write_pair(records, folder, stem="", **options):
    """Temperatures and frequencies as two CSV files."""
    files = []
    for letter in "Tf":
        files.append(folder / f"{letter.upper()}{stem}.csv")
        records.filter(regex=f"^{letter}").to_csv(files[-1], **{"index_label": "time"} | options)
    return files


def made_bridge(folder, records):
    """A bridge whose monitor is fitted to two years; the folder it is in has the settings."""
    run("init", *write_pair(records[:FIRST], folder), "--into", folder / "bridge")
    done = run("fit", folder / "bridge" / "monitor.toml")
    assert done.code == 0, done.err


def write_day(records, bridge, row, stop=None, name=None):
    """New records in one file of the folder, as of which stamp they are."""
    rows = records[row : row + 1 if stop is None else stop]
    rows.to_csv(bridge / "new" / (name or f"{rows.index[0]:%Y-%m-%d}.csv"), index_label="time")
    return str(rows.index[-1])


def edit(file, old, new):
    """Change a text that a file has once."""
    text = file.read_text(encoding="utf-8")
    assert text.count(old) == 1, (old, text)
    file.write_text(text.replace(old, new), encoding="utf-8")
