"""FE models whose matrices are affine in products of the parameters."""

import copy
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.sparse import csc_array

from skthermo._threads import map_on_blas_threads
from skthermo.fem._affine_input import (
    are_sparse,
    check_groups,
    check_n_modes,
    check_names,
    check_severities,
    exponents_of,
    read_terms,
)
from skthermo.fem._eigen import eigen_form, hertz
from skthermo.fem._stability import check_supported, count_modes
from skthermo.fem._terms import CHUNK_BYTES, AffineTerms, DenseTerms, SparseTerms
from skthermo.fem._theta import check_one_theta, check_theta, nominal_theta, warn_of_failures
from skthermo.fem._tracking import may_be_missed, pair_modes, repeated

Array = NDArray[np.float64]
RandomState = int | np.random.RandomState | None

GUARD_MODES = 4
"""Modes above the tracked ones that are looked at first, since an intruder pushes a mode up."""

MOST_CANDIDATES = 8
"""How many times as many candidates as modes are looked at before a mode counts as dissolved."""

Terms = Mapping[tuple[str, ...], ArrayLike] | Sequence[tuple[tuple[str, ...], ArrayLike]]


class AffineModel:
    """FE model K(theta) phi = (2 pi f)^2 M(theta) phi with affine stiffness and mass.

    K(theta) = sum over the terms of (product of the named theta) * matrix, and M likewise.
    Models are immutable; clones share their matrices.

    Parameters
    ----------
    stiffness : mapping of tuple of str to matrix, or sequence of such pairs
        Parameter names -> symmetric matrix (n_dof, n_dof), dense or SciPy sparse, in N/m. The
        key ``()`` is the constant part; a name may stand in a key more than once. Pairs,
        unlike a mapping, may repeat a key, so that groups can cut through a parameter.
    mass : matrix, mapping or sequence of pairs
        Mass in kg, as ``stiffness``; a single matrix is constant. It may be singular (massless
        degrees of freedom).
    n_modes : int, default=6
        How many of the lowest modes the model gives.
    parameter_names : sequence of str, optional
        Columns of theta. By default the names in the order in which the terms mention them.
    groups : mapping of str to list of (tuple of str or int), optional
        Damage group -> the stiffness terms that it scales, by key or by position. By default
        each parameter's name is a group of all stiffness terms that carry it.
    track : bool, default=False
        True: column j is the j-th nominal mode, followed by mass-weighted MAC wherever modes
        swap. False: column j is the j-th lowest mode.
    dof_names : sequence of str, optional
        What degrees of freedom are called in errors.

    Attributes
    ----------
    n_dof : int
        Number of degrees of freedom.

    Raises
    ------
    ValueError
        If shapes disagree, a matrix is not symmetric or not finite, a name is unknown, the
        nominal stiffness leaves a motion free, or there are fewer modes than ``n_modes``.

    Notes
    -----
    Up to 200 degrees of freedom eigenproblems are dense and solved in batches: with a constant mass that
    is factored once, else (mass that depends on theta or is singular, or a wide spectrum) through the
    flexibility L^-1 M L^-T with K = L L'. Larger ones are sparse and solved one by one by Lanczos
    iterations on K^-1 M, from a seeded start. All run on as many threads as BLAS may use. Where the
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
        mass: ArrayLike | Terms,
        *,
        n_modes: int = 6,
        parameter_names: Sequence[str] | None = None,
        groups: Mapping[str, Sequence[tuple[str, ...] | int]] | None = None,
        track: bool = False,
        dof_names: Sequence[str] | None = None,
    ):
        stiffness_keys, stiffness_matrices = read_terms(stiffness, "stiffness")
        mass_keys, mass_matrices = read_terms(mass, "mass", n_dof=stiffness_matrices[0].shape[0])
        self._parameter_names = check_names(parameter_names, stiffness_keys + mass_keys)
        self._groups = check_groups(groups, self._parameter_names, stiffness_keys)
        self._track = bool(track)
        self._n_modes = check_n_modes(n_modes)

        terms: type[AffineTerms] = (
            SparseTerms if are_sparse(stiffness_matrices + mass_matrices, n_modes) else DenseTerms
        )
        self._stiffness = terms.from_matrices(stiffness_matrices, exponents_of(stiffness_keys, self._parameter_names))
        self._mass = terms.from_matrices(mass_matrices, exponents_of(mass_keys, self._parameter_names))
        nominal = nominal_theta(len(self._parameter_names))
        dofs = dof_names or [f"degree of freedom {i}" for i in range(self.n_dof)]
        check_supported(self._stiffness.assemble(nominal)[0], dofs)
        available = count_modes(self._mass.assemble(nominal)[0], at_least=n_modes)
        solvable = self.n_dof - 1 if terms is SparseTerms else self.n_dof
        self._most_candidates = min(available, MOST_CANDIDATES * n_modes, solvable)
        self._form = eigen_form(self._stiffness, self._mass)
        eigenvalues, shapes = self._form.modes(nominal, n_modes)
        self._together = repeated(eigenvalues[0])
        self._weighted_shapes = self._mass.product(nominal, shapes)[0]
        self._reference_masses = self._mass.coefficients(nominal)[0]
        for array in (self._together, self._weighted_shapes, self._reference_masses):
            array.flags.writeable = False

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Columns of theta."""
        return self._parameter_names

    @property
    def n_modes(self) -> int:
        """Number of modes given."""
        return self._n_modes

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""
        return self._unreduced._stiffness.n_dof

    @property
    def track(self) -> bool:
        """Whether a column follows its mode rather than its rank."""
        return self._track

    @property
    def rows_per_chunk(self) -> int:
        """How many samples are solved at once, so that memory stays bounded."""
        numbers = max(self._stiffness.n_entries, 2 * self._stiffness.n_dof * self.n_modes)
        return max(1, min(self._stiffness.most_rows, CHUNK_BYTES // (8 * numbers)))

    @property
    def prefer(self) -> str:
        """What joblib had better spread samples over: sparse solves hold Python's lock, dense ones do not."""
        return "threads" if isinstance(self._stiffness, DenseTerms) else "processes"

    @property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """Damage groups and the positions of the stiffness terms that each scales."""
        return dict(self._groups)

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
        return self._in_chunks(self._frequencies, theta)[0]

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
        frequencies, shapes = self._in_chunks(self._modes, theta)
        return frequencies, self._expanded(shapes)

    def jacobian(self, theta: ArrayLike) -> Array:
        """Exact derivatives of the frequencies, d lambda = phi' (dK - lambda dM) phi.

        Parameters
        ----------
        theta : array-like of shape (n_samples, n_parameters)
            Multipliers of the nominal parameters. Where eigenvalues repeat, derivatives of
            single modes do not exist and the values are those of an arbitrary basis.

        Returns
        -------
        ndarray of shape (n_samples, n_modes, n_parameters)
            d f / d theta in Hz.
        """
        return self._in_chunks(self._jacobian, theta)[0]

    def likeness(self, shapes: Array) -> Array:
        """Mass-weighted MAC of shapes with the healthy nominal modes.

        Parameters
        ----------
        shapes : ndarray of shape (n_samples, n_dof, n_candidates)
            Mode shapes, of any scale.

        Returns
        -------
        ndarray of shape (n_samples, n_modes, n_candidates)
            Between 0 and 1.
        """
        return self._unreduced._likeness(shapes)

    def matrices(self, theta: ArrayLike) -> tuple[csc_array, csc_array]:
        """Stiffness and mass at one theta.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,) or (1, n_parameters)
            Multipliers of the nominal parameters.

        Returns
        -------
        stiffness, mass : scipy.sparse.csc_array of shape (n_dof, n_dof)
        """
        row = check_one_theta(theta, self.parameter_names)
        terms = self._unreduced._stiffness, self._unreduced._mass
        stiffness, mass = (csc_array(term.assemble(row)[0]) for term in terms)
        return stiffness, mass

    def damaged(self, damage: Mapping[str, float]) -> "AffineModel":
        """A new model with less stiffness (or more) in some groups; mass stays.

        Parameters
        ----------
        damage : mapping of str to float
            Group -> severity s, which multiplies the group's stiffness by 1 - s: 0.5 is half,
            -0.15 a strengthening by 15 %. Terms of several damaged groups take every factor.

        Returns
        -------
        AffineModel
            Its columns are the modes of this model's undamaged nominal state.

        Raises
        ------
        ValueError
            If a group is unknown, or a severity is 1 or more or not finite.
        """
        factors = np.ones(len(self._stiffness.factors))
        for group, severity in check_severities(damage, self._groups).items():
            factors[list(self._groups[group])] *= 1 - severity
        twin = copy.copy(self)
        twin._stiffness = self._stiffness.scaled(factors)
        twin._form = self._form.scaled(factors)
        return twin

    def rescaled(self, theta: ArrayLike) -> "AffineModel":
        """A new model whose nominal state, theta = 1, is this model at a given theta.

        Parameters
        ----------
        theta : array-like of shape (n_parameters,) or (1, n_parameters)
            Multipliers that become the new nominal values.

        Returns
        -------
        AffineModel
            Its columns are the modes of this model's nominal state.

        Raises
        ------
        ValueError
            If theta has the wrong width or more than one row, or a value is not finite and positive.
        """
        row = check_one_theta(theta, self.parameter_names)
        twin = copy.copy(self)
        twin._stiffness = self._stiffness.scaled(self._stiffness.products(row)[0])
        twin._mass = self._mass.scaled(self._mass.products(row)[0])
        twin._form = eigen_form(twin._stiffness, twin._mass)
        return twin

    def reduced(self, bounds: ArrayLike = 0.3, *, tol: float = 1e-5, random_state: RandomState = None) -> "AffineModel":
        """A small model that gives the same frequencies within a box, to a stated error.

        Parameters
        ----------
        bounds : float or array-like of shape (n_parameters, 2), default=0.3
            Box of multipliers: a half-width, or lowest and highest of each parameter.
        tol : float, default=1e-5
            Largest relative error of a frequency.
        random_state : int, RandomState or None, default=None
            Seed of the points at which the basis is made and checked.

        Returns
        -------
        ReducedModel
            With this model's interface.
        """
        from skthermo.fem._reduced import ReducedModel  # which is an AffineModel itself

        return ReducedModel(self._unreduced, bounds, tol=tol, random_state=random_state)

    def __sklearn_clone__(self) -> "AffineModel":
        return self

    def __repr__(self) -> str:
        counts = ((len(self.parameter_names), "parameter"), (self.n_dof, "degree"), (self.n_modes, "mode"))
        parameters, degrees, modes = (f"{n} {noun}{'s' * (n != 1)}" for n, noun in counts)
        track = ", track=True" if self.track else ""
        return f"AffineModel({parameters}, {degrees} of freedom, {modes}{track})"

    @property
    def _unreduced(self) -> "AffineModel":
        """The model at all degrees of freedom."""
        return self

    def _expanded(self, shapes: Array) -> Array:
        """Shapes at all degrees of freedom, from the coordinates that are solved for."""
        return shapes

    def _at_dofs(self, dofs: NDArray[np.intp], shapes: Array) -> Array:
        """What shapes, in the coordinates that are solved for, are at degrees of freedom."""
        return shapes[dofs]

    def _likeness(self, shapes: Array) -> Array:
        masses = self._mass.quadratic_forms(shapes) @ self._reference_masses
        return (self._weighted_shapes.T @ shapes) ** 2 / masses[:, np.newaxis]

    def _frequencies(self, theta: Array) -> tuple[Array]:
        if self.track:
            return (self._modes(theta)[0],)
        return (hertz(self._form.eigenvalues(theta, self.n_modes)),)

    def _modes(self, theta: Array) -> tuple[Array, Array]:
        if self.track:
            return self._tracked(theta, min(self.n_modes + GUARD_MODES, self._most_candidates))
        eigenvalues, shapes = self._form.modes(theta, self.n_modes)
        return hertz(eigenvalues), shapes

    def _tracked(self, theta: Array, n_candidates: int) -> tuple[Array, Array]:
        """Nominal modes among the lowest candidates, and among more where these leave a doubt."""
        eigenvalues, candidates = self._form.modes(theta, n_candidates)
        likeness = self._likeness(candidates)
        order = pair_modes(likeness, self._together)
        frequencies = np.take_along_axis(hertz(eigenvalues), order, axis=1)
        shapes = np.take_along_axis(candidates, order[:, np.newaxis], axis=2)
        doubtful = may_be_missed(likeness, order, self._together)
        if n_candidates < self._most_candidates and doubtful.any():
            more = min(2 * n_candidates, self._most_candidates)
            frequencies[doubtful], shapes[doubtful] = self._tracked(theta[doubtful], more)
        return frequencies, shapes

    def _jacobian(self, theta: Array) -> tuple[Array]:
        frequencies, shapes = self._modes(theta)
        gradient = self._stiffness.gradients(theta, shapes)
        if not self._mass.is_constant:
            eigenvalues = (2 * np.pi * frequencies) ** 2
            gradient -= eigenvalues[:, :, np.newaxis] * self._mass.gradients(theta, shapes)
        return (gradient / (8 * np.pi**2 * frequencies[:, :, np.newaxis]),)

    def _in_chunks(self, solve, theta: ArrayLike) -> tuple[Array, ...]:
        rows = check_theta(theta, self.parameter_names)
        size = self.rows_per_chunk
        parts = map_on_blas_threads(solve, [rows[i : i + size] for i in range(0, max(len(rows), 1), size)])
        results = tuple(np.concatenate(columns) for columns in zip(*parts, strict=True))
        self._warn_of(rows, results[0])
        return results

    def _frequencies_of_chunk(self, theta: Array) -> Array:
        """Frequencies of checked rows, without a warning."""
        return self._frequencies(theta)[0]

    def _warn_of(self, theta: Array, solved: Array) -> None:
        self._warn_of_bounds(theta)
        warn_of_failures(theta, solved, stacklevel=5)

    def _warn_of_bounds(self, theta: Array) -> None:
        """A model that is good everywhere has nothing to say."""
