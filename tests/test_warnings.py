"""Warnings are of a few kinds, which Python's filters distinguish, at the line of the user."""

import pickle
import warnings
from collections import Counter

import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline

from skthermo._core.warnings import one_of_each_kind
from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.exceptions import FewRecordsWarning, RecordsWarning, SkthermoWarning, WeatherWarning
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

YEAR = make_truss_campaign(samples_per_year=90, random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies.copy()
F.iloc[5, 2] = -999.0  # what a logger writes in place of a missing value
CHAIN = DataInformedFEM(make_truss(), mapper=TemperatureMapper(Ridge()), random_state=0)
COMPENSATED = make_pipeline(TemperatureCompensator(Ridge(), targets=list(F)), MahalanobisDetector())
FITS = {
    "chain": lambda: clone(CHAIN).fit(T, F),
    "compensator": lambda: clone(COMPENSATED[0]).fit(T.join(F)),
    "detector": lambda: MahalanobisDetector().fit(F),
    "pipeline": lambda: clone(COMPENSATED).fit(T.join(F)),
}


def given(*calls, action="always"):
    """The warnings of skthermo that calls give."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter(action)
        for call in calls:
            call()
    return [one for one in caught if isinstance(one.message, SkthermoWarning)]


@pytest.mark.nightly
@pytest.mark.parametrize("action", ["default", "always"])
def test_two_lines_that_fit_warn_twice(action):
    lines = [
        lambda: MahalanobisDetector().fit(F),
        lambda: clone(COMPENSATED).fit(T.join(F)),
        lambda: clone(COMPENSATED).fit(T.join(F)),
        lambda: clone(CHAIN).fit(T, F),
        lambda: clone(CHAIN).fit(T, F),
    ]
    found = [one for one in given(*lines, action=action) if "set-aside" in one.message.kind]
    assert [(one.filename, one.lineno) for one in found] == [
        (line.__code__.co_filename, line.__code__.co_firstlineno) for line in lines
    ]


@pytest.mark.parametrize("fit", FITS.values(), ids=FITS)
def test_a_fit_warns_at_most_once_of_a_kind_and_equal_records_in_equal_words(fit):
    found = given(fit)
    kinds = Counter(one.message.kind for one in found)
    assert sum(times for kind, times in kinds.items() if "set-aside" in kind) == 1
    assert max(kinds.values()) == 1
    assert [str(one.message) for one in given(fit)] == [str(one.message) for one in found]


def test_findings_of_one_kind_are_one_warning_that_hides_none():
    findings = [FewRecordsWarning(text, "few-records") for text in ("a", "b", "a", "c", "d", "e")]
    others = [RecordsWarning("z", "set-aside")]
    joined, alone = one_of_each_kind([*findings, *others])
    assert (str(alone), type(joined), joined.kind) == ("z [set-aside]", FewRecordsWarning, "few-records")
    assert all(text in joined.args[0] for text in ("a", "b", "c", "2 more"))
    assert one_of_each_kind(findings[:1])[0].args == findings[0].args


def test_filters_tell_categories_apart():
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        warnings.simplefilter("error", WeatherWarning)
        MahalanobisDetector().fit(F)
        warnings.simplefilter("error", RecordsWarning)
        with pytest.raises(RecordsWarning, match=r"set-aside\]$"):
            MahalanobisDetector().fit(F)


def test_the_code_ends_the_text_also_of_a_copy():
    warning = FewRecordsWarning("3 records", "few-records")
    again = pickle.loads(pickle.dumps(warning))
    assert (str(again), again.kind) == (str(warning), "few-records") == ("3 records [few-records]", "few-records")
