"""Neural networks for the two surrogates."""

from typing import Any, Literal

from sklearn.neural_network import MLPRegressor

HIDDEN_LAYERS = {
    1: (128, 128, 64, 64, 32, 16),
    4: (256, 128, 64, 32, 16),
    6: (256, 128, 64, 32),
}
BATCH_SIZES = {1: "auto", 4: 128, 6: 256}


def default_network() -> MLPRegressor:
    """A small network for noisy data, with an L2 penalty that keeps it from fitting the noise.

    Adam, because scikit-learn's L-BFGS gets a loss that is averaged over outputs and a gradient
    that is summed over them: with several outputs its line search fails.
    """
    return MLPRegressor(
        hidden_layer_sizes=(64,), alpha=1.0, learning_rate_init=0.003, max_iter=2000, n_iter_no_change=20
    )


def paper_network(table: Literal[1, 4, 6], **parameters: Any) -> MLPRegressor:
    """The deep networks of Kamali et al. (2026), as near as ``MLPRegressor`` comes to them.

    Parameters
    ----------
    table : {1, 4, 6}
        Table of the paper: 1, both networks of the truss (6 hidden layers); 4, the inverse
        surrogate of the KW51 bridge (5); 6, its temperature mapper (4).
    **parameters
        Parameters of ``MLPRegressor`` to set otherwise.

    Returns
    -------
    MLPRegressor
        ReLU, Adam with learning rate 0.001, at most 1000 epochs, no early stopping.

    Raises
    ------
    ValueError
        If the paper has no such table.

    Notes
    -----
    ``MLPRegressor`` has no dropout and no learning-rate schedule for Adam. What stands in for
    the dropout of Table 1 (0.05 after the input) and Table 6 (0.2 after the first two layers) is
    the L2 penalty ``alpha``, 0.1 and 1 here, and, for the inverse surrogate, ``noise``
    on the simulated frequencies. Training ends before 1000 epochs when the loss has stopped
    falling; no rows are held back to decide this, which fails on small samples.
    Standardisation of inputs and outputs is the estimators' own.

    References
    ----------
    Kamali, Ceravolo & Marzani, Mechanical Systems and Signal Processing 256 (2026) 114519.

    Examples
    --------
    >>> from skthermo.surrogate import paper_network
    >>> paper_network(4, alpha=0.01).hidden_layer_sizes
    (256, 128, 64, 32, 16)
    """
    if table not in HIDDEN_LAYERS:
        raise ValueError(f"table is {table!r}; expected one of {sorted(HIDDEN_LAYERS)}")
    settings = {
        "hidden_layer_sizes": HIDDEN_LAYERS[table],
        "alpha": {1: 0.1, 4: 1e-4, 6: 1.0}[table],
        "batch_size": BATCH_SIZES[table],
        "learning_rate_init": 0.001,
        "max_iter": 1000,
    }
    return MLPRegressor(**(settings | parameters))
