"""Scripts from docs and examples give what they gave with 0.2.0 on the same input, within the tolerances kept with it.

``results.json`` has the results of 0.2.0 and how long each script took then (see ``run.py``). Slow ones are nightly.
"""

import json
from pathlib import Path

import numpy as np
import pytest

from tests.contract.run import run, scripts

KEPT = json.loads(Path(__file__).with_name("results.json").read_text(encoding="utf-8"))
SLOW = 0.55  # seconds of a processor


def marked(name):
    return pytest.param(name, marks=pytest.mark.nightly if KEPT[name]["seconds"] > SLOW else ())


def differences(found, kept, rtol, atol, place=""):
    """Where two results differ: in keys, lengths, texts, or in numbers by more than the tolerances."""
    if isinstance(kept, dict) and isinstance(found, dict) and set(found) == set(kept):
        pairs = [(found[key], kept[key], f"{place} {key}") for key in kept]
    elif isinstance(kept, list) and isinstance(found, list) and len(found) == len(kept):
        pairs = [(*pair, f"{place} {number}") for number, pair in enumerate(zip(found, kept, strict=True))]
    else:
        pairs = []
        if not same(found, kept, rtol, atol):
            yield f"{place.strip()}: {found!r:.200}; with 0.2.0 {kept!r:.200}"
    for one, other, where in pairs:
        yield from differences(one, other, rtol, atol, where)


def same(found, kept, rtol, atol):
    is_number = [isinstance(one, int | float) and not isinstance(one, bool) for one in (found, kept)]
    if all(is_number):
        return bool(np.isclose(found, kept, rtol=rtol, atol=atol))
    return type(found) is type(kept) and found == kept


@pytest.mark.parametrize("name", map(marked, sorted(KEPT)))
def test_a_script_gives_what_it_gave(name):
    found = run(name)
    assert set(found) == set(KEPT[name]["results"])
    differ = [
        line
        for result, kept in KEPT[name]["results"].items()
        for line in differences(found[result]["value"], kept["value"], kept["rtol"], kept["atol"], result)
    ]
    assert not differ, "\n".join(differ)


def test_each_script_has_results_of_0_2_0():
    assert sorted(KEPT) == sorted(scripts())


def test_differences_are_found():
    kept = {"a": [1.0, "text"], "b": {"c": True}}
    assert not [*differences({"a": [1.001, "text"], "b": {"c": True}}, kept, 0.01, 0)]
    for other in ({"a": [1.1, "text"], "b": {"c": True}}, {"a": [1.0, "no"], "b": {"c": True}}, {"a": [1.0, "text"]}):
        assert len([*differences(other, kept, 0.01, 0)]) == 1
    assert [*differences({"a": [1.0, "text"], "b": {"c": 1}}, kept, 0.01, 0)]
