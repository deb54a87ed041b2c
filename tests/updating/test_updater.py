"""Model updating recovers what is known, knows what it cannot, follows modes, steps back from where there are none."""

import pickle
import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import AffineModel, CallableModel, mac
from skthermo.surrogate import DataInformedFEM
from skthermo.updating import ModelUpdater, identifiability, sensitivity
from tests.fem.frames import FRAME, portal

pytestmark = pytest.mark.filterwarnings("ignore:.*poor-fit")

TRUSS = make_truss()
TRUTH = np.array([0.9, 1.1, 0.95, 1.05])
METHODS = ("least_squares", "lbfgs")
OF_MODELS = pytest.mark.parametrize(
    ("model", "method"),
    [(TRUSS, "lbfgs"), (FRAME, "least_squares"), (FRAME.reduced(0.3, random_state=0), "lbfgs")],
    ids=["truss", "frame", "reduced"],
)


def measured(model, truth, dofs=None):
    """Noise-free frequencies, and shapes at degrees of freedom."""
    frequencies, shapes = model.modes([truth])
    return frequencies[0], shapes[0] if dofs is None else shapes[0][dofs]


@OF_MODELS
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


def test_values_that_cannot_be_frequencies_count_as_missing_and_are_named():
    records = make_truss_campaign(random_state=0).frequencies
    wrong, missing = records.copy(), records.copy()
    for row, value in enumerate([0.0, -999.0, 999.0, 9999.0]):
        wrong.iloc[row, 1], missing.iloc[row, 1] = value, np.nan
    with pytest.warns(UserWarning, match=r"4 frequencies.*'f2' \(4\).*set-aside"):
        updater = ModelUpdater(TRUSS, prior=0.2, random_state=0).fit(wrong, frequency_std=0.01 * records.mean())
    expected = ModelUpdater(TRUSS, prior=0.2, random_state=0).fit(missing, frequency_std=0.01 * records.mean())
    np.testing.assert_array_equal(updater.theta_, expected.theta_)


@OF_MODELS
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


@pytest.mark.parametrize(("model", "method"), [(TRUSS, "least_squares"), (portal(3), "lbfgs")], ids=["truss", "frame"])
def test_the_documented_objective_is_least_where_a_search_ends(model, method):
    """What is measured cannot be explained, so that gradients of frequencies, shapes and prior balance."""
    dofs, prior, std = np.arange(0, 20, 3), 0.1, 0.01
    frequencies, shapes = measured(model, TRUTH, dofs)
    random = np.random.default_rng(0)
    frequencies = frequencies * (1 + 0.01 * random.standard_normal(6))
    shapes = shapes + 0.2 * np.abs(shapes).max(axis=0) * random.standard_normal(shapes.shape)
    weights = np.array([30.0, 0.0, 20.0, 5.0, 30.0, 30.0])
    updater = ModelUpdater(model, shape_weight=weights, prior=prior, method=method, max_iter=500)
    updater.fit(frequencies, shapes=shapes, dofs=dofs, frequency_std=std * frequencies)

    def objective(theta):
        f, phi = measured(model, theta, dofs)
        root = np.sqrt(np.diagonal(mac(shapes, phi)))
        misfits = (f / frequencies - 1) / std, (1 - root) / root * weights, (theta - 1) / prior
        return sum((misfit**2).sum() for misfit in misfits)

    step = 1e-3
    least = objective(updater.theta_)
    assert updater.starts_["objective"].min() == pytest.approx(least, rel=1e-6)
    for unit in step * np.eye(4):
        up, down = objective(updater.theta_ + unit), objective(updater.theta_ - unit)
        vertex = step * (down - up) / (2 * (up + down - 2 * least))
        assert min(up, down) > least
        assert abs(vertex) < 1e-4


@pytest.mark.parametrize("n_dofs", [2, 9])
def test_covariance_from_shapes_is_what_identifiability_predicts(n_dofs):
    """With frequencies so noisy that almost all is known from the shapes."""
    noise, shape_noise, dofs = 0.2, 1e-4, np.arange(3, 3 + n_dofs)
    frequencies, shapes = measured(TRUSS, TRUTH, dofs)
    updater = ModelUpdater(TRUSS, shape_weight=np.sqrt(2 * (n_dofs - 1)) / shape_noise**2)
    updater.fit(frequencies, shapes=shapes, dofs=dofs, frequency_std=noise * frequencies)
    bound = identifiability(TRUSS, updater.theta_, noise=noise, dofs=dofs, shape_noise=shape_noise).deviations
    np.testing.assert_allclose(np.sqrt(np.diag(updater.covariance_)) / updater.theta_, bound, rtol=1e-6)


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
    with pytest.warns(UserWarning, match="doubtful-shapes"):
        from_complex = clone(updater).fit(frequencies, shapes=turned, dofs=dofs)
    from_real = updater.fit(frequencies, shapes=shapes, dofs=dofs)
    np.testing.assert_allclose(from_complex.theta_, from_real.theta_, atol=1e-6)


@pytest.mark.filterwarnings("ignore:.*undetermined")
def test_a_prior_holds_what_cannot_be_identified():
    terms = {("a",): np.diag([1.0, 0]), ("b",): np.diag([0, 3.0]), ("c",): np.diag([0, 1e-12])}
    model = AffineModel(terms, np.eye(2), n_modes=2)
    frequencies = model.frequencies([[1.2, 0.8, 1.0]])
    with pytest.warns(UserWarning, match=r"3 parameters .*2 residuals.*\[undetermined\]"):
        free = ModelUpdater(model).fit(frequencies)
    assert np.isinf(free.covariance_[2, 2])
    (F, shapes), first = measured(TRUSS, TRUTH, [2, 8, 14]), np.where(np.arange(6) == 0, 1.0, np.nan)
    with pytest.warns(UserWarning, match=r"4 parameters .*3 residuals"):  # a frequency and the direction of a shape
        ModelUpdater(TRUSS, shape_weight=1.0).fit(F * first, shapes=shapes * first, dofs=[2, 8, 14])
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


def test_models_without_derivatives_are_differenced():
    model = CallableModel(TRUSS.frequencies, TRUSS.parameter_names, 6, vectorized=True)
    updater = ModelUpdater(model).fit(TRUSS.frequencies([TRUTH]))
    np.testing.assert_allclose(updater.theta_, TRUTH, atol=1e-4)
    exact = ModelUpdater(TRUSS).fit(TRUSS.frequencies([TRUTH]))
    np.testing.assert_allclose(updater.covariance_, exact.covariance_, rtol=1e-3)
    revived = pickle.loads(pickle.dumps(updater))
    np.testing.assert_allclose(revived.model_.frequencies([np.ones(4)]), TRUSS.frequencies([TRUTH]), rtol=1e-5)


def test_the_updated_model_composes_with_the_chain():
    year = make_truss_campaign(random_state=0)
    updater = ModelUpdater(TRUSS).fit(year.frequencies)
    np.testing.assert_allclose(updater.model_.frequencies([np.ones(4)])[0], year.frequencies.mean(), rtol=5e-3)
    T, F = year.temperatures[::3], year.frequencies[::3]
    assert DataInformedFEM(updater.model_, random_state=0).fit(T, F).score(T, F) > 0.8
    np.testing.assert_allclose(sensitivity(updater.model_), sensitivity(TRUSS, updater.theta_), atol=1e-9)
    damaged = TRUSS.damaged({"bottom": 0.5}).frequencies([updater.theta_])
    np.testing.assert_allclose(updater.model_.damaged({"bottom": 0.5}).frequencies([np.ones(4)]), damaged, rtol=1e-9)


def test_covariance_is_the_noise_that_fits_pass_on_and_the_cramer_rao_bound():
    """Each frequency is changed by a tenth of its noise, alone; what this changes in theta adds up."""
    noise, share, truth = 0.002, 0.1, np.array([0.95, 1.05, 1.0, 0.98])
    frequencies, _ = measured(TRUSS, truth)
    updater = ModelUpdater(TRUSS, bounds=[[0.2, 3.0]] * 4)
    std, changed = noise * frequencies, frequencies * (1 + share * noise * np.eye(6))
    fits = [updater.fit(F, frequency_std=std).theta_ for F in changed]
    deviations = np.sqrt(np.diag(updater.fit(frequencies, frequency_std=std).covariance_))
    bound = identifiability(TRUSS, truth, noise=noise).deviations.to_numpy() * truth
    np.testing.assert_allclose(deviations, bound, rtol=1e-4)
    identifiable = bound < 0.1  # where the model is linear over the noise
    assert identifiable.sum() == 3
    passed_on = np.linalg.norm((np.array(fits) - updater.theta_) / share, axis=0)
    np.testing.assert_allclose(passed_on[identifiable], bound[identifiable], rtol=0.02)


def test_parameters_that_no_mode_feels_are_named():
    """A hundred-thousandth of the third spring is a parameter."""
    terms = {("a",): np.diag([1.0, 0, 0]), ("b",): np.diag([0, 4.0, 0]), ("c",): np.diag([0, 0, 9e-5])}
    model = AffineModel(terms | {(): np.diag([0, 0, 9.0])}, np.eye(3), n_modes=3)
    with pytest.warns(UserWarning, match=r"\['c'\] .*undetermined"):
        ModelUpdater(model).fit(model.frequencies([[1.1, 0.9, 1.0]]))


@pytest.mark.parametrize("dofs", [None, [2, 8, 14, 20]], ids=["frequencies", "shapes"])
def test_where_a_reduced_model_searches_the_optimum_is_the_full_models(dofs):
    truth = np.linspace(0.9, 1.1, len(FRAME.parameter_names))
    F, shapes = measured(FRAME, truth, dofs)
    given = {} if dofs is None else {"shapes": shapes, "dofs": dofs}
    weight = 0.0 if dofs is None else 0.1
    settings = {"bounds": 0.2, "n_starts": 2, "prior": 0.1, "shape_weight": weight, "random_state": 0}
    reduced, full = (ModelUpdater(FRAME, reduce=reduce, **settings).fit(F, **given) for reduce in (True, False))
    np.testing.assert_allclose(reduced.theta_, full.theta_, rtol=1e-5)
    assert reduced.starts_["objective"].min() <= full.starts_["objective"].min() * (1 + 1e-6)
    assert len(reduced.starts_) == 2
    assert FRAME.reduction_pays(10_000)


@pytest.mark.parametrize(
    ("F", "shapes", "message"),
    [
        (np.ones((1, 12)), np.eye(5, 6), "F has 12 columns; expected the 6 modes"),
        (np.ones((1, 6)), np.eye(5, 6), "shape of 'f6' is zero throughout"),
        (np.ones((1, 6)), np.where(np.eye(5, 6) == 1, np.nan, 1), "shape of 'f1' is NaN in row 0 but not in all"),
    ],
)
def test_measurements_that_cannot_be(F, shapes, message):
    with pytest.raises(ValueError, match=message):
        ModelUpdater(TRUSS).fit(F, shapes=shapes, dofs=range(5))


INSIDE = np.array([0.97, 1.1, 0.95, 1.05])


def half_truss(lowest=0.95):
    """The truss, which has no modes where its first multiplier is low."""

    def frequencies(theta):
        return np.where(theta[:, :1] > lowest, TRUSS.frequencies(theta), np.nan)

    return CallableModel(frequencies, TRUSS.parameter_names, 6, vectorized=True)


@pytest.mark.filterwarnings("error")
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
    for truth, n_warnings in ((TRUTH, 1), (np.array([0.97, 1.04, 0.98, 1.02]), 0)):
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


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize(("method", "model"), FAILING.values(), ids=FAILING)
def test_a_program_that_fails_beside_the_optimum_or_there_gives_one_warning_at_most(method, model):
    updater = ModelUpdater(model, method=method, n_starts=3, random_state=0).fit(TRUSS.frequencies([INSIDE]))
    np.testing.assert_allclose(updater.theta_, INSIDE, atol=1e-4)
    starts = updater.starts_
    assert starts["success"].tolist() == [start[0] > 0.95 for start in starts["start"]]
    with pytest.warns(UserWarning, match="poor-fit") as caught:
        updater.fit(TRUSS.frequencies([TRUTH]))
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
