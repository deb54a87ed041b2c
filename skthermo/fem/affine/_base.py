"""What the full and the reduced affine model share: their public methods, and how their arguments are read."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable, Iterable, Mapping, Sequence
from copy import copy
from functools import partial
from typing import Any, Self

import numpy as np
import scipy.sparse
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.threads import map_on_blas_threads
from skthermo._tables.arrays import (
    Array,
    Bounds,
    Label,
    Matrix,
    MatrixLike,
    RandomState,
    as_mapping,
    check_dofs,
    check_flag,
    check_theta,
    integer_row,
    is_label,
    is_real,
    real_array,
    shape_array,
)
from skthermo.fem._protocol import BatchModel, DamageableModel, DifferentiableModel, LocalModel, ModalModel
from skthermo.fem._terms import warn_of_failures
from skthermo.fem.affine._core import AffineCore
from skthermo.fem.modal import LocalModes

Key = tuple[str, ...]

DENSE_DOFS = 200  # degrees of freedom up to which dense batches are faster
LOWEST_SEVERITY = -10.0  # lowest severity accepted; a lower number is probably a percentage given instead of a fraction
DENSE_SHARE = 0.3  # share of nonzero entries above which a matrix counts as dense


def read_terms(terms, what: str, n_dof: int | None = None) -> tuple[list[Key], list[Matrix]]:
    """Keys and matrices: symmetric copies, dense or sparse as given."""
    if isinstance(terms, Mapping):
        pairs = list(terms.items())
    elif isinstance(terms, Sequence) and all(
        isinstance(term, tuple) and len(term) == 2 and isinstance(term[0], tuple | str) for term in terms
    ):
        pairs = list(terms)
    else:
        pairs = [((), terms)]
    if not pairs:
        raise ValueError(f"{what} has no terms; expected at least one matrix")
    keys = [_read_key(key, what) for key, _ in pairs]
    matrices = []
    for key, (_, matrix) in zip(keys, pairs, strict=True):
        matrices.append(read_matrix(matrix, f"{what} term {key}", n_dof))
        n_dof = matrices[0].shape[0]
    return keys, matrices


def _read_key(key, what: str) -> Key:
    names = (key,) if isinstance(key, str) else key
    if not isinstance(names, tuple) or not all(isinstance(name, str) for name in names):
        raise ValueError(f"{what} has the key {key!r}; expected a tuple of parameter names")
    return names


def read_matrix(matrix, what: str, n_dof: int | None) -> Matrix:
    """An exactly symmetric copy of a matrix that is symmetric to 1e-8 of its largest entry, dense or sparse."""
    array = scipy.sparse.csc_array(matrix) if scipy.sparse.issparse(matrix) else real_array(matrix, what)
    if np.iscomplexobj(array):
        raise ValueError(f"{what} is complex; expected real numbers")
    if array.ndim != 2 or array.shape[0] != array.shape[1] or not array.shape[0]:
        raise ValueError(f"{what} has shape {array.shape}; expected a square matrix")
    if n_dof is not None and array.shape[0] != n_dof:
        raise ValueError(f"{what} has shape {array.shape}; expected ({n_dof}, {n_dof}) like the first term")
    array = array.astype(float)
    if not np.isfinite(array.data if scipy.sparse.issparse(array) else array).all():
        raise ValueError(f"{what} holds values that are not finite")
    skew = abs(array - array.T)
    if skew.max() > 1e-8 * abs(array).max():
        row, column = np.unravel_index(int(skew.argmax()), array.shape)
        raise ValueError(
            f"{what} is not symmetric: entries ({row}, {column}) and ({column}, {row}) are "
            f"{array[row, column]} and {array[column, row]}"
        )
    return (array + array.T) / 2


def read_mass(mass: MatrixLike, what: str, n_dof: int) -> Matrix:
    """A mass matrix; lumped masses, in a vector, become its diagonal."""
    if scipy.sparse.issparse(mass) or real_array(mass, what).ndim != 1:
        return read_matrix(mass, what, n_dof)
    if np.shape(mass) != (n_dof,):
        raise ValueError(f"{what} has shape {np.shape(mass)}; expected ({n_dof},) or a matrix")
    return read_matrix(scipy.sparse.diags_array(real_array(mass, what)), what, n_dof)


def are_sparse(matrices: Sequence[Matrix], n_modes: int) -> bool:
    """Whether shift-invert is faster than dense batches for this many modes."""
    n_dof = matrices[0].shape[0]
    entries = sum(np.count_nonzero(m) if isinstance(m, np.ndarray) else m.nnz for m in matrices)
    return n_dof > max(DENSE_DOFS, 4 * n_modes) and entries < DENSE_SHARE * n_dof**2


def check_names(parameter_names: Sequence[str] | None, keys: Sequence[Key]) -> tuple[str, ...]:
    """Names of the parameters, checked: each occurs in some term, and the terms contain no other names."""
    mentioned = dict.fromkeys(name for key in keys for name in key)
    if parameter_names is None:
        names = tuple(mentioned)
        if not names:
            raise ValueError("no term names a parameter; expected at least one, such as ('E_deck',)")
        return names
    names = check_different(parameter_names)
    unknown = [name for name in mentioned if name not in names]
    if unknown:
        raise ValueError(f"terms name {unknown}; expected only the parameters {list(names)}")
    unused = [name for name in names if name not in mentioned]
    if unused:
        raise ValueError(f"no term names the parameters {unused}; expected some of {list(mentioned)}")
    return names


def check_different(parameter_names: Sequence[str] | str) -> tuple[str, ...]:
    """Names of parameters, all different."""
    if not isinstance(parameter_names, Iterable) or isinstance(parameter_names, bytes | type):
        raise ValueError(f"parameter_names is {parameter_names!r}; expected one or more different names")
    names = (parameter_names,) if isinstance(parameter_names, str) else tuple(parameter_names)
    if not names or not all(isinstance(name, str) for name in names) or len(set(names)) < len(names):
        raise ValueError(f"parameter_names is {names}; expected one or more different names")
    return names


def check_groups(groups, names: Sequence[str], keys: Sequence[Key]) -> dict[str, tuple[int, ...]]:
    """Damage groups as positions of stiffness terms."""
    if groups is None:
        groups = {name: [i for i, key in enumerate(keys) if name in key] for name in names}
        return {name: tuple(positions) for name, positions in groups.items() if positions}
    found = {}
    if not isinstance(groups, Mapping):
        raise ValueError(f"groups is {groups!r:.200}; expected a mapping of group to the terms that it scales")
    for group, terms in groups.items():
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


def check_severities(damage: Mapping[str, float], groups) -> Mapping[str, float]:
    """Checks that groups are known and that severities leave some stiffness."""
    damage = as_mapping(damage)
    if not isinstance(damage, Mapping):
        raise ValueError(f"damage is {damage!r}; expected a mapping of group to severity")
    for group, severity in damage.items():
        if group not in groups:
            raise ValueError(f"unknown damage group {group!r}; expected one of {sorted(groups)}")
        if not (is_real(severity) and LOWEST_SEVERITY <= float(severity) < 1):
            raise ValueError(
                f"damage of group {group!r} has severity {severity!r}; expected a number below 1, and not below "
                f"{LOWEST_SEVERITY:g} (0.5 halves the stiffness, -0.15 adds 15 %)"
            )
    return damage


def check_modes(modes: Sequence[int], available: int) -> NDArray[np.intp]:
    """Checks that ranks of modes are different integers from 0 to below the number available."""
    ranks = integer_row(modes, "modes", "ranks of modes, such as [0, 1, 3, 2], the lowest being 0")
    outside = ranks[(ranks < 0) | (ranks >= available)]
    if outside.size:
        raise ValueError(f"mode {outside[0]} is none of the model's; expected 0 to {available - 1}")
    if len(np.unique(ranks)) < len(ranks):
        raise ValueError(f"modes {ranks.tolist()} repeat; expected each once")
    return ranks.astype(np.intp)


def check_labels(dofs: Sequence[Label], n_dof: int) -> tuple[Label, ...]:
    """Labels of all degrees of freedom, or none."""
    if not isinstance(dofs, Sequence) or not all(is_label(dof) for dof in dofs):
        raise ValueError(
            f"dofs is {dofs!r:.200}; expected a tuple of node and direction for each row, such as (12, 'x')"
        )
    if dofs and len(dofs) != n_dof:
        raise ValueError(f"dofs holds {len(dofs)} labels; expected {n_dof}, one for each row")
    if len(set(dofs)) < len(dofs):
        raise ValueError(f"dofs is {dofs!r:.200}; expected different labels")
    return tuple(dofs)


def exponents_of(keys: Sequence[Key], names: Sequence[str]) -> NDArray[np.int64]:
    """How often each parameter occurs in each key, (n_terms, n_parameters)."""
    return np.array([[key.count(name) for name in names] for key in keys], dtype=np.int64)


Content = tuple[Hashable, tuple[str, ...]]
Change = Callable[[AffineCore], AffineCore]
Names = tuple[str, ...] | None
Groups = dict[str, tuple[int, ...]] | None


class AffineBase(ModalModel, DifferentiableModel, DamageableModel, LocalModel, BatchModel, ABC):
    """Base of `AffineModel` and `ReducedModel`: the methods that both share.

    A subclass stores ``_parameter_names``, ``_groups`` and ``_core``, and ``_basis`` if it is solved on a basis.
    """

    _parameter_names: tuple[str, ...]
    _groups: dict[str, tuple[int, ...]]
    _contents: tuple[tuple[Content, ...], ...] = ()
    _dofs: tuple[Label, ...] = ()
    _core: AffineCore
    _basis: Array | None = None
    _is_quiet = False

    thread_safe = True

    @property
    def parameter_names(self) -> tuple[str, ...]:
        return self._parameter_names

    @property
    def n_modes(self) -> int:
        """Number of modes given."""
        return self._core.n_modes

    @property
    def mode_ranks(self) -> tuple[int, ...]:
        """Which modes of the healthy nominal model the columns are; the lowest is 0."""
        return tuple(int(rank) for rank in self._full_core.ranks)

    @property
    def n_available(self) -> int:
        """Number of modes that `with_modes` can choose from."""
        return self._full_core.available

    @property
    def n_dof(self) -> int:
        return self._full_core.stiffness.n_dof

    @property
    def dofs(self) -> tuple[Label, ...]:
        """Labels of the degrees of freedom, such as (node, direction), one for each row; empty if unknown."""
        return self._dofs

    @property
    def track(self) -> bool:
        return self._core.track

    @property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """Damage groups and the positions of the stiffness terms that each scales."""
        return dict(self._groups)

    @property
    def parameter_terms(self) -> dict[str, tuple[int, ...]]:
        """Parameters and the positions of the stiffness terms that each scales; none for a parameter of the mass."""
        exponents = self._full_core.stiffness.exponents
        return {
            name: tuple(np.flatnonzero(column).tolist())
            for name, column in zip(self._parameter_names, exponents.T, strict=True)
        }

    @property
    def contents(self) -> tuple[tuple[Content, ...], ...]:
        """Members of a `Structure` and their properties whose matrices each stiffness term sums; empty if unknown."""
        return self._contents

    @property
    def stiffness_terms(self) -> list[scipy.sparse.csc_array]:
        """Matrices of the stiffness terms in N/m, without the parameters and severities that multiply them."""
        return [scipy.sparse.csc_array(matrix) for matrix in self._full_core.stiffness.each_matrix]

    @property
    def rows_per_chunk(self) -> int:
        """How many samples are solved together, so that memory stays bounded."""
        return self._core.rows_per_chunk

    @property
    def prefer(self) -> str:
        """Hint to joblib: "threads" or "processes". Sparse solvers hold Python's global lock, dense ones do not."""
        return "threads" if self._core.is_dense else "processes"

    def frequencies(self, theta: ArrayLike) -> Array:
        return self._in_chunks(self._core.frequencies, theta)[0]

    def modes(self, theta: ArrayLike) -> tuple[Array, Array]:
        frequencies, shapes = self._in_chunks(self._core.modes, theta)
        return frequencies, shapes if self._basis is None else self._basis @ shapes

    def jacobian(self, theta: ArrayLike) -> Array:
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
        row = check_theta(theta, self.parameter_names, one_row=True)
        check_flag(follow, "follow")
        if not self._is_quiet:
            self._warn_of_bounds(row)
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
        return self._full_core.nominal_mac(array)

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
        row, core = check_theta(theta, self.parameter_names, one_row=True), self._full_core
        stiffness, mass = (scipy.sparse.csc_array(terms.assemble(row)[0]) for terms in (core.stiffness, core.mass))
        return stiffness, mass

    def damaged(self, damage: Mapping[str, float]) -> Self:
        factors = np.ones(len(self._full_core.stiffness.factors))
        for group, severity in check_severities(damage, self._groups).items():
            factors[list(self._groups[group])] *= 1 - severity
        return self._changed(lambda core: core.with_scaled_stiffness(factors))

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
        ranks = check_modes(modes, self._full_core.available)
        return self._changed(lambda core: core.with_modes(ranks))

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
        kept = check_different(names)
        unknown = [name for name in kept if name not in self._parameter_names]
        if unknown:
            raise ValueError(f"parameters {unknown} are unknown; expected some of {list(self._parameter_names)}")
        columns = np.array([self._parameter_names.index(name) for name in kept])
        return self._changed(lambda core: core.with_parameters(columns), kept)

    def with_damage_parameters(
        self, groups: Sequence[str] | None = None, *, severities: tuple[float, float] = (-0.1, 0.6)
    ) -> Self:
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
        lowest, highest = _range_of(severities, "severities", -np.inf, 1)
        bounds = np.tile([1 - highest, 1 - lowest], (len(chosen), 1))
        return self._changed(lambda core: core.with_group_factors(scaled), names, bounds)

    def with_added(self, stiffness: MatrixLike | None = None, mass: MatrixLike | None = None) -> Self:
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
            If a matrix is not symmetric and finite, or more mass is taken away than there is.
        """
        stiff = None if stiffness is None else read_matrix(stiffness, "added stiffness", self.n_dof)
        heavy = None if mass is None else read_mass(mass, "added mass", self.n_dof)
        return self._changed(lambda core: core.with_added(stiff, heavy))

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
        return self._changed(lambda core: core.with_mass_factors(matrices), names, bounds)

    def with_parts(self, parts: Mapping[str, Mapping[int, MatrixLike]]) -> Self:
        """A new model of the same matrices with further damage groups, each of which scales parts of stiffness terms.

        `Structure.divide` finds the parts that belong to members.

        Parameters
        ----------
        parts : mapping of str to mapping of int to matrix
            Damage group -> position of a stiffness term -> the matrix (n_dof, n_dof), a part of that term, which the
            group scales. What is left of a term still belongs to the groups that it is in, and so do its parts.

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
        Two springs in a row, of which one parameter is the stiffness of both:

        >>> from skthermo.fem import AffineModel
        >>> model = AffineModel({("k",): [[800.0, -400.0], [-400.0, 400.0]]}, mass=[[1.0, 0.0], [0.0, 1.0]], n_modes=2)
        >>> model.with_parts({"first": {0: [[400.0, 0.0], [0.0, 0.0]]}}).groups
        {'k': (0, 1), 'first': (1,)}
        """
        n_terms = len(self._full_core.stiffness.factors)
        groups = dict(self._groups)
        divided: list[tuple[int, Matrix]] = []
        for name, of_terms in parts.items():
            if name in self._groups or not isinstance(of_terms, Mapping) or not of_terms:
                raise ValueError(f"part {name!r} is {of_terms!r:.200}; expected a new name, and matrices by position")
            unknown = [position for position in of_terms if position not in range(n_terms)]
            if unknown:
                raise ValueError(f"part {name!r} is of terms {unknown}; expected positions from 0 to {n_terms - 1}")
            first = n_terms + len(divided)
            new = dict(zip(of_terms, range(first, first + len(of_terms)), strict=True))
            for group, inside in groups.items():
                groups[group] = (*inside, *(new[position] for position in inside if position in new))
            groups[name] = tuple(new.values())
            divided += [
                (position, read_matrix(part, f"part {name!r}", self.n_dof)) for position, part in of_terms.items()
            ]
        twin = self._changed(lambda core: core.with_divided_stiffness(divided), groups=groups)
        return twin._twin(_contents=())

    def quiet(self) -> Self:
        return self._twin(_is_quiet=True)

    def warn_of(self, theta: Array, frequencies: NDArray) -> None:
        if not self._is_quiet:
            self._warn_of_bounds(theta)
            warn_of_failures(theta, frequencies)

    def __sklearn_clone__(self) -> Self:
        return self

    @abstractmethod
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

    @abstractmethod
    def reduced(self, bounds: Bounds = 0.3, *, tol: float = 1e-5, random_state: RandomState = None) -> AffineBase:
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

    @abstractmethod
    def _changed(self, change: Change, names: Names = None, bounds: Array | None = None, groups: Groups = None) -> Self:
        """A model like this one with a changed full core, these parameter names, bounds of the new ones, and groups."""

    @property
    @abstractmethod
    def _full_core(self) -> AffineCore:
        """The core at all degrees of freedom."""

    def _twin(self, **changes: Any) -> Self:
        """A model like this one, with some attributes changed."""
        twin = copy(self)
        vars(twin).update(changes)
        return twin

    def _warn_of_bounds(self, theta: Array) -> None:
        """Hook: a reduced model warns of theta outside its box."""

    def _in_chunks(self, solve: Callable[[Array], tuple[Array, ...]], theta: ArrayLike) -> tuple[Array, ...]:
        rows = check_theta(theta, self.parameter_names)
        size = self.rows_per_chunk
        parts = map_on_blas_threads(solve, [rows[i : i + size] for i in range(0, max(len(rows), 1), size)])
        results = tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
        self.warn_of(rows, results[0])
        return results


def _range_of(values: tuple[float, float], what: str, above: float, below: float) -> Array:
    """The lowest and the highest value that a reduced model covers."""
    array = real_array(values, what)
    if array.shape != (2,) or not above < array[0] < array[1] < below:
        raise ValueError(
            f"{what} is {values!r:.200}; expected the lowest and the highest, above {above}, below {below}"
        )
    return array
