"""Measured mode shapes in the chain: columns beside the frequencies, and what the prior keeps from their parameters."""

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
    modes = column_names(F, "f")
    names = [*modes, *(f"{mode}_dof{dof}" for mode in modes for dof in inputs.dofs)]
    return frame_like(F, np.hstack([as_floats(F), components]), names)


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
