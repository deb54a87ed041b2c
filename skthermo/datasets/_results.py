"""Results of loaders and campaigns, with the type of every attribute."""

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
    """Result of `load_z24`."""

    state: pd.Series


class KW51Monitoring(Monitoring):
    """Result of `load_kw51`."""

    damping: pd.DataFrame
    shapes: NDArray[np.complex128]
    sensors: list[str]
    state: pd.Series
    is_published: bool | None


class Campaign(Monitoring):
    """Simulated records, with their model and parameters."""

    clean_frequencies: pd.DataFrame
    theta: pd.DataFrame
    model: AffineModel


class TrussCampaign(Campaign):
    """Result of `make_truss_campaign`."""


class KW51Campaign(Campaign):
    """Result of `make_kw51_campaign`; with ``shapes`` if they were asked for."""

    damping: pd.DataFrame
    shapes: NDArray[np.complex128]
    sensors: list[str]
    state: pd.Series
    retrofit: dict[str, Any]


class FleetRecords(Monitoring):
    """Result of ``records`` of a `~skthermo.datasets.make_fleet` bridge."""

    clean_frequencies: pd.DataFrame
    theta: pd.DataFrame
