"""Columns are what their units, names and values say, and nothing is taken for what it is not."""

import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skthermo.preprocessing import read_records

SOURCES = tomllib.loads(Path(__file__).with_name("column_names.toml").read_text(encoding="utf-8"))
N = 24 * 30
HOURS = pd.date_range("2025-03-03", periods=N, freq="h", name="stamp")
RANDOM = np.random.default_rng(0)
WARM = 10 + 6 * np.sin(2 * np.pi * np.arange(N) / 24) + RANDOM.normal(0, 0.5, N)
STEADY = 4 * (1 - 0.002 * WARM) + RANDOM.normal(0, 0.008, N)
VALUES = {"temperature": WARM, "frequency": STEADY}


def records_of(names, values):
    """A table of columns, each with values of its own, beside a temperature and a frequency."""
    known = {"Temperature 0 [°C]": WARM, "Frequency 0 [Hz]": STEADY}
    own = {name: values + 0.1 * np.abs(values).mean() * place for place, name in enumerate(names, start=1)}
    return pd.DataFrame(known | own, HOURS).round(4)


@pytest.mark.filterwarnings("ignore:.*read-as")
@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("kind", VALUES)
def test_names_of_quantities_are_known(source, kind, tmp_path):
    names = SOURCES[source].get(kind, "").split("\n")[1:-1]
    records_of(names, VALUES[kind]).to_csv(tmp_path / "log.csv")
    T, F = read_records(tmp_path / "log.csv")
    assert [name for name in names if name not in (T if kind == "temperature" else F)] == []
    assert len([*T, *F]) == len(names) + 2


@pytest.mark.parametrize("source", SOURCES)
@pytest.mark.parametrize("kind", VALUES)
def test_what_is_no_quantity_of_ours_is_left_out_and_named(source, kind, tmp_path):
    names = SOURCES[source]["neither"].split("\n")[1:-1]
    records_of(names, VALUES[kind]).to_csv(tmp_path / "log.csv")
    with pytest.warns(UserWarning, match="not used") as given:
        T, F = read_records(tmp_path / "log.csv")
    assert [*T, *F] == ["Temperature 0 [°C]", "Frequency 0 [Hz]"]
    assert [name for name in names if repr(name) not in str(given[0].message)] == []


def test_there_are_many_names():
    names = [name for kinds in SOURCES.values() for text in kinds.values() for name in text.split("\n")[1:-1]]
    assert len(set(names)) >= 200
