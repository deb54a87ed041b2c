"""A fleet whose bridges are given, with the attributes of a fitted one."""

import numpy as np
import pandas as pd

from skthermo.fleet._discoveries import Discoveries


class FakeFleet:
    """Monitors, chains and errors by bridge; a bridge is fitted if it has a chain or a monitor."""

    def __init__(self, monitors=(), chains=(), errors=(), warned=(), kept=()):
        self.monitors, self.chains = dict(monitors), dict(chains)
        names = list(dict.fromkeys([*self.monitors, *self.chains, *dict(errors)]))
        self.errors = pd.DataFrame(
            [(name, "fit", text) for name, text in dict(errors).items()], columns=["bridge", "stage", "error"]
        )
        is_fitted = [name in self.monitors or name in self.chains for name in names]
        self.table = pd.DataFrame({"is_fitted": is_fitted}, pd.Index(names, name="bridge", dtype=object))
        self.warnings = pd.DataFrame(list(warned), columns=["bridge", "kind", "message"])
        self.kept = set(kept)

    def discoveries(self, share=0.1):
        rows = [
            (name, number, (name, number) in self.kept)
            for name, monitor in self.monitors.items()
            if monitor is not None
            for number in monitor.events_.index[monitor.events_["kind"] == "damage"]
        ]
        table = pd.DataFrame(rows, columns=["bridge", "event", "is_discovery"]).astype({"is_discovery": bool})
        table["p_value"] = np.linspace(0, 1, len(table))
        p_values = pd.Series(1.0, list(self.monitors))
        return Discoveries(share, table, p_values, [], 0.5, float(len(self.monitors)))
