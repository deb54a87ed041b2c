"""Parameters of parts that are still None, and what a fit tells about its stages."""

import re

import numpy as np
import pytest
from sklearn.base import clone
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline

from skthermo.detection import MahalanobisDetector
from skthermo.preprocessing import LagFeatures
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, PosteriorInverse, TemperatureMapper
from tests.surrogate.chains import TRUSS, YEAR

T, F = YEAR.temperatures.iloc[::3], YEAR.frequencies.iloc[::3]
INVERSE = InverseSurrogate(TRUSS, Ridge(), bounds=0.2, noise=0.01, n_samples=60, random_state=0)


def chain(**parameters):
    fem = DataInformedFEM(TRUSS, inverse=clone(INVERSE), mapper=TemperatureMapper(LinearRegression()))
    return fem.set_params(**{"discrepancy": None} | parameters)


def test_parameters_of_default_parts_put_the_part_in_place():
    fem = DataInformedFEM(TRUSS)
    assert fem.get_params()["inverse"] is None
    assert "inverse__noise" not in fem.get_params()
    fem.set_params(reduce=1e-4, n_jobs=1, inverse__noise=0.02)
    fem.set_params(mapper__regressor__hingefeatures__n_knots=2)
    expected = PosteriorInverse(reduce=1e-4, n_jobs=1, noise=0.02).get_params(deep=False)
    assert fem.inverse.get_params(deep=False) == expected
    assert fem.mapper.regressor[0].n_knots == clone(fem).get_params()["mapper__regressor__hingefeatures__n_knots"] == 2
    assert DataInformedFEM(TRUSS).inverse is None
    again = fem.set_params(inverse=None, inverse__noise=0.03).inverse
    assert (again.noise, again.prior) == (0.03, "learned")


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("inverse__samples", r"Invalid parameter 'samples' for estimator PosteriorInverse\(\). Valid parameters are"),
        ("mapping__regressor", "Invalid parameter 'mapping' for estimator DataInformedFEM"),
        ("imputer__n_neighbors", "imputer is 'passthrough', without parameters such as 'n_neighbors'; expected an"),
        ("model__E", r"model is AffineModel\(.*\), without parameters such as 'E'"),
    ],
)
def test_unknown_parameters_are_named_and_change_nothing(name, message):
    fem = DataInformedFEM(TRUSS)
    with pytest.raises(ValueError, match=message):
        fem.set_params(**{name: 1})
    assert fem.inverse is fem.mapper is None


def lines_of(text):
    return re.findall(r"\[(\w+)\] \.+ (\(.*), total= +\d+\.\d[a-z]+", text)


@pytest.mark.filterwarnings("ignore:.*few-records")
def test_verbose_tells_the_stages(capsys):
    quiet = chain().fit(T, F)
    assert capsys.readouterr().out == ""
    fem = chain(verbose=True).fit(T, F)
    outer = ["noise", "inverse", "parameters of the records", "temperature mapper", "discrepancy and report"]
    expected = [("DataInformedFEM", f"({i} of 5) {name}") for i, name in enumerate(outer, 1)]
    assert lines_of(capsys.readouterr().out) == expected
    scenarios = sweep(fem, (0.2,), groups=["bottom"])
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=2, verbose=1, uncertainty="noise")
    study.run(T)
    stages = ["detectors", "frequencies", "repeats"]
    found = lines_of(capsys.readouterr().out)
    assert found == [("DetectabilityStudy", f"({i} of 3) {name}") for i, name in enumerate(stages, 1)]
    with pytest.raises(ValueError, match="verbose is 'much'; expected a boolean or an integer from 0"):
        study.set_params(verbose="much").run(T)
    with pytest.raises(ValueError, match="'verbose' parameter"):
        quiet.set_params(verbose="much").fit(T, F)


class Recorder:
    """Keeps what scikit-learn tells a callback."""

    max_propagation_depth = 1

    def __init__(self):
        self.tasks = []

    def setup(self, estimator, context):
        self.tasks.append("setup")

    def teardown(self, estimator, context):
        self.tasks.append("teardown")

    def on_fit_task_begin(self, estimator, context):
        self.tasks.append((type(estimator).__name__, context.task_name, context.max_subtasks))

    def on_fit_task_end(self, estimator, context):
        self.tasks.append(context.task_name)


def test_callbacks_see_the_stages():
    pytest.importorskip("sklearn.callback")  # from scikit-learn 1.9
    recorder = Recorder()
    fem = chain(mapper=make_pipeline(LagFeatures(1), TemperatureMapper(LinearRegression()))).set_callbacks(recorder)
    twin = clone(fem).fit(T, F)
    begun = [task for task in recorder.tasks if isinstance(task, tuple)]
    assert begun[0] == ("DataInformedFEM", "fit", 5)
    assert recorder.tasks[0] == "setup"
    assert ("Pipeline", "fit", 2) in begun
    last = "discrepancy and report"
    assert recorder.tasks[-4:] == [("DataInformedFEM", last, 0), last, "fit", "teardown"]
    np.testing.assert_array_equal(twin.predict(T), clone(fem).set_callbacks().fit(T, F).predict(T))
    with pytest.raises(ValueError, match="constant"):
        fem.fit(T, F.assign(f1=1.0))
    with pytest.raises(ValueError, match="bounds"):
        fem.set_params(inverse__bounds=-1).fit(T, F)
    assert recorder.tasks[-1] == "teardown"
