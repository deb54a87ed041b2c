"""Scenarios of all damage groups and severities."""

from collections.abc import Sequence
from typing import Any

from skthermo.studies._scenario import Scenario
from skthermo.studies._state import check_groups


def sweep(
    model: Any, severities: Sequence[float] = (0.1, 0.2, 0.3, 0.4, 0.5), groups: Sequence[str] | None = None
) -> list[Scenario]:
    """The healthy structure, and damage of every group at every severity.

    Parameters
    ----------
    model : FE model or DataInformedFEM
        With damage groups.
    severities : sequence of float, default=(0.1, 0.2, 0.3, 0.4, 0.5)
        Shares of the stiffness that are lost.
    groups : sequence of str, optional
        Damage groups; by default all.

    Returns
    -------
    list of Scenario
        With names such as "healthy" and "bottom 20 %".

    Raises
    ------
    ValueError
        If a group is unknown, a severity is impossible, or the model has no damage groups.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.studies import sweep
    >>> [scenario.name for scenario in sweep(make_truss(), (0.1, 0.2), ["bottom", "top"])]
    ['healthy', 'bottom 10 %', 'bottom 20 %', 'top 10 %', 'top 20 %']
    """
    model = getattr(model, "model", model)
    known = getattr(model, "groups", None)
    if not known:
        raise ValueError(f"{model!r:.200} has no damage groups; expected a model with 'groups', such as AffineModel")
    chosen = list(known) if groups is None else list(groups)
    check_groups(chosen, known)
    damaged = [Scenario(f"{g} {100 * s:g} %", {g: s}) for g in chosen for s in severities]
    return [Scenario("healthy"), *damaged]
