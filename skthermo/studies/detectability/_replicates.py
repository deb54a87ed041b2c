"""Replicates: other structures that could have given the training records, in other weather, and their alarms."""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed
from numpy.typing import NDArray
from scipy.special import expit, logit
from scipy.stats import t

from skthermo._core.arrays import Array, as_floats, positive_integer
from skthermo._core.frames import Table, column_names, frame_like, has_stamps, row_times
from skthermo._core.parallel import run_jobs, single_blas_thread
from skthermo._core.warnings import warn_user, without_warnings
from skthermo.exceptions import ModelWarning, ResultWarning
from skthermo.fem import FEModel
from skthermo.metrics import minimum_detectable_damage
from skthermo.studies._scenarios import BaseScenario, checked_models
from skthermo.studies.detectability._pod_curve import FamilyRates, PODCurve, pod_curve
from skthermo.studies.detectability._rates import EvaluatedRecords
from skthermo.studies.detectability._simulation import (
    LARGEST_SEED,
    SIMULATED,
    Evaluation,
    Key,
    Simulation,
    clean_frequencies,
)
from skthermo.surrogate import DataInformedFEM, refitted, resampled
from skthermo.updating import ModelUpdater

DEVIATION = 0.005  # relative, of measured mean frequencies from those of a perfect model
SPREAD = 0.15  # relative deviation of stiffnesses before anything is measured
HALF_WIDTH = 0.6  # of the box in which stiffnesses are looked for
PARTS = ("noise", "weather", "baseline", "model")
"""What a replicate draws, in the order in which one is added to the others."""

ALL, AUTO = "all", "auto"
N_DRAWS = 2  # draws of the noise in each replicate, to separate its share from that of what else varies
FEWEST_REPLICATES = 2

DAY = 24 * 3600e9  # ns
YEAR = 365  # days, so that seasons and whole days are kept
WEEKS = 52  # blocks of rows without stamps, which count as a year
BLOCK = 7  # days that stay together
SEASON = 15  # days by which a block may be earlier or later in the year

MOST_FAILURES = 0.5  # share of replicates that may fail
SMALL = 0.1  # share of a variance that is not worth a word
NAMES = {"noise": "noise", "weather": "the weather", "baseline": "the training records", "model": "the model"}


@dataclass(frozen=True, eq=False)
class Replicates:
    """What may vary beside the noise, ``parts``; years of weather, of which the first is that of the study; models.

    Every replicate is drawn from its own seed alone. Without "noise" among what varies, all replicates have the same.
    """

    fem: DataInformedFEM
    parts: Sequence[str]
    with_noise: bool
    years: Sequence[Table]
    models: Sequence[FEModel]
    seeds: Sequence[int]

    @classmethod
    def of(
        cls, fem: DataInformedFEM, uncertainty: str | Sequence[str], T: Table, models: Any, number: Any, seed: Any
    ) -> Replicates:
        """So many replicates in which the named parts vary; without models, these are drawn from the training
        records."""
        asked = checked_parts(uncertainty, with_models=models is not None)
        years = other_years(T) if isinstance(T, list | tuple) and len(T) and np.ndim(T[0]) == 2 else [T]
        if positive_integer(number, "n_replicates") < FEWEST_REPLICATES:
            raise ValueError(
                f"n_replicates is {number}; expected at least {FEWEST_REPLICATES}, 10 or more for bands of 90 %"
            )
        random = np.random.RandomState(seed)
        seeds = random.randint(LARGEST_SEED, size=number + 1)
        if models is not None:
            models = checked_models(fem, models)
            if "model" not in asked:
                raise ValueError(
                    f"models came, but uncertainty is {uncertainty!r}; expected 'model' among it, 'auto' or 'all'"
                )
        elif "model" in asked:
            models = _models_of(
                fem, number, int(seeds[-1]), is_needed=not (isinstance(uncertainty, str) and uncertainty == ALL)
            )
        varied = [part for part in PARTS[1:] if part in asked and (part != "model" or models)]
        return cls(fem, varied, "noise" in asked, years, models or [], [int(one) for one in seeds[:-1]])

    def replicate(self, number: int) -> Iterator[tuple[str, DataInformedFEM, Table]]:
        """One part after the other, with a chain and temperatures in which it and those before vary.

        Other training records are those that the chain's structure could have given as well in the same weather.
        """
        weather, records = np.random.RandomState(self.seeds[number]).randint(LARGEST_SEED, size=2)
        chain, T, n_years = self.fem, self.years[0], len(self.years)
        for part in self.parts:
            if part == "weather":
                T = self.years[number % n_years] if n_years > 1 else resampled_days(T, np.random.RandomState(weather))
            elif part == "baseline":
                chain = resampled(self.fem, int(records))
            else:
                chain = refitted(self.fem, model=self.models[number % len(self.models)])
                chain = resampled(chain, int(records)) if "baseline" in self.parts else chain
            yield part, chain, T

    def predicted_time(self, seconds: float, n_repeats: int, share: float) -> str:
        """How long up to so many repeats and all replicates take, if one repeat takes so many seconds, and a draw of a
        replicate a share of them."""
        text = f"up to {n_repeats} more repeats take about {n_repeats * seconds:.1f} s of one core"
        if self.parts:
            n_evaluated = N_DRAWS * len(self.parts) * len(self.seeds)
            text += f", {len(self.seeds)} replicates about {n_evaluated * share * seconds:.1f} s"
        return text + (", and the refits of their chains" if "model" in self.parts else "")

    def noise_levels(self, number: int) -> Array:
        """Factors of the noise of each mode, (n_modes,), which the training records determine up to an error."""
        errors = self.fem.recorder_.residuals.level_errors
        return np.exp(errors * np.random.RandomState([self.seeds[number], 1]).standard_normal(len(errors)))


def _models_of(fem: DataInformedFEM, number: int, seed: int, is_needed: bool) -> list[FEModel]:
    """Models drawn from the training records; none, with a warning, where they cannot be drawn and need not."""
    try:
        return drawn_models(fem, number, seed)
    except ValueError as error:
        if is_needed:
            raise
        warn_user(f"bands do not include the error of the model: {error}", ResultWarning, "bands-without-models")
        return []


def checked_parts(uncertainty: str | Sequence[str], with_models: bool = False) -> list[str]:
    """What varies, or an error; "auto" is all but models, and models too where they are given."""
    if isinstance(uncertainty, str) and uncertainty in (ALL, AUTO):
        return list(PARTS if with_models or uncertainty == ALL else PARTS[:-1])
    is_one = isinstance(uncertainty, str | Mapping) or not isinstance(uncertainty, Iterable)
    asked = [uncertainty] if is_one else list(uncertainty)
    if not asked or not all(isinstance(part, str) and part in PARTS for part in asked):
        raise ValueError(f"uncertainty is {uncertainty!r:.200}; expected 'auto', 'all', or some of {list(PARTS)}")
    return asked


def drawn_models(fem: DataInformedFEM, number: int, seed: int) -> list[FEModel]:
    """Models calibrated to the mean of the training records, as far as these determine stiffnesses."""
    mean = np.nanmean(as_floats(fem.records_.frequencies), axis=0)
    with without_warnings():
        try:
            updater = ModelUpdater(fem.model, bounds=HALF_WIDTH, prior=SPREAD).fit(mean, frequency_std=DEVIATION * mean)
            return list(updater.sample_models(number, spread=SPREAD, random_state=seed))
        except (AttributeError, TypeError, ValueError) as error:
            raise ValueError(
                f"other models like {fem.model!r:.200} cannot be drawn from the training records ({error}); expected "
                "models=[...], or uncertainty without 'model', such as ('noise', 'baseline', 'weather')"
            ) from error


def resampled_days(T: Table, random: np.random.RandomState) -> Table:
    """The temperatures of other days of the same season for each row, whole weeks together, at the same time of day.

    Rows keep their stamps, so that onsets of damage and waits keep their meaning. Rows without stamps count as a year.
    """
    if len(T) < 2:
        return T
    times = row_times(T) / DAY if has_stamps(T) else np.arange(len(T)) * (WEEKS * BLOCK / max(len(T), 1))
    if has_stamps(T):
        times = times + (T.index[0].as_unit("ns").value % DAY) / DAY
    order = np.argsort(times, kind="stable")
    taken = np.empty(len(T), dtype=np.intp)
    taken[order] = order[_shifted(times[order], random)]
    return frame_like(T, as_floats(T)[taken])


def _shifted(times: Array, random: np.random.RandomState) -> NDArray[np.intp]:
    """For each of some times in days, in order, the position of the record so many whole days from it."""
    blocks = (np.floor(times).astype(int) + random.randint(BLOCK)) // BLOCK
    years = int((times[-1] - times[0]) // YEAR) + 1
    shifts = np.add.outer(YEAR * np.arange(-years, years + 1), np.arange(-SEASON, SEASON + 1)).ravel()
    wanted = times.copy()
    for block in np.unique(blocks):
        rows = np.flatnonzero(blocks == block)
        inside = shifts[(times[rows[0]] + shifts >= times[0]) & (times[rows[-1]] + shifts <= times[-1])]
        wanted[rows] += random.choice(inside)
    near, distances = _nearest(times, wanted)
    is_there = distances <= np.median(np.diff(times)) / 2 + 1e-9
    return np.where(is_there, near, np.arange(len(times)))


def _nearest(times: Array, wanted: Array) -> tuple[NDArray[np.intp], Array]:
    """Positions of the times, in order, that are nearest to wanted ones, and how far each is."""
    after = np.clip(np.searchsorted(times, wanted), 1, len(times) - 1)
    near = np.where(wanted - times[after - 1] <= times[after] - wanted, after - 1, after)
    return near, np.abs(times[near] - wanted)


def other_years(T: Sequence[Table]) -> list[FEModel]:
    """Every year of weather on the stamps of the first: row by row, or matched by the time of the year."""
    first = T[0]
    return [first, *(_on_stamps_of(first, one, number) for number, one in enumerate(T[1:], start=1))]


def _on_stamps_of(first: Table, other: Table, number: int) -> Table:
    """Another year of weather on the stamps of the first."""
    if np.ndim(other) != 2 or not len(other) or np.isnan(as_floats(other)).all():
        raise ValueError(f"year {number} of T is {other!r:.200}; expected a table of temperatures, as the first")
    names = [column_names(table, "T") for table in (first, other)]
    if names[0] != names[1]:
        raise ValueError(f"year {number} of T has the sensors {names[1]}; expected those of the first, {names[0]}")
    if len(first) == len(other):
        return frame_like(first, as_floats(other))
    if not (has_stamps(first) and has_stamps(other)):
        raise ValueError(
            f"year {number} of T has {len(other)} rows, the first {len(first)}; expected the same number, or stamps"
        )
    mine, theirs = (table.index.as_unit("ns").asi8 / DAY for table in (first, other))
    order = np.argsort(theirs, kind="stable")
    wanted = mine + YEAR * np.round((theirs.mean() - mine.mean()) / YEAR)
    near, distances = _nearest(theirs[order], wanted)
    far = distances > 1.0
    if far.any():
        raise ValueError(
            f"year {number} of T has no record within a day of the season of {far.sum()} of {len(first)} rows of the "
            "first; expected records of the same season"
        )
    return frame_like(first, as_floats(other)[order[near]])


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

    def prediction_interval(self, key: Key, confidence: float) -> tuple[float, float]:
        """Rates between which that of a measured campaign should lie with this probability.

        Student's law on the scale of the logit: of few replicates, quantiles are hardly known.
        """
        logits, number = self.logits(key), len(self.rates[key])
        between, within = variances_of(logits)
        variance = between + self.with_noise * within
        margin = t.ppf((1 + confidence) / 2, number - 1) * np.sqrt(variance * (1 + 1 / number))
        lowest, highest = self._rates(logits.mean(axis=1).mean() + np.array([-margin, margin]), key)
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
                results.loc[row, ["pi_low", "pi_high"]] = self.prediction_interval(key, confidence)
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

    def curves(self, family: FamilyRates, log: bool = True) -> list[PODCurve]:
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
            steps = self.rates[key]
            changes = np.concatenate([steps[:, :1], np.diff(steps, axis=1)], axis=1)
            deviations = {"noise": np.sqrt(variances_of(steps[:, -1])[1])} if self.with_noise else {}
            for number, part in enumerate(self.parts):
                deviations[part] = np.sqrt(variances_of(changes[:, number])[0])
            total = sum(deviation**2 for deviation in deviations.values())
            shares = {f"{part} share": one**2 / total if total > 0 else np.nan for part, one in deviations.items()}
            rows[key] = {**deviations, "together": np.sqrt(total), **shares}
        return pd.DataFrame.from_dict(rows, orient="index").rename_axis(["detector", "scenario"])


def variances_of(values: Array) -> tuple[float, float]:
    """Variances of values, (n_replicates, n_draws), between replicates and within them: an analysis of variance."""
    within = float(values.var(axis=1, ddof=1).mean())
    between = float(values.mean(axis=1).var(ddof=1)) - within / values.shape[1]
    return max(between, 0.0), within


def _rates_of_replicate(simulation: Simulation, replicates: Replicates, number: int) -> Any:
    """Rates, (n_parts, n_draws), and numbers of evaluated records by detector and scenario; or the text of an error."""
    random = np.random.RandomState([replicates.seeds[number] if replicates.with_noise else 0, N_DRAWS])
    seeds = random.randint(LARGEST_SEED, size=(N_DRAWS, 2))
    here, steps, drawn = simulation, [], []
    with without_warnings(), single_blas_thread():
        try:
            for part, chain, T in replicates.replicate(number):
                if not drawn or here.T is not T:
                    here = replace(simulation, T=T)
                    drawn = [here.drawn(int(seed)) for seed, _ in seeds]
                if part == "baseline":
                    faults = np.random.RandomState([replicates.seeds[number], 2])  # gaps and outliers of other records
                    measurement = here.measurement.resampled(here.fem, faults)
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
    simulation: Simulation, chain: DataInformedFEM, seeds: Array, drawn: Sequence[tuple[Array, Table]], first: int
) -> dict[Key, tuple[Array, float]]:
    """Rates of alarms, (n_draws,), and the mean number of evaluated records, by detector and scenario."""
    clean = clean_frequencies(chain, simulation.scenarios, simulation.T, len(seeds), first)
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
