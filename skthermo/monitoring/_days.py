"""Daily summaries of judgements."""

from __future__ import annotations

import numpy as np
import pandas as pd


def days_of(answers: pd.DataFrame) -> pd.DataFrame:
    """A row for each calendar day that has records, from the judgements of all of them in order of time.

    ``n_records``, of which ``n_judged`` and ``n_alarms``; ``index_median`` and ``index_max``, NaN if none is judged.
    """
    day = answers.index.normalize()
    starts = np.flatnonzero(np.append(True, day[1:] != day[:-1])) if len(day) else np.empty(0, dtype=np.intp)
    stops = np.append(starts, len(day))[1:]
    index, is_alarm = answers["index"].to_numpy(), (answers["state"] == "alarm").to_numpy()
    known = [index[start:stop][~np.isnan(index[start:stop])] for start, stop in zip(starts, stops, strict=True)]
    table = {
        "n_records": stops - starts,
        "n_judged": np.array([len(values) for values in known], dtype=np.int64),
        "n_alarms": np.array([is_alarm[a:b].sum() for a, b in zip(starts, stops, strict=True)], dtype=np.int64),
        "index_median": np.array([np.median(values) if len(values) else np.nan for values in known], dtype=float),
        "index_max": np.array([values.max() if len(values) else np.nan for values in known], dtype=float),
    }
    return pd.DataFrame(table, day[starts].rename("day"))
