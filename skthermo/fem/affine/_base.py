"""The public methods of affine models: checks, chunks, threads, warnings."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array

from skthermo._arguments import check_theta
from skthermo._arrays import Array
from skthermo._threads import map_on_blas_threads
from skthermo._warnings import warn_user
from skthermo.fem._theta import warn_of_failures
from skthermo.fem.affine._core import AffineCore
from skthermo.fem.affine._interventions import Interventions
from skthermo.fem.affine._read_terms import check_different, check_modes
from skthermo.fem.affine._shape_slopes import ShapeSlopes
from skthermo.fem.modal import LocalModes

Model = TypeVar("Model", bound="AffineBase")


class AffineBase(Interventions, ShapeSlopes, ABC):
    """Base of `AffineModel` and `ReducedModel`: the methods that both share.

    A subclass stores ``_parameter_names``, ``_groups`` and ``_core`` and implements `_full_core`; ``_basis`` and
    `_bounds_warning` are for models that are solved on a basis, within a box.
    """

    _parameter_names: tuple[str, ...]
    _groups: dict[str, tuple[int, ...]]
    _core: AffineCore
    _basis: Array | None = None
    _is_quiet = False

    thread_safe = True

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Columns of theta."""
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
        """Number of degrees of freedom."""
        return self._full_core.stiffness.n_dof

    @property
    def track(self) -> bool:
        """Whether a column follows its mode rather than its rank."""
        return self._core.track

    @property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """Damage groups and the positions of the stiffness terms that each scales."""
        return dict(self._groups)

    @property
    def rows_per_chunk(self) -> int:
        """How many samples are solved together, so that memory stays bounded."""
        return self._core.rows_per_chunk

    @property
    def prefer(self) -> str:
        """Hint to joblib: "threads" or "processes". Sparse solvers hold Python's global lock, dense ones do not."""
        return "threads" if self._core.is_dense else "processes"

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
        """Exact derivatives of the frequencies, d lambda = phi' (dK - lambda dM) phi.

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
        frequencies : ndarray of shape (n_samples, n_modes)
            In Hz.
        jacobian : ndarray of shape (n_samples, n_modes, n_parameters)
            Derivatives d f / d theta in Hz.
        """
        frequencies, jacobian = self._in_chunks(self._core.linearised, theta)
        return frequencies, jacobian

    def local_modes(self, theta: ArrayLike, *, follow: bool = False) -> LocalModes:
        """The lowest modes at one theta, with their derivatives.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,) or (1, n_parameters)
            Multipliers of the nominal parameters.
        follow : bool, default=False
            Whether to compute enough modes to find every nominal mode among them.

        Returns
        -------
        LocalModes
            More modes than ``n_modes``, in ascending order.
        """
        row = check_theta(theta, self.parameter_names, one_row=True)
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
        return self._full_core.nominal_mac(shapes)

    def matrices(self, theta: ArrayLike) -> tuple[csc_array, csc_array]:
        """Stiffness and mass at one theta.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,) or (1, n_parameters)
            Multipliers of the nominal parameters.

        Returns
        -------
        stiffness : scipy.sparse.csc_array of shape (n_dof, n_dof)
            In N/m.
        mass : scipy.sparse.csc_array of shape (n_dof, n_dof)
            In kg.
        """
        row = check_theta(theta, self.parameter_names, one_row=True)
        core = self._full_core
        return csc_array(core.stiffness.assemble(row)[0]), csc_array(core.mass.assemble(row)[0])

    def with_modes(self: Model, modes: Sequence[int]) -> Model:
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
        >>> truss = make_truss()
        >>> truss.frequencies([1.0, 1.0, 1.0, 1.0])[0, :4].round(1)
        array([ 7.5, 27.5, 37.8, 62.6])
        >>> truss.with_modes([0, 1, 3, 2]).frequencies([1.0, 1.0, 1.0, 1.0]).round(1)
        array([[ 7.5, 27.5, 62.6, 37.8]])
        """
        ranks = check_modes(modes, self._full_core.available)
        return self._changed(lambda core: core.with_modes(ranks))

    def with_parameters(self: Model, names: Sequence[str]) -> Model:
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

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> truss = make_truss().with_parameters(["top", "bottom"])
        >>> truss.parameter_names
        ('top', 'bottom')
        """
        kept = check_different(names)
        unknown = [name for name in kept if name not in self._parameter_names]
        if unknown:
            raise ValueError(f"parameters {unknown} are unknown; expected some of {list(self._parameter_names)}")
        columns = np.array([self._parameter_names.index(name) for name in kept])
        return self._changed(lambda core: core.with_parameters(columns), kept)

    def quiet(self: Model) -> Model:
        """The same model without warnings.

        Returns
        -------
        AffineModel or ReducedModel
            For searches that may pass through theta outside the box or without a solution. It shares the matrices of
            this model.
        """
        twin = self._twin(self._core)
        twin._is_quiet = True
        return twin

    def warn_of(self, theta: Array, frequencies: NDArray) -> None:
        """Warn of rows outside the bounds of a reduced model, and of rows without a solution.

        Parameters
        ----------
        theta : ndarray of shape (n_samples, n_parameters)
            Multipliers; rows with NaN are ignored.
        frequencies : ndarray of shape (n_samples, ...)
            The solution for each row.
        """
        self._warn_of_bounds(theta)
        if not self._is_quiet:
            warn_of_failures(theta, frequencies)

    def __sklearn_clone__(self: Model) -> Model:
        return self

    @abstractmethod
    def damaged(self: Model, damage: Mapping[str, float]) -> Model:
        """A new model with less stiffness (or more) in some groups."""

    @abstractmethod
    def rescaled(self: Model, theta: ArrayLike) -> Model:
        """A new model whose nominal state, theta = 1, is this model at a given theta."""

    @abstractmethod
    def _changed(
        self: Model,
        change: Callable[[AffineCore], AffineCore],
        names: tuple[str, ...] | None = None,
        bounds: Array | None = None,
    ) -> Model:
        """A model like this one with a changed full core, these parameter names, and bounds of the new ones."""

    @property
    @abstractmethod
    def _full_core(self) -> AffineCore:
        """The core at all degrees of freedom."""

    @abstractmethod
    def _twin(self: Model, core: AffineCore) -> Model:
        """A model like this one, on another core."""

    def _bounds_warning(self, theta: Array) -> str:
        """Hook: ReducedModel warns outside its box."""
        return ""

    def _warn_of_bounds(self, theta: Array) -> None:
        message = "" if self._is_quiet else self._bounds_warning(theta)
        if message:
            warn_user(message, "outside the reduced box")

    def _in_chunks(self, solve: Callable[[Array], tuple[Array, ...]], theta: ArrayLike) -> tuple[Array, ...]:
        rows = check_theta(theta, self.parameter_names)
        size = self.rows_per_chunk
        parts = map_on_blas_threads(solve, [rows[i : i + size] for i in range(0, max(len(rows), 1), size)])
        results = tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
        self.warn_of(rows, results[0])
        return results
