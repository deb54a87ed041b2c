"""Identifications made by hand, to see what is said and drawn of them."""

import numpy as np
import pandas as pd

from skthermo.studies import IdentifiedDamage
from skthermo.studies._causes import Cause
from skthermo.studies._evidence import DamageExplanation
from skthermo.studies._identify import tabulated


def identified(explanations, *, groups=None, unobservable=(), alike=(), **changed):
    """An identification with these explanations: by name, the probability and each group's severity and error."""
    random = np.random.default_rng(0)
    names = list(groups or dict.fromkeys(name for _, amounts in explanations.values() for name in amounts))
    causes = {name: Cause(name, of=(name,), rows=(name,), group=name) for name in names}
    explained = [
        DamageExplanation(
            tuple(causes[group] for group in amounts),
            name.endswith("something else"),
            probability,
            np.clip([random.normal(*amount, 500) for amount in amounts.values()], 0, 0.95).T.reshape(500, -1),
            np.zeros(4),
            3.0,
        )
        for name, (probability, amounts) in explanations.items()
    ]
    table = tabulated(explained, names)
    errors = [0.3 if name in unobservable else 0.02 for name in names]
    table = table.assign(error_alone=errors, error_together=0.5, kind="damage")
    similarity = pd.DataFrame(np.eye(len(names)), table.index, table.index)
    for one, other in alike:
        similarity.loc[[one, other], [one, other]] = 0.999
    shifts = {"measured": [-0.021, -0.012], "explained": [-0.02, -0.013], "standard_error": [0.001, 0.001]}
    given = {
        "table": table,
        "groups": table,
        "shifts": pd.DataFrame(shifts, ["f1", "f2"]).assign(n_records=60, n_independent=30.0),
        "draws": pd.DataFrame(np.full((2, len(names)), 0.1), columns=table.index),
        "damage": {},
        "p_value": 0.0003,
        "misfit_p_value": 0.6,
        "similarity": similarity,
        "records": pd.Series(
            {"given": 60, "compared": 60, "independent": 30, "trained": 365, "independent of trained": 99}
        ),
        "explained": explained,
    }
    return IdentifiedDamage(**given | changed)
