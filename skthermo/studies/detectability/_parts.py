"""Which part of what is unknown is how large in the bands of a study."""

from collections.abc import Sequence

import numpy as np
import pandas as pd

from skthermo.studies.detectability._world_rates import WorldRates

CAUSES = {"noise": "noise", "weather": "weather", "baseline": "training records", "model": "model"}
SMALL = 0.1  # share of a variance that is not worth a word


def table_of_parts(worlds: WorldRates) -> pd.DataFrame:
    """Standard deviation of the rate due to each part, and its share of the variance, by detector and scenario."""
    rows = {}
    for key in worlds.rates:
        deviations = worlds.by_part(key)
        total = sum(deviation**2 for deviation in deviations.values())
        shares = {f"{part} share": one**2 / total if total > 0 else np.nan for part, one in deviations.items()}
        rows[key] = {**deviations, "together": np.sqrt(total), **shares}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis(["detector", "scenario"])


def bands_in_words(results: pd.DataFrame, parts: pd.DataFrame, detector: str, confidence: float) -> list[str]:
    """What the bands of a detector hold, and which part of the widest one is the largest."""
    names = [column for column in parts.columns if column in CAUSES]
    rows = results[(results["detector"] == detector) & (results["source"] == "data-informed")].set_index("scenario")
    width = (rows["band_highest"] - rows["band_lowest"]).drop(rows.index[rows["measure"] == "PFA"])
    line = f"Bands hold {_listed([CAUSES[name] for name in names])}."
    if not len(width.dropna()) or (detector, width.idxmax()) not in parts.index:
        return [line]
    widest = rows.loc[width.idxmax()]
    shares = parts.loc[(detector, widest.name), [f"{name} share" for name in names]].set_axis(names)
    told = shares[shares >= SMALL].sort_values(ascending=False)
    causes = _listed([f"{share:.0%} from {'the ' * (name != 'noise')}{CAUSES[name]}" for name, share in told.items()])
    return [
        line,
        f"A measured campaign of {widest.name!r} should show {widest['band_lowest']:.1%} to "
        f"{widest['band_highest']:.1%} of its records in alarm ({confidence:.0%} band, the widest); of its variance "
        f"come {causes}.",
    ]


def _listed(texts: Sequence[str]) -> str:
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"
