"""A search steps back from where the model has no modes, and says when it has not converged."""

import warnings

import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import AffineModel, CallableModel
from skthermo.updating import ModelUpdater, sensitivity

TRUSS = make_truss()
INSIDE, OUTSIDE = np.array([0.97, 1.1, 0.95, 1.05]), np.array([0.9, 1.1, 0.95, 1.05])
METHODS = ("least_squares", "lbfgs")


def half_truss(lowest=0.95):
    """The truss, which has no modes where its first multiplier is low."""

    def frequencies(theta):
        return np.where(theta[:, :1] > lowest, TRUSS.frequencies(theta), np.nan)

    return CallableModel(frequencies, TRUSS.parameter_names, 6, vectorized=True)


@pytest.mark.parametrize("method", METHODS)
def test_a_box_that_is_not_positive_definite_throughout(method):
    model = AffineModel({("a",): [[2, -1], [-1, 2]], ("b",): [[0, 0], [0, -1]]}, np.eye(2), n_modes=2)
    truth = [0.8, 1.1]
    options = {"bounds": [[0.5, 1.6], [0.3, 2.0]], "n_starts": 8, "random_state": 0}
    updater = ModelUpdater(model, method=method, **options).fit(model.frequencies([truth]))
    starts = updater.starts_
    np.testing.assert_allclose(updater.theta_, truth, atol=1e-4)
    assert (starts["objective"][starts["success"]] < 1e-8).all()
    solvable = [1.5 * a > b for a, b in starts["start"]]  # det K = a (3 a - 2 b)
    assert starts["success"].tolist() == solvable
    assert not all(solvable)


def test_differences_are_one_sided_beside_theta_without_modes():
    theta = [0.9501, 1.0, 1.0, 1.0]
    with pytest.warns(UserWarning, match="no-solution"):
        found = sensitivity(half_truss(), theta, step=1e-3)
    exact = sensitivity(TRUSS, theta)
    np.testing.assert_allclose(found, exact, atol=1e-3)
    np.testing.assert_allclose(found.iloc[:, 1:], exact.iloc[:, 1:], atol=1e-5)


@pytest.mark.parametrize(("missing", "with_shapes"), [([], False), ([1, 4], True)], ids=["frequencies", "and shapes"])
def test_a_reduced_model_warns_once_of_an_optimum_outside_its_box(missing, with_shapes):
    reduced = TRUSS.reduced(0.05, random_state=0)
    for truth, n_warnings in ((OUTSIDE, 1), (np.array([0.97, 1.04, 0.98, 1.02]), 0)):
        frequencies, shapes = TRUSS.modes([truth])
        frequencies[:, missing] = np.nan
        measured = {"shapes": shapes[0], "dofs": range(TRUSS.n_dof)} if with_shapes else {}
        updater = ModelUpdater(reduced, shape_weight=100.0 * with_shapes, n_starts=3, random_state=0)
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            updater.fit(frequencies, **measured)
        assert ["outside the bounds" in str(warning.message) for warning in caught] == [True] * n_warnings
        assert [warning.filename for warning in caught] == [__file__] * n_warnings


class BareModel:
    """A third party's model, which has no frequencies where its first multiplier is low, and knows no `quiet`."""

    parameter_names, n_modes = TRUSS.parameter_names, 6

    def frequencies(self, theta):
        return half_truss().frequencies(theta)


def failing_program(theta):
    if np.atleast_2d(theta)[:, 0].min() <= 0.95:
        raise ZeroDivisionError("the mesh has a hole")
    return TRUSS.frequencies(np.atleast_2d(theta))


FAILING = {
    "row by row": ("least_squares", CallableModel(failing_program, TRUSS.parameter_names, 6)),
    "many rows": ("least_squares", CallableModel(failing_program, TRUSS.parameter_names, 6, vectorized=True)),
    "NaN": ("lbfgs", half_truss()),
    "no quiet": ("lbfgs", BareModel()),
}


@pytest.mark.parametrize(("method", "model"), FAILING.values(), ids=FAILING)
def test_a_program_that_fails_at_many_theta_gives_one_warning_where_its_optimum_is_there(method, model):
    updater = ModelUpdater(model, method=method, n_starts=3, random_state=0).fit(TRUSS.frequencies([INSIDE]))
    np.testing.assert_allclose(updater.theta_, INSIDE, atol=1e-4)
    starts = updater.starts_
    assert starts["success"].tolist() == [start[0] > 0.95 for start in starts["start"]]
    with pytest.warns(UserWarning, match="poor-fit") as caught:
        updater.fit(TRUSS.frequencies([OUTSIDE]))
    starts = updater.starts_
    best = starts.loc[starts["objective"].idxmin()]
    assert len(caught) == 1
    assert "met theta without modes" in str(caught[0].message)
    assert not starts["success"].any()
    assert updater.theta_[0] == pytest.approx(0.95, abs=1e-3)
    assert 0 < best["n_failed"] < best["n_evaluations"]
    assert starts["n_failed"][starts["objective"] == np.inf].eq(1).all()


def test_a_program_that_always_fails_is_quoted():
    model = CallableModel(lambda row: 1 / 0, ["k"], 1)
    with (
        pytest.warns(UserWarning, match="ZeroDivisionError: division by zero") as caught,
        pytest.raises(ValueError, match="no modes at any of the 2 starts"),
    ):
        ModelUpdater(model, n_starts=2, random_state=0).fit([[1.0]])
    assert len(caught) == 1
