"""Works that ``speed.py`` times; one of them in this process, with the skthermo that PYTHONPATH names.

    python tests/benchmarks/works.py NAME [--quick] [--results FILE.npz]

Prints JSON: processor seconds of the work and of what stands beside it (a loop of eigsh, pandas, ...), peak megabytes.
Works use what every state of the library offers: public names, default settings.
"""

import argparse
import contextlib
import json
import os
import resource
import sys
import tempfile
import time
import warnings
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.io
import scipy.signal  # which the library loads once it is used
import scipy.sparse.linalg
from blind_bridge import GROUPS, MODES, SENSORS, Bridge, footbridge, lagged
from bridges import frame_bridge
from joblib.externals.loky import get_reusable_executor
from sklearn.impute import KNNImputer
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV, KFold
from sklearn.pipeline import make_pipeline

from skthermo.datasets import load_z24, make_kw51, make_kw51_campaign, make_truss, make_truss_campaign, make_z24
from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.fem import AffineModel, add_noise, linearise, sample
from skthermo.monitoring import Monitor
from skthermo.preprocessing import BiasAligner, KNNGapImputer, LagFeatures
from skthermo.studies import DetectabilityStudy, identify_damage, sweep
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from skthermo.updating import ModelUpdater

sys.path.append(str(Path(__file__).parents[2] / "examples"))
from detector_recipes import field_detectors

DATA = Path(os.environ["SKTHERMO_DATA"]) if "SKTHERMO_DATA" in os.environ else None
BOUNDS = 0.3
EXACT = 1e-9  # largest relative difference of full solves
REDUCED = 1e-7  # a hundredth of the default tolerance of reduced models
NEARLY = 2e-3  # a few decisions in a thousand, which surfaces may turn
NOT_COMPARED = np.inf


@dataclass
class Clock:
    """Processor seconds of the work, of its worker processes, and of what it is compared with."""

    seconds: float = 0.0
    reference: float = 0.0
    results: dict = field(default_factory=dict)

    @contextlib.contextmanager
    def work(self):
        start = processor_seconds()
        yield
        self.seconds += processor_seconds() - start

    @contextlib.contextmanager
    def beside(self, times=1.0):
        """What counts so many times."""
        start = processor_seconds()
        yield
        self.reference += times * (processor_seconds() - start)

    def keep(self, limit, **results):
        """Results to compare with those of another state, to this relative difference."""
        self.results |= {f"{name}|{limit}": np.asarray(values, dtype=float) for name, values in results.items()}


def processor_seconds():
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime


def building_frame():
    """2302 degrees of freedom, 913 of them massless, and 14 parameters."""
    content = scipy.io.loadmat(DATA / "building_frame" / "ConcreteBuildingFrame.mat")
    names = [f"E_{i}" for i in range(1, 13)] + ["Influence_Link", "Influence_Rebar"]
    return AffineModel({(name,): content[name] for name in names}, content["M0"])


def draw(model, n_samples, seed=0, bounds=BOUNDS):
    share = np.random.default_rng(seed).uniform(-1, 1, (n_samples, len(model.parameter_names)))
    return 1 + bounds * share


def eigsh_loop(model, n_samples):
    """A function that solves ready-made matrices, one after the other."""
    matrices = [model.matrices(theta) for theta in draw(model, n_samples)]
    return lambda: [scipy.sparse.linalg.eigsh(K, model.n_modes, M, sigma=0) for K, M in matrices]


def loop(clock, quick):
    """The machine: a loop of eigsh over the building frame, seconds a solve."""
    solve = eigsh_loop(building_frame(), 10)
    with clock.beside(1 / 10):
        solve()
    clock.seconds = clock.reference


def frame_samples(clock, quick, n_samples):
    model = building_frame()
    n_loop = 5 if quick else 20
    solve = eigsh_loop(model, n_loop)
    with clock.beside(n_samples / n_loop):
        solve()
    with clock.work():
        reduced = model.reduced(BOUNDS, random_state=0)
        drawn = sample(reduced, BOUNDS, n_samples, random_state=0)
    full = model.frequencies(drawn.theta[:50])
    clock.keep(REDUCED, frequencies=drawn.frequencies)
    clock.keep(NOT_COMPARED, error=np.abs(drawn.frequencies[:50] / full - 1).max())


def frame_1000(clock, quick):
    """Reduced models of the building frame: basis and 1000 samples."""
    frame_samples(clock, quick, 100 if quick else 1000)


def frame_10000(clock, quick):
    """Reduced models of the building frame: basis and 10,000 samples."""
    frame_samples(clock, quick, 1000 if quick else 10_000)


def frame_linearise(clock, quick):
    """Frequencies and derivatives of 1000 rows of the frame's reduced model."""
    reduced = building_frame().reduced(BOUNDS, random_state=0)
    theta = draw(reduced, 100 if quick else 1000, bounds=0.99 * BOUNDS)
    with clock.work():
        frequencies, jacobian = linearise(reduced, theta)
    clock.keep(REDUCED, frequencies=frequencies)
    clock.keep(1e-5, derivatives=jacobian / np.abs(jacobian).max(axis=2, keepdims=True) + 1)


def hourly_year(n_hours):
    """Temperatures of KW51, and frequencies of stiffnesses that fall as it warms."""
    random, hour = np.random.default_rng(0), np.arange(n_hours)
    season, day = np.sin(2 * np.pi * hour / 8760), np.sin(2 * np.pi * hour / 24)
    air = 10 + 10 * season + 5 * day + random.standard_normal(n_hours)
    theta = 1 - 4e-4 * np.outer(air - 10, [1.0, 1.2, 0.8, 1.0, 0.9])
    F = add_noise(make_kw51().reduced(0.05, random_state=0).frequencies(theta), 0.001, random_state=0)
    stamps = pd.date_range("2025-01-01", periods=n_hours, freq="h")
    return pd.DataFrame({"T": air}, stamps), pd.DataFrame(F, stamps, [f"f{mode + 1}" for mode in range(6)])


def kw51_by_hand(clock, quick):
    """Fit of a chain to an hourly year of KW51, complete rows, the reduced model made by hand before."""
    T, F = hourly_year(800 if quick else 8760)
    model = make_kw51().reduced(BOUNDS, random_state=0)
    inverse = PosteriorInverse(model, noise=0.001)
    fem = DataInformedFEM(model, inverse=inverse, mapper=TemperatureMapper(Ridge()), random_state=0)
    with clock.work():
        fem.fit(T, F)
    clock.keep(1e-6, predictions=fem.predict(T[::50]), parameters=fem.predict_parameters(T[::50]))


def kw51_damaged(clock, quick):
    """Fit to an hourly year of KW51 and simulation of it in fifteen states of damage, beside 100 full solves."""
    T, F = hourly_year(800 if quick else 8760)
    model = make_kw51()
    inverse = PosteriorInverse(noise=0.001, reduce=True)
    fem = DataInformedFEM(model, inverse=inverse, mapper=TemperatureMapper(Ridge()), reduce=True, random_state=0)
    with clock.work():
        fem.fit(T, F)
        damages = [{group: severity} for group in [*model.groups][:5] for severity in (0.05, 0.1, 0.2)]
        simulated = [fem.simulate(T, damage=damage) for damage in damages]
    clock.keep(1e-6, simulated=np.stack([frequencies[::50] for frequencies in simulated]))
    rows = np.random.default_rng(1).choice(len(T), 20, replace=False)
    theta = fem.predict_parameters(T.iloc[rows])
    full = np.stack([model.damaged(damage).frequencies(theta) for damage in damages])
    clock.keep(NOT_COMPARED, error=np.abs(np.stack([f.iloc[rows] for f in simulated]) / full - 1).max())


def kw51_with_gaps(clock, quick, *, updated=True):
    """The same as a user writes it: reduce=True, modes missing as in the real file."""
    campaign = make_kw51_campaign(n_hours=1236 + (400 if quick else 8760), retrofit=False, random_state=0)
    T, F = campaign.temperatures[1236:], campaign.frequencies[1236:]
    inverse = PosteriorInverse(noise=0.002, reduce=True)
    fem = DataInformedFEM(make_kw51(updated=updated), inverse=inverse, reduce=True, random_state=0)
    with clock.work():
        fem.fit(T, F)
    clock.keep(1e-6, predictions=fem.predict(T[::50]), parameters=fem.predict_parameters(T[::50]))


def kw51_not_updated(clock, quick):
    """The same with a model whose modes are 2 to 12 % from the measured ones."""
    kw51_with_gaps(clock, quick, updated=False)


def frame_records(model, n_days):
    """Daily temperatures, and frequencies of stiffnesses that fall as it warms."""
    random, day = np.random.default_rng(0), np.arange(n_days)
    air = 10 - 12 * np.cos(2 * np.pi * day / 365) + 3 * random.standard_normal(len(day))
    slopes = -4e-4 * random.uniform(0.5, 1.5, len(model.parameter_names))
    F = add_noise(
        model.reduced(0.05, random_state=0).frequencies(1 + np.outer(air - 10, slopes)), 0.001, random_state=0
    )
    stamps = pd.date_range("2025", periods=len(day), freq="D")
    return pd.DataFrame({"T": air}, stamps), pd.DataFrame(F, stamps).add_prefix("f")


def frame_chain(clock, quick):
    """Fit of a chain to 365 rows of the exported frame, reduce=True."""
    model = building_frame()
    T, F = frame_records(model, 10 if quick else 365)
    inverse = PosteriorInverse(noise=0.001, reduce=True)
    fem = DataInformedFEM(model, inverse=inverse, mapper=TemperatureMapper(Ridge()), reduce=True, random_state=0)
    with clock.work():
        fem.fit(T, F)
    clock.keep(1e-6, predictions=fem.predict(T), parameters=fem.predict_parameters(T))


def grid_search(clock, quick):
    """GridSearchCV over 12 settings of M2 in 5 folds, memory on; a month of hourly records of the truss."""
    campaign = make_truss_campaign(samples_per_year=8760, samples_per_day=24, random_state=0)
    rows = slice(0, 240 if quick else 720)
    T, F = campaign.temperatures[rows], campaign.frequencies[rows]
    with tempfile.TemporaryDirectory() as memory:
        fem = DataInformedFEM(
            make_truss(),
            inverse=PosteriorInverse(noise=0.01, memory=memory),
            mapper=make_pipeline(LagFeatures(freq="1h"), TemperatureMapper(Ridge())),
            random_state=0,
        )
        lags = [1, 24] if quick else [1, 6, 12, 24]
        settings = {"mapper__lagfeatures__lags": lags, "mapper__temperaturemapper__regressor__alpha": [0.1, 1.0, 10.0]}
        search = GridSearchCV(fem, settings, cv=KFold(5))
        with clock.work():
            search.fit(T, F)
    clock.keep(1e-6, scores=search.cv_results_["mean_test_score"], predictions=search.predict(T[:100]))


def two_hourly(n_rows):
    """Records whose frequencies follow three temperatures, with noise that is larger in frost."""
    random, row = np.random.default_rng(0), np.arange(n_rows)
    season, day = 10 * np.sin(2 * np.pi * row / 4380), 4 * np.sin(2 * np.pi * row / 12)
    T = 8 + np.add.outer(season + day, np.zeros(3)) + 2 * random.standard_normal((n_rows, 3))
    slopes = 0.01 * random.uniform(0.5, 1.5, (3, 6))
    F = 10 - T @ slopes + np.where(T[:, :1] < 0, 0.03, 0.01) * random.standard_normal((n_rows, 6))
    stamps = pd.date_range("2023", periods=n_rows, freq="2h")
    return pd.DataFrame(T, stamps).add_prefix("T").join(pd.DataFrame(F, stamps).add_prefix("f"))


def local_whitening(clock, quick):
    """TemperatureCompensator(whiten="local") over 13,140 records."""
    records = two_hourly(2000 if quick else 13_140)
    compensator = TemperatureCompensator(LinearRegression(), targets=[f"f{mode}" for mode in range(6)], whiten="local")
    with clock.work():
        learned = compensator.fit_transform(records)
        transformed = compensator.transform(records)
    clock.keep(1e-7, learned=1 + np.abs(learned), transformed=1 + np.abs(transformed))


def lags_of(clock, n_sensors, n_rows=8760):
    random = np.random.default_rng(0)
    T = pd.DataFrame(random.standard_normal((n_rows, n_sensors)), pd.date_range("2020", periods=n_rows, freq="h"))
    T = T.add_prefix("T")
    for _ in range(max(200 // n_sensors * 8760 // n_rows, 5)):
        with clock.beside():
            pd.concat([T.shift(k) for k in range(24)], axis=1)
        with clock.work():
            found = LagFeatures(24, freq="1h").fit_transform(T)
    clock.keep(0.0, lags=found)


def lag_features(clock, quick):
    """24 lags of 8760 x 7 temperatures, regular stamps."""
    lags_of(clock, 7)


def lag_features_of_one(clock, quick):
    """24 lags of 8760 temperatures of one sensor, regular stamps."""
    lags_of(clock, 1)


def lag_features_of_many(clock, quick):
    """24 lags of 100,000 x 7 temperatures, regular stamps."""
    lags_of(clock, 7, 10_000 if quick else 100_000)


def gaps(clock, quick, n_rows=30_000):
    """KNNGapImputer beside KNNImputer: seven correlated columns, 10 % missing."""
    random = np.random.default_rng(0)
    values = random.standard_normal((3000 if quick else n_rows, 7)) @ random.standard_normal((7, 7))
    values[random.random(values.shape) < 0.1] = np.nan
    with clock.work():
        filled = KNNGapImputer(n_neighbors=10).fit_transform(values)
    with clock.beside():
        reference = KNNImputer(n_neighbors=10).fit_transform(values)
    clock.keep(EXACT, filled=filled)
    clock.keep(NOT_COMPARED, error=np.abs(filled - reference).max())


def intervals(clock, quick):
    """Prediction intervals of an hourly year of the truss, 5 % of the frequencies missing."""
    n_rows = 1460 if quick else 8760
    campaign = make_truss_campaign(samples_per_year=n_rows, samples_per_day=n_rows // 365, random_state=0)
    T, F = campaign.temperatures, campaign.frequencies
    F = F.mask(np.random.default_rng(0).random(F.shape) < 0.05)
    fem = DataInformedFEM(make_truss(), random_state=0).fit(T, F)
    fem.predict_interval(T)  # whose residuals are kept
    with clock.work():
        bounds = fem.predict_interval(T)
    clock.keep(1e-6, bounds=np.stack([np.asarray(one) for one in bounds[:2]]))


def drawn_models(clock, quick):
    """Two models drawn from the calibration of KW51's reduced model."""
    model = make_kw51().reduced(BOUNDS, random_state=0)
    measured = model.frequencies(draw(model, 1, bounds=0.1))[0]
    update = ModelUpdater(model, prior=0.15).fit(measured, frequency_std=0.005 * measured)
    with clock.work():
        models = update.sample_models(2, random_state=0)
    nominal = np.ones((1, len(model.parameter_names)))
    clock.keep(1e-3, frequencies=np.stack([one.frequencies(nominal) for one in models]))


def truss_chain(clock, quick):
    """Fit and predictions of the truss's chain, a year of daily records."""
    year = make_truss_campaign(random_state=0)
    fem = DataInformedFEM(make_truss(), inverse=PosteriorInverse(noise=0.01), random_state=0)
    with clock.work():
        fem.fit(year.temperatures, year.frequencies)
        predicted, deviations = fem.predict(year.temperatures, return_std=True)
    clock.keep(1e-6, predictions=predicted)
    clock.keep(1e-4, deviations=deviations)


def z24_chain(clock, quick):
    """Fit and predictions of the chain of the measured Z24 bridge, 2240 records."""
    data = load_z24(DATA / "z24" / "z24_monitoring.csv")
    T, F = data.temperatures[:2240], data.frequencies[:2240]
    model = make_z24().reduced([[0.4, 4.0]] * 4, random_state=0)
    inverse, aligner = PosteriorInverse(noise=0.005), BiasAligner(method="scale")
    fem = DataInformedFEM(model, inverse=inverse, aligner=aligner, random_state=0)
    with clock.work():
        predicted = fem.fit(T, F).predict(data.temperatures)
    clock.keep(1e-6, predictions=predicted)


def solves_of(clock, model, n_samples):
    theta = draw(model, n_samples)
    with clock.work():
        frequencies = model.frequencies(theta)
        jacobian = model.jacobian(draw(model, n_samples // 2, bounds=0.99 * BOUNDS))
    clock.keep(EXACT, frequencies=frequencies)
    clock.keep(1e-7, derivatives=jacobian / np.abs(jacobian).max(axis=2, keepdims=True) + 1)


def full_truss(clock, quick):
    """Full solves and derivatives: the truss."""
    solves_of(clock, make_truss(), 2000 if quick else 20_000)


def full_kw51(clock, quick):
    """Full solves and derivatives: KW51."""
    solves_of(clock, make_kw51(), 20 if quick else 100)


def full_frame(clock, quick):
    """Full solves and derivatives: the building frame."""
    solves_of(clock, building_frame(), 10 if quick else 50)


def full_bridge(clock, quick):
    """Full solves and derivatives: a tied-arch bridge of 20,940 degrees of freedom."""
    solves_of(clock, frame_bridge(), 4 if quick else 20)


def bridge_basis(clock, quick):
    """A reduced model of a tied-arch bridge of 20,940 degrees of freedom, and 1000 samples."""
    model = frame_bridge(*((10, 2, 3) if quick else (40, 4, 9)))
    with clock.work():
        drawn = sample(model.reduced(BOUNDS, random_state=0), BOUNDS, 1000, random_state=0)
    clock.keep(REDUCED, frequencies=drawn.frequencies)


def tracking(clock, quick):
    """Modes followed by shape: Z24, full and reduced."""
    model = make_z24()
    reduced = model.reduced(BOUNDS, random_state=0)
    with clock.work():
        full = model.frequencies(draw(model, 20 if quick else 400))
        small = reduced.frequencies(draw(model, 200 if quick else 10_000))
    clock.keep(EXACT, full=full)
    clock.keep(REDUCED, reduced=small)


def kw51_reduced(clock, quick):
    """10,000 solves of KW51's reduced model, 1000 derivatives."""
    reduced = make_kw51().reduced(BOUNDS, random_state=0)
    with clock.work():
        frequencies = reduced.frequencies(draw(reduced, 1000 if quick else 10_000))
        linearise(reduced, draw(reduced, 1000, bounds=0.99 * BOUNDS))
    clock.keep(REDUCED, frequencies=frequencies)


def truss_years():
    """A fitted chain of the truss, its records, and those of a damaged year."""
    year = make_truss_campaign(random_state=0)
    later = make_truss_campaign(random_state=1, damage={"bottom": 0.2})
    inverse = PosteriorInverse(noise=0.01)
    fem = DataInformedFEM(make_truss(), inverse=inverse, random_state=0).fit(year.temperatures, year.frequencies)
    return fem, year, later


def identified(clock, quick):
    """identify_damage: a damaged year of the truss, five times."""
    fem, _, later = truss_years()
    with clock.work():
        for _ in range(5):
            found = identify_damage(fem, later.temperatures, later.frequencies, random_state=0)
    clock.keep(1e-4, severities=1 + found.table["severity"].to_numpy(dtype=float))


def detectability(clock, quick):
    """A detectability study of the truss: 2 detectors, 7 scenarios."""
    fem, year, _ = truss_years()
    modes = list(year.frequencies)
    detectors = {
        "raw": MahalanobisDetector(),
        "compensated": make_pipeline(TemperatureCompensator(LinearRegression(), targets=modes), MahalanobisDetector()),
    }
    scenarios = [{}, *({group: s} for group in ("bottom", "top", "diagonal") for s in (0.1, 0.2))]
    uncertainty = ("noise",) if quick else ("noise", "baseline")
    study = DetectabilityStudy(fem, detectors, scenarios, n_repeats=5, uncertainty=uncertainty, random_state=0)
    with clock.work():
        table = study.run(year.temperatures, year.frequencies)
    clock.keep(NEARLY, rates=1 + table["rate"])


def truss_study(clock, quick):
    """A study of the truss by default: one detector, 16 scenarios, 20 repeats."""
    fem, _, later = truss_years()
    scenarios = sweep(fem, (0.05, 0.1, 0.15, 0.2, 0.3), groups=["bottom", "top", "diagonal"])
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=20, random_state=0)
    with clock.work():
        table = study.run(later.temperatures)
    clock.keep(NEARLY, rates=1 + table["rate"])


def footbridge_study(clock, quick, uncertainty=None):
    """A study of the footbridge of ``blind_bridge.py`` by default: seven states, 4380 records, two detectors."""
    bridge = Bridge(0)
    records, later = bridge.training(True), bridge.T[bridge.n :]
    model = footbridge(pylon=1.1).assemble(GROUPS, n_modes=len(MODES), track=True)
    fem = DataInformedFEM(model, random_state=0).fit(records[SENSORS], records[MODES])
    damages = [("side span", 0.06), ("side span", 0.12), ("main stays", 0.03), ("main stays", 0.06)]
    scenarios = [{}, *({group: s} for group, s in [*damages, ("bearings", 0.1), ("pylon", 0.15)])]
    compensator = TemperatureCompensator(lagged(TemperatureMapper()), targets=MODES)
    lasts = {"single": MahalanobisDetector(), "day": WindowedAlarm("1D")}
    detectors = {name: make_pipeline(compensator, last) for name, last in lasts.items()}
    options = {} if uncertainty is None else {"uncertainty": uncertainty}
    study = DetectabilityStudy(fem, detectors, scenarios[:3] if quick else scenarios, random_state=0, **options)
    with clock.work():
        table = study.run(later)
    clock.keep(NOT_COMPARED, error=(table["pi_high"] - table["pi_low"]).mean())


def many_detectors(clock, quick):
    """A study of eight detectors on 13 states of the truss, 20 repeats, beside a study for each."""
    fem, year, later = truss_years()
    everyone = field_detectors(list(year.frequencies))
    names = ["raw, Mahalanobis", "raw, isolation forest", "raw, 20 neighbours", "raw, Gaussian mixture"]
    names += ["linear regression", "piecewise-linear", "piecewise-linear, whitened", "conditional covariance"]

    def decisions(*chosen):
        detectors = {name: everyone[name] for name in chosen}
        options = {"n_repeats": 2 if quick else 20, "random_state": 0, "uncertainty": "noise"}
        study = DetectabilityStudy(fem, detectors, sweep(fem, (0.1, 0.2, 0.3)), **options)
        study.run(later.temperatures)
        return study.decisions_

    with clock.work():
        together = decisions(*names)
    with clock.beside():
        alone = [decisions(name) for name in names]
    differ = [not np.array_equal(d, together[key], equal_nan=True) for one in alone for key, d in one.items()]
    clock.keep(NOT_COMPARED, error=np.mean(differ))


def hourly_monitor(n_years=2):
    campaign = make_truss_campaign(n_years, samples_per_year=8760, samples_per_day=24, random_state=0)
    records = campaign.temperatures.join(campaign.frequencies)
    weather = make_pipeline(LagFeatures([0, 6, 24], freq="1h"), LinearRegression())
    compensator = TemperatureCompensator(weather, targets=list(campaign.frequencies))
    return Monitor(make_pipeline(compensator, WindowedAlarm("24h")), random_state=0), records


def numbers(states):
    return pd.DataFrame(states).select_dtypes("number")


def monitor_fit(clock, quick):
    """Monitor.fit, a year of hourly records."""
    monitor, records = hourly_monitor()
    with clock.work():
        monitor.fit(records[: 2000 if quick else 8760])
    clock.keep(1e-7, states=numbers(monitor.update(records[8760:9000])))


def monitor_update(clock, quick):
    """Monitor.update, sixty single days."""
    monitor, records = hourly_monitor()
    monitor.fit(records[:8760])
    with clock.work():
        states = [monitor.update(records[start : start + 24]) for start in range(8760, 8760 + 60 * 24, 24)]
    clock.keep(1e-7, states=pd.concat([numbers(state) for state in states]))


def monitor_update_later(clock, quick):
    """Monitor.update, sixteen single days after ten years of hourly records, beside those after one year."""
    n_years = 2 if quick else 10
    monitor, records = hourly_monitor(n_years + 2)
    monitor.fit(records[:8760])
    for clocked, first in ((clock.beside, 8760), (clock.work, 8760 * n_years)):
        for start in range(8760 + 16 * 24, first, 730):
            monitor.update(records[start : min(start + 730, first)])
        with clocked():
            states = [monitor.update(records[start : start + 24]) for start in range(first, first + 16 * 24, 24)]
    clock.keep(1e-7, states=pd.concat([numbers(state) for state in states]))


def updater(clock, quick):
    """ModelUpdater on KW51's reduced model, 20 starts; on the truss, with 20 calibrated models."""
    for model, n_starts, n_models in ((make_kw51().reduced(BOUNDS, random_state=0), 20, 0), (make_truss(), 1, 20)):
        truth = model.frequencies(draw(model, 1, bounds=0.2))
        measured = add_noise(np.repeat(truth, 10, axis=0), 0.001, random_state=0)
        update = ModelUpdater(model, n_starts=n_starts, prior=0.3, random_state=0)
        with clock.work():
            update.fit(measured, frequency_std=0.001 * truth[0])
            if n_models:
                update.sample_models(n_models, random_state=0)
        clock.keep(1e-5, **{f"theta of {n_starts} starts": update.theta_})


def two_jobs(clock, quick):
    """sample over two processes, KW51's full model."""
    model = make_kw51()
    with clock.work():
        drawn = sample(model, BOUNDS, 64 if quick else 256, n_jobs=2, random_state=0)
        get_reusable_executor().shutdown(wait=True)
    clock.keep(EXACT, frequencies=drawn.frequencies)


def ten_minutes(clock, quick):
    """A year at ten minutes (52,560 rows) of the truss: fit, predict, simulate with fitted noise."""
    rows = 4000 if quick else 52_560
    random, row = np.random.default_rng(0), np.arange(rows)
    T = 10 + 10 * np.sin(2 * np.pi * row / 52_560) + 5 * np.sin(2 * np.pi * row / 144)
    T = T[:, np.newaxis] + random.standard_normal((rows, 3))
    model = make_truss()
    F = add_noise(model.frequencies(1 - 4e-4 * (T[:, [0, 1, 2, 0]] - 10)), 0.005, random_state=0)
    stamps = pd.date_range("2025", periods=rows, freq="10min")
    T, F = pd.DataFrame(T, stamps).add_prefix("T"), pd.DataFrame(F, stamps).add_prefix("f")
    fem = DataInformedFEM(model, inverse=PosteriorInverse(noise=0.005), random_state=0)
    with clock.work():
        predicted = fem.fit(T, F).predict(T)
        fem.simulate(T, noise="fitted", random_state=0)
    clock.keep(1e-6, predictions=predicted[::50])


WORKS = {
    "loop": loop,
    "frame-1000": frame_1000,
    "frame-10000": frame_10000,
    "frame-linearise": frame_linearise,
    "kw51-by-hand": kw51_by_hand,
    "kw51-damaged": kw51_damaged,
    "kw51-gaps": kw51_with_gaps,
    "kw51-not-updated": kw51_not_updated,
    "frame-chain": frame_chain,
    "grid-search": grid_search,
    "local-whitening": local_whitening,
    "lags": lag_features,
    "lags-one": lag_features_of_one,
    "lags-many": lag_features_of_many,
    "gaps": gaps,
    "gaps-year": partial(gaps, n_rows=8760),
    "intervals": intervals,
    "drawn-models": drawn_models,
    "full-truss": full_truss,
    "full-kw51": full_kw51,
    "full-frame": full_frame,
    "full-bridge": full_bridge,
    "bridge-basis": bridge_basis,
    "kw51-reduced": kw51_reduced,
    "tracking": tracking,
    "truss-chain": truss_chain,
    "z24-chain": z24_chain,
    "identify": identified,
    "study": detectability,
    "study-of-eight": many_detectors,
    "study-truss": truss_study,
    "study-footbridge": footbridge_study,
    "study-footbridge-all": partial(footbridge_study, uncertainty="all"),
    "monitor-fit": monitor_fit,
    "monitor-update": monitor_update,
    "monitor-later": monitor_update_later,
    "updater": updater,
    "two-jobs": two_jobs,
    "ten-minutes": ten_minutes,
}


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("name", choices=[*WORKS])
    parser.add_argument("--quick", action="store_true")
    parser.add_argument("--results", help="where the work's results go")
    options = parser.parse_args()
    warnings.simplefilter("ignore")
    clock = Clock()
    WORKS[options.name](clock, options.quick)
    if options.results:
        np.savez(options.results, **clock.results)
    unit = 1e6 if sys.platform == "darwin" else 1e3
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit
    print(json.dumps({"seconds": clock.seconds, "beside": clock.reference, "megabytes": peak}))


if __name__ == "__main__":
    main()
