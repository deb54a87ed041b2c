"""Reading KW51's monitoring: files as they were published, in every way that MATLAB may have stored them; bad ones."""

import re

import numpy as np
import pandas as pd
import pytest
import scipy.io
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from skthermo.datasets import load_kw51
from tests.datasets.kw51_file import CHANNELS, SENSORS, cell, kw51_bytes, kw51_fields, write_kw51
from tests.nights import by_day

FUZZ = settings(max_examples=by_day(12, at_night=60))
NOT_PUBLISHED = pytest.mark.filterwarnings("ignore:.*read-as:UserWarning")


def check_equal(data, fields):
    """What was loaded is what was written, to the bit."""
    np.testing.assert_array_equal(data.frequencies, fields["f"])
    np.testing.assert_array_equal(data.damping, fields["xi"])
    np.testing.assert_array_equal(data.temperatures, fields["env"])
    np.testing.assert_array_equal(data.shapes, fields["m"])
    assert data.sensors == fields["labels_m"].ravel().tolist()
    assert list(data.temperatures) == fields["labels_env"].ravel().tolist()
    for table in (data.frequencies, data.damping, data.state):
        assert table.index.equals(data.temperatures.index)
    assert len(data.state) == len(data.shapes) == len(data.temperatures)


def write(file, fields, **options):
    file.write_bytes(kw51_bytes(fields, **options))
    return file


@pytest.fixture
def file(tmp_path):
    return tmp_path / "trackedmodes.mat"


@pytest.mark.parametrize("compressed", [False, True])
def test_a_file_is_read_as_it_was_written(file, compressed):
    fields = write_kw51(file, n_records=30, compressed=compressed)
    data = load_kw51(str(file))
    check_equal(data, fields)
    assert data.is_published is None
    assert data.temperatures.index.name == "time"
    assert (data.temperatures.index == pd.date_range("2018-10-01", periods=30, freq="h")).all()
    assert list(data.frequencies) == [f"f{number}" for number in range(1, 15)]
    assert list(data.damping) == [f"xi{number}" for number in range(1, 15)]


@pytest.mark.parametrize("name", ["trackedmodes.zip", "download"])
def test_a_zip_file_of_any_name_says_that_it_is_not_the_published_one(tmp_path, name):
    file = write(tmp_path / name, kw51_fields(), zipped=True)
    with pytest.warns(UserWarning, match=rf"{name}.*read-as") as caught:
        data = load_kw51(file)
    assert len(caught) == 1
    assert caught[0].filename == __file__
    assert data.is_published is False
    check_equal(data, kw51_fields())


def test_time_stamps_are_rounded_to_seconds(file):
    stamps = pd.DatetimeIndex(["2019-02-28 23:00:00.2", "2019-03-01 00:59:59.9", "2019-03-01 01:00:30.6"])
    write_kw51(file, n_records=3, times=stamps)
    assert (load_kw51(file).state.index == stamps.round("s")).all()


FORMS = {
    "another order": lambda fields: dict(reversed(fields.items())),
    "another field": lambda fields: {"note": "text", "settings": {"a": 1.0}} | fields,
    "row of times": lambda fields: fields | {"sdn": fields["sdn"].T},
    "columns of labels": lambda fields: fields | {"labels_m": cell(SENSORS, is_column=True)},
    "characters": lambda fields: fields | {"labels_env": np.array(CHANNELS)},
    "nested cells": lambda fields: fields | {"labels_env": cell([cell([label]) for label in CHANNELS])},
    "cells of a cell": lambda fields: fields | {"labels_m": cell([cell(SENSORS)])},
    "complex": lambda fields: fields | {"f": fields["f"] + 0j},
    "single": lambda fields: fields | {"env": fields["env"].astype("f4")},
}


@pytest.mark.parametrize("form", FORMS)
def test_forms_in_which_matlab_may_have_stored_it(file, form):
    fields = kw51_fields()
    write(file, FORMS[form](fields))
    if form == "single":
        fields["env"] = fields["env"].astype("f4").astype(float)
    check_equal(load_kw51(file), fields)


@FUZZ
@given(data=st.data(), n_records=st.integers(1, 5), n_modes=st.integers(1, 4), n_sensors=st.integers(1, 3))
def test_any_campaign_that_is_written_is_read_back_equal(file, data, n_records, n_modes, n_sensors):
    def drawn(shape, lowest, highest):
        return data.draw(arrays(float, shape, elements=st.floats(lowest, highest) | st.just(np.nan)))

    modes = (n_records, n_modes)
    hours = data.draw(st.lists(st.integers(0, 11327), min_size=n_records, max_size=n_records, unique=True))
    times = pd.Timestamp("2018-10-01") + pd.to_timedelta(hours, unit="h")
    fields = kw51_fields(
        frequencies=drawn(modes, 0.1, 100),
        damping=drawn(modes, -1, 1),
        shapes=drawn((*modes, n_sensors), -2, 2) + 1j * drawn((*modes, n_sensors), -2, 2),
        temperatures=drawn((n_records, data.draw(st.integers(1, 3))), -50, 80),
        times=times,
    )
    write(file, fields, compressed=data.draw(st.booleans()))
    loaded = load_kw51(file)
    check_equal(loaded, fields)
    assert (loaded.state.index == times).all()


def replaced(name, place, value):
    values = kw51_fields()[name].copy()
    values[place] = value
    return {name: values}


N = 12
SHAPE = r"\(12, 14, 12\)"
BAD = [
    ({"xi": None}, r"no field \['xi'\] in 'modes'; found \['env', 'f', "),
    ({"f": "text"}, "field 'f' is text, a cell array, a struct or sparse; expected a full array"),
    ({"f": np.ones((N, 13))}, r"field 'xi' has shape \(12, 14\); expected \(12, 13\)"),
    ({"sdn": np.ones((N + 1, 1))}, r"field 'sdn' has shape \(13, 1\); expected \(12, 1\)"),
    ({"m": np.ones((N, 12, 14))}, rf"field 'm' has shape \(12, 12, 14\); expected {SHAPE}"),
    ({"env": np.ones((N, 10))}, r"field 'env' has shape \(12, 10\); expected \(12, 11\)"),
    ({"labels_m": cell(SENSORS[:-1])}, rf"field 'm' has shape {SHAPE}; expected \(12, 14, 11\)"),
    ({"labels_m": np.ones((N, 1))}, "field 'labels_m' holds something else than texts"),
    (replaced("sdn", 3, np.nan), "field 'sdn', row 3 is nan; expected a MATLAB date number"),
    (replaced("sdn", 3, kw51_fields()["sdn"][1]), "field 'sdn', row 3 repeats 2018-10-01 01:00:00"),
    (replaced("f", (2, 5), 0.01), "field 'f', row 2, column 'f6' is 0.01; expected 0.1 to 100, or NaN"),
    (replaced("xi", (0, 1), 1.5), "field 'xi', row 0, column 'xi2' is 1.5; expected -1 to 1, or NaN"),
    (replaced("env", (4, 0), 85), "field 'env', row 4, column 'tBD31A' is 85; expected -60 to 80"),
    (replaced("m", (4, 3, 1), 1j * np.inf), "field 'm', sensor 'aBD17Ay', row 4, column 'f4' is inf"),
]


def test_bad_content_names_file_field_and_place(tmp_path):
    for changes, message in BAD:
        fields = {name: value for name, value in (kw51_fields() | changes).items() if value is not None}
        with pytest.raises(ValueError, match=r"broken\.mat: ") as caught:
            load_kw51(write(tmp_path / "broken.mat", fields))
        assert re.search(message, str(caught.value)), f"{message}: {caught.value}"


def test_a_doubtful_weather_channel_does_not_hide_the_rest(tmp_path):
    file = write(tmp_path / "modes.mat", kw51_fields() | replaced("env", (4, 5), -999))
    with pytest.warns(UserWarning, match=r"'env' .*row 4, column 'grVL'.*-999.*\[doubtful-values\]"):
        data = load_kw51(file)
    assert data.temperatures["grVL"].iloc[4] == -999


def test_files_of_another_kind_are_refused(tmp_path):
    file = tmp_path / "other.mat"
    with pytest.raises(FileNotFoundError, match=r"other\.mat is not a file"):
        load_kw51(file)
    with pytest.raises(FileNotFoundError, match="is not a file"):
        load_kw51(tmp_path)
    scipy.io.savemat(file, {"data": np.ones((2, 2)), "nc": 1})
    with pytest.raises(ValueError, match=r"other\.mat: the variables are \['data', 'nc'\]; expected a struct 'modes'"):
        load_kw51(file)
    file.write_bytes(b"")
    with pytest.raises(ValueError, match=r"other\.mat: not readable as MATLAB v5 \(another format"):
        load_kw51(file)
    for modes in (np.ones((2, 2)), "text"):
        with pytest.raises(ValueError, match=r"other\.mat: 'modes' is no single struct; expected a struct"):
            load_kw51(write(file, modes))
    several = np.zeros((2, 1), dtype=[(name, "O") for name in kw51_fields()])
    with pytest.raises(ValueError, match=r"other\.mat: 'modes' is no single struct"):
        load_kw51(write(file, several))


def outcome(file, content):
    """The loaded tables, or what the error says."""
    file.write_bytes(content)
    try:
        return load_kw51(file)
    except ValueError as error:
        return str(error)


SMALL = kw51_fields(frequencies=np.full((3, 2), 2.0), shapes=np.ones((3, 2, 2)) * 1j, channels=CHANNELS[:3])


@NOT_PUBLISHED
@settings(FUZZ, max_examples=by_day(2, at_night=5))
@given(
    form=st.sampled_from(["mat", "packed", "zip"]), place=st.integers(0, 10**6), byte=st.none() | st.integers(0, 255)
)
def test_damaged_and_truncated_files_never_become_nonsense(tmp_path, form, place, byte):
    content = bytearray(kw51_bytes(SMALL, compressed=form == "packed", zipped=form == "zip"))
    if byte is None:
        del content[place % len(content) :]
    else:
        content[place % len(content)] = byte
    file = tmp_path / f"damaged.{'zip' if form == 'zip' else 'mat'}"
    data = outcome(file, bytes(content))
    if isinstance(data, str):
        assert file.name in data
    else:
        assert data.frequencies.stack().dropna().between(0.1, 100).all()
        assert data.temperatures.filter(regex="tBD31A|tVL").stack().dropna().between(-60, 80).all()
        assert not np.isinf(data.shapes).any()
        assert data.state.index.is_unique
        assert data.shapes.shape == (*data.frequencies.shape, len(data.sensors))
        assert len(data.temperatures) == len(data.damping) == len(data.state) == len(data.shapes)
