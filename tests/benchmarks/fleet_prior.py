"""What other bridges' mappers give to a new bridge: errors of a later year after 15, 30, 60 and 120 days.

    OMP_NUM_THREADS=1 python tests/benchmarks/fleet_prior.py --starts winter summer

Bridges of `make_fleet` with gaps, outliers and noise that lasts. In turn each is the new one: groups of bridges are
left out, the others give a year (2025), the new one its first days from January or from July 2026 on, and its clean
frequencies of 2027 are predicted. Errors are mean absolute percent over records and modes. Ways to predict:

alone     the library without a fleet: `TemperatureMapper`
mean      the mean response to the weather of the other bridges of its kind, at the bridge's own level
ridge     the bridge's own ridge regression towards that mean, its penalty chosen by what would have predicted the
          others' later records best after as many days from the same date
fleet     ``FleetMapper(mappers)``, mappers of the bridges of its kind (0.2.0: ``FleetPrior`` with the covariates kind,
          material, span and latitude, of all kinds)
own year  alone, with all of 2026

Bridges have no FE models. Then new bridges with thermal laws of their own come to the fleet. Intervals are of the
posterior and the scatter of the bridge's own residuals.

Targets: the fleet's mean error is below that of alone and no more than 2 % above the better of mean and ridge, at
each number of days and start; with atypical at most 5 % above alone; 85 to 95 % of the records of the year are in
intervals of 90 %. The exit code is 1 if one is missed.
"""

import sys
from collections import defaultdict
from functools import cached_property

import numpy as np
import pandas as pd
from harness import arguments, is_missed, shown
from sklearn.linear_model import RidgeCV
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.datasets import make_fleet
from skthermo.preprocessing import HingeFeatures, SensorMeans
from skthermo.surrogate import TemperatureMapper

try:
    from skthermo.surrogate import FleetMapper

    FleetPrior = None
except ImportError:  # before 0.3
    from skthermo.fleet import FleetMapper, FleetPrior

DAYS = (15, 30, 60, 120)
STARTS = {"winter": "2026-01-01", "summer": "2026-07-01"}
PENALTIES = np.logspace(-3, 6, 19)
WAYS = {
    "alone": "alone",
    "mean": "mean of the fleet",
    "ridge": "ridge towards the mean",
    "fleet": "mapper of the fleet",
    "own year": "a year of its own",
}
CLOSE, LOSS, LEAST, MOST = 1.02, 1.05, 0.85, 0.95
QUANTILE = 1.645  # of intervals of 90 %


class Frequencies:
    """A bridge without FE model: the quantities are its frequencies."""

    def __init__(self, bridge):
        self.bridge = bridge

    def year(self, start, days=365):
        """Means of the thermometers by role, frequencies, clean frequencies."""
        records = self.bridge.records(days, start)
        return SensorMeans(self.bridge.roles).fit_transform(records.temperatures), records

    @cached_property
    def of_fleet(self):
        """What it gives to the fleet: its pair of tables."""
        X, records = self.year("2025-01-01")
        return X, records.frequencies

    @cached_property
    def mapper(self):
        """What the fleet knows of it."""
        return TemperatureMapper().fit(*self.of_fleet)

    def pair(self):
        """Inputs and logarithms of its year in the fleet."""
        X, F = self.of_fleet
        return X.to_numpy(), np.log(F.to_numpy())

    def fitted(self, mapper, start, days):
        """Predictions of the evaluated year by a mapper that has seen the first days, and their intervals."""
        X, records = self.year(start, days)
        evaluated, later = self.evaluated
        complete = evaluated.notna().all(axis=1).to_numpy()
        centre = np.full(later.frequencies.shape, np.nan)
        spread = np.zeros_like(centre)
        if isinstance(mapper, FleetMapper):
            mapper.fit(X, records.frequencies)
            centre[complete], spread[complete] = mapper.predict(evaluated[complete], return_std=True)
            at = X.notna().all(axis=1).to_numpy()
            left = records.frequencies[at].to_numpy() - mapper.predict(X[at]).to_numpy()
            noise = 1.4826 * np.nanmedian(np.abs(left), axis=0) * np.sqrt(days / (days - 3))
            half = QUANTILE * np.sqrt(spread**2 + noise**2)
            return centre, (centre - half, centre + half)
        for i, mode in enumerate(records.frequencies):
            f = records.frequencies[mode]
            known = f.notna() & X.notna().all(axis=1)
            centre[complete, i] = np.ravel(TemperatureMapper().fit(X[known], f[known]).predict(evaluated[complete]))
        return centre, None

    @cached_property
    def evaluated(self):
        """Inputs and records of the evaluated year."""
        return self.year("2027-01-01")

    def by_logs(self, start, days, predict):
        """Predictions of the evaluated year by a function of (X, logs, X of that year) that predicts logs."""
        X, records = self.year(start, days)
        return np.exp(predict(X.to_numpy(), np.log(records.frequencies.to_numpy()), self.evaluated[0].to_numpy()))


class Competitors:
    """Mean and ridge of bridges of one kind, on one piecewise-linear basis."""

    def __init__(self, members):
        tables = {name: member.pair() for name, member in members.items()}
        everything = np.concatenate([X[~np.isnan(X).any(axis=1)] for X, _ in tables.values()])
        self.basis = make_pipeline(HingeFeatures(), StandardScaler()).fit(everything)
        self.years = {name: (self.of(X), y) for name, (X, y) in tables.items()}
        self.own = {name: self.year_alone(U, y) for name, (U, y) in self.years.items()}
        self.penalties = {}

    def of(self, X):
        """The basis; NaN where an input is."""
        U = np.full((len(X), 5 * X.shape[1]), np.nan)
        known = ~np.isnan(X).any(axis=1)
        U[known] = self.basis.transform(X[known])
        return U

    @staticmethod
    def year_alone(U, y):
        """Coefficients of a bridge's own year, an array (n_functions, n_outputs)."""
        known = [~np.isnan(U).any(axis=1) & ~np.isnan(column) for column in y.T]
        return np.column_stack(
            [RidgeCV(np.logspace(-3, 5, 17)).fit(U[k], c[k]).coef_ for k, c in zip(known, y.T, strict=True)]
        )

    def mean(self, without=None):
        """Mean of the coefficients."""
        return np.mean([beta for name, beta in self.own.items() if name != without], axis=0)

    @staticmethod
    def predict(beta, U, y, U_new):
        """Logarithms by given coefficients, at the level of the bridge's own records."""
        level = np.nanmean(y - U @ beta, axis=0)
        return level + U_new @ beta

    @staticmethod
    def towards(mean, penalty, U, y):
        """Coefficients of a ridge regression towards a mean, each output at its own level."""
        beta = np.empty_like(mean)
        for i, column in enumerate(y.T):
            k = ~np.isnan(U).any(axis=1) & ~np.isnan(column)
            u, left = U[k] - U[k].mean(axis=0), column[k] - U[k] @ mean[:, i]
            beta[:, i] = mean[:, i] + np.linalg.solve(
                u.T @ u + penalty * np.eye(u.shape[1]), u.T @ (left - left.mean())
            )
        return beta

    def penalty(self, start, days):
        """What predicts the others' later records best after as many days from the same date of their year."""
        if (start, days) not in self.penalties:
            first = (pd.Timestamp(start) - pd.Timestamp("2026-01-01")).days
            errors = np.zeros(len(PENALTIES))
            for name, (U, y) in self.years.items():
                early, later = slice(first, first + days), np.r_[0:first, first + days : len(U)]
                mean = self.mean(without=name)
                for i, penalty in enumerate(PENALTIES):
                    beta = self.towards(mean, penalty, U[early], y[early])
                    errors[i] += np.nanmean(np.abs(self.predict(beta, U[early], y[early], U[later]) - y[later]))
            self.penalties[start, days] = PENALTIES[errors.argmin()]
        return self.penalties[start, days]

    def ways(self, start, days):
        """A function of (X, logs, X of that year) for each way."""

        def with_own(X, y, X_new):
            U = self.of(X)
            return self.predict(self.towards(self.mean(), self.penalty(start, days), U, y), U, y, self.of(X_new))

        def by_mean(X, y, X_new):
            return self.predict(self.mean(), self.of(X), y, self.of(X_new))

        return {"mean": by_mean, "ridge": with_own}


def share_inside(ends, measured):
    """Share of measured frequencies inside their intervals."""
    lower, upper = ends
    known = ~np.isnan(measured) & ~np.isnan(lower)
    return ((measured >= lower) & (measured <= upper))[known].mean()


def evaluate(member, new, start, days, ways):
    """Errors in percent, and shares in intervals, of all ways to predict one bridge."""
    truth = member.evaluated[1]
    clean, measured = truth.clean_frequencies.to_numpy(), truth.frequencies.to_numpy()
    found = {}
    for way, mapper in ways.items():
        if callable(mapper):
            centre, ends = member.by_logs(start, days, mapper), None
        else:
            centre, ends = member.fitted(mapper, start, days)
        found[way] = (100 * np.nanmean(np.abs(centre / clean - 1)), share_inside(ends, measured) if ends else np.nan)
    return [{"bridge": new, "days": days, "way": way, "error": e, "inside": share} for way, (e, share) in found.items()]


def covariates_of(bridges):
    """A row for each bridge: its kind, material, span and latitude."""
    return pd.DataFrame.from_dict({name: bridge.covariates for name, bridge in bridges.items()}, orient="index")


def known_of(bridge, fleet):
    """Covariates of a bridge; a material that no bridge of the fleet has counts as unknown."""
    given = bridge.covariates
    return given | {"material": given["material"] if (fleet["material"] == given["material"]).any() else None}


def campaign_rows(members, covariates, folds, days_asked, starts, newcomers=None):
    """A row for each new bridge, start, number of days and way; folds of the members are new in turn, or newcomers."""
    rows = []
    for fold in folds:
        known = {name: member for name, member in members.items() if name not in fold}
        facts = covariates.loc[list(known)]
        prior = FleetPrior and FleetPrior().fit({n: m.of_fleet for n, m in known.items()}, covariates=facts)
        kinds = defaultdict(dict)
        for name, member in known.items():
            kinds[member.bridge.kind][name] = member
        by_kind = {kind: Competitors(mates) for kind, mates in kinds.items()}
        for name in fold:
            member = (newcomers or members)[name]
            year = evaluate(member, name, "2026-01-01", 365, {"own year": TemperatureMapper()})
            for label in starts:
                start = STARTS[label]
                for days in days_asked:
                    ways = {"alone": TemperatureMapper()}
                    ways |= by_kind[member.bridge.kind].ways(start, days)
                    if prior:
                        ways |= {"fleet": prior.mapper(covariates=known_of(member.bridge, facts))}
                    else:
                        ways |= {"fleet": FleetMapper([mate.mapper for mate in kinds[member.bridge.kind].values()])}
                    found = evaluate(member, name, start, days, ways) + [row | {"days": days} for row in year]
                    rows += [row | {"start": label, "thermal law": member.bridge.atypical_law or ""} for row in found]
    return pd.DataFrame(rows)


def table(rows, by=("start", "days")):
    """A row for each number of days, a column for each way: mean error, %, and the share in the fleet's intervals."""
    found = rows.pivot_table(index=list(by), columns="way", values="error", sort=False)[list(WAYS)]
    inside = rows[rows["way"] == "fleet"].groupby(list(by), sort=False)["inside"].mean()
    return found, inside


def shown_by(title, rows, by=("start", "days")):
    found, inside = table(rows, by)
    found = found.rename(columns=WAYS).assign(**{"in the fleet's 90 % intervals, %": 100 * inside})
    shown(title, found.rename_axis(["first days" if name == "days" else name for name in found.index.names]))


def missed_targets(rows, is_atypical):
    """Number of targets that the rows miss."""
    missed = 0
    for (case, row), share in zip(table(rows)[0].iterrows(), table(rows)[1], strict=True):
        fleet = row["fleet"]
        missed += is_missed(f"{case}: beside alone", fleet, f"<= {(LOSS if is_atypical else 1.0) * row['alone']:.4f}")
        if not is_atypical:
            missed += is_missed(f"{case}: beside the best", fleet, f"<= {CLOSE * min(row['mean'], row['ridge']):.4f}")
            missed += is_missed(f"{case}: within 90 %", share, f">= {LEAST}")
            missed += is_missed(f"{case}: within 90 %", share, f"<= {MOST}")
    return missed


def main():
    options = arguments(
        __doc__,
        bridges=18,
        groups=(3, "left out in turn; as many as bridges: one by one"),
        newcomers=(6, "bridges with laws of their own"),
        days=list(DAYS),
        starts=(["winter"], None, list(STARTS)),
        members=("frequencies", "what is known of the bridges", ["frequencies"]),
        seed=0,
    )
    fleet = make_fleet(options.bridges, random_state=options.seed)
    strangers = make_fleet(options.newcomers, atypical=1.0, random_state=200 + options.seed)
    strangers = {
        f"atypical {n}": type(b)(f"atypical {n}", b.kind, b.seed, b.atypical_law) for n, b in strangers.items()
    }
    members, newcomers = ({name: Frequencies(b) for name, b in bridges.items()} for bridges in (fleet, strangers))
    covariates, asked = covariates_of({**fleet, **strangers}), (options.days, options.starts)
    rows = campaign_rows(members, covariates, np.array_split(list(members), options.groups), *asked)
    settings = f"new bridges without FE models, one of {len(fleet)} each, in {options.groups} groups"
    shown_by(f"Error of the frequencies of a later year, %: {settings}", rows)
    missed = missed_targets(rows, False)
    rows = campaign_rows(members, covariates, [list(newcomers)], *asked, newcomers)
    shown_by(f"The same of {len(newcomers)} bridges whose thermal laws are their own", rows)
    shown_by("The same by law, mean over the days", rows, by=("thermal law",))
    missed += missed_targets(rows, True)
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
