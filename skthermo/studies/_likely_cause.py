"""Likely causes of shifts that no damage explains."""

import numpy as np
import pandas as pd

from skthermo._arguments import seem_rad_per_s
from skthermo._arrays import Array

NEAR = 0.25
"""Relative distance from 2 pi up to which ratios of frequencies suggest rad/s."""

CLEAR = 2.0
"""Standard errors from which a frequency has clearly risen."""


def unexplained(shifts: pd.DataFrame) -> Array:
    """Measured less explained shift of each mode in standard errors; NaN for a mode that was not measured."""
    return ((shifts["measured"] - shifts["explained"]) / shifts["standard_error"]).to_numpy(dtype=float)


def likely_cause(shifts: pd.DataFrame) -> str:
    """What may have shifted the frequencies if no damage did, as part of a sentence; empty if nothing suggests it."""
    rest, known = unexplained(shifts), shifts[shifts["measured"].notna()]
    if np.isnan(rest).all():
        return ""
    ratios = 1 + known["measured"].to_numpy(dtype=float)
    if seem_rad_per_s(ratios, NEAR):
        return "the measured frequencies are about 2 pi times the predicted ones, perhaps in rad/s; expected Hz"
    rose = (known["measured"] > CLEAR * known["standard_error"]).sum()
    worst = int(np.nanargmax(np.abs(rest)))
    if rose == 0 or rest[worst] < 0:
        return ""
    return (
        f"{rose} of {len(known)} frequencies rose, that of mode {shifts.index[worst]} by "
        f"{shifts['measured'].iloc[worst]:.2%}; strengthening is not sought, because severities are not negative"
    )
