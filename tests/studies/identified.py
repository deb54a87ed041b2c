"""Identifications made by hand, to see what is said and drawn of them."""

import numpy as np
import pandas as pd

from skthermo.studies import DamagePrior
from skthermo.studies.identification import IdentifiedDamage
from skthermo.studies.identification._identified import Probabilities, Separability
from skthermo.studies.identification._shift import ComparedRecords

BAND = 1.645  # standard deviations on either side that hold 90 %


def identified(explanations, *, groups=None, kinds=None, alike=(), shifts=None, **changed):
    """An identification with these explanations: by name, the probability and each cause's severity and error.

    Severities are averaged by drawing from them; ``alike`` holds sets of groups with a cosine of 0.99.
    """
    random = np.random.default_rng(0)
    causes = list(groups or dict.fromkeys(cause for _, amounts in explanations.values() for cause in amounts))
    kinds = kinds or {}
    probabilities = np.array([probability for probability, _ in explanations.values()])
    counts = np.round(20000 * probabilities).astype(int)
    draws = {cause: np.zeros(counts.sum()) for cause in causes}
    holds = {cause: np.zeros(counts.sum(), dtype=bool) for cause in causes}
    rows, begin = {}, 0
    for (name, (_, amounts)), count in zip(explanations.items(), counts, strict=True):
        here = slice(begin, begin := begin + count)
        for cause, (severity, error) in amounts.items():
            lowest, highest = severity - BAND * error, severity + BAND * error
            if kinds.get(cause, "damage") == "damage":
                lowest = max(lowest, 0.0)
            rows[name, cause] = [severity, error, lowest, highest]
            draws[cause][here] = np.abs(random.normal(severity, error, count)) * np.sign(severity)
            holds[cause][here] = True
    estimates = pd.DataFrame.from_dict(
        rows, orient="index", columns=["severity", "standard_error", "ci_low", "ci_high"]
    )
    estimates.index = (
        pd.MultiIndex.from_tuples(rows, names=["explanation", "cause"]) if rows else pd.MultiIndex.from_arrays([[], []])
    )
    table = pd.DataFrame(
        {
            "probability": [holds[cause].mean() for cause in causes],
            "severity": [draws[cause].mean() for cause in causes],
            "standard_error": [draws[cause].std() for cause in causes],
            "ci_low": [np.quantile(draws[cause], 0.05) for cause in causes],
            "ci_high": [np.quantile(draws[cause], 0.95) for cause in causes],
            "if_damaged": [draws[cause][holds[cause]].mean() if holds[cause].any() else np.nan for cause in causes],
            "highest_if_damaged": [
                np.quantile(draws[cause][holds[cause]], 0.95) if holds[cause].any() else 0.031 for cause in causes
            ],
            "error_alone": 0.02,
            "kind": [kinds.get(cause, "damage") for cause in causes],
        },
        index=causes,
    )
    similarity = pd.DataFrame(np.eye(len(causes)), causes, causes)
    for members in alike:
        similarity.loc[list(members), list(members)] = 0.99
    names = list(explanations)
    given = {
        "explanations": pd.DataFrame(
            {
                "probability": probabilities,
                "misfit": 3.0,
                "text": [
                    ", ".join(f"{cause} {100 * severity:.0f} %" for cause, (severity, _) in amounts.items())
                    for _, amounts in explanations.values()
                ],
            },
            index=names,
        ).sort_values("probability", ascending=False, kind="stable"),
        "estimates": estimates,
        "table": table,
        "shifts": pd.DataFrame(
            shifts
            or {
                "measured": [-0.021, -0.012, -0.034, -0.008],
                "explained": [-0.020, -0.013, -0.033, -0.008],
                "standard_error": [0.001, 0.001, 0.002, 0.002],
            },
            index=["f1", "f2", "f3", "f4"],
        ).assign(n_records=60, n_independent=30.0),
        "draws": pd.DataFrame(draws),
        "members": {cause: [cause] for cause in causes if kinds.get(cause, "damage") == "damage"},
        "probabilities": {
            "damage": 1 - explanations.get("no damage", (0.0,))[0],
            "other": sum(p for name, (p, _) in explanations.items() if name.endswith("something else")),
            "even": 0.0,
            "p_value": 0.0003,
            "misfit_p_value": 0.6,
        },
        "separability": {
            "similarity": similarity,
            "indistinguishable": [tuple(members) for members in alike],
            "unobservable": [],
            "precision": table[["error_alone"]].set_axis(["alone"], axis=1).assign(together=0.05),
        },
        "records": ComparedRecords(60, {}, 60.0, 365, 365.0, {}),
        "prior": DamagePrior(),
    }
    for part in ("probabilities", "separability"):
        given[part] |= {name: changed.pop(name) for name in set(changed) & set(given[part])}
    given |= changed | {"probabilities": Probabilities(**given["probabilities"])}
    return IdentifiedDamage(**given | {"separability": Separability(**given["separability"])})
