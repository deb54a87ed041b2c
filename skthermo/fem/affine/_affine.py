"""FE models whose matrices are affine in products of the parameters, and the same on a basis of mode shapes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, Self

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

from skthermo._core.arrays import (
    Array,
    Bounds,
    Label,
    Matrix,
    MatrixLike,
    RandomState,
    check_bounds,
    check_dofs,
    check_flag,
    check_theta,
    integer_row,
    is_label,
    mapping_of,
    positive_integer,
    real_array,
    shape_array,
)
from skthermo._core.parallel import map_on_blas_threads
from skthermo._core.warnings import warn_each
from skthermo.exceptions import ModelWarning, SkthermoWarning
from skthermo.fem._terms import (
    AffineTerms,
    Content,
    DenseTerms,
    ImmutableModel,
    Key,
    PartsOfMass,
    SparseTerms,
    check_different,
    check_severities,
    read_matrix,
    read_terms,
)
from skthermo.fem.affine._basis import Basis, grow_basis
from skthermo.fem.damage import LossKind, check_kind, direction_name
from skthermo.fem.modal import AffineCore, LocalModes, check_supported, count_modes

Terms = Mapping[tuple[str, ...], MatrixLike] | Sequence[tuple[tuple[str, ...], MatrixLike]]
Names = tuple[str, ...] | None
Groups = dict[str, tuple[int, ...]]


class AffineModel(ImmutableModel):
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
    group_mass : mapping of str to matrix, mapping or sequence of pairs, optional
        Damage group -> its mass in kg, which ``mass`` includes and a loss of the group's section takes away, as
        ``mass``: a single matrix is constant, and a key names the parameters of the mass that multiply it.
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
    parameter_names : tuple of str
        Columns of theta.
    dofs : tuple of (node, direction)
        Labels of the degrees of freedom, one for each row; empty if unknown.
    contents : tuple of tuple of (member, properties)
        Members of a `Structure` and their properties whose matrices each stiffness term sums; empty if unknown.
    thread_safe : bool
        True: several threads may ask it at the same time.

    Raises
    ------
    ValueError
        If shapes disagree, a matrix is not symmetric or not finite, a name is unknown, the nominal stiffness is
        singular (a mechanism), a group has more mass than there is, or there are fewer modes than ``n_modes``.

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

    The second spring is a bar that has a tenth of the second mass. Half of its section lost, it weighs less:

    >>> model = AffineModel(
    ...     {(): [[400.0, 0.0], [0.0, 0.0]], ("k",): [[400.0, -400.0], [-400.0, 400.0]]},
    ...     mass=np.eye(2), n_modes=2, group_mass={"k": np.diag([0.0, 0.1])})
    >>> model.damaged({"k": 0.5}, kind="section").frequencies([[1.0]]).round(3)
    array([[1.761, 4.175]])
    """

    thread_safe = True

    _basis: Array | None = None  # the columns are the coordinates in which a reduced model is solved
    _mass_groups: Groups = {}  # whose mass is known, with the positions of its parts
    _mass_contents: tuple[tuple[Content, ...], ...] = ()

    def __init__(
        self,
        stiffness: Terms,
        mass: MatrixLike | Terms,
        *,
        n_modes: int | None = None,
        parameter_names: Sequence[str] | None = None,
        groups: Mapping[str, Sequence[tuple[str, ...] | int]] | None = None,
        group_mass: Mapping[str, MatrixLike | Terms] | PartsOfMass | None = None,
        track: bool = False,
        dofs: Sequence[Label] = (),
        contents: Sequence[Sequence[Content]] = (),
    ):
        stiffness_keys, stiffness_matrices = read_terms(stiffness, "stiffness")
        n_dof = stiffness_matrices[0].shape[0]
        mass_keys, mass_matrices = read_terms(mass, "mass", n_dof=n_dof)
        self.parameter_names = check_names(parameter_names, stiffness_keys + mass_keys)
        self._groups = check_groups(groups, self.parameter_names, stiffness_keys)
        wanted = 6 if n_modes is None else positive_integer(n_modes, "n_modes")
        if contents and len(contents) != len(stiffness_keys):
            raise ValueError(f"contents are of {len(contents)} terms; expected {len(stiffness_keys)}, as of stiffness")
        self.contents = tuple(map(tuple, contents))
        self.dofs = check_labels(dofs, n_dof)

        terms: type[AffineTerms] = SparseTerms if are_sparse(stiffness_matrices + mass_matrices, wanted) else DenseTerms
        stiffness_terms = terms.from_matrices(stiffness_matrices, exponents_of(stiffness_keys, self.parameter_names))
        mass_terms = terms.from_matrices(mass_matrices, exponents_of(mass_keys, self.parameter_names))
        nominal = np.ones((1, len(self.parameter_names)))
        check_supported(stiffness_terms.assemble(nominal)[0], self.dofs)
        least = 1 if n_modes is None else wanted
        available = count_modes(mass_terms.assemble(nominal)[0], at_least=least, dofs=self.dofs)
        solvable = n_dof - 1 if terms is SparseTerms else n_dof
        if n_modes is None:
            wanted = min(wanted, available)
        self._core = self._whole = AffineCore.from_terms(
            stiffness_terms,
            mass_terms,
            ranks=range(wanted),
            track=check_flag(track, "track"),
            available=min(available, solvable),
        )
        if group_mass is not None:
            self._know(read_group_mass(group_mass, self._groups, self.parameter_names, n_dof))

    @property
    def n_modes(self) -> int:
        """Number of modes given."""
        return len(self._core.ranks)

    @property
    def mode_ranks(self) -> tuple[int, ...]:
        """Which modes of the healthy nominal model the columns are; the lowest is 0."""
        return tuple(int(rank) for rank in self._whole.ranks)

    @property
    def n_available(self) -> int:
        """Number of modes that `with_modes` can choose from."""
        return self._whole.available

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""
        return self._whole.stiffness.n_dof

    @property
    def track(self) -> bool:
        """Whether a column follows its mode rather than its rank."""
        return self._core.track

    @property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """Damage groups and the positions of the stiffness terms that each scales."""
        return dict(self._groups)

    @property
    def parameter_terms(self) -> dict[str, tuple[int, ...]]:
        """Parameters and the positions of the stiffness terms that each scales; none for a parameter of the mass."""
        exponents = self._whole.stiffness.exponents
        return {
            name: tuple(np.flatnonzero(column).tolist())
            for name, column in zip(self.parameter_names, exponents.T, strict=True)
        }

    @property
    def stiffness_terms(self) -> list[scipy.sparse.csc_array]:
        """Matrices of the stiffness terms in N/m, without the parameters and severities that multiply them."""
        return [scipy.sparse.csc_array(matrix) for matrix in self._whole.stiffness.each_matrix]

    @property
    def group_mass(self) -> dict[str, scipy.sparse.csc_array]:
        """Damage groups and their mass in kg at theta = 1, where it is known; a loss of section takes a share of it."""
        parts, nominal = self._whole.parts, np.ones((1, len(self.parameter_names)))
        factors = [] if parts is None else parts.coefficients(nominal)[0]
        each = [factor * matrix for factor, (_, matrix) in zip(factors, self._parts_of_mass.terms, strict=True)]
        none = scipy.sparse.csc_array((self.n_dof, self.n_dof))
        return {name: sum((each[place] for place in own), none) for name, own in self._mass_groups.items()}

    @property
    def _parts_of_mass(self) -> PartsOfMass:
        """Masses of damage groups in kg, without the parameters and severities that multiply them."""
        parts = self._whole.parts
        keys = [] if parts is None else [np.repeat(self.parameter_names, row).tolist() for row in parts.exponents]
        matrices = [] if parts is None else map(scipy.sparse.csc_array, parts.each_matrix)
        return PartsOfMass(list(zip(map(tuple, keys), matrices, strict=True)), self._mass_groups, self._mass_contents)

    @property
    def rows_per_chunk(self) -> int:
        """How many samples are solved together, so that memory stays bounded."""
        return self._core.rows_per_chunk

    @property
    def prefer(self) -> str:
        """Hint to joblib: "threads" or "processes". Sparse solvers hold Python's global lock, dense ones do not."""
        return "threads" if self._core.stiffness.is_dense else "processes"

    def frequencies(self, theta: ArrayLike) -> Array:
        """Natural frequencies.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.

        Returns
        -------
        ndarray of shape (n_samples, n_modes)
            In Hz.

        Raises
        ------
        ValueError
            If theta has the wrong width, or a value that is not finite and positive.
        """
        return self._in_chunks(self._core.frequencies, theta)[0]

    def modes(self, theta: ArrayLike) -> tuple[Array, Array]:
        """Natural frequencies and mode shapes.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.

        Returns
        -------
        frequencies : ndarray of shape (n_samples, n_modes)
            In Hz.
        shapes : ndarray of shape (n_samples, n_dof, n_modes)
            With unit modal mass; signs are arbitrary.
        """
        frequencies, shapes = self._in_chunks(self._core.modes, theta)
        return frequencies, shapes if self._basis is None else self._basis @ shapes

    def jacobian(self, theta: ArrayLike) -> Array:
        """Derivatives of the frequencies, d lambda = phi' (dK - lambda dM) phi where they are exact.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters. Where eigenvalues repeat, derivatives of single modes do not exist,
            and the values depend on the arbitrary choice of mode shapes.

        Returns
        -------
        ndarray of shape (n_samples, n_modes, n_parameters)
            Derivatives d f / d theta in Hz.
        """
        return self.linearised(theta)[1]

    def linearised(self, theta: ArrayLike) -> tuple[Array, Array]:
        """Natural frequencies and their exact derivatives, from one solution of each eigenproblem.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.

        Returns
        -------
        tuple of ndarray
            Frequencies and Jacobian, as `linearise` gives them.
        """
        return self._in_chunks(self._core.linearised, theta)  # type: ignore[return-value]

    def linearised_modes(self, theta: ArrayLike, dofs: ArrayLike) -> tuple[Array, Array, Array, Array]:
        """Natural frequencies and mode shapes at many theta, and their exact derivatives.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters.
        dofs : array-like of int of shape (n_dofs,), or list of (node, direction)
            Degrees of freedom at which shapes are wanted, by position, the first being 0, or by label.

        Returns
        -------
        tuple of ndarray
            Frequencies, Jacobian, shapes of unit modal mass and their derivatives, as `linearise_modes` gives them;
            derivatives are arbitrary where eigenvalues repeat.
        """
        places = check_dofs(dofs, self.n_dof, self.dofs)
        solve = partial(self._core.linearised_modes, dofs=places, basis=self._basis)
        return self._in_chunks(solve, theta)  # type: ignore[return-value]

    def local_modes(self, theta: ArrayLike, *, follow: bool = False) -> LocalModes:
        """Modes at one theta, and their derivatives on demand.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,)
            Multipliers of the nominal parameters.
        follow : bool, default=False
            Whether to compute enough modes to contain every nominal mode, rather than the lowest ones.

        Returns
        -------
        LocalModes
            More modes than ``n_modes``, in ascending order.
        """
        row = check_theta(theta, self.parameter_names, one_row=True)
        check_flag(follow, "follow")
        return self._core.local_modes(row, follow=follow, basis=self._basis)

    def nominal_mac(self, shapes: Array) -> Array:
        """Mass-weighted MAC of the healthy nominal modes with other shapes.

        Parameters
        ----------
        shapes : ndarray of shape (n_samples, n_dof, n_candidates)
            Mode shapes, of any scale.

        Returns
        -------
        ndarray of shape (n_samples, n_modes, n_candidates)
            Between 0 and 1.
        """
        array = shape_array(shapes, "shapes", any_size=True)
        if array.ndim != 3 or array.shape[1] != self.n_dof or np.isinf(array).any():
            raise ValueError(
                f"shapes have shape {array.shape}; expected (n_samples, {self.n_dof}, n_candidates), finite or NaN"
            )
        return self._whole.nominal_mac(array)

    def matrices(self, theta: ArrayLike) -> tuple[scipy.sparse.csc_array, scipy.sparse.csc_array]:
        """Stiffness and mass at one theta.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,) or (1, n_parameters)
            Multipliers of the nominal parameters.

        Returns
        -------
        tuple of scipy.sparse.csc_array of shape (n_dof, n_dof)
            Stiffness in N/m and mass in kg.
        """
        row, core = check_theta(theta, self.parameter_names, one_row=True), self._whole
        stiffness, mass = (scipy.sparse.csc_array(terms.assemble(row)[0]) for terms in (core.stiffness, core.mass))
        return stiffness, mass

    def damaged(self, damage: Mapping[str, float], *, kind: LossKind = "stiffness") -> Self:
        """A new model with less stiffness (or more) in some groups, and with the same mass or less.

        Parameters
        ----------
        damage : mapping of str to float
            Group -> severity s, which multiplies the group's stiffness by 1 - s: 0.5 is half, -0.15 a strengthening by
            15 %. A term in several damaged groups is multiplied by all their factors.
        kind : {"stiffness", "section"}, default="stiffness"
            A loss of stiffness, by which no frequency rises, or of cross-section, which multiplies the groups' mass by
            1 - s too, so that some frequencies may rise.

        Returns
        -------
        FE model
            Its columns are the modes of this model's undamaged nominal state. A reduced model is checked anew, and its
            basis grows if it must.

        Raises
        ------
        ValueError
            If a group is unknown, a severity is 1 or more or not finite, or a section is lost of which the model does
            not know the mass.
        """
        core, damage = self._whole, check_severities(damage, self._groups)
        lost = np.array([*damage.values()], dtype=float)
        if parts := self._lost_parts(damage, kind):
            left = np.prod(1 - lost * scaled_terms(self._mass_groups, damage, len(parts.factors)), axis=1)
            core = core.with_scaled_parts(parts.with_factors(parts.factors * left))
        left = np.prod(1 - lost * scaled_terms(self._groups, damage, len(core.stiffness.factors)), axis=1)
        return self._with_core(core.with_scaled_stiffness(left))

    def with_modes(self, modes: Sequence[int]) -> Self:
        """A new model with other modes as its columns.

        Parameters
        ----------
        modes : sequence of int
            Ranks of modes of the healthy nominal model (0 is the lowest), in the order of the new columns.
            `match_modes` proposes such ranks. Modes that are not among the present columns are allowed.

        Returns
        -------
        AffineModel or ReducedModel
            With these modes as columns. A reduced model is checked anew, and its basis grows if it must.

        Raises
        ------
        ValueError
            If a mode is named twice, is not an integer, or does not exist in the model.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> make_truss().with_modes([0, 1, 3, 2]).frequencies([1.0, 1.0, 1.0, 1.0]).round(1)
        array([[ 7.5, 27.5, 62.6, 37.8]])
        """
        ranks = integer_row(modes, "modes", "ranks of modes, such as [0, 1, 3, 2], the lowest being 0")
        outside = ranks[(ranks < 0) | (ranks >= self.n_available)]
        if outside.size:
            raise ValueError(f"mode {outside[0]} is none of the model's; expected 0 to {self.n_available - 1}")
        if len(np.unique(ranks)) < len(ranks):
            raise ValueError(f"modes {ranks.tolist()} repeat; expected each once")
        return self._with_core(self._whole.with_modes(ranks.astype(np.intp)))

    def with_parameters(self, names: Sequence[str]) -> Self:
        """A new model of fewer parameters; the others stay at their present values.

        Parameters
        ----------
        names : sequence of str
            Parameters that remain, in the order of the new columns of theta.

        Returns
        -------
        AffineModel or ReducedModel
            With the same modes and damage groups.

        Raises
        ------
        ValueError
            If a name is unknown or repeated, or ``names`` is empty.
        """
        kept = check_different(names, "parameters", self.parameter_names)
        columns = np.array([self.parameter_names.index(name) for name in kept])
        return self._with_core(self._whole.with_parameters(columns), kept)

    def with_damage_parameters(
        self,
        groups: Sequence[str] | None = None,
        *,
        severities: tuple[float, float] = (-0.1, 0.6),
        kind: LossKind = "stiffness",
    ) -> Self:
        """A new model with one more parameter for each damage group: the factor 1 - severity of what it loses.

        Each row of theta may then have its own severities, and the Jacobian holds exact derivatives by them.

        Parameters
        ----------
        groups : sequence of str, optional
            Damage groups. By default all.
        severities : (float, float), default=(-0.1, 0.6)
            Lowest and highest severity that a reduced model covers; a full model has no bounds.
        kind : {"stiffness", "section"}, default="stiffness"
            What the groups lose, as in `damaged`.

        Returns
        -------
        AffineModel or ReducedModel
            Its last parameters are named ``1 - GROUP``, or ``1 - GROUP, section``.

        Raises
        ------
        ValueError
            If a group is unknown or named twice, its parameter's name is taken, or its mass is not known.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> truss = make_truss().with_damage_parameters(["bottom"])
        >>> truss.parameter_names
        ('bottom', 'top', 'diagonal', 'vertical', '1 - bottom')
        >>> truss.frequencies([[1, 1, 1, 1, 1.0], [1, 1, 1, 1, 0.5]])[:, 0].round(3)
        array([7.485, 6.359])
        """
        chosen = check_different(list(self.groups) if groups is None else groups, "damage groups", self.groups)
        parts = self._lost_parts(chosen, kind)
        names = check_different([*self.parameter_names, *(f"1 - {direction_name(group, kind)}" for group in chosen)])
        scaled = scaled_terms(self._groups, chosen, len(self._whole.stiffness.factors))
        core = self._whole.with_group_factors(scaled)
        if parts:
            further = scaled_terms(self._mass_groups, chosen, len(parts.factors))
            core = core.with_scaled_parts(parts.with_factors(parts.factors, np.hstack([parts.exponents, further])))
        lowest, highest = _range_of(severities, "severities", -np.inf, 1)
        bounds = np.tile([1 - highest, 1 - lowest], (len(chosen), 1))
        return self._with_core(core, names, bounds)

    def with_added(self, stiffness: MatrixLike | None = None, mass: MatrixLike | None = None) -> Self:
        """A new model with further stiffness and mass, such as a retrofit adds.

        Parameters
        ----------
        stiffness : matrix of shape (n_dof, n_dof), optional
            Added stiffness in N/m, dense or SciPy sparse, the same at every theta.
        mass : matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,), optional
            Added mass in kg; a vector holds lumped masses.

        Returns
        -------
        AffineModel or ReducedModel
            Its columns are the modes of this model's nominal state, before the addition.

        Raises
        ------
        ValueError
            If a matrix is not symmetric and finite, or more mass is taken away than there is.
        """
        stiff = None if stiffness is None else read_matrix(stiffness, "added stiffness", self.n_dof)
        heavy = None if mass is None else read_mass(mass, "added mass", self.n_dof)
        return self._with_core(self._whole.with_added(stiff, heavy))

    def with_mass_parameters(
        self, masses: Mapping[str, MatrixLike], *, amounts: tuple[float, float] = (0.0, 2.0)
    ) -> Self:
        """A new model with one more parameter for each pattern of added mass: 1 + how many times it is added.

        At theta = 1 nothing is added. Each row of theta may have its own amounts, and the Jacobian holds exact
        derivatives by them.

        Parameters
        ----------
        masses : mapping of str to matrix of shape (n_dof, n_dof) or array-like of shape (n_dof,)
            Names and masses in kg; a vector holds lumped masses.
        amounts : (float, float), default=(0.0, 2.0)
            Smallest and largest amount that a reduced model covers, above -1; a full model has no bounds.

        Returns
        -------
        AffineModel or ReducedModel
            Its last parameters are named ``1 + NAME``.

        Raises
        ------
        ValueError
            If a mass is not symmetric and finite, a parameter's name is taken, or the amounts are no range above -1.

        Examples
        --------
        >>> import numpy as np
        >>> from skthermo.datasets import make_truss
        >>> truss = make_truss()
        >>> truss.with_mass_parameters({"asphalt": np.full(truss.n_dof, 100.0)}).parameter_names
        ('bottom', 'top', 'diagonal', 'vertical', '1 + asphalt')
        """
        if not isinstance(masses, Mapping) or not masses:
            raise ValueError(f"masses is {masses!r:.200}; expected a mapping of name to mass in kg")
        names = check_different([*self.parameter_names, *(f"1 + {name}" for name in masses)])
        matrices = [read_mass(mass, f"mass {name!r}", self.n_dof) for name, mass in masses.items()]
        bounds = np.tile(1 + _range_of(amounts, "amounts", -1, np.inf), (len(masses), 1))
        return self._with_core(self._whole.with_mass_factors(matrices), names, bounds)

    def with_parts(
        self,
        parts: Mapping[str, Mapping[int, MatrixLike]],
        masses: Mapping[str, Mapping[int, MatrixLike]] | None = None,
    ) -> Self:
        """A new model of the same matrices with further damage groups, which scale parts of stiffness terms.

        `Structure.divide` finds the parts that belong to members.

        Parameters
        ----------
        parts : mapping of str to mapping of int to matrix
            Damage group -> position of a stiffness term -> the matrix (n_dof, n_dof), a part of that term, which the
            group scales. The remainder of a term still belongs to the term's groups, and so do its parts.
        masses : mapping of str to mapping of int to matrix, optional
            The same for parts of the mass that groups lose with their section: damage group -> position of a part ->
            the mass of the group there. The mass of a group that is not named is not known.

        Returns
        -------
        AffineModel or ReducedModel
            With the same parameters and frequencies. A reduced model is checked anew.

        Raises
        ------
        ValueError
            If a group exists already or has no part, a term is unknown, or a matrix has the wrong shape or is not
            symmetric.

        Examples
        --------
        Two springs in a row, with one parameter for the stiffness of both:

        >>> from skthermo.fem import AffineModel
        >>> model = AffineModel({("k",): [[800.0, -400.0], [-400.0, 400.0]]}, mass=[[1.0, 0.0], [0.0, 1.0]], n_modes=2)
        >>> model.with_parts({"first": {0: [[400.0, 0.0], [0.0, 0.0]]}}).groups
        {'k': (0, 1), 'first': (1,)}
        """
        wrong = [name for name, own in parts.items() if name in self._groups or not isinstance(own, Mapping) or not own]
        if wrong:
            own = parts[wrong[0]]
            raise ValueError(f"part {wrong[0]!r} is {own!r:.200}; expected a new name, and matrices by position")
        groups, stiffness = divided(parts, self._groups, len(self._whole.stiffness.factors), self.n_dof)
        n_masses = len(self._parts_of_mass.terms)
        mass_groups, mass = divided(masses or {}, self._mass_groups, n_masses, self.n_dof)
        whole = self._whole.with_divided_terms(stiffness, mass)
        changes: dict[str, Any] = {"_groups": groups, "_mass_groups": mass_groups}
        return self._with_core(whole, **changes, contents=(), _mass_contents=())

    def rescaled(self, theta: ArrayLike) -> Self:
        """A new model whose nominal state, theta = 1, is this model at a given theta.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,) or (1, n_parameters)
            Multipliers that become the new nominal values.

        Returns
        -------
        AffineModel or ReducedModel
            Its columns are the modes of this model's nominal state. A reduced model keeps its basis and its box, whose
            bounds are now relative to theta.

        Raises
        ------
        ValueError
            If theta has the wrong width or more than one row, or a value is not finite and positive.
        """
        row = check_theta(theta, self.parameter_names, one_row=True)
        return self._with_core(self._whole.rescaled(row))

    def reduced(self, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None) -> ReducedModel:
        """A small model that gives the full model's frequencies within a box, to a stated relative error.

        Parameters
        ----------
        bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
            Box of multipliers: a half-width, or lowest and highest of each parameter.
        tol : float, default=1e-5
            Largest relative error of a frequency.
        random_state : int, RandomState or None, default=None
            Seed of the points at which the basis is built and checked.

        Returns
        -------
        ReducedModel
            With this model's interface.
        """
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
        The costs are within 30 % of times measured for lines and grids of beams with 2 to 20 parameters.

        Examples
        --------
        >>> from skthermo.datasets import make_truss, make_z24
        >>> make_truss().reduction_pays(100_000), make_z24().reduction_pays(1000)
        (False, True)
        """
        n_parameters = len(self.parameter_names)
        size = min(self.n_dof, 12 * (n_parameters + 1))  # vectors of a basis
        is_dense = self._core.stiffness.is_dense
        full = 0.05 + 1.6e-4 * self.n_dof**2 if is_dense else 6.0 + 0.008 * self.n_dof  # milliseconds of a solve
        basis = (20 + 4 * n_parameters) * full + 2.0 * size
        reduced = 0.06 + 5e-5 * size**2
        return bool(basis + n_solves * reduced < 0.5 * n_solves * full)

    def __repr__(self) -> str:
        counts = ((len(self.parameter_names), "parameter"), (self.n_dof, "degree"), (self.n_modes, "mode"))
        parameters, degrees, modes = (f"{n} {noun}{'s' * (n != 1)}" for n, noun in counts)
        track = ", track=True" if self.track else ""
        return f"AffineModel({parameters}, {degrees} of freedom, {modes}{track})"

    def _with_core(self, core: AffineCore, names: Names = None, bounds: Array | None = None, **changes: Any) -> Self:
        """A model like this one with another core, these parameter names, bounds of the new ones, and changes."""
        return self._twin(_core=core, _whole=core, parameter_names=names or self.parameter_names, **changes)

    def _lost_parts(self, groups: Iterable[str], kind: LossKind) -> AffineTerms | None:
        """Parts of the mass, where a loss of groups takes some; None where it takes none."""
        check_kind(kind)
        unknown = [group for group in groups if group not in self._mass_groups]
        if kind == "section" and unknown:
            raise ValueError(
                f"the model does not know the mass of the groups {unknown}, which a loss of section takes away; "
                "expected kind='stiffness', or a model with group_mass={group: matrix}, as Structure.assemble gives it"
            )
        return self._whole.parts if kind == "section" else None

    def _know(self, masses: PartsOfMass) -> None:
        """Take the masses of groups."""
        if masses.terms:
            keys, matrices = zip(*masses.terms, strict=True)
            parts = type(self._whole.mass).from_matrices(matrices, exponents_of(keys, self.parameter_names))
            self._core = self._whole = replace(self._whole, parts=parts)
        self._mass_groups, self._mass_contents = masses.groups, tuple(map(tuple, masses.contents))
        mass = self.matrices(np.ones(len(self.parameter_names)))[1].diagonal()
        for name, own in self.group_mass.items():
            if (own.diagonal() < 0).any() or (own.diagonal() > (1 + 1e-6) * mass + 1e-9 * mass.max()).any():
                raise ValueError(f"group_mass of {name!r} is below 0, or more than the model's mass; expected kg of it")

    def _in_chunks(self, solve: Callable[[Array], tuple[Array, ...]], theta: ArrayLike) -> tuple[Array, ...]:
        rows = check_theta(theta, self.parameter_names)
        size = self.rows_per_chunk
        parts = map_on_blas_threads(solve, np.split(rows, range(size, len(rows), size)))
        results = tuple(map(np.concatenate, zip(*parts, strict=True)))
        warn_each(self.findings(rows, results[0]))
        return results


class ReducedModel(AffineModel):
    """An affine FE model projected on a small basis of its own mode shapes, accurate to a stated error.

    The basis V is spanned by modes at random points and corners of the box, and then at points where an error estimate
    is largest. Every term is projected once, V' K_t V, so that each solve is a small dense eigenproblem.
    `AffineModel.reduced` makes such a model.

    Parameters
    ----------
    full : AffineModel
        The model to reduce.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        Box of multipliers in which the error is controlled. Outside it a warning is given.
    tol : float, default=1e-5
        Largest relative error of a frequency. The basis grows until the errors at fresh random
        points and corners of the box are below tol / 2.
    random_state : int, RandomState or None, default=None
        Seed of those points; a sample with the same seed has other points.

    Attributes
    ----------
    full : AffineModel
        The model that was reduced.
    basis_size_ : int
        Number of basis vectors.
    error_ : float
        Largest relative error of a frequency at the check points.
    check_points_ : ndarray of shape (n_checks, n_parameters)
        Theta at which the full model was solved to compute ``error_``: ten or more uniform in the box, and up to
        ten of its corners, none of them a snapshot point.
    snapshot_points_ : ndarray of shape (n_snapshots, n_parameters)
        Theta whose modes, or steps towards them, span the basis.

    Raises
    ------
    ValueError
        If the bounds are infeasible or ``tol`` is not between 0 and 1.
    RuntimeError
        If no basis reaches ``tol``.

    Notes
    -----
    The j-th lowest frequency is never below the full model's j-th (Rayleigh-Ritz). The estimate of a relative error
    [MMO00]_ is r' K_0^-1 r / (2 lambda), with the residual r = K phi - lambda M phi of a mode of unit modal mass and
    the nominal stiffness K_0: within 30 % of K_0, 0.64 to 1.3 times the error. Shapes are given at all degrees of
    freedom. A damaged model is checked anew, and its basis is enlarged if necessary.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.datasets import make_truss
    >>> truss = make_truss()
    >>> reduced = truss.reduced(bounds=0.2, random_state=0)
    >>> reduced.error_ < 5e-6
    True
    >>> theta = [[0.9, 1.1, 1.0, 0.85]]
    >>> bool(np.abs(reduced.frequencies(theta) / truss.frequencies(theta) - 1).max() < 1e-5)
    True
    """

    _basis: Array

    def __init__(self, full: AffineModel, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None):
        if not isinstance(full, AffineModel):
            raise ValueError(f"full is {full!r:.200}; expected an AffineModel, or a ReducedModel")
        if not isinstance(tol, int | float | np.floating) or not 0 < tol < 1:
            raise ValueError(f"tol is {tol!r}; expected a relative error between 0 and 1, such as 1e-5")
        self.parameter_names, self._groups, self.contents = full.parameter_names, full._groups, full.contents
        self.dofs, self._mass_groups, self._mass_contents = full.dofs, full._mass_groups, full._mass_contents
        self.full, self._whole = full, full._whole
        self._bounds = check_bounds(bounds, full.parameter_names)
        self._tol = tol
        self._use(grow_basis(self._whole, self._bounds, tol, random_state))

    @property
    def basis_size_(self) -> int:
        """Number of basis vectors."""
        return self._core.stiffness.n_dof

    def rescaled(self, theta: ArrayLike) -> Self:
        row = check_theta(theta, self.parameter_names, one_row=True)
        full = self.full.rescaled(row)
        return self._twin(
            full=full,
            _whole=full._whole,
            _bounds=self._bounds / row.T,
            _core=full._whole.projected(self._basis, self._tol),
            check_points_=self.check_points_ / row,
            snapshot_points_=self.snapshot_points_ / row,
        )

    def reduced(self, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None) -> ReducedModel:
        return ReducedModel(self.full, bounds, tol=tol, random_state=random_state)

    def reduction_pays(self, n_solves: int) -> bool:
        return False  # it is reduced already

    def __repr__(self) -> str:
        return f"ReducedModel({self.full!r}, {self.basis_size_} basis vectors, error {self.error_:.1e})"

    def local_modes(self, theta: ArrayLike, *, follow: bool = False) -> LocalModes:
        modes = super().local_modes(theta, follow=follow)
        warn_each(self._beyond_bounds(check_theta(theta, self.parameter_names, one_row=True)))
        return modes

    def findings(self, theta: Array, frequencies: Array) -> list[SkthermoWarning]:
        return [*self._beyond_bounds(theta), *super().findings(theta, frequencies)]

    def _with_core(self, core: AffineCore, names: Names = None, bounds: Array | None = None, **changes: Any) -> Self:
        full = self.full._with_core(core, names, **changes)
        known = dict(zip(self.parameter_names, self._bounds, strict=True))
        new = () if bounds is None else bounds
        known |= dict(zip([name for name in full.parameter_names if name not in known], new, strict=True))
        bounds = np.array([known[name] for name in full.parameter_names])
        changes |= {"full": full, "_whole": core, "_bounds": bounds, "parameter_names": full.parameter_names}
        twin = self._twin(**changes)
        twin._use(grow_basis(core, bounds, self._tol, 0, start=self._basis))
        return twin

    def _use(self, basis: Basis) -> None:
        self._basis, self._core, self.error_, self.check_points_, self.snapshot_points_ = basis

    def _beyond_bounds(self, theta: Array) -> list[SkthermoWarning]:
        lowest, highest = self._bounds.T * [[1 - 1e-9], [1 + 1e-9]]
        outside = ((theta < lowest) | (theta > highest)).any(axis=0)
        if self._is_quiet or not outside.any():
            return []
        names = ", ".join(repr(name) for name, is_so in zip(self.parameter_names, outside, strict=True) if is_so)
        text = (
            f"theta of {names} is outside the bounds for which the model was reduced. Frequencies there may be wrong "
            f"by more than {self._tol:g}. Reduce the model for wider bounds, or use the full one"
        )
        return [ModelWarning(text, "outside-bounds")]


def check_names(parameter_names: Sequence[str] | None, keys: Sequence[Key]) -> tuple[str, ...]:
    """Names of the parameters, checked: each occurs in some term, and the terms contain no other names."""
    mentioned = list(dict.fromkeys(name for key in keys for name in key))
    if parameter_names is None and not mentioned:
        raise ValueError("no term names a parameter; expected at least one, such as ('E_deck',)")
    names = tuple(mentioned) if parameter_names is None else check_different(parameter_names)
    if set(names) != set(mentioned):
        raise ValueError(f"terms name {mentioned}; expected all of the parameters {list(names)}, and no other names")
    return names


def exponents_of(keys: Sequence[Key], names: Sequence[str]) -> NDArray[np.int64]:
    """How often each parameter multiplies each term, (n_terms, n_parameters)."""
    return np.array([[key.count(name) for name in names] for key in keys], dtype=np.int64)


def scaled_terms(groups: Groups, chosen: Iterable[str], n_terms: int) -> NDArray[np.int64]:
    """How often each of some damage groups multiplies each term, (n_terms, n_groups)."""
    each = [np.bincount(np.array(groups[group], dtype=np.int64), minlength=n_terms) for group in chosen]
    return np.array(each, dtype=np.int64).reshape(-1, n_terms).T


def read_group_mass(
    masses: Mapping[str, MatrixLike | Terms] | PartsOfMass, groups: Groups, names: Sequence[str], n_dof: int
) -> PartsOfMass:
    """Masses of damage groups as terms, which know their groups."""
    if isinstance(masses, PartsOfMass):
        return masses
    if not isinstance(masses, Mapping) or not set(masses) <= set(groups):
        raise ValueError(f"group_mass is {masses!r:.200}; expected a mapping of some of {list(groups)} to matrices")
    terms: list[tuple[Key, Matrix]] = []
    found = {}
    for group, mass in masses.items():
        own = list(zip(*read_terms(mass, f"group_mass of {group!r}", n_dof), strict=True))
        found[group] = tuple(range(len(terms), len(terms) + len(own)))
        terms += own
    unknown = sorted({name for key, _ in terms for name in key} - {*names})
    if unknown:
        raise ValueError(f"terms of group_mass name {unknown}; expected parameters of the model, {list(names)}")
    return PartsOfMass(terms, found)


def divided(
    parts: Mapping[str, Mapping[int, MatrixLike]], groups: Groups, n_terms: int, n_dof: int
) -> tuple[dict[str, tuple[int, ...]], list[tuple[int, Matrix]]]:
    """Groups with the positions of their terms once parts are terms of their own, and each part with its term's."""
    found: Groups = dict(groups)
    terms: list[tuple[int, Matrix]] = []
    for name, of_terms in parts.items():
        unknown = [position for position in of_terms if position not in range(n_terms)]
        if unknown:
            raise ValueError(f"part {name!r} is of terms {unknown}; expected positions from 0 to {n_terms - 1}")
        first = n_terms + len(terms)
        new = dict(zip(of_terms, range(first, first + len(of_terms)), strict=True))
        for group, inside in found.items():
            found[group] = (*inside, *(new[position] for position in inside if position in new))
        found[name] = tuple(new.values())
        terms += [(position, read_matrix(part, f"part {name!r}", n_dof)) for position, part in of_terms.items()]
    return found, terms


def check_groups(groups, names: Sequence[str], keys: Sequence[Key]) -> dict[str, tuple[int, ...]]:
    """Damage groups as positions of stiffness terms."""
    if groups is None:
        groups = {name: [i for i, key in enumerate(keys) if name in key] for name in names}
        return {name: tuple(positions) for name, positions in groups.items() if positions}
    found = {}
    for group, terms in mapping_of(groups, "groups", "a mapping of group to the terms that it scales").items():
        if isinstance(terms, bytes | type) or not isinstance(terms, Iterable):
            raise ValueError(f"group {group!r} is {terms!r:.200}; expected stiffness terms, such as ['E_deck']")
        positions: set[int] = set()
        for term in [terms] if isinstance(terms, str) else terms:
            matches = [i for i, key in enumerate(keys) if term in (i, key) or (term,) == key]
            if not matches or isinstance(term, bool):
                raise ValueError(f"group {group!r} names the term {term!r}; expected one of {list(keys)}")
            positions.update(matches)
        if not positions:
            raise ValueError(f"group {group!r} names no stiffness term; expected one or more of {list(keys)}")
        found[group] = tuple(sorted(positions))
    return found


def check_labels(dofs: Sequence[Label], n_dof: int) -> tuple[Label, ...]:
    """Labels of all degrees of freedom, or none."""
    if not isinstance(dofs, Sequence) or not all(is_label(dof) for dof in dofs):
        raise ValueError(
            f"dofs is {dofs!r:.200}; expected a tuple of node and direction for each row, such as (12, 'x')"
        )
    if dofs and not len(dofs) == len(set(dofs)) == n_dof:
        raise ValueError(
            f"dofs holds {len(dofs)} labels, {len(set(dofs))} of them different; expected {n_dof} different"
        )
    return tuple(dofs)


def are_sparse(matrices: Sequence[Matrix], n_modes: int) -> bool:
    """Whether shift-invert is faster than dense batches for this many modes."""
    n_dof = matrices[0].shape[0]
    entries = sum(np.count_nonzero(m) if isinstance(m, np.ndarray) else m.nnz for m in matrices)
    return n_dof > max(200, 4 * n_modes) and entries < 0.3 * n_dof**2


def read_mass(mass: MatrixLike, what: str, n_dof: int) -> Matrix:
    """A mass matrix; lumped masses, in a vector, become its diagonal."""
    if scipy.sparse.issparse(mass) or real_array(mass, what).ndim != 1:
        return read_matrix(mass, what, n_dof)
    if np.shape(mass) != (n_dof,):
        raise ValueError(f"{what} has shape {np.shape(mass)}; expected ({n_dof},) or a matrix")
    return read_matrix(scipy.sparse.diags_array(real_array(mass, what)), what, n_dof)


def _range_of(values: tuple[float, float], what: str, above: float, below: float) -> Array:
    """The lowest and the highest value that a reduced model covers."""
    array = real_array(values, what)
    if array.shape != (2,) or not above < array[0] < array[1] < below:
        raise ValueError(
            f"{what} is {values!r:.200}; expected the lowest and the highest, above {above}, below {below}"
        )
    return array
