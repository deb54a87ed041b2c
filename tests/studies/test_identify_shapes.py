"""Mode shapes as data for explanations."""

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies import identify_damage

TRUSS, DOFS = make_truss(), [1, 3, 5, 10, 16, 22]
random = np.random.RandomState(0)


def noisy(shapes, n_records, deviation=0.01, random=random):
    largest = np.abs(shapes).max(axis=0)
    return shapes + deviation * largest * random.standard_normal((n_records, *shapes.shape))


@pytest.fixture(scope="module")
def later():
    return make_truss_campaign(damage={"vertical": 0.3}, samples_per_year=120, random_state=1)


def test_shapes_find_what_frequencies_hardly_show(fem, later):
    """The vertical members of the truss: their damage moves no frequency by as much as the noise."""
    records, seed = (later.temperatures, later.frequencies), np.random.RandomState(2)
    states = (TRUSS, TRUSS.damaged({"vertical": 0.3}))
    shapes = tuple(noisy(model.modes(np.ones((1, 4)))[1][0][DOFS], 8, random=seed) for model in states)
    with pytest.warns(UserWarning, match="vertical"):
        without = identify_damage(fem, *records, random_state=0)
    found = identify_damage(fem, *records, shapes=shapes, dofs=DOFS, shape_noise="fitted", random_state=0)
    assert found.most_probable == ("vertical",)
    assert found.table.loc["vertical", "probability"] > max(0.95, without.table.loc["vertical", "probability"])
    bands = [table.loc["vertical", ["ci_low", "ci_high"]] for table in (found.table, without.table)]
    assert bands[0]["ci_low"] < 0.3 < bands[0]["ci_high"]
    assert np.diff(bands[0]) < 0.5 * np.diff(bands[1])
    precision = found.separability.precision
    alone = without.separability.precision
    np.testing.assert_allclose(precision["together_without_shapes"], alone["together"], rtol=1e-9)
    assert list(alone.columns) == ["alone", "together"]
    for name in ("alone", "together"):
        assert (precision[name] < precision[f"{name}_without_shapes"]).all()
    assert precision.loc["vertical", "alone"] < 0.5 * precision.loc["vertical", "alone_without_shapes"]
