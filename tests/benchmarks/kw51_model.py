"""The un-updated model of KW51 beside the paper's: Tables A.5 and A.3.

python tests/benchmarks/kw51_model.py
"""

import numpy as np
import pandas as pd
from scipy.stats import spearmanr

from skthermo.datasets import make_kw51
from skthermo.updating import sensitivity

MODES = [f"f{j}" for j in range(1, 7)]
THERMAL = ["E_bot", "E_arc", "E_br", "E_con", "E_pip"]
FREQUENCIES = np.array([0.4735, 1.1080, 1.7190, 2.3450, 2.4870, 2.7810])  # Table A.5, un-updated, Hz
SENSITIVITIES = pd.DataFrame(  # Table A.3
    {
        "E_bot": [0.0810, 0.0686, 0.4350, 0.0531, 0.0191, 0.0784],
        "E_arc": [0.2076, 0.2936, 0.0251, 0.3582, 0.4184, 0.0557],
        "E_br": [0.0007, 0.0019, 0.0088, 0.0011, 0.0403, 0.2584],
        "E_con": [0.0092, 0.0060, 0.0093, 0.0142, 0.0219, 0.1065],
        "E_pip": [0.1982, 0.1271, 0.0004, 0.0711, 0.0000, 0.0000],
        "E_b": [0.0033, 0.0028, 0.0215, 0.0023, 0.0004, 0.0011],
        "A_c": [0.0003, 0.0007, 0.0062, 0.0003, 0.0218, 0.1057],
        "A_p": [0.0000, 0.0000, 0.0000, 0.0000, 0.0000, 0.0000],
        "I_33p": [0.0281, 0.0088, 0.0001, 0.0046, 0.0000, 0.0000],
        "I_22p": [0.1653, 0.1152, 0.0001, 0.0648, 0.0000, 0.0000],
        "A_d": [0.0006, 0.0017, 0.0086, 0.0005, 0.0403, 0.2581],
        "I_33a": [0.0002, 0.0002, 0.0205, 0.0001, 0.0129, 0.0107],
        "I_22a": [0.2031, 0.2875, 0.0008, 0.3509, 0.0000, 0.0000],
        "A_a": [0.0016, 0.0004, 0.0029, 0.0004, 0.4029, 0.0447],
        "J_a": [0.0007, 0.0027, 0.0004, 0.0027, 0.0000, 0.0000],
        "M_a": [-0.4081, -0.4113, -0.0011, -0.3963, -0.0420, -0.0533],
        "I_33g": [0.0002, 0.0002, 0.0206, 0.0001, 0.0040, 0.0115],
        "I_22g": [0.0285, 0.0234, 0.0014, 0.0173, 0.0000, 0.0001],
        "M_g": [0.0000, 0.0000, -0.0407, -0.0001, -0.0355, -0.0343],
        "A_tb": [0.0013, 0.0012, 0.0040, 0.0011, 0.0012, 0.0014],
        "I_22s": [0.0002, 0.0002, 0.0001, 0.0001, 0.0000, 0.0001],
    },
    index=MODES,
).T


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
