"""What model updating says of wrong input."""

import re
import warnings

import numpy as np
import pytest

from skthermo.datasets import make_truss
from skthermo.fem import CallableModel
from skthermo.updating import ModelUpdater

TRUSS = make_truss()
F = TRUSS.frequencies([np.ones(4)])
SHAPES = TRUSS.modes([np.ones(4)])[1][0][:5]
HOLED = np.where(np.arange(30).reshape(5, 6) == 8, np.nan, SHAPES)
EMPTY = SHAPES * [1, 1, 0, 1, 1, 1]


@pytest.mark.parametrize(
    ("F", "options", "message"),
    [
        (F[:, :5], {}, r"F has 5 columns; expected the 6 modes"),
        (np.hstack([F, F]), {"shapes": SHAPES, "dofs": range(5)}, "F has 12 columns; expected the 6 modes"),
        (F * np.nan, {}, "F is NaN in all 1 records of all 6 modes"),
        (F * [[1, -1, 1, 1, 1, 1]], {}, r"frequency 'f2' of record 0 is -27\.5.*expected Hz above 0, or NaN"),
        (F, {"shapes": SHAPES}, "shapes were given without dofs"),
        (F, {"dofs": range(5)}, "dofs were given without shapes"),
        (F, {"shapes": SHAPES[:4], "dofs": range(5)}, r"shapes have shape \(4, 6\); expected \(5, 6\)"),
        (F, {"shapes": SHAPES, "dofs": [0, 1, 2, 3, 23]}, "dofs holds 23; expected 0 to 22"),
        (F, {"shapes": SHAPES, "dofs": [0, 1, 2, 3, -1]}, "dofs holds -1; expected 0 to 22"),
        (F, {"shapes": SHAPES, "dofs": [0, 1, 2, 3, 3]}, "dofs holds 3 more than once"),
        (F, {"shapes": SHAPES, "dofs": np.arange(5.0)}, "expected integers"),
        (F, {"shapes": HOLED, "dofs": range(5)}, "shape of 'f3' is NaN in row 1 but not in all"),
        (F, {"shapes": EMPTY, "dofs": range(5)}, "shape of 'f3' is zero throughout"),
        (F, {"frequency_std": [0.1, 0.2]}, r"frequency_std has shape \(2,\); expected a number, or one for each"),
        (F, {"frequency_std": [1, 1, 0, 1, 1, 1]}, "frequency_std of 'f3' is 0"),
    ],
)
def test_measurements_that_cannot_be(F, options, message):
    with pytest.raises(ValueError, match=message):
        ModelUpdater(TRUSS).fit(F, **options)


@pytest.mark.parametrize(
    ("parameters", "message"),
    [
        ({"bounds": 1.5}, "half-width between 0 and 1"),
        ({"bounds": [[0.5, 1.5]]}, r"bounds has shape \(1, 2\); expected a half-width or \(4, 2\)"),
        (
            {"bounds": [[0.5, 1.5]] * 3 + [[1.2, 0.8]]},
            "bounds of parameter 'vertical' are .* expected 0 < lowest < highest",
        ),
        (
            {"bounds": [[0.5, 1.5]] * 3 + [[1.2, 1.8]]},
            "bounds of parameter 'vertical' .* expected them to contain 1",
        ),
        ({"shape_weight": 1.0}, "shape_weight is 1.0 but no shapes were given"),
        ({"shape_weight": -1.0}, "shape_weight"),
        ({"prior": 0.0}, "prior"),
        ({"prior": [0.1, 0.1]}, "prior is .* expected relative standard deviations"),
        ({"n_starts": 0}, "n_starts"),
        ({"method": "newton"}, "method"),
    ],
)
def test_settings_that_cannot_be(parameters, message):
    with pytest.raises(ValueError, match=message):
        ModelUpdater(TRUSS, **parameters).fit(F)


def test_shapes_need_a_model_with_local_modes():
    model = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    with pytest.raises(
        ValueError,
        match=r"has no 'local_modes' and no 'n_dof' and no 'track'; .* such as AffineModel",
    ):
        ModelUpdater(model).fit(F, shapes=SHAPES, dofs=range(5))


def test_a_model_that_is_none_is_refused():
    class Frequencies:
        def frequencies(self, theta):
            return theta

    with pytest.raises(ValueError, match="an object with parameter_names, n_modes and frequencies"):
        ModelUpdater(Frequencies()).fit(F)


def test_more_unknowns_than_residuals_warn():
    with pytest.warns(UserWarning, match="4 parameters are to be found from 2 residuals"):
        ModelUpdater(TRUSS).fit(np.where(np.arange(6) < 2, F, np.nan))
    ModelUpdater(TRUSS, prior=0.1).fit(np.where(np.arange(6) < 2, F, np.nan))


def test_a_shape_counts_one_residual_less_than_degrees_of_freedom():
    only_first = np.where(np.arange(6) == 0, F, np.nan)
    shape = np.where(np.arange(6) == 0, SHAPES[:3], np.nan)
    with pytest.warns(UserWarning, match="4 parameters are to be found from 3 residuals"):
        ModelUpdater(TRUSS, shape_weight=1.0).fit(only_first, shapes=shape, dofs=range(3))
    with pytest.warns(UserWarning, match="4 parameters are to be found from 1 residuals"):
        ModelUpdater(TRUSS).fit(only_first, shapes=shape, dofs=range(3))


def test_a_model_without_modes_at_any_start():
    model = CallableModel(lambda row: [np.nan], ["k"], 1)
    with pytest.raises(ValueError, match="no modes at any of the 2 starts"):
        ModelUpdater(model, n_starts=2, random_state=0).fit([[1.0]])


@pytest.mark.parametrize("factor", [2 * np.pi, 1.5])
def test_frequencies_that_no_parameters_explain_are_named(factor):
    units = r".*rad/s instead of Hz" if factor > 2 else ""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        ModelUpdater(TRUSS).fit(factor * TRUSS.frequencies(np.ones((1, 4))))
    texts = [str(warning.message) for warning in caught]
    assert any(re.match(r"the updated model misses \['f1', .*by more than 15 %" + units, text) for text in texts)
    assert any(re.match(r"the optimum lies at the bounds of 'bottom' \(1.3\)", text) for text in texts)
    assert {warning.filename for warning in caught} == {__file__}


def test_residuals_beyond_the_noise_are_named():
    measured = TRUSS.frequencies(np.ones((1, 4)))[0] * [1.0, 1.002, 0.998, 1.001, 1.0, 1.0]
    with pytest.warns(UserWarning, match=r"misses \[.*\] by up to \d+ standard deviations of frequency_std"):
        ModelUpdater(TRUSS).fit(measured, frequency_std=1e-4 * measured)


def test_a_prior_goes_by_name():
    measured = TRUSS.frequencies([[0.9, 1.0, 1.0, 1.0]])
    by_name = {"top": 1e-6, "bottom": 1.0, "diagonal": 1e-6, "vertical": 1e-6}
    in_order = [1.0, 1e-6, 1e-6, 1e-6]
    fits = [ModelUpdater(TRUSS, prior=prior).fit(measured, frequency_std=0.01) for prior in (by_name, in_order)]
    np.testing.assert_array_equal(fits[0].theta_, fits[1].theta_)
    with pytest.raises(ValueError, match=r"prior: \['roof'\] are unknown"):
        ModelUpdater(TRUSS, prior=by_name | {"roof": 1.0}).fit(measured)
