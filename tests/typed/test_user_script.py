"""Annotated results are what callables return: every statement about types holds at run time."""

import copy
import pickle
import runpy
import typing
from pathlib import Path

import pytest
from sklearn.utils import Bunch

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import sample
from skthermo.updating import identifiability

SCRIPT = Path(__file__).with_name("user_script.py")


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:1 of 122.*not-evaluated")  # the first, whose window is not full
def test_what_type_checkers_infer_is_true_at_run_time(monkeypatch):
    checked = []

    def check(value, kind):
        assert isinstance(value, typing.get_origin(kind) or kind)
        if typing.get_origin(kind) is not None and hasattr(value, "dtype"):
            assert value.dtype == typing.get_args(typing.get_args(kind)[1])[0]
        checked.append(kind)
        return value

    monkeypatch.setattr(typing, "assert_type", check)
    runpy.run_path(str(SCRIPT))
    assert len(checked) == SCRIPT.read_text().count("\nassert_type(") > 50


RESULTS = {
    "campaign": make_truss_campaign(samples_per_year=10, random_state=0),
    "samples": sample(make_truss(), 0.2, 3, dofs=[1, 3], random_state=0),
    "identifiability": identifiability(make_truss(), noise=0.01),
}


@pytest.mark.parametrize("result", RESULTS.values(), ids=list(RESULTS))
def test_typed_results_are_bunches(result):
    assert isinstance(result, Bunch)
    assert not set(vars(type(result))) & set(result), "a class attribute would hide the value"
    assert set(typing.get_type_hints(type(result))) == set(result)
    if type(result).__repr__ is Bunch.__repr__:
        assert repr(result) == dict.__repr__(result)
    else:
        assert repr(result).startswith(result.summary())
    for twin in (pickle.loads(pickle.dumps(result)), copy.copy(result)):
        assert type(twin) is type(result)
        assert list(twin) == list(result)
        assert all(getattr(twin, name) is twin[name] for name in twin)
