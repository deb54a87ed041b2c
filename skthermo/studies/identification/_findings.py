"""The result of an identification: tables from the probabilities of explanations."""

from __future__ import annotations

import numpy as np
import pandas as pd
from scipy import stats

from skthermo._arrays import Array
from skthermo._changes import Changes
from skthermo.studies.identification._identified import IdentifiedDamage
from skthermo.studies.identification._sentences import explanation_text
from skthermo.studies.identification._separability import VISIBLE, confused_groups, cosines, errors_alone, precision
from skthermo.studies.identification.measured import ComparedRecords, Shift
from skthermo.studies.identification.weighing import Cause, Comparison, DamagePrior, Observed, Posterior

LISTED = 1e-3  # least probability of explanations that are listed
N_DRAWS = 500
OF_GROUPS = ("damage", "stiffening")


def findings(
    posterior: Posterior,
    slopes: Array,
    nominal: Comparison,
    shift: Shift,
    records: ComparedRecords,
    causes: list[Cause],
    changes: Changes,
    prior: DamagePrior,
    random: np.random.RandomState,
) -> IdentifiedDamage:
    """Tables of a posterior, and what the causes' effects have in common.

    ``slopes`` (n_observed, n_causes) are effects of small amounts in standard errors, in the weather of the records;
    what the causes have in common is judged at the model's nominal state, too.
    """
    names, observed = [cause.name for cause in causes], nominal.observed()
    signs = np.array([1.0 if cause.highest > 0 else -1.0 for cause in causes])  # of the amounts
    slopes, at_nominal = signs * slopes, signs * nominal.slopes(len(causes))
    factor = two_errors(shift.freedom)
    alone = factor * errors_alone(slopes)
    seen = np.flatnonzero(alone <= VISIBLE)
    groups = confused_groups(at_nominal[:, seen]) + confused_groups(slopes[:, seen])
    table = posterior.table(names)
    table["error_alone"], table["kind"] = alone, [cause.kind for cause in causes]
    first, factors = changes.n_parameters, changes.factors(posterior.drawn(names, N_DRAWS, random))
    estimates, best = posterior.estimates(LISTED), posterior.explanations[0]
    listed = [one for one in posterior.explanations if one.probability >= LISTED] or [best]
    return IdentifiedDamage(
        explanations=pd.DataFrame(
            {
                "probability": [one.probability for one in listed],
                "misfit": [one.misfit for one in listed],
                "text": [explanation_text(one.causes, one.draws.mean(axis=0)) for one in listed],
            },
            index=[one.name for one in listed],
        ),
        estimates=estimates,
        table=table,
        shifts=_shift_table(shift, posterior.explained(), factor),
        rest=max(1 - sum(one.probability for one in listed), 0.0),
        most_probable=best.causes,
        probability_of_damage=1 - posterior.no_damage,
        probability_of_else=posterior.probability_of("something else"),
        similarity=pd.DataFrame(cosines(at_nominal), names, names),
        confused=list(dict.fromkeys(tuple(names[seen[column]] for column in group) for group in groups)),
        unseen=[name for name, error in zip(names, alone, strict=True) if error > VISIBLE],
        members={cause.name: list(cause.of) if cause.kind in OF_GROUPS else [] for cause in causes},
        draws=pd.DataFrame(1 - factors[:, first : first + len(changes.groups)], columns=list(changes.groups)),
        precision=factor * precision(slopes, int((~np.isnan(shift.mean)).sum()), causes, prior.severity),
        p_value=p_of_misfit(observed.measured @ observed.measured, 0, observed, shift.freedom),
        misfit_p_value=p_of_misfit(best.misfit, len(best.named), observed, shift.freedom),
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


def _shift_table(shift: Shift, explained: Array, factor: float) -> pd.DataFrame:
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
