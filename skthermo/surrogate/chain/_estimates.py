"""Private steps of `DataInformedFEM`: fill gaps, invert, report; predict parameters, solve, undo the alignment."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arrays import Array, as_columns, as_floats
from skthermo._frames import frame_like
from skthermo._regressors import weights_for
from skthermo._validation import check_is_fitted, validate_data
from skthermo._warnings import warn_each, warn_user
from skthermo._weather import TrainingRange
from skthermo.surrogate._chain_parts import learn_frequencies, refining_step
from skthermo.surrogate._chain_shapes import shape_warnings, steps_without_prior, with_shapes
from skthermo.surrogate._inverse import InverseSurrogate
from skthermo.surrogate._mapper_inputs import last_step, mapper_inputs
from skthermo.surrogate._refined_inverse import unconverged
from skthermo.surrogate._report import fit_report
from skthermo.surrogate._simulator import Simulator, tolerance
from skthermo.surrogate._spread_rows import spread_rows

MARGIN, LEAST_MARGIN = 0.25, 0.05
"""Margin of a reduced model's box around the learned parameters: a share of their range, and of their values."""

FARTHEST = 5.0
"""Largest step of ln theta that takes the prior's shrinkage out."""

NOT_NOISE = 0.1
"""Relative residual of a frequency from which it is that of a wrong model or a wrong record."""

SCARCE = 0.25
"""Mean weight of records with gaps below which a warning is given: four of six modes missing in each, say."""

POSSIBLE = (1e-6, 1e6)
"""Range of multipliers; outside it rounding errors swamp the model's matrices."""


class ChainSteps:
    """Private steps that the public methods of the chain call."""

    def _temperatures(self, X: ArrayLike) -> Any:
        """Temperatures, checked; a frame stays a frame."""
        check_is_fitted(self)
        return frame_like(X, validate_data(self, X, dtype=np.float64, ensure_all_finite="allow-nan", reset=False))

    def _predict_theta(self, X: ArrayLike) -> NDArray[np.float64]:
        T = self._temperatures(X)
        message = self.training_range_.warning(mapper_inputs(self.mapper_, T))
        if message:
            warn_user(message, "foreign weather")
        theta, impossible = self._possible(self.mapper_.predict(T))
        if impossible.any():
            row = np.flatnonzero(impossible)[0]
            warn_user(
                f"in {impossible.sum()} of {len(theta)} rows, row {row} the first, the mapper gave multipliers outside "
                f"{POSSIBLE[0]:g} to {POSSIBLE[1]:g}: these rows are NaN",
                "impossible parameters",
            )
        return theta

    def _possible(self, theta: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
        """Parameters, with NaN in rows with impossible values, and a mask of those rows."""
        theta = as_columns(theta).copy()
        impossible = ((theta < POSSIBLE[0]) | (theta > POSSIBLE[1])).any(axis=1)
        theta[impossible] = np.nan
        return theta, impossible

    def _simulator(self, learned: NDArray[np.float64]) -> Simulator:
        """The model and, with ``reduce``, its reduced model for a box around the training parameters."""
        tol = tolerance(self.model, self.reduce)
        if tol is None:
            return Simulator(self.model)
        lowest, highest = np.nanmin(learned, axis=0), np.nanmax(learned, axis=0)
        margin = np.maximum(MARGIN * (highest - lowest), LEAST_MARGIN * lowest)
        box = np.column_stack([np.maximum(lowest - margin, lowest / 2), highest + margin])
        return Simulator.within(self.model, box, tol, random_state=0)

    def _report(self, T: Any, F: Any, theta: NDArray[np.float64]) -> None:
        """Store the report of the fit, and give its warnings."""
        inputs = mapper_inputs(self.mapper_, T)
        trained = ~(np.isnan(as_floats(inputs)).any(axis=1) | np.isnan(theta).any(axis=1))
        self.training_range_ = TrainingRange.of(inputs, trained)
        rows = spread_rows(trained)
        learned = self._possible(self.mapper_.predict(T))[0]
        self.simulator_ = self._simulator(learned)
        predicted = self.simulator_.frequencies(learned[rows], self.n_jobs, warn=False)
        predicted = as_floats(self.aligner_.inverse_transform(predicted))
        last = last_step(self.inverse_)
        self.report_ = fit_report(
            self.model,
            T,
            F,
            theta,
            as_floats(inputs),
            trained,
            self.box_,
            rows,
            predicted,
            self._n_unconverged,
            last.round_trip() if isinstance(last, InverseSurrogate) else None,
        )
        warn_each(self.report_.warnings())

    def _completed(self, T: Any, F: Any) -> Any:
        """Frequencies with gaps filled by the imputer, if there is one."""
        if self.imputer_ is None:
            return F
        n_sensors, n_modes = T.shape[1], F.shape[1]
        values = as_floats(self.imputer_.fit_transform(np.hstack([T, F])))
        return frame_like(F, values[:, n_sensors : n_sensors + n_modes], self.mode_names_)

    def _fit_inverse(self, F: Any, shapes: ArrayLike | None) -> tuple[Array, Array | None, Array | None]:
        """Fit aligner and M1: parameters of the training data, residuals and weights where they are refined."""
        aligned = with_shapes(self.inverse_, self.aligner_.fit(F).transform(F), shapes)
        self.inverse_.fit(aligned)
        last, self._n_unconverged = refining_step(self.inverse_), None
        if shapes is not None and last is not None:
            warn_each(shape_warnings(last, aligned))
        if last is not None:
            found = last.invert(mapper_inputs(self.inverse_, aligned))
            last.warn_of(found)
            weight = found.weight[found.weight > 0].mean() if found.weight.any() else 1.0
            if weight < SCARCE:
                warn_user(
                    f"because of their gaps, records tell on average {weight:.0%} of what complete ones would tell "
                    "about the parameters, and predictions are drawn towards the model's nominal state; expected more "
                    "modes a record, imputer=KNNGapImputer(), or at least aligner=BiasAligner(model)",
                    "scarce modes",
                )
            self._n_unconverged = int(unconverged(found).sum())
            return as_floats(found.theta), found.residuals, found.weight if self.weighted else None
        theta = as_floats(self.inverse_.transform(aligned))
        if theta.shape[1] != len(self.parameter_names_):
            raise ValueError(f"the inverse gave {theta.shape[1]} columns; expected {self.parameter_names_}")
        return theta, None, None

    def _fit_mapper(self, T: Any, theta: Array, residuals: Array | None, weights: Array | None) -> Array:
        """Fit M2; the parameters that it has learned.

        In coordinates of frequencies it learns what the prior of the inverse keeps from the parameters, too: one more
        Gauss-Newton step, hardly damped, with the derivatives that define these coordinates. Parameters that hardly
        move the frequencies may then scatter widely, but not their effects, which are all that the mapper sees.
        Combinations of parameters that do not move them at all stay where they are.
        """
        last = refining_step(self.inverse_)
        if self.coordinates == "frequencies" and last is not None:
            n_rows = np.count_nonzero(~np.isnan(theta).any(axis=1))
            inverse = learn_frequencies(self.mapper_, last, n_rows)
            if inverse is not None:
                noise = np.where(np.abs(residuals) < NOT_NOISE, residuals, 0.0)
                if last.shape_inputs_ is None:
                    steps = noise / last.scatter_ @ inverse.T
                else:
                    steps = np.where(noise.any(axis=1)[:, np.newaxis], steps_without_prior(last, theta, n_rows), 0.0)
                theta = theta * np.exp(np.clip(steps, -FARTHEST, FARTHEST))
        self.mapper_.fit(T, frame_like(T, theta, self.parameter_names_), **weights_for(self.mapper_, weights))
        return theta
