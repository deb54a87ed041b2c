import numpy as np

from skthermo.datasets import make_truss
from skthermo.fem import add_noise
from skthermo.updating import ModelUpdater, identifiability, select_parameters, sensitivity


def updating_frequencies():
    """A model is fitted to mean frequencies, with a prior and several starts."""
    truss = make_truss()
    exact = ModelUpdater(truss).fit(truss.frequencies([0.9, 1.1, 0.95, 1.05]))
    records = add_noise(np.repeat(truss.frequencies([[0.9, 1.1, 0.95, 1.0]]), 100, axis=0), 0.01, random_state=0)
    updater = ModelUpdater(truss, prior=0.2, n_starts=2, random_state=0)
    updater.fit(records, frequency_std=records.std(axis=0) / 10)
    return {
        "exact": exact.theta_,
        "theta": updater.theta_,
        "errors": updater.table_[["error_before", "error_after"]],
        "deviations": np.sqrt(np.diag(updater.covariance_)),
        "model": updater.model_.frequencies([[1.0] * 4]),
        "starts": len(updater.starts_),
    }, {"*": {"rtol": 1e-3, "atol": 1e-4}}


def updating_identifiability():
    """Which parameters of the truss six frequencies tell."""
    truss = make_truss()
    known, fewer = identifiability(truss, noise=0.001), identifiability(make_truss(n_modes=3), noise=0.001)
    with_shapes = identifiability(truss, noise=0.001, dofs=[1, 5, 9], shape_noise=0.01)
    return {
        "sensitivity": sensitivity(truss),
        "selected": select_parameters(sensitivity(truss)),
        "deviations": known.deviations,
        "with shapes": with_shapes.deviations,
        "recommended": [list(known.recommended), len(fewer.recommended)],
        "ranks": [known.rank, fewer.rank],
    }, {"*": {"rtol": 1e-4}, "sensitivity": {"rtol": 1e-7}}


def updating_shapes():
    """A model is fitted to frequencies and to shapes at six sensors; models that this leaves open."""
    truss, truth, dofs = make_truss(), [[0.9, 1.1, 0.95, 1.0]], [1, 5, 9, 13, 17, 21]
    frequencies, shapes = truss.modes(truth)
    weight = np.sqrt(2 * (len(dofs) - 1)) / 0.01**2
    updater = ModelUpdater(truss, shape_weight=weight, random_state=0)
    updater.fit(frequencies, shapes=shapes[0][dofs], dofs=dofs, frequency_std=0.001 * frequencies[0])
    few = ModelUpdater(truss.with_parameters(["bottom", "diagonal"]), bounds=0.6, prior=0.15)
    few.fit(frequencies, frequency_std=0.005 * frequencies[0])
    models = few.sample_models(5, random_state=0)
    sampled = np.array([model.frequencies(np.ones((1, len(model.parameter_names))))[0] for model in models])
    return {"theta": updater.theta_, "open": [len(models), bool(np.abs(sampled / frequencies[0] - 1).max() < 0.03)]}, {
        "theta": {"rtol": 2e-3}
    }
