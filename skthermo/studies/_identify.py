"""Which damage explains a shift of frequencies."""

from __future__ import annotations

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed
from numpy.typing import ArrayLike

from skthermo._core.arrays import Array, RandomState, as_random_state, check_jobs, check_probability
from skthermo._core.parallel import run_jobs
from skthermo._core.text import Sentences, chance_text, counted, listed, probability_text, share_text, significant
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import ResultWarning, SkthermoWarning
from skthermo.fem import Structure
from skthermo.fem.damage import LossKind, check_kind
from skthermo.residuals.mean_errors import chance_of
from skthermo.studies._causes import NO_DAMAGE, SOMETHING_ELSE, Cause, DamagePrior, divided_causes, read_causes
from skthermo.studies._evidence import DRAWS_EACH, DamageExplanation, Evidence, averaged, effects_of
from skthermo.studies._measured import FrequencyShift, measured_shift, observed
from skthermo.studies._scenarios import UncertainDamage, check_chain, checked_models
from skthermo.surrogate import refitted


def identify_damage(
    fem: Any,
    T: ArrayLike,
    F: ArrayLike,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    *,
    structure: Structure | None = None,
    kind: LossKind = "stiffness",
    noise: ArrayLike | str = "fitted",
    prior: DamagePrior | None = None,
    stiffening: bool | Iterable[str] | None = None,
    parameters: Iterable[str] = (),
    added_mass: Mapping[str, Any] | None = None,
    added_stiffness: Mapping[str, Any] | None = None,
    shapes: tuple[ArrayLike, ArrayLike] | None = None,
    dofs: ArrayLike | None = None,
    shape_noise: ArrayLike | str = 0.01,
    models: Sequence[Any] | None = None,
    n_jobs: int | None = None,
    random_state: RandomState = None,
) -> IdentifiedDamage:
    """Which causes explain how measured frequencies have shifted, how probably, and by how much.

    Parameters
    ----------
    fem : DataInformedFEM
        Fitted to healthy records; its model can be damaged.
    T : array-like or DataFrame of shape (n_samples, n_sensors)
        Temperatures of the records to explain, in degrees Celsius.
    F : array-like or DataFrame of shape (n_samples, n_modes)
        Their frequencies in Hz; NaN is allowed. Records should be of one state, so that their mean says what changed.
    groups : sequence of str, or mapping of str to sequence of str, optional
        Damage groups of the model; a mapping joins several under a new name, with one severity. By default all groups
        of the model, without those that other groups make up.
    structure : Structure, optional
        Nodes and members of the model, which was assembled from it and may have been calibrated since; an
        `~skthermo.fem.ImportedStructure` for members that another program has assembled. With it, stretches of
        neighbouring members of a group are sought beside whole groups.
    kind : {"stiffness", "section"}, default="stiffness"
        What groups lose, or gain with ``stiffening``: stiffness alone or, with cross-section, mass too. An unknown kind
        can be found by comparing the misfits of both.
    noise : "fitted", float or array-like of shape (n_modes,), default="fitted"
        Where the error of the mean shift comes from: the residuals of the training records, with their correlations
        from mode to mode and from record to record; or independent records with a relative standard deviation.
    prior : DamagePrior, optional
        What is thought of damage before; by default `DamagePrior()`.
    stiffening : bool, sequence of str, or mapping of str to float, optional
        Groups that may also have become stiffer, by up to 100 %, such as after a repair; True for all. A mapping has
        the relative gain of each that would be likely, such as 4.0 for a bearing that locks; up to three times as much
        is possible. Each is a cause of its own, named "GROUP stiffer", with a severity below 0.
    parameters : sequence of str, or mapping of str to float, optional
        Parameters of the model whose change may explain the shifts, such as the mass of the ballast. Each gives two
        causes, "NAME lower" and "NAME higher", with relative changes from -95 % to 100 %. A mapping has parameters that
        may only rise, with the relative rise that would be likely, as for ``stiffening``.
    added_mass : mapping of str to matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
        Patterns of mass that may have been added, in kg; a vector holds lumped masses. The amount of each is how many
        times it was added, from 0 to 3; give what would be likely if there were any. Negative masses were taken away.
    added_stiffness : mapping of str to matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
        Springs that may act now, in N/m, such as that of a bearing that has locked or of a new strut; a vector holds
        springs to the ground. Amounts are as those of ``added_mass``. More than what makes a bearing rigid changes
        nothing.
    shapes : (array-like, array-like), optional
        Measured mode shapes of the healthy and of the changed structure in similar weather, each of shape (n_dofs,
        n_modes) or, of several records, (n_records, n_dofs, n_modes). Scale, sign and phase do not matter, and complex
        shapes are turned to be real; NaN where a component was not measured.
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction), optional
        Degrees of freedom of the shapes' rows, by position, counted from 0, or by label, as in ``fem.model.dofs``;
        needed with ``shapes``.
    shape_noise : "fitted", float or array-like of shape (n_modes,), default=0.01
        Standard deviation of a component of one record's shape, relative to the shape's largest component. Where
        several records scatter more, their scatter counts; "fitted" takes the scatter alone.
    models : sequence of FE model, optional
        Models that may be the structure's, all as probable, as `~skthermo.updating.ModelUpdater.sample_models` gives
        them. The chain learns its training records anew with each of them; probabilities and amounts are averages over
        the models. By default the chain's own model counts as right.
    n_jobs : int, optional
        Parallel jobs (joblib) over the models. Results do not depend on it.
    random_state : int, RandomState or None, default=None
        Seed of the draws behind severities and their bands; probabilities of explanations do not depend on it.

    Returns
    -------
    IdentifiedDamage
        Explanations with their probabilities, probability and severity of each cause or member, explained shifts,
        causes that cannot be distinguished, and the draws that ``scenario()`` turns into a scenario of a
        `DetectabilityStudy`.

    Raises
    ------
    ValueError
        If fem is not a fitted chain, T and F differ in rows, a group or parameter is unknown, a mass pattern does not
        fit the model, causes have the same name or that of an explanation, ``prior`` is no `DamagePrior`, shapes or
        dofs do not fit the model, the model was not assembled from the structure, no record can be compared (each lacks
        all frequencies, a temperature, or similar weather in the training records), a mode is more than 3 times or less
        than a fifth of the predicted one, no cause can be seen, or the model cannot be changed so or gives NaN then.

    Warns
    -----
    UserWarning
        Once for each kind: if records cannot be compared or are far from the others, with their number and the reasons;
        if the records, or the training records, are worth few independent ones; if the answer leaves open which of two
        causes has changed, or does not show one; or if the causes do not explain the shifts.

    Notes
    -----
    Sets of at most three causes, each with one unknown amount, and an even loss in all groups are weighed by their
    evidence. :ref:`how-explanations-are-weighed` has the errors of the shifts, the prior and what is assumed.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign, truss_structure
    >>> from skthermo.studies import identify_damage
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> structure, model = truss_structure(), make_truss()
    >>> fem = DataInformedFEM(model, random_state=0).fit(year.temperatures, year.frequencies)
    >>> later = make_truss_campaign(damage={"diagonal": 0.1}, random_state=1)
    >>> found = identify_damage(fem, later.temperatures, later.frequencies, ["top", "diagonal"], random_state=0)
    >>> found.severities.round(2).to_dict()
    {'top': 0.0, 'diagonal': 0.1}

    Two members of the diagonals have lost 40 %:

    >>> divided = structure.divide(model, {"diagonal": {"two bays": ["10", "22"]}})
    >>> healthy, damaged = (m.frequencies([[1.0] * 4]) for m in (divided, divided.damaged({"two bays": 0.4})))
    >>> F = make_truss_campaign(random_state=1).frequencies * damaged / healthy
    >>> found = identify_damage(
    ...     fem, later.temperatures, F, ["top", "diagonal"], structure=structure, random_state=0
    ... )
    >>> sorted(found.likely_members())
    ['10', '22']
    """
    check_chain(fem)
    prior = DamagePrior() if prior is None else prior
    if not isinstance(prior, DamagePrior):
        raise ValueError(f"prior is {prior!r}; expected a DamagePrior")
    if (shapes is None) != (dofs is None):
        raise ValueError("one of shapes and dofs came without the other; expected both or neither")
    if not isinstance(structure, Structure | None):
        raise ValueError(f"structure is {structure!r:.200}; expected the Structure or ImportedStructure of the model")
    check_jobs(n_jobs)
    random = as_random_state(random_state)
    causes = read_causes(fem.model, groups, stiffening, parameters, added_mass, added_stiffness)
    check_kind(kind)
    measured = {"kind": kind, "shapes": shapes, "dofs": dofs, "shape_noise": shape_noise}

    def weighed(chain: Any) -> tuple[FrequencyShift, Evidence]:
        shift = measured_shift(chain, T, F, noise)
        seen = observed(chain, chain.model, shift, **measured)
        return shift, Evidence(seen, causes, effects_of(seen, causes), prior, shift.freedom)

    with collected() as findings:
        shift, evidence = weighed(fem)
        seen = evidence.observed
        if models is None:
            whole = evidence.explanations(random)
        else:
            whole = _over_models(weighed, fem, checked_models(fem, models), random, n_jobs)
        errors, similarity = _errors(evidence)
        draws, explained = _drawn(whole, causes, random), whole
        if structure is not None:
            located, members = _located(evidence, shift, structure, fem, measured)
            explained = located.explanations(random)
        n_observed, best = len(seen.change), explained[0]
        by_group = tabulated(explained, errors.index).join(errors)
        found = IdentifiedDamage(
            table=by_group if structure is None else tabulated(explained, members.index).join(members),
            groups=by_group,
            shifts=_shifts(shift, explained, fem.mode_names_),
            draws=draws,
            damage=_severities(whole[0], whole[0].draws.mean(axis=0)),
            p_value=chance_of(seen.change @ np.linalg.solve(seen.covariance, seen.change), n_observed, shift.freedom),
            misfit_p_value=chance_of(best.misfit, n_observed - len(best.causes), shift.freedom),
            similarity=similarity,
            records=shift.counts,
            explained=explained,
            kind=kind,
        )
        if structure is not None:
            found.table["is_likely"] = found.table.index.isin(found.likely_members())
    warn_each([*findings, *shift.findings, *seen.findings, *found.warnings()])
    return found


def _over_models(
    weighed: Callable[[Any], tuple[FrequencyShift, Evidence]],
    fem: Any,
    models: Sequence[Any],
    random: np.random.RandomState,
    n_jobs: int | None,
) -> list[DamageExplanation]:
    """Explanations by the chain with each of some models, averaged."""

    def with_model(model: Any, seed: int) -> list[DamageExplanation]:
        with collected():  # as those of the chain itself
            return weighed(refitted(fem, model=model))[1].explanations(np.random.RandomState(seed))

    seeds = random.randint(np.iinfo(np.int32).max, size=len(models))
    jobs = (delayed(with_model)(model, int(seed)) for model, seed in zip(models, seeds, strict=True))
    return averaged(run_jobs(jobs, len(models), unit="models", n_jobs=n_jobs))


def _errors(evidence: Evidence) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Standard errors of the amounts of the causes that were asked for, with their kinds, and cosines of effects."""
    asked = [cause for cause in evidence.causes if not cause.alone]  # they come first
    number, names = len(asked), pd.Index([cause.name for cause in asked])
    slopes = (evidence.slopes[0] / np.sqrt(evidence.variances[0]))[:number].T
    slopes = slopes * np.sign([cause.bound for cause in asked])
    lengths = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
    if lengths.max() < 10:
        errors = ", ".join(f"{name} {1 / length:.2g}" for name, length in zip(names, lengths, strict=True))
        raise ValueError(
            f"no group can be seen; expected a standard error of 0.1 or less for one of them, but they are {errors}. "
            "More records or other modes would lower them"
        )
    products = slopes.T @ slopes
    together = np.linalg.inv(products + np.diag(evidence.deviations[:number] ** -2.0))
    columns = {"error_alone": 1 / lengths, "error_together": np.sqrt(np.diag(together))}
    table = pd.DataFrame(columns, names).assign(kind=[cause.kind for cause in asked])
    return table, pd.DataFrame(products / np.outer(lengths, lengths), names, names)


def _located(
    evidence: Evidence, shift: FrequencyShift, structure: Structure, fem: Any, measured: Mapping[str, Any]
) -> tuple[Evidence, pd.DataFrame]:
    """Evidence of stretches of all groups that may be damaged, and the members of these groups."""
    causes, pieces, parts, members = divided_causes(evidence.causes, fem.model, structure)
    seen = observed(fem, structure.divide(fem.model, parts), shift, **measured)
    units = pieces + [cause for cause in causes if not cause.alone]
    by_unit = dict(zip([unit.name for unit in units], effects_of(seen, units, 7).swapaxes(0, 1), strict=True))
    effects = [sum(by_unit[name] for name in (cause.of if cause.alone else [cause.name])) for cause in causes]
    table = pd.DataFrame(list(members.values()), pd.Index(list(members), name="member", tupleize_cols=False))
    return Evidence(seen, causes, np.stack(effects, axis=1), evidence.prior, shift.freedom), table


def _shifts(shift: FrequencyShift, explained: Sequence[DamageExplanation], names: Sequence[Any]) -> pd.DataFrame:
    known, values = ~np.isnan(shift.mean), np.full(len(shift.mean), np.nan)
    shares = np.array([one.probability for one in explained])
    values[known] = (shares @ np.array([one.change for one in explained]) / shares.sum())[: known.sum()]
    columns = {
        "measured": np.expm1(shift.mean),
        "explained": np.expm1(values),
        "standard_error": np.sqrt(np.diag(shift.covariance)),
        "n_records": shift.n_records,
        "n_independent": shift.n_independent,
    }
    return pd.DataFrame(columns, list(names))


def _severities(one: DamageExplanation, amounts: Array) -> dict[str, float]:
    """Severities of the model's groups by the amounts of an explanation's causes."""
    factors: dict[str, float] = {}
    for cause, amount in zip(one.causes, amounts, strict=True):
        if cause.direction < 0:
            factors |= {name: factors.get(name, 1.0) * (1 - amount) for name in cause.of}
    return {name: float(1 - factor) for name, factor in factors.items()}


def _drawn(
    explained: Sequence[DamageExplanation], causes: Sequence[Cause], random: np.random.RandomState
) -> pd.DataFrame:
    """Severities of the model's groups, of explanations by their probability."""
    groups = dict.fromkeys(name for cause in causes if cause.direction < 0 for name in cause.of)
    probable = np.array([one.probability for one in explained])
    chosen = random.choice(len(probable), size=DRAWS_EACH, p=probable / probable.sum())
    some = [(explained[place], random.randint(DRAWS_EACH)) for place in chosen]
    rows = [_severities(one, one.draws[number % len(one.draws)]) for one, number in some]
    return pd.DataFrame(rows, columns=list(groups)).fillna(0.0)


def tabulated(explained: Sequence[DamageExplanation], rows: Sequence[Hashable]) -> pd.DataFrame:
    """Probability that each row, a cause or a member, has changed, and by how much on average."""
    found = []
    for row in rows:
        parts = []
        for one in explained:
            inside = [row in cause.rows or row == cause.group for cause in one.causes]
            if any(inside):
                parts.append((one.probability, 1 - np.prod(1 - one.draws[:, inside], axis=1)))
        probability = min(sum(share for share, _ in parts), 1.0)
        values = np.concatenate([*(draws for _, draws in parts), np.zeros(1)])
        weights = np.concatenate(
            [*(np.full(len(draws), share / len(draws)) for share, draws in parts), [1 - probability]]
        )
        present = averages(values[:-1], weights[:-1])
        extreme = present["ci_low" if present["severity"] < 0 else "ci_high"]
        if_changed = {"if_damaged": present["severity"], "highest_if_damaged": extreme}
        found.append({"probability": probability, **averages(values, weights), **if_changed})
    return pd.DataFrame(found, pd.Index(list(rows), name=getattr(rows, "name", None), tupleize_cols=False))


def averages(values: Array, weights: Array) -> dict[str, float]:
    """Mean, standard deviation and 90 % band of weighted values; NaN of none."""
    if not len(values):
        return dict.fromkeys(("severity", "standard_error", "ci_low", "ci_high"), np.nan)
    weights, order = weights / weights.sum(), np.argsort(values)
    mean, shares = float(weights @ values), np.cumsum(weights[order])
    low, high = (values[order][min(np.searchsorted(shares, end), len(values) - 1)] for end in (0.05 - 1e-12, 0.95))
    deviation = float(np.sqrt(weights @ (values - mean) ** 2))
    return {"severity": mean, "standard_error": deviation, "ci_low": float(low), "ci_high": float(high)}


def _fewest(explained: Sequence[DamageExplanation], groups: Collection[str], probability: float) -> list[Hashable]:
    """Rows of a table that hold all changed ones of some groups, those added first that hold most for their number."""
    sets = [
        (one.probability, rows)
        for one in explained
        if (rows := frozenset(row for cause in one.causes if cause.group in groups for row in cause.rows))
    ]
    total, held, chosen = sum(share for share, _ in sets), 0.0, {}
    while sets and held < probability * total * (1 - 1e-9):
        more = {rows.difference(chosen) for _, rows in sets}
        gain = {new: sum(s for s, rows in sets if rows <= chosen.keys() | new) / len(new) for new in more}
        chosen |= dict.fromkeys(sorted(max(gain, key=lambda new: gain[new]), key=str))
        held += sum(share for share, rows in sets if rows <= chosen.keys())
        sets = [(share, rows) for share, rows in sets if not rows <= chosen.keys()]
    return list(chosen)


@dataclass(frozen=True, eq=False)
class IdentifiedDamage(Sentences):
    """Explanations of a shift of frequencies with their probabilities, and what follows for each possible cause.

    An explanation is a set of up to three causes, or none; causes are damage of a group or, with a structure, of a
    stretch of its members, and what else was asked for.

    Parameters
    ----------
    table : DataFrame
        One row a cause or, with a structure, a member: ``probability`` that it has changed; ``severity``, its mean over
        all explanations, where those without it count as 0, with ``standard_error``; ``ci_low`` and ``ci_high``, which
        cover it with a probability of 90 %; ``if_damaged``, its mean where it has changed, and ``highest_if_damaged``,
        which it then does not exceed with a probability of 95 %. Of causes also ``error_alone``, the standard error if
        nothing else could have changed, ``error_together``, if all others may have changed as much as is likely
        beforehand, and ``kind``: "damage", "stiffening", "parameter", "mass" or "spring". Of members also ``group``,
        ``line`` of connected members of the group, ``element``, the number in it by coordinates, ``x``, ``y`` and
        ``z`` of its middle, and ``is_likely``, whether it is among `likely_members`.
    groups : DataFrame
        The same by cause, also with a structure.
    shifts : DataFrame
        One row a mode: mean relative shift ``measured`` and ``explained`` by the causes, the mean over explanations,
        ``standard_error`` of the measured one, ``n_records``, and ``n_independent``, as many independent records as
        would determine it as well.
    draws : DataFrame
        Severities of the model's groups, drawn from all explanations by their probability; one draw a row. Of whole
        groups, also with a structure.
    damage : dict of str to float
        Severities of the model's groups in the most probable explanation by whole groups, for ``simulate``.
    p_value : float
        Probability that a healthy structure shows as large a shift.
    misfit_p_value : float
        Of a larger misfit than that of the most probable explanation, if it is right; NaN if it has as many causes as
        there are modes. A low one says that something else changed too.
    similarity : DataFrame
        Cosines between the effects of the causes, in standard errors of the shifts.
    records : Series
        How many records were given and compared, and left out by reason; how many independent ones they and the
        training records are worth.
    explained : sequence of explanations
        All explanations with a probability above .001 %, with draws of their amounts.
    kind : {"stiffness", "section"}, default="stiffness"
        What the damaged groups have lost in all explanations.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.studies import identify_damage
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> later = make_truss_campaign(damage={"top": 0.2}, random_state=1)
    >>> T, F = later.temperatures[:90], later.frequencies[:90]
    >>> found = identify_damage(fem, T, F, ["bottom", "top"], random_state=0)
    >>> found.most_probable
    ('top',)
    >>> found.scenario().name
    'identified damage'
    """

    table: pd.DataFrame
    groups: pd.DataFrame
    shifts: pd.DataFrame
    draws: pd.DataFrame = field(repr=False)
    damage: dict[str, float]
    p_value: float
    misfit_p_value: float
    similarity: pd.DataFrame = field(repr=False)
    records: pd.Series = field(repr=False)
    explained: Sequence[DamageExplanation] = field(repr=False)
    kind: LossKind = "stiffness"

    @cached_property
    def explanations(self) -> pd.DataFrame:
        """One row an explanation, the most probable first, down to a probability of .1 %.

        Its name joins its causes by " + "; "no damage" is the one without, and "something else" stands for any other
        shift. ``probability``; ``misfit``, the sum of squared differences between measured and explained shifts, in
        standard errors, at its most probable severities; ``text``, such as "side span 12 %, main stays 4 %".
        """
        rows = {}
        for one in self._listed:
            amounts = zip(one.causes, one.draws.mean(axis=0), strict=True)
            texts = [f"{cause.name} {_size(cause, amount)}" for cause, amount in amounts]
            text = ", ".join(texts + [SOMETHING_ELSE] * one.has_else) or NO_DAMAGE
            rows[one.name] = {"probability": one.probability, "misfit": one.misfit, "text": text}
        return pd.DataFrame.from_dict(rows, orient="index")

    @cached_property
    def estimates(self) -> pd.DataFrame:
        """Amount of each cause in each explanation, by explanation and cause, if that explanation is right.

        Mean ``severity``, ``standard_error``, and ``ci_low`` and ``ci_high``, which cover it with a probability of
        90 %.
        """
        amounts = {
            (one.name, cause.name): averages(values, np.ones(len(values)))
            for one in self._listed
            for cause, values in zip(one.causes, one.draws.T, strict=True)
        }
        index = pd.MultiIndex.from_tuples(list(amounts), names=["explanation", "cause"])
        return pd.DataFrame(list(amounts.values()), index, list(averages(np.zeros(0), np.zeros(0))))

    @property
    def _listed(self) -> Sequence[DamageExplanation]:
        """Explanations with a probability of .1 % or more, or the most probable one."""
        return [one for one in self.explained if one.probability >= 1e-3] or self.explained[:1]

    @property
    def probability_of_damage(self) -> float:
        """Probability that anything changed."""
        return 1 - min(sum(one.probability for one in self.explained if one.is_healthy), 1.0)

    @property
    def probability_other(self) -> float:
        """Probability that something else than the named causes shifted the frequencies."""
        return min(sum(one.probability for one in self.explained if one.has_else), 1.0)

    @property
    def unobservable(self) -> list[str]:
        """Causes whose severity alone would have a standard error above 10 %.

        Their probability hardly differs from what the prior says.
        """
        return list(self.groups.index[self.groups["error_alone"] > 0.1])

    @property
    def indistinguishable(self) -> list[tuple[str, str]]:
        """Pairs of causes that these modes show, but do not distinguish."""
        shown = self.similarity.drop(index=self.unobservable, columns=self.unobservable)
        errors = self.groups["error_alone"]
        found = []
        for one, other in combinations(shown, 2):
            apart = np.sqrt(max(1 - max(shown.loc[one, other], 0.0) ** 2, 0.0))  # of the effect of each
            if apart * 0.1 < max(errors[one], errors[other]):
                found.append((one, other))
        return found

    @property
    def most_probable(self) -> tuple[str, ...]:
        """Causes of the most probable explanation, "something else" among them; empty for "no damage"."""
        best = self.explained[0]
        return (*(cause.name for cause in best.causes), *([SOMETHING_ELSE] * best.has_else))

    @property
    def probability(self) -> float:
        """Probability of the most probable explanation."""
        return self.explained[0].probability

    @property
    def severities(self) -> pd.Series:
        """Amount of each cause, or of each member, the mean over all explanations."""
        return self.table["severity"]

    def scenario(self, name: str = "identified damage") -> UncertainDamage:
        """This damage as a scenario of a `DetectabilityStudy`, each repeat with other severities within their error.

        Parameters
        ----------
        name : str, default="identified damage"
            Name of the scenario.

        Returns
        -------
        UncertainDamage
            A scenario whose severities are drawn from ``draws``.
        """
        return UncertainDamage(name, self.draws, kind=self.kind)

    def likely_members(self, probability: float = 0.9, group: str | None = None) -> list[Hashable]:
        """The fewest rows of the table that hold all damaged ones with a probability, given that there are any.

        Parameters
        ----------
        probability : float, default=0.9
            Between 0 and 1.
        group : str, optional
            Only damage in this group. By default in any that these modes show.

        Returns
        -------
        list of members
            The most probable first; none if there is no damage.

        Raises
        ------
        ValueError
            If the group is unknown, or the probability is not between 0 and 1.
        """
        if group is not None and group not in self.groups.index:
            raise ValueError(f"unknown group {group!r}; expected one of {sorted(self.groups.index)}")
        wanted = {group} if group is not None else set(self.groups.index).difference(self.unobservable)
        return _fewest(self.explained, wanted, check_probability(probability, "probability"))

    def _answer(self) -> Iterator[str]:
        best, records = self.explained[0], self.records
        if best.is_healthy:
            shown = " observable in these modes" if self.unobservable else ""
            yield f"Most probable: {NO_DAMAGE}{shown}, probability {chance_text(best.probability)}."
        else:
            texts = [self._phrase(cause) for cause in best.causes] + [SOMETHING_ELSE] * best.has_else
            yield f"Most probable: {listed(texts)}, probability {chance_text(best.probability)}."
        others = [one for one in self._listed[1:5] if one.probability >= 0.02]
        if others:
            texts = [f"{self.explanations['text'][one.name]} ({chance_text(one.probability)})" for one in others]
            yield f"Less probable: {'; '.join(texts)}."
        if best.is_healthy:
            bounds = self.groups["highest_if_damaged"].drop(self.unobservable)
            losses = [f"{share_text(bound)} in {name}" for name, bound in bounds[bounds > 0].items()]
            yield f"{share_text(0.95)} upper bounds on undetected losses of {self.kind}: {listed(losses)}."
        else:
            yield f"Probability of no change: {chance_text(1 - self.probability_of_damage)}."
        yield (
            f"{counted(int(records['compared']), 'record')} (worth {significant(records['independent'])} independent "
            f"ones) compared with {counted(int(records['trained']), 'training record')} (worth "
            f"{significant(records['independent of trained'])})."
        )

    def _phrase(self, cause: Cause) -> str:
        """A cause of the most probable explanation, with its place and the band of its amount."""
        row = self.estimates.loc[(self.explained[0].name, cause.name)]
        amount, change = _size(cause, row["severity"]), {"damage": "loss", "stiffening": "gain"}.get(cause.kind)
        text = f"{cause.name} {amount}"
        if change:
            text = f"a {change} of {amount} of {self.kind} in {cause.name.removesuffix(' stiffer')}"
        text += f", {cause.place}" if cause.place else ""
        low, high = sorted((row["ci_low"], row["ci_high"]), key=abs)
        bounds = f"up to {_size(cause, high)}" if abs(low) < 5e-4 else f"{_size(cause, low)} to {_size(cause, high)}"
        return f"{text} ({share_text(0.9)} interval {bounds})"

    @property
    def _open(self) -> list[str]:
        """What the modes leave open of the answer."""
        likely = set(self.groups.index[self.groups["probability"] >= 0.1])
        pairs = [" and ".join(pair) for pair in self.indistinguishable if likely.intersection(pair)]
        left = [f"which of {pair} has changed" for pair in pairs] + [f"damage of {name}" for name in self.unobservable]
        return left if len(left) <= 3 else [*left[:3], f"{len(left) - 3} other such things"]

    def _limits(self) -> Iterator[str]:
        if self._open:
            yield f"These modes do not show {listed(self._open, 'nor')}."
        if self.p_value < 0.05 and self.explained[0].is_healthy:
            yield f"Such shifts are rare in a healthy structure (p value {probability_text(self.p_value)})."
        if self.misfit_p_value < 0.05:
            yield (
                "The most probable explanation does not explain all of the shifts (p value "
                f"{probability_text(self.misfit_p_value)})."
            )

    def warnings(self) -> Iterator[SkthermoWarning]:
        """What the answer leaves open.

        Yields
        ------
        SkthermoWarning
            With its ``kind``.
        """
        if self._open:
            yield ResultWarning(
                f"these modes do not show {listed(self._open, 'nor')}. Take records over a longer time, or measure "
                "mode shapes or other modes",
                "undetermined",
            )
        if self.explained[0].has_else or self.misfit_p_value < 0.05:
            yield ResultWarning(
                "the causes that were sought do not explain the shifts. There may be damage outside these groups, a "
                "stiffer part, a change of mass or of a support, a wrong sensor, modes that were exchanged, or a wrong "
                "model. See shifts and stiffening",
                "unexplained-shifts",
            )

    def __repr__(self) -> str:
        best = self.explanations.iloc[0]
        return f"IdentifiedDamage({best['text']}, probability {self.probability:.2g})"


def _size(cause: Cause, amount: float) -> str:
    """An amount without its sign, which the name of its cause says, in percent or times of a pattern."""
    if cause.kind in ("mass", "spring"):
        return f"{significant(abs(amount))} times"
    return share_text(abs(amount))
