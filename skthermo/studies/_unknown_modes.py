"""Modes that depend on parameters which the measured modes do not determine."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from skthermo._arrays import Array, as_floats
from skthermo._warnings import warn_user
from skthermo.fem import linearise
from skthermo.studies._world import mode_name

DOUBTFUL = 2.0
"""Standard deviation of a mode as the measured ones predict it, in units of theirs, from which its gain is doubtful."""


def warn_of_unknown_modes(fem: Any, ranks: Sequence[int]) -> None:
    """Warn of modes whose frequencies the parameters of the chain predict badly."""
    theta = np.nanmean(as_floats(fem.parameters_), axis=0, keepdims=True)
    measured = _slopes(fem.model, theta)
    for rank, slope in zip(ranks, _slopes(fem.model.with_modes(ranks), theta), strict=True):
        weights = slope @ np.linalg.pinv(measured)
        deviation = np.linalg.norm(weights) if np.allclose(weights @ measured, slope, atol=1e-6) else np.inf
        if deviation > DOUBTFUL:
            warn_user(
                f"{mode_name(rank)} depends on parameters that the measured modes hardly determine: predicted from one "
                f"record, its frequency scatters {deviation:.1f} times as much as theirs, and its gain is doubtful",
                f"unknown {mode_name(rank)}",
            )


def _slopes(model: Any, theta: Array) -> Array:
    """d ln f / d ln theta at one theta, (n_modes, n_parameters)."""
    frequencies, jacobian = linearise(model, theta)
    return jacobian[0] * theta / frequencies[0][:, np.newaxis]
