"""Time and memory of several ways to do one thing, in one run."""

import statistics
import time
import tracemalloc


def median_seconds(ways, rounds):
    """Median over rounds, in each of which every way has its turn."""
    seconds = {name: [] for name in ways}
    for _ in range(rounds):
        for name, way in ways.items():
            start = time.perf_counter()
            way()
            seconds[name].append(time.perf_counter() - start)
    return {name: statistics.median(values) for name, values in seconds.items()}


def peak_megabytes(way):
    """What one call allocates beyond its input."""
    tracemalloc.start()
    way()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return peak / 1e6
