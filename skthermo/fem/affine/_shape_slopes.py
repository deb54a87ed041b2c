"""Mode shapes of many theta at some degrees of freedom, with their derivatives."""

from collections.abc import Callable
from typing import Protocol, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._arguments import check_dofs
from skthermo._arrays import Array
from skthermo.fem.affine._core import AffineCore
from skthermo.fem.affine._terms import DenseTerms
from skthermo.fem.modal import shape_derivatives


class Solvable(Protocol):
    """What the method of `ShapeSlopes` asks of an affine model."""

    _core: AffineCore
    _basis: Array | None

    @property
    def n_dof(self) -> int: ...

    def _in_chunks(self, solve: Callable[[Array], tuple[Array, ...]], theta: ArrayLike) -> tuple[Array, ...]: ...


class ShapeSlopes:
    """Method of affine models that differentiates mode shapes."""

    def linearised_modes(self: Solvable, theta: ArrayLike, dofs: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Natural frequencies and mode shapes at many theta, and their exact derivatives.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.
        dofs : array-like of int of shape (n_dofs,)
            Degrees of freedom at which shapes are wanted, the first being 0.

        Returns
        -------
        frequencies : ndarray of shape (n_samples, n_modes)
            In Hz.
        jacobian : ndarray of shape (n_samples, n_modes, n_parameters)
            Derivatives d f / d theta in Hz.
        shapes : ndarray of shape (n_samples, n_dofs, n_modes)
            Of unit modal mass; signs are arbitrary.
        derivatives : ndarray of shape (n_samples, n_dofs, n_modes, n_parameters)
            Derivatives d phi / d theta of these shapes. Where eigenvalues repeat, they do not exist and the values are
            arbitrary.

        Raises
        ------
        ValueError
            If theta has the wrong width or a value that is not finite and positive, or ``dofs`` are not different
            degrees of freedom of the model.
        """
        places = check_dofs(dofs, self.n_dof)
        core, basis = self._core, self._basis
        solve = _batch if isinstance(core.stiffness, DenseTerms) else _one_by_one
        frequencies, jacobian, shapes, slopes = self._in_chunks(lambda rows: solve(core, rows, places, basis), theta)
        return frequencies, jacobian, shapes, slopes


def _batch(
    core: AffineCore, theta: Array, dofs: NDArray[np.intp], basis: Array | None
) -> tuple[Array, Array, Array, Array]:
    frequencies, shapes = core.modes(theta)
    jacobian = core.frequency_slopes(theta, frequencies, shapes)
    terms = cast(DenseTerms, core.stiffness), cast(DenseTerms, core.mass)
    slopes = shape_derivatives(*terms, theta, (2 * np.pi * frequencies) ** 2, shapes)
    if basis is None:
        return frequencies, jacobian, shapes[:, dofs], slopes[:, dofs]
    return frequencies, jacobian, basis[dofs] @ shapes, np.einsum("di,simp->sdmp", basis[dofs], slopes, optimize=True)


def _one_by_one(
    core: AffineCore, theta: Array, dofs: NDArray[np.intp], basis: Array | None
) -> tuple[Array, Array, Array, Array]:
    parts = []
    for row in theta[:, np.newaxis]:
        modes = core.local_modes(row, follow=core.track, basis=basis)
        columns = modes.ranks if core.track else core.ranks
        parts.append((modes.frequencies[columns], modes.shapes(dofs)[:, columns], *modes.derivatives(columns, dofs)))
    frequencies, shapes, jacobian, slopes = (np.stack(arrays) for arrays in zip(*parts, strict=True))
    return frequencies, jacobian, shapes, slopes
