"""Reading Z24: small files in the real formats, damaged ones, and the real file where it is."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.datasets import load_z24

SENSORS = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
MODES = ["f1", "f2", "f3", "f4"]
RNG = np.random.default_rng(0)
N = 12
RECORDS = np.array([0, 1, 2, 5, 6, 7, 8, 20, 21, 22, 30, 31])
F = pd.DataFrame(RNG.normal([4.0, 5.2, 10.1, 10.8], 0.05, (N, 4)).round(6), columns=MODES)
T = pd.DataFrame(RNG.normal(10, 8, (N, 7)).round(3), columns=SENSORS)
STATE = ["undamaged"] * 9 + ["damaged"] * 3


def csv_text():
    table = pd.concat([pd.Series(RECORDS, name="record"), F, T], axis=1).assign(state=STATE)
    return table.to_csv(index=False)


def matlab_fields():
    fields = {"data": F.to_numpy(), "nc": 9, "idx": np.isin(np.arange(40), RECORDS)[:, np.newaxis]}
    return fields | {f"Z24_{name}": T[[name]].to_numpy() for name in SENSORS}


@pytest.fixture
def csv_file(tmp_path):
    file = tmp_path / "z24.csv"
    file.write_text(csv_text())
    return file


@pytest.fixture
def mat_file(tmp_path):
    file = tmp_path / "z24.mat"
    scipy.io.savemat(file, matlab_fields())
    return file


@pytest.mark.parametrize("form", ["csv_file", "mat_file"])
def test_both_forms_hold_the_same(form, request):
    z24 = load_z24(request.getfixturevalue(form))
    np.testing.assert_allclose(z24.frequencies[MODES], F, rtol=1e-12)
    np.testing.assert_allclose(z24.temperatures[SENSORS], T, rtol=1e-12)
    assert z24.state.tolist() == STATE
    stamps = pd.Timestamp("1997-11-11") + pd.to_timedelta(RECORDS, unit="h")
    for table in (z24.frequencies, z24.temperatures, z24.state):
        assert (table.index == stamps).all()


def test_file_order_is_kept_and_gaps_are_nan(tmp_path):
    header, *rows = csv_text().splitlines()
    rows[4] = rows[4].replace(str(T["TS"][4]), "")
    file = tmp_path / "z24.csv"
    file.write_text("\n".join([header, *rows[::-1]]))
    z24 = load_z24(str(file))
    assert len(z24.frequencies) == N
    np.testing.assert_allclose(z24.frequencies, F[::-1], rtol=1e-12)
    assert np.isnan(z24.temperatures["TS"].iloc[N - 1 - 4])
    assert z24.temperatures.isna().sum().sum() == 1


def test_matlab_without_options_has_consecutive_hours_and_no_state(tmp_path):
    fields = matlab_fields()
    scipy.io.savemat(tmp_path / "z24.mat", {name: fields[name] for name in fields if name not in ("idx", "nc")})
    z24 = load_z24(tmp_path / "z24.mat")
    assert (np.diff(z24.frequencies.index) == pd.Timedelta("1h")).all()
    assert set(z24.state) == {"unknown"}


LINES = csv_text().splitlines()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not a readable CSV file"),
        (LINES[0], "the header has the fields .* and records"),
        ("\n".join(LINES).replace("Tair", "Tsea"), r"expected \['Tair'\] once"),
        ("\n".join(LINES)[:-3], "field 'state', row 11 is 'dama'"),
        ("\n".join(LINES).replace(str(F["f2"][3]), "5,2"), "Expected 13 fields in line 5, saw 14"),
        ("\n".join(LINES)[:-12], "field 'state', row 11 is nan"),
        ("\n".join(LINES).replace(str(F["f2"][3]), "5.2x"), "field 'f2', row 3 is '5.2x'"),
        ("\n".join(LINES).replace(str(T["TS"][7]), "999"), "field 'TS', row 7 is 999.0; expected -60 to 80"),
        ("\n".join(LINES).replace("\n5,", "\n2,"), "field 'record', row 3 repeats 2"),
        ("\n".join(LINES).replace("\n5,", "\n5.5,"), "field 'record', row 3 is 5.5"),
    ],
)
def test_bad_csv_names_file_and_field(tmp_path, text, message):
    (tmp_path / "broken.csv").write_text(text)
    with pytest.raises(ValueError, match=rf"broken\.csv.*({message})"):
        load_z24(tmp_path / "broken.csv")


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"data": None}, "no field 'data'; found"),
        ({"data": np.ones((N, 3))}, r"field 'data' has shape \(12, 3\)"),
        ({"Z24_TS": np.ones((N - 1, 1))}, r"field 'Z24_TS' has shape \(11, 1\); expected \(12, 1\)"),
        ({"Z24_TS": "warm"}, "field 'Z24_TS' is not a full matrix of real numbers"),
        ({"idx": np.ones(40)}, "field 'idx' marks 40 of 40 hours"),
    ],
)
def test_bad_matlab_names_file_and_field(tmp_path, changes, message):
    fields = {name: value for name, value in (matlab_fields() | changes).items() if value is not None}
    scipy.io.savemat(tmp_path / "broken.mat", fields)
    with pytest.raises(ValueError, match=rf"broken\.mat.*{message}"):
        load_z24(tmp_path / "broken.mat")


FUZZ = settings(max_examples=50)


def outcome(file, content):
    """The loaded tables, or what the error says."""
    file.write_bytes(content)
    try:
        return load_z24(file)
    except ValueError as error:
        return str(error)


def check_outcome(file, content):
    """Either a clear error that names the file, or tables in which nothing is impossible."""
    z24 = outcome(file, content)
    if isinstance(z24, str):
        assert file.name in z24
    else:
        assert z24.frequencies.stack().dropna().between(0.1, 100).all()
        assert z24.temperatures.stack().dropna().between(-60, 80).all()
        assert z24.frequencies.index.is_unique
        assert len(z24.frequencies) == len(z24.temperatures) == len(z24.state)


@FUZZ
@given(cut=st.integers(0, 10_000), position=st.integers(0, 10_000), byte=st.integers(0, 255))
def test_damaged_and_truncated_tables_never_become_nonsense(csv_file, cut, position, byte):
    check_damaged(csv_file, cut, position, byte)


@pytest.mark.nightly
@settings(FUZZ, max_examples=2)
@given(cut=st.integers(0, 10_000), position=st.integers(0, 10_000), byte=st.integers(0, 255))
@pytest.mark.parametrize("is_packed", [False, True])
def test_damaged_and_truncated_files_never_become_nonsense(mat_file, is_packed, cut, position, byte):
    scipy.io.savemat(mat_file, matlab_fields(), do_compression=is_packed)
    check_damaged(mat_file, cut, position, byte)


def check_damaged(file, cut, position, byte):
    """One byte changed, and the end cut off."""
    content = bytearray(file.read_bytes())
    content[position % len(content)] = byte
    check_outcome(file.with_name(f"damaged{file.suffix}"), bytes(content))
    check_outcome(file.with_name(f"short{file.suffix}"), file.read_bytes()[: cut % len(content)])


@pytest.mark.skipif("SKTHERMO_DATA" not in os.environ, reason="SKTHERMO_DATA does not name a folder with the real data")
def test_the_real_file():
    z24 = load_z24(Path(os.environ["SKTHERMO_DATA"]) / "z24" / "z24_monitoring.csv")
    assert z24.frequencies.shape == (2930, 4)
    assert z24.temperatures.shape == (2930, 7)
    healthy = z24.frequencies[z24.state == "undamaged"]
    assert len(healthy) == 2800
    np.testing.assert_allclose(healthy.mean(), [4.00, 5.21, 10.15, 10.83], rtol=0.01)
    assert not z24.frequencies.isna().any(axis=None)
