"""Pages of the gallery that are run at night: what they find, draw and write."""

import re

import numpy as np
import pytest

from skthermo.datasets import make_kw51
from tests.examples.pages import recipes, run

pytestmark = pytest.mark.nightly
APPENDIX = recipes("kw51_appendix")


def test_every_member_of_kw51_is_drawn_and_modes_are_named_by_what_moves_most(tmp_path):
    page = run("kw51_model", "--figures", tmp_path)
    structure = page["structure"]
    drawn = set().union(*(structure.groups[group] for group in [*page["WIDTHS"], "plate", "ballast"]))
    assert drawn == set(structure.members)
    for part, direction, name in (("deck", "z", "deck up and down"), ("arch", "y", "arches sideways")):
        shape = [9.0 if (node[0], along) == (part, direction) else 1.0 for node, along in structure.dofs]
        assert page["kind"](structure, np.array(shape)) == name
    assert sorted(path.name for path in tmp_path.iterdir()) == ["kw51_model_1.png", "kw51_model_2.png"]


def test_model_updating_finds_what_was_put_in_and_shapes_make_every_parameter_more_certain(tmp_path):
    page = run("model_updating", "--starts", 4, "--figures", tmp_path)
    updater = page["updaters"]["frequencies and shapes"]
    errors = (updater.theta_ - [*page["TRUTH"].values()]) / np.sqrt(np.diag(updater.covariance_))
    assert np.abs(errors).max() < 3
    alone, both = (known.deviations for known in page["predicted"].values())
    assert (both < alone).all()


def test_the_report_names_the_damaged_group(tmp_path):
    run("owner_report", "--figures", tmp_path / "figures")
    text = (tmp_path / "figures" / "truss_report.html").read_text(encoding="utf-8")
    found = re.search(r"loss of (\d+)\s% of stiffness in bottom", text)
    assert abs(float(found[1]) - 25) <= 1
    for group, severity in (("bottom", 20), ("top", 30), ("diagonal", 15)):
        assert int(re.search(rf"<strong>{group}:</strong>[^<]*?(\d+)\xa0%", text)[1]) == severity


@pytest.fixture(scope="module")
def tracked():
    """KW51 within the widest limits."""
    return APPENDIX.bridge(True, APPENDIX.bounds(E_bot=0.3))


@pytest.fixture(scope="module")
def followed(tracked):
    return APPENDIX.update(tracked, APPENDIX.bounds(), 2)


def test_the_design_variables_are_those_of_the_model(tracked):
    theta = np.linspace(0.9, 1.1, 11)
    model = make_kw51(list(APPENDIX.DESIGN))
    for ours, theirs in zip(tracked.matrices(theta), model.matrices(theta), strict=True):
        np.testing.assert_allclose(ours.toarray(), theirs.toarray(), rtol=1e-9)


def mean_error(updater, when="after"):
    return updater.table_[f"error_{when}"].abs().mean()


def test_updating_brings_kw51_to_the_measured_frequencies(tracked, followed):
    followed, _ = followed
    wide, _ = APPENDIX.update(tracked, APPENDIX.bounds(E_bot=0.3), 1)
    assert mean_error(followed, "before") > 6
    assert mean_error(followed) < 2.5
    assert mean_error(wide) < 1.2
    assert (followed.starts_["optimum"] == 0).all()
    assert np.isinf(np.diag(followed.covariance_)).any()  # six frequencies cannot tell eleven parameters


def test_the_better_fit_of_sorted_modes_is_refused(followed):
    followed, messages = followed
    false, refused = APPENDIX.update(APPENDIX.bridge(False, APPENDIX.bounds()), APPENDIX.bounds(), 2)
    assert false.starts_["objective"].min() < followed.starts_["objective"].min()
    assert not messages
    assert len(refused) == 1
    assert "['f4', 'f5']" in refused[0]
