"""Which damage explains a shift of frequencies."""

from __future__ import annotations

from collections.abc import Hashable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from joblib import delayed
from numpy.typing import ArrayLike
from scipy import stats

from skthermo._core.arrays import MatrixLike, as_random_state, check_jobs
from skthermo._core.parallel import run_jobs
from skthermo._core.warnings import collected, warn_each
from skthermo.fem import Structure
from skthermo.studies._scenarios import check_chain, checked_models
from skthermo.studies.identification._causes import Cause, DamagePrior, read_causes
from skthermo.studies.identification._effects import Curves, observed
from skthermo.studies.identification._evidence import Evidence, Explanation
from skthermo.studies.identification._identified import (
    IdentifiedDamage,
    drawn,
    severities_of,
    tabulated,
)
from skthermo.studies.identification._shift import FrequencyShift, measured_shift
from skthermo.studies.identification._stretches import lines_of, members_of, pieces_of, stretches
from skthermo.surrogate import refitted


def identify_damage(
    fem: Any,
    T: ArrayLike,
    F: ArrayLike,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    *,
    structure: Structure | None = None,
    noise: ArrayLike | Literal["fitted"] = "fitted",
    prior: DamagePrior | None = None,
    stiffening: bool | Sequence[str] | None = None,
    parameters: Sequence[str] | None = None,
    added_mass: Mapping[str, MatrixLike] | None = None,
    shapes: tuple[ArrayLike, ArrayLike] | None = None,
    dofs: ArrayLike | None = None,
    shape_noise: ArrayLike | Literal["fitted"] = 0.01,
    models: Sequence[Any] | None = None,
    n_jobs: int | None = None,
    random_state: int | np.random.RandomState | None = None,
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
    noise : "fitted", float or array-like of shape (n_modes,), default="fitted"
        Where the error of the mean shift comes from: the residuals of the training records, with their correlations
        from mode to mode and from record to record; or independent records with a relative standard deviation.
    prior : DamagePrior, optional
        What is thought of damage before; by default `DamagePrior()`.
    stiffening : bool or sequence of str, optional
        Groups that may also have become stiffer, by up to 100 %, such as after a repair or where a bearing is locked;
        True for all. Each is a cause of its own, named "GROUP stiffer", with a severity below 0.
    parameters : sequence of str, optional
        Parameters of the model whose change may explain the shifts, such as the mass of the ballast. Each gives two
        causes, "NAME lower" and "NAME higher", with relative changes from -95 % to 100 %.
    added_mass : mapping of str to matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
        Patterns of mass that may have been added, in kg; a vector holds lumped masses. The amount of each is how many
        times it was added, from 0 to 3; give what would be likely if there were any. Negative masses were taken away.
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
        than a fifth of the predicted one, no cause can be seen, or the model cannot be changed so.

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
    if shapes is None and dofs is not None:
        raise ValueError("dofs came without shapes; expected both or neither")
    if not isinstance(structure, Structure | None):
        raise ValueError(f"structure is {structure!r:.200}; expected the Structure or ImportedStructure of the model")
    check_jobs(n_jobs)
    random = as_random_state(random_state)
    causes = read_causes(fem.model, groups, stiffening, parameters, added_mass)
    measured = {"shapes": shapes, "dofs": dofs, "shape_noise": shape_noise}
    with collected() as findings:
        shift = measured_shift(fem, T, F, noise)
        seen = observed(fem, fem.model, shift, **measured)
    evidence = Evidence(seen, causes, Curves.tabulated(seen.response, causes), prior, shift.freedom)
    if models is None:
        explained = evidence.explanations(random)
    else:

        def with_model(model: Any, seed: int) -> list[Explanation]:
            with collected():  # as those of the chain itself
                chain = refitted(fem, model=model)
                seen = observed(chain, model, measured_shift(chain, T, F, noise), **measured)
            curves = Curves.tabulated(seen.response, causes)
            return Evidence(seen, causes, curves, prior, shift.freedom).explanations(np.random.RandomState(seed))

        models = checked_models(fem, models)
        seeds = random.randint(np.iinfo(np.int32).max, size=len(models))
        jobs = (delayed(with_model)(model, int(seed)) for model, seed in zip(models, seeds, strict=True))
        explained = averaged(run_jobs(jobs, len(models), unit="models", n_jobs=n_jobs))
    found = _identified(evidence, explained, shift, fem, random)
    if structure is not None:
        found = _located(found, evidence, shift, fem, structure, measured, random)
    warn_each([*findings, *shift.findings, *seen.findings, *found.warnings()])
    return found


def averaged(each: Sequence[Sequence[Explanation]]) -> list[Explanation]:
    """The explanations of models that are equally probable, each with the draws of all of them."""
    by_name: dict[str, list[Explanation]] = {}
    for one in (one for explained in each for one in explained):
        by_name.setdefault(one.name, []).append(one)
    found = []
    for some in by_name.values():
        weights = np.array([one.probability for one in some])
        counts = np.ceil(500 * weights / weights.sum()).astype(int)
        draws = np.concatenate([one.draws[:count] for one, count in zip(some, counts, strict=True)])
        shares = weights / weights.sum()
        change, misfit = (shares @ np.array([getattr(one, name) for one in some]) for name in ("change", "misfit"))
        probability = float(weights.sum()) / len(each)
        found.append(replace(some[0], probability=probability, draws=draws, change=change, misfit=float(misfit)))
    return sorted(found, key=lambda one: -one.probability)


def _identified(
    evidence: Evidence, explained: list[Explanation], shift: FrequencyShift, fem: Any, random: np.random.RandomState
) -> IdentifiedDamage:
    """Tables of explanations by whole groups, and what the causes' effects have in common."""
    asked = [cause for cause in evidence.causes if not cause.alone]  # they come first
    names = [cause.name for cause in asked]
    scaled = np.sign(evidence.curves.bounds) / np.sqrt(evidence.variances[0])[:, np.newaxis]
    slopes = (evidence.curves.slopes[:, 0].T * scaled)[:, : len(asked)]
    lengths = np.maximum(np.linalg.norm(slopes, axis=0), np.finfo(float).tiny)
    table = tabulated(explained, {name: [name] for name in names})
    information = slopes.T @ slopes + np.diag(evidence.deviations[: len(asked)] ** -2.0)
    table["error_alone"], table["error_together"] = 1 / lengths, np.sqrt(np.diag(np.linalg.inv(information)))
    table["kind"] = [cause.kind for cause in asked]
    if lengths.max() * 0.1 < 1:
        errors = ", ".join(f"{name} {1 / length:.2g}" for name, length in zip(names, lengths, strict=True))
        raise ValueError(
            f"no group can be seen; expected a standard error of 0.1 or less for one of them, but they are {errors}. "
            "More records or other modes would lower them"
        )
    seen, best = evidence.observed, explained[0]
    return IdentifiedDamage(
        table=table,
        groups=table,
        shifts=_shifts(shift, explained, fem.mode_names_),
        draws=drawn(explained, list(dict.fromkeys(n for c in asked if c.direction < 0 for n in c.of)), 500, random),
        damage=severities_of(best, best.draws.mean(axis=0)),
        p_value=_p_of_misfit(
            seen.change @ np.linalg.solve(seen.covariance, seen.change), len(seen.change), shift.freedom
        ),
        misfit_p_value=_p_of_misfit(best.misfit, len(seen.change) - len(best.causes), shift.freedom),
        similarity=pd.DataFrame(slopes.T @ slopes / np.outer(lengths, lengths), table.index, table.index),
        records=shift.counts,
        explained=explained,
    )


def _located(
    found: IdentifiedDamage,
    evidence: Evidence,
    shift: FrequencyShift,
    fem: Any,
    structure: Structure,
    measured: dict[str, Any],
    random: np.random.RandomState,
) -> IdentifiedDamage:
    """Explanations by stretches of groups that may be damaged; of all if whole ones do not explain the shifts."""
    is_open = found.probability_other > 0.1 or found.misfit_p_value < 0.05
    probable = found.table["probability"][found.table["kind"] == "damage"]
    causes: list[Cause] = []
    pieces: list[Cause] = []
    parts: dict[str, dict[str, set[Hashable]]] = {}
    members: dict[Hashable, dict[str, Any]] = {}
    for cause in (one for one in evidence.causes if not one.alone):
        if cause.kind != "damage":
            causes.append(cause)
            continue
        lines = lines_of(structure, members_of(fem.model, cause.of))
        if is_open or probable[cause.name] >= min(0.02, probable.max()):
            divided = pieces_of(lines)
            all_pieces = [piece for line in divided for piece in line]
            names = [f"{cause.name}, piece {number}" for number in range(1, len(all_pieces) + 1)]
            for name in cause.of:
                inside = set(members_of(fem.model, [name]))
                named = {piece: inside.intersection(rows) for piece, rows in zip(names, all_pieces, strict=True)}
                parts[name] = {piece: rows for piece, rows in named.items() if rows}
            pieces += [Cause(name, of=(name,)) for name in names]
            causes += stretches(cause.name, cause.of, divided, names)
        else:  # which `divide` checks, too
            parts |= {name: {} for name in cause.of if name not in parts}
            causes.append(replace(cause, rows=tuple(member for line in lines for member in line)))
        for place, line in enumerate(lines, 1):
            members |= {one: {"group": cause.name, "line": place, "element": i} for i, one in enumerate(line, 1)}
    seen = observed(fem, structure.divide(fem.model, parts), shift, **measured)
    whole = [cause for cause in causes if not cause.alone]
    curves = Curves.tabulated(seen.response, whole).beside(Curves.tabulated(seen.response, pieces, 5))
    names = [(cause.name,) for cause in whole] + [cause.of for cause in pieces]
    incidence = np.array([[name[0] in ((c.of) if c.alone else (c.name,)) for name in names] for c in causes])
    located = Evidence(seen, causes, curves.summed(incidence, causes), evidence.prior, shift.freedom)
    explained = located.explanations(random)
    best = explained[0]
    groups = tabulated(explained, {name: [name] for name in found.groups.index})
    table = tabulated(explained, {member: [member] for member in members})
    table = table.join(pd.DataFrame(members.values(), table.index)).rename_axis("member")
    found = replace(
        found,
        table=table,
        groups=groups.join(found.groups[["error_alone", "error_together", "kind"]]),
        shifts=_shifts(shift, explained, fem.mode_names_),
        misfit_p_value=_p_of_misfit(best.misfit, len(seen.change) - len(best.causes), shift.freedom),
        explained=explained,
    )
    return replace(found, table=table.assign(is_likely=table.index.isin(found.likely_members())))


def _p_of_misfit(misfit: float, freedom: int, of_errors: float) -> float:
    """Probability (F) of a larger misfit by chance; NaN without more observations than causes."""
    return float(stats.f.sf(misfit / freedom, freedom, of_errors)) if freedom > 0 else float("nan")


def _shifts(shift: FrequencyShift, explained: Sequence[Explanation], names: Sequence[Any]) -> pd.DataFrame:
    known, values = ~np.isnan(shift.mean), np.full(len(shift.mean), np.nan)
    shares = np.array([one.probability for one in explained])
    values[known] = (shares @ np.array([one.change for one in explained]) / shares.sum())[: known.sum()]
    return pd.DataFrame(
        {
            "measured": np.expm1(shift.mean),
            "explained": np.expm1(values),
            "standard_error": np.where(known, np.sqrt(np.diag(shift.covariance)), np.nan),
            "n_records": shift.n_records,
            "n_independent": shift.n_independent,
        },
        index=list(names),
    )
