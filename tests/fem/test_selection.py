"""Models of other modes and of fewer parameters; matching with measured modes."""

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss, make_z24
from skthermo.fem import AffineModel, mac, match_modes, sample

TRUSS, Z24 = make_truss(8), make_z24(6)
BOX = sample(Z24, 0.2, 4, random_state=0).theta
MODES = [3, 0, 5]


@pytest.fixture(scope="module", params=["dense", "tracked", "damaged", "rescaled", "reduced"])
def model(request):
    return {
        "dense": lambda: TRUSS,
        "tracked": lambda: Z24,
        "damaged": lambda: Z24.damaged({"soil": 0.2}),
        "rescaled": lambda: Z24.rescaled([0.9, 1.1, 1.0, 0.95]),
        "reduced": lambda: Z24.reduced(0.25, random_state=0),
    }[request.param]()


@pytest.mark.one_case
def test_chosen_modes_are_columns_of_the_model_with_all_modes(model):
    theta = BOX if model.track else sample(TRUSS, 0.05, 4, random_state=0).theta
    chosen = model.with_modes(MODES)
    assert chosen.n_modes == 3
    np.testing.assert_allclose(chosen.frequencies(theta), model.frequencies(theta)[:, MODES], rtol=1e-5)
    np.testing.assert_allclose(chosen.jacobian(theta), model.jacobian(theta)[:, MODES], rtol=1e-3, atol=1e-3)
    frequencies, shapes = chosen.modes(theta[:1])
    np.testing.assert_allclose(frequencies, model.frequencies(theta[:1])[:, MODES], rtol=1e-5)
    np.testing.assert_allclose(np.diagonal(mac(shapes[0], model.modes(theta[:1])[1][0][:, MODES])), 1, atol=1e-6)
    back = chosen.with_modes(range(model.n_modes))
    np.testing.assert_allclose(back.frequencies(theta), model.frequencies(theta), rtol=1e-5)


def test_modes_beyond_the_first_columns_can_be_chosen():
    few, all_six = make_z24(2), Z24
    np.testing.assert_allclose(few.with_modes([4, 1]).frequencies(BOX), all_six.frequencies(BOX)[:, [4, 1]], rtol=1e-9)
    damaged = few.damaged({"soil": 0.3}).with_modes([4, 1])
    expected = all_six.damaged({"soil": 0.3}).frequencies(BOX)[:, [4, 1]]
    np.testing.assert_allclose(damaged.frequencies(BOX), expected, rtol=1e-9)


@pytest.mark.one_case
def test_frozen_parameters_stay_at_one(model):
    names = [model.parameter_names[2], model.parameter_names[0]]
    fewer = model.with_parameters(names)
    assert fewer.parameter_names == tuple(names)
    theta = np.array([[0.9, 1.1], [1.05, 0.85]])
    full = np.ones((2, 4))
    full[:, [2, 0]] = theta
    np.testing.assert_allclose(fewer.frequencies(theta), model.frequencies(full), rtol=1e-5)
    np.testing.assert_allclose(fewer.jacobian(theta), model.jacobian(full)[:, :, [2, 0]], rtol=1e-3, atol=1e-3)
    group = next(iter(model.groups))
    damaged = fewer.damaged({group: 0.2})
    np.testing.assert_allclose(damaged.frequencies(theta), model.damaged({group: 0.2}).frequencies(full), rtol=1e-5)
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(fewer)).frequencies(theta), fewer.frequencies(theta))


def test_parameters_of_the_mass_can_be_frozen_too():
    model = AffineModel({("k",): np.eye(2) * [1.0, 4.0]}, {("m",): np.eye(2)}, n_modes=2)
    np.testing.assert_allclose(model.with_parameters(["k"]).frequencies([[4.0]]), [[1, 2] / np.array(np.pi)])
    np.testing.assert_allclose(model.with_parameters(["m"]).frequencies([[4.0]]), [[0.25, 0.5] / np.array(np.pi)])


def test_a_tracking_model_of_some_modes_follows_them_where_others_swap():
    """The second mode is passed by the third, which is no column."""
    terms = {"a": np.diag([1.0, 0, 0]), "b": np.diag([0, 4.0, 0]), (): np.diag([0, 0, 9.0])}
    chosen = AffineModel(terms, np.eye(3), n_modes=3, track=True).with_modes([0, 1])
    np.testing.assert_allclose(chosen.frequencies([[1.0, 9.0], [16.0, 1.0]]) * 2 * np.pi, [[1, 6], [4, 2]])


def test_any_order_and_choice_of_modes_is_found_by_frequency():
    nominal, order, factors = TRUSS.frequencies(np.ones(4))[0], [2, 0, 4, 1], np.array([1.02, 0.97, 1.01, 0.99])
    table = match_modes(TRUSS, nominal[order] * factors)
    assert table["mode"].tolist() == order
    np.testing.assert_allclose(table["offset"], 100 * (1 / factors - 1), atol=1e-3)
    np.testing.assert_allclose(TRUSS.with_modes(table["mode"]).frequencies(np.ones(4))[0], nominal[order], rtol=1e-9)


def test_shapes_tell_modes_apart_that_frequencies_confuse():
    """Frequencies of the fourth and fifth mode, 7 % apart, were measured the other way round."""
    frequencies, shapes = Z24.modes(np.ones((1, 4)))
    swapped, dofs = frequencies[0][[0, 1, 3, 2, 4, 5]], np.arange(0, Z24.n_dof, 5)
    assert match_modes(Z24, swapped)["mode"].tolist() == [0, 1, 3, 2, 4, 5]
    table = match_modes(Z24, swapped, shapes=shapes[0][dofs] * np.exp(1j * np.arange(6)), dofs=dofs)
    assert table["mode"].tolist() == list(range(6))
    np.testing.assert_allclose(table["mac"], 1, atol=1e-9)


def test_the_mean_of_records_with_gaps_counts_and_names_are_kept():
    wrong = pd.DataFrame({"a": [7.4, 7.6, 0.0], 2: [27.0, 999.0, 28.0]})
    with pytest.warns(UserWarning, match=r"2 frequencies.*'a' \(1\), '2' \(1\).*set-aside"):
        counted = match_modes(TRUSS, wrong)
    table = match_modes(TRUSS, pd.DataFrame({"a": [7.4, 7.6, np.nan], 2: [27.0, np.nan, 28.0]}))
    pd.testing.assert_frame_equal(counted, table)
    assert table.index.tolist() == ["a", "2"]
    np.testing.assert_allclose(table["measured"], [7.5, 27.5])


@pytest.mark.parametrize(("second", "are_as_good"), [(410.0, True), (900.0, False)])
def test_pairings_that_are_as_good_are_named(second, are_as_good):
    model = AffineModel({"k": np.diag([400.0, second, 5000.0])}, np.eye(3))
    measured = np.sqrt([400.0, second]) / (2 * np.pi) * [1.002, 0.998]
    with warnings.catch_warnings(record=True) as given:
        warnings.simplefilter("always")
        assert match_modes(model, measured)["mode"].tolist() == [0, 1]
        match_modes(model, measured, shapes=np.eye(3)[:, :2], dofs=[0, 1, 2])  # shapes decide
    assert [one.message.kind for one in given] == ["mode-order"] * are_as_good
