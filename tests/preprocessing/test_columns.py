"""Columns are what their units, names and values say, and nothing is taken for what it is not."""

import tomllib
from contextlib import nullcontext
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from skthermo.preprocessing import read_records

SOURCES = tomllib.loads(Path(__file__).with_name("column_names.toml").read_text(encoding="utf-8"))
N = 24 * 6
HOURS = pd.date_range("2025-03-03", periods=N, freq="h", name="stamp")
RANDOM = np.random.default_rng(0)
WARM = 10 + 6 * np.sin(2 * np.pi * np.arange(N) / 24) + RANDOM.normal(0, 0.5, N)
STEADY = 4 * (1 - 0.002 * WARM) + RANDOM.normal(0, 0.008, N)
VALUES = {"temperature": WARM, "frequency": STEADY}
OTHERS = VALUES | {
    "humidity": 70 + 10 * RANDOM.normal(size=N),
    "damping": RANDOM.lognormal(0, 0.3, N),
    "strain": 10 * WARM + RANDOM.normal(size=N),
    "tension": 100 - 0.06 * WARM,
}
KNOWN = ["Temperature 0 [°C]", "Frequency 0 [Hz]"]
ONE_FOR_EACH = [
    pytest.param(source, kind, marks=[pytest.mark.nightly] * ((place + number) % 2))
    for place, source in enumerate(SOURCES)
    for number, kind in enumerate(VALUES)
]
"""Columns of a source that are no quantity, with values like those of temperatures or of frequencies by turns."""


def records_of(**columns):
    """A table of columns by the kind of their values, each with values of its own, beside a temperature and a
    frequency."""
    table = {"Temperature 0 [°C]": WARM, "Frequency 0 [Hz]": STEADY}
    for kind, names in columns.items():
        values = OTHERS[kind]
        own = enumerate(names, start=1)
        table |= {name: values + 0.1 * np.abs(values).mean() * (place % 7) for place, name in own}
    return pd.DataFrame(table, HOURS).round(4)


def names_of(source, kind):
    return SOURCES[source].get(kind, "").split("\n")[1:-1]


@pytest.mark.filterwarnings("ignore:.*read-as")
@pytest.mark.parametrize("source", SOURCES)
def test_names_of_quantities_are_known(source, tmp_path):
    names = {kind: names_of(source, kind) for kind in VALUES}
    records_of(**names).to_csv(tmp_path / "log.csv")
    for table, known, expected in zip(read_records(tmp_path / "log.csv"), KNOWN, names.values(), strict=True):
        assert sorted(table) == sorted([known, *expected])


@pytest.mark.parametrize(("source", "kind"), ONE_FOR_EACH)
def test_what_is_no_quantity_of_ours_is_left_out_and_named(source, kind, tmp_path):
    names = names_of(source, "neither")
    records_of(**{kind: names}).to_csv(tmp_path / "log.csv")
    with pytest.warns(UserWarning, match="not used") as given:
        T, F = read_records(tmp_path / "log.csv")
    assert [*T, *F] == KNOWN
    assert [name for name in names if repr(name) not in str(given[0].message)] == []


PAIRS = {
    "as they are": (["T1 temperature", "T2 temperature"], ["f1 frequency"], ["T1", "T2"], ["f1"]),
    "exchanged": (["f1 frequency", "f2 frequency"], ["T1 temperature"], ["T1"], ["f1", "f2"]),
    "open names": (["A temperature"], ["C frequency"], ["A"], ["C"]),
    "exchanged, with open names": (["A frequency"], ["C temperature"], None, None),
    "weather beside temperatures": (["T1 temperature", "RH humidity"], ["f1 frequency"], ["T1"], ["f1"]),
    "damping beside frequencies": (["T1 temperature"], ["f1 frequency", "xi1 damping"], ["T1"], ["f1"]),
    "letters of modes": (["T1 temperature"], ["B1 frequency", "T3 frequency"], ["T1"], ["B1", "T3"]),
    "another response": (["T1 temperature"], ["strain strain"], ["T1"], ["strain"]),
    "a tension beside temperatures": (["T1 temperature", "tension tension"], ["f1 frequency"], ["T1"], ["f1"]),
    "a tension that is called T1": (["T1 tension", "T2 temperature"], ["f1 frequency"], ["T2"], ["f1"]),
}
"""Columns of two files and their values; which are temperatures and responses, None where that is asked for."""


@pytest.mark.filterwarnings("ignore:.*read-as")
@pytest.mark.parametrize("case", PAIRS)
def test_the_same_rules_hold_for_two_files(case, tmp_path):
    *files, temperatures, responses = PAIRS[case]
    for name, columns in zip(("T.csv", "F.csv"), files, strict=True):
        values = {column.split()[0]: OTHERS[column.split()[1]] for column in columns}
        pd.DataFrame(values, HOURS).round(4).to_csv(tmp_path / name)
    if temperatures is None:
        with pytest.raises(ValueError, match="no column is known"):
            read_records(tmp_path / "T.csv", tmp_path / "F.csv")
        return
    T, F = read_records(tmp_path / "T.csv", tmp_path / "F.csv")
    assert [list(T), list(F)] == [temperatures, responses]


def test_what_is_asked_for_is_an_input_whatever_it_is(tmp_path):
    records_of(humidity=["RH"]).to_csv(tmp_path / "log.csv")
    T, _ = read_records(tmp_path / "log.csv", temperatures=[KNOWN[0], "RH"])
    assert list(T) == [KNOWN[0], "RH"]


@pytest.mark.parametrize(("name", "letter"), [("Temp_F", True), ("AirTF_Avg", True), ("Temp_{}", False)])
def test_a_letter_is_a_unit_where_it_is_none_of_a_series(name, letter, tmp_path):
    warm = WARM * 1.8 + 32 if letter else WARM
    names = [name] if letter else [name.format(one) for one in "AEF"]
    pd.DataFrame(dict.fromkeys(names, warm) | {"f1": STEADY}, HOURS).to_csv(tmp_path / "log.csv")
    with pytest.warns(UserWarning, match="converted") if letter else nullcontext():
        T, _ = read_records(tmp_path / "log.csv")
    np.testing.assert_allclose(T, np.column_stack([WARM] * len(names)), atol=1e-9)
