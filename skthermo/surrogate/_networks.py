"""Default regressors of the two surrogates, and the paper's networks."""

from typing import Any, Literal

import numpy as np
from sklearn.linear_model import RidgeCV
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import Pipeline, make_pipeline

from skthermo.preprocessing import HingeFeatures

NETWORKS: dict[str, dict[str, Any]] = {
    "truss": {"hidden_layer_sizes": (128, 128, 64, 64, 32, 16), "alpha": 0.1, "batch_size": "auto"},
    "kw51-inverse": {"hidden_layer_sizes": (256, 128, 64, 32, 16), "alpha": 1e-4, "batch_size": 128},
    "kw51-mapper": {"hidden_layer_sizes": (256, 128, 64, 32), "alpha": 1.0, "batch_size": 256},
}
PENALTIES = np.logspace(-3, 5, 33)
TABLES = {1: "truss", 4: "kw51-inverse", 6: "kw51-mapper"}


def default_network() -> MLPRegressor:
    """A small network for noisy data; Adam, because the line search of L-BFGS fails with several outputs."""
    return MLPRegressor(
        hidden_layer_sizes=(64,), alpha=1.0, learning_rate_init=0.003, max_iter=2000, n_iter_no_change=20
    )


def default_lines(penalties: Any = PENALTIES, **options: Any) -> Pipeline:
    """Broken lines whose changes of slope are penalised; they go on straight beyond the data."""
    hinges = HingeFeatures().set_output(transform="default")  # whatever the global setting is at fit and at predict
    return make_pipeline(hinges, RidgeCV(penalties, **options))


def paper_network(network: Literal["truss", "kw51-inverse", "kw51-mapper", 1, 4, 6], **parameters: Any) -> MLPRegressor:
    """The deep networks of Kamali et al. (2026), as closely as ``MLPRegressor`` allows.

    Parameters
    ----------
    network : {"truss", "kw51-inverse", "kw51-mapper"} or {1, 4, 6}
        Purpose of the network, or its table in the paper: both networks of the truss (Table 1, 6 hidden layers),
        the inverse surrogate of the KW51 bridge (Table 4, 5 layers), its temperature mapper (Table 6, 4 layers).
    **parameters
        Parameters of ``MLPRegressor`` that replace those of the paper.

    Returns
    -------
    MLPRegressor
        ReLU, Adam with learning rate 0.001, at most 1000 epochs, no early stopping.

    Raises
    ------
    ValueError
        If the paper has no such network.

    Notes
    -----
    ``MLPRegressor`` has no dropout and no learning-rate schedule for Adam. The dropout of Table 1 (0.05 after the
    input) and Table 6 (0.2 after the first two layers) is replaced by the L2 penalty ``alpha``, 0.1 and 1 here, and,
    for the inverse surrogate, by ``noise`` on the simulated frequencies. Training ends before 1000 epochs when the
    loss has stopped falling; no rows are held out to decide this, because a small sample has too few of them.
    The estimators themselves standardise inputs and outputs.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519 [KCM26]_.

    Examples
    --------
    >>> from skthermo.surrogate import paper_network
    >>> paper_network("kw51-inverse", alpha=0.01).hidden_layer_sizes
    (256, 128, 64, 32, 16)
    """
    is_name = isinstance(network, str | int) and not isinstance(network, bool)
    purpose = TABLES.get(network, network) if is_name else None
    if purpose not in NETWORKS:
        raise ValueError(f"network is {network!r}; expected one of {[*NETWORKS]} or of the tables {[*TABLES]}")
    settings = NETWORKS[purpose] | {"learning_rate_init": 0.001, "max_iter": 1000}
    return MLPRegressor(**(settings | parameters))
