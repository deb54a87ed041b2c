"""How often a90/95 lies above the true a90, and a comparison with statsmodels.

OMP_NUM_THREADS=1 python tests/benchmarks/detectability_pod.py
"""

import argparse
import warnings

import numpy as np
import pandas as pd
import statsmodels.api as api
from scipy.optimize import brentq
from scipy.special import expit, logit
from scipy.stats import norm

from skthermo.studies import pod_curve

SEVERITIES = np.array([0.1, 0.2, 0.3, 0.4, 0.5])
CURVES = {"flat": 12, "medium": 25, "steep": 50}
RECORDS = (20, 50, 365, 7300)


def draws(slope, n_records, log, n_simulations):
    """Detected records of every simulation, and the true a90."""
    x, centre = (np.log(SEVERITIES), np.log(0.25)) if log else (SEVERITIES, 0.25)
    slope = slope / 4 if log else slope
    truth = centre + logit(0.9) / slope
    detected = np.random.RandomState(0).binomial(n_records, expit(slope * (x - centre)), (n_simulations, len(x)))
    return detected, np.exp(truth) if log else truth


def by_statsmodels(detected, n_records, log):
    """a90 and a90/95 by a generalised linear model."""
    x = np.log(SEVERITIES) if log else SEVERITIES
    counts = np.column_stack([detected, n_records - detected])
    fitted = api.GLM(counts, api.add_constant(x), family=api.families.Binomial()).fit(tol=1e-14)
    a90 = (logit(0.9) - fitted.params[0]) / fitted.params[1]

    def lower(place):
        design = np.array([1.0, place])
        return design @ fitted.params - norm.ppf(0.95) * np.sqrt(design @ fitted.cov_params() @ design) - logit(0.9)

    bound = brentq(lower, a90, a90 + 10, xtol=1e-13)
    return (np.exp(a90), np.exp(bound)) if log else (a90, bound)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--simulations", type=int, default=500)
    options = parser.parse_args()
    rows, difference = {}, 0.0
    for log in (False, True):
        for name, slope in CURVES.items():
            for n_records in RECORDS:
                detected, truth = draws(slope, n_records, log, options.simulations)
                with warnings.catch_warnings():
                    warnings.filterwarnings("ignore", message="the severities")
                    curves = [pod_curve(SEVERITIES, k, np.full(5, n_records), log=log) for k in detected]
                finite = [curve for curve in curves if np.isfinite(curve.a90_95)]
                held = np.mean([curve.a90_95 >= truth for curve in finite]) if finite else np.nan
                margin = np.median([curve.a90_95 - curve.a90 for curve in finite]) if finite else np.nan
                rows["log" if log else "linear", name, n_records] = (100 * held, truth, margin, len(finite))
                for curve in finite[:20]:
                    ours = np.array([curve.a90, curve.a90_95])
                    theirs = by_statsmodels(curve.n_detected, n_records, log)
                    difference = max(difference, np.abs(ours - theirs).max())
    index = pd.MultiIndex.from_tuples(list(rows), names=["severity", "slope", "records"])
    columns = ["a90/95 above a90, %", "a90", "median margin", "finite"]
    table = pd.DataFrame(list(rows.values()), index=index, columns=columns)
    print(f"{options.simulations} simulations each; 95 % asked for\n")
    print(table.round(4).to_string(), end="\n\n")
    print(f"largest difference from statsmodels in a90 and a90/95: {difference:.1e}")


if __name__ == "__main__":
    main()
