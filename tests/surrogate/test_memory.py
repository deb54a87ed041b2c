"""What a memory keeps: simulations, regressors, inversions and checks, each by what it depends on."""

import warnings

import joblib
import numpy as np
import pytest
from sklearn.linear_model import Ridge
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.exceptions import SkthermoWarning
from skthermo.fem import evaluate_modes
from skthermo.preprocessing import BiasAligner
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, PosteriorInverse, TemperatureMapper
from tests.surrogate.chains import TRUSS

YEAR = make_truss_campaign(samples_per_year=90, random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
SETTINGS = {"regressor": Ridge(1e-3), "bounds": 0.2, "n_samples": 60, "noise": 0.01, "random_state": 0}
KINDS = "taught", "inverted"  # functions whose results are kept
THETA = np.random.default_rng(0).uniform(0.9, 1.1, (40, 4))


def trained(**options):
    return InverseSurrogate(**({"model": TRUSS} | SETTINGS | options))


def inverse(**options):
    return PosteriorInverse(**({"model": TRUSS} | options))


def chain(memory, **options):
    options = {"inverse": inverse(model=None), "mapper": TemperatureMapper(Ridge())} | options
    return DataInformedFEM(TRUSS, **options, memory=memory, random_state=0)


def kept(folder, kind):
    return len(list(folder.rglob(f"{kind}/*/output.pkl")))


def found(memory, records, **options):
    """What the inverse finds, with the noise that it is based on."""
    fitted = inverse(memory=memory, **options).fit(records)
    inverted = fitted.invert(records)
    findings = [str(one) for one in inverted.pop("findings")]
    return {"noise": fitted.noise_, "prior": fitted.prior_.covariance, "findings": findings, **inverted}


def assert_same(one, other):
    for name, values in one.items():
        np.testing.assert_array_equal(values, other[name], name)


@pytest.mark.nightly
def test_a_search_over_the_mapper_inverts_each_set_of_training_records_once(tmp_path):
    grid = {"mapper__regressor": [Ridge(penalty) for penalty in (0.1, 10.0)]}
    folds, memory = KFold(2, shuffle=True, random_state=0), str(tmp_path)
    searches = [GridSearchCV(chain(one), grid, cv=folds).fit(T, F) for one in (None, memory, memory)]
    for search in searches[1:]:
        np.testing.assert_array_equal(*(one.cv_results_["mean_test_score"] for one in (searches[0], search)))
        np.testing.assert_array_equal(searches[0].predict(T), search.predict(T))
    assert {kind: kept(tmp_path, kind) for kind in KINDS} == {"taught": 3, "inverted": 3}
    assert len(list(tmp_path.rglob("output.pkl"))) == 6


def refuse(*arguments, **options):
    raise AssertionError("it is computed again")


def test_nothing_is_computed_again_unless_its_file_is_damaged(tmp_path, monkeypatch):
    memory = str(tmp_path)
    first, by_regressor = found(memory, F), trained(memory=memory).fit(F).transform(F)
    with monkeypatch.context() as computed:
        for owner, method in ((Ridge, "fit"), (type(TRUSS), "linearised"), (type(TRUSS), "frequencies")):
            computed.setattr(owner, method, refuse)
        assert_same(first, found(memory, F))
        np.testing.assert_array_equal(trained(memory=memory).fit(F).transform(F), by_regressor)
    for file in tmp_path.rglob("output.pkl"):
        file.write_bytes(file.read_bytes()[:20])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # joblib's, which says so
        assert_same(first, found(memory, F))


def test_pipelines_that_transform_what_they_were_fitted_to_do_so_once(tmp_path):
    pipeline = make_pipeline(BiasAligner(TRUSS), inverse(memory=str(tmp_path)))
    np.testing.assert_array_equal(*(pipeline.fit(F).transform(F) for _ in range(2)))
    assert kept(tmp_path, "inverted") == 1


OTHERS = {
    "a record": {"records": F * np.where(np.arange(len(F)) == 7, 1.001, 1.0)[:, np.newaxis]},
    "a record left out": {"records": F[:-1]},
    "a gap": {"records": F.where(F.iloc[3, 1] != F)},
    "noise": {"noise": 0.02},
    "noise of one mode": {"noise": [0.01, 0.01, 0.01, 0.01, 0.01, 0.02]},
    "no noise": {"noise": 0.0},
    "a prior": {"prior": 0.05},
    "a reduced model": {"reduce": 1e-4},
    "sensors": {"dofs": [3, 9], "shapes": True},
    "other sensors": {"dofs": [3, 11], "shapes": True},
    "noise of shapes": {"dofs": [3, 9], "shapes": True, "shape_noise": 0.02},
    "a model": {"model": TRUSS.damaged({"bottom": 0.1})},
    "other modes": {"model": TRUSS.with_modes([0, 1, 2, 3, 5, 4])},
}


@pytest.fixture(scope="module")
def filled(tmp_path_factory):
    """A memory of another case than the one that is asked for."""
    folder = tmp_path_factory.mktemp("memory")
    found(str(folder), F)
    return folder


@pytest.mark.nightly
@pytest.mark.parametrize("what", OTHERS)
def test_what_changes_gives_a_new_inversion(filled, what):
    options = dict(OTHERS[what])
    records = options.pop("records", F)
    if options.pop("shapes", False):
        frequencies, shapes = evaluate_modes(TRUSS, THETA, options["dofs"])
        at_sensors = np.hstack([frequencies, shapes.swapaxes(1, 2).reshape(len(THETA), -1)])
        records = at_sensors * np.random.default_rng(1).normal(1, 0.005, at_sensors.shape)
    before = kept(filled, "inverted")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        known, again, fresh = (found(memory, records, **options) for memory in (str(filled), str(filled), None))
    assert_same(known, fresh)
    assert_same(again, fresh)
    assert kept(filled, "inverted") == before + 1


def test_what_is_found_of_records_comes_again_with_what_a_memory_reads(tmp_path):
    for memory in (str(tmp_path), str(tmp_path), None):
        with pytest.warns(SkthermoWarning) as caught:
            inverse(memory=memory).fit(F[:5]).transform(F[:5])
        assert [one.message.kind for one in caught] == ["few-records"]


@pytest.mark.filterwarnings("ignore:Stochastic Optimizer")
def test_without_a_seed_what_is_kept_is_always_the_same(tmp_path):
    network = trained(random_state=None, regressor=MLPRegressor(hidden_layer_sizes=(8,), max_iter=20))
    first, second, elsewhere = (
        network.set_params(memory=str(tmp_path / folder)).fit(F).transform(F) for folder in ("here", "here", "there")
    )
    np.testing.assert_array_equal(first, second)
    np.testing.assert_array_equal(first, elsewhere)
    assert kept(tmp_path / "here", "fit_outputs") == kept(tmp_path / "here", "drawn_samples") == 1


def test_a_chain_hands_its_memory_to_an_inverse_without_one(tmp_path):
    own, chains = tmp_path / "own", tmp_path / "chain"
    chain(str(chains), inverse=inverse(memory=str(own))).fit(T, F)
    assert [kept(own, kind) for kind in KINDS] == [1, 1]
    assert [kept(chains, kind) for kind in KINDS] == [0, 0]
    default = DataInformedFEM(TRUSS, memory=str(chains), random_state=0).fit(T, F)
    assert kept(chains, "inverted") == 1
    assert default.inverse_.memory == str(chains)


def test_a_memory_of_nowhere_keeps_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    nowhere = joblib.Memory(None)
    assert_same(found(nowhere, F), found(None, F))
    assert list(tmp_path.iterdir()) == []
