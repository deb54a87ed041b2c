"""What model updating makes small."""

import numpy as np
from numpy.typing import NDArray

from skthermo.fem import FEModel
from skthermo.updating._comparison import Counterparts, counterparts
from skthermo.updating._information import tangent_derivatives, tangents
from skthermo.updating._measured import Measured

Array = NDArray[np.float64]


def without_warnings(model: FEModel) -> FEModel:
    """The model to search with: it says nothing of single theta, which an optimisation leaves again."""
    return model.quiet() if hasattr(model, "quiet") else model


class Residuals:
    """Residuals of frequencies, of the prior, and tangents of shapes, in one vector with one loss.

    The tangents e_j of a shape have the squared length E = 1 / MAC - 1, and
    ((1 - sqrt(MAC)) / sqrt(MAC))^2 = (sqrt(1 + E) - 1)^2 is their common loss. Its slope weights them in the
    Gauss-Newton matrix, for which the residual of the MAC alone, quadratic in e, would be a poor basis.
    """

    def __init__(self, model: FEModel, measured: Measured, prior: Array | None):
        self.model = model
        self.measured = measured
        self.prior = prior
        self.felt = np.flatnonzero(measured.shape_weights > 0)
        self._n_plain = int(measured.has_frequency.sum()) + (0 if prior is None else len(prior))

    def at(self, theta: Array) -> "Point":
        """Residuals at one theta."""
        return Point(self, theta, counterparts(self.model, self.measured, theta))

    def loss(self, squares: Array) -> Array:
        """Loss of squared residuals, its slope and its curvature, as `scipy.optimize.least_squares` asks."""
        rho = np.array([squares, np.ones_like(squares), np.zeros_like(squares)])
        weights = self.measured.shape_weights[self.felt] ** 2
        groups = squares[self._n_plain :].reshape(len(self.felt), len(self.measured.dofs))
        E = groups.sum(axis=1)
        secant = np.sqrt(1 + E)
        values = weights * (E / (1 + secant)) ** 2
        slopes = weights * E / (secant * (1 + secant))
        per_mode = groups.shape[1]
        rho[0, self._n_plain :] = np.repeat(values, per_mode) / max(per_mode, 1)
        rho[1, self._n_plain :] = np.repeat(slopes, per_mode)
        return rho


class Point:
    """Residuals at one theta, and on demand their derivatives."""

    def __init__(self, residuals: Residuals, theta: Array, modes: Counterparts):
        self._residuals = residuals
        self._theta = theta
        self._modes = modes
        measured, prior, felt = residuals.measured, residuals.prior, residuals.felt
        self._with = measured.has_frequency
        parts = [((modes.frequencies - measured.frequencies) / measured.deviations)[self._with]]
        if prior is not None:
            parts.append((theta - 1) / prior)
        if len(felt):
            parts.append(tangents(modes.shapes[:, felt], measured.shapes[:, felt]).T.ravel())
        self.values = np.concatenate(parts)

    @property
    def objective(self) -> float:
        """Sum of the squared and weighted residuals; infinite where the model has no modes."""
        total = self._residuals.loss(self.values**2)[0].sum()
        return float(total) if np.isfinite(total) else np.inf

    def jacobian(self) -> Array:
        """Derivatives of ``values``, (n_values, n_parameters)."""
        plain, slopes = self.blocks()
        return np.vstack([plain, slopes.swapaxes(0, 1).reshape(-1, len(self._theta))])

    def gradient(self) -> Array:
        """Derivative of ``objective``, (n_parameters,)."""
        slopes = self._residuals.loss(self.values**2)[1]
        return 2 * (slopes * self.values) @ self.jacobian()

    def information(self) -> Array:
        """Fisher information of measurements with the noise that the weights stand for, and of the prior.

        A relative noise s of shapes at n degrees of freedom gives 1 / sqrt(MAC) - 1 the standard deviation
        s^2 / sqrt(2 (n - 1)), one over the weight, and the tangents each the variance s^2 / (n - 1).
        """
        plain, slopes = self.blocks()
        weights = self._residuals.measured.shape_weights[self._residuals.felt]
        precisions = weights * np.sqrt(max(len(slopes) - 1, 0) / 2)
        return plain.T @ plain + np.einsum("djp,j,djq->pq", slopes, precisions, slopes)

    def blocks(self) -> tuple[Array, Array]:
        """Derivatives of the plain residuals, and of the tangents (n_dofs, n_shapes, n_parameters)."""
        measured, prior, felt = self._residuals.measured, self._residuals.prior, self._residuals.felt
        d_frequencies, d_shapes = self._modes.derivatives()
        plain = (d_frequencies / measured.deviations[:, np.newaxis])[self._with]
        if prior is not None:
            plain = np.vstack([plain, np.diag(1 / prior)])
        if not len(felt):
            return plain, np.empty((0, 0, len(self._theta)))
        return plain, tangent_derivatives(self._modes.shapes[:, felt], d_shapes[:, felt], measured.shapes[:, felt])
