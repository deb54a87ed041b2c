"""Appendix A of the paper on our model of KW51, for ``plot_kw51_updating.py``: design variables, fits, its tables."""

import warnings

import numpy as np

from skthermo.datasets import kw51_structure
from skthermo.updating import ModelUpdater

MODES = [f"f{i}" for i in range(1, 7)]
MEASURED = [0.51, 1.24, 1.89, 2.45, 2.58, 2.92]  # Hz, before the retrofit
NOISE = 0.001
DESIGN = {  # the eleven design variables, as make_kw51 binds them
    "E_bot": "bottom",
    "E_arc": "arch",
    "E_br": "braces",
    "E_con": "connections",
    "E_pip": "pipes",
    "A_c": ("A", "connections", "stiffness"),
    "I_22p": ("I_zz", "pipes"),
    "A_d": ("A", "braces", "stiffness"),
    "I_22a": ("I_zz", "arch"),
    "A_a": ("A", "arch", "stiffness"),
    "M_a": ("mass", "arch"),
}
PAPER_A3 = {
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
}
PAPER_A4 = [0.9324, 1.1000, 1.0432, 1.1000, 0.9286, 1.2188, 0.6416, 1.4826, 1.5000, 1.0540, 0.9710]
PAPER_A5 = {"before": [0.4735, 1.1080, 1.7190, 2.3450, 2.4870, 2.7810],
            "after": [0.5040, 1.2754, 1.8885, 2.4033, 2.5797, 2.9202]}  # fmt: skip


def bounds(**others):
    """Multipliers of the design variables: 10 % for moduli, 50 % for all else, or as stated."""
    widths = {name: 0.1 if name.startswith("E_") else 0.5 for name in DESIGN} | others
    return np.array([[1 - width, 1 + width] for width in widths.values()])


def bridge(track, limits):
    """The FE model of the eleven design variables, reduced within their limits."""
    return kw51_structure().assemble(DESIGN, n_modes=6, track=track).reduced(limits, random_state=0)


def update(model, limits, n_starts):
    """The design variables fitted to six frequencies, and what the updater warned of."""
    updater = ModelUpdater(model, bounds=limits, n_starts=n_starts, random_state=0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        updater.fit(MEASURED, frequency_std=NOISE * np.array(MEASURED))
    return updater, [str(w.message) for w in caught if w.message.kind == "mode-order"]
