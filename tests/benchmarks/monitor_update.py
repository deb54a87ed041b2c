"""A monitor after ten years of hourly records: time of a day's update, of saving and loading, and size of its file.

    OMP_NUM_THREADS=1 python tests/benchmarks/monitor_update.py

The truss with a record each hour: lags of 6 and 24 h, windows of a day, a healthy structure. The baseline is the first
year; the records of the following ones come month by month, and after 1, 5 and 10 years those of sixteen days come day
by day. Times are medians: of these updates, with the processor's time beside it, which other programs on the machine do
not lengthen. The exit code is 1 if that of an update is 50 ms or more, or if the file grows by more than its events and
daily summaries do.
"""

import argparse
import sys
import tempfile
import time
import warnings
from functools import partial
from itertools import pairwise
from pathlib import Path
from statistics import median

from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import TemperatureCompensator, WindowedAlarm
from skthermo.monitoring import Monitor, load_monitor
from skthermo.preprocessing import LagFeatures
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

TARGET = 50.0  # ms
GROWTH = 200  # bytes that a day may add for good: its summary and a share of the events
MONTH, DAY, YEAR = 730, 24, 8760  # records
DAYS = 16  # that come day by day


def new_monitor(targets, baseline, *, follows_drift, watches_sensors):
    weather = make_pipeline(LagFeatures([0, 6, 24], freq="1h"), LinearRegression())
    detector = make_pipeline(TemperatureCompensator(weather, targets=targets), WindowedAlarm("24h"))
    fem = None
    if follows_drift:
        inverse = InverseSurrogate(noise=0.01, refine=2)
        fem = DataInformedFEM(make_truss(), inverse=inverse, mapper=TemperatureMapper(LinearRegression()))
        fem.set_params(random_state=0).fit(baseline.drop(columns=targets), baseline[targets])
    return Monitor(detector, fem=fem, sensors=watches_sensors, random_state=0).fit(baseline)


def timed(action):
    """Wall-clock and processor time in ms."""
    start = time.perf_counter(), time.process_time()
    action()
    return 1000 * (time.perf_counter() - start[0]), 1000 * (time.process_time() - start[1])


def median_time(action):
    return median(timed(action)[0] for _ in range(5))


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--years", type=int, nargs="+", default=[1, 5, 10])
    parser.add_argument("--no-sensors", action="store_true", help="without the watch on sensors")
    parser.add_argument("--fem", action="store_true", help="follow drift in the parameters of a fitted chain")
    options = parser.parse_args()
    campaign = make_truss_campaign(max(options.years) + 1, samples_per_year=YEAR, samples_per_day=DAY, random_state=0)
    records = campaign.temperatures.join(campaign.frequencies)
    targets = list(campaign.frequencies)
    warnings.simplefilter("ignore", UserWarning)  # of first windows that are not evaluated
    start = time.perf_counter()
    monitor = new_monitor(targets, records[:YEAR], follows_drift=options.fem, watches_sensors=not options.no_sensors)
    print(f"fit to a year of hourly records: {time.perf_counter() - start:.1f} s")
    print("years   update ms  processor   slowest   events   days   .joblib MB   save   load   .skops MB   save   load")
    failed, sizes = False, {}
    for before, years in pairwise([0, *options.years]):
        end = YEAR * (1 + years)
        for start in range(YEAR * (1 + before), end - DAYS * DAY, MONTH):
            monitor.update(records[start : min(start + MONTH, end - DAYS * DAY)])
        starts = range(end - DAYS * DAY, end, DAY)
        wall, processor = zip(*(timed(partial(monitor.update, records[s : s + DAY])) for s in starts), strict=True)
        row = f"{years:5d}   {median(wall):9.1f}   {median(processor):9.1f}   {max(wall):7.0f}"
        row += f"   {len(monitor.events_):6d}   {len(monitor.days_):4d}"
        with tempfile.TemporaryDirectory() as folder:
            for ending in ("joblib", "skops"):
                file = Path(folder) / f"bridge.{ending}"
                monitor.save(file)  # imports what is needed
                row += f"   {file.stat().st_size / 1e6:10.2f}   {median_time(partial(monitor.save, file)):4.0f}"
                row += f"   {median_time(partial(load_monitor, file)):4.0f}"
                sizes[years, ending] = file.stat().st_size
        print(row, flush=True)
        failed |= median(processor) >= TARGET
    first, last = options.years[-2:]
    for ending in ("joblib", "skops"):
        growth = (sizes[last, ending] - sizes[first, ending]) / (365 * (last - first))
        print(f"from year {first} to {last}, .{ending} grows by {growth:.0f} bytes a day")
        failed |= growth > GROWTH
    sys.exit(failed)


if __name__ == "__main__":
    main()
