"""The retrofit of KW51: what it adds, and when."""

import numpy as np
import pandas as pd

from skthermo._arrays import Array
from skthermo.datasets._kw51_structure import kw51_structure
from skthermo.fem import PointMass

BEGUN, FINISHED = pd.Timestamp("2019-05-15 00:00"), pd.Timestamp("2019-09-27 01:00")
STIFFENED = {"arch_connections": 0.906, "deck_connections": 0.430}
ADDED = {"arch": 353.0, "deck": 837.0}  # kg at each joint of brace and connection
PROGRESS = pd.DataFrame(
    {"mass": [0.0, 0.0, 0.5, 0.5, 0.5, 1.0], "stiffness": [0.0, 0.0, 0.0, 0.5, 0.5, 1.0]},
    index=pd.to_datetime(["2019-05-15", "2019-06-06", "2019-06-20", "2019-06-28", "2019-09-06", "2019-09-16"]),
)


def joint_masses() -> dict[object, PointMass]:
    """A point mass at every joint."""
    joints = [node for node in kw51_structure().nodes if node[0] == "joint"]
    return {("mass", node): PointMass(node, ADDED[node[-1]]) for node in joints}


def retrofit_mass() -> Array:
    """The same, in kg at each degree of freedom."""
    return np.array(
        [ADDED[node[-1]] if node[0] == "joint" and d in "xyz" else 0.0 for node, d in kw51_structure().dofs]
    )


def progress_of(index: pd.DatetimeIndex, retrofit: bool) -> pd.DataFrame:
    """Shares of the retrofit's mass and stiffness that are there in each hour."""
    if not retrofit:
        return pd.DataFrame(0.0, index, PROGRESS.columns)
    knots = (PROGRESS.index - index[0]) / pd.Timedelta(hours=1)
    hours = np.arange(len(index))
    return pd.DataFrame({name: np.interp(hours, knots, shares) for name, shares in PROGRESS.items()}, index)


def state_of(index: pd.DatetimeIndex, retrofit: bool) -> pd.Series:
    """ "before", "during" or "after" the retrofit."""
    state = np.full(len(index), "before", dtype=object)
    if retrofit:
        state[index >= BEGUN] = "during"
        state[index >= FINISHED] = "after"
    return pd.Series(state, index, name="state")
