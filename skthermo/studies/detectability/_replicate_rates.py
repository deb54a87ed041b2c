"""Rates of alarms in many replicates, and the bands that a measured campaign should lie in."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed
from scipy.special import expit, logit
from scipy.stats import t

from skthermo._estimators.answers import answers_kept
from skthermo._estimators.threads import single_blas_thread
from skthermo._estimators.warnings import checked_once, warn_user, without_warnings
from skthermo._io import run_jobs
from skthermo._tables.arrays import Array
from skthermo._tables.frames import Table
from skthermo.exceptions import ModelWarning
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies.detectability._pod_curve import FamilyRates, PODCurve, pod_curve
from skthermo.studies.detectability._simulation import (
    LARGEST_SEED,
    SIMULATED,
    YEARS,
    EvaluatedRecords,
    Evaluation,
    Key,
    Simulation,
    clean_frequencies,
)
from skthermo.studies.replicates import N_DRAWS, Replicates
from skthermo.studies.scenarios import BaseScenario
from skthermo.surrogate import FittedChain

MOST_FAILURES = 0.5  # share of replicates that may fail
SMALL = 0.1  # share of a variance that is not worth a word
NAMES = {"noise": "noise", "weather": "the weather", "baseline": "the training records", "model": "the model"}


@dataclass(frozen=True, eq=False)
class ReplicateRates:
    """Rates of alarms in replicates, (n_replicates, n_parts, n_draws), by detector and scenario, as parts are added
    one after the other, and ``own`` rates of the study's repeats; ``n_records`` are evaluated in each draw, and
    ``with_noise`` says whether intervals include the noise, too."""

    rates: Mapping[Key, Array]
    own: Mapping[Key, Array]
    n_records: Mapping[Key, float]
    parts: Sequence[str]
    with_noise: bool
    errors: Sequence[str]

    @classmethod
    def of(
        cls,
        simulation: Simulation,
        evaluation: Evaluation,
        replicates: Replicates,
        n_jobs: int | None,
        verbose: int = 0,
    ) -> ReplicateRates:
        """Evaluate the records of every replicate; those that fail are counted in a warning, unless most fail.

        Given are the simulation of the study and the evaluation of its repeats.
        """
        simulation = replace(simulation, clean={}, reference=None)
        jobs = (delayed(_rates_of_replicate)(simulation, replicates, number) for number in range(len(replicates.seeds)))
        with without_warnings():
            outcomes = run_jobs(jobs, len(replicates.seeds), unit="replicates", n_jobs=n_jobs, verbose=verbose)
        errors = [one for one in outcomes if isinstance(one, str)]
        found = [one for one in outcomes if not isinstance(one, str)]
        if len(errors) > MOST_FAILURES * len(outcomes):
            raise ValueError(
                f"{len(errors)} of {len(outcomes)} replicates failed, the first with {errors[0]}; expected chains that "
                "can be refitted, or uncertainty='noise'"
            )
        if errors:
            warn_user(
                f"{len(errors)} of {len(outcomes)} replicates failed, the first with {errors[0]}. Bands are of the "
                "others",
                ModelWarning,
                "failed-replicates",
            )
        own = _counted(evaluation, simulation.scenarios, simulation.T)
        keys = [key for key in found[0] if all(key in one for one in (own, *found))]
        rates = {key: np.array([one[key][0] for one in found]) for key in keys}
        n_records = {key: float(np.mean([one[key][1] for one in found])) for key in keys}
        return cls(
            rates, {key: own[key][0] for key in keys}, n_records, replicates.parts, replicates.with_noise, errors
        )

    def logits(self, key: Key) -> Array:
        """Logits of the rates of single campaigns with all that varies, (n_replicates, n_draws).

        Chains of other training records differ from what detectors have learned to either side, and each of them adds
        its own error out of fold to the noise, so that alarms rise in the mean. The rates of the study hold one such
        error already: this mean rise is taken out.
        """
        steps = self._logits(self.rates[key], key)
        means = steps.mean(axis=(0, 2))
        rises = np.diff(means, prepend=self._logits(self.own[key], key).mean())
        return steps[:, -1] - sum(rise for part, rise in zip(self.parts, rises, strict=True) if part == "baseline")

    def single(self, key: Key) -> Array:
        """Rates of single campaigns with all that varies, (n_replicates, n_draws), or without noise their mean."""
        rates = self._rates(self.logits(key), key)
        return rates if self.with_noise else rates.mean(axis=1, keepdims=True)

    def band(self, key: Key, confidence: float) -> tuple[float, float]:
        """Rates between which that of a measured campaign should lie with this probability.

        Student's law on the scale of the logit: of few replicates, quantiles are hardly known.
        """
        spread, number = Spread.of(self.logits(key)), len(self.rates[key])
        variance = spread.between + self.with_noise * spread.within
        margin = t.ppf((1 + confidence) / 2, number - 1) * np.sqrt(variance * (1 + 1 / number))
        lowest, highest = self._rates(spread.mean + np.array([-margin, margin]), key)
        return float(lowest), float(highest)

    def _logits(self, rates: Array, key: Key) -> Array:
        """Logits, finite also where all records or none are in alarm."""
        n = self.n_records[key]
        return np.asarray(logit((rates * n + 0.5) / (n + 1)))

    def _rates(self, logits: Array, key: Key) -> Array:
        n = self.n_records[key]
        return np.clip(((n + 1) * expit(logits) - 0.5) / n, 0, 1)

    def banded(self, results: pd.DataFrame, confidence: float) -> pd.DataFrame:
        """The table of a study, whose simulated rows have the bands of the replicates."""
        results = results.copy()
        for row in results.index[results["source"] == SIMULATED]:
            key = results.at[row, "detector"], results.at[row, "scenario"]
            if key in self.rates:
                results.loc[row, ["pi_low", "pi_high"]] = self.band(key, confidence)
        return results

    def smallest(self, family: FamilyRates, level: float, method: str, confidence: float) -> tuple[float, float]:
        """Band of the smallest severity of a family that is detected reliably."""
        severities, rates = family.tested["severity"].to_numpy(dtype=float), self._campaigns(family)
        if not len(rates):
            return float("nan"), float("nan")
        if method == "grid":
            found = np.array([abs(minimum_detectable_damage(severities, row, level)) for row in rates])
        else:
            curves = [abs(one.severity_at(level)) for one in self.curves(family)]
            found = np.append(curves, np.full(len(rates) - len(curves), np.nan))
        found = np.where(np.isnan(found), np.inf, found)
        sign, tail = np.sign(severities[0]), (1 - confidence) / 2
        lowest, highest = (np.quantile(found, q, method=m) for q, m in ((tail, "lower"), (1 - tail, "higher")))
        return float(sign * lowest), float(sign * highest)

    def curves(self, family: FamilyRates, log: bool = False) -> list[PODCurve]:
        """Fitted curves of all campaigns of all replicates that have one."""
        tested, curves = family.tested, []
        n = tested["n_effective"] / tested["n_repeats"]
        for row in self._campaigns(family):
            with suppress(ValueError), without_warnings():
                curves.append(pod_curve(tested["severity"], row * n, n, log=log))
        return [curve for curve in curves if np.isfinite(curve.slope)]

    def _campaigns(self, family: FamilyRates) -> Array:
        """Rates of single campaigns, (n_campaigns, n_severities); none of measured records."""
        keys = list(zip(family.tested["detector"], family.tested["scenario"], strict=True))
        if family.source != SIMULATED or not all(key in self.rates for key in keys):
            return np.empty((0, len(keys)))
        return np.array([self.single(key).ravel() for key in keys]).T

    def table(self) -> pd.DataFrame:
        """Standard deviation of the rate due to each part, and its share of the variance, by detector and scenario."""
        rows = {}
        for key in self.rates:
            deviations = self.by_part(key)
            total = sum(deviation**2 for deviation in deviations.values())
            shares = {f"{part} share": one**2 / total if total > 0 else np.nan for part, one in deviations.items()}
            rows[key] = {**deviations, "together": np.sqrt(total), **shares}
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis(["detector", "scenario"])

    def by_part(self, key: Key) -> dict[str, float]:
        """Standard deviation of the rate due to each part."""
        steps = self.rates[key]
        changes = np.concatenate([steps[:, :1], np.diff(steps, axis=1)], axis=1)
        deviations = {"noise": np.sqrt(Spread.of(steps[:, -1]).within)} if self.with_noise else {}
        for number, part in enumerate(self.parts):
            deviations[part] = np.sqrt(Spread.of(changes[:, number]).between)
        return deviations


@dataclass(frozen=True)
class Spread:
    """Mean of values, (n_replicates, n_draws), and their variances between replicates and within them."""

    mean: float
    between: float
    within: float

    @classmethod
    def of(cls, values: Array) -> Spread:
        """Analysis of variance of values, (n_replicates, n_draws)."""
        means, within = values.mean(axis=1), float(values.var(axis=1, ddof=1).mean())
        between = max(float(means.var(ddof=1)) - within / values.shape[1], 0.0)
        return cls(float(means.mean()), between, within)


def _rates_of_replicate(simulation: Simulation, replicates: Replicates, number: int) -> Any:
    """Rates, (n_parts, n_draws), and numbers of evaluated records by detector and scenario; or the text of an error."""
    random = np.random.RandomState([replicates.seeds[number] if replicates.with_noise else 0, N_DRAWS])
    seeds = random.randint(LARGEST_SEED, size=(N_DRAWS, 2))
    here, steps, drawn = simulation, [], []
    with without_warnings(), answers_kept(), checked_once(), single_blas_thread():
        try:
            for part, chain, T in replicates.replicate(number):
                if not drawn or here.T is not T:
                    here = replace(simulation, T=T)
                    drawn = [here.drawn(int(seed)) for seed, _ in seeds]
                if part == "baseline":
                    measurement = here.measurement.resampled(here.fem, replicates.fault_stream(number))
                    if measurement is not here.measurement:
                        here = replace(here, measurement=measurement)
                        drawn = [here.drawn(int(seed)) for seed, _ in seeds]
                    levels = replicates.noise_levels(number)
                    drawn = [(noise * levels, gappy) for noise, gappy in drawn]
                steps.append(_rates(here, chain, seeds, drawn, number * N_DRAWS))
        except Exception as error:
            return f"{type(error).__name__}: {error}"
    keys = [key for key in steps[0] if all(key in step for step in steps)]
    return {
        key: (np.array([step[key][0] for step in steps]), float(np.mean([step[key][1] for step in steps])))
        for key in keys
    }


def _rates(
    simulation: Simulation, chain: FittedChain, seeds: Array, drawn: Sequence[tuple[Array, Table]], first: int
) -> dict[Key, tuple[Array, float]]:
    """Rates of alarms, (n_draws,), and the mean number of evaluated records, by detector and scenario."""
    n_years = YEARS if chain.model is simulation.fem.model else 1
    clean = clean_frequencies(chain, simulation.scenarios, simulation.T, len(seeds), first, n_years)
    changed = replace(simulation, clean=clean)
    draws = enumerate(zip(seeds, drawn, strict=True))
    records = (changed.records(simulation.scenarios, number, *pair) for number, pair in draws)
    found = _counted(changed.evaluate(itertools.chain.from_iterable(records), {}), simulation.scenarios, simulation.T)
    return {key: rates for key, rates in found.items() if len(rates[0]) == len(seeds)}


def _counted(evaluation: Evaluation, scenarios: Sequence[BaseScenario], T: Table) -> dict[Key, tuple[Array, float]]:
    """Rates of alarms among simulated records, (n_repeats,), and how many are evaluated, by detector and scenario."""
    rows, by_name = pd.Series(np.nan, getattr(T, "index", pd.RangeIndex(len(T)))), {one.name: one for one in scenarios}
    found = {}
    for (name, scenario, source), decisions in evaluation.decisions.items():
        if source == SIMULATED:
            counted = EvaluatedRecords(name, by_name[scenario], source, rows, decisions).from_onset()[0]
            evaluated = (~np.isnan(counted)).sum(axis=1)
            found[name, scenario] = (counted < 0).sum(axis=1) / np.maximum(evaluated, 1), float(evaluated.mean())
    return found


def sentences(results: pd.DataFrame, parts: pd.DataFrame | None, detector: str, confidence: float) -> str:
    """What the intervals of a detector include, the widest one and its parts, and which rates are outside."""
    if parts is None:
        return "Intervals include noise only, not other weather, other training records or an error of the model."
    names = [column for column in parts.columns if column in NAMES]
    lines = [
        f"{confidence:.0%} prediction intervals include the uncertainty of {_listed([NAMES[name] for name in names])}. "
        "They hold in weather like that of the training records: colder or warmer days can raise more false alarms."
    ]
    rows = results[(results["detector"] == detector) & (results["source"] == SIMULATED)].set_index("scenario")
    width = (rows["pi_high"] - rows["pi_low"])[rows["measure"] == "POD"].dropna()
    if len(width) and (detector, width.idxmax()) in parts.index:
        widest = rows.loc[width.idxmax()]
        shares = parts.loc[(detector, widest.name), [f"{name} share" for name in names]].set_axis(names)
        large = shares[shares >= SMALL].sort_values(ascending=False)
        causes = _listed([f"{share:.0%} from {NAMES[name]}" for name, share in large.items()])
        interval = f"{widest['pi_low']:.1%} to {widest['pi_high']:.1%}"
        lines.append(
            f"The widest is that of {widest.name!r}: {interval} of the records of a measured campaign in alarm."
        )
        if causes:
            lines.append(f"Its variance comes {causes}.")
    outside = rows[(rows["rate"] < rows["pi_low"]) | (rows["rate"] > rows["pi_high"])]
    if len(outside):
        shares = [
            f"{name!r} ({row['rate']:.1%}, interval {row['pi_low']:.1%} to {row['pi_high']:.1%})"
            for name, row in outside.iterrows()
        ]
        cause = "The training records contradict the chain's FE model: calibrate it (ModelUpdater)"
        if "model" not in names:
            cause = "Chains of other training records give other rates: give more records"
        lines.append(f"Rates of this chain outside their intervals: {_listed(shares)}. {cause}.")
    return "\n".join(lines)


def _listed(texts: Sequence[str]) -> str:
    return f"{', '.join(texts[:-1])} and {texts[-1]}" if len(texts) > 1 else "".join(texts)
