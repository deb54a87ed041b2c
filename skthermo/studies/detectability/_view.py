"""Which columns a detector sees of measured and simulated records."""

from collections.abc import Hashable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from skthermo._arrays import Array, as_columns, as_floats
from skthermo._frames import check_same_rows, column_names, frame_like


@dataclass(frozen=True)
class View:
    """Columns of a detector's baseline: their positions among temperatures and modes of the chain side by side."""

    names: Sequence[Hashable]
    n_sensors: int
    positions: Any
    is_frame: bool

    def table(self, T: Any, F: Array) -> Any:
        """Temperatures and frequencies of all modes as the detector sees them."""
        return self._seen(np.hstack([as_floats(T), F]), T)

    def reference(self, records: Any, T: Any, name: str) -> Any:
        """Measured records of a scenario as the detector sees them, with temperatures T where they lack their own."""
        known = self._positions_of(records, f"the reference of scenario {name!r}")
        values = np.full((len(records), len(self.names)), np.nan)
        values[:, known] = as_columns(records)
        lacking = np.setdiff1d(self.positions, known)
        if (lacking >= self.n_sensors).any():
            raise ValueError(
                f"the reference of scenario {name!r} lacks the modes {[self.names[i] for i in lacking]}; expected "
                f"those that the detector sees"
            )
        if lacking.size:
            check_same_rows(T, records, ("temperatures", f"the reference of scenario {name!r}"))
            values[:, : self.n_sensors] = as_floats(T)
        return self._seen(values, records if isinstance(records, pd.DataFrame) or len(values) != len(T) else T)

    def _seen(self, values: Array, rows: Any) -> Any:
        """The detector's columns of all of the chain's, on the index of some rows."""
        if not self.is_frame:
            return values[:, self.positions]
        index = rows.index if isinstance(rows, pd.DataFrame) else None
        return pd.DataFrame(values[:, self.positions], index=index, columns=[self.names[i] for i in self.positions])

    def _positions_of(self, records: Any, what: str) -> Any:
        """Which of the chain's columns a table holds."""
        n_columns, n_all = np.shape(records)[1] if np.ndim(records) == 2 else 0, len(self.names)
        sensors, modes = list(self.names[: self.n_sensors]), list(self.names[self.n_sensors :])
        if isinstance(records, pd.DataFrame):
            unknown = [name for name in records.columns if name not in self.names]
            if unknown or not set(records.columns) & set(modes):
                raise ValueError(
                    f"{what} has the columns {list(records.columns)}; expected modes {modes}, alone or beside "
                    f"temperatures {sensors}, as in the fit of the chain"
                )
            return np.array([list(self.names).index(name) for name in records.columns])
        if n_columns not in (n_all, n_all - self.n_sensors):
            raise ValueError(
                f"{what} has shape {np.shape(records)}; expected {n_all - self.n_sensors} columns of frequencies, or "
                f"{self.n_sensors} of temperatures and {n_all - self.n_sensors} of frequencies side by side"
            )
        return np.arange(n_all - n_columns, n_all)


def read_baseline(fem: Any, detector: Any, baseline: Any) -> tuple[View, Any]:
    """The detector's view, and the records that it learns from: by default those that the chain has learned from.

    Only a detector with a part that has ``targets`` sees temperatures.
    """
    T, F = fem.training_records_
    names, n_sensors, compensates = [*column_names(T, "T"), *fem.mode_names_], fem.n_features_in_, has_targets(detector)
    everything = View(names, n_sensors, np.arange(len(names)), False)
    if baseline is None:
        positions = everything.positions if compensates else everything.positions[n_sensors:]
        view = View(names, n_sensors, positions, isinstance(T, pd.DataFrame) or isinstance(F, pd.DataFrame))
        return view, view.table(T if isinstance(T, pd.DataFrame) else frame_like(F, as_floats(T)), as_floats(F))
    known = everything._positions_of(baseline, "the baseline")
    if compensates and not (known < n_sensors).any():
        raise ValueError("the detector compensates for temperature, and the baseline has none; expected both")
    seen = np.flatnonzero(compensates | (known >= n_sensors))
    view = View(names, n_sensors, known[seen], isinstance(baseline, pd.DataFrame))
    return view, baseline.iloc[:, seen] if view.is_frame else as_columns(baseline)[:, seen]


def has_targets(detector: Any) -> bool:
    """Whether a part of a detector takes some of its columns for targets, as `TemperatureCompensator` does."""
    return any(name.rsplit("__", 1)[-1] == "targets" for name in detector.get_params())
