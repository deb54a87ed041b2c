"""Damage as parameters, and matrices that are added to a model."""

from collections.abc import Callable, Mapping, Sequence
from typing import Protocol, TypeVar

import numpy as np
import scipy.sparse

from skthermo._arrays import Array, MatrixLike
from skthermo.fem.affine._core import AffineCore
from skthermo.fem.affine._read_terms import check_different, read_matrix


class Changeable(Protocol):
    """What the methods of `Interventions` ask of an affine model."""

    @property
    def parameter_names(self) -> tuple[str, ...]: ...

    @property
    def groups(self) -> Mapping[str, tuple[int, ...]]: ...

    @property
    def n_dof(self) -> int: ...

    @property
    def _full_core(self) -> AffineCore: ...

    def _changed(
        self: "Model",
        change: Callable[[AffineCore], AffineCore],
        names: tuple[str, ...] | None = None,
        bounds: Array | None = None,
    ) -> "Model": ...


Model = TypeVar("Model", bound=Changeable)


class Interventions:
    """Methods of affine models that change the structure."""

    def with_damage_parameters(
        self: Model, groups: Sequence[str] | None = None, *, severities: tuple[float, float] = (-0.1, 0.6)
    ) -> Model:
        """A new model with one more parameter for each damage group: the factor 1 - severity of its stiffness.

        Each row of theta may then have its own severities, and the Jacobian holds exact derivatives by them.

        Parameters
        ----------
        groups : sequence of str, optional
            Damage groups. By default all.
        severities : (float, float), default=(-0.1, 0.6)
            Lowest and highest severity that a reduced model covers; a full model has no bounds.

        Returns
        -------
        AffineModel or ReducedModel
            Its last parameters are named ``1 - GROUP``.

        Raises
        ------
        ValueError
            If a group is unknown or named twice, or its parameter's name is taken.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> truss = make_truss().with_damage_parameters(["bottom"])
        >>> truss.parameter_names
        ('bottom', 'top', 'diagonal', 'vertical', '1 - bottom')
        >>> truss.frequencies([[1, 1, 1, 1, 1.0], [1, 1, 1, 1, 0.5]])[:, 0].round(3)
        array([7.485, 6.359])
        """
        chosen = check_different(list(self.groups) if groups is None else groups)
        unknown = [group for group in chosen if group not in self.groups]
        if unknown:
            raise ValueError(f"unknown damage groups {unknown}; expected some of {sorted(self.groups)}")
        names = check_different([*self.parameter_names, *(f"1 - {group}" for group in chosen)])
        scaled = np.zeros((len(self._full_core.stiffness.factors), len(chosen)), dtype=np.int64)
        for column, group in enumerate(chosen):
            scaled[list(self.groups[group]), column] = 1
        bounds = np.tile([1 - severities[1], 1 - severities[0]], (len(chosen), 1))
        return self._changed(lambda core: core.with_group_factors(scaled), names, bounds)

    def with_added(
        self: Model,
        stiffness: MatrixLike | None = None,
        mass: MatrixLike | None = None,
    ) -> Model:
        """A new model with further stiffness and mass, such as those of a retrofit.

        Parameters
        ----------
        stiffness : matrix of shape (n_dof, n_dof), optional
            Added stiffness in N/m, dense or SciPy sparse, the same at every theta.
        mass : matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
            Added mass in kg; a vector holds lumped masses.

        Returns
        -------
        AffineModel or ReducedModel
            Its columns are the modes of this model's nominal state, without what is added.

        Raises
        ------
        ValueError
            If a matrix has the wrong shape, is not symmetric, or holds values that are not finite, or more mass is
            taken away than there is.

        Examples
        --------
        >>> import numpy as np
        >>> from skthermo.datasets import make_truss
        >>> truss = make_truss()
        >>> heavier = truss.with_added(mass=np.full(truss.n_dof, 100.0))
        >>> bool(heavier.frequencies([[1, 1, 1, 1]])[0, 0] < truss.frequencies([[1, 1, 1, 1]])[0, 0])
        True
        """
        if mass is not None and np.ndim(mass) == 1 and not scipy.sparse.issparse(mass):
            if np.shape(mass) != (self.n_dof,):
                raise ValueError(f"mass has shape {np.shape(mass)}; expected ({self.n_dof},) or a matrix")
            mass = scipy.sparse.diags_array(np.asarray(mass, dtype=float)).tocsc()
        added = [
            None if matrix is None else read_matrix(matrix, f"added {what}", self.n_dof)
            for matrix, what in ((stiffness, "stiffness"), (mass, "mass"))
        ]
        return self._changed(lambda core: core.with_added(*added))
