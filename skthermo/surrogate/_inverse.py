"""The paper's inverse surrogate M1: frequencies to parameters by a regressor that is trained on simulations."""

from __future__ import annotations

from collections.abc import Sequence
from numbers import Integral, Real
from typing import Literal, overload

import numpy as np
import pandas as pd
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils import Bunch, check_random_state

from skthermo._core.arrays import Array, Bounds, check_bounds, check_model, check_noise, check_theta
from skthermo._core.estimators import (
    HasMethods,
    Interval,
    StrOptions,
    _fit_context,
    check_is_fitted,
    validate_data,
)
from skthermo._core.frames import frame_like
from skthermo._core.memory import remembered
from skthermo._core.warnings import collected, warn_each
from skthermo.exceptions import ModelWarning, ResultWarning, SkthermoWarning
from skthermo.fem import FEModel, add_noise, evaluate, sample
from skthermo.metrics.errors import complete_r2
from skthermo.surrogate._regression import FrequencyInverse, MultiplierRegressor, default_network


class InverseSurrogate(FrequencyInverse, MultiplierRegressor):
    """Parameters of an FE model from frequencies, learned from simulations; equations (3)-(4).

    Draws parameters from a box, solves the FE model, and learns the inverse, M1 ~ FEM^-1 [KCM26]_ [KMH24]_: a regressor
    and nothing else, so that every search over it tunes what is used.

    Parameters
    ----------
    model : FE model, optional
        Needed unless `fit` gets frequencies and parameters.
    regressor : regressor, optional
        Learns the standardised logarithms of the parameters from the logarithms of the frequencies, a nearly linear
        relation; one of a single output is fitted once for each parameter. By default a small ``MLPRegressor``; see
        `paper_network` for the paper's.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        Box of multipliers: a half-width, or lowest and highest multiplier of each parameter, or a mapping from each
        parameter to either.
    n_samples : int, default=1000
        Number of simulations.
    noise : "auto", float or array-like of shape (n_modes,), default="auto"
        Relative standard deviation of Gaussian noise added to the simulated frequencies, as the measurement has it.
        "auto" is what a `DataInformedFEM` estimates of its records, else 0.
    memory : str or joblib.Memory, optional
        Folder for simulations and regressor, so that searches and cross-validation make each only once
        (:doc:`/guide/costs`). With ``random_state=None``, what is stored is always the same. Clear the memory when the
        program behind a model or a regressor of your own changes.
    n_jobs : int, optional
        Number of parallel jobs for the simulations.
    random_state : int, RandomState or None, default=None
        Seed of the samples, of the noise, and of the regressor unless it has its own seed.

    Attributes
    ----------
    regressor_ : regressor
        Fitted to standardised log frequencies (inputs) and standardised log parameters (outputs).
    inputs_, targets_ : StandardScaler
        Means and scales of the log frequencies and of the log parameters.
    log_inputs_, log_targets_ : bool
        Whether logarithms are standardised: where all frequencies, and all parameters, are positive.
    findings_ : list of SkthermoWarning
        What is doubtful about model and samples.
    samples_ : Bunch
        ``theta`` and ``frequencies`` of the training samples, before noise.
    bounds_ : ndarray of shape (n_parameters, 2) or None
        Lowest and highest multiplier of each parameter in the samples, if they were simulated; else None.
    noise_ : ndarray of shape (n_modes,)
        If there is a model: the relative standard deviations of the noise.
    n_parameters_, parameter_names_ : int, list of str or None
        Number of parameters, and their names: the model's, or the columns of the frame that `fit` saw.
    y_is_vector_ : bool
        Whether `fit` saw one parameter as a vector.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns of X and, where `fit` saw a frame with such, their names.

    See Also
    --------
    PosteriorInverse : Solves for the parameters of each record; the default of a chain.

    Notes
    -----
    Frequencies cannot determine more parameters than there are modes, and an estimate is an effective stiffness, not a
    material property. Trained on simulations without noise, a regressor amplifies the noise of the measurement;
    trained with noise, it gives the posterior mean in the box. :doc:`/accuracy_regressors` compares regressors.

    Examples
    --------
    >>> import numpy as np
    >>> from skthermo.datasets import make_truss
    >>> from skthermo.surrogate import InverseSurrogate
    >>> model = make_truss()
    >>> inverse = InverseSurrogate(model, bounds=0.2, random_state=0).fit()
    >>> theta = np.array([[0.95, 1.05, 0.9, 1.0]])
    >>> bool(np.abs(inverse.transform(model.frequencies(theta)) / theta - 1).max() < 0.05)
    True
    """

    _default_regressor = staticmethod(default_network)
    _parameter_constraints: dict = {
        "model": [HasMethods(["frequencies"]), None],
        "regressor": [HasMethods(["fit", "predict"]), None],
        "bounds": [Real, "array-like", dict],
        "n_samples": [Interval(Integral, 2, None, closed="left")],
        "noise": [StrOptions({"auto"}), Interval(Real, 0, None, closed="left"), "array-like"],
        "memory": [str, HasMethods(["cache"]), None],
        "n_jobs": [Integral, None],
        "random_state": ["random_state"],
    }

    def __init__(
        self,
        model: FEModel | None = None,
        regressor: BaseEstimator | None = None,
        *,
        bounds: Bounds = 0.3,
        n_samples: int = 1000,
        noise: ArrayLike | Literal["auto"] = "auto",
        memory: str | Memory | None = None,
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
    ):
        self.model = model
        self.regressor = regressor
        self.bounds = bounds
        self.n_samples = n_samples
        self.noise = noise
        self.memory = memory
        self.n_jobs = n_jobs
        self.random_state = random_state

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike | None = None, y: ArrayLike | None = None) -> InverseSurrogate:
        """Learn the inverse.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes), optional
            Frequencies in Hz. Without y they give the columns only.
        y : array-like or DataFrame of shape (n_samples, n_parameters), optional
            Multipliers of each row of X. Without y, frequencies and multipliers are simulated.

        Returns
        -------
        InverseSurrogate
            The fitted estimator.

        Raises
        ------
        ValueError
            If there is neither y nor a model, the numbers of modes or parameters are not the model's, the bounds are
            infeasible, or multipliers of a model are not positive.

        Warns
        -----
        UserWarning
            If there are more parameters than modes.
        """
        random_state = 0 if self.random_state is None and self.memory is not None else self.random_state
        random = check_random_state(random_state)
        self.findings_: list[SkthermoWarning] = []
        if self.model is not None:
            check_model(self.model)
            stated = 0.0 if isinstance(self.noise, str) else self.noise
            self.noise_ = check_noise(stated, self.model.n_modes, getattr(X, "columns", None))
        if self.model is not None and y is None:
            found = validate_data(self, np.ones((1, self.model.n_modes)) if X is None else X).shape[1]
            if found != self.model.n_modes:
                raise ValueError(f"X has {found} columns; expected the {self.model.n_modes} modes of {self.model!r}")
            self.parameter_names_, self.y_is_vector_ = list(self.model.parameter_names), False
            self.bounds_ = check_bounds(self.bounds, self.parameter_names_)
            with collected() as self.findings_:
                self.samples_ = self._drawn(self.n_samples, random)
            theta, inputs = self.samples_.theta, add_noise(self.samples_.frequencies, self.noise_, random_state=random)
            if len(self.parameter_names_) > found:
                self.findings_.append(
                    ResultWarning(
                        "there are more parameters than modes: frequencies cannot distinguish all parameters. Use more "
                        "modes or fewer parameters, or a PosteriorInverse",
                        "undetermined",
                    )
                )
        else:
            inputs, theta = self._read_xy(X, y, ("frequencies", "theta"))
            self.bounds_, self.samples_ = None, Bunch(theta=theta, frequencies=inputs)
            if self.model is not None:
                check_theta(theta, self.model.parameter_names, allow_nan=True)
                self.parameter_names_ = list(self.model.parameter_names)
        seed = None if random_state is None else random
        self._learn(inputs, theta, random_state=seed, log_inputs=True, memory=self.memory)
        warn_each(self.findings_)
        return self

    @overload
    def fit_transform(self, X: pd.DataFrame, y: ArrayLike | None = None) -> pd.DataFrame: ...
    @overload
    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None) -> NDArray[np.float64]: ...
    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None) -> NDArray[np.float64] | pd.DataFrame:
        """Fit, and return the parameters of the same records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.
        y : array-like of shape (n_samples, ...), optional
            Without a model, the multipliers of each row of X. With a model y is ignored, because the inverse learns
            from simulations; in a pipeline, y is the target of a later step.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            As from `transform`.
        """
        return self.fit(X, y if self.model is None else None).transform(X)

    @overload
    def transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Multipliers of the nominal parameters, as `predict` gives them.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes)
            Frequencies in Hz.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            NaN in rows with a missing mode. A frame gives a frame on its own index.

        Warns
        -----
        UserWarning
            If more than 5 % of the rows give parameters that are farther outside the bounds than half the width of
            the box.
        """
        theta = self._regress(self._inputs(X))[0]
        if self.bounds_ is not None:
            warn_each(far_outside(theta, self.bounds_, self.parameter_names_))
        return frame_like(X, theta, self.get_feature_names_out())

    def score(
        self, X: ArrayLike | None = None, y: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> float:
        """Coefficient of determination R2, averaged over parameters: without y, for new simulations.

        Without y, the logarithms of the parameters of 500 simulations are scored, from the same bounds and with the
        same noise; the regressor was not trained on them. With y, `predict` is scored over complete rows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_modes), optional
            Frequencies in Hz. Without y ignored.
        y : array-like or DataFrame of shape (n_samples, n_parameters), optional
            Multipliers of each row of X.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row; weights in a series are matched to the rows of a frame by index. Without y ignored.

        Returns
        -------
        float
            At most 1. With y, NaN if fewer than two rows are complete.

        Raises
        ------
        ValueError
            If there is no y, and `fit` has learned from given frequencies and parameters.

        Notes
        -----
        The 500 simulations are always the same, so that scores of different regressors and numbers of samples can be
        compared; scores for different ``bounds`` or ``noise`` cannot. One fold is enough.

        Examples
        --------
        >>> from sklearn.model_selection import GridSearchCV, ShuffleSplit
        >>> from skthermo.datasets import make_truss, make_truss_campaign
        >>> from skthermo.surrogate import InverseSurrogate
        >>> inverse = InverseSurrogate(make_truss(), bounds=0.2, n_samples=200, random_state=0)
        >>> networks = {"regressor__hidden_layer_sizes": [(2,), (32,)]}
        >>> search = GridSearchCV(inverse, networks, cv=ShuffleSplit(1)).fit(make_truss_campaign().frequencies)
        >>> search.cv_results_["mean_test_score"].round(1), search.best_params_
        (array([0.4, 0.7]), {'regressor__hidden_layer_sizes': (32,)})
        """
        check_is_fitted(self)
        if y is not None:
            return super().score(X, y, sample_weight)
        if self.bounds_ is None:
            raise ValueError("InverseSurrogate has learned from given parameters, not simulations; expected y to score")
        random = np.random.RandomState(20_260_000)  # the same simulations for all settings that are compared
        samples = self._drawn(500, random)
        noisy = add_noise(samples.frequencies, self.noise_, random_state=random)
        return complete_r2(np.log(samples.theta), np.log(self._regress(noisy)[0]))

    def round_trip(self) -> Array:
        """Relative errors of the model's nominal frequencies after inversion and another solution.

        Such an error goes into everything that is simulated with the parameters found.

        Returns
        -------
        ndarray of shape (n_modes,)
            At the nominal state or, where that is outside the box of the samples, at the nearest one inside.

        Raises
        ------
        ValueError
            If the estimator has no model.
        """
        check_is_fitted(self)
        model, state = self._checked_model(), np.ones((1, self.n_parameters_))
        nominal = evaluate(model, state if self.bounds_ is None else np.clip(state, *self.bounds_.T))
        return (evaluate(model, self._regress(nominal)[0]) / nominal - 1)[0]

    def _drawn(self, n_samples: int, random: np.random.RandomState) -> Bunch:
        """Samples in the box; read from the memory if they are there."""
        seed = random.randint(np.iinfo(np.int32).max)
        settings = self.model, self.bounds_, n_samples, seed, self.n_jobs
        return remembered(self.memory, drawn_samples, *settings, ignore=["n_jobs"])

    def _inputs(self, X: ArrayLike) -> Array:
        check_is_fitted(self)
        return self._positive(X, None if self.log_inputs_ else 0)


def drawn_samples(model: FEModel, bounds: Array, n_samples: int, seed: int, n_jobs: int | None) -> Bunch:
    """Random samples in a box, as a memory keeps them."""
    return sample(model, bounds, n_samples, n_jobs=n_jobs, random_state=seed)


def far_outside(theta: Array, bounds: Array, names: Sequence[str]) -> list[SkthermoWarning]:
    """The finding that 5 % of the rows have parameters far outside the bounds, where a regressor extrapolates."""
    known, middle, half = theta[~np.isnan(theta).any(axis=1)], bounds.mean(axis=1), np.diff(bounds, axis=1)[:, 0] / 2
    least = np.maximum(middle - 2 * half, bounds[:, 0] / 2)  # positive
    far = (known < least) | (known > middle + 2 * half)
    rows = far.any(axis=1)
    if not rows.size or rows.mean() <= 0.05:
        return []
    listed = ", ".join(repr(name) for name, is_far in zip(names, far.any(axis=0), strict=True) if is_far)
    return [
        ModelWarning(
            f"many rows give parameters farther outside the bounds than half their width: {listed}. Give frequencies "
            "in Hz in the order of the model's modes, wider bounds, or the noise of the measurement",
            "outside-bounds",
        )
    ]
