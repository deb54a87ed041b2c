"""One row of a study's table, and damage indices."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._arrays import Array
from skthermo._times import row_times, time_of
from skthermo.studies._intervals import rate_of
from skthermo.studies._state import State


def summary(scenario: State, source: str, decisions: Array, rows: Any, **options: Any) -> dict[str, Any]:
    """Rates, bounds and time to detection of one scenario and source.

    Parameters
    ----------
    scenario : State
        Whose alarms they are.
    source : str
        "data-informed" or "reference".
    decisions : ndarray of shape (n_repeats, n_records)
        Decision function, NaN where there is none.
    rows : DataFrame or array-like of n_records rows
        Says when the records were taken.
    **options : dict
        For `rate_of`.

    Returns
    -------
    dict

    Raises
    ------
    ValueError
        If no record can be judged.
    """
    times = row_times(rows)
    start = times.min() if scenario.onset is None else time_of(rows, scenario.onset, "onset")
    order = np.argsort(times, kind="stable")
    order = order[times[order] >= start]
    rate = rate_of(decisions[:, order], whole_repeats=scenario.n_draws > 1, **options)
    if not rate.n_records:
        raise ValueError(
            f"none of {decisions.shape[1]} records of scenario {scenario.name!r}, source {source!r}, can be judged: "
            "they lack what the detector needs, or are before the onset; expected some that it can judge"
        )
    band = band_of(decisions[:, order], options["confidence"])
    return {
        "scenario": scenario.name,
        "family": scenario.family,
        "severity": scenario.severity,
        "source": source,
        "measure": "PFA" if scenario.is_healthy else "POD",
        "rate": rate.rate,
        "lowest": rate.lowest,
        "highest": rate.highest,
        "band_lowest": band[0],
        "band_highest": band[1],
        "n_alarms": rate.n_alarms,
        "n_records": rate.n_records,
        "n_effective": rate.n_effective,
        "n_repeats": len(decisions),
        "time_to_detection": _mean_wait(decisions[:, order] < 0, times[order] - start, rows),
    }


def band_of(decisions: Array, confidence: float) -> tuple[float, float]:
    """Range that holds the rate of one more repeat with this probability, or that of all repeats if they are too few.

    Of n rates, the k-th smallest exceeds that of one more repeat with probability k / (n + 1). One rate has no range.
    """
    judged = (~np.isnan(decisions)).sum(axis=1)
    rates = (decisions < 0).sum(axis=1)[judged > 0] / judged[judged > 0]
    if len(rates) < 2:
        return float("nan"), float("nan")
    lowest, highest = np.quantile(rates, [(1 - confidence) / 2, (1 + confidence) / 2], method="weibull")
    return float(lowest), float(highest)


def damage_index(detector: Any, table: Any, rows: Any) -> pd.Series:
    """Minus the detector's ``score_samples``, on the index of the records."""
    index = rows.index if isinstance(rows, pd.DataFrame) else None
    return pd.Series(-np.asarray(detector.score_samples(table), dtype=float), index=index, name="damage_index")


def _mean_wait(alarms: NDArray[np.bool_], waits: Array, rows: Any) -> Any:
    """Mean time to the first alarm over the repeats that have one, in records or as a Timedelta."""
    detected = alarms[alarms.any(axis=1)].argmax(axis=1)
    if isinstance(getattr(rows, "index", None), pd.DatetimeIndex):
        return pd.Timedelta(int(waits[detected].mean()), "ns") if detected.size else pd.NaT
    return float(detected.mean()) if detected.size else float("nan")
