"""The part of the inverse surrogate that refines the regressor's estimates on the FE model."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from sklearn.utils import Bunch

from skthermo._arrays import Array, as_floats
from skthermo._frames import frame_like
from skthermo._validation import check_is_fitted
from skthermo._warnings import warn_user
from skthermo.surrogate._box import Box
from skthermo.surrogate._refinement import DEFAULT_STEPS, Refinement
from skthermo.surrogate._regression import MultiplierRegressor

MANY_UNCONVERGED = 0.01
"""Share of rows that have not converged above which a warning is given; the report of a chain always counts them."""


def unconverged(found: Bunch) -> NDArray[np.bool_]:
    """Rows with frequencies whose refinement has not converged."""
    return ~found.converged & (found.weight > 0)


class RefinedInverse(MultiplierRegressor):
    """Methods of `InverseSurrogate` that refine estimates, and their private steps."""

    model: Any
    dofs: ArrayLike | None
    refine: int | None
    prior: Any
    box_: Box | None
    n_steps_: int
    refinement_: Refinement
    scatter_: Array

    def invert(self, X: ArrayLike) -> Bunch:
        """Parameters of measured frequencies, and how sure they are.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz and, with ``dofs``, components of shapes; NaN is allowed.

        Returns
        -------
        Bunch
            - ``theta`` (n_samples, n_parameters): the multipliers, NaN in rows without any mode, and in rows with a
              missing mode that have stalled;
            - ``std`` (n_samples, n_parameters): their posterior standard deviations by Laplace's approximation, given
              ``scatter_`` and the prior; those of the prior in rows that have stalled;
            - ``residuals`` (n_samples, n_modes): ln f measured minus ln f of the model at theta, NaN where a mode is
              missing and in rows that have stalled;
            - ``weight`` (n_samples,): mean precision of the parameters as a share of what all modes would give, 1 in
              complete rows and 0 in rows without any mode;
            - ``converged`` (n_samples,): whether the steps have converged. Rows that have run out of steps keep what
              they have reached; rows that have stalled keep the regressor's estimate;
            - ``outside`` (n_samples, n_parameters): whether a parameter contradicts the prior: farther from the middle
              of the bounds than their whole width, and by more than its uncertainty explains.

        Raises
        ------
        ValueError
            If the estimator does not refine.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> from skthermo.surrogate import InverseSurrogate
        >>> model = make_truss()
        >>> inverse = InverseSurrogate(model, bounds=0.2, noise=0.001, random_state=0).fit()
        >>> found = inverse.invert(model.frequencies([[0.95, 1.05, 0.9, 1.0]]))
        >>> found.theta.round(3), found.std.round(3)
        (array([[0.95 , 1.05 , 0.9  , 1.001]]), array([[0.006, 0.008, 0.002, 0.095]]))
        """
        check_is_fitted(self)
        if not self.n_steps_:
            raise ValueError(
                f"refine is {self.refine}, which means no steps for {self.model!r}; expected a positive number of steps"
            )
        inputs = self._read_inputs(X)
        found = self.refinement_.refined(inputs, self._estimate(inputs)[0], self.scatter_)
        names = self.get_feature_names_out()
        found.update(theta=frame_like(X, found.theta, names), std=frame_like(X, found.std, names))
        return found

    def warn_of(self, found: Bunch) -> None:
        """Warn if many rows have not converged or are far outside the bounds.

        Parameters
        ----------
        found : Bunch
            What `invert` has given.
        """
        theta = as_floats(found.theta)
        rows = np.flatnonzero(unconverged(found))
        if rows.size > MANY_UNCONVERGED * len(theta):
            warn_user(
                f"{rows.size} of {len(theta)} rows did not converge in {self.n_steps_} steps, row {rows[0]} the first: "
                "they keep what they reached, or the regressor's estimate",
                "not converged",
            )
        self._warn_of_box(theta, found.outside)

    def _warn_of_box(self, theta: Array, far: NDArray[np.bool_]) -> None:
        message = "" if self.box_ is None else self.box_.warning(theta, far)
        if message and self.prior is not None:
            message += "; or a wider prior, which these rows contradict"
        if message:
            warn_user(message, "outside the bounds")

    def _scatter(self, X: ArrayLike | None) -> Array:
        """Relative standard deviations of the frequencies, given or estimated from the records that `fit` saw."""
        measured = np.ones((0, self.n_features_in_)) if X is None else self._read_inputs(X)
        return self.refinement_.estimated_scatter(measured, self._estimate(measured)[0])

    def _n_steps(self) -> int:
        """Number of steps of the refinement: those asked for, else some where derivatives are exact."""
        if self.model is None:
            if self.refine:
                raise ValueError(f"refine is {self.refine} without a model; expected an FE model to refine on")
            return 0
        is_differentiable = hasattr(self.model, "linearised") or hasattr(self.model, "jacobian")
        if self.dofs is not None:
            is_differentiable = hasattr(self.model, "linearised_modes")
        return (DEFAULT_STEPS if is_differentiable else 0) if self.refine is None else int(self.refine)

    def _predict_arrays(self, X: ArrayLike, return_std: bool = False) -> tuple[NDArray, NDArray]:
        check_is_fitted(self)
        if not self.n_steps_:
            return super()._predict_arrays(X, return_std)
        found = self.invert(X)
        self.warn_of(found)
        return as_floats(found.theta), as_floats(found.std)
