"""Which damage explains a shift of frequencies."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import pandas as pd
from joblib import delayed
from numpy.typing import ArrayLike
from scipy import stats

from skthermo._core.arrays import Array, MatrixLike, as_floats, as_random_state, check_jobs
from skthermo._core.parallel import run_jobs
from skthermo._core.warnings import warn_each, without_warnings
from skthermo.studies._scenarios import check_chain, checked_models
from skthermo.studies.identification._causes import SOMETHING_ELSE, Cause, DamagePrior, read_causes
from skthermo.studies.identification._curves import Observed, Part, ShiftComparison
from skthermo.studies.identification._evidence import Posterior, Scale, explanations
from skthermo.studies.identification._identified import (
    VISIBLE,
    IdentifiedDamage,
    Probabilities,
    Separability,
    errors_alone,
    explanation_text,
    precision,
)
from skthermo.studies.identification._shapes import ShapeEffects, shape_shift
from skthermo.studies.identification._shift import ComparedRecords, FrequencyShift, observe
from skthermo.surrogate import refitted
from skthermo.surrogate.effects import FrequencyEffects, StructuralChanges

LISTED = 1e-3  # least probability of explanations that are listed
N_DRAWS = 500
OF_GROUPS = ("damage", "stiffening")


def identify_damage(
    fem: Any,
    T: ArrayLike,
    F: ArrayLike,
    groups: Sequence[str] | Mapping[str, Sequence[str]] | None = None,
    *,
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
        Explanations with their probabilities, probability and severity of each cause, explained shifts, causes that
        cannot be distinguished, and the draws that ``scenario()`` turns into a scenario of a `DetectabilityStudy`.

    Raises
    ------
    ValueError
        If fem is not a fitted chain, T and F differ in rows, a group or parameter is unknown, a mass pattern does not
        fit the model, causes have the same name or that of an explanation, ``prior`` is no `DamagePrior`, shapes or
        dofs do not fit the model, no record can be compared (each lacks all frequencies, a temperature, or similar
        weather in the training records), a mode is more than 3 times or less than a fifth of the predicted one, no
        cause can be seen, or the model cannot be changed so.

    Warns
    -----
    UserWarning
        Once for each kind: if records cannot be compared or are far from the others, with their number and the reasons,
        and if these are the last ones, because the structure may have just changed; if the records, or the training
        records, are worth few independent ones; if temperatures have other names than in fit, causes cannot be
        distinguished or cannot be seen, a severity is at its bound, or the causes do not explain the shifts.

    Notes
    -----
    Sets of at most three causes, each with one unknown amount, and an even loss in all groups are weighed by their
    evidence. :ref:`how-explanations-are-weighed` has the errors of the shifts, the prior and what is assumed.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.studies import identify_damage
    >>> from skthermo.surrogate import DataInformedFEM
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = DataInformedFEM(make_truss(), random_state=0).fit(year.temperatures, year.frequencies)
    >>> later = make_truss_campaign(damage={"diagonal": 0.1}, random_state=1)
    >>> found = identify_damage(fem, later.temperatures, later.frequencies, ["top", "diagonal"], random_state=0)
    >>> found.severities.round(2).to_dict()
    {'top': 0.0, 'diagonal': 0.1}
    """
    check_chain(fem)
    prior = DamagePrior() if prior is None else prior
    if not isinstance(prior, DamagePrior):
        raise ValueError(f"prior is {prior!r}; expected a DamagePrior")
    if shapes is None and dofs is not None:
        raise ValueError("dofs came without shapes; expected both or neither")
    check_jobs(n_jobs)
    causes, changes = read_causes(fem.model, groups, stiffening, parameters, added_mass, even=True)
    seen = observe(fem, T, F, noise)

    def beside(chain: Any, theta: Array) -> ShiftComparison:
        effects = FrequencyEffects.averaged(chain, theta, seen.frequencies, changes)
        return compared(effects, seen.shift, shapes, dofs, shape_noise)

    def scale_of(every: ShiftComparison) -> Scale:
        return Scale.of(every.observed(prior.model_error), every.effects, causes, prior)

    every = beside(fem, seen.theta)
    nominal = ShiftComparison([replace(every.parts[0], effects=every.parts[0].effects.nominal()), *every.parts[1:]])
    scale = scale_of(every)
    whitened = every.observed().rotation @ scale.curves.first
    check_visible(whitened, causes)
    random = as_random_state(random_state)
    if models is None:
        posterior = Posterior.of(scale, *explanations(scale), random)
    else:

        def with_model(model: Any, seed: int) -> Posterior:
            with without_warnings():  # the chain itself has given them
                chain = refitted(fem, model=model)
                scale = scale_of(beside(chain, as_floats(chain.predict_parameters(seen.temperatures))))
            return Posterior.of(scale, *explanations(scale), np.random.RandomState(seed))

        models = checked_models(fem, models)
        seeds = random.randint(np.iinfo(np.int32).max, size=len(models))
        jobs = (delayed(with_model)(model, int(seed)) for model, seed in zip(models, seeds, strict=True))
        posterior = Posterior.mean(run_jobs(jobs, len(models), unit="models", n_jobs=n_jobs))
    found = findings(posterior, whitened, nominal, seen.shift, seen.records, causes, changes, prior, random)
    warn_each(found.warnings())
    return found


def check_visible(slopes: Array, causes: Sequence[Cause]) -> None:
    """Raise an error if the modes show no group that was asked for."""
    alone = errors_alone(slopes)
    asked = [place for place, cause in enumerate(causes) if not cause.is_even]
    if alone[asked].min() > VISIBLE:
        errors = ", ".join(f"{causes[place].name} {alone[place]:.2g}" for place in asked)
        raise ValueError(
            f"no group can be seen; expected a standard error of {VISIBLE} or less for one of them, but they are "
            f"{errors}. More records or other modes would lower them"
        )


def compared(
    effects: FrequencyEffects,
    shift: FrequencyShift,
    shapes: Any,
    dofs: ArrayLike | None,
    shape_noise: ArrayLike | Literal["fitted"],
) -> ShiftComparison:
    """Measured shifts of frequencies, and of shapes if there are any, beside the effects of causes."""
    parts = [Part(effects, shift.mean, shift.covariance, shift.freedom)]
    if shapes is None:
        return ShiftComparison(parts)
    if dofs is None:
        raise ValueError("shapes came without dofs; expected the degree of freedom of each of their rows")
    states = (effects.theta, np.ones((1, effects.theta.shape[1])))
    candidates = [ShapeEffects.of(effects.structure, theta, dofs) for theta in states]
    return ShiftComparison([*parts, shape_shift(candidates, shapes, shape_noise, effects.structure.fem.mode_names_)])


def findings(
    posterior: Posterior,
    slopes: Array,
    nominal: ShiftComparison,
    shift: FrequencyShift,
    records: ComparedRecords,
    causes: list[Cause],
    changes: StructuralChanges,
    prior: DamagePrior,
    random: np.random.RandomState,
) -> IdentifiedDamage:
    """Tables of a posterior, and what the causes' effects have in common.

    ``slopes`` (n_observed, n_causes) are effects of small amounts in standard errors, in the weather of the records;
    what the causes have in common is assessed at the model's nominal state, too.
    """
    observed = nominal.observed()
    signs = np.array([1.0 if cause.highest > 0 else -1.0 for cause in causes])  # of the amounts
    asked = [cause for cause in causes if not cause.is_even]  # they come first
    slopes, at_nominal = ((signs * all_)[:, : len(asked)] for all_ in (slopes, nominal.slopes(len(causes))))
    factor = two_errors(shift.freedom)
    n_frequencies = int((~np.isnan(shift.mean)).sum())
    separability = Separability.of(
        slopes, at_nominal, asked, factor * precision(slopes, n_frequencies, asked, prior.severity)
    )
    table = posterior.table(asked)
    table["error_alone"], table["kind"] = separability.precision["alone"], [cause.kind for cause in asked]
    drawn = posterior.drawn([cause.name for cause in causes], N_DRAWS, random)
    listed, best = posterior.listed(LISTED), posterior.explanations[0]
    unchanged = sum(one.probability for one in posterior.explanations if not one.causes)
    return IdentifiedDamage(
        explanations=pd.DataFrame(
            {
                "probability": [one.probability for one in listed],
                "misfit": [one.misfit for one in listed],
                "text": [explanation_text(one.causes, one.draws.mean(axis=0)) for one in listed],
            },
            index=[one.name for one in listed],
        ),
        estimates=posterior.estimates(LISTED),
        table=table,
        shifts=_shift_table(shift, posterior.explained(), factor),
        draws=pd.DataFrame(changes.severities(drawn), columns=list(changes.groups)),
        members={cause.name: list(cause.of) if cause.kind in OF_GROUPS else [] for cause in causes},
        probabilities=Probabilities(
            damage=1 - min(unchanged, 1.0),
            other=posterior.probability_of(SOMETHING_ELSE),
            even=sum(posterior.probability_of(cause.name) for cause in causes if cause.is_even),
            p_value=p_of_misfit(observed.measured @ observed.measured, 0, observed, shift.freedom),
            misfit_p_value=p_of_misfit(best.misfit, len(best.named), observed, shift.freedom),
        ),
        separability=separability,
        records=records,
        prior=prior,
    )


def p_of_misfit(misfit: float, n_causes: int, observed: Observed, freedom: float) -> float:
    """Probability (F) of a larger misfit by chance; NaN without more observations than causes."""
    rest = len(observed.measured) - n_causes
    return float(stats.f.sf(misfit / rest, rest, freedom)) if rest > 0 else float("nan")


def two_errors(freedom: float) -> float:
    """Half of what holds as much of Student's law as two standard deviations hold of the normal law."""
    return float(stats.t.isf(stats.norm.sf(2.0), freedom)) / 2


def _shift_table(shift: FrequencyShift, explained: Array, factor: float) -> pd.DataFrame:
    known = np.flatnonzero(~np.isnan(shift.mean))
    values = np.full(len(shift.mean), np.nan)
    values[known] = explained[: len(known)]
    return pd.DataFrame(
        {
            "measured": np.expm1(shift.mean),
            "explained": np.expm1(values),
            "standard_error": np.where(np.isnan(shift.mean), np.nan, factor * np.sqrt(np.diag(shift.covariance))),
            "n_records": shift.n_records,
            "n_independent": shift.n_independent,
        },
        index=list(shift.modes),
    )
