"""Records of KW51, measured or synthetic, the paper's chain and the default one; for ``plot_kw51_study.py``."""

import time
import warnings
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cache

import numpy as np
import pandas as pd
from sklearn.pipeline import make_pipeline

from skthermo.datasets import load_kw51, make_kw51, make_kw51_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.metrics import mape
from skthermo.preprocessing import BiasAligner, KNNGapImputer, LagFeatures
from skthermo.surrogate import DataInformedFEM, TemperatureMapper, paper_chain, paper_network

MODES = [f"f{mode}" for mode in range(1, 7)]
PAIR = ["f2", "f4"]  # the modes that the paper's index sees
BASELINE, TRAINED = 4000, 3200  # first records; the paper trains on four fifths of them
LAGS = 24
NOISE = (0.003, 0.0017, 0.0016, 0.0026, 0.00115, 0.0015)  # relative, of the identified frequencies
PART = 0.3  # of the retrofit, harder to find
PAPER_RETROFIT = {"damage": {"connections": -0.15}}


@cache
def bridge():
    """The updated FE model, reduced: its frequencies to 0.005 %, and much faster."""
    return make_kw51(updated=True).reduced(0.3, tol=5e-5, random_state=0)


@dataclass
class Records:
    """Temperatures and the six lowest modes; what is known of their truth."""

    title: str
    temperatures: pd.DataFrame
    frequencies: pd.DataFrame
    state: pd.Series
    retrofit: dict
    clean: pd.DataFrame | None = None

    @classmethod
    def read(cls, path=None, seed=0):
        """The published file or, without a path, a synthetic campaign."""
        if path is None:
            campaign = make_kw51_campaign(random_state=seed)
            title = f"KW51, synthetic campaign (seed {seed})"
            tables = campaign.temperatures, campaign.frequencies, campaign.state, campaign.retrofit
            return cls(title, *tables, campaign.clean_frequencies)
        data = load_kw51(path)
        retrofit = make_kw51_campaign(n_hours=1).retrofit
        title = "KW51, measured" if data.is_published else f"KW51, {path.name}"  # only the published file is known
        return cls(title, data.temperatures[["tBD31A"]], data.frequencies[MODES], data.state, retrofit)

    @property
    def changes(self):
        """The healthy bridge, the retrofit that explains the shifts, a part of it, and the paper's."""
        part = {name: scaled(change, PART) for name, change in self.retrofit.items()}
        return {"healthy": {}, "retrofit": self.retrofit, "part": part, "paper's": PAPER_RETROFIT}

    @property
    def after(self):
        """Which records are from after the retrofit."""
        return (self.state == "after").to_numpy()

    def imputed(self):
        """The records with all gaps filled from ten similar records, of each state by itself, as in the paper."""
        both = pd.concat([self.temperatures, self.frequencies], axis=1)
        filled = pd.concat([KNNGapImputer(n_neighbors=10).fit_transform(part) for _, part in both.groupby(self.state)])
        filled = filled.loc[both.index]
        return replace(self, temperatures=filled[self.temperatures.columns], frequencies=filled[MODES])


PUBLISHED, WITHOUT, DEFAULT = "the paper's chain", "without dropout", "skthermo"
CHAINS = (PUBLISHED, WITHOUT, DEFAULT)


def chain(name):
    """An unfitted chain that sees the temperatures of a day: the paper's, the same without dropout, or the default."""
    if name == DEFAULT:
        mapper = make_pipeline(LagFeatures(LAGS, freq="h"), TemperatureMapper())
        return DataInformedFEM(bridge(), mapper=mapper, aligner=BiasAligner(bridge()))
    fem = paper_chain(bridge(), network="kw51", lags=LAGS)
    if name == WITHOUT:
        networks = {part: paper_network(table, dropout=False) for part, table in (("inverse", 4), ("mapper", 6))}
        fem.set_params(inverse__regressor=networks["inverse"], mapper__temperaturemapper__regressor=networks["mapper"])
    return fem


EXPECTED_WARNINGS = (
    ".*uncalibrated-model",
    ".*few-records",
    ".*outside-bounds",
    ".*other-weather",
    ".*poor-fit",
)


@contextmanager
def quiet():
    """Without the warnings that this study counts itself, or that belong to choices which it shows to be bad."""
    with warnings.catch_warnings():
        for message in EXPECTED_WARNINGS:
            warnings.filterwarnings("ignore", message=message)
        yield


@dataclass
class Fitted:
    """A chain that has learned from the first records, and records as it sees them: the paper's chain, imputed."""

    records: Records
    fem: DataInformedFEM
    seconds: float
    noise_free: dict = field(default_factory=dict)

    @classmethod
    def by(cls, records, name, seed=0):
        """The chain of this name."""
        fem = chain(name).set_params(random_state=seed)
        began = time.perf_counter()
        with quiet():
            fem.fit(records.temperatures[:TRAINED], records.frequencies[:TRAINED])
        seconds = time.perf_counter() - began
        return cls(records if name == DEFAULT else records.imputed(), fem, seconds)

    def test(self, table):
        """The last fifth of the first records."""
        return table[TRAINED:BASELINE]

    def predicted(self):
        """Predictions of the last fifth; lags reach back into the records before."""
        return self.test(self.simulated("healthy"))

    def errors(self, measured):
        """MAPE of the predictions of the last fifth."""
        return mape(self.test(measured), self.predicted())

    def simulated(self, change="healthy", noise=0.0, seed=0):
        """All records as the chain simulates them, healthy or after a change of `Records.changes`."""
        with quiet():
            if change not in self.noise_free:
                self.noise_free[change] = self.fem.simulate(self.records.temperatures, **self.records.changes[change])
            draw = self.fem.recorder_.noise(self.fem.weather(self.records.temperatures), noise, random_state=seed)
        return self.noise_free[change] * (1 + draw)

    def detection(self, noise="fitted", modes=PAIR, complete=True, change="retrofit", seed=0):
        """Table 9: rates of alarms in percent and damage indices, measured and simulated; and the threshold.

        With ``complete`` an index needs all of its modes, as in the paper.
        """
        F, after = self.records.frequencies, self.records.after
        tables = {
            ("healthy", "measured"): self.test(F),
            ("healthy", "simulated"): self.test(self.simulated("healthy", noise, seed)),
            ("retrofit", "measured"): F[after],
            ("retrofit", "simulated"): self.simulated(change, noise, seed)[after],
        }
        baseline = F[:TRAINED][modes]
        detector = MahalanobisDetector(threshold="quantile").fit(baseline.dropna() if complete else baseline)
        return {key: index(detector, table[modes], complete) for key, table in tables.items()}, detector.threshold_


def index(detector, table, complete):
    """Damage index of each record; with ``complete``, only where all modes are there."""
    with quiet():
        found = pd.Series(np.ravel(detector.damage_index(table)), table.index)
    return found.where(table.notna().all(axis=1)) if complete else found


def rates(indices, threshold):
    """Alarms in percent, mean and standard deviation of the index, and the share of records that have one."""
    rows = {}
    for key, found in indices.items():
        known = found.dropna()
        rows[key] = {
            "alarms, %": 100 * (known > threshold).mean(),
            "mean index": known.mean(),
            "deviation": known.std(),
            "records with an index, %": 100 * len(known) / len(found),
        }
    return pd.DataFrame(rows).T


def scaled(change, share):
    """A share of the severities of groups, or of a matrix."""
    return (
        {group: share * severity for group, severity in change.items()} if isinstance(change, dict) else share * change
    )
