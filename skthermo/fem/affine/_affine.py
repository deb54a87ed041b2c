"""FE models whose matrices are affine in products of the parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Self

from numpy.typing import ArrayLike

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import (
    Array,
    Bounds,
    Label,
    MatrixLike,
    RandomState,
    check_flag,
    check_theta,
    positive_integer,
)
from skthermo.exceptions import ModelWarning
from skthermo.fem._terms import AffineTerms, DenseTerms, SparseTerms, nominal_theta
from skthermo.fem.affine._base import (
    AffineBase,
    Change,
    Content,
    Groups,
    Names,
    are_sparse,
    check_groups,
    check_labels,
    check_names,
    exponents_of,
    read_terms,
)
from skthermo.fem.affine._core import AffineCore
from skthermo.fem.affine._reduced import ReducedModel
from skthermo.fem.modal import check_supported, count_modes

Terms = Mapping[tuple[str, ...], MatrixLike] | Sequence[tuple[tuple[str, ...], MatrixLike]]

FULL_DENSE, FULL_SPARSE = (0.05, 1.6e-4), (6.0, 0.008)
"""Milliseconds of frequencies and derivatives: of a dense model, in all and per squared degree of freedom; of a sparse
one, in all and per degree of freedom."""

USUAL_MODES = 6  # as few as vibration tests of bridges usually identify
VECTORS_PER_PARAMETER = 12  # a basis has about as many vectors for each parameter, and for one more
REDUCED = (0.06, 5e-5)  # milliseconds of a reduced solve, in all and per squared number of basis vectors
BASIS_SOLVES, BASIS_PER_VECTOR = (20, 4), 2.0
"""A basis takes so many full solves, in all and per parameter, and so many milliseconds per vector."""

LARGEST_SHARE = 0.5  # largest share of the full model's time that a reduced model may take


class AffineModel(AffineBase):
    """FE model K(theta) phi = (2 pi f)^2 M(theta) phi with affine stiffness and mass.

    K(theta) = sum over the terms of (product of the named theta) * matrix, and M likewise.
    Models are immutable; clones share their matrices.

    Parameters
    ----------
    stiffness : mapping of tuple of str to matrix, or sequence of such pairs
        Parameter names -> symmetric matrix (n_dof, n_dof), dense or SciPy sparse, in N/m. The key ``()`` is the
        constant part; a name may occur in a key more than once. Pairs, unlike a mapping, may repeat a key.
    mass : matrix, mapping or sequence of pairs
        Mass in kg, as ``stiffness``; a single matrix is constant. It may be singular (massless degrees of freedom).
    n_modes : int, optional
        How many of the lowest modes the model gives. By default six, or all if there are fewer.
    parameter_names : sequence of str, optional
        Columns of theta. By default the names in the order of the terms.
    groups : mapping of str to list of (tuple of str or int), optional
        Damage group -> the stiffness terms that it scales, by key or by position. By default each parameter is a
        group: all stiffness terms that it multiplies.
    track : bool, default=False
        True: column j is the j-th nominal mode, followed by mass-weighted MAC wherever modes swap. False: column j is
        the j-th lowest mode.
    dofs : sequence of (node, direction), optional
        Labels of the degrees of freedom, one for each row, all different. Error messages name them, and measured
        shapes can be given at them.
    contents : sequence of sequence of (member, properties), optional
        The members of a `Structure` whose matrices each stiffness term sums, as `Structure.assemble` gives them, so
        that `Structure.divide` can take them apart.

    Attributes
    ----------
    n_dof : int
        Number of degrees of freedom.

    Raises
    ------
    ValueError
        If shapes disagree, a matrix is not symmetric or not finite, a name is unknown, the
        nominal stiffness is singular (a mechanism), or there are fewer modes than ``n_modes``.

    Notes
    -----
    Up to 200 degrees of freedom eigenproblems are dense and solved in batches; larger ones are sparse and solved one by
    one by Lanczos iterations, from a seeded start. All solvers run on as many threads as BLAS may use. Where the
    stiffness is not positive definite, frequencies are NaN and a warning says at which theta.

    Examples
    --------
    Two equal masses in a row on two springs, the second spring a parameter:

    >>> import numpy as np
    >>> from skthermo.fem import AffineModel
    >>> model = AffineModel(
    ...     {(): [[400.0, 0.0], [0.0, 0.0]], ("k",): [[400.0, -400.0], [-400.0, 400.0]]},
    ...     mass=np.eye(2), n_modes=2)
    >>> model
    AffineModel(1 parameter, 2 degrees of freedom, 2 modes)
    >>> model.frequencies([[1.0], [0.5]]).round(3)
    array([[1.967, 5.15 ],
           [1.723, 4.159]])
    >>> model.damaged({"k": 0.5}).frequencies([[1.0]]).round(3)
    array([[1.723, 4.159]])
    """

    def __init__(
        self,
        stiffness: Terms,
        mass: MatrixLike | Terms,
        *,
        n_modes: int | None = None,
        parameter_names: Sequence[str] | None = None,
        groups: Mapping[str, Sequence[tuple[str, ...] | int]] | None = None,
        track: bool = False,
        dofs: Sequence[Label] = (),
        contents: Sequence[Sequence[Content]] = (),
    ):
        stiffness_keys, stiffness_matrices = read_terms(stiffness, "stiffness")
        mass_keys, mass_matrices = read_terms(mass, "mass", n_dof=stiffness_matrices[0].shape[0])
        self._parameter_names = check_names(parameter_names, stiffness_keys + mass_keys)
        self._groups = check_groups(groups, self._parameter_names, stiffness_keys)
        wanted = USUAL_MODES if n_modes is None else positive_integer(n_modes, "n_modes")
        if contents and len(contents) != len(stiffness_keys):
            raise ValueError(f"contents are of {len(contents)} terms; expected {len(stiffness_keys)}, as of stiffness")
        self._contents = tuple(map(tuple, contents))

        terms: type[AffineTerms] = SparseTerms if are_sparse(stiffness_matrices + mass_matrices, wanted) else DenseTerms
        stiffness_terms = terms.from_matrices(stiffness_matrices, exponents_of(stiffness_keys, self._parameter_names))
        mass_terms = terms.from_matrices(mass_matrices, exponents_of(mass_keys, self._parameter_names))
        n_dof = stiffness_terms.n_dof
        nominal = nominal_theta(len(self._parameter_names))
        self._dofs = check_labels(dofs, n_dof)
        check_supported(stiffness_terms.assemble(nominal)[0], self._dofs)
        available = count_modes(mass_terms.assemble(nominal)[0], at_least=1 if n_modes is None else wanted)
        solvable = n_dof - 1 if terms is SparseTerms else n_dof
        if n_modes is None and available < wanted:
            warn_user(
                f"of the {wanted} modes that models give by default this one has only {available}. It gives these; say "
                f"so by n_modes={available}",
                ModelWarning,
                "fewer-modes",
            )
            wanted = available
        self._core = AffineCore.from_terms(
            stiffness_terms,
            mass_terms,
            ranks=range(wanted),
            track=check_flag(track, "track"),
            available=min(available, solvable),
        )

    def rescaled(self, theta: ArrayLike) -> Self:
        return self._twin(_core=self._core.rescaled(check_theta(theta, self.parameter_names, one_row=True)))

    def reduced(self, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None) -> ReducedModel:
        return ReducedModel(self, bounds, tol=tol, random_state=random_state)

    def reduction_pays(self, n_solves: int) -> bool:
        """Whether a reduced model is expected to save time.

        Parameters
        ----------
        n_solves : int
            How many frequencies, or frequencies with derivatives, will be computed.

        Returns
        -------
        bool
            True where making a reduced model and solving it is expected to take less than half the time of the full
            model. It depends on the numbers of degrees of freedom and parameters, not on the machine or its load.

        Notes
        -----
        The costs are rounded from those of lines and grids of beams with 2 to 20 parameters within 30 %
        (``python tests/benchmarks/solves.py --parts pays``).

        Examples
        --------
        >>> from skthermo.datasets import make_kw51, make_truss
        >>> make_truss().reduction_pays(100_000), make_kw51().reduction_pays(1000)
        (False, True)
        """
        n_parameters = len(self.parameter_names)
        size = min(self.n_dof, VECTORS_PER_PARAMETER * (n_parameters + 1))
        fixed, growing = FULL_DENSE if self._core.is_dense else FULL_SPARSE
        full = fixed + growing * self.n_dof ** (2 if self._core.is_dense else 1)
        basis = (BASIS_SOLVES[0] + BASIS_SOLVES[1] * n_parameters) * full + BASIS_PER_VECTOR * size
        reduced = REDUCED[0] + REDUCED[1] * size**2
        return bool(basis + n_solves * reduced < LARGEST_SHARE * n_solves * full)

    def __repr__(self) -> str:
        counts = ((len(self.parameter_names), "parameter"), (self.n_dof, "degree"), (self.n_modes, "mode"))
        parameters, degrees, modes = (f"{n} {noun}{'s' * (n != 1)}" for n, noun in counts)
        track = ", track=True" if self.track else ""
        return f"AffineModel({parameters}, {degrees} of freedom, {modes}{track})"

    def _changed(self, change: Change, names: Names = None, bounds: Array | None = None, groups: Groups = None) -> Self:
        names, groups = names or self._parameter_names, groups or self._groups
        return self._twin(_core=change(self._core), _parameter_names=names, _groups=groups)

    @property
    def _full_core(self) -> AffineCore:
        return self._core
