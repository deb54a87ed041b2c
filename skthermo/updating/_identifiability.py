"""How strongly parameters change frequencies, and which of them measured modes identify."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
import pandas as pd
import scipy.linalg
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import connected_components
from sklearn.utils import Bunch

from skthermo._core.arrays import (
    HUGE,
    Array,
    check_model,
    check_noise,
    check_theta,
    cramer_rao,
    is_real,
    real_array,
)
from skthermo._core.text import SPACE, counted, listed
from skthermo.fem import FEModel, linearise, linearise_modes
from skthermo.updating._residuals import tangent_derivatives


def sensitivity(model: FEModel, theta: ArrayLike | None = None, *, step: float | None = None) -> pd.DataFrame:
    """Normalised sensitivities of frequencies to parameters, equation (A.1) [KCM26]_.

    Parameters
    ----------
    model : FE model
        Derivatives are exact if it gives them, as `~skthermo.fem.AffineModel` does; else central differences.
    theta : array-like of shape (n_parameters,), optional
        Multipliers at which to differentiate; 1 by default.
    step : float, optional
        Relative step of central differences, eq. (A.2), of any model, as of `~skthermo.fem.linearise`.

    Returns
    -------
    DataFrame of shape (n_modes, n_parameters)
        S_ij = (theta_j / f_i) d f_i / d theta_j, in rows f1, f2, ... and the parameters' columns.

    Raises
    ------
    ValueError
        If the model is none, has no frequencies at theta, or theta or step is not valid.

    See Also
    --------
    skthermo.fem.linearise : The same at many theta, as an array.
    select_parameters : Parameters that change some mode enough.
    identifiability : Parameters that measured modes can identify.

    Notes
    -----
    Eq. (A.2) is S_ij = (f_i(theta_j + h) - f_i(theta_j - h)) / (2 step f_i) with h = step theta_j. Where the model has
    no frequencies on one side, the difference to theta itself takes its place.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.updating import sensitivity
    >>> sensitivity(make_truss()).loc["f1"].round(3)
    bottom      0.233
    top         0.212
    diagonal    0.054
    vertical    0.001
    Name: f1, dtype: float64
    """
    row = theta_or_nominal(model, theta)
    frequencies, slopes = linearise(model, row, relative=True, step=step)
    if not np.isfinite(frequencies).all():
        raise ValueError(
            f"the model has the frequencies {frequencies[0]} at theta = {row[0].tolist()}; expected numbers"
        )
    return pd.DataFrame(slopes[0], [f"f{i + 1}" for i in range(model.n_modes)], list(model.parameter_names))


def select_parameters(S: pd.DataFrame, threshold: float = 0.1) -> list[str]:
    """Parameters that change at least one frequency enough.

    Parameters
    ----------
    S : DataFrame of shape (n_modes, n_parameters)
        Normalised sensitivities.
    threshold : float, default=0.1
        Smallest \\|S\\| that must be reached in some mode.

    Returns
    -------
    list of str
        Names in the order of the columns.

    Raises
    ------
    ValueError
        If S is not a frame of numbers, or the threshold not a number of zero or more.

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.updating import select_parameters, sensitivity
    >>> select_parameters(sensitivity(make_truss()))
    ['bottom', 'top', 'diagonal']
    """
    if not isinstance(S, pd.DataFrame):
        raise ValueError(f"S is a {type(S).__name__}; expected a DataFrame whose columns are parameters")
    values = real_array(S, "S")
    if not values.size or not np.isfinite(values).all() or S.columns.has_duplicates:
        raise ValueError(
            f"S has shape {values.shape} and the columns {list(S.columns)}; expected finite sensitivities of different "
            "parameters"
        )
    if not is_real(threshold) or not 0 <= threshold < HUGE:
        raise ValueError(f"threshold is {threshold!r}; expected a number of zero or more, such as 0.1")
    return [*S.columns[(np.abs(values) >= threshold).any(axis=0)]]


def theta_or_nominal(model: FEModel, theta: ArrayLike | None) -> Array:
    """One checked row of multipliers, all 1 by default."""
    check_model(model)
    names = model.parameter_names
    return check_theta(np.ones(len(names)) if theta is None else theta, names, one_row=True)


class Identifiability(Bunch):
    """Result of `identifiability`."""

    rank: int
    n_modes: int
    n_dofs: int
    sensitivity: pd.DataFrame
    singular_values: Array
    condition_number: float
    deviations: pd.Series
    collinear: list[list[str]]
    recommended: list[str]

    def summary(self) -> str:
        """How many parameters the modes can distinguish, and which, in a few sentences.

        Returns
        -------
        str
            One line for each sentence.
        """
        return "\n".join(self._sentences()).replace(SPACE, " ")

    def __repr__(self) -> str:
        percent = (100 * self.deviations).round(2).rename("smallest deviation (%)")
        return f"{self.summary()}\n\n{percent.to_frame().to_string()}"

    def _sentences(self) -> Iterator[str]:
        names = list(self.deviations.index)
        shapes = f" with their shapes at {counted(self.n_dofs, 'degree')} of freedom" if self.n_dofs else ""
        yield f"{counted(len(names), 'parameter')}, {counted(self.n_modes, 'mode')}{shapes}."
        if self.rank < len(names):
            more = "more degrees of freedom" if self.n_dofs else "shapes"
            yield (
                f"At most {self.rank} of the {len(names)} parameters are identifiable together. Records in other "
                f"weather do not help, since weather changes the parameters; expected fewer parameters, more modes, "
                f"{more}, or a prior."
            )
        for group in self.collinear:
            yield f"Cannot be distinguished: {listed(group)}."
        within = "a standard deviation of at most 10 % at this noise"
        if self.recommended:
            others = " if the others are known" if len(self.recommended) < len(names) else ""
            yield f"Identifiable together with {within}{others}: {listed(self.recommended)}."
        else:
            yield f"No parameter is identifiable with {within}."


def identifiability(
    model: FEModel,
    theta: ArrayLike | None = None,
    *,
    noise: ArrayLike,
    dofs: ArrayLike | None = None,
    shape_noise: float | None = None,
) -> Identifiability:
    """Which parameters measured modes can identify, and how accurately.

    Parameters
    ----------
    model : FE model
        If it gives no derivatives, they are central differences.
    theta : array-like of shape (n_parameters,), optional
        Multipliers at which to differentiate; 1 by default.
    noise : float or array-like of shape (n_modes,)
        Relative standard deviation of the measured frequencies. For a mean of n records, divide the deviation of one
        record by sqrt(n).
    dofs : array-like of int of shape (n_dofs,), or list of (node, direction), optional
        Degrees of freedom, by position, the first being 0, or by label, where mode shapes are measured too. The model
        needs a method ``modes`` or ``local_modes``, as `~skthermo.fem.AffineModel` has.
    shape_noise : float, optional
        Standard deviation of a shape's components as a share of their root mean square.

    Returns
    -------
    Bunch
        With the method ``summary()``, which says the same in sentences, and the attributes

        - ``rank``: number of parameters identifiable together, without measured shapes at most the number of modes;
        - ``n_modes``, ``n_dofs``: number of modes, and of degrees of freedom where their shapes are measured;
        - ``sensitivity``: d ln f / d ln theta, a frame of shape (n_modes, n_parameters);
        - ``singular_values``, ``condition_number``: of the sensitivities, each row multiplied by the root mean square
          noise over its own noise, with rows of shapes below where these are measured. The condition number is
          infinite if there are more parameters than rows;
        - ``deviations``: smallest possible relative standard deviation of each parameter's estimate when all
          are estimated (Cramer-Rao), a series; infinite where it cannot be distinguished from others;
        - ``collinear``: lists of parameters whose effects differ only by a factor (cosine of 0.99 or more);
        - ``recommended``: parameters that can be estimated together, the others held, with deviations of
          at most 0.1, most informative first.

    Raises
    ------
    ValueError
        If noise is negative or zero for some modes only, just one of ``dofs`` and ``shape_noise`` is given, or the
        model has no method ``modes`` or ``local_modes`` where they are.

    See Also
    --------
    ModelUpdater : Its ``covariance_`` is the same bound, at the optimum.

    Notes
    -----
    With A = (d ln f / d ln theta) / noise, an unbiased estimate of ln theta has at least the covariance
    (A' A)^-1 ([Kay93]_, chapter 3). A shape of length 1 at n_d degrees of freedom adds its derivative in rows, divided
    by shape_noise / sqrt(n_d). Parameters are ranked by QR factorisation of A with column pivoting ([GV13]_, section
    5.4.2).

    Examples
    --------
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.updating import identifiability
    >>> identifiability(make_truss(), noise=0.001).recommended
    ['diagonal', 'bottom', 'top']

    Three modes do not identify four parameters:

    >>> print(identifiability(make_truss(n_modes=3), noise=0.001).summary())
    4 parameters, 3 modes.
    At most 3 of the 4 parameters are identifiable together. Records in other weather do not help, since weather changes
    the parameters; expected fewer parameters, more modes, shapes, or a prior.
    Identifiable together with a standard deviation of at most 10 % at this noise if the others are known: bottom,
    diagonal and top.
    """
    check_model(model)
    names = list(model.parameter_names)
    S = sensitivity(model, theta)
    deviations = check_noise(noise, model.n_modes)
    if deviations.any() and not deviations.all():
        raise ValueError(f"noise is {deviations}; expected it positive for all modes, or zero for all")
    if (dofs is None) != (shape_noise is None):
        raise ValueError("expected both dofs and shape_noise, or neither")
    if dofs is not None and not deviations.any():
        raise ValueError("noise is 0; expected it positive where shapes are measured too")
    level = np.sqrt(np.mean(deviations**2))
    rows = S.to_numpy() * (level / deviations if level else np.ones(model.n_modes))[:, np.newaxis]
    if dofs is not None:
        rows = np.vstack([rows, level * _shape_rows(model, theta, dofs, shape_noise)])

    values = np.linalg.svd(rows, compute_uv=False)
    smallest = values[-1] if len(values) == len(names) else 0.0
    ranking = scipy.linalg.qr(rows, mode="r", pivoting=True)[1]
    return Identifiability(
        rank=int((values > 1e-6 * values[0]).sum()),
        n_modes=model.n_modes,
        n_dofs=0 if dofs is None else len(dofs),
        sensitivity=S,
        singular_values=values,
        condition_number=float(values[0] / smallest) if smallest else np.inf,
        deviations=pd.Series(_deviations(rows, level), names),
        collinear=[[names[i] for i in group] for group in collinear_groups(rows)],
        recommended=[names[i] for i in _recommended(rows, ranking, level)],
    )


def _shape_rows(model: FEModel, theta: ArrayLike | None, dofs: ArrayLike, shape_noise: float | None) -> Array:
    """Derivatives of unit shapes with respect to ln theta, divided by their noise."""
    if not is_real(shape_noise) or not 0 < shape_noise < HUGE:
        raise ValueError(f"shape_noise is {shape_noise!r}; expected a positive number, such as 0.01 for 1 %")
    row = theta_or_nominal(model, theta)
    shapes, d_shapes = (array[0] for array in linearise_modes(model, row, dofs)[2:])
    slopes = tangent_derivatives(shapes, d_shapes, shapes / np.linalg.norm(shapes, axis=0)) * row[0]
    return slopes.reshape(-1, row.shape[1]) * np.sqrt(len(shapes)) / shape_noise


def _deviations(rows: Array, level: float) -> Array:
    deviations = np.sqrt(np.diagonal(cramer_rao(rows.T @ rows)))
    known = np.isfinite(deviations)
    deviations[known] *= level
    return deviations


def _recommended(rows: Array, ranking: NDArray[np.intp], level: float) -> NDArray[np.intp]:
    """Longest prefix of the ranking whose parameters can be estimated well together."""
    for size in range(len(ranking), 0, -1):
        if (_deviations(rows[:, ranking[:size]], level) <= 0.1).all():
            return ranking[:size]
    return ranking[:0]


def collinear_groups(rows: Array) -> list[NDArray[np.intp]]:
    """Groups of two or more columns that point almost the same way, or the opposite way: by a cosine of 0.99."""
    lengths = np.linalg.norm(rows, axis=0)
    nonzero = np.flatnonzero(lengths > 0)
    directions = rows[:, nonzero] / lengths[nonzero]
    labels = connected_components(csr_array(np.abs(directions.T @ directions) >= 0.99), directed=False)[1]
    groups = (nonzero[labels == label] for label in np.unique(labels))
    return [group for group in groups if len(group) > 1]
