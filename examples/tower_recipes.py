"""A synthetic log of a tower with a logger's defects, and calls whose warnings are collected."""

import warnings

import numpy as np
import pandas as pd

from skthermo.fem import add_noise


def write_synthetic_log(path, model, scatter, n_days=25):
    """A log of a tower that stiffens as it warms: stamps that are not round, a clock set back, and gaps."""
    random = np.random.default_rng(0)
    hours = np.arange(48 * n_days) / 2
    day = np.sin(np.pi * hours / 12)
    front = np.cumsum(random.normal(0, 0.12, len(hours)))
    T = np.column_stack([10 + 0.02 * hours / 24 + 0.3 * front + 0.4 * day, 9 + front + 2.5 * day])
    law = np.array([[0.004, 0.006], [0.004, 0.006], [0.004, 0.002], [0.002, 0.004]])
    theta = 1 + (T - [10, 9]) @ law.T
    F = add_noise(model.frequencies(theta), scatter / 2, random_state=0) * 1.02
    stamps = pd.Timestamp("2019-02-13 16:02:26") + pd.to_timedelta(hours, unit="h")
    stamps += pd.to_timedelta(random.integers(-15, 16, len(hours)), unit="s")
    early = hours < 0.85 * hours[-1]
    stamps = stamps.where(early, stamps - pd.Timedelta("60min"))  # the logger's clock is set back
    log = pd.DataFrame(np.hstack([T, F]).round(5), columns=["T1", "T2", *(f"f{i}" for i in range(1, 8))])
    log.insert(0, "time", stamps.floor("s"))
    log.drop(index=[*range(55, 100), *range(400, 464)]).to_csv(path, index=False)


def quietly(function, *arguments):
    """Call a function without its warnings of unknown weather, rows after gaps and few weeks, which are known."""
    with warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*other-weather")
        warnings.filterwarnings("ignore", ".*not-evaluated")
        return function(*arguments)


def said(function, *arguments):
    """Warnings of a call, or its error, as text."""
    with warnings.catch_warnings(record=True) as record:
        warnings.simplefilter("always")
        try:
            function(*arguments)
        except ValueError as error:
            return [f"refused: {error}"]
    return [str(warning.message) for warning in record]
