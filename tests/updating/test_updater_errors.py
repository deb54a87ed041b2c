"""What model updating says of wrong input."""

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
        (np.hstack([F, F]), {"shapes": SHAPES, "dofs": range(5)}, "F has 12 columns; expected the 6 modes"),
        (F, {"shapes": HOLED, "dofs": range(5)}, "shape of 'f3' is NaN in row 1 but not in all"),
        (F, {"shapes": EMPTY, "dofs": range(5)}, "shape of 'f3' is zero throughout"),
    ],
)
def test_measurements_that_cannot_be(F, options, message):
    with pytest.raises(ValueError, match=message):
        ModelUpdater(TRUSS).fit(F, **options)


def test_shapes_need_a_model_with_local_modes():
    model = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    with pytest.raises(
        ValueError,
        match=r"has no 'local_modes' and no 'n_dof' and no 'track'; .* such as AffineModel",
    ):
        ModelUpdater(model).fit(F, shapes=SHAPES, dofs=range(5))


def test_a_prior_goes_by_name():
    measured = TRUSS.frequencies([[0.9, 1.0, 1.0, 1.0]])
    by_name = {"top": 1e-6, "bottom": 1.0, "diagonal": 1e-6, "vertical": 1e-6}
    in_order = [1.0, 1e-6, 1e-6, 1e-6]
    fits = [ModelUpdater(TRUSS, prior=prior).fit(measured, frequency_std=0.01) for prior in (by_name, in_order)]
    np.testing.assert_array_equal(fits[0].theta_, fits[1].theta_)
