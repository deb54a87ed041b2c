"""The result of an identification: tables and tests from fits."""

import numpy as np
import pandas as pd

from skthermo.studies.identification._bounded_fit import (
    BoundedFit,
    error_beside,
    p_of_damage,
    p_of_group,
    p_of_misfit,
    redrawn,
    standard_errors,
    two_errors,
    widening_of,
)
from skthermo.studies.identification._compared import ComparedRecords
from skthermo.studies.identification._comparison import Comparison
from skthermo.studies.identification._identified import IdentifiedDamage
from skthermo.studies.identification._separability import confused_groups, cosines, errors_alone
from skthermo.studies.identification._shift import Shift

N_DRAWS = 500  # number of fits to redrawn shifts, for standard errors and p-values


def findings(
    comparison: Comparison,
    nominal: Comparison,
    shift: Shift,
    records: ComparedRecords,
    unseen: list[str],
    significance: float,
    random: np.random.RandomState,
) -> IdentifiedDamage:
    """Fit the groups together and one by one, and test what is found.

    The comparisons are with the effects of the groups in the weather of the records and at the model's nominal state.
    """
    fit, names, at_nominal = comparison.fit(), list(comparison.names), nominal.slopes()
    confused = list(dict.fromkeys(confused_groups(at_nominal) + confused_groups(fit.slopes)))
    misfit_p_value = p_of_misfit(fit, shift.freedom)
    widening = widening_of(fit) if misfit_p_value < significance else 1.0
    draws = redrawn(fit.slopes, fit.target, N_DRAWS, random, shift.freedom, widening)
    errors, covariance = standard_errors(fit, N_DRAWS, random)
    for column in {column for group in confused for column in group}:
        errors[column] = max(errors[column], error_beside(at_nominal, fit.severities, column))
    factor = two_errors(shift.freedom)
    errors, covariance = widening * errors, widening**2 * covariance
    p_value, p_values = p_of_damage(fit, shift.freedom, N_DRAWS, random), []
    for column, severity in enumerate(fit.severities):
        others = [[other] for other in range(len(names)) if other != column]
        without = comparison.of(others).fit() if severity > 0 else fit
        p_values.append(p_of_group(fit, without, shift.freedom, column, at_nominal))
    table = pd.DataFrame(
        {
            "severity": fit.severities,
            "standard_error": factor * errors,
            "error_alone": factor * widening * errors_alone(fit.slopes),
            "p_value": p_values,
            "significant": (np.array(p_values) < significance / len(names)) & (p_value <= significance),
        },
        index=names,
    )
    return IdentifiedDamage(
        table=table,
        shifts=_shift_table(shift, fit, factor),
        single=_single_fits(comparison, shift, factor),
        similarity=pd.DataFrame(cosines(at_nominal), names, names),
        covariance=pd.DataFrame(covariance, names, names),
        draws=pd.DataFrame(comparison.members(draws), columns=list(comparison.of_model)),
        confused=[tuple(names[column] for column in group) for group in confused],
        unseen=unseen,
        members=comparison.contents,
        p_value=p_value,
        misfit=fit.misfit,
        misfit_p_value=misfit_p_value,
        widening=widening,
        records=records,
        significance=significance,
        converged=fit.converged,
    )


def _shift_table(shift: Shift, fit: BoundedFit, factor: float) -> pd.DataFrame:
    known = np.flatnonzero(~np.isnan(shift.mean))
    explained = np.full(len(shift.mean), np.nan)
    explained[known] = fit.explained[: len(known)]
    return pd.DataFrame(
        {
            "measured": np.expm1(shift.mean),
            "explained": np.expm1(explained),
            "standard_error": np.where(np.isnan(shift.mean), np.nan, factor * np.sqrt(np.diag(shift.covariance))),
            "n_records": shift.n_records,
            "n_independent": shift.n_independent,
        },
        index=list(shift.modes),
    )


def _single_fits(comparison: Comparison, shift: Shift, factor: float) -> pd.DataFrame:
    """Each group's own best fit, the best first."""
    fits = [comparison.of([[column]]).fit() for column in range(len(comparison.names))]
    return pd.DataFrame(
        {
            "severity": [fit.severities[0] for fit in fits],
            "standard_error": [factor * errors_alone(fit.slopes)[0] for fit in fits],
            "misfit": [fit.misfit for fit in fits],
            "misfit_p_value": [p_of_misfit(fit, shift.freedom) for fit in fits],
        },
        index=list(comparison.names),
    ).sort_values("misfit", kind="stable")
