"""What users wait for: processor seconds and peak memory of works, beside other ways to the same.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/speed.py
    OMP_NUM_THREADS=1 python tests/benchmarks/speed.py --against 43ba4fa4 --rows lags study-truss

Each work runs in a process of its own. Printed are medians of processor seconds (worker processes included), how many
times as long the other way takes in the same process, and the largest peak memory of the process, imports and the other
way included. The first line of a work's function says what it is and, after "beside", what the other way is; a loop of
``eigsh`` is that of ``scipy.sparse.linalg`` over ready-made matrices. With ``--against``, works run by turns with the
package of now and of that commit. Works on the building frame need its file in the folder that SKTHERMO_DATA names.
The exit code is 1 if something has become slower by more than 10 %: if even the fastest round takes more than 1.1 times
the median of that commit.
"""

import contextlib
import inspect
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import scipy.io
import scipy.signal  # which the library loads once it is used
import scipy.sparse.linalg
from harness import DATA, arguments, compensated, draw, joined, peak_megabytes, processor_seconds, recipes, shown, split
from sklearn.covariance import EmpiricalCovariance
from sklearn.ensemble import IsolationForest
from sklearn.impute import KNNImputer
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.model_selection import GridSearchCV
from sklearn.pipeline import make_pipeline
from structures import Footbridge, building_frame, footbridge, frame_bridge, lagged
from versions import OtherVersion, run_present

from skthermo.datasets import make_kw51, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, OutlierDetector
from skthermo.fem import FrequencySurface, add_noise, sample
from skthermo.monitoring import Monitor
from skthermo.preprocessing import BlockedKFold, KNNGapImputer, LagFeatures
from skthermo.studies import DetectabilityStudy, identify_damage, sweep
from skthermo.surrogate import DataInformedFEM, PosteriorInverse, TemperatureMapper
from skthermo.updating import ModelUpdater

field_detectors = recipes("detector").field_detectors

BOUNDS = 0.3


@dataclass
class Clock:
    """Processor seconds of the work, of its worker processes, and of what it is compared with."""

    seconds: float = 0.0
    reference: float = 0.0

    @contextlib.contextmanager
    def work(self, times=1.0):
        """What counts so many times."""
        start = processor_seconds()
        yield
        self.seconds += times * (processor_seconds() - start)

    @contextlib.contextmanager
    def beside(self, times=1.0):
        """The other way, which counts so many times."""
        start = processor_seconds()
        yield
        self.reference += times * (processor_seconds() - start)


def eigsh_loop(model, n_samples):
    """A function that solves ready-made matrices, one after the other."""
    matrices = [model.matrices(theta) for theta in draw(model, n_samples)]
    return lambda: [scipy.sparse.linalg.eigsh(K, model.n_modes, M, sigma=0) for K, M in matrices]


def frame_samples(clock, quick, structure, n_samples):
    """{n_samples:,} samples of a {structure}, its reduced model made on the way, beside a loop of eigsh."""
    small = frame_bridge(6, 2, 1) if quick else frame_bridge()
    model, n_loop = small if structure == BRIDGE else building_frame(), 5 if quick else 20
    solve = eigsh_loop(model, n_loop)
    with clock.beside(n_samples / n_loop):
        solve()
    with clock.work():
        reduced = model.reduced(BOUNDS, random_state=0)
        sample(reduced, BOUNDS, n_samples, random_state=0)


def derivatives(clock, quick):
    """Frequencies and derivatives by 5 parameters, bridge of 3,600 degrees of freedom, beside central differences."""
    model = frame_bridge(*((4, 1, 1) if quick else (16, 3, 4)))
    theta, steps = draw(model, 20), 1e-3 * np.eye(len(model.parameter_names))
    around = np.concatenate([theta, *(theta + sign * step for step in steps for sign in (1, -1))])
    with clock.work(1 / len(theta)):
        model.linearised(theta)
    with clock.beside(1 / len(theta)):
        model.frequencies(around)


def hourly_year(n_hours):
    """Temperatures of KW51, and frequencies of stiffnesses that fall as it warms."""
    random, hour = np.random.default_rng(0), np.arange(n_hours)
    season, day = np.sin(2 * np.pi * hour / 8760), np.sin(2 * np.pi * hour / 24)
    air = 10 + 10 * season + 5 * day + random.standard_normal(n_hours)
    theta = 1 - 4e-4 * np.outer(air - 10, [1.0, 1.2, 0.8, 1.0, 0.9])
    F = add_noise(make_kw51().reduced(0.05, random_state=0).frequencies(theta), 0.001, random_state=0)
    stamps = pd.date_range("2025-01-01", periods=n_hours, freq="h")
    return pd.DataFrame({"T": air}, stamps), pd.DataFrame(F, stamps, [f"f{mode + 1}" for mode in range(6)])


def kw51_damaged(clock, quick):
    """Chain of KW51: fit to an hourly year, and its simulation in fifteen states of damage."""
    T, F = hourly_year(800 if quick else 8760)
    model = make_kw51()
    inverse = PosteriorInverse(noise=0.001, reduce=True)
    fem = DataInformedFEM(model, inverse=inverse, mapper=TemperatureMapper(Ridge()), reduce=True, random_state=0)
    with clock.work():
        fem.fit(T, F)
        damages = [{group: severity} for group in [*model.groups][:5] for severity in (0.05, 0.1, 0.2)]
        for damage in damages:
            fem.simulate(T, damage=damage)


def surface(clock, quick):
    """An hourly year of KW51 by a surface of its reduced model, made on the way, beside the reduced model."""
    air = hourly_year(800 if quick else 8760)[0].to_numpy()
    theta, model = 1 - 4e-4 * (air - 10) * [1.0, 1.2, 0.8, 1.0, 0.9], make_kw51().reduced(0.05, random_state=0)
    with clock.work():
        FrequencySurface(model.frequencies, theta).frequencies(theta)
    with clock.beside():
        model.frequencies(theta)


def lags(clock, quick, n_rows=8760):
    """24 lags of {n_rows:,} hourly temperatures of 7 sensors, beside pandas' shift and concat."""
    n_sensors, n_rows = 7, n_rows // 10 if quick else n_rows
    random = np.random.default_rng(0)
    T = pd.DataFrame(random.standard_normal((n_rows, n_sensors)), pd.date_range("2020", periods=n_rows, freq="h"))
    T = T.add_prefix("T")
    n_times = max(200 // n_sensors * 8760 // n_rows, 5)
    for _ in range(n_times):
        with clock.beside(1 / n_times):
            pd.concat([T.shift(k) for k in range(24)], axis=1)
        with clock.work(1 / n_times):
            LagFeatures(24, freq="1h").fit_transform(T)


def gaps(clock, quick, n_rows=30_000):
    """Gaps of {n_rows:,} records of 7 columns filled, 10 % missing, beside scikit-learn's KNNImputer."""
    random = np.random.default_rng(0)
    values = random.standard_normal((3000 if quick else n_rows, 7)) @ random.standard_normal((7, 7))
    values[random.random(values.shape) < 0.1] = np.nan
    with clock.work():
        KNNGapImputer(n_neighbors=10).fit_transform(values)
    with clock.beside():
        KNNImputer(n_neighbors=10).fit_transform(values)


def intervals(clock, quick):
    """Prediction intervals of an hourly year of the truss, 5 % of the frequencies missing."""
    n_rows = 1460 if quick else 8760
    campaign = make_truss_campaign(samples_per_year=n_rows, samples_per_day=n_rows // 365, random_state=0)
    T, F = campaign.temperatures, campaign.frequencies
    F = F.mask(np.random.default_rng(0).random(F.shape) < 0.05)
    fem = DataInformedFEM(make_truss(), random_state=0).fit(T, F)
    fem.predict_interval(T)  # whose residuals are kept
    with clock.work():
        fem.predict_interval(T)


def normal_records(quick, n_rows):
    return 1e-3 * np.random.default_rng(0).standard_normal((n_rows // 10 if quick else n_rows, 6))


def mahalanobis(clock, quick, n_rows=100_000):
    """MahalanobisDetector fitted to {n_rows:,} records of 6 modes, beside scikit-learn's EmpiricalCovariance."""
    R = normal_records(quick, n_rows)
    for _ in range(10):
        with clock.beside(0.1):
            EmpiricalCovariance().fit(R)
        with clock.work(0.1):
            MahalanobisDetector().fit(R)


def forest(clock, quick, n_rows=100_000):
    """OutlierDetector of a forest fitted to {n_rows:,} records of 6 modes, beside IsolationForest and its scores."""
    R = normal_records(quick, n_rows)
    with clock.beside():
        IsolationForest(random_state=0).fit(R).score_samples(R)
    with clock.work():
        OutlierDetector(IsolationForest(random_state=0)).fit(R)


def hourly_chain(clock, quick, n_rows=100_000):
    """Chain of the truss fitted to {n_rows:,} hourly records."""
    n_years = 1 if quick else 12
    campaign = make_truss_campaign(n_years, samples_per_year=8760, samples_per_day=24, random_state=0)
    T, F = (table[:n_rows] for table in (campaign.temperatures, campaign.frequencies))
    with clock.work():
        DataInformedFEM(make_truss(), random_state=0).fit(T, F)


def hourly_years(quick):
    """Two years of hourly records of the truss, a twentieth of the frequencies missing, and rows of the first."""
    n_rows = 1460 if quick else 8760
    campaign = make_truss_campaign(2, samples_per_year=n_rows, samples_per_day=24, random_state=0)
    F = campaign.frequencies
    return campaign.temperatures, F.mask(np.random.default_rng(0).random(F.shape) < 0.05), slice(None, n_rows)


def hourly_detector(clock, quick):
    """Detector by day: a year of hourly records learned, and another one evaluated."""
    T, F, year = hourly_years(quick)
    detector, records = compensated(F, window="1D"), T.join(F)
    with clock.work():
        detector.fit(records[year])
        detector.predict(records[year.stop :])


def hourly_mapper(clock, quick):
    """TemperatureMapper: a year of hourly records learned, and another one predicted."""
    T, F, year = hourly_years(quick)
    with clock.work():
        TemperatureMapper().fit(T[year], F[year]).predict(T[year.stop :])


def hourly_chain_year(clock, quick):
    """Chain of the truss: a year of hourly records learned, and another one predicted."""
    T, F, year = hourly_years(quick)
    with clock.work():
        DataInformedFEM(make_truss(), random_state=0).fit(T[year], F[year]).predict(T[year.stop :])


def drawn_models(clock, quick):
    """Two models drawn from the calibration of KW51."""
    model = make_kw51().reduced(BOUNDS, random_state=0)
    measured = model.frequencies(draw(model, 1, bounds=0.1))[0]
    update = ModelUpdater(model, prior=0.15).fit(measured, frequency_std=0.005 * measured)
    with clock.work():
        update.sample_models(2, random_state=0)


def truss_chain(clock, quick):
    """Chain of the truss: fit to a year of days, and predictions of it."""
    year = make_truss_campaign(random_state=0)
    fem = DataInformedFEM(make_truss(), inverse=PosteriorInverse(noise=0.01), random_state=0)
    with clock.work():
        fem.fit(year.temperatures, year.frequencies)
        fem.predict(year.temperatures, return_std=True)


def truss_years():
    """A fitted chain of the truss, its records, and those of a damaged year."""
    year = make_truss_campaign(random_state=0)
    later = make_truss_campaign(random_state=1, damage={"bottom": 0.2})
    inverse = PosteriorInverse(noise=0.01)
    fem = DataInformedFEM(make_truss(), inverse=inverse, random_state=0).fit(year.temperatures, year.frequencies)
    return fem, year, later


def identified(clock, quick):
    """Damage identified from a year of days of the truss."""
    fem, _, later = truss_years()
    with clock.work():
        identify_damage(fem, later.temperatures, later.frequencies, random_state=0)


def truss_study(clock, quick):
    """Study of the truss by default, a year of days: one detector, 16 states, 20 repeats."""
    fem, _, later = truss_years()
    scenarios = sweep(fem, (0.05, 0.1, 0.15, 0.2, 0.3), groups=["bottom", "top", "diagonal"])
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=20, random_state=0)
    with clock.work():
        study.run(later.temperatures)


def footbridge_study(clock, quick, title, **options):
    """Study of a footbridge, {title}: two detectors, 7 states, 4,380 records."""
    bridge = Footbridge(0)
    records, later = bridge.training(True), bridge.T[bridge.n :]
    model = footbridge(pylon=1.1).assemble(bridge.groups, n_modes=len(bridge.modes), track=True)
    fem = DataInformedFEM(model, random_state=0).fit(*split(records))
    damages = [("side span", 0.06), ("side span", 0.12), ("main stays", 0.03), ("main stays", 0.06)]
    scenarios = [{}, *({group: s} for group, s in [*damages, ("bearings", 0.1), ("pylon", 0.15)])]
    mapper, windows = lagged(TemperatureMapper()), {"single": None, "day": "1D"}
    detectors = {name: compensated(bridge.modes, None, mapper, window=one) for name, one in windows.items()}
    study = DetectabilityStudy(fem, detectors, scenarios[:3] if quick else scenarios, random_state=0, **options)
    with clock.work():
        study.run(later)


def many_detectors(clock, quick):
    """Study of eight detectors, 13 states of the truss, noise alone, beside a study for each detector."""
    fem, year, later = truss_years()
    everyone = field_detectors(list(year.frequencies))
    names = ["raw, Mahalanobis", "raw, isolation forest", "raw, 20 neighbours", "raw, Gaussian mixture"]
    names += ["linear regression", "piecewise-linear", "piecewise-linear, regimes", "conditional covariance"]

    def run(*chosen):
        detectors = {name: everyone[name] for name in chosen}
        options = {"n_repeats": 2 if quick else 20, "random_state": 0, "uncertainty": "noise"}
        study = DetectabilityStudy(fem, detectors, sweep(fem, (0.1, 0.2, 0.3)), **options)
        study.run(later.temperatures)

    with clock.work():
        run(*names)
    with clock.beside():
        for name in names:
            run(name)


def search(clock, quick):
    """Search over 12 settings of a chain's mapper by five folds, with memory, beside one without."""
    year = make_truss_campaign(samples_per_year=60 if quick else 365, random_state=0)
    grid, inverse = {"mapper__regressor__alpha": np.logspace(-2, 3, 12)}, PosteriorInverse(noise=0.01)

    def searched(memory):
        mapper = TemperatureMapper(Ridge())
        fem = DataInformedFEM(make_truss(), inverse=inverse, mapper=mapper, memory=memory, random_state=0)
        GridSearchCV(fem, grid, cv=BlockedKFold(5)).fit(year.temperatures, year.frequencies)

    with clock.beside():
        searched(None)
    with tempfile.TemporaryDirectory() as memory, clock.work():
        searched(memory)


def hourly_monitor(n_years=2):
    campaign = make_truss_campaign(n_years, samples_per_year=8760, samples_per_day=24, random_state=0)
    records = joined(campaign)
    weather = make_pipeline(LagFeatures([0, 6, 24], freq="1h"), LinearRegression())
    return Monitor(compensated(campaign.frequencies, None, weather, window="24h"), random_state=0), records


def monitor_update_later(clock, quick):
    """Monitor updated by a day of hourly records, after ten years, beside the same after one year."""
    n_years = 2 if quick else 10
    monitor, records = hourly_monitor(n_years + 2)
    monitor.fit(records[:8760])
    for clocked, first in ((clock.beside, 8760), (clock.work, 8760 * n_years)):
        for start in range(8760 + 16 * 24, first, 730):
            monitor.update(records[start : min(start + 730, first)])
        with clocked(1 / 16):
            for start in range(first, first + 16 * 24, 24):
                monitor.update(records[start : start + 24])


def page_of_two_files(clock, quick):
    """From two CSV files of an hourly year to a fitted monitor and its page, by three commands."""
    n_rows = 1460 if quick else 8760
    campaign = make_truss_campaign(samples_per_year=n_rows, samples_per_day=24, random_state=0)
    stamps = pd.date_range("2025-01-01", periods=n_rows, freq="h", name="time")
    with tempfile.TemporaryDirectory() as folder:
        for name, table in {"T.csv": campaign.temperatures, "F.csv": campaign.frequencies}.items():
            table.set_axis(stamps).to_csv(Path(folder) / name)
        settings = "river/monitor.toml"
        for words in (
            ["init", "T.csv", "F.csv", "--into", "river"],
            ["fit", settings],
            ["report", settings, "--out", "page.html"],
        ):
            with clock.work():
                subprocess.run([sys.executable, "-m", "skthermo", *words], cwd=folder, check=True, capture_output=True)
        assert (Path(folder) / "page.html").stat().st_size


FRAME, BRIDGE = "building frame of 2,302 degrees of freedom", "bridge of 20,940 degrees of freedom"
GROUPS = {
    "Models": {
        "frame-1000": partial(frame_samples, structure=FRAME, n_samples=1000),
        "frame-10000": partial(frame_samples, structure=FRAME, n_samples=10_000),
        "bridge-10000": partial(frame_samples, structure=BRIDGE, n_samples=10_000),
        "derivatives": derivatives,
        "drawn-models": drawn_models,
    },
    "Records and monitors": {
        "lags": lags,
        "lags-many": partial(lags, n_rows=100_000),
        "gaps-year": partial(gaps, n_rows=8760),
        "gaps": gaps,
        "monitor-later": monitor_update_later,
        "two-files": page_of_two_files,
    },
    "Many records": {"mahalanobis": mahalanobis, "forest": forest, "chain-records": hourly_chain},
    "Years of hourly records": {
        "detector-year": hourly_detector,
        "mapper-year": hourly_mapper,
        "chain-year": hourly_chain_year,
    },
    "Chains and studies": {
        "truss-chain": truss_chain,
        "intervals": intervals,
        "surface": surface,
        "kw51-damaged": kw51_damaged,
        "search": search,
        "identify": identified,
        "study-truss": truss_study,
        "study-of-eight": many_detectors,
        "study-footbridge": partial(footbridge_study, title="by default"),
        "study-footbridge-all": partial(footbridge_study, title="all uncertainty", uncertainty="all"),
    },
}
WORKS = {name: work for works in GROUPS.values() for name, work in works.items()}


def said(work):
    """What a work is, and what its other way is."""
    settings = {name: parameter.default for name, parameter in inspect.signature(work).parameters.items()}
    line = (work.func if isinstance(work, partial) else work).__doc__.splitlines()[0]
    what, _, other = line.format(**settings).rstrip(".").partition(", beside ")
    return what, other


def measure(name, versions, options):
    """Rounds of a work with each version, by turns; none of a version in which it fails."""
    rounds, words = {version: [] for version in versions}, ["--work", name, *["--quick"][: options.quick]]
    for _ in range(options.rounds):
        for version, run in versions.items():
            done = run(__file__, words)
            if done.returncode:
                print(f"{name}, {version}: {done.stderr.strip().splitlines()[-1]}")
            else:
                rounds[version].append(json.loads(done.stdout.splitlines()[-1]))
        if max(sum(one["seconds"] for one in found) for found in rounds.values()) > options.long:
            break
    return {version: pd.DataFrame(found) for version, found in rounds.items() if found}


def main():
    options = arguments(
        __doc__,
        takes_turns=True,
        rows=(WORKS, "works"),
        rounds=3,
        long=(20.0, "seconds after which no further round begins"),
        quick=(False, "small works"),
        work=(str, "a work in this process, for the script itself"),
    )
    if options.work:
        clock = Clock()
        WORKS[options.work](clock, options.quick)
        print(json.dumps({"seconds": clock.seconds, "beside": clock.reference, "megabytes": peak_megabytes()}))
        return 0
    os.environ.update(OMP_NUM_THREADS="1", MPLBACKEND="Agg")
    slower, versions = [], {"now": run_present}
    if options.against:
        versions = {"before": OtherVersion.built(options.against).run} | versions
    for title, works in GROUPS.items():
        rows = {}
        for name in [one for one in works if one in options.rows and (DATA or not one.startswith("frame"))]:
            found, (what, other) = measure(name, versions, options), said(works[name])
            seconds = {version: table["seconds"].median() for version, table in found.items()}
            row = rows[what] = {"seconds": seconds.get("now")}
            if "before" in seconds:
                row |= {f"seconds {options.against}": seconds["before"]}
            if len(found) == 2:
                row[f"times as long {options.against}"] = seconds["before"] / seconds["now"]
                slower += [name] * bool(found["now"]["seconds"].min() > 1.1 * seconds["before"])
            if "now" in found:
                times = found["now"]["beside"].median() / seconds["now"]
                row |= {"other way, times as long": times if other else None, "other way": other}
                row["peak memory, MB"] = found["now"]["megabytes"].max()
        if rows:
            shown(f"{title}: processor seconds, median of up to {options.rounds} rounds", pd.DataFrame(rows).T, "3g")
    print(f"slower by more than 10 %: {', '.join(slower) or 'nothing'}")
    return int(bool(slower))


if __name__ == "__main__":
    sys.exit(main())
