"""Monte Carlo sampling of FE models."""

from __future__ import annotations

from typing import TYPE_CHECKING, Literal, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import qmc

from skthermo._estimators.arguments import check_bounds, check_flag, check_model
from skthermo._tables.arrays import Array, Bounds, RandomState, as_random_state, positive_integer
from skthermo.fem._protocol import FEModel, ModalModel
from skthermo.fem.sampling._evaluate import evaluate, evaluate_modes

if TYPE_CHECKING:
    from skthermo.fem.sampling._samples import Samples


def sample(
    model: FEModel,
    bounds: Bounds = 0.3,
    n_samples: int = 1000,
    *,
    method: Literal["uniform", "lhs", "sobol"] = "uniform",
    dofs: ArrayLike | None = None,
    n_jobs: int | None = None,
    progress: bool | None = None,
    random_state: RandomState = None,
) -> Samples:
    """Frequencies of an FE model at random parameters.

    Parameters
    ----------
    model : FE model
        Anything with ``parameter_names``, ``n_modes`` and ``frequencies``.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        A half-width (0.2 means 1 +- 20 %), lowest and highest multiplier of each parameter, or a mapping from each
        parameter to its half-width or to (lowest, highest).
    n_samples : int, default=1000
        Number of rows.
    method : {"uniform", "lhs", "sobol"}, default="uniform"
        Independent uniform draws, a Latin hypercube, or a scrambled Sobol sequence (balanced if ``n_samples`` is a
        power of 2).
    dofs : array-like of int of shape (n_dofs,), optional
        Degrees of freedom where mode shapes are wanted too; the model needs a method ``modes``.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.
    progress : bool, optional
        Whether to show a progress bar on stderr. By default it appears on a terminal after one second.
    random_state : int, RandomState or None, default=None
        Seed. The same seed gives the same bits whatever ``n_jobs`` is.

    Returns
    -------
    Bunch
        ``theta`` (n_samples, n_parameters) and ``frequencies`` (n_samples, n_modes) in Hz; with ``dofs`` also
        ``shapes`` (n_samples, n_dofs, n_modes), as `evaluate_modes` gives them.

    Raises
    ------
    ValueError
        If ``model`` is not an FE model, the bounds are infeasible, ``n_samples`` is not a positive integer, the method
        is unknown, or ``dofs``, ``random_state`` or ``n_jobs`` are invalid.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import sample
    >>> drawn = sample(make_truss(), bounds=0.2, n_samples=100, random_state=0)
    >>> drawn.theta.shape, drawn.frequencies.shape
    ((100, 4), (100, 6))
    """
    from skthermo.fem.sampling._samples import Samples  # imported here because scikit-learn imports pandas

    check_model(model)
    lowest, highest = check_bounds(bounds, model.parameter_names).T
    n_samples = positive_integer(n_samples, "n_samples")
    if progress is not None:
        check_flag(progress, "progress")
    theta = _unit_cube(method, n_samples, len(lowest), as_random_state(random_state))
    theta *= highest - lowest
    theta += lowest
    if dofs is not None:
        frequencies, shapes = evaluate_modes(cast(ModalModel, model), theta, dofs, n_jobs=n_jobs)
        return Samples(theta=theta, frequencies=frequencies, shapes=shapes)
    return Samples(theta=theta, frequencies=evaluate(model, theta, n_jobs=n_jobs, progress=progress))


def _unit_cube(method: str, n_samples: int, n_parameters: int, random_state: np.random.RandomState) -> Array:
    if method == "uniform":
        return random_state.uniform(size=(n_samples, n_parameters))
    engines = {"lhs": qmc.LatinHypercube, "sobol": qmc.Sobol}
    if method not in list(engines):  # a list, because a method that cannot be hashed would fail in a dictionary
        raise ValueError(f"method is {method!r}; expected one of {['uniform', *engines]}")
    generator = np.random.default_rng(random_state.randint(np.iinfo(np.int32).max))
    return engines[method](n_parameters, rng=generator).random(n_samples)
