"""Bounds and priors of parameter multipliers."""

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from skthermo._arrays import Array, Bounds, by_parameter, real_array


def check_bounds(bounds: Bounds, parameter_names: Sequence[str]) -> Array:
    """Lowest and highest multiplier of every parameter.

    Parameters
    ----------
    bounds : float, array-like of shape (n_parameters, 2), or mapping of str to float or pair of floats
        A half-width (0.2 means 1 +- 20 %), lowest and highest multiplier of each parameter, or a mapping from each
        parameter to its half-width or to (lowest, highest).
    parameter_names : sequence of str
        The parameters.

    Returns
    -------
    ndarray of shape (n_parameters, 2)
        Lowest and highest multipliers.

    Raises
    ------
    ValueError
        If a half-width is not between 0 and 1, the shape is wrong, a lowest multiplier is
        not positive or not below the highest, or a mapping leaves out a parameter or names an unknown one.

    Examples
    --------
    >>> from skthermo.fem import check_bounds
    >>> check_bounds(0.2, ["E_deck", "E_arch"])
    array([[0.8, 1.2],
           [0.8, 1.2]])
    >>> check_bounds({"E_arch": (0.9, 1.5), "E_deck": 0.3}, ["E_deck", "E_arch"])
    array([[0.7, 1.3],
           [0.9, 1.5]])
    """
    names = list(parameter_names)
    if isinstance(bounds, Mapping):
        widths = by_parameter(bounds, names, "bounds")
        return np.vstack([check_bounds(_pair(width, name), [name]) for name, width in zip(names, widths, strict=True)])
    array = real_array(bounds, "bounds")
    if array.ndim == 0:
        if not 0 < array < 1:
            raise ValueError(f"bounds is {array}; expected a half-width between 0 and 1, such as 0.3")
        return np.tile([1 - array, 1 + array], (len(names), 1))
    if array.shape != (len(names), 2):
        raise ValueError(
            f"bounds has shape {array.shape}; expected a half-width or ({len(names)}, 2), lowest and highest "
            f"multipliers of {names}, or a mapping of these names"
        )
    for name, (lowest, highest) in zip(names, array, strict=True):
        if not 0 < lowest < highest < np.inf:
            raise ValueError(f"bounds of parameter {name!r} are [{lowest}, {highest}]; expected 0 < lowest < highest")
    return array


def check_prior(prior: ArrayLike | Mapping[str, float], parameter_names: Sequence[str]) -> Array:
    """Standard deviation of the prior of every parameter.

    Parameters
    ----------
    prior : float, array-like of shape (n_parameters,) or mapping of str to float
        Relative standard deviations: a number, one for each parameter, or a mapping from each parameter to its own.
    parameter_names : sequence of str
        The parameters.

    Returns
    -------
    ndarray of shape (n_parameters,)
        Relative standard deviations.

    Raises
    ------
    ValueError
        If the shape is wrong, a value is not finite and above 0, or a mapping leaves out a parameter or names an
        unknown one.

    Examples
    --------
    >>> from skthermo.fem import check_prior
    >>> check_prior({"E_arch": 0.1, "E_deck": 0.3}, ["E_deck", "E_arch"])
    array([0.3, 0.1])
    """
    names = list(parameter_names)
    given = by_parameter(prior, names, "prior") if isinstance(prior, Mapping) else prior
    deviations = real_array(given, "prior")
    if deviations.shape not in ((), (len(names),)) or not ((deviations > 0) & np.isfinite(deviations)).all():
        raise ValueError(
            f"prior is {deviations}; expected relative standard deviations above 0, a number or one for each of {names}"
        )
    return np.broadcast_to(deviations, (len(names),))


def _pair(width: Any, name: str) -> Any:
    """A half-width, or lowest and highest as the only row."""
    if np.ndim(width) == 0:
        if not (isinstance(width, Real) and 0 < float(width) < 1):
            raise ValueError(
                f"bounds of parameter {name!r} are {width!r}; expected a half-width between 0 and 1, or (lowest, "
                "highest)"
            )
        return width
    if np.shape(width) != (2,):
        raise ValueError(f"bounds of parameter {name!r} are {width!r}; expected a half-width or (lowest, highest)")
    return [width]
