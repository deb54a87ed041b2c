"""
KW51: sensitivities and model updating
======================================

Appendix A of Kamali, Ceravolo & Marzani (2026) for our own model of the bridge,
:func:`~skthermo.datasets.make_kw51`, with its Tables A.3, A.4 and A.5 beside ours and a counterpart of Fig. A.2;
``plot_kw51_model.py`` draws that of Fig. A.1.

Eleven properties are fitted to six measured frequencies, within 10 % of the moduli and 50 % of all else. Six
frequencies cannot determine eleven properties: most multipliers end at their bounds, and the last columns of Table A.4
show how uncertain they are. Three fits are compared:

- *modes followed* by their shapes, within the paper's bounds;
- *modes sorted*: the fit looks better but is false, because modes have swapped places, and the updater warns of it;
- *modes followed, E_bot within 30 %*: the third mode, lateral bending of the deck, needs a stiffer deck than the
  paper's bounds allow.

Run it with ``python examples/plot_kw51_updating.py``; the figure goes to the folder ``figures``.
"""

import argparse
import time
import warnings
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd

from skthermo.datasets import kw51_structure, make_kw51
from skthermo.plotting import SensitivityDisplay
from skthermo.updating import ModelUpdater, identifiability, sensitivity

MODES = [f"f{i}" for i in range(1, 7)]
MEASURED = [0.51, 1.24, 1.89, 2.45, 2.58, 2.92]  # Hz, before the retrofit
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
NOISE = 0.001


def bounds(**others):
    """Multipliers of the design variables: 10 % for moduli, 50 % for all else, or as stated."""
    widths = {name: 0.1 if name.startswith("E_") else 0.5 for name in DESIGN} | others
    return np.array([[1 - width, 1 + width] for width in widths.values()])


def table_a3():
    """Sensitivities of all 21 parameters, exact, and how much faster they are than by eq. (A.2)."""
    model = make_kw51("all")
    seconds = {}
    for method in ("exact", "central"):
        started = time.perf_counter()
        S = sensitivity(model, method=method)
        seconds[method] = time.perf_counter() - started
        if method == "exact":
            exact = S
    print(
        f"21 sensitivities of 6 modes: exact {seconds['exact']:.3f} s, eq. (A.2) {seconds['central']:.3f} s "
        f"({seconds['central'] / seconds['exact']:.0f} times longer), "
        f"largest difference {np.abs(exact - S).max().max():.1g}"
    )
    return exact.T


def bridge(track, limits):
    """The FE model of the eleven design variables, reduced within their limits."""
    return kw51_structure().assemble(DESIGN, n_modes=6, track=track).reduced(limits, random_state=0)


def update(model, limits, n_starts):
    """The design variables fitted to six frequencies, and what the updater warned of."""
    updater = ModelUpdater(model, bounds=limits, n_starts=n_starts, random_state=0)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        updater.fit(MEASURED, frequency_std=NOISE * np.array(MEASURED))
    return updater, [str(w.message) for w in caught if "swap" in str(w.message)]


def plot_a3(ours):
    """Table A.3 as two maps, the paper's and ours."""
    paper = pd.DataFrame(PAPER_A3, index=MODES).T
    fig, axes = plt.subplots(1, 2, figsize=(8, 7.5), sharey=True, layout="constrained")
    for ax, table, title in zip(axes, (paper, ours), ("paper, Table A.3", "here"), strict=True):
        display = SensitivityDisplay.from_predictions(table.T, ax=ax, limit=0.45, colorbar=False)
        ax.set_title(title)
    fig.colorbar(display.image_, ax=axes, label="normalised sensitivity, eq. (A.1)", shrink=0.6)
    return fig


def main():
    parser = argparse.ArgumentParser(description="Appendix A of the paper on our model of KW51.")
    parser.add_argument("--figures", type=Path, default=Path("figures"), help="folder for the figure")
    parser.add_argument("--starts", type=int, default=10)
    options = parser.parse_args()

    ours = table_a3()
    print("\nTable A.3, the paper's and ours side by side:")
    print(pd.concat({"paper": pd.DataFrame(PAPER_A3, index=MODES).T, "here": ours}, axis=1).round(3).to_string())

    settings = {
        "followed": (True, bounds()),
        "sorted": (False, bounds()),
        "followed, E_bot 30 %": (True, bounds(E_bot=0.3)),
    }
    fits = {name: update(bridge(track, limits), limits, options.starts) for name, (track, limits) in settings.items()}
    table_a4 = pd.DataFrame({"paper": PAPER_A4}, index=list(DESIGN))
    errors = pd.DataFrame({f"paper, {when}": np.divide(f, MEASURED) - 1 for when, f in PAPER_A5.items()}, index=MODES)
    errors["here, before"] = fits["followed"][0].table_["error_before"].to_numpy() / 100
    for name, (updater, _) in fits.items():
        table_a4[name] = updater.theta_
        errors[f"here, {name}"] = updater.table_["error_after"].to_numpy() / 100
    known = identifiability(fits["followed"][0].model_, noise=NOISE)
    table_a4["deviation alone, %"] = 100 * NOISE / np.sqrt((known.sensitivity**2).sum(axis=0))
    table_a4["deviation with the others, %"] = 100 * known.deviations
    print(f"\nTable A.4, multipliers; deviations (followed) for {100 * NOISE:g} % noise on every frequency:")
    print(table_a4.round(3).to_string())
    print(f"Parameters that these frequencies can tell together to 10 %: {', '.join(known.recommended)}")
    errors.loc["mean of absolute values"] = errors.abs().mean()
    print("\nTable A.5, errors of frequencies in %:")
    print((100 * errors).round(2).T.to_string())
    for message in fits["sorted"][1]:
        print(f"\nThe sorted fit is refused: {message}")

    options.figures.mkdir(parents=True, exist_ok=True)
    path = options.figures / "kw51_sensitivities.png"
    plot_a3(ours).savefig(path, dpi=130)
    print(f"\nFigure: {path}")


if __name__ == "__main__":
    main()
