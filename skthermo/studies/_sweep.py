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
        Shares of the stiffness that are lost; negative ones are gained.
    groups : sequence of str, optional
        Damage groups; by default all.

    Returns
    -------
    list of Scenario
        With names such as "healthy" and "bottom 20 %". Each group is a family. If there are severities of both signs,
        the strengthening of a group is a family of its own, such as "bottom strengthened", since no curve of detection
        can hold both.

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
    >>> [scenario.family for scenario in sweep(make_truss(), (-0.1, 0.2), ["bottom"])]
    [None, 'bottom strengthened', 'bottom']
    """
    model = getattr(model, "model", model)
    known = getattr(model, "groups", None)
    if not known:
        raise ValueError(f"{model!r:.200} has no damage groups; expected a model with 'groups', such as AffineModel")
    chosen = list(known) if groups is None else list(groups)
    check_groups(chosen, known)
    has_both = min(severities, default=0) < 0 < max(severities, default=0)

    def scenario(group: str, severity: float) -> Scenario:
        family = f"{group} strengthened" if has_both and severity < 0 else None
        return Scenario(f"{group} {100 * severity:g} %", {group: severity}, family=family)

    return [Scenario("healthy"), *(scenario(group, severity) for group in chosen for severity in severities)]
