"""What users wait for, now and before: processor seconds and peak memory of the same works in one run.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/speed.py --before HEAD~20
    OMP_NUM_THREADS=1 python tests/benchmarks/speed.py --before 807a281 --rows lags study-truss

Each work runs in a process of its own, by turns with a copy of the code of this folder and of another revision. Printed
are medians of processor seconds (worker processes included), how many times faster it is now, and the largest peak
memory. "beside" is how many times longer another way takes in the same process: a loop of ``scipy.sparse.linalg.eigsh``
over the same matrices, for lags ``pandas.concat`` of shifts, for gaps ``KNNImputer``, for eight detectors a study for
each, for a monitor after ten years its updates after one. Works on the building frame need its file in the folder that
SKTHERMO_DATA names. The exit code is 1 if something has become slower by more than 10 %: if even the fastest round
takes more than 1.1 times the median of before.
"""

import contextlib
import json
import os
import shutil
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
from harness import DATA, arguments, draw, joined, peak_megabytes, processor_seconds, recipes, shown, split
from sklearn.impute import KNNImputer
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from structures import Footbridge, building_frame, footbridge, lagged

from skthermo.datasets import make_kw51, make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.fem import add_noise, sample
from skthermo.monitoring import Monitor
from skthermo.preprocessing import KNNGapImputer, LagFeatures
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


def eigsh_loop(model, n_samples):
    """A function that solves ready-made matrices, one after the other."""
    matrices = [model.matrices(theta) for theta in draw(model, n_samples)]
    return lambda: [scipy.sparse.linalg.eigsh(K, model.n_modes, M, sigma=0) for K, M in matrices]


def frame_samples(clock, quick, n_samples):
    """Reduced models of the building frame: basis and samples, beside a loop of eigsh."""
    model, n_samples, n_loop = building_frame(), n_samples // 10 if quick else n_samples, 5 if quick else 20
    solve = eigsh_loop(model, n_loop)
    with clock.beside(n_samples / n_loop):
        solve()
    with clock.work():
        reduced = model.reduced(BOUNDS, random_state=0)
        sample(reduced, BOUNDS, n_samples, random_state=0)


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
    """Fit to an hourly year of KW51 and simulation of it in fifteen states of damage."""
    T, F = hourly_year(800 if quick else 8760)
    model = make_kw51()
    inverse = PosteriorInverse(noise=0.001, reduce=True)
    fem = DataInformedFEM(model, inverse=inverse, mapper=TemperatureMapper(Ridge()), reduce=True, random_state=0)
    with clock.work():
        fem.fit(T, F)
        damages = [{group: severity} for group in [*model.groups][:5] for severity in (0.05, 0.1, 0.2)]
        for damage in damages:
            fem.simulate(T, damage=damage)


def lags(clock, quick, n_rows=8760):
    """24 lags of the temperatures of seven sensors, regular stamps, beside pandas."""
    n_sensors, n_rows = 7, n_rows // 10 if quick else n_rows
    random = np.random.default_rng(0)
    T = pd.DataFrame(random.standard_normal((n_rows, n_sensors)), pd.date_range("2020", periods=n_rows, freq="h"))
    T = T.add_prefix("T")
    for _ in range(max(200 // n_sensors * 8760 // n_rows, 5)):
        with clock.beside():
            pd.concat([T.shift(k) for k in range(24)], axis=1)
        with clock.work():
            LagFeatures(24, freq="1h").fit_transform(T)


def gaps(clock, quick, n_rows=30_000):
    """KNNGapImputer beside KNNImputer: seven correlated columns, 10 % missing."""
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


def drawn_models(clock, quick):
    """Two models drawn from the calibration of KW51's reduced model."""
    model = make_kw51().reduced(BOUNDS, random_state=0)
    measured = model.frequencies(draw(model, 1, bounds=0.1))[0]
    update = ModelUpdater(model, prior=0.15).fit(measured, frequency_std=0.005 * measured)
    with clock.work():
        update.sample_models(2, random_state=0)


def truss_chain(clock, quick):
    """Fit and predictions of the truss's chain, a year of daily records."""
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
    """identify_damage: a damaged year of the truss, five times."""
    fem, _, later = truss_years()
    with clock.work():
        for _ in range(5):
            identify_damage(fem, later.temperatures, later.frequencies, random_state=0)


def truss_study(clock, quick):
    """A study of the truss by default: one detector, 16 scenarios, 20 repeats."""
    fem, _, later = truss_years()
    scenarios = sweep(fem, (0.05, 0.1, 0.15, 0.2, 0.3), groups=["bottom", "top", "diagonal"])
    study = DetectabilityStudy(fem, MahalanobisDetector(), scenarios, n_repeats=20, random_state=0)
    with clock.work():
        study.run(later.temperatures)


def footbridge_study(clock, quick, uncertainty=None):
    """A study of the footbridge by default: seven states, 4380 records, two detectors."""
    bridge = Footbridge(0)
    records, later = bridge.training(True), bridge.T[bridge.n :]
    model = footbridge(pylon=1.1).assemble(bridge.groups, n_modes=len(bridge.modes), track=True)
    fem = DataInformedFEM(model, random_state=0).fit(*split(records))
    damages = [("side span", 0.06), ("side span", 0.12), ("main stays", 0.03), ("main stays", 0.06)]
    scenarios = [{}, *({group: s} for group, s in [*damages, ("bearings", 0.1), ("pylon", 0.15)])]
    compensator = TemperatureCompensator(lagged(TemperatureMapper()), targets=bridge.modes)
    lasts = {"single": MahalanobisDetector(), "day": WindowedAlarm("1D")}
    detectors = {name: make_pipeline(compensator, last) for name, last in lasts.items()}
    options = {} if uncertainty is None else {"uncertainty": uncertainty}
    study = DetectabilityStudy(fem, detectors, scenarios[:3] if quick else scenarios, random_state=0, **options)
    with clock.work():
        study.run(later)


def many_detectors(clock, quick):
    """A study of eight detectors on 13 states of the truss, 20 repeats, beside a study for each."""
    fem, year, later = truss_years()
    everyone = field_detectors(list(year.frequencies))
    names = ["raw, Mahalanobis", "raw, isolation forest", "raw, 20 neighbours", "raw, Gaussian mixture"]
    names += ["linear regression", "piecewise-linear", "piecewise-linear, whitened", "conditional covariance"]

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


def hourly_monitor(n_years=2):
    campaign = make_truss_campaign(n_years, samples_per_year=8760, samples_per_day=24, random_state=0)
    records = joined(campaign)
    weather = make_pipeline(LagFeatures([0, 6, 24], freq="1h"), LinearRegression())
    compensator = TemperatureCompensator(weather, targets=list(campaign.frequencies))
    return Monitor(make_pipeline(compensator, WindowedAlarm("24h")), random_state=0), records


def monitor_update(clock, quick):
    """Monitor.update, sixty single days."""
    monitor, records = hourly_monitor()
    monitor.fit(records[:8760])
    with clock.work():
        for start in range(8760, 8760 + 60 * 24, 24):
            monitor.update(records[start : start + 24])


def monitor_update_later(clock, quick):
    """Monitor.update, sixteen single days after ten years of hourly records, beside those after one year."""
    n_years = 2 if quick else 10
    monitor, records = hourly_monitor(n_years + 2)
    monitor.fit(records[:8760])
    for clocked, first in ((clock.beside, 8760), (clock.work, 8760 * n_years)):
        for start in range(8760 + 16 * 24, first, 730):
            monitor.update(records[start : min(start + 730, first)])
        with clocked():
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


WORKS = {
    "frame-1000": partial(frame_samples, n_samples=1000),
    "frame-10000": partial(frame_samples, n_samples=10_000),
    "kw51-damaged": kw51_damaged,
    "lags": lags,
    "lags-many": partial(lags, n_rows=100_000),
    "gaps": gaps,
    "gaps-year": partial(gaps, n_rows=8760),
    "intervals": intervals,
    "drawn-models": drawn_models,
    "truss-chain": truss_chain,
    "identify": identified,
    "study-of-eight": many_detectors,
    "study-truss": truss_study,
    "study-footbridge": footbridge_study,
    "study-footbridge-all": partial(footbridge_study, uncertainty="all"),
    "monitor-update": monitor_update,
    "monitor-later": monitor_update_later,
    "two-files": page_of_two_files,
}


def copy_of(revision, folder):
    """A folder with the package at this revision, or as it is here now, ready as if it were installed."""
    folder.mkdir()
    root = Path(__file__).parents[2]
    if revision:
        command = ["git", "archive", revision, "skthermo"]
        archive = subprocess.run(command, cwd=root, check=True, capture_output=True).stdout
        subprocess.run(["tar", "-x", "-C", folder], input=archive, check=True)
    else:
        shutil.copytree(root / "skthermo", folder / "skthermo")
    subprocess.run([sys.executable, "-m", "compileall", "-q", folder], check=True)
    return folder


def measure(name, packages, options):
    """Rounds of a work with each state of the code, by turns; none of a state in which it fails."""
    rounds, command = {state: [] for state in packages}, [sys.executable, __file__, "--work", name]
    for _ in range(options.rounds):
        for state, package in packages.items():
            environment = os.environ | {"PYTHONPATH": str(package), "OMP_NUM_THREADS": "1", "MPLBACKEND": "Agg"}
            words = [*command, *["--quick"][: options.quick]]
            done = subprocess.run(words, env=environment, cwd=package, capture_output=True, text=True)
            if done.returncode:
                print(f"{name}, {state}: {done.stderr.strip().splitlines()[-1]}")
            else:
                rounds[state].append(json.loads(done.stdout.splitlines()[-1]))
        if max(sum(one["seconds"] for one in found) for found in rounds.values()) > options.long:
            break
    return {state: pd.DataFrame(found) for state, found in rounds.items() if found}


def main():
    options = arguments(
        __doc__,
        before=(str, "a git revision to compare with"),
        rows=(WORKS, "works"),
        rounds=5,
        long=(40.0, "seconds after which no further round begins"),
        quick=(False, "small works"),
        work=(str, "a work in this process, for the script itself"),
    )
    if options.work:
        clock = Clock()
        WORKS[options.work](clock, options.quick)
        print(json.dumps({"seconds": clock.seconds, "beside": clock.reference, "megabytes": peak_megabytes()}))
        return 0
    rows, slower = {}, []
    with tempfile.TemporaryDirectory() as folder:
        states = ({"before": options.before} if options.before else {}) | {"now": None}
        packages = {state: copy_of(revision, Path(folder) / state) for state, revision in states.items()}
        for name in [one for one in options.rows if DATA is not None or not one.startswith("frame")]:
            found = measure(name, packages, options)
            rows[name] = {f"{state}, s": table["seconds"].median() for state, table in found.items()}
            rows[name] |= {f"{state}, MB": table["megabytes"].max() for state, table in found.items()}
            if "now" in found:
                rows[name]["beside"] = found["now"]["beside"].median() / rows[name]["now, s"]
            if len(found) == 2:
                rows[name]["times faster"] = rows[name]["before, s"] / rows[name]["now, s"]
                slower += [name] * bool(found["now"]["seconds"].min() > 1.1 * rows[name]["before, s"])
    shown("Seconds, megabytes, and times as long as now", pd.DataFrame(rows).T, "3g")
    print(f"slower by more than 10 %: {', '.join(slower) or 'nothing'}")
    return int(bool(slower))


if __name__ == "__main__":
    sys.exit(main())
