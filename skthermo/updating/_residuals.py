"""The residuals that model updating minimises."""

import numpy as np

from skthermo._tables.arrays import Array
from skthermo.fem import FEModel
from skthermo.updating._comparison import PairedModes, paired_modes, tangent_derivatives, tangents
from skthermo.updating._measured import Measured


class Residuals:
    """Residuals of frequencies, of the prior and of shapes, in one vector with one loss.

    A shape's residuals are its `tangents` e, of squared length E = 1 / MAC - 1. Together they have the loss
    ((1 - sqrt(MAC)) / sqrt(MAC))^2 = (sqrt(1 + E) - 1)^2, whose slope weights them in the Gauss-Newton matrix.
    (1 - sqrt(MAC)) / sqrt(MAC) itself is quadratic in e: its derivative vanishes at the optimum.
    """

    def __init__(self, model: FEModel, measured: Measured, prior: Array | None):
        self.model = model
        self.measured = measured
        self.prior = prior
        self.weighted = np.flatnonzero(measured.shape_weights > 0)  # modes whose shapes have a weight
        self.n_plain = int(measured.has_frequency.sum()) + (0 if prior is None else len(prior))

    def at(self, theta: Array) -> "Point":
        """Residuals at one theta."""
        return Point(self, theta, paired_modes(self.model, self.measured, theta))

    @property
    def precisions(self) -> Array:
        """Precision of each tangent of the weighted shapes, (n_weighted,), with the noise their weights are made for.

        A shape with the weight sqrt(2 (n - 1)) / s^2 has noise of s times its root mean square at n degrees of freedom:
        each of its tangents, and of the unit shape's components, has the variance s^2 / n.
        """
        n_dofs = len(self.measured.dofs)
        return self.measured.shape_weights[self.weighted] * n_dofs / np.sqrt(2 * max(n_dofs - 1, 1))

    def loss(self, squares: Array) -> Array:
        """Loss of squared residuals, its slope and its curvature, as `scipy.optimize.least_squares` asks."""
        rho = np.array([squares, np.ones_like(squares), np.zeros_like(squares)])
        weights = self.measured.shape_weights[self.weighted] ** 2
        per_mode = len(self.measured.dofs)
        E = squares[self.n_plain :].reshape(len(self.weighted), per_mode).sum(axis=1)
        secant = np.sqrt(1 + E)
        values = weights * (E / (1 + secant)) ** 2
        slopes = weights * E / (secant * (1 + secant))
        rho[0, self.n_plain :] = np.repeat(values, per_mode) / max(per_mode, 1)
        rho[1, self.n_plain :] = np.repeat(slopes, per_mode)
        return rho


class Point:
    """Residuals at one theta, and their derivatives on demand."""

    def __init__(self, residuals: Residuals, theta: Array, modes: PairedModes):
        self._residuals = residuals
        self._theta = theta
        self._modes = modes
        measured, prior, weighted = residuals.measured, residuals.prior, residuals.weighted
        self._has_frequency = measured.has_frequency
        parts = [((modes.frequencies - measured.frequencies) / measured.deviations)[self._has_frequency]]
        if prior is not None:
            parts.append((theta - 1) / prior)
        if len(weighted):
            parts.append(tangents(modes.shapes[:, weighted], measured.shapes[:, weighted]).T.ravel())
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
        """Fisher information of the prior, and of measurements whose noise is that for which the weights are made."""
        plain, slopes = self.blocks()
        return plain.T @ plain + np.einsum("djp,j,djq->pq", slopes, self._residuals.precisions, slopes)

    def blocks(self) -> tuple[Array, Array]:
        """Derivatives of the residuals of frequencies and prior, and of tangents (n_dofs, n_shapes, n_parameters)."""
        measured, prior, weighted = self._residuals.measured, self._residuals.prior, self._residuals.weighted
        d_frequencies, d_shapes = self._modes.derivatives()
        plain = (d_frequencies / measured.deviations[:, np.newaxis])[self._has_frequency]
        if prior is not None:
            plain = np.vstack([plain, np.diag(1 / prior)])
        if not len(weighted):
            return plain, np.empty((0, 0, len(self._theta)))
        return plain, tangent_derivatives(
            self._modes.shapes[:, weighted], d_shapes[:, weighted], measured.shapes[:, weighted]
        )
