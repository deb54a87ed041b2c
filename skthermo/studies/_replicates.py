"""Replicates: campaigns of other structures that could have given the training records, in other weather."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from scipy.special import expit, logit
from scipy.stats import t

from skthermo._core.arrays import Array, as_floats, positive_integer
from skthermo._core.frames import DAY, DAY_NS, Table, frame_like, has_stamps, row_times
from skthermo._core.parallel import single_blas_thread
from skthermo._core.text import listed
from skthermo._core.warnings import collected
from skthermo.fem import FEModel
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies._pod_curve import FamilyRates, PODCurve, fitted_curve
from skthermo.studies._rates import EvaluatedRecords
from skthermo.studies._scenarios import checked_models
from skthermo.studies._simulation import Candidate, Simulation, changed_frequencies
from skthermo.surrogate import DataInformedFEM, refitted, resampled
from skthermo.updating import ModelUpdater

PARTS = {"noise": "noise", "weather": "the weather", "baseline": "the training records", "model": "the model"}
"""What a replicate draws, in the order in which one is added to the others, and how it is called."""
ENOUGH = 10  # replicates for bands of 90 %


def drawn_replicates(
    fem: DataInformedFEM, uncertainty: str | Sequence[str], T: Table, models: Any, number: Any, seed: Any
) -> tuple[list[str], list[Table], Sequence[FEModel], list[int]]:
    """What varies; years of weather, of which the first is that of the study; models, which are drawn from the training
    records where none are given; and a seed of each replicate."""
    parts = checked_parts(uncertainty, with_models=models is not None)
    years = other_years(T) if isinstance(T, list | tuple) and len(T) and np.ndim(T[0]) == 2 else [T]
    if positive_integer(number, "n_replicates") < 2:
        raise ValueError(f"n_replicates is {number}; expected at least 2, {ENOUGH} or more for bands of 90 %")
    seeds = np.random.RandomState(seed).randint(np.iinfo(np.int32).max, size=number + 1).tolist()
    if models is not None:
        models = checked_models(fem, models)
        if "model" not in parts:
            raise ValueError(
                f"models came, but uncertainty is {uncertainty!r}; expected 'model' among it, 'auto' or 'all'"
            )
    elif "model" in parts:
        models = drawn_models(fem, number, seeds[-1])
    return parts, years, models or [], seeds[:-1]


def replicated(
    simulation: Simulation,
    candidates: Mapping[str, Candidate],
    parts: Sequence[str],
    years: Sequence[Table],
    models: Sequence[FEModel],
    number: int,
    seed: int,
) -> dict[tuple[str, str], list[float]] | str:
    """Rates of alarms of one replicate by detector and scenario, as one part after the other varies, or its error.

    All is drawn from its own seed. Without "noise" among the parts, all replicates have the same.
    """
    random = np.random.RandomState(seed)
    weather, records, noise = random.randint(np.iinfo(np.int32).max, size=3).tolist()
    fem, T, levels, rates = simulation.fem, years[0], 1.0, {}
    chain, scenarios = fem, {one.name: one for one in simulation.scenarios}
    with collected(drop_others=True), single_blas_thread():
        try:
            for part in [one for one in parts if one != "noise"]:
                if part == "weather":
                    days = np.random.RandomState(weather)
                    T = years[number % len(years)] if len(years) > 1 else resampled_days(T, days)
                if part == "model":
                    chain = refitted(fem, model=models[number % len(models)])
                if part == "baseline" or (part == "model" and "baseline" in parts):
                    chain = resampled(chain, records)
                if part == "baseline":  # the training records determine the noise up to an error
                    errors = fem.recorder_.residuals.level_errors
                    levels = np.exp(errors * random.standard_normal(len(errors)))
                clean = changed_frequencies(chain, simulation.scenarios, T, [number])
                here = replace(simulation, T=T, clean=clean, levels=levels, reference=None)
                tables = here.records(0, [noise if "noise" in parts else 0])
                for name, candidate in candidates.items():
                    found = candidate.decided(name, tables)
                    if isinstance(found, Exception):
                        raise found
                    for (_, scenario, source), values in found.decisions.items():
                        one = EvaluatedRecords(name, scenarios[scenario], source, T, values[np.newaxis])
                        kept = one.from_onset()[0]
                        rate = float((kept < 0).sum() / max(np.count_nonzero(~np.isnan(kept)), 1))
                        rates.setdefault((name, scenario), []).append(rate)
        except Exception as error:
            return f"{type(error).__name__}: {error}"
    return rates


def checked_parts(uncertainty: str | Sequence[str], with_models: bool = False) -> list[str]:
    """What varies, or an error; "auto" is all but models, and models too where they are given."""
    if isinstance(uncertainty, str) and uncertainty in ("all", "auto"):
        return [part for part in PARTS if part != "model" or with_models or uncertainty == "all"]
    is_one = isinstance(uncertainty, str | Mapping) or not isinstance(uncertainty, Iterable)
    asked = [uncertainty] if is_one else list(uncertainty)
    if not asked or not all(isinstance(part, str) and part in PARTS for part in asked):
        raise ValueError(f"uncertainty is {uncertainty!r:.200}; expected 'auto', 'all', or some of {list(PARTS)}")
    return [part for part in PARTS if part in asked]


def drawn_models(fem: DataInformedFEM, number: int, seed: int) -> list[FEModel]:
    """Models calibrated to the mean of the training records, from which a perfect model deviates by .5 %; stiffnesses
    are known to 15 % before."""
    mean = np.nanmean(as_floats(fem.records_.frequencies), axis=0)
    with collected(drop_others=True):
        updater = ModelUpdater(fem.model, bounds=0.6, prior=0.15).fit(mean, frequency_std=0.005 * mean)
        return list(updater.sample_models(number, spread=0.15, random_state=seed))


def resampled_days(T: Table, random: np.random.RandomState, *, most: int = 15) -> Table:
    """The temperatures of other days of the season for each row, at the same time of day: whole weeks are taken up to
    ``most`` days earlier or later. Rows keep their stamps; those without stamps count as a year."""
    days = row_times(T) / DAY_NS if has_stamps(T) else np.arange(len(T)) * (364 / len(T))
    week = (days // 7).astype(int)
    shift = random.randint(-most, most + 1, week[-1] + 1)[week]
    outside = (days + shift < 0) | (days + shift > days[-1])
    wanted = np.where(outside, days - shift, days + shift)
    rows = np.arange(len(days))
    near = np.rint(np.interp(wanted, days, rows)).astype(int)
    is_there = np.abs(days[near] - wanted) <= np.median(np.diff(days)) / 2 + 1e-9
    return frame_like(T, as_floats(T)[np.where(is_there, near, rows)])


def other_years(T: Sequence[Table]) -> list[Table]:
    """Every year of weather on the rows of the first, by the time of the year where it has stamps."""
    first, years = T[0], [T[0]]
    for number, other in enumerate(T[1:], start=1):
        year = other
        if has_stamps(first) and has_stamps(other):
            whole_years = 365 * DAY * round((first.index[0] - other.index[0]) / (365 * DAY))
            moved = other.set_axis(other.index + whole_years).sort_index()
            near = moved.index.get_indexer(first.index, method="nearest", tolerance=DAY)
            if (near < 0).any():
                raise ValueError(
                    f"year {number} of T has no record within a day of the season of {(near < 0).sum()} of "
                    f"{len(first)} rows of the first; expected records of the same season"
                )
            year = moved.iloc[near]
        years.append(frame_like(first, as_floats(year), getattr(year, "columns", None)))
    return years


@dataclass(frozen=True, eq=False)
class ReplicateRates:
    """Rates of alarms in replicates, (n_replicates, n_parts), by detector and scenario, as ``parts`` are added one
    after the other; ``own`` has the rows of the study, and ``with_noise`` says whether the noise varies, too."""

    rates: Mapping[tuple[str, str], Array]
    own: pd.DataFrame
    parts: Sequence[str]
    with_noise: bool

    @classmethod
    def joined(cls, found: Sequence[Mapping[Any, Any]], results: pd.DataFrame, parts: Sequence[str]) -> ReplicateRates:
        """The rates of all replicates beside the results of the study."""
        own = results[(results["source"] == "simulated") & (results["error"] == "")]
        own = own.set_index(["detector", "scenario"])
        rates = {key: np.array([one[key] for one in found]) for key in own.index}
        return cls(rates, own, [part for part in parts if part != "noise"], "noise" in parts)

    def campaigns(self, key: tuple[str, str]) -> Array:
        """Rates of single campaigns with all that varies, (n_campaigns,), about the study's own rate.

        Chains of other training records differ from what detectors have learned to either side, so that alarms rise in
        the mean: on the scale of the logit, this mean rise is taken out.
        """
        logits, own, rates_at = self._logits(key)
        return rates_at(logits - logits.mean() + own)

    def prediction_interval(self, key: tuple[str, str], confidence: float) -> tuple[float, float]:
        """Rates between which that of a measured campaign should lie with this probability: of few replicates,
        Student's law on the scale of the logit."""
        logits, own, rates_at = self._logits(key)
        margin = t.ppf((1 + confidence) / 2, len(logits) - 1) * logits.std(ddof=1) * np.sqrt(1 + 1 / len(logits))
        lowest, highest = rates_at(own + np.array([-margin, margin])).tolist()
        return lowest, highest

    def _logits(self, key: tuple[str, str]) -> tuple[Array, float, Callable[[Array], Array]]:
        """Logits of the rates of the replicates and of the study, finite also where all records or none are in alarm,
        and what gives rates at logits."""
        n = self.own.at[key, "n_records"] / self.own.at[key, "n_repeats"]
        logits = logit((np.append(self.rates[key][:, -1], self.own.at[key, "rate"]) * n + 0.5) / (n + 1))
        return logits[:-1], logits[-1], lambda some: np.clip(((n + 1) * expit(some) - 0.5) / n, 0, 1)

    def banded(self, results: pd.DataFrame, confidence: float) -> pd.DataFrame:
        """The table of a study, whose simulated rows have the bands of the replicates."""
        bands, results = [self.prediction_interval(key, confidence) for key in self.own.index], results.copy()
        results.loc[(results["source"] == "simulated") & (results["error"] == ""), ["pi_low", "pi_high"]] = bands
        return results

    def smallest(self, family: FamilyRates, level: float, method: str, confidence: float) -> tuple[float, float]:
        """Band of the smallest severity of a family that is detected reliably."""
        severities, rates = family.tested["severity"].to_numpy(dtype=float), self._campaigns(family)
        if not len(rates):
            return float("nan"), float("nan")
        found = [minimum_detectable_damage(severities, row, level) for row in rates]
        if method == "curve":
            curves = [one.severity_at(level) for one in self.curves(family)]
            found = curves + [np.nan] * (len(rates) - len(curves))
        found, sign = np.nan_to_num(np.abs(found), nan=np.inf, posinf=np.inf), np.sign(severities[0])
        tails = (((1 - confidence) / 2, "lower"), ((1 + confidence) / 2, "higher"))
        lowest, highest = (sign * np.quantile(found, tail, method=end) for tail, end in tails)
        return float(lowest), float(highest)

    def curves(self, family: FamilyRates, log: Any = "auto") -> list[PODCurve]:
        """Fitted curves of the campaigns that have one."""
        tested, curves = family.tested, []
        n = tested["n_effective"] / tested["n_repeats"]
        for row in self._campaigns(family):
            try:
                curves.append(fitted_curve(tested["severity"], row * n, n, log=log)[0])
            except ValueError:  # the rate does not increase
                continue
        return [curve for curve in curves if np.isfinite(curve.slope)]

    def _campaigns(self, family: FamilyRates) -> Array:
        """Rates of single campaigns, (n_campaigns, n_severities); none of measured records."""
        keys = list(zip(family.tested["detector"], family.tested["scenario"], strict=True))
        return np.array([self.campaigns(key) for key in keys]).T if family.source == "simulated" else np.empty(0)

    def table(self) -> pd.DataFrame:
        """Standard deviation of the rate due to each part, and its share of the variance, by detector and scenario.

        That of the noise in one campaign follows from the effective number of records; the first of the other parts
        has what is more than that, and each later part what it adds in the same replicates.
        """
        own, rates = self.own, np.array(list(self.rates.values()))
        noise = own["rate"] * (1 - own["rate"]) / (own["n_effective"] / own["n_repeats"]) * self.with_noise
        variances = noise.to_frame("noise") if self.with_noise else pd.DataFrame(index=own.index)
        variances[self.parts[0]] = np.maximum(rates[:, :, 0].var(axis=1, ddof=1) - noise, 0.0)
        variances[list(self.parts[1:])] = np.diff(rates, axis=2).var(axis=1, ddof=1)
        total = variances.sum(axis=1)
        shares = variances.div(total.where(total > 0), axis=0).add_suffix(" share")
        return np.sqrt(variances.assign(together=total)).join(shares)


def in_sentences(results: pd.DataFrame, replicates: ReplicateRates | None, detector: str, confidence: float) -> str:
    """What the intervals of a detector include, and the widest one with its parts."""
    if replicates is None:
        return "Intervals include noise only, not other weather, other training records or an error of the model."
    parts, number = replicates.table(), len(next(iter(replicates.rates.values())))
    names = [name for name in PARTS if name in parts]
    lines = [
        f"{confidence:.0%} prediction intervals include the uncertainty of {listed([PARTS[name] for name in names])}. "
        "They hold in weather like that of the training records: colder or warmer days can raise more false alarms."
    ]
    if number < ENOUGH:
        lines.append(f"They come from {number} replicates and are rough: take n_replicates={ENOUGH} or more.")
    rows = results[(results["detector"] == detector) & (results["source"] == "simulated")].set_index("scenario")
    width = (rows["pi_high"] - rows["pi_low"])[rows["measure"] == "POD"]
    if len(width):
        widest = rows.loc[width.idxmax()]
        shares = parts.loc[(detector, widest.name), [f"{name} share" for name in names]].set_axis(names)
        large = shares[shares >= 0.1].sort_values(ascending=False)
        causes = listed([f"{share:.0%} from {PARTS[name]}" for name, share in large.items()])
        lines.append(
            f"The widest is that of {widest.name!r}: {widest['pi_low']:.1%} to {widest['pi_high']:.1%} of the records "
            f"of a measured campaign in alarm." + (f" Its variance comes {causes}." if causes else "")
        )
    return "\n".join(lines)
