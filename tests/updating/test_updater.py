"""Model updating recovers what is known, knows what it cannot, and follows modes."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import AffineModel, CallableModel, mac, shape_jacobian
from skthermo.surrogate import DataInformedFEM, InverseSurrogate
from skthermo.updating import ModelUpdater, identifiability, sensitivity
from tests.fem.frames import FRAME, portal

TRUSS = make_truss()
TRUTH = np.array([0.9, 1.1, 0.95, 1.05])
METHODS = ("least_squares", "lbfgs")


def measured(model, truth, dofs=None):
    """Noise-free frequencies, and shapes at degrees of freedom."""
    frequencies, shapes = model.modes([truth])
    return frequencies[0], shapes[0] if dofs is None else shapes[0][dofs]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", [TRUSS, FRAME, FRAME.reduced(0.3, random_state=0)], ids=["truss", "frame", "reduced"])
def test_frequencies_alone_recover_the_parameters(model, method):
    updater = ModelUpdater(model, method=method).fit(model.frequencies([TRUTH]))
    np.testing.assert_allclose(updater.theta_, TRUTH, atol=1e-4)
    np.testing.assert_allclose(updater.model_.frequencies([np.ones(4)]), model.frequencies([TRUTH]), rtol=1e-6)
    assert updater.model_.parameter_names == model.parameter_names
    table = updater.table_
    np.testing.assert_allclose(table["before"], model.frequencies([np.ones(4)])[0])
    np.testing.assert_allclose(table["error_before"], 100 * (table["before"] / table["measured"] - 1))
    assert table["error_after"].abs().max() < 1e-4
    assert updater.starts_["success"].all()


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("model", [TRUSS, FRAME, FRAME.reduced(0.3, random_state=0)], ids=["truss", "frame", "reduced"])
def test_shapes_at_a_few_degrees_of_freedom_recover_what_two_frequencies_do_not(model, method):
    dofs = np.random.default_rng(3).choice(model.n_dof, 8, replace=False)
    frequencies, shapes = measured(model, TRUTH, dofs)
    frequencies[2:] = np.nan
    scaled = shapes * [3.0, -0.2, 1.0, -1.0, 50.0, 0.01]
    updater = ModelUpdater(model, shape_weight=100.0, method=method, max_iter=500)
    updater.fit(frequencies, shapes=scaled, dofs=dofs)
    np.testing.assert_allclose(updater.theta_, TRUTH, atol=0.02)
    assert updater.table_["mac_after"].min() > 0.99999
    assert updater.table_.index.tolist() == ["f1", "f2", "f3", "f4", "f5", "f6"]
    assert updater.table_["measured"].isna().sum() == 4


def test_the_objective_is_as_documented():
    dofs = [1, 4, 8, 12, 20]
    frequencies, shapes = measured(TRUSS, TRUTH, dofs)
    std, weights, prior = 0.01 * np.arange(1, 7), np.arange(6.0), 0.2
    updater = ModelUpdater(TRUSS, shape_weight=weights, prior=prior, max_iter=1)
    with pytest.warns(UserWarning, match="has not converged"):
        updater.fit(frequencies, shapes=shapes, dofs=dofs, frequency_std=std)
    start = updater.starts_.loc[0]
    f, phi = measured(TRUSS, start.theta, dofs)
    root = np.sqrt(np.diagonal(mac(shapes, phi)))
    expected = (((f - frequencies) / std) ** 2).sum() + (((1 - root) / root * weights) ** 2).sum()
    expected += (((start.theta - 1) / prior) ** 2).sum()
    assert start.objective == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize("model", [TRUSS, portal(3)], ids=["truss", "frame"])
def test_gradients_of_the_objective_equal_central_differences(model):
    from skthermo.updating._measured import read_measured
    from skthermo.updating._residuals import Residuals

    dofs = np.arange(0, 20, 3)
    frequencies, shapes = measured(model, TRUTH, dofs)
    names = [f"f{i}" for i in range(1, 7)]
    read = read_measured(frequencies[np.newaxis], names, shapes, dofs, 0.05, [1e3, 0, 3e3, 50, 1e3, 1e3], model.n_dof)
    residuals = Residuals(model, read, np.full(4, 0.3))
    theta, step = np.array([1.05, 0.95, 1.0, 1.1]), 1e-5
    point = residuals.at(theta)
    ends = [[residuals.at(theta + way * step * unit) for way in (1, -1)] for unit in np.eye(4)]
    slopes = np.stack([(raised.values - lowered.values) / (2 * step) for raised, lowered in ends], axis=1)
    np.testing.assert_allclose(point.jacobian(), slopes, rtol=1e-4, atol=1e-4 * np.abs(slopes).max())
    gradient = [(raised.objective - lowered.objective) / (2 * step) for raised, lowered in ends]
    np.testing.assert_allclose(point.gradient(), gradient, rtol=1e-4)


@pytest.mark.parametrize("dofs", [None, [0, 3, 7, 9, 14, 17, 21]], ids=["frequencies", "and shapes"])
def test_covariance_is_the_scatter_of_repeated_fits_and_the_cramer_rao_bound(dofs):
    """Standard deviations of 200 fits are known to 5 %; three of these are 15 %."""
    noise, shape_noise, n_fits = 0.002, 0.01, 200
    random, truth = np.random.default_rng(0), np.array([0.95, 1.05, 1.0, 0.98])
    frequencies, shapes = measured(TRUSS, truth, dofs)
    options, weight = {}, 0.0
    if dofs:
        options = {"dofs": dofs, "shape_noise": shape_noise}
        weight = np.sqrt(2 * (len(dofs) - 1)) / shape_noise**2
    updater = ModelUpdater(TRUSS, bounds=[[0.2, 3.0]] * 4, shape_weight=weight)
    found, deviations = [], []
    for _ in range(n_fits):
        F = frequencies * (1 + noise * random.standard_normal(6))
        with_shapes = {}
        if dofs:
            level = shape_noise * np.sqrt(np.mean(shapes**2, axis=0))
            with_shapes = {"dofs": dofs, "shapes": shapes + level * random.standard_normal(shapes.shape)}
        updater.fit(F, frequency_std=noise * frequencies, **with_shapes)
        found.append(updater.theta_)
        deviations.append(np.sqrt(np.diag(updater.covariance_)))
    bound = identifiability(TRUSS, truth, noise=noise, **options).deviations.to_numpy() * truth
    scatter = np.std(found, axis=0, ddof=1)
    identifiable = bound < 0.1  # where the model is linear over the scatter
    assert identifiable.sum() >= 3
    np.testing.assert_allclose(scatter[identifiable], bound[identifiable], rtol=0.15)
    np.testing.assert_allclose(np.median(deviations, axis=0)[identifiable], bound[identifiable], rtol=0.1)
    errors = (np.mean(found, axis=0) - truth) / (bound / np.sqrt(n_fits))
    assert np.abs(errors[identifiable]).max() < 4


@pytest.mark.parametrize("n_dofs", [2, 9])
def test_covariance_from_shapes_is_what_identifiability_promises(n_dofs):
    """With frequencies so noisy that almost all is known from the shapes."""
    noise, shape_noise, dofs = 10.0, 1e-3, np.arange(3, 3 + n_dofs)
    frequencies, shapes = measured(TRUSS, TRUTH, dofs)
    updater = ModelUpdater(TRUSS, shape_weight=np.sqrt(2 * (n_dofs - 1)) / shape_noise**2)
    updater.fit(frequencies, shapes=shapes, dofs=dofs, frequency_std=noise * frequencies)
    bound = identifiability(TRUSS, updater.theta_, noise=noise, dofs=dofs, shape_noise=shape_noise).deviations
    np.testing.assert_allclose(np.sqrt(np.diag(updater.covariance_)) / updater.theta_, bound, rtol=1e-6)


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
    with pytest.warns(UserWarning, match=r"\['f1', 'f2'\] swap places .* expected a model with track=True"):
        false = ModelUpdater(sorted_, bounds=bounds, n_starts=8, random_state=0).fit(F)
    assert false.starts_["objective"].min() < 1e-9 < honest.starts_["objective"].min()
    with pytest.warns(UserWarning, match=r"\['f1', 'f2'\] are by their shapes other modes"):
        updater = ModelUpdater(sorted_, bounds=0.6).fit(frequencies, shapes=np.eye(3), dofs=[0, 1, 2])
    np.testing.assert_allclose(updater.theta_, truth, rtol=1e-6)
    np.testing.assert_allclose(updater.table_["mac_after"], 1)


def test_shapes_that_the_model_does_not_have_are_named():
    with pytest.warns(UserWarning, match=r"no mode .* shapes of \['f3'\] \(MAC below 0.5\)"):
        ModelUpdater(oscillators(True)).fit(
            oscillators(True).frequencies([np.ones(3)]), shapes=[[1, 0, 1], [0, 1, 1], [0, 0, 0.3]], dofs=[0, 1, 2]
        )


def test_measured_modes_in_another_order_are_found_by_their_shapes():
    dofs, order = np.arange(0, 23, 3), [1, 0, 2, 4, 3, 5]
    frequencies, shapes = measured(TRUSS, TRUTH, dofs)
    with pytest.warns(UserWarning, match=r"\['f1', 'f2', 'f4', 'f5'\] are by their shapes other modes"):
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


def test_records_are_averaged_and_missing_modes_left_out():
    truth = FRAME.frequencies([TRUTH])[0]
    F = pd.DataFrame([truth * 0.99, truth * 1.01, truth], columns=[f"mode {i}" for i in range(6)])
    F.iloc[:, 2] = np.nan
    F.iloc[:2, 4] = np.nan
    updater = ModelUpdater(FRAME).fit(F)
    np.testing.assert_allclose(updater.theta_, TRUTH, atol=1e-4)
    assert updater.table_.index.tolist() == ["mode 0", "mode 1", "mode 3", "mode 4", "mode 5"]
    assert updater.n_features_in_ == 6
    again = ModelUpdater(FRAME).fit(F.mean().to_numpy())
    np.testing.assert_array_equal(again.theta_, updater.theta_)


def test_complex_shapes_of_random_phase_are_made_real():
    dofs = np.arange(0, 23, 2)
    frequencies, shapes = measured(TRUSS, TRUTH, dofs)
    turned = shapes * np.exp(1j * np.random.default_rng(0).uniform(0, 2 * np.pi, 6))
    updater = ModelUpdater(TRUSS, shape_weight=10.0)
    with pytest.warns(UserWarning, match=r"shapes are complex: .* up to 0.0% of a shape's length"):
        from_complex = clone(updater).fit(frequencies, shapes=turned, dofs=dofs)
    from_real = updater.fit(frequencies, shapes=shapes, dofs=dofs)
    np.testing.assert_allclose(from_complex.theta_, from_real.theta_, atol=1e-6)


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


def test_a_prior_holds_what_cannot_be_told():
    model = AffineModel(
        {("a",): np.diag([1.0, 0]), ("b",): np.diag([0, 3.0]), ("c",): np.diag([0, 1e-12])}, np.eye(2), n_modes=2
    )
    frequencies = model.frequencies([[1.2, 0.8, 1.0]])
    with pytest.warns(UserWarning, match="3 parameters are to be found from 2 residuals"):
        free = ModelUpdater(model).fit(frequencies)
    assert np.isinf(free.covariance_[2, 2])
    held = ModelUpdater(model, prior=[1.0, 1.0, 0.1], random_state=0, n_starts=3)
    held.fit(frequencies, frequency_std=1e-6)
    np.testing.assert_allclose(held.theta_, [1.2, 0.8, 1.0], atol=1e-4)
    assert held.covariance_[2, 2] == pytest.approx(0.01)


@pytest.mark.parametrize("method", METHODS)
def test_bounds_are_kept_and_reached(method):
    bounds = np.array([[0.95, 1.05], [0.95, 1.05], [0.5, 1.5], [0.5, 1.5]])
    updater = ModelUpdater(TRUSS, bounds=bounds, method=method).fit(TRUSS.frequencies([TRUTH]))
    assert ((updater.theta_ >= bounds[:, 0]) & (updater.theta_ <= bounds[:, 1])).all()
    assert updater.theta_[0] == pytest.approx(0.95, abs=1e-5)
    bounds[0, 0] = 0.96
    tighter = ModelUpdater(TRUSS, bounds=bounds, method=method).fit(TRUSS.frequencies([TRUTH]))
    assert tighter.theta_[0] == pytest.approx(0.96, abs=1e-5)
    assert tighter.starts_["objective"].min() > updater.starts_["objective"].min()


def two_wells():
    """One frequency that two stiffnesses give: a parabola with its lowest point between them."""
    return CallableModel(lambda row: [2 + (row[0] - 1.1) ** 2, 10 + 0.1 * row[0]], ["k"], 2)


def test_starts_report_local_optima():
    F = [[2.04, 10.13]]  # k = 0.9 or 1.3, the second mode prefers 1.3
    updater = ModelUpdater(two_wells(), bounds=0.5, n_starts=8, random_state=0).fit(F)
    starts = updater.starts_
    assert len(starts) == 8
    assert set(starts["optimum"]) == {0, 1}
    assert starts.loc[0, "start"] == [1.0]
    np.testing.assert_allclose(updater.theta_, [1.3], atol=1e-4)
    best = starts[starts["optimum"] == 0]
    assert best["objective"].max() < starts[starts["optimum"] == 1]["objective"].min()
    np.testing.assert_allclose(np.stack(best["theta"]), 1.3, atol=1e-4)
    np.testing.assert_allclose(updater.model_.frequencies([[1.0]]), F, atol=1e-4)


@pytest.mark.parametrize("model", [TRUSS, FRAME], ids=["threads", "processes"])
def test_the_same_bits_whatever_the_number_of_jobs(model):
    dofs = np.arange(0, 20, 3)
    frequencies, shapes = measured(model, TRUTH, dofs)
    fits = [
        ModelUpdater(model, shape_weight=10.0, n_starts=3, n_jobs=n_jobs, random_state=0).fit(
            frequencies * [1.01, 0.99, 1, 1, 1, 1], shapes=shapes, dofs=dofs
        )
        for n_jobs in (1, 2)
    ]
    for one, other in zip(*(np.stack(updater.starts_["theta"]) for updater in fits), strict=True):
        np.testing.assert_array_equal(one, other)
    pd.testing.assert_frame_equal(fits[0].table_, fits[1].table_)


def test_models_without_derivatives_are_differenced():
    model = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    updater = ModelUpdater(model).fit(TRUSS.frequencies([TRUTH]))
    np.testing.assert_allclose(updater.theta_, TRUTH, atol=1e-4)
    exact = ModelUpdater(TRUSS).fit(TRUSS.frequencies([TRUTH]))
    np.testing.assert_allclose(updater.covariance_, exact.covariance_, rtol=1e-3)
    revived = pickle.loads(pickle.dumps(updater))
    np.testing.assert_allclose(revived.model_.frequencies([np.ones(4)]), TRUSS.frequencies([TRUTH]), rtol=1e-5)


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
    for found, same in zip(shape_jacobian(other, truth, dofs), shape_jacobian(model, truth, dofs), strict=True):
        np.testing.assert_array_equal(found, same)
    known, same = (identifiability(m, noise=0.01, dofs=dofs, shape_noise=0.01).deviations for m in (other, model))
    np.testing.assert_allclose(known, same, rtol=1e-4)
    del other.track
    with pytest.raises(ValueError, match="has no 'track'; expected a model with local_modes, n_dof and track"):
        ModelUpdater(other).fit(**given)


def test_swapped_modes_of_a_third_partys_sorted_model_are_named():
    model, bounds = ThirdPartyModel(oscillators(False)), [[1, 1.6], [0.5, 1.05], [0.5, 1.5]]
    with pytest.warns(UserWarning, match=r"\['f1', 'f2'\] swap places"):
        ModelUpdater(model, bounds=bounds, n_starts=8, random_state=0).fit(model.frequencies([[1.5, 0.9, 1.0]]))


def test_the_updater_follows_scikit_learn():
    updater = ModelUpdater(TRUSS, bounds=0.2, prior=0.5, n_starts=2, random_state=0)
    twin = clone(updater)
    assert twin.model is TRUSS
    assert repr(twin.get_params()) == repr(updater.get_params())
    F = TRUSS.frequencies([TRUTH])
    assert updater.fit(F) is updater
    revived = pickle.loads(pickle.dumps(updater))
    np.testing.assert_array_equal(revived.theta_, updater.theta_)
    np.testing.assert_array_equal(revived.model_.frequencies([np.ones(4)]), updater.model_.frequencies([np.ones(4)]))
    with pytest.raises(ValueError, match="method"):
        clone(updater).set_params(method="newton").fit(F)


def test_the_updated_model_composes_with_the_chain():
    year = make_truss_campaign(random_state=0)
    updater = ModelUpdater(TRUSS).fit(year.frequencies)
    np.testing.assert_allclose(updater.model_.frequencies([np.ones(4)])[0], year.frequencies.mean(), rtol=5e-3)
    fem = DataInformedFEM(updater.model_, inverse=InverseSurrogate(bounds=0.2, n_samples=200), random_state=0)
    assert fem.fit(year.temperatures, year.frequencies).score(year.temperatures, year.frequencies) > 0.8
    np.testing.assert_allclose(sensitivity(updater.model_), sensitivity(TRUSS, updater.theta_), atol=1e-9)
    damaged = TRUSS.damaged({"bottom": 0.5}).frequencies([updater.theta_])
    np.testing.assert_allclose(updater.model_.damaged({"bottom": 0.5}).frequencies([np.ones(4)]), damaged, rtol=1e-9)
