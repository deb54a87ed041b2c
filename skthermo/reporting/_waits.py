"""How soon damage is found, in the units of an owner: days, weeks, and cases in a hundred."""

from typing import Any

import numpy as np
import pandas as pd

from skthermo._formatting import bounds_text, duration_text, percent, share_text
from skthermo.reporting._html import Html, bullets, element, joined, paragraphs, table

RELIABLE = 0.95  # share of the cases in which damage is found within the time that is told
BOUNDS = (" lowest", " highest")


def how_soon(study: Any) -> Html:
    """Sentences on the smallest damage of each family, and a table of all scenarios."""
    waits = study.time_to_find(level=RELIABLE)
    is_healthy = dict(zip(study.results_["scenario"], study.results_["measure"] == "PFA", strict=True))
    told = study.time_to_find(level=RELIABLE, smallest=True)
    items = [
        element("span", element("strong", f"{row['scenario']}:"), f" {row['text']}.")
        for _, row in told.sort_values("scenario", key=lambda names: names.map(is_healthy), kind="stable").iterrows()
    ]
    times = [name for name in waits if f"{name} healthy" in waits and waits[name].notna().any()]
    meaning = (
        "Damage may begin on any day of the simulated weather, and is found with the first alarm after that. An alarm "
        "may also be a false one: the chance that the structure without damage raises one in the same time stands "
        "beside. The longer the time, the more of both there are."
    )
    delayed = float(waits["not_judged"].max())
    if delayed:
        meaning += f" In {share_text(delayed)} of the time no record can be judged, which delays what is found."
    columns = ["Scenario", *(f"Alarm within {_label(name)}" for name in times), "In half of the cases", "In 95 of 100"]
    cells = [
        [row["scenario"], *(_chance(row, name) for name in times), _time(row["median"]), _time(row["reliable"])]
        for _, row in waits.iterrows()
    ]
    caption = (
        f"Chance of an alarm within a time from the beginning of the damage, with {percent(study.confidence_)} bounds"
    )
    return joined(
        [bullets(items), paragraphs(meaning), table(f"{caption}, and time to the first alarm.", columns, cells)]
    )


def _chance(row: pd.Series, name: str) -> str:
    if np.isnan(row[name]):
        return "records too short or too rare"
    return f"{share_text(row[name])} ({bounds_text(*(row[name + bound] for bound in BOUNDS))})"


def _time(wait: Any) -> str:
    return "longer than the records" if pd.isna(wait) else duration_text(wait)


def _label(name: str) -> str:
    """A column of the table in words."""
    return f"{name} records" if name.isdigit() else {"1D": "a day", "7D": "a week", "30D": "30 days"}.get(name, name)
