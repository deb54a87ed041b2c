"""Reads the records that `DataInformedFEM` is fitted to, and clones its parts."""

from typing import Any, NamedTuple

import numpy as np
from sklearn.base import BaseEstimator, clone
from sklearn.multioutput import MultiOutputRegressor
from sklearn.pipeline import Pipeline
from sklearn.preprocessing import FunctionTransformer

from skthermo._arguments import check_bounds
from skthermo._arrays import Array, as_floats
from skthermo._frames import check_columns, check_same_rows, check_temperatures, column_names, frame_like
from skthermo._models import check_model
from skthermo._validation import check_array, seed_parts, seeded, validate_data
from skthermo.fem import linearise
from skthermo.surrogate._box import Box
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._mapper import TemperatureMapper
from skthermo.surrogate._mapper_inputs import last_step
from skthermo.surrogate._standardiser import damped_inverse

ROWS_PER_DEGREE = 10
"""Training records for each record whose mean a prediction is as sure as: mappers have tens of degrees of freedom."""


class Parts(NamedTuple):
    """Clones, ready to be fitted."""

    inverse: BaseEstimator
    mapper: BaseEstimator
    aligner: BaseEstimator
    imputer: BaseEstimator | None


def read_records(chain: Any, X: Any, y: Any) -> tuple[Any, Any]:
    """Temperatures and frequencies, checked; frames stay frames."""
    model = chain.model
    check_model(model)
    if y is None:
        raise ValueError("This DataInformedFEM estimator requires y to be passed, but the target y is None")
    values = validate_data(chain, X, dtype=np.float64, ensure_all_finite="allow-nan", ensure_min_samples=2)
    T, F = frame_like(X, values), frame_like(y, check_array(y, dtype=np.float64, ensure_all_finite="allow-nan"))
    check_same_rows(X, y, ("temperatures", "frequencies"))
    if F.shape[1] != model.n_modes:
        raise ValueError(f"frequencies have {F.shape[1]} columns; expected the {model.n_modes} modes of {model!r}")
    check_frequencies(F)
    check_temperatures(T)
    check_columns(T, "temperature", varying=True)
    check_columns(F, "frequency")
    return T, F


def check_frequencies(F: Any) -> None:
    """Raise an error for values that are neither positive frequencies nor NaN.

    Raises
    ------
    ValueError
        Names the column and the row.
    """
    values = as_floats(F)
    wrong = ~np.isnan(values) & ~(values > 0)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise ValueError(
            f"frequency {column_names(F, 'f')[column]!r} in row {row} is {values[row, column]:g}; expected positive "
            "numbers in Hz, and NaN where a mode is missing"
        )


def clone_parts(chain: Any) -> Parts:
    """Clones of the chain's parts, with its model and seeds where they have none of their own."""
    parts = Parts(
        inverse=InverseSurrogate(reduce=chain.reduce, n_jobs=chain.n_jobs)
        if chain.inverse is None
        else clone(chain.inverse),
        mapper=TemperatureMapper() if chain.mapper is None else clone(chain.mapper),
        aligner=passthrough() if chain.aligner == "passthrough" else clone(chain.aligner),
        imputer=None if chain.imputer == "passthrough" else clone(chain.imputer),
    )
    names = list(chain.model.parameter_names)
    for part in (parts.inverse, *parts.inverse.get_params().values()):
        if isinstance(part, InverseSurrogate):
            if part.model is None:
                part.set_params(model=chain.model)
            if list(part.model.parameter_names) != names:
                raise ValueError(
                    f"the inverse's model has the parameters {list(part.model.parameter_names)}; expected {names}, as "
                    f"{chain.model!r} has"
                )
    random_state = seeded(chain.random_state)
    for part in parts:
        if part is not None:
            seed_parts(part, random_state)
    return parts


def refining_step(inverse: Any) -> InverseSurrogate | None:
    """The fitted `InverseSurrogate` that an inverse is or ends with, if it refines its estimates."""
    last = inverse[-1] if isinstance(inverse, Pipeline) else inverse
    return last if isinstance(last, InverseSurrogate) and last.n_steps_ else None


def learn_frequencies(mapper: BaseEstimator, inverse: InverseSurrogate, n_rows: int) -> Array | None:
    """Let every `TemperatureMapper` that a mapper is or holds learn in coordinates of frequencies.

    The coordinates are d ln f / d ln theta at the nominal state, in standard deviations of the frequencies. A
    prediction is about as sure as the mean of a tenth of the records; the prior of the parameters does the damping.
    Returns the inverse of the coordinates, (n_parameters, n_modes), damped as for the mean of all records; None if
    there is no such mapper, if it is fitted to one parameter at a time, if its coordinates are given, or if the nominal
    state has no solution.
    """
    if isinstance(last_step(mapper), MultiOutputRegressor):
        return None
    mappers = [part for part in (mapper, *mapper.get_params().values()) if isinstance(part, TemperatureMapper)]
    is_given = any(part.sensitivities is not None for part in mappers)
    if not mappers or is_given:
        return None
    frequencies, jacobian = linearise(inverse.model, np.ones((1, len(inverse.parameter_names_))))
    sensitivities = jacobian[0] / frequencies[0][:, np.newaxis] / inverse.scatter_[:, np.newaxis]
    if not np.isfinite(sensitivities).all():
        return None
    damping = inverse.refinement_.prior.width**-2.0 * ROWS_PER_DEGREE / n_rows
    for part in mappers:
        part.set_params(sensitivities=sensitivities, damping=damping)
    return damped_inverse(sensitivities, damping / ROWS_PER_DEGREE)


def box_of(inverse: BaseEstimator) -> Box | None:
    """Bounds of the first `InverseSurrogate` that an inverse is or holds, if it has a model."""
    for part in (inverse, *inverse.get_params().values()):
        if isinstance(part, InverseSurrogate) and part.model is not None:
            names = tuple(part.model.parameter_names)
            return Box(check_bounds(part.bounds, names), names)
    return None


def passthrough() -> FunctionTransformer:
    """A transformer that returns its input unchanged, arrays and frames alike."""
    return FunctionTransformer().set_output(transform="default")
