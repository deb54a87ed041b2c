"""Measured mode shapes in the chain: columns beside the frequencies, and what the prior keeps from their parameters."""

import warnings
from collections.abc import Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skthermo._arrays import Array, as_floats
from skthermo._frames import column_names, frame_like
from skthermo.fem import linearise_modes, shape_components
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._shape_inputs import ShapeInputs
from skthermo.surrogate._shape_misfit import MeasuredShapes

FEW_SHAPES = 0.5
"""Share of measured modes with a complete shape below which a warning is given."""

FOREIGN = 5.0
"""Distance of median components from those of the model, in deviations of the noise, from which they are foreign."""


def shape_inputs_of(inverse: Any) -> ShapeInputs | None:
    """How the first `InverseSurrogate` with ``dofs`` that an inverse is or holds reads shapes; None without one."""
    for part in (inverse, *inverse.get_params().values()):
        if isinstance(part, InverseSurrogate) and part.dofs is not None and part.model is not None:
            return ShapeInputs.of(part.model, part.dofs, part.shape_noise)
    return None


def with_shapes(inverse: Any, F: Any, shapes: ArrayLike | None) -> Any:
    """Frequencies with the columns of shapes that an inverse expects; NaN there without shapes.

    Raises
    ------
    ValueError
        If shapes are given to an inverse without ``dofs``, or have another size.
    """
    inputs = shape_inputs_of(inverse)
    if inputs is None:
        if shapes is not None:
            raise ValueError("shapes are given, but the inverse has no dofs; expected InverseSurrogate(dofs=...)")
        return F
    components = np.full((len(F), inputs.n_columns - inputs.n_modes), np.nan)
    if shapes is not None:
        components = shape_components(shapes, inputs.reference)
        if len(components) != len(F):
            raise ValueError(f"shapes have {len(components)} rows and frequencies {len(F)}; expected the same number")
    modes = [str(name) for name in column_names(F, "f")]
    if hasattr(F, "columns"):
        F = F.set_axis(modes, axis=1)
    names = [*modes, *(f"{mode}_dof{dof}" for mode in modes for dof in inputs.dofs)]
    return frame_like(F, np.hstack([as_floats(F), components]), names)


def shape_warnings(inverse: InverseSurrogate, aligned: Any) -> Iterator[tuple[str, str]]:
    """Warnings about measured shapes, which stand beside the frequencies: kind and text of each."""
    inputs, values = inverse.shape_inputs_, as_floats(aligned)
    n_modes, n_sensors = inputs.n_modes, inputs.n_sensors
    components = values[:, n_modes:].reshape(len(values), n_modes, n_sensors)
    found = ~np.isnan(values[:, :n_modes])
    n_shapes = (found & ~np.isnan(components).any(axis=2)).sum()
    names = column_names(aligned, "f")[:n_modes]
    if n_shapes < FEW_SHAPES * found.sum():
        yield (
            "few shapes",
            f"{n_shapes} of {found.sum()} measured modes have a component of their shape at each of the {n_sensors} "
            "sensors; the other shapes are not used: expected dofs without sensors that failed",
        )
    if not n_shapes or "shapes" not in inverse.samples_:
        return
    possible = shape_components(inverse.samples_.shapes.swapaxes(1, 2), inputs.reference).reshape(
        -1, n_modes, n_sensors
    )
    lowest, highest = possible.min(axis=0), possible.max(axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a mode without any shape
        median = np.nanmedian(components, axis=0)
    excess = np.nan_to_num(np.maximum(lowest - median, median - highest) / inputs.noise[:, np.newaxis])
    mode, sensor = np.unravel_index(excess.argmax(), excess.shape)
    if excess[mode, sensor] > FOREIGN:
        yield (
            "foreign shapes",
            f"measured shapes of {names[mode]!r} are unlike those of the model anywhere in its bounds: at sensor "
            f"{sensor} the median component is {median[mode, sensor]:.2f}, by the model {lowest[mode, sensor]:.2f} to "
            f"{highest[mode, sensor]:.2f}; expected the modes of the model, and sensors in the order of dofs, with the "
            "signs and gains of the model's axes, or a shape_noise that covers the model's error",
        )


def steps_without_prior(inverse: InverseSurrogate, theta: Array, n_rows: int) -> Array:
    """Steps of ln theta that take the prior's shrinkage out of posterior modes, (n_samples, n_parameters).

    At a posterior mode the derivatives of the observations times their residuals equal the pull of the prior. The step
    is a Gauss-Newton step of frequencies and shapes with the information of all of them at the nominal state, and with
    a prior as weak as suits the mean of all records.
    """
    inputs, prior = inverse.shape_inputs_, inverse.refinement_.prior
    frequencies, jacobian, shapes, slopes = linearise_modes(inverse.model, np.ones((1, theta.shape[1])), inputs.dofs)
    units = MeasuredShapes(shapes.swapaxes(1, 2) / np.linalg.norm(shapes, axis=1)[:, :, np.newaxis])
    rows = np.hstack([jacobian / frequencies[:, :, np.newaxis], units.misfit(shapes, slopes)[1]])
    weak = replace(prior, width=prior.width * np.sqrt(n_rows))
    information = weak.information(rows, np.append(inverse.scatter_, inputs.deviations)[np.newaxis])[0]
    pull = (np.log(theta) - prior.mean) / prior.width**2
    return np.linalg.solve(information, pull.T).T
