"""What loaders and campaigns return, with the type of every attribute."""

from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.utils import Bunch

from skthermo.fem import AffineModel


class Monitoring(Bunch):
    """Records of a structure."""

    temperatures: pd.DataFrame
    frequencies: pd.DataFrame


class Z24Monitoring(Monitoring):
    """What `load_z24` returns."""

    state: pd.Series


class KW51Monitoring(Monitoring):
    """What `load_kw51` returns."""

    damping: pd.DataFrame
    shapes: NDArray[np.complex128]
    sensors: list[str]
    state: pd.Series
    is_published: bool | None


class Campaign(Monitoring):
    """Simulated records, with what they were simulated from."""

    clean_frequencies: pd.DataFrame
    theta: pd.DataFrame
    model: AffineModel


class TrussCampaign(Campaign):
    """What `make_truss_campaign` returns."""


class KW51Campaign(Campaign):
    """What `make_kw51_campaign` returns; ``shapes`` are there if they were asked for."""

    damping: pd.DataFrame
    shapes: NDArray[np.complex128]
    sensors: list[str]
    state: pd.Series
    retrofit: dict[str, Any]


class FleetRecords(Monitoring):
    """What ``records`` of a `~skthermo.datasets.make_fleet` bridge returns."""

    clean_frequencies: pd.DataFrame
    theta: pd.DataFrame
