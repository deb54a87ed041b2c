"""Frequencies of the structure under any weather: healthy, damaged or otherwise changed, with noise."""

from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any, Literal, overload

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import check_noise
from skthermo._arrays import Array, MatrixLike, as_floats, as_random_state, real_array
from skthermo._frames import check_same_rows, frame_like
from skthermo._validation import check_is_fitted
from skthermo._warnings import warn_user
from skthermo.surrogate._simulator import Simulator

LARGE_FACTOR = 10.0
"""Factor of a parameter that was perhaps meant in percent."""


class ChainSimulation:
    """Methods of the chain that simulate records."""

    @overload
    def simulate(
        self,
        X: pd.DataFrame,
        *,
        damage: Mapping[str, float | ArrayLike] | None = None,
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
        noise: ArrayLike | Literal["fitted"] = 0.0,
        random_state: int | np.random.RandomState | None = None,
    ) -> pd.DataFrame: ...
    @overload
    def simulate(
        self,
        X: ArrayLike,
        *,
        damage: Mapping[str, float | ArrayLike] | None = None,
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
        noise: ArrayLike | Literal["fitted"] = 0.0,
        random_state: int | np.random.RandomState | None = None,
    ) -> Array: ...
    def simulate(
        self,
        X: ArrayLike,
        *,
        damage: Mapping[str, float | ArrayLike] | None = None,
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
        noise: ArrayLike | Literal["fitted"] = 0.0,
        random_state: int | np.random.RandomState | None = None,
    ) -> Array | pd.DataFrame:
        """Frequencies of the structure, healthy or damaged, as monitoring would record them, equation (8).

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        damage : mapping of str to float or array-like of shape (n_samples,), optional
            Severity by damage group of the model: 0.5 halves the stiffness, -0.15 adds 15 %. A vector gives each row
            its own severity, for damage that grows.
        parameters : mapping of str to float, optional
            Factor by parameter of the model, which multiplies the values that belong to the temperatures.
        stiffness : matrix of shape (n_dof, n_dof), optional
            Stiffness added to the model's in N/m, as by a retrofit.
        mass : matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
            Mass added to the model's in kg; a vector holds lumped masses.
        noise : float, array-like of shape (n_modes,) or "fitted", default=0.0
            Relative standard deviation of Gaussian noise on the frequencies. With "fitted", each row gets the relative
            residuals of a whole training record of similar weather: their scatter out of fold, around the mean that
            the fit leaves in such weather. So modes scatter together, scatter more in frost, and are missing as in the
            training records. Runs of consecutive records are drawn if residuals are serially correlated; rows of X
            should then be in order of time.
        random_state : int, RandomState or None, default=None
            Seed of the noise.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_modes)
            In Hz, in the measured domain.

        Raises
        ------
        ValueError
            If a damage group or a parameter is unknown, a severity is 1 or more, a factor is not positive, or the
            model cannot be changed in this way.

        Warns
        -----
        UserWarning
            If a factor is above 10, which may be meant in percent.

        References
        ----------
        Politis & Romano, The stationary bootstrap, Journal of the American Statistical Association 89 (1994) 1303-1313
        [PR94]_, for runs of consecutive residuals.
        """
        check_is_fitted(self)
        changes = {"damage": damage, "parameters": parameters, "stiffness": stiffness, "mass": mass}
        frequencies = self._frequencies(X, **changes)
        frequencies *= 1 + self.draw_noise(X, noise, random_state=random_state)
        return frame_like(X, frequencies, self.mode_names_)

    def draw_noise(
        self,
        X: ArrayLike,
        noise: ArrayLike | Literal["fitted"] = "fitted",
        *,
        random_state: int | np.random.RandomState | None = None,
    ) -> Array:
        """Relative noise, as `simulate` puts it on the frequencies.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        noise : float, array-like of shape (n_modes,) or "fitted", default="fitted"
            As in `simulate`.
        random_state : int, RandomState or None, default=None
            Seed of the noise.

        Returns
        -------
        ndarray of shape (n_samples, n_modes)
            What is added to 1 and multiplied with the frequencies; NaN where a drawn record lacks a mode.

        Raises
        ------
        ValueError
            If the noise is neither "fitted" nor relative standard deviations.
        """
        check_is_fitted(self)
        random = as_random_state(random_state)
        if isinstance(noise, str):
            if noise != "fitted":
                raise ValueError(f'noise is {noise!r}; expected "fitted" or relative standard deviations')
            return self._fitted_noise(X, random)
        shape = (np.shape(X)[0], len(self.mode_names_))
        return check_noise(noise, shape[1]) * random.standard_normal(shape)

    def simulate_modes(
        self,
        X: ArrayLike,
        modes: Sequence[int],
        *,
        damage: Mapping[str, float | ArrayLike] | None = None,
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
    ) -> Array:
        """Frequencies of other modes than the measured ones, without noise and as the model gives them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_sensors)
            Temperatures in degrees Celsius.
        modes : sequence of int
            Ranks of modes of the healthy nominal model, the lowest being 0.
        damage : mapping of str to float or array-like of shape (n_samples,), optional
            As in `simulate`.
        parameters : mapping of str to float, optional
            As in `simulate`.
        stiffness : matrix of shape (n_dof, n_dof), optional
            As in `simulate`.
        mass : matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
            As in `simulate`.

        Returns
        -------
        ndarray of shape (n_samples, n_chosen)
            In Hz, in the numerical domain: no aligner knows how these modes differ from measured ones.

        Raises
        ------
        ValueError
            As in `simulate`; if the model has no such modes.
        """
        check_is_fitted(self)
        changes = {"damage": damage, "parameters": parameters, "stiffness": stiffness, "mass": mass}
        return self._numerical(self.simulator_.changed("with_modes", modes), X, **changes)

    def _frequencies(self, X: ArrayLike, **changes: Any) -> NDArray[np.float64]:
        """Frequencies of the changed structure at given temperatures, in the measured domain."""
        check_is_fitted(self)
        return as_floats(self.aligner_.inverse_transform(self._numerical(self.simulator_, X, **changes)))

    def _numerical(
        self,
        simulator: Simulator,
        X: ArrayLike,
        damage: Mapping[str, float | ArrayLike] | None = None,
        parameters: Mapping[str, float] | None = None,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
    ) -> NDArray[np.float64]:
        """The same in the numerical domain."""
        if stiffness is not None or mass is not None:
            simulator = simulator.changed("with_added", stiffness=stiffness, mass=mass)
        theta = self._predict_theta(X) * self._factors(parameters)
        fixed, growing = _split(damage, X)
        simulator = simulator.damaged(fixed)
        if growing:
            severities = np.column_stack(list(growing.values()))
            simulator = simulator.with_damage_parameters(list(growing), severities.min(), severities.max())
            theta = np.hstack([theta, 1 - severities])
        return simulator.frequencies(theta, self.n_jobs)

    def _factors(self, parameters: Mapping[str, float] | None) -> Array:
        """The factor of every parameter."""
        factors = dict.fromkeys(self.parameter_names_, 1.0)
        for name, factor in (parameters or {}).items():
            if name not in factors:
                raise ValueError(f"parameter {name!r} is unknown; expected some of {self.parameter_names_}")
            if not isinstance(factor, Real) or not 0 < factor < np.inf:
                raise ValueError(f"the factor of parameter {name!r} is {factor!r:.100}; expected a positive number")
            if factor > LARGE_FACTOR:
                warn_user(
                    f"the factor of parameter {name!r} is {factor:g}; expected a factor, such as 1.02 for 2 % more, "
                    "and not percent",
                    "large factor",
                )
            factors[name] = float(factor)
        return np.array(list(factors.values()))


def _split(
    damage: Mapping[str, float | ArrayLike] | None, X: ArrayLike
) -> tuple[dict[str, float], dict[str, NDArray[np.float64]]]:
    """Severities that are the same in all rows, and those with a value for each row."""
    if damage is not None and not isinstance(damage, Mapping):
        raise ValueError(f"damage is {damage!r}; expected a mapping of group to severity")
    fixed: dict[str, Any] = {}
    growing: dict[str, NDArray[np.float64]] = {}
    n_rows = np.shape(X)[0]
    for group, severity in (damage or {}).items():
        if np.ndim(severity) == 0:
            fixed[group] = severity
            continue
        values = real_array(severity, f"damage of group {group!r}")
        if values.shape != (n_rows,) or not (values < 1).all() or not np.isfinite(values).all():
            raise ValueError(
                f"damage of group {group!r} has shape {values.shape} and highest value {values.max(initial=0)}; "
                f"expected one severity or {n_rows}, one for each row, finite and below 1"
            )
        check_same_rows(X, severity, ("temperatures", f"damage of group {group!r}"))
        growing[group] = values
    return fixed, growing
