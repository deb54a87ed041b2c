"""The method as Kamali et al. (2026) published it: their networks, and the chain of all their choices."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator, MultiOutputMixin, RegressorMixin
from sklearn.metrics import r2_score
from sklearn.neural_network import MLPRegressor
from sklearn.pipeline import make_pipeline
from sklearn.utils import check_random_state, gen_batches
from sklearn.utils.validation import check_is_fitted, validate_data

from skthermo._core.arrays import Array, Bounds, check_flag
from skthermo.fem import FEModel
from skthermo.preprocessing import BiasAligner, KNNGapImputer, LagFeatures
from skthermo.surrogate._data_informed import DataInformedFEM
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._regression import TemperatureMapper


class DropoutRegressor(MultiOutputMixin, RegressorMixin, BaseEstimator):
    """A network of ReLU layers with dropout, trained by Adam in 32 bits for all its epochs; see `paper_network`."""

    def __init__(
        self,
        hidden_layer_sizes: Sequence[int] = (100,),
        *,
        dropout: Sequence[float] = (),
        alpha: float = 0.0,
        batch_size: int = 128,
        learning_rate_init: float = 0.001,
        max_iter: int = 1000,
        validation_fraction: float = 0.2,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.hidden_layer_sizes = hidden_layer_sizes
        self.dropout = dropout
        self.alpha = alpha
        self.batch_size = batch_size
        self.learning_rate_init = learning_rate_init
        self.max_iter = max_iter
        self.validation_fraction = validation_fraction
        self.random_state = random_state

    def fit(self, X: ArrayLike, y: ArrayLike) -> DropoutRegressor:
        """Learn from all rows but those that are held out, and score these."""
        X, y = validate_data(self, X, y, dtype=np.float32, multi_output=True, y_numeric=True)
        self.y_is_vector_ = y.ndim == 1
        targets = y.reshape(len(y), -1).astype(np.float32)
        random = check_random_state(self.random_state)
        sizes = [X.shape[1], *self.hidden_layer_sizes, targets.shape[1]]
        drawn = (np.sqrt(6 / sum(shape)) * random.uniform(-1, 1, shape) for shape in pairwise(sizes))
        self.coefs_ = [values.astype(np.float32) for values in drawn]
        self.intercepts_ = [np.zeros(size, dtype=np.float32) for size in sizes[1:]]
        held_out, learned = np.split(random.permutation(len(X)), [round(self.validation_fraction * len(X))])
        parameters = [*self.coefs_, *self.intercepts_]
        means, squares = ([np.zeros_like(values) for values in parameters] for _ in range(2))
        n_steps, self.n_iter_ = 0, self.max_iter
        for _ in range(self.max_iter):
            order = random.permutation(learned)
            for batch in gen_batches(len(order), self.batch_size):
                slopes = self._slopes(X[order[batch]], targets[order[batch]], random)
                n_steps += 1
                rate = self.learning_rate_init * (1 - 0.999**n_steps) ** 0.5 / (1 - 0.9**n_steps)
                for values, slope, mean, square in zip(parameters, slopes, means, squares, strict=True):
                    mean += 0.1 * (slope - mean)
                    square += 0.001 * (slope**2 - square)
                    values -= rate * mean / (np.sqrt(square) + 1e-8)
        few = len(held_out) < 2
        self.validation_score_ = np.nan if few else r2_score(targets[held_out], self._layers(X[held_out])[-1])
        return self

    def predict(self, X: ArrayLike) -> Array:
        """Outputs of all layers, without dropout."""
        check_is_fitted(self)
        found = self._layers(validate_data(self, X, dtype=np.float64, reset=False))[-1]
        return found.ravel() if self.y_is_vector_ else found

    @property
    def _rates(self) -> list[float]:
        return [*map(float, self.dropout), *[0.0] * (len(self.coefs_) - len(self.dropout))]

    def _layers(self, X: Array, random: np.random.RandomState | None = None) -> list[Array]:
        """What goes into each layer, and the output; in training, random values are dropped."""
        layers = [X]
        for coefs, intercepts, rate in zip(self.coefs_, self.intercepts_, self._rates, strict=True):
            if random is not None and rate > 0:
                layers[-1] = layers[-1] * (random.uniform(size=layers[-1].shape) >= rate) / (1 - rate)
            layers.append(np.maximum(layers[-1] @ coefs + intercepts, 0))
        layers[-1] = layers[-2] @ self.coefs_[-1] + self.intercepts_[-1]
        return layers

    def _slopes(self, X: Array, y: Array, random: np.random.RandomState) -> list[Array]:
        """Derivatives of half the squared error a row, by each matrix of weights and each vector of intercepts."""
        layers = self._layers(X, random)
        by_output = (layers[-1] - y) / len(X)
        of_coefs, of_intercepts = [], []
        for inputs, coefs, rate in reversed(list(zip(layers[:-1], self.coefs_, self._rates, strict=True))):
            of_coefs.append(inputs.T @ by_output + self.alpha / len(X) * coefs)
            of_intercepts.append(by_output.sum(axis=0))
            by_output = by_output @ coefs.T * (inputs > 0) / (1 - rate)
        return [*of_coefs[::-1], *of_intercepts[::-1]]


def paper_network(
    network: Literal["truss", "kw51-inverse", "kw51-mapper", 1, 4, 6], *, dropout: bool = True, **parameters: Any
) -> BaseEstimator:
    """The deep networks of Kamali et al. (2026) [KCM26]_, untrained.

    Parameters
    ----------
    network : {"truss", "kw51-inverse", "kw51-mapper"} or {1, 4, 6}
        Purpose of the network, or its table in the paper: both networks of the truss (Table 1, 6 hidden layers), the
        inverse surrogate of the KW51 bridge (Table 4, 5 layers), its temperature mapper (Table 6, 4 layers).
    dropout : bool, default=True
        Whether the network trains as published: with dropout where its table has some, and on 80 % of its rows. False
        gives scikit-learn's ``MLPRegressor``, which has no dropout.
    **parameters
        Parameters of the network that replace the paper's.

    Returns
    -------
    regressor
        ReLU layers, trained by Adam with learning rate 0.001 for 1000 epochs; nothing stops earlier. As published, it
        has ``MLPRegressor``'s parameters ``hidden_layer_sizes``, ``alpha``, ``batch_size``, ``learning_rate_init``,
        ``max_iter``, ``validation_fraction`` and ``random_state``, and ``dropout``: the rates after the input and after
        each hidden layer. After ``fit``, ``n_iter_`` is the number of epochs, ``validation_score_`` the R2 of the rows
        that were held out, and ``coefs_`` and ``intercepts_`` are the weights.

    Raises
    ------
    ValueError
        If the paper has no such network.

    Notes
    -----
    Table 1 drops 5 % of the inputs, Table 6 20 % of the outputs of each of the first two layers, Table 4 nothing. The
    rows that are held out are drawn at random. ``MLPRegressor`` holds out none, and in place of dropout it has an L2
    penalty, ``alpha``, of 0.1 and 1. Table 1 has no size of batches, which is Table 4's here, and a schedule for the
    learning rate whose steps it does not say: here the rate is constant. The estimators themselves standardise inputs
    and outputs.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.surrogate import paper_network
    >>> X = np.linspace(-1, 1, 100)[:, np.newaxis]
    >>> network = paper_network("kw51-inverse", max_iter=50, random_state=0).fit(X, X**2)
    >>> network.hidden_layer_sizes, network.n_iter_, network.validation_score_ > 0.9
    ((256, 128, 64, 32, 16), 50, True)
    """
    networks: dict[str, dict[str, Any]] = {
        "truss": {"hidden_layer_sizes": (128, 128, 64, 64, 32, 16), "batch_size": 128},
        "kw51-inverse": {"hidden_layer_sizes": (256, 128, 64, 32, 16), "batch_size": 128},
        "kw51-mapper": {"hidden_layer_sizes": (256, 128, 64, 32), "batch_size": 256},
    }
    rates = {"truss": (0.05,), "kw51-inverse": (), "kw51-mapper": (0.0, 0.2, 0.2)}
    penalties = {"truss": 0.1, "kw51-inverse": 1e-4, "kw51-mapper": 1.0}
    tables = {1: "truss", 4: "kw51-inverse", 6: "kw51-mapper"}
    is_name = isinstance(network, str | int) and not isinstance(network, bool)
    purpose = tables.get(network, network) if is_name else None
    if purpose not in networks:
        raise ValueError(f"network is {network!r}; expected one of {[*networks]} or of the tables {[*tables]}")
    settings = networks[purpose] | {"learning_rate_init": 0.001, "max_iter": 1000} | parameters
    if check_flag(dropout, "dropout"):
        return DropoutRegressor(**({"dropout": rates[purpose]} | settings))
    # by this tolerance no epoch counts as better than the first, and patience ends with the last one, without a warning
    patience = {"tol": 1e9, "n_iter_no_change": max(settings["max_iter"] - 2, 1)}
    return MLPRegressor(**({"alpha": penalties[purpose]} | patience | settings))


def paper_chain(
    model: FEModel,
    *,
    network: Literal["truss", "kw51"] = "truss",
    lags: int | None = None,
    bounds: Bounds = 0.3,
    n_samples: int = 1000,
    random_state: int | np.random.RandomState | None = None,
) -> DataInformedFEM:
    """The chain of Kamali et al. (2026) [KCM26]_: every choice is the paper's.

    Parameters
    ----------
    model : FE model
        Its modes are the columns of the frequencies.
    network : {"truss", "kw51"}, default="truss"
        The networks of the truss, Table 1 for both surrogates, or those of the KW51 bridge, Tables 4 and 6.
    lags : int, optional
        Number of temperatures, of this record and the records before it, that M2 sees: 24 hours on KW51. None is the
        temperatures of this record alone, as on the truss.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        Box of the simulations that teach M1, as in `InverseSurrogate`: 0.3 on KW51; 0.2 on the truss.
    n_samples : int, default=1000
        Number of these simulations.
    random_state : int, RandomState or None, default=None
        Seed of the simulations and networks.

    Returns
    -------
    DataInformedFEM
        Unfitted. M1 is an `InverseSurrogate` and M2 a `TemperatureMapper`, both on a `paper_network`, M1 from
        simulations without noise; frequencies are shifted, eq. (22), to the mean of these simulations (Section 4.3);
        gaps in temperatures and frequencies are filled from the 10 nearest records; there is no discrepancy and no
        reduced model.

    Raises
    ------
    ValueError
        If the paper has no such networks.

    See Also
    --------
    DataInformedFEM : By default, makes other choices; :doc:`/accuracy_paper` shows both beside the paper's results.

    Notes
    -----
    Its detector is ``MahalanobisDetector(threshold="quantile")``. Each network holds out a fifth of its rows, M2 of the
    records that ``fit`` is given. Networks learn logarithms of frequencies and parameters, so that predictions are
    positive; in the paper, the values themselves. ``set_params(reduce="auto")`` solves a reduced model, which takes a
    fraction of the time where the FE model is large.

    Examples
    --------
    >>> from skthermo.datasets import make_truss, make_truss_campaign
    >>> from skthermo.surrogate import paper_chain
    >>> year = make_truss_campaign(random_state=0)
    >>> fem = paper_chain(make_truss(), bounds=0.2, n_samples=200, random_state=0)
    >>> fem = fem.set_params(inverse__regressor__max_iter=100, mapper__regressor__max_iter=100)
    >>> fem.fit(year.temperatures, year.frequencies).simulate(year.temperatures, damage={"bottom": 0.2}).shape
    (365, 6)
    """
    networks = {"truss": ("truss", "truss"), "kw51": ("kw51-inverse", "kw51-mapper")}
    if not isinstance(network, str) or network not in networks:
        raise ValueError(f"network is {network!r}; expected one of {[*networks]}")
    of_inverse, of_mapper = (paper_network(purpose) for purpose in networks[network])
    mapper = TemperatureMapper(of_mapper, means=None)
    return DataInformedFEM(
        model,
        inverse=InverseSurrogate(regressor=of_inverse, bounds=bounds, n_samples=n_samples, noise=0.0),
        mapper=mapper if lags is None else make_pipeline(LagFeatures(lags), mapper),
        aligner=BiasAligner("simulations"),
        imputer=KNNGapImputer(n_neighbors=10),
        discrepancy=None,
        reduce=False,
        random_state=random_state,
    )
