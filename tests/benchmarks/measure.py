"""Time and memory of several ways to do one thing, in one run."""

import statistics
import time
import tracemalloc


def median_seconds(ways, rounds, clock=time.perf_counter):
    """Median over rounds, in each of which every way has its turn; `time.process_time` counts this process alone."""
    seconds = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            start = clock()
            way()
            seconds[name].append(clock() - start)
    return {name: statistics.median(values) for name, values in seconds.items()}


def peak_megabytes(way):
    """What one call allocates beyond its input."""
    tracemalloc.start()
    way()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6
