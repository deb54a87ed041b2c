"""The interface of FE models: necessary and optional methods."""

from __future__ import annotations

from typing import Protocol, runtime_checkable

from numpy.typing import ArrayLike

from skthermo._core.arrays import Array


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
    AffineModel : Has all that a model may offer; its pages describe arguments and results of each method.

    Notes
    -----
    Each stage looks for the methods that it needs, not for a class, and an error names a missing method. Besides the
    above, these are optional:

    - ``modes(theta)``, frequencies and mode shapes;
    - ``jacobian(theta)``, derivatives of the frequencies; ``linearised(theta)``, both from one solution;
    - ``linearised_modes(theta, dofs)``, these and mode shapes with their derivatives at some degrees of freedom;
    - ``local_modes(theta, follow=...)``, modes and their derivatives at one theta, with ``n_dof``, and
      ``track``, whether a column follows its mode (True) or its rank (False);
    - ``groups`` and ``damaged(damage)``, damage groups by name, and a model with less stiffness in some;
    - ``group_mass``, masses of damage groups, and ``damaged(damage, kind="section")``, a model with less of both;
    - ``damage_directions(groups)``, relative changes of the frequencies per small loss of each group;
    - ``with_damage_parameters(groups)``, a model whose theta ends with 1 - severity of each group;
    - ``with_mass_parameters(masses)``, a model whose theta ends with 1 + the amount of each added mass;
    - ``with_added(stiffness, mass)``, a model with further stiffness and mass;
    - ``rescaled(theta)``, a model whose nominal state is this one's at theta;
    - ``reduced(bounds, tol=..., random_state=...)``, a smaller model of the same frequencies within a box, whose
      ``full`` is the model that was reduced;
    - ``reduction_pays(n_solves)``, whether ``reduced`` is expected to save time for so many rows of theta;
    - ``rows_per_chunk``, how many rows are best solved together; ``thread_safe``, whether several threads may ask it at
      the same time; ``prefer``, a hint to joblib, "threads" or "processes";
    - ``quiet()``, the same model without warnings, for searches that may pass through theta without a solution, and
      ``findings(theta, frequencies)``, the list of its warnings about a whole table and its solution.

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
