"""The constants of make_z24 that are fitted, from the monitoring of the bridge.

    python tools/fit_z24_constants.py DATA_FILE

DATA_FILE is what load_z24 reads. Four constants are found by least squares on their logarithms, drawn
mildly to where they start from; modes are paired by kind. Prints the rounded constants, the frequencies they
give beside the measured means, and how well the model's four parameters can be told apart.
"""

import argparse
from copy import deepcopy

import numpy as np
from scipy.optimize import least_squares

from skthermo.datasets import load_z24
from skthermo.datasets._z24_model import CONSTANTS, PARAMETERS, z24_structure

STARTS = {  # constant: where it starts from, and how far from there it may well be, in logarithms
    ("girder", "I_yy"): (0.6, 0.1),
    ("girder", "J"): (1.25, 0.2),
    ("soil", "rx"): (1e10, 0.5),
    ("abutment", "z"): (5e8, 0.5),
}
KINDS = ("vertical, symmetric", "lateral, symmetric", "vertical, antisymmetric", "torsion, symmetric")
MISFIT = 0.005  # of a frequency, that weighs as much as a constant which is as far as it may well be
WARM = 5.0  # degrees Celsius
DIRECTIONS = {"x": "longitudinal", "y": "lateral", "z": "vertical", "rx": "torsion"}


def warm_means(z24):
    """Mean frequencies of the healthy records in which every sensor is warm, and how many there are."""
    rows = (z24.state == "undamaged") & (z24.temperatures > WARM).all(axis=1)
    return z24.frequencies[rows].mean().to_numpy(), int(rows.sum())


def mass_shares(structure, model):
    """Share of each direction in the modal mass of the nominal modes, direction -> (n_modes,)."""
    nominal = np.ones((1, len(model.parameter_names)))
    shapes, mass = model.modes(nominal)[1][0], model.matrices(nominal)[1]
    along = np.array([direction for _, direction in structure.dofs])
    return {direction: (shapes * (mass @ shapes))[along == direction].sum(axis=0) for direction in np.unique(along)}


def mode_kinds(structure, model):
    """The direction that moves most of each nominal mode's mass, and whether its two halves move alike."""
    shapes = model.modes(np.ones((1, len(model.parameter_names))))[1][0]
    shares = mass_shares(structure, model)
    kinds = []
    for j in range(model.n_modes):
        direction = max(DIRECTIONS, key=lambda d: shares[d][j])
        deck = [i for i, ((_, _, z), d) in enumerate(structure.dofs) if z == 0 and d == direction]
        halves = "symmetric" if shapes[deck, j] @ shapes[deck[::-1], j] > 0 else "antisymmetric"
        kinds.append(f"{DIRECTIONS[direction]}, {halves}")
    return kinds


def frequencies_by_kind(constants, n_modes=8):
    """The lowest frequency of each of the four kinds."""
    structure = z24_structure(constants)
    model = structure.assemble(PARAMETERS, n_modes=n_modes)
    kinds = mode_kinds(structure, model)
    return model.frequencies(np.ones((1, 4)))[0][[kinds.index(kind) for kind in KINDS]]


def with_logs(logs):
    """All constants, with those that are fitted at exp(logs) times their starts."""
    constants = deepcopy(CONSTANTS)
    for ((part, name), (start, _)), log in zip(STARTS.items(), logs, strict=True):
        constants[part][name] = start * np.exp(log)
    return constants


def fit(measured):
    """The constants at the optimum, those that are fitted rounded to three digits."""
    spread = np.array([spread for _, spread in STARTS.values()])

    def residuals(logs):
        misfit = np.log(frequencies_by_kind(with_logs(logs)) / measured)
        return np.concatenate([misfit / MISFIT, logs / spread])

    constants = with_logs(least_squares(residuals, np.zeros(len(STARTS)), x_scale=spread, diff_step=1e-4).x)
    for part, name in STARTS:
        constants[part][name] = float(f"{constants[part][name]:.3g}")
    return constants


def relative_sensitivity(model):
    """d ln f / d ln theta at the nominal state, (n_modes, n_parameters)."""
    nominal = np.ones((1, len(model.parameter_names)))
    return model.jacobian(nominal)[0] / model.frequencies(nominal)[0][:, np.newaxis]


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data_file", metavar="DATA_FILE", help="the Z24 monitoring as CSV or MATLAB v5 file")
    options = parser.parse_args()
    try:
        measured, n_records = warm_means(load_z24(options.data_file))
    except (FileNotFoundError, ValueError) as error:
        parser.error(str(error))
    constants = fit(measured)
    print("constant           start    fitted")
    for (part, name), (start, _) in STARTS.items():
        print(f"{part + ' ' + name:14s} {start:9.3g} {constants[part][name]:9.3g}")
    print(f"\nmode                      model  measured  difference   (mean of {n_records} records, Hz)")
    for kind, model, mean in zip(KINDS, frequencies_by_kind(constants), measured, strict=True):
        print(f"{kind:24s} {model:6.3f}    {mean:6.3f}     {100 * (model / mean - 1):+.2f} %")
    model = z24_structure(constants).assemble(PARAMETERS, n_modes=4, track=True)
    sensitivity = relative_sensitivity(model)
    singular = np.linalg.svd(sensitivity, compute_uv=False)
    print("\nd ln f / d ln theta   " + "  ".join(f"{name:>14s}" for name in PARAMETERS))
    for j, row in enumerate(sensitivity):
        print(f"f{j + 1:<20d} " + "  ".join(f"{value:14.3f}" for value in row))
    print("singular values " + ", ".join(f"{s:.3f}" for s in singular))
    print(f"condition number {singular[0] / singular[-1]:.1f}")


if __name__ == "__main__":
    main()
