"""A typed user's script: type checkers verify each ``assert_type``, and a test verifies it again at run time."""

from typing import TypeAlias, assert_type

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.sparse import csc_array
from sklearn.linear_model import LinearRegression

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.fem import AffineModel, add_noise, evaluate, sample
from skthermo.metrics import error_table, mape, probability_of_detection, time_to_detection
from skthermo.preprocessing import BiasAligner, HingeFeatures, KNNGapImputer, LagFeatures, ModeTracker
from skthermo.studies import DetectabilityStudy, DetectionTask, detection_task, sweep
from skthermo.surrogate import (
    DataInformedFEM,
    InverseSurrogate,
    PosteriorInverse,
    TemperatureMapper,
    refitted,
    resampled,
    with_model,
)
from skthermo.updating import identifiability

Frame: TypeAlias = pd.DataFrame
Array: TypeAlias = NDArray[np.float64]

# From a year of records to a probability of detection.
year = make_truss_campaign(random_state=0)
model = make_truss()
fem = DataInformedFEM(model, random_state=0)
fem.fit(year.temperatures, year.frequencies)
weather = make_truss_campaign(random_state=1).temperatures
damaged = fem.simulate(weather, damage={"bottom": 0.2}, noise=0.01, random_state=0)
detector = MahalanobisDetector().fit(year.frequencies)
index = detector.damage_index(damaged)
assert_type(year.temperatures, Frame)
assert_type(year.theta, Frame)
assert_type(year.model, AffineModel)
assert_type(fem, DataInformedFEM)
assert_type(damaged, Frame)
assert_type(detector, MahalanobisDetector)
assert_type(index, pd.Series)
assert_type(detector.threshold_, float)
assert_type(probability_of_detection(index, detector.threshold_), float)

# Tables as frames and as arrays.
T, F = year.temperatures[::3], year.frequencies[::3]
t, f = T.to_numpy(), F.to_numpy()
lowest, highest = fem.predict_interval(T)
assert_type(lowest, Frame)
assert_type(highest, Frame)
assert_type(fem.predict(T), Frame)
assert_type(fem.predict(T, return_std=True)[1], Frame)
assert_type(fem.predict_parameters(T), Frame)
assert_type(fem.estimate_parameters(F), Frame)
assert_type(fem.extrapolation_distance(T), Frame)
from_arrays = DataInformedFEM(model, mapper=TemperatureMapper(LinearRegression()), random_state=0).fit(t, f)
assert_type(from_arrays.predict(t), Array)
assert_type(from_arrays.predict(t, return_std=True)[1], Array)
assert_type(from_arrays.predict_interval(t)[0], Array)
assert_type(from_arrays.predict_parameters(t), Array)
assert_type(from_arrays.estimate_parameters(f), Array)
assert_type(from_arrays.recorder_.residuals.expected(from_arrays.weather(t).inputs), Array)
assert_type(from_arrays.simulate(t, noise="fitted", random_state=0), Array)
assert_type(from_arrays.score(t, f), float)

# Each step alone.
assert_type(LagFeatures(3).fit(T).transform(T), Frame)
assert_type(LagFeatures(3).fit_transform(T), Frame)
assert_type(LagFeatures(3).fit_transform(t), Array)
assert_type(LagFeatures(3).fit(t).transform(t.tolist()), Array)
assert_type(HingeFeatures().fit_transform(T), Frame)
assert_type(HingeFeatures().fit(t).transform(t), Array)
assert_type(KNNGapImputer().fit(F).transform(F), Frame)
assert_type(KNNGapImputer().fit(f).transform(f), Array)
aligner = BiasAligner(model).fit(F)
assert_type(aligner.transform(F), Frame)
assert_type(aligner.inverse_transform(F), Frame)
assert_type(BiasAligner(model).fit(f).transform(f), Array)
assert_type(BiasAligner(model).fit(f).inverse_transform(f), Array)
inverse = InverseSurrogate(model, noise=0.01, n_samples=200, random_state=0)
assert_type(inverse.fit_transform(F), Frame)
assert_type(inverse.transform(F), Frame)
theta = InverseSurrogate(model, noise=0.01, n_samples=200, random_state=0).fit_transform(f)
assert_type(theta, Array)
assert_type(inverse.fit().predict(f), Array)
assert_type(inverse.inverse_transform(pd.DataFrame(theta, columns=list(model.parameter_names))), Frame)
assert_type(inverse.inverse_transform(theta), Array)
posterior = PosteriorInverse(model).fit(F)
assert_type(posterior.transform(F), Frame)
assert_type(PosteriorInverse(model).fit(f).transform(f), Array)
assert_type(posterior.inverse_transform(theta), Array)
mapper = TemperatureMapper(LinearRegression()).fit(t, theta)
assert_type(mapper, TemperatureMapper)
assert_type(mapper.predict(t), Array)
tracked = ModeTracker((model.frequencies(np.ones((1, 4)))[0], None), max_shift=0.03).fit().transform(F)
assert_type(tracked.frequencies, Frame)
assert_type(tracked.left_over, pd.Series)

# Residuals, detectors and measures of both.
both = T.join(F)
compensator = TemperatureCompensator(LinearRegression(), targets=list(F))
residuals = compensator.fit_transform(both)
assert_type(residuals, Frame)
assert_type(compensator.transform(both), Frame)
assert_type(compensator.extrapolation_distance(both), Frame)
by_position = TemperatureCompensator(LinearRegression(), targets=[3, 4, 5, 6, 7, 8])
assert_type(by_position.fit_transform(both.to_numpy()), Array)
assert_type(by_position.transform(both.to_numpy()), Array)
assert_type(by_position.extrapolation_distance(both.to_numpy()), Array)
on_residuals = MahalanobisDetector(contamination=0.1).fit(residuals)
assert_type(on_residuals.damage_index(residuals), pd.Series)
assert_type(MahalanobisDetector().fit(year.frequencies.to_numpy()).damage_index(f), Array)
assert_type(on_residuals.predict(residuals), NDArray[np.int64])
assert_type(time_to_detection([1.0, 2.0], 1.5), float)
assert_type(mape(F, fem.predict(T)), Array)
assert_type(error_table(F, fem.predict(T)), Frame)

# A chain in a study and in a task of scikit-learn's searches.
scenarios = sweep(model, (0.1, 0.2), groups=["bottom"])
study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=2, uncertainty="noise", random_state=0)
assert_type(study, DetectabilityStudy)
assert_type(study.run(weather), Frame)
task = detection_task(fem, weather, scenarios, random_state=0)
assert_type(task, DetectionTask)
assert_type(refitted(fem, T, F), DataInformedFEM)
assert_type(resampled(fem, 0), DataInformedFEM)
assert_type(with_model(fem, model), DataInformedFEM)

# The model.
drawn = sample(model, 0.2, 50, random_state=0)
assert_type(drawn.theta, Array)
assert_type(drawn.frequencies, Array)
assert_type(evaluate(model, drawn.theta), Array)
assert_type(model.frequencies(drawn.theta), Array)
assert_type(add_noise(drawn.frequencies, 0.01, random_state=0), Array)
springs = AffineModel({("k",): csc_array([[2.0, -1.0], [-1.0, 1.0]])}, np.eye(2), n_modes=2)
assert_type(springs.frequencies([[1.0]]), Array)
assert_type(springs.jacobian([[1.0]]), Array)
assert_type(springs.damaged({"k": 0.1}).modes([[1.0]])[1], Array)
known = identifiability(model, noise=0.001)
assert_type(known.deviations, pd.Series)
assert_type(known.recommended, list[str])
