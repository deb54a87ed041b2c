"""The constants of make_z24 that are fitted, from the monitoring of the bridge.

    python tools/fit_z24_constants.py DATA_FILE

DATA_FILE is what load_z24 reads. ModelUpdater finds four constants, drawn mildly to where they start from;
modes are followed from there, where their kinds are checked. Prints the rounded constants, the frequencies
they give beside the measured means, and how well the model's four parameters can be distinguished.
"""

import argparse
from copy import deepcopy

import numpy as np

from skthermo.datasets import load_z24
from skthermo.datasets._z24 import Z24_CONSTANTS, Z24_PARAMETERS, z24_structure
from skthermo.fem import Spring, Structure
from skthermo.updating import ModelUpdater, sensitivity

STARTS = {  # constant: where it starts from, and how far from there it may well be, as a share
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


def with_multipliers(theta):
    """All constants, with those that are fitted at multiples of their starts."""
    constants = deepcopy(Z24_CONSTANTS)
    for ((part, name), (start, _)), multiplier in zip(STARTS.items(), theta, strict=True):
        constants[part][name] = start * multiplier
    return constants


def fitted_structure():
    """The bridge at the starts, with a group for the springs of every fitted direction."""
    structure = z24_structure(with_multipliers(np.ones(len(STARTS))))
    springs = {
        f"{part} {direction}": [
            name
            for name in structure.groups["abutments" if part == "abutment" else part]
            if isinstance(structure.members[name], Spring) and structure.members[name].direction == direction
        ]
        for part, direction in STARTS
        if part != "girder"
    }
    return Structure(structure.nodes, structure.members, {}, structure.groups | springs)


def model_of_constants():
    """The bridge with the fitted constants as its parameters, and modes of the kinds that were measured."""
    structure = fitted_structure()
    parameters = {f"{part} {name}": (name, "girder") if part == "girder" else f"{part} {name}" for part, name in STARTS}
    model = structure.assemble(parameters, n_modes=4, track=True)
    assert mode_kinds(structure, model) == list(KINDS)
    return model


def fit(measured):
    """The constants at the optimum, those that are fitted rounded to three digits."""
    bounds = [[0.3, 3.0]] * len(STARTS)
    updater = ModelUpdater(model_of_constants(), bounds=bounds, prior=[spread for _, spread in STARTS.values()])
    constants = with_multipliers(updater.fit(measured, frequency_std=MISFIT * measured).theta_)
    for part, name in STARTS:
        constants[part][name] = float(f"{constants[part][name]:.3g}")
    return constants


def frequencies(constants):
    """The four frequencies of the bridge in Hz."""
    return z24_structure(constants).assemble(Z24_PARAMETERS, n_modes=4).frequencies(np.ones((1, 4)))[0]


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
    for kind, model, mean in zip(KINDS, frequencies(constants), measured, strict=True):
        print(f"{kind:24s} {model:6.3f}    {mean:6.3f}     {100 * (model / mean - 1):+.2f} %")
    model = z24_structure(constants).assemble(Z24_PARAMETERS, n_modes=4, track=True)
    slopes = sensitivity(model)
    singular = np.linalg.svd(slopes, compute_uv=False)
    print("\nd ln f / d ln theta", slopes.round(3), sep="\n")
    print("singular values " + ", ".join(f"{s:.3f}" for s in singular))
    print(f"condition number {singular[0] / singular[-1]:.1f}")


if __name__ == "__main__":
    main()
