"""Records of experiments, clusters, frames and files of other packages."""

import numpy as np
import pandas as pd
import pytest

from skthermo.fem import sample
from skthermo.metrics import mape
from tests.drop_ins.recipes import run_recipe

pytestmark = pytest.mark.filterwarnings("default")  # warnings of other packages are not tested
PAGE = "drop_ins.rst"


def test_mlflow(folder):
    mlflow = pytest.importorskip("mlflow")
    for needed in ("sqlalchemy", "alembic"):
        pytest.importorskip(needed)
    recipe = run_recipe(PAGE, "recipe-records", "recipe-mlflow-run")
    later, fem = recipe["later"], recipe["fem"]
    run = mlflow.get_run(recipe["run"].info.run_id)
    assert run.data.params["inverse__noise"] == "auto"
    errors = mape(later.frequencies, fem.predict(later.temperatures))
    assert run.data.metrics == pytest.approx({f"mape_f{i + 1}": error for i, error in enumerate(errors)})
    file = mlflow.artifacts.download_artifacts(run_id=run.info.run_id, artifact_path="fem.joblib")
    predicted = recipe["joblib"].load(file).predict(later.temperatures)
    np.testing.assert_array_equal(predicted, fem.predict(later.temperatures))


def assert_same_bits(recipe):
    expected = sample(recipe["model"], 0.2, 1000, random_state=0)
    np.testing.assert_array_equal(recipe["drawn"].theta, expected.theta)
    np.testing.assert_array_equal(recipe["drawn"].frequencies, expected.frequencies)


@pytest.mark.nightly
def test_dask():
    pytest.importorskip("distributed")
    assert_same_bits(run_recipe(PAGE, "recipe-records", "recipe-dask-samples"))


def test_ray(folder, monkeypatch):
    ray = pytest.importorskip("ray")
    monkeypatch.setenv("RAY_AUTH_MODE", "disabled")
    monkeypatch.setenv("RAY_USAGE_STATS_ENABLED", "0")
    try:
        assert_same_bits(run_recipe(PAGE, "recipe-records", "recipe-ray-samples"))
    finally:
        ray.shutdown()


@pytest.mark.nightly
def test_polars():
    pytest.importorskip("polars")
    recipe = run_recipe(PAGE, "recipe-records", "recipe-polars-frames")
    T, F, fem = recipe["T"], recipe["F"], recipe["fem"]
    assert recipe["predicted"].columns == list(F.columns)
    assert recipe["lagged"].columns[:4] == ["T1_lag0", "T1_lag1", "T1_lag2", "T2_lag0"]
    np.testing.assert_array_equal(recipe["predicted"].to_numpy(), fem.fit(T, F).predict(T))


@pytest.mark.parametrize("reduce", [False, True])
def test_skops(folder, reduce):
    pytest.importorskip("skops")
    recipe = run_recipe(PAGE, "recipe-records")
    recipe = run_recipe(PAGE, "recipe-skops-files", **recipe | {"fem": recipe["fem"].set_params(reduce=reduce)})
    assert all(name.startswith(("skthermo.", "sklearn.")) for name in recipe["types"])
    fem, saved, weather = recipe["fem"], recipe["saved"], recipe["later"].temperatures
    pd.testing.assert_frame_equal(recipe["predicted"], fem.predict(weather))
    pd.testing.assert_frame_equal(saved.parameters_, fem.parameters_)
    assert repr(saved.report_) == repr(fem.report_)
    drawn = [one.simulate(weather, damage={"bottom": 0.2}, noise="fitted", random_state=0) for one in (saved, fem)]
    pd.testing.assert_frame_equal(*drawn)
