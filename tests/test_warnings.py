"""Warnings are of a few kinds, which Python's filters distinguish, and leave nothing behind."""

import pickle
import re
import threading
import warnings
from copy import deepcopy

import numpy as np
import pytest
from sklearn.inspection import partial_dependence, permutation_importance

from skthermo._core.warnings import (
    counted_warnings,
    explain_rows,
    explained_rows,
    reported_by_caller,
    warn_user,
    warnings_once,
)
from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.exceptions import FewRecordsWarning, WeatherWarning
from skthermo.surrogate import DataInformedFEM


def test_filters_tell_kinds_apart_and_point_to_the_line_of_the_user():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warnings.simplefilter("ignore", WeatherWarning)
        with warnings_once("more"):
            for number in range(3):
                warn_user("it is hot", WeatherWarning, "weather")
                warn_user(f"{number} records", FewRecordsWarning, "few-rows")
    assert [(one.category, one.filename) for one in caught] == [(FewRecordsWarning, __file__)]
    assert re.fullmatch(r"0 records .and 2 times more more. \[few-rows\]", str(caught[0].message))
    with warnings.catch_warnings():
        warnings.simplefilter("error", WeatherWarning)
        with pytest.raises(WeatherWarning):
            warn_user("it is hot", WeatherWarning, "weather")


def test_the_code_ends_the_text_once_however_often_a_warning_is_repeated_or_counted():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with warnings_once("outside") as outside:
            for _ in range(2):
                with warnings_once("inside"):
                    for number in range(3):
                        warn_user(f"{number} records", FewRecordsWarning, "few-rows")
    (one,) = caught
    assert [str(one.message)] == outside
    assert re.fullmatch(r"0 records \(.*inside\) \(.*outside\) \[few-rows\]", outside[0])
    again = pickle.loads(pickle.dumps(one.message))
    assert (str(again), again.kind) == (outside[0], "few-rows")
    with counted_warnings() as counts:
        for _ in range(3):
            warnings.warn(FewRecordsWarning("few", "few-rows"), stacklevel=1)
    assert counts == {("few-rows", "few"): 3}


def test_what_is_explained_stays_so_after_the_estimator_around():
    rows = np.array([True, False])
    with reported_by_caller(["few-rows"]):
        table = explain_rows(np.array([np.nan, 1.0]), rows)
        warn_user("few", FewRecordsWarning, "few-rows")
    assert explained_rows(table).tolist() == [True, False]
    assert not explained_rows(table.copy())
    table[0] = 1.0
    assert not explained_rows(table).any()
    with pytest.warns(FewRecordsWarning):
        warn_user("few", FewRecordsWarning, "few-rows")


def test_an_inspection_warns_once_for_each_estimator_and_line():
    year = make_truss_campaign(random_state=0)
    T, F = year.temperatures, year.frequencies
    one = DataInformedFEM(make_truss(), random_state=0).fit(T[:120], F[:120])  # a winter, and summer is outside
    other = deepcopy(one)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        for estimator in (one, other, one):
            permutation_importance(estimator, T, F, n_repeats=2, random_state=0)
        partial_dependence(one, T, ["T1"], grid_resolution=3)
    assert [warning.message.kind for warning in caught] == ["outside-training-weather"] * 3
    assert len({warning.lineno for warning in caught}) == 2
    for _ in range(2):
        with pytest.warns(WeatherWarning):
            one.predict(T)


def test_another_thread_has_a_context_of_its_own():
    table = explain_rows(np.array([np.nan]), np.array([True]))
    found = []
    thread = threading.Thread(target=lambda: found.append(explained_rows(table)))
    thread.start()
    thread.join()
    assert explained_rows(table).all()
    assert not found[0]
