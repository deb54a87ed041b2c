"""A fleet whose bridges are given, with the attributes of a fitted one."""

import pandas as pd

from skthermo.fleet._discoveries import COLUMNS, Discoveries


class FakeFleet:
    """Monitors, chains and errors by bridge; a bridge is fitted if it has a chain or a monitor."""

    def __init__(self, monitors=(), chains=(), errors=(), warned=(), significant=()):
        self.monitors, self.chains = dict(monitors), dict(chains)
        names = list(dict.fromkeys([*self.monitors, *self.chains, *dict(errors)]))
        rows = [(name, "update" if name in self.monitors else "fit", text) for name, text in dict(errors).items()]
        self.errors = pd.DataFrame(rows, columns=["bridge", "stage", "error"])
        is_fitted = [name in self.monitors or name in self.chains for name in names]
        self.table = pd.DataFrame({"is_fitted": is_fitted}, pd.Index(names, name="bridge", dtype=object))
        self.warnings = pd.DataFrame(list(warned), columns=["bridge", "kind", "message"])
        self.significant = set(significant)

    def discoveries(self, fdr=0.1):
        rows = [
            {"bridge": name, "event": number, "p_value": 0.001 if (name, number) in self.significant else 0.5} | event
            for name, monitor in self.monitors.items()
            if monitor is not None
            for number, event in monitor.events_.to_dict("index").items()
            if event["kind"] == "damage"
        ]
        table = pd.DataFrame(rows, columns=[*COLUMNS, "is_discovery"])
        table["is_discovery"] = table["end"].isna() & (table["p_value"] < 0.01)
        p_values = pd.Series(1.0, list(self.monitors))
        return Discoveries(fdr, table, p_values, 0.01, [], 0.5, float(len(self.monitors)))
