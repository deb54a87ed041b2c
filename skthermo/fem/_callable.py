"""FE models that are somebody else's program."""

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo.fem._affine_input import check_different, check_n_modes
from skthermo.fem._theta import check_theta


class CallableModel:
    """Any program that turns parameters into frequencies, as an FE model.

    Parameters
    ----------
    function : callable
        Takes one row of multipliers, an array of shape (n_parameters,), and returns the
        frequencies in Hz, (n_modes,). With ``vectorized=True`` it takes (n_samples,
        n_parameters) and returns (n_samples, n_modes).
    parameter_names : sequence of str
        Columns of theta.
    n_modes : int
        Number of frequencies returned.
    vectorized : bool, default=False
        Whether the function takes many rows at once.

    Raises
    ------
    ValueError
        If a name repeats or ``n_modes`` is not a positive integer.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.fem import CallableModel
    >>> model = CallableModel(lambda row: np.sqrt(row[0]) * np.array([1.0, 2.0]), ["E"], 2)
    >>> model.frequencies([[1.0], [4.0]])
    array([[1., 2.],
           [2., 4.]])
    """

    def __init__(
        self,
        function: Callable[[NDArray[np.float64]], ArrayLike],
        parameter_names: Sequence[str],
        n_modes: int,
        *,
        vectorized: bool = False,
    ):
        self.function = function
        self.parameter_names = check_different(parameter_names)
        self.n_modes = check_n_modes(n_modes)
        self.vectorized = vectorized

    def frequencies(self, theta: ArrayLike) -> NDArray[np.float64]:
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
            If theta has the wrong width or values, or the function returns another shape.
        """
        rows = check_theta(theta, self.parameter_names)
        if self.vectorized:
            return self._checked(self.function(rows), (len(rows), self.n_modes))
        results = [self._checked(self.function(row), (self.n_modes,)) for row in rows]
        return np.array(results).reshape(len(rows), self.n_modes)

    def _checked(self, result: ArrayLike, shape: tuple[int, ...]) -> NDArray[np.float64]:
        array = np.asarray(result, dtype=float)
        if array.size != np.prod(shape) or array.shape[-1:] != shape[-1:]:
            raise ValueError(
                f"the model's function returned shape {array.shape}; expected {shape}"
                + ("" if self.vectorized else " for one row of theta (for many rows: vectorized=True)")
            )
        return array.reshape(shape)

    def __sklearn_clone__(self) -> "CallableModel":
        return self

    def __repr__(self) -> str:
        name = getattr(self.function, "__name__", type(self.function).__name__)
        return f"CallableModel({name}, {list(self.parameter_names)}, {self.n_modes} modes)"
