"""Frequencies of many rows of theta, given or drawn at random, with mode shapes, derivatives and noise."""

from __future__ import annotations

from collections.abc import Generator
from contextlib import closing
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import scipy  # which loads scipy.signal once it is used
from joblib import delayed, effective_n_jobs
from numpy.typing import ArrayLike, NDArray
from scipy.stats import qmc

from skthermo._core.arrays import (
    Array,
    Bounds,
    RandomState,
    as_random_state,
    central_differences,
    check_bounds,
    check_dofs,
    check_flag,
    check_jobs,
    check_model,
    check_noise,
    check_size,
    check_theta,
    positive_integer,
    real_array,
)
from skthermo._core.parallel import as_they_come, map_on_blas_threads, single_blas_thread, with_progress
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import SkthermoWarning
from skthermo.fem._protocol import FEModel
from skthermo.fem._terms import ROWS_PER_CHUNK, failures
from skthermo.fem.modal import linearised_by_row

if TYPE_CHECKING:
    from skthermo.fem._samples import Samples


RESULTS = {
    "frequencies": ("frequencies",),
    "modes": ("frequencies", "shapes"),
    "linearised": ("frequencies", "derivatives"),
    "linearised_modes": ("frequencies", "derivatives", "shapes", "derivatives of shapes"),
}
"""What each method of a model gives for rows of theta."""


class Solves:
    """Questions to a model for many rows of theta, with shapes at some degrees of freedom, and its findings."""

    def __init__(self, model: Any, n_jobs: int | None, dofs: ArrayLike | None = None):
        check_model(model)
        check_jobs(n_jobs)
        self.model, self.n_jobs, self.dofs = model, n_jobs, dofs
        self.findings: list[SkthermoWarning] = []

    def rows(self, theta: ArrayLike) -> Array:
        """Checked rows of theta, which may hold NaN."""
        return check_theta(theta, self.model.parameter_names, allow_nan=True)

    @cached_property
    def places(self) -> NDArray[np.intp]:
        """Positions of the degrees of freedom."""
        model, nominal = self.model, np.ones((1, len(self.model.parameter_names)))
        n_dof = model.n_dof if hasattr(model, "n_dof") else np.shape(model.modes(nominal)[1])[1]
        return check_dofs(self.dofs, n_dof, getattr(model, "dofs", ()))  # type: ignore[arg-type]

    def results(self, method: str, theta: Array, progress: bool | None = False) -> list[Array]:
        """Results of a model's method for every row of theta, NaN where theta has NaN; frequencies are the first."""
        model = self.model
        if method == "modes" and not hasattr(model, "modes"):
            raise ValueError(f"{model!r} has no method 'modes'; expected one that gives mode shapes, as of AffineModel")
        places = self.places if "shapes" in RESULTS[method] else np.empty(0, dtype=np.intp)
        n_modes, n_parameters, n_dofs = model.n_modes, theta.shape[1], len(places)
        shapes = {
            "frequencies": (n_modes,),
            "derivatives": (n_modes, n_parameters),
            "shapes": (n_dofs, n_modes),
            "derivatives of shapes": (n_dofs, n_modes, n_parameters),
        }
        results = [np.full((len(theta), *shapes[what]), np.nan) for what in RESULTS[method]]
        known = np.flatnonzero(~np.isnan(theta).any(axis=1))
        if not known.size:
            return results
        size = getattr(model, "rows_per_chunk", ROWS_PER_CHUNK)
        chunks = np.split(known, range(size, len(known), size))
        thread_safe = getattr(model, "thread_safe", False)
        job = Job(model.quiet() if thread_safe else model, method, places)
        parts: Generator[Any, None, None]
        if thread_safe and effective_n_jobs(self.n_jobs) == 1:
            parts = map_on_blas_threads(lambda rows: (job(rows), []), [theta[chunk] for chunk in chunks])
        else:
            jobs = (delayed(on_one_thread)(job, theta[chunk]) for chunk in chunks)
            parts = as_they_come(jobs, n_jobs=self.n_jobs, prefer=getattr(model, "prefer", None))
        with closing(parts):
            shown = with_progress(parts, len(known), progress, count=lambda part: len(np.atleast_1d(part[0][0])))
            for chunk, (arrays, found) in zip(chunks, shown, strict=True):
                self.findings += found
                for result, array, what in zip(results, arrays, RESULTS[method], strict=True):
                    expected = (len(chunk), *shapes[what])
                    if np.shape(array) != expected:
                        raise ValueError(
                            f"the model's {what} have shape {np.shape(array)}; expected {expected}, the first for the "
                            "rows of theta"
                        )
                    result[chunk] = array
        self.findings += getattr(model, "findings", failures)(theta, results[0])
        return results

    def slopes(self, theta: Array, step: float | None) -> list[Array]:
        """Frequencies and their derivatives, exact or, with a step or where the model has none, by differences."""
        if step is None and (hasattr(self.model, "linearised") or hasattr(self.model, "jacobian")):
            return self.results("linearised", theta)
        (frequencies,) = self.results("frequencies", theta)

        def moved(rows: Array) -> Array:
            return self.results("frequencies", rows)[0]

        return [frequencies, central_differences(moved, theta, frequencies, _step_size(step))]


class Job:
    """One question to a model for every chunk of rows; Dask sends it to a worker once, because it says it is large."""

    def __init__(self, model: Any, method: str, dofs: Any):
        self.model = model
        self.method = method
        self.dofs = dofs

    def __call__(self, theta: Array) -> tuple[Array, ...]:
        if self.method == "frequencies":
            return (self.model.frequencies(theta),)
        if self.method == "modes":
            frequencies, shapes = self.model.modes(theta)
            return frequencies, np.asarray(shapes)[:, self.dofs]
        if self.method == "linearised_modes" and hasattr(self.model, "linearised_modes"):
            return self.model.linearised_modes(theta, self.dofs)
        if self.method == "linearised_modes":
            ranks = None if self.model.track else np.arange(self.model.n_modes)
            return linearised_by_row(partial(self.model.local_modes, follow=True), theta, self.dofs, ranks)
        if hasattr(self.model, "linearised"):
            return self.model.linearised(theta)
        return self.model.frequencies(theta), self.model.jacobian(theta)

    def __sizeof__(self) -> int:
        return 2**20


def on_one_thread(job: Job, chunk: Array) -> tuple[tuple[Array, ...], list[SkthermoWarning]]:
    """A job on a chunk of rows, with one thread of BLAS: its workers share the cores; and the model's warnings."""
    with single_blas_thread(), collected() as findings:
        return job(chunk), findings


def evaluate(model: FEModel, theta: ArrayLike, *, n_jobs: int | None = None, progress: bool | None = None) -> Array:
    """Frequencies of many rows of parameters.

    Parameters
    ----------
    model : FE model
        Anything with ``parameter_names``, ``n_modes`` and ``frequencies``.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.
    progress : bool, optional
        Whether to show a progress bar on stderr. By default it appears on a terminal after one second.

    Returns
    -------
    ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN.

    Raises
    ------
    ValueError
        If ``model`` is not an FE model or returns another shape, or theta has the wrong width, or a value that is
        neither NaN nor finite and positive.

    Notes
    -----
    Rows without a solution give one warning. The chunks, of ``model.rows_per_chunk`` rows where it has that attribute,
    do not depend on ``n_jobs``, so that results are the same to the last bit. With one job, a model that is
    ``thread_safe`` runs on as many threads as BLAS may use.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import evaluate
    >>> evaluate(make_truss(), [[1.0, 1.0, 1.0, 1.0], [0.9, float("nan"), 1.0, 1.0]])[:, :2].round(2)
    array([[ 7.48, 27.5 ],
           [  nan,   nan]])
    """
    solves = Solves(model, n_jobs)
    (frequencies,) = solves.results("frequencies", solves.rows(theta), progress)
    warn_each(solves.findings)
    return frequencies


def evaluate_modes(
    model: FEModel, theta: ArrayLike, dofs: ArrayLike, *, n_jobs: int | None = None
) -> tuple[Array, Array]:
    """Frequencies and mode shapes of many rows of parameters, at some degrees of freedom.

    Parameters
    ----------
    model : FE model
        With a method ``modes``.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction)
        Degrees of freedom, such as those of sensors, by position, the first being 0, or by label, as in the model's
        ``dofs``.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.

    Returns
    -------
    frequencies : ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN.
    shapes : ndarray of shape (n_samples, n_dofs, n_modes)
        As the model scales them; signs are arbitrary. NaN in rows with NaN.

    Raises
    ------
    ValueError
        If the model has no method ``modes``, theta is refused as by `evaluate`, or ``dofs`` are not different degrees
        of freedom of the model.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import evaluate_modes
    >>> frequencies, shapes = evaluate_modes(make_truss(), [[1.0, 1.0, 1.0, 1.0]], dofs=[0, 3])
    >>> frequencies.shape, shapes.shape
    ((1, 6), (1, 2, 6))
    """
    solves = Solves(model, n_jobs, dofs)
    frequencies, shapes = solves.results("modes", solves.rows(theta))
    warn_each(solves.findings)
    return frequencies, shapes


def linearise(
    model: FEModel, theta: ArrayLike, *, relative: bool = False, step: float | None = None, n_jobs: int | None = None
) -> tuple[Array, Array]:
    """Frequencies of many rows of parameters, and their derivatives.

    Parameters
    ----------
    model : FE model
        Exact derivatives come from its method ``linearised`` or ``jacobian``, if it has one.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    relative : bool, default=False
        Whether to return d ln f / d ln theta in place of d f / d theta.
    step : float, optional
        Relative step of central differences, at least 1.5e-8. By default derivatives are exact, or differences with a
        step of 0.001 where the model gives none.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.

    Returns
    -------
    frequencies : ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN.
    jacobian : ndarray of shape (n_samples, n_modes, n_parameters)
        Derivatives d f / d theta in Hz or, if ``relative``, d ln f / d ln theta; NaN in rows with NaN.

    Raises
    ------
    ValueError
        If theta is refused as by `evaluate`, or the step is not between 1.5e-8 and 1.

    See Also
    --------
    skthermo.updating.sensitivity : The relative derivatives at one theta, as a frame.

    Examples
    --------
    The frequency of a mass on a spring is proportional to the square root of the stiffness:

    >>> from skthermo.fem import AffineModel, linearise
    >>> model = AffineModel({("k",): [[400.0]]}, [[1.0]], n_modes=1)
    >>> frequencies, jacobian = linearise(model, [[1.0], [4.0]], relative=True)
    >>> jacobian[:, 0, 0].round(6)
    array([0.5, 0.5])
    """
    solves = Solves(model, n_jobs)
    rows = solves.rows(theta)
    frequencies, jacobian = solves.slopes(rows, step)
    if check_flag(relative, "relative"):
        jacobian = jacobian * rows[:, np.newaxis] / frequencies[:, :, np.newaxis]
    warn_each(solves.findings)
    return frequencies, jacobian


def _step_size(step: float | None) -> float:
    """A relative step of central differences; below the smallest, rounding takes half of the digits of a frequency."""
    lowest = float(np.sqrt(np.finfo(float).eps))
    expected = (
        f"a relative step from {lowest:.1e}, below which rounding takes more than half of the digits, to 1, such as "
        "0.001"
    )
    return 0.001 if step is None else check_size(step, "step", lowest, 1, expected)


def linearise_modes(
    model: FEModel,
    theta: ArrayLike,
    dofs: ArrayLike,
    *,
    step: float | None = None,
    n_jobs: int | None = None,
) -> tuple[Array, Array, Array, Array]:
    """Frequencies and mode shapes of many rows of parameters, and their derivatives.

    Parameters
    ----------
    model : FE model
        Exact derivatives [Nel76]_ come from its method ``linearised_modes`` or ``local_modes``, if it has one; else
        derivatives of the shapes are central differences of its method ``modes``, and `linearise` gives those of the
        frequencies.
    theta : array-like or DataFrame of shape (n_samples, n_parameters)
        Multipliers of the nominal parameters. NaN is allowed.
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction)
        Degrees of freedom, such as those of sensors, by position, the first being 0, or by label, as in the model's
        ``dofs``.
    step : float, optional
        Relative step of central differences, as of `linearise`.
    n_jobs : int, optional
        Number of parallel jobs (joblib); each takes chunks of rows.

    Returns
    -------
    frequencies : ndarray of shape (n_samples, n_modes)
        In Hz; NaN in rows with NaN, as are the others.
    jacobian : ndarray of shape (n_samples, n_modes, n_parameters)
        Derivatives d f / d theta in Hz.
    shapes : ndarray of shape (n_samples, n_dofs, n_modes)
        As the model scales them; signs are arbitrary.
    derivatives : ndarray of shape (n_samples, n_dofs, n_modes, n_parameters)
        Derivatives d phi / d theta of these shapes.

    Raises
    ------
    ValueError
        If the model has neither method, ``dofs`` are not different degrees of freedom of the model, theta is refused
        as by `evaluate`, or the step is not between 1.5e-8 and 1.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.fem import linearise_modes
    >>> [array.shape for array in linearise_modes(make_truss(), [[1.0, 1.0, 1.0, 1.0]], dofs=[0, 3, 8])]
    [(1, 6), (1, 6, 4), (1, 3, 6), (1, 3, 6, 4)]
    """
    solves = Solves(model, n_jobs, dofs)
    rows = solves.rows(theta)
    if step is None and (hasattr(model, "linearised_modes") or hasattr(model, "local_modes")):
        results = solves.results("linearised_modes", rows)
    else:
        results = solves.slopes(rows, step)
        shapes = solves.results("modes", rows)[1]

        def with_the_same_signs(moved: Array) -> Array:
            there = solves.results("modes", moved)[1]
            reference = np.tile(np.repeat(shapes, rows.shape[1], axis=0), (2, 1, 1))  # both sides of every parameter
            return there * np.sign(np.einsum("sdm,sdm->sm", there, reference))[:, np.newaxis]

        results += [shapes, central_differences(with_the_same_signs, rows, shapes, _step_size(step))]
    warn_each(solves.findings)
    return tuple(results)  # type: ignore[return-value]


def add_noise(
    frequencies: ArrayLike, noise: ArrayLike, *, correlation: float = 0.0, random_state: RandomState = None
) -> NDArray[np.float64]:
    """Frequencies times (1 + noise * standard Gaussian).

    Parameters
    ----------
    frequencies : array-like of shape (n_samples, n_modes)
        In Hz.
    noise : float or array-like of shape (n_modes,)
        Relative standard deviation; 0 leaves the frequencies as they are.
    correlation : float, default=0.0
        Correlation of the noise of neighbouring rows, above -1 and below 1. Noise k rows apart is correlated by its
        k-th power: a stationary autoregressive process of first order.
    random_state : int, RandomState or None, default=None
        Seed.

    Returns
    -------
    ndarray of shape (n_samples, n_modes)
        In Hz.

    Raises
    ------
    ValueError
        If the noise is negative, 1 or more, or of another length, the correlation is not between -1 and 1, or a number
        is not real.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.fem import add_noise
    >>> noisy = add_noise(np.full((10_000, 2), 4.0), [0.0, 0.01], random_state=0)
    >>> noisy.std(axis=0).round(2)
    array([0.  , 0.04])
    """
    clean, names = real_array(frequencies, "frequencies"), getattr(frequencies, "columns", None)
    if np.isinf(clean).any():
        raise ValueError("frequencies hold infinite values; expected finite ones, or NaN")
    if clean.ndim != 2:
        raise ValueError(f"frequencies have shape {clean.shape}; expected (n_samples, n_modes)")
    deviation = check_noise(noise, clean.shape[1], names)
    memory = check_size(correlation, "correlation", -1, 1, "a number between -1 and 1, such as 0.9")
    relative = as_random_state(random_state).standard_normal(clean.shape)
    if memory:
        relative[1:] *= np.sqrt(1 - memory**2)
        relative = scipy.signal.lfilter([1.0], [1.0, -memory], relative, axis=0)
    return clean * (1 + deviation * relative)


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
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction), optional
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
    from skthermo.fem._samples import Samples  # imported here because scikit-learn imports pandas

    solves = Solves(model, n_jobs, dofs)
    lowest, highest = check_bounds(bounds, model.parameter_names).T
    n_samples = positive_integer(n_samples, "n_samples")
    if progress is not None:
        check_flag(progress, "progress")
    theta = _unit_cube(method, n_samples, len(lowest), as_random_state(random_state))
    theta *= highest - lowest
    theta += lowest
    if dofs is None:
        drawn = Samples(theta=theta, frequencies=solves.results("frequencies", theta, progress)[0])
    else:
        frequencies, shapes = solves.results("modes", theta)
        drawn = Samples(theta=theta, frequencies=frequencies, shapes=shapes)
    warn_each(solves.findings)
    return drawn


def _unit_cube(method: str, n_samples: int, n_parameters: int, random_state: np.random.RandomState) -> Array:
    if method == "uniform":
        return random_state.uniform(size=(n_samples, n_parameters))
    engines = {"lhs": qmc.LatinHypercube, "sobol": qmc.Sobol}
    if method not in list(engines):  # a list, because a method that cannot be hashed would fail in a dictionary
        raise ValueError(f"method is {method!r}; expected one of {['uniform', *engines]}")
    generator = np.random.default_rng(random_state.randint(np.iinfo(np.int32).max))
    return engines[method](n_parameters, rng=generator).random(n_samples)
