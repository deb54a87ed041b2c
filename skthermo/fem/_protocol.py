"""What an FE model must offer."""

from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray


@runtime_checkable
class FEModel(Protocol):
    """The duck type of every FE model: anything with these three members will do.

    Attributes
    ----------
    parameter_names : tuple of str
        Columns of theta.
    n_modes : int
        Columns of the frequencies.

    Notes
    -----
    A model that can do more is used for more, and each stage says which of these it needs:

    - ``modes(theta) -> (frequencies, shapes)``, shapes (n_samples, n_dof, n_modes) with unit modal mass;
    - ``jacobian(theta)``, d f / d theta in Hz, (n_samples, n_modes, n_parameters);
    - ``damaged({group: severity})``, a new model with the groups' stiffness times (1 - severity);
    - ``groups``, the names that ``damaged`` knows;
    - ``track``, whether a column follows its mode (True) or its rank (False);
    - ``reduced(bounds, tol=..., random_state=...)``, a smaller model of the same frequencies within a box;
    - ``rows_per_chunk`` and ``prefer``, how many samples make a task, and joblib's hint what tasks are best spread
      over.

    scikit-learn's ``clone`` never copies a model in skthermo's estimators.
    """

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Columns of theta."""

    @property
    def n_modes(self) -> int:
        """Columns of the frequencies."""

    def frequencies(self, theta: ArrayLike) -> NDArray[np.float64]:
        """Natural frequencies in Hz, (n_samples, n_modes), of theta (n_samples, n_parameters)."""


class ModalModel(FEModel, Protocol):
    """An FE model that gives mode shapes."""

    def modes(self, theta: ArrayLike) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Frequencies, and shapes (n_samples, n_dof, n_modes) of unit modal mass."""
