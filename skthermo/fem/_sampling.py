"""Monte Carlo sampling of FE models."""

from collections.abc import Callable, Generator
from contextlib import closing
from numbers import Integral
from typing import Any, Literal

import numpy as np
from joblib import Parallel, delayed, effective_n_jobs
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc
from sklearn.utils import Bunch, check_random_state

from skthermo._progress import watched
from skthermo._threads import map_on_blas_threads, single_blas_thread
from skthermo.fem._protocol import FEModel
from skthermo.fem._terms import ROWS_PER_CHUNK
from skthermo.fem._theta import check_theta, warn_of_failures

Array = NDArray[np.float64]
RandomState = int | np.random.RandomState | None


def check_bounds(bounds: ArrayLike, parameter_names: tuple[str, ...]) -> Array:
    """Lowest and highest multiplier of every parameter.

    Parameters
    ----------
    bounds : float or array-like of shape (n_parameters, 2)
        A half-width (0.2 means 1 +- 20 %), or lowest and highest multipliers.
    parameter_names : tuple of str
        The parameters.

    Returns
    -------
    ndarray of shape (n_parameters, 2)

    Raises
    ------
    ValueError
        If a half-width is not between 0 and 1, the shape is another, or a lowest multiplier is
        not positive or not below the highest.
    """
    array = np.asarray(bounds, dtype=float)
    if array.ndim == 0:
        if not 0 < array < 1:
            raise ValueError(f"bounds is {array}; expected a half-width between 0 and 1, such as 0.3")
        return np.tile([1 - array, 1 + array], (len(parameter_names), 1))
    if array.shape != (len(parameter_names), 2):
        raise ValueError(
            f"bounds has shape {array.shape}; expected a half-width or ({len(parameter_names)}, 2), lowest "
            f"and highest multipliers of {list(parameter_names)}"
        )
    for name, (lowest, highest) in zip(parameter_names, array, strict=True):
        if not 0 < lowest < highest < np.inf:
            raise ValueError(f"bounds of parameter {name!r} are [{lowest}, {highest}]; expected 0 < lowest < highest")
    return array


def sample(
    model: FEModel,
    bounds: ArrayLike = 0.3,
    n_samples: int = 1000,
    *,
    method: Literal["uniform", "lhs", "sobol"] = "uniform",
    n_jobs: int | None = None,
    progress: bool | None = None,
    random_state: RandomState = None,
) -> Bunch:
    """Frequencies of an FE model at random parameters.

    Parameters
    ----------
    model : FE model
        Anything with ``parameter_names``, ``n_modes`` and ``frequencies``.
    bounds : float or array-like of shape (n_parameters, 2), default=0.3
        A half-width (0.2 means 1 +- 20 %), or lowest and highest multipliers.
    n_samples : int, default=1000
        Number of rows.
    method : {"uniform", "lhs", "sobol"}, default="uniform"
        Independent uniform draws, a Latin hypercube, or a scrambled Sobol sequence (even
        where ``n_samples`` is a power of 2).
    n_jobs : int, optional
        Jobs over which chunks of rows are spread, through joblib.
    progress : bool, optional
        Whether a bar on stderr tells how far it is. By default on a terminal, once a second has passed.
    random_state : int, RandomState or None, default=None
        Seed. The same seed gives the same bits whatever ``n_jobs`` is.

    Returns
    -------
    Bunch
        ``theta`` (n_samples, n_parameters) and ``frequencies`` (n_samples, n_modes) in Hz.

    Raises
    ------
    ValueError
        If the bounds are infeasible, ``n_samples`` is not positive or the method is unknown.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import sample
    >>> drawn = sample(make_truss(), bounds=0.2, n_samples=100, random_state=0)
    >>> drawn.theta.shape, drawn.frequencies.shape
    ((100, 4), (100, 6))
    """
    lowest, highest = check_bounds(bounds, model.parameter_names).T
    if not isinstance(n_samples, Integral) or n_samples < 1:
        raise ValueError(f"n_samples is {n_samples!r}; expected a positive integer")
    theta = _unit_cube(method, n_samples, len(lowest), check_random_state(random_state))
    theta *= highest - lowest
    theta += lowest
    return Bunch(theta=theta, frequencies=solve(model, theta, n_jobs=n_jobs, progress=progress))


def solve(model: FEModel, theta: ArrayLike, *, n_jobs: int | None = None, progress: bool | None = False) -> Array:
    """Frequencies (n_samples, n_modes) of many rows; a row of theta with NaN gives NaN.

    Rows are cut into the same chunks whatever ``n_jobs`` is, of ``rows_per_chunk`` if the model states that; it
    may also state what joblib should ``prefer``. One job is as many threads as BLAS has, for models of ours.
    """
    rows = check_theta(theta, model.parameter_names, allow_nan=True)
    frequencies = np.full((len(rows), model.n_modes), np.nan)
    known = np.flatnonzero(~np.isnan(rows).any(axis=1))
    if not known.size:
        return frequencies
    size = getattr(model, "rows_per_chunk", ROWS_PER_CHUNK)
    places = [known[i : i + size] for i in range(0, len(known), size)]
    with closing(_solved(model, rows, places, n_jobs)) as parts:
        for place, part in zip(places, watched(parts, len(known), progress), strict=True):
            frequencies[place] = part
    getattr(model, "_warn_of", warn_of_failures)(rows, frequencies)
    return frequencies


def _solved(model: FEModel, rows: Array, places: list[NDArray], n_jobs: int | None) -> Generator[Array, None, None]:
    """Frequencies at each of the places in their order; the work ends where the generator is closed."""
    quiet = getattr(model, "_frequencies_of_chunk", None)
    if quiet and effective_n_jobs(n_jobs) == 1:
        yield from map_on_blas_threads(lambda place: quiet(rows[place]), places)
    else:
        parallel = _parallel(n_jobs=n_jobs, prefer=getattr(model, "prefer", None))
        yield from parallel(delayed(_solve_chunk)(quiet or model.frequencies, rows[place]) for place in places)


def _parallel(**options: Any) -> Parallel:
    """Gives results as they come where the active backend can."""
    try:
        return Parallel(return_as="generator", **options)
    except ValueError:  # pools of workers, Ray's among them, give all at the end
        return Parallel(**options)


def _solve_chunk(frequencies: Callable[[Array], Array], theta: Array) -> Array:
    with single_blas_thread():
        return frequencies(theta)


def _unit_cube(method: str, n_samples: int, n_parameters: int, random_state: np.random.RandomState) -> Array:
    if method == "uniform":
        return random_state.uniform(size=(n_samples, n_parameters))
    engines = {"lhs": qmc.LatinHypercube, "sobol": qmc.Sobol}
    if method not in engines:
        raise ValueError(f"method is {method!r}; expected one of {['uniform', *engines]}")
    generator = np.random.default_rng(random_state.randint(np.iinfo(np.int32).max))
    return engines[method](n_parameters, rng=generator).random(n_samples)
