"""The un-updated model of KW51 beside the paper's: Tables A.5 and A.3.

python tests/benchmarks/kw51_model.py
"""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

sys.path.append(str(Path(__file__).parents[2] / "examples"))  # which Python does itself for a file that it runs

from kw51_appendix_recipes import MODES, PAPER_A3, PAPER_A5

from skthermo.datasets import make_kw51
from skthermo.updating import sensitivity

THERMAL = ["E_bot", "E_arc", "E_br", "E_con", "E_pip"]
FREQUENCIES = np.array(PAPER_A5["before"])  # un-updated, Hz
SENSITIVITIES = pd.DataFrame(PAPER_A3, index=MODES).T


def rank_correlation(found, parameters):
    """Spearman's correlation of absolute sensitivities with Table A.3."""
    table, ours = SENSITIVITIES.loc[parameters], found.loc[parameters]
    return spearmanr(np.abs(ours).to_numpy().ravel(), np.abs(table).to_numpy().ravel()).statistic


def main():
    model = make_kw51("all")
    frequencies = model.frequencies(np.ones((1, 21)))[0]
    found = sensitivity(model).T
    table = pd.DataFrame({"paper": FREQUENCIES, "here": frequencies}, index=MODES).T
    table.loc["difference, %"] = 100 * (frequencies / FREQUENCIES - 1)
    print(model, "", "Table A.5, un-updated frequencies (Hz)", table.round(4).to_string(), "", sep="\n")
    side_by_side = pd.concat({"paper": SENSITIVITIES, "here": found}, axis=1).round(4)
    print("Table A.3, sensitivities (theta / f) df / dtheta", side_by_side.to_string(), "", sep="\n")
    for name, parameters, target in (("five thermal", THERMAL, 0.9), ("all 21", list(found.index), 0.85)):
        correlation = rank_correlation(found, parameters)
        print(f"Spearman correlation of |S|, {name} parameters, at least {target}: {correlation:.3f}")


if __name__ == "__main__":
    main()
