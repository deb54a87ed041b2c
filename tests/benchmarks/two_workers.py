"""Sampling by two workers over sampling by one: joblib's processes, and Dask's.

    OMP_NUM_THREADS=1 python tests/benchmarks/two_workers.py

A tied-arch bridge of 3600 degrees of freedom, on a machine that does nothing else. Prints seconds by the clock, ratios
to one process, and the peak memory of each of Dask's workers; exit code 1 if a ratio is below 1.6 or the bits differ.
"""

import time

import joblib
import numpy as np
from dask.distributed import Client
from harness import arguments, peak_megabytes, timed
from structures import frame_bridge

from skthermo.fem import sample

BRIDGE, BOUNDS, TARGET = (16, 3, 4), 0.3, 1.6


def main():
    options = arguments(__doc__, samples=960)
    model = frame_bridge(*BRIDGE)

    def drawn(n_samples=options.samples, n_jobs=None):
        return sample(model, BOUNDS, n_samples, n_jobs=n_jobs, random_state=0).frequencies

    alone, frequencies = timed(drawn, time.perf_counter)
    drawn(32, n_jobs=2)  # starts the processes
    results = {"joblib's processes": timed(lambda: drawn(n_jobs=2), time.perf_counter)}
    with Client(n_workers=2, threads_per_worker=1, dashboard_address=None) as client, joblib.parallel_config("dask"):
        drawn(32)
        results["Dask's workers"] = timed(drawn, time.perf_counter)
        peaks = client.run(peak_megabytes).values()
    print(f"{model}, {options.samples} samples: {alone:.1f} s in one process")
    for name, (seconds, found) in results.items():
        same = "same bits" if np.array_equal(found, frequencies) else "OTHER BITS"
        print(f"two of {name}: {seconds:.1f} s, {alone / seconds:.2f} times faster, {same}")
    print(f"peak memory of Dask's workers: {', '.join(f'{peak:.0f}' for peak in peaks)} MB")
    failed = any(
        alone / seconds < TARGET or not np.array_equal(found, frequencies) for seconds, found in results.values()
    )
    raise SystemExit(int(failed))


if __name__ == "__main__":
    main()
