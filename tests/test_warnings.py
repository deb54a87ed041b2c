"""Warnings are of a few kinds, which Python's filters tell apart, and leave nothing behind."""

import ast
import re
import threading
import warnings
from pathlib import Path

import numpy as np
import pytest

import skthermo
from skthermo import exceptions
from skthermo._estimators.warnings import (
    KINDS,
    category_of,
    explain_rows,
    explained_rows,
    told_around,
    warn_user,
    warnings_once,
)
from skthermo.exceptions import FewRecordsWarning, SkthermoWarning, WeatherWarning

SOURCE = Path(skthermo.__file__).parent


def beginnings():
    """Kinds of the warnings in the source, up to what differs from case to case."""
    for path in SOURCE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Call) and getattr(node.func, "id", None) == "warn_user":
                kind = node.args[1] if len(node.args) > 1 else node.keywords[0].value
                text = ast.literal_eval(kind) if isinstance(kind, ast.Constant) else ast.unparse(kind)[2:].split("{")[0]
                if path.name != "warnings.py":
                    yield text


def test_every_warning_is_of_one_kind():
    assert set(exceptions.__all__) == {category.__name__ for category in KINDS}
    unknown = {one for one in beginnings() if category_of(one) is SkthermoWarning}
    assert unknown == set(KINDS[SkthermoWarning].split(", "))


def test_kinds_that_others_begin_with_are_told_apart():
    assert category_of("weather outside the training range") is WeatherWarning
    assert category_of("weather").__name__ == "RecordsWarning"
    assert category_of("few independent records") is FewRecordsWarning


def test_filters_tell_kinds_apart_and_point_to_the_line_of_the_user():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", WeatherWarning)
        with warnings_once("more"):
            for number in range(3):
                warn_user("it is hot", "weather outside the training range")
                warn_user(f"{number} records", "few rows")
    assert [(one.category, one.filename) for one in caught] == [(FewRecordsWarning, __file__)]
    assert re.fullmatch("0 records .and 2 times more more.", str(caught[0].message))
    with warnings.catch_warnings():
        warnings.simplefilter("error", WeatherWarning)
        with pytest.raises(WeatherWarning):
            warn_user("it is hot", "weather of folds")


def test_what_is_explained_stays_so_after_the_estimator_around():
    rows = np.array([True, False])
    with told_around(["few rows"]):
        table = explain_rows(np.array([np.nan, 1.0]), rows)
        warn_user("few", "few rows")
    assert explained_rows(table).tolist() == [True, False]
    assert not explained_rows(table.copy())
    table[0] = 1.0
    assert not explained_rows(table).any()
    with pytest.warns(FewRecordsWarning):
        warn_user("few", "few rows")


def test_another_thread_has_a_context_of_its_own():
    table = explain_rows(np.array([np.nan]), np.array([True]))
    found = []
    thread = threading.Thread(target=lambda: found.append(explained_rows(table)))
    thread.start()
    thread.join()
    assert explained_rows(table).all()
    assert not found[0]
