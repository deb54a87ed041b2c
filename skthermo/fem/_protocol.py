"""The interface of FE models: required and optional methods."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, runtime_checkable

from numpy.typing import ArrayLike, NDArray

from skthermo._tables.arrays import Array


@runtime_checkable
class FEModel(Protocol):
    """The interface of every FE model: any object with these two attributes and ``frequencies`` is one.

    Attributes
    ----------
    parameter_names : tuple of str
        Columns of theta.
    n_modes : int
        Columns of the frequencies.

    See Also
    --------
    ModalModel, DifferentiableModel, DamageableModel, LocalModel, BatchModel : What a model may offer beside.

    Notes
    -----
    Each stage looks for the methods that it needs, not for a class, and an error names a missing method. Besides the
    protocols above, these are optional:

    - ``track``, whether a column follows its mode (True) or its rank (False);
    - ``reduced(bounds, tol=..., random_state=...)``, a smaller model of the same frequencies within a box, whose
      ``full`` is the model that was reduced;
    - ``reduction_pays(n_solves)``, whether ``reduced`` is expected to save time for so many rows of theta;
    - ``linearised(theta)``, frequencies and Jacobian from one solution;
    - ``linearised_modes(theta, dofs)``, these and mode shapes with their derivatives at some degrees of freedom;
    - ``with_damage_parameters(groups)``, a model whose theta ends with 1 - severity of each group;
    - ``with_mass_parameters(masses)``, a model whose theta ends with 1 + the amount of each added mass;
    - ``with_added(stiffness, mass)``, a model with further stiffness and mass;
    - ``rescaled(theta)``, a model whose nominal state is this one's at theta.

    scikit-learn's ``clone`` never copies a model in skthermo's estimators.
    """

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Columns of theta."""

    @property
    def n_modes(self) -> int:
        """Columns of the frequencies."""

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


class ModalModel(FEModel, Protocol):
    """An FE model that gives mode shapes.

    Attributes
    ----------
    parameter_names, n_modes
        As of `FEModel`.
    """

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


class DifferentiableModel(FEModel, Protocol):
    """An FE model that gives derivatives of its frequencies.

    Attributes
    ----------
    parameter_names, n_modes
        As of `FEModel`.
    """

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


class DamageableModel(FEModel, Protocol):
    """An FE model that can be damaged.

    Attributes
    ----------
    groups
        As described below.
    """

    @property
    def groups(self) -> Mapping[str, object]:
        """The damage groups by name."""

    def damaged(self, damage: Mapping[str, float]) -> DamageableModel:
        """A new model with less stiffness (or more) in some groups and the same mass.

        Parameters
        ----------
        damage : mapping of str to float
            Group -> severity s, which multiplies the group's stiffness by 1 - s: 0.5 is half, -0.15 a strengthening by
            15 %. A term in several damaged groups is multiplied by all their factors.

        Returns
        -------
        FE model
            Its columns are the modes of this model's undamaged nominal state. A reduced model is checked anew, and its
            basis grows if it must.

        Raises
        ------
        ValueError
            If a group is unknown, or a severity is 1 or more or not finite.
        """


class LocalModel(FEModel, Protocol):
    """An FE model that gives its modes at one theta with their derivatives, as model updating needs them.

    Attributes
    ----------
    n_dof, track
        As described below.
    """

    @property
    def n_dof(self) -> int:
        """Number of degrees of freedom."""

    @property
    def track(self) -> bool:
        """Whether a column follows its mode rather than its rank."""

    def local_modes(self, theta: ArrayLike, *, follow: bool = False) -> Any:
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


class BatchModel(FEModel, Protocol):
    """An FE model that says how many rows are best solved together, and warns of all of them at once.

    Attributes
    ----------
    rows_per_chunk, prefer, thread_safe
        As described below.
    """

    @property
    def rows_per_chunk(self) -> int:
        """How many rows are solved together."""

    @property
    def prefer(self) -> str:
        """Hint to joblib: "threads" or "processes"."""

    @property
    def thread_safe(self) -> bool:
        """Whether several threads may ask it at the same time."""

    def quiet(self) -> FEModel:
        """The same model without warnings.

        Returns
        -------
        FE model
            For searches that may pass through theta of which it would warn.
        """

    def warn_of(self, theta: Array, frequencies: NDArray) -> None:
        """Give the model's warnings about a whole table and its solution.

        Parameters
        ----------
        theta, frequencies : ndarray of shape (n_samples, n_parameters) and (n_samples, n_modes)
            The table, and its solution in Hz.
        """
