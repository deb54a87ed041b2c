"""Files of a bridge that does not exist, to try the commands on."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pandas as pd

from skthermo._core.files import write_when_complete
from skthermo.datasets import make_fleet


def write_demo(folder: Path, now: pd.Timestamp) -> list[str]:
    """Write records of a synthetic girder bridge, every three hours until now, and say what is in each file."""
    end = now.tz_convert("UTC").tz_localize(None).floor("3h")
    last_day, new, start = (end - pd.Timedelta(days=days) for days in (1, 31, 396))
    bridge = make_fleet(2, random_state=0)["bridge 001"]
    healthy, damaged = (
        _table(bridge.records(396, start, samples_per_day=8, damage=loss)) for loss in ({}, {"first span": 0.1})
    )
    is_baseline, is_last = healthy.index < new, healthy.index >= last_day
    files = {
        "T.csv": healthy.loc[is_baseline, healthy.columns.str.endswith("[degC]")],
        "F.csv": healthy.loc[is_baseline, healthy.columns.str.endswith("[Hz]")],
        "new.csv": healthy[~is_baseline & ~is_last],
        "damaged.csv": damaged[is_last],
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, table in files.items():
        write_when_complete(folder / name, table.to_csv(date_format="%Y-%m-%d %H:%M:%S+00:00"))
    at = {name: folder / name for name in files}
    return [
        f"{at['T.csv']}, {at['F.csv']}: temperatures and frequencies of a girder bridge, a healthy year",
        f"{at['new.csv']}: the 30 days after it, healthy",
        f"{at['damaged.csv']}: the last day, in which the first span has lost 10 % of its stiffness",
        f"next: skthermo init {at['T.csv']} {at['F.csv']} --into river",
    ]


def _table(records: Any) -> pd.DataFrame:
    """Temperatures and frequencies as a logger writes them: units in the heads, few digits."""
    T, F = records.temperatures.round(2).add_suffix(" [degC]"), records.frequencies.round(4).add_suffix(" [Hz]")
    return T.join(F).rename_axis("time")
