"""The part of the inverse surrogate that simulates what it learns from."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import check_bounds, check_noise
from skthermo._arrays import Array
from skthermo._models import check_model
from skthermo._validation import check_is_fitted
from skthermo._warnings import warn_user
from skthermo.fem import evaluate
from skthermo.surrogate._box import Box
from skthermo.surrogate._inverse_inputs import InverseInputs
from skthermo.surrogate._memory import ORDER_CHECKS, remembered_simulations
from skthermo.surrogate._refined_inverse import RefinedInverse
from skthermo.surrogate._simulator import Simulator, tolerance

MANY_REORDERED = 0.1
"""Share of simulations with modes in another order above which a warning is given. A share of 5 % does not harm the
truss's results; 29 % doubles the error of Z24."""


MIDDLE = (0.5, 99.5)
"""Percentiles of the records' parameters that a narrower box is made for: a few wrong records do not widen it."""

LEAST_HALF_WIDTH = 0.02
"""Smallest half-width of a narrower box, as a share of its middle."""


def narrower(bounds: Array, theta: Array) -> Array:
    """The range of the parameters of records and half of it on either side, within the bounds; (n_parameters, 2)."""
    lowest, highest = np.nanpercentile(theta, MIDDLE, axis=0)
    middle = np.clip((lowest + highest) / 2, *bounds.T)
    half = np.maximum(highest - lowest, LEAST_HALF_WIDTH * middle)
    return np.column_stack([np.maximum(middle - half, bounds[:, 0]), np.minimum(middle + half, bounds[:, 1])])


class SimulatedTraining(InverseInputs, RefinedInverse):
    """The part of `InverseSurrogate` that draws its samples, and checks what it has learned from them."""

    narrow_bounds: bool
    parameter_names_: list[str] | None

    def round_trip(self) -> Array:
        """Relative errors of the model's nominal frequencies after inversion and another solution.

        Such an error goes into everything that is simulated with the parameters found.

        Returns
        -------
        ndarray of shape (n_modes,)
            At the nominal state or, where that is outside the box of the samples, at the nearest one inside.

        Raises
        ------
        ValueError
            If the estimator has no model.

        Examples
        --------
        >>> import numpy as np
        >>> from skthermo.datasets import make_truss
        >>> from skthermo.surrogate import InverseSurrogate
        >>> inverse = InverseSurrogate(make_truss(), refine=0, random_state=0).fit()
        >>> bool(1e-4 < np.abs(inverse.round_trip()).max() < 1e-2)
        True
        """
        check_is_fitted(self)
        if self.model is None:
            raise ValueError("InverseSurrogate has no model; expected an FE model to turn parameters into frequencies")
        state = np.ones((1, self.n_parameters_))
        nominal = self._of_parameters(state if self.box_ is None else np.clip(state, *self.box_.bounds.T))
        theta = self._estimate(nominal)[0]
        if self.n_steps_:
            theta = self.refinement_.refined(nominal, theta, self.scatter_).theta
        return (evaluate(self.model, theta) / nominal[:, : self.model.n_modes] - 1)[0]

    def _simulate(self, X: Any, random: np.random.RandomState) -> tuple[NDArray, NDArray]:
        check_model(self.model)
        model = self.model
        self._check_columns(X)
        check_noise(self.noise, model.n_modes)
        n_parameters = len(model.parameter_names)
        if n_parameters > model.n_modes:
            warn_user(
                f"{n_parameters} parameters and {model.n_modes} modes: frequencies cannot tell the parameters apart; "
                f"expected more modes{'' if np.all(self.noise) else ', or the noise of the measurement'}: the prior "
                "decides between them",
                "few modes",
            )
        self.box_ = Box(check_bounds(self.bounds, model.parameter_names), tuple(model.parameter_names))
        is_remembered = self.memory is not None and self.random_state is None
        seed = 0 if is_remembered else random.randint(np.iinfo(np.int32).max)
        tol = tolerance(self.model, self.reduce)
        drawn, share_reordered, reduced = remembered_simulations(
            self.memory, model, self.bounds, self.n_samples, tol, dofs=self.dofs, n_jobs=self.n_jobs, seed=seed
        )
        if share_reordered > MANY_REORDERED:
            warn_user(
                f"modes change their order in {share_reordered:.1%} of {min(self.n_samples, ORDER_CHECKS)} samples of "
                "the box, and the model sorts them: expected narrower bounds, or a model with track=True",
                "order of modes",
            )
        self.samples_ = drawn
        self.simulator_ = Simulator(model, reduced, self.box_.bounds)
        self.parameter_names_ = list(model.parameter_names)
        self.y_is_vector_ = False
        return self._noisy(drawn, random), drawn.theta

    def _simulate_narrower(self, X: ArrayLike | None, random: np.random.RandomState) -> tuple[NDArray, NDArray]:
        """Samples from the part of the box where the records have their parameters."""
        estimates = np.empty((0, 1)) if X is None else self._estimate(self._read_inputs(X))[0]
        n_known = np.count_nonzero(~np.isnan(estimates).any(axis=1))
        if n_known < 2:
            raise ValueError(
                f"narrow_bounds is set, but fit got {n_known} records with all modes; expected at least 2, whose "
                "parameters the bounds are narrowed to"
            )
        names = tuple(self.model.parameter_names)
        self.box_ = Box(narrower(self.box_.bounds, estimates), names)
        is_remembered = self.memory is not None and self.random_state is None
        seed = 1 if is_remembered else random.randint(np.iinfo(np.int32).max)
        model = self.simulator_.reduced or self.model
        self.samples_ = remembered_simulations(
            self.memory, model, self.box_.bounds, self.n_samples, None, dofs=self.dofs, n_jobs=self.n_jobs, seed=seed
        )[0]
        return self._noisy(self.samples_, random), self.samples_.theta
