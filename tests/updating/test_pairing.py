"""Measured modes are paired with the model's by their shapes, of whatever model gives them."""

import pickle

import numpy as np
import pandas as pd
import pytest

from skthermo.fem import AffineModel, CallableModel, mac
from skthermo.updating import ModelUpdater, identifiability
from tests.updating.test_updater import TRUSS, TRUTH, measured

pytestmark = pytest.mark.filterwarnings("ignore:.*poor-fit")


def oscillators(track, n_modes=3):
    """Three masses on springs of their own: frequencies in the ratio of roots of stiffness, shapes are axes."""
    stiffness = {
        (name,): np.diag(np.eye(3)[i] * k) for i, (name, k) in enumerate(zip("abc", (1.0, 1.4, 9.0), strict=True))
    }
    return AffineModel(stiffness, np.eye(3), n_modes=n_modes, track=track)


def test_a_false_match_of_swapped_modes_is_refused():
    """In truth the first spring is the stiffer one; only shapes, or following them, can tell."""
    truth = np.array([1.5, 0.9, 1.0])
    tracked, sorted_ = oscillators(True), oscillators(False)
    frequencies = tracked.frequencies([truth])
    assert frequencies[0, 0] > frequencies[0, 1]
    np.testing.assert_allclose(ModelUpdater(tracked, bounds=0.6).fit(frequencies).theta_, truth, rtol=1e-6)

    bounds, F = [[0.9, 1.6], [0.6, 1.01], [0.5, 1.5]], np.sqrt([[1.3, 1.5, 9.0]]) / (2 * np.pi)
    honest = ModelUpdater(tracked, bounds=bounds, n_starts=8, random_state=0).fit(F)
    np.testing.assert_allclose(honest.theta_, [1.3, 1.01, 1.0], atol=1e-4)
    with pytest.warns(UserWarning, match=r"\['f1', 'f2'\] .*mode-order"):
        false = ModelUpdater(sorted_, bounds=bounds, n_starts=8, random_state=0).fit(F)
    assert false.starts_["objective"].min() < 1e-9 < honest.starts_["objective"].min()
    with pytest.warns(UserWarning, match=r"\['f1', 'f2'\] .*mode-order"):
        updater = ModelUpdater(sorted_, bounds=0.6).fit(frequencies, shapes=np.eye(3), dofs=[0, 1, 2])
    np.testing.assert_allclose(updater.theta_, truth, rtol=1e-6)
    np.testing.assert_allclose(updater.table_["mac_after"], 1)


def test_shapes_that_the_model_does_not_have_are_named():
    model, shapes = oscillators(True), [[1, 0, 1], [0, 1, 1], [0, 0, 0.3]]
    with pytest.warns(UserWarning, match=r"\['f3'\] .*doubtful-shapes"):
        ModelUpdater(model).fit(model.frequencies([np.ones(3)]), shapes=shapes, dofs=[0, 1, 2])


def test_measured_modes_in_another_order_are_found_by_their_shapes():
    dofs, order = np.arange(0, 23, 3), [1, 0, 2, 4, 3, 5]
    frequencies, shapes = measured(TRUSS, TRUTH, dofs)
    with pytest.warns(UserWarning, match=r"\['f1', 'f2', 'f4', 'f5'\] .*mode-order"):
        updater = ModelUpdater(TRUSS).fit(frequencies[order], shapes=shapes[:, order], dofs=dofs)
    np.testing.assert_allclose(updater.theta_, TRUTH, atol=1e-4)


def test_a_mode_is_found_among_more_modes_than_the_model_has():
    """At the optimum a local mode has fallen between the two modes of the model, which is not the second."""
    terms = {("k",): np.diag([1.0, 0.0, 9.0]), (): np.diag([0.0, 1.4, 0.0])}
    model = AffineModel(terms, np.eye(3), n_modes=2, track=True)
    frequencies = np.sqrt([0.15, 1.4]) / (2 * np.pi)
    assert 0.15 < 9 * 0.15 < 1.4
    updater = ModelUpdater(model, bounds=[[0.05, 2.0]]).fit(frequencies, shapes=np.eye(3)[:, :2], dofs=[0, 1, 2])
    np.testing.assert_allclose(updater.theta_, 0.15, rtol=1e-6)
    np.testing.assert_allclose(updater.table_["after"], frequencies, rtol=1e-6)


def test_one_sensor_pairs_by_the_nominal_modes():
    """A single component is like any other; a MAC of 1 tells nothing."""
    frequencies, shapes = measured(TRUSS, TRUTH, [5])
    updater = ModelUpdater(TRUSS, shape_weight=10.0).fit(frequencies, shapes=shapes, dofs=[5])
    np.testing.assert_allclose(updater.theta_, TRUTH, atol=1e-4)


def test_where_sensors_cannot_tell_modes_apart_the_nominal_modes_decide():
    """At the two sensors, modes 1 and 3 differ by less than the noise, which makes each look like the other."""
    turn, half = 0.1, np.sqrt(0.5)
    sway = np.array([[half, 0, half], [0, 1, 0], [half, 0, -half]])
    shapes = sway @ [[np.cos(turn), -np.sin(turn), 0], [np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    terms = {(name,): k * np.outer(phi, phi) for name, k, phi in zip("abc", (1.0, 4.0, 9.0), shapes.T, strict=True)}
    model, truth = AffineModel(terms, np.eye(3), n_modes=3), [1.05, 0.95, 1.1]
    seen = shapes[:2][:, [2, 1, 0]]
    assert (np.diag(mac(shapes[:2], seen)) < mac(shapes[:2], seen).max(axis=0)).tolist() == [True, False, True]
    updater = ModelUpdater(model).fit(model.frequencies([truth]), shapes=seen, dofs=[0, 1])
    np.testing.assert_allclose(updater.theta_, truth, rtol=1e-6)


class ThirdPartyModel:
    """What a model must offer to be updated with shapes, and nothing else."""

    def __init__(self, model):
        self._model = model
        self.parameter_names, self.n_modes = model.parameter_names, model.n_modes
        self.n_dof, self.track = model.n_dof, model.track

    def frequencies(self, theta):
        return self._model.frequencies(theta)

    def local_modes(self, theta, *, follow=False):
        return self._model.local_modes(theta, follow=follow)


@pytest.mark.parametrize("model", [TRUSS, oscillators(True)], ids=["sorted", "tracked"])
def test_a_third_partys_model_is_asked_for_what_it_can_do(model):
    truth = np.array([1.2, 0.85, 1.1, 0.95])[: len(model.parameter_names)]
    dofs = np.arange(model.n_dof)
    frequencies, shapes = measured(model, truth, dofs)
    given = {"F": frequencies * 1.01, "shapes": shapes, "dofs": dofs}
    other = ThirdPartyModel(model)
    expected = ModelUpdater(model, shape_weight=10.0).fit(**given)
    updater = pickle.loads(pickle.dumps(ModelUpdater(other, shape_weight=10.0).fit(**given)))
    np.testing.assert_array_equal(updater.theta_, expected.theta_)
    np.testing.assert_array_equal(updater.covariance_, expected.covariance_)
    pd.testing.assert_frame_equal(updater.table_, expected.table_)
    nominal = [np.ones(len(truth))]
    np.testing.assert_allclose(updater.model_.frequencies(nominal), expected.model_.frequencies(nominal), rtol=1e-12)
    known, same = (identifiability(m, noise=0.01, dofs=dofs, shape_noise=0.01).deviations for m in (other, model))
    np.testing.assert_allclose(known, same, rtol=1e-4)
    del other.track
    with pytest.raises(ValueError, match="has no 'track'; expected a model with local_modes, n_dof and track"):
        ModelUpdater(other).fit(**given)


class OnlyModes(CallableModel):
    """A third-party model that sorts its modes and gives shapes, and no derivatives."""

    track = False

    def modes(self, theta):
        return oscillators(False).modes(theta)


SORTED = oscillators(False)
ONLY_MODES = OnlyModes(SORTED.frequencies, list("abc"), 3, vectorized=True)


@pytest.mark.parametrize("model", [ThirdPartyModel(SORTED), ONLY_MODES], ids=["local modes", "modes"])
def test_swapped_modes_of_a_third_partys_sorted_model_are_named(model):
    bounds = [[1, 1.6], [0.5, 1.05], [0.5, 1.5]]
    with pytest.warns(UserWarning, match=r"\['f1', 'f2'\] .*mode-order"):
        ModelUpdater(model, bounds=bounds, n_starts=8, random_state=0).fit(model.frequencies([[1.5, 0.9, 1.0]]))
