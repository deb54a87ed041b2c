"""The inverse surrogate M1: frequencies to parameters."""

from __future__ import annotations

from collections.abc import Mapping
from numbers import Integral, Real
from typing import Literal, overload

import numpy as np
import pandas as pd
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator
from sklearn.utils import Bunch, check_random_state

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, Bounds, as_floats, check_model, check_noise, check_theta
from skthermo._tables.frames import frame_like
from skthermo._validation import (
    CallbackSupport,
    HasMethods,
    Interval,
    Stages,
    StrOptions,
    TransformerMixin,
    _fit_context,
    check_is_fitted,
)
from skthermo.exceptions import ModelWarning
from skthermo.fem import FEModel, evaluate
from skthermo.metrics.errors import complete_r2
from skthermo.surrogate._regression import MultiplierRegressor, default_network
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.inverse._refinement import FAR_OUTSIDE, Refinement, unconverged
from skthermo.surrogate.inverse._training import InverseColumns, Inversions, ShapeScores, SimulatedTraining, held_out

DEFAULT_STEPS = 100
MANY_UNCONVERGED = 0.01  # share of rows that have not converged above which a warning is given
MANY_BY_FULL_MODEL = 0.01  # share of rows that the full model solves beside a reduced one, likewise


class InverseSurrogate(CallbackSupport, TransformerMixin, MultiplierRegressor):
    """Parameters of an FE model from frequencies and mode shapes, learned from simulations; equations (3)-(4).

    Draws parameters from a box, solves the FE model, and learns the inverse, M1 ~ FEM^-1 [KCM26]_ [KMH24]_.

    Parameters
    ----------
    model : FE model, optional
        Needed unless `fit` gets frequencies and parameters.
    regressor : regressor, optional
        Learns the standardised logarithms of the parameters from those of the frequencies, a nearly linear relation;
        one of a single output is fitted once for each parameter. By default a small ``MLPRegressor``; see
        `paper_network` for the paper's.
    bounds : float, array-like of shape (n_parameters, 2) or mapping, default=0.3
        Box of multipliers: a half-width, or lowest and highest multiplier of each parameter, or a mapping from each
        parameter to either.
    n_samples : int, default=1000
        Number of simulations.
    narrow_bounds : bool, default=False
        Whether to simulate as many samples again within the part of the bounds where the records that `fit` sees have
        their parameters, and to learn from them alone. An inverse that is not refined becomes more accurate there.
    noise : "auto", float or array-like of shape (n_modes,), default="auto"
        Relative standard deviation of Gaussian noise added to the simulated frequencies: that of the measurement. With
        0, frequencies count as exact (to 1e-6; to 0.1 % in rows where a mode is missing). "auto" is estimated: by a
        `DataInformedFEM` from temperatures and frequencies; without temperatures, from what the model leaves
        unexplained of the records that `fit` sees, if estimates are refined and there are more modes than parameters;
        otherwise it is 0.
    dofs : array-like of int of shape (n_sensors,), or list of (node, direction), optional
        Degrees of freedom of the model where mode shapes are measured, by position, the first being 0, or by label, as
        in ``model.dofs``. Rows of X are then the frequencies followed by the shapes' real components at the sensors
        (`~skthermo.fem.shape_components`), mode by mode: n_modes * (1 + n_sensors) columns.
    shape_noise : float or array-like of shape (n_modes,), default=0.01
        Standard deviation of the measured components of a shape as a share of their root mean square.
    refine : int, optional
        Largest number of Levenberg-Marquardt steps on the FE model that improve the regressor's estimate of each row
        (:doc:`/guide/estimation`). By default 100 for a model that gives exact derivatives (``linearised`` or
        ``jacobian``; with ``dofs``, ``linearised_modes``), else 0. With a number above 0, other models are
        differentiated by central differences: 2 n_parameters + 1 solutions a step and row.
    prior : float, array-like of shape (n_parameters,) or mapping, optional
        Standard deviations of a Gaussian prior of ln theta about the middle of the bounds, for refining. By default
        that of values spread evenly over the box.
    reduce : "auto", bool or float, default="auto"
        Whether to simulate and refine with the reduced model ``model.reduced(bounds)``, much faster for large models.
        "auto" reduces where ``model.reduction_pays`` and a basis is accurate. True allows a relative error of 1e-5 in
        the frequencies, as "auto" does; a number sets the error allowed. Rows that end outside its box are solved by
        the full model, with a warning that counts them (:doc:`/guide/costs`).
    memory : str or joblib.Memory, optional
        Folder for simulations, reduced model, regressor and inversion of the records that `fit` saw, so that searches
        and cross-validation make each only once (:doc:`/guide/costs`). With ``random_state=None``, what is stored is
        always the same. Clear the memory when the program behind a model or a regressor of your own changes.
    n_jobs : int, optional
        Number of parallel jobs for the simulations.
    random_state : int, RandomState or None, default=None
        Seed of the samples, of the noise, and of the regressor unless it has its own seed.
    verbose : bool or int, default=0
        Whether `fit` prints a line with the time of each of its stages.

    Attributes
    ----------
    regressor_ : regressor
        Fitted to standardised log frequencies (inputs) and standardised log parameters (outputs).
    inputs_, targets_ : Standardiser
        Means and scales of the log frequencies and of the log parameters.
    samples_ : Bunch
        ``theta``, ``frequencies`` and, with ``dofs``, ``shapes`` of the training samples, before noise.
    columns_ : InverseColumns
        How columns are read, named and computed.
    shape_inputs_, scores_ : ShapeInputs, ShapeScores
        With ``dofs``: how columns of shapes are read (``reference`` holds the nominal shapes at the sensors), and the
        linear estimates that the regressor sees in place of them.
    simulator_ : Simulator
        If there is a model: it and, where it is reduced, its reduced model.
    refinement_, inversions_ : Refinement, Inversions
        If estimates are refined: the model, the box and the prior of the steps, and the inversions of the records of
        `fit`.
    box_ : Box or None
        The bounds of the samples, if they were simulated; else None.
    noise_ : ndarray of shape (n_modes,)
        If there is a model: the relative standard deviations that count.
    n_steps_ : int
        Largest number of steps that refine an estimate; 0 if estimates are not refined.
    scatter_ : ndarray of shape (n_modes,)
        Relative standard deviations of the frequencies that those of refined estimates are based on: ``noise_`` or,
        where it is 0, what the model leaves unexplained of the records of `fit`, or 0.001.
    n_parameters_, parameter_names_ : int, list of str or None
        Number of parameters, and their names: the model's, or those of the frame that `fit` saw.
    y_is_vector_ : bool
        Whether `fit` saw one parameter as a vector.
    n_features_in_, feature_names_in_ : int, ndarray of str
        Number of columns of X and, where `fit` saw a frame with such, their names.

    Notes
    -----
    Frequencies cannot determine more parameters than there are modes, and an estimate is an effective stiffness, not a
    material property. Refined estimates do not depend on the regressor: noise-free, they are exact to 1e-5 %.
    :doc:`/guide/estimation` says what the steps minimise, where they begin and end, and what shapes add;
    :doc:`/accuracy_regressors` compares regressors, :doc:`/guide/costs` has the size of a ``memory``.

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
        "narrow_bounds": ["boolean"],
        "noise": [StrOptions({"auto"}), Interval(Real, 0, None, closed="left"), "array-like"],
        "dofs": ["array-like", None],
        "shape_noise": [Interval(Real, 0, 1, closed="neither"), "array-like"],
        "refine": [Interval(Integral, 0, None, closed="left"), None],
        "prior": [Interval(Real, 0, None, closed="neither"), "array-like", dict, None],
        "reduce": [StrOptions({"auto"}), "boolean", Interval(Real, 0, 1, closed="neither")],
        "memory": [str, HasMethods(["cache"]), None],
        "n_jobs": [Integral, None],
        "random_state": ["random_state"],
        "verbose": ["verbose"],
    }

    def __init__(
        self,
        model: FEModel | None = None,
        regressor: BaseEstimator | None = None,
        *,
        bounds: Bounds = 0.3,
        n_samples: int = 1000,
        narrow_bounds: bool = False,
        noise: ArrayLike | Literal["auto"] = "auto",
        dofs: ArrayLike | None = None,
        shape_noise: ArrayLike = 0.01,
        refine: int | None = None,
        prior: ArrayLike | Mapping[str, float] | None = None,
        reduce: bool | float | Literal["auto"] = "auto",
        memory: str | Memory | None = None,
        n_jobs: int | None = None,
        random_state: int | np.random.RandomState | None = None,
        verbose: bool | int = 0,
    ):
        self.model = model
        self.regressor = regressor
        self.bounds = bounds
        self.n_samples = n_samples
        self.narrow_bounds = narrow_bounds
        self.noise = noise
        self.dofs = dofs
        self.shape_noise = shape_noise
        self.refine = refine
        self.prior = prior
        self.reduce = reduce
        self.memory = memory
        self.n_jobs = n_jobs
        self.random_state = random_state
        self.verbose = verbose

    @_fit_context(prefer_skip_nested_validation=False)
    def fit(self, X: ArrayLike | None = None, y: ArrayLike | None = None) -> InverseSurrogate:
        """Learn the inverse.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features), optional
            Frequencies in Hz and, with ``dofs``, components of shapes. Without y they give the columns, ``scatter_``
            and, with ``narrow_bounds``, the bounds.
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
            infeasible, multipliers of a model are not positive, or a model that is to be reduced has no method for it.

        Warns
        -----
        UserWarning
            If there are more parameters than modes, or modes change their order in more than a tenth of the simulations
            and the model does not track them.
        """
        random_state = 0 if self.random_state is None and self.memory is not None else self.random_state
        random = check_random_state(random_state)
        seed = None if random_state is None else random
        if self.model is None and self.refine:
            raise ValueError(f"refine is {self.refine} without a model; expected an FE model to refine on")
        self.n_steps_ = 0 if self.model is None else self.steps_on(self.model)
        self.columns_ = InverseColumns.of(self)
        self.shape_inputs_ = self.columns_.shapes
        if self.model is not None:
            check_model(self.model)
            self.noise_ = check_noise(self._stated_noise, self.model.n_modes, getattr(X, "columns", None))
        is_simulated = self.model is not None and y is None
        n_learned = 1 + bool(self.narrow_bounds)
        stages = Stages(self, (2 * n_learned if is_simulated else 1) + (self.n_steps_ > 0), X, y)
        if is_simulated:
            self._learn_simulations(X, random, seed, stages)
        else:
            self._learn_pairs(X, y, seed, stages)
        if self.n_steps_:
            with stages.stage("scatter of the records"):
                measured = np.ones((0, self.n_features_in_)) if X is None else self.columns_.read(self, X)
                guess = self._estimate(measured)[0]
                self.inversions_ = Inversions.of(self.memory, Refinement.of(self), measured, guess)
                self.refinement_ = self.inversions_.refinement
                self.simulator_ = self.refinement_.simulator
                self.scatter_ = self.inversions_.scatter(measured, guess)
                if isinstance(self.noise, str) and self.inversions_.tells_noise(measured):
                    self.noise_ = self.scatter_
                    self.inversions_ = self.inversions_.with_noise(self.noise_)
                    self.refinement_ = self.inversions_.refinement
        stages.end()
        return self

    @overload
    def fit_transform(self, X: pd.DataFrame, y: ArrayLike | None = None) -> pd.DataFrame: ...
    @overload
    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None) -> NDArray[np.float64]: ...
    def fit_transform(self, X: ArrayLike, y: ArrayLike | None = None) -> NDArray[np.float64] | pd.DataFrame:
        """Fit, and return the parameters of the same records.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz and, with ``dofs``, components of shapes.
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
        X : array-like or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz and, with ``dofs``, components of shapes.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_parameters)
            NaN in rows without any mode and, without refining, where one is missing. A frame gives a frame on its own
            index.

        Warns
        -----
        UserWarning
            If more than 5 % of the rows give parameters that are farther outside the bounds than half the width of
            the box.
        """
        theta = self._predict_arrays(X)[0]
        if not self.n_steps_ and self.box_ is not None:
            self._warn_of_box(theta, self.box_.far_outside(theta), "farther outside the bounds than half their width")
        return frame_like(X, theta, self.get_feature_names_out())

    def invert(self, X: ArrayLike) -> Bunch:
        """Parameters of measured frequencies, and how sure they are.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz and, with ``dofs``, components of shapes; NaN is allowed.

        Returns
        -------
        Bunch
            - ``theta`` (n_samples, n_parameters): the multipliers, NaN in rows without any mode, and in rows with a
              missing mode that have stalled;
            - ``std`` (n_samples, n_parameters): their posterior standard deviations by Laplace's approximation, given
              ``scatter_`` and the prior; those of the prior in rows that have stalled;
            - ``residuals`` (n_samples, n_modes): ln f measured minus ln f of the model at theta, NaN where a mode is
              missing and in rows that have stalled;
            - ``weight`` (n_samples,): mean precision of the parameters as a share of what all modes would give, 1 in
              complete rows and 0 in rows without any mode;
            - ``converged`` (n_samples,): whether the steps have converged. Rows that have run out of steps keep what
              they have reached; rows that have stalled keep the regressor's estimate;
            - ``outside`` (n_samples, n_parameters): whether a parameter contradicts the prior: farther from the middle
              of the bounds than their whole width, and by more than its uncertainty explains;
            - ``solves``, ``full_solves`` (n_samples,): how often a model was solved with its derivatives for the row,
              and how many of these were of the full model because steps ended outside the box of the reduced one.

        Raises
        ------
        ValueError
            If the estimator does not refine.

        Examples
        --------
        >>> from skthermo.datasets import make_truss
        >>> from skthermo.surrogate import InverseSurrogate
        >>> model = make_truss()
        >>> inverse = InverseSurrogate(model, bounds=0.2, noise=0.001, random_state=0).fit()
        >>> found = inverse.invert(model.frequencies([[0.95, 1.05, 0.9, 1.0]]))
        >>> found.theta.round(3), found.std.round(3)
        (array([[0.95 , 1.05 , 0.9  , 1.001]]), array([[0.006, 0.008, 0.002, 0.095]]))
        """
        check_is_fitted(self)
        if not self.n_steps_:
            raise ValueError(
                f"refine is {self.refine}, which means no steps for {self.model!r}; expected a positive number of steps"
            )
        inputs = self.columns_.read(self, X)
        found = self.inversions_.found(inputs, self._estimate(inputs)[0], self.scatter_)
        names = self.get_feature_names_out()
        found.update(theta=frame_like(X, found.theta, names), std=frame_like(X, found.std, names))
        return found

    def warn_of(self, found: Bunch) -> None:
        """Warn if many rows have not converged, are solved by the full model or are far outside the bounds.

        Parameters
        ----------
        found : Bunch
            What `invert` has given.
        """
        theta = as_floats(found.theta)
        rows = np.flatnonzero(unconverged(found))
        if rows.size > MANY_UNCONVERGED * len(theta):
            warn_user(
                f"{rows.size} of {len(theta)} rows did not converge in {self.n_steps_} steps, row {rows[0]} the first. "
                "They keep what they reached, or the regressor's estimate. Raise refine, or use a model with "
                "track=True where modes cross",
                ModelWarning,
                "not-converged",
            )
        rows = np.flatnonzero(found.full_solves)
        if rows.size > MANY_BY_FULL_MODEL * len(theta):
            warn_user(
                f"the parameters of {rows.size} of {len(theta)} rows, row {rows[0]} the first, are outside the box of "
                f"the reduced model. The full one was solved {found.full_solves.sum()} times, which takes longer. Give "
                "wider bounds, or the noise of the measurement",
                ModelWarning,
                "outside-reduced-model",
            )
        tested = f"farther from the prior's mean than {FAR_OUTSIDE:.2g} times the spread expected of these modes"
        self._warn_of_box(theta, found.outside, tested)

    def score(
        self, X: ArrayLike | None = None, y: ArrayLike | None = None, sample_weight: ArrayLike | None = None
    ) -> float:
        """Coefficient of determination R2, averaged over parameters: without y, of the regressor on new simulations.

        Without y, so that searches can compare regressors, the score is that of the logarithms of the parameters that
        the regressor itself gives, not refined, for 500 simulations that it was not trained on, from the same bounds
        and with the same noise. With y, the score is that of `predict`, over complete rows.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_features), optional
            Frequencies in Hz and, with ``dofs``, components of shapes. Without y ignored.
        y : array-like or DataFrame of shape (n_samples, n_parameters), optional
            Multipliers of each row of X.
        sample_weight : array-like of shape (n_samples,), optional
            Weight of each row; those of a series are matched to the rows of a frame by index. Without y ignored.

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
        compared; those of different ``bounds`` or ``noise`` cannot. One fold is enough, and ``refine=0`` the fastest.

        Examples
        --------
        >>> from sklearn.model_selection import GridSearchCV, ShuffleSplit
        >>> from skthermo.datasets import make_truss, make_truss_campaign
        >>> from skthermo.surrogate import InverseSurrogate
        >>> inverse = InverseSurrogate(make_truss(), bounds=0.2, n_samples=300, refine=0, random_state=0)
        >>> networks = {"regressor__hidden_layer_sizes": [(2,), (32,)]}
        >>> search = GridSearchCV(inverse, networks, cv=ShuffleSplit(1)).fit(make_truss_campaign().frequencies)
        >>> search.cv_results_["mean_test_score"].round(1), search.best_params_
        (array([0.5, 0.8]), {'regressor__hidden_layer_sizes': (32,)})
        """
        check_is_fitted(self)
        if y is not None:
            return super().score(X, y, sample_weight)
        if self.box_ is None:
            raise ValueError("InverseSurrogate has learned from given parameters, not simulations; expected y to score")
        inputs, theta = held_out(self, self._stated_noise)
        if self.shape_inputs_ is not None:
            inputs = self.shape_inputs_.normalised(inputs)
        return complete_r2(np.log(theta), np.log(self._estimate(inputs)[0]))

    @overload
    def inverse_transform(self, X: pd.DataFrame) -> pd.DataFrame: ...
    @overload
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64]: ...
    def inverse_transform(self, X: ArrayLike) -> NDArray[np.float64] | pd.DataFrame:
        """Frequencies and, with ``dofs``, shapes of given parameters, computed by the FE model.

        Parameters
        ----------
        X : array-like or DataFrame of shape (n_samples, n_parameters)
            Multipliers.

        Returns
        -------
        ndarray or DataFrame of shape (n_samples, n_features)
            Frequencies in Hz, followed by components of shapes with a root mean square of 1; NaN in rows with NaN. A
            frame, whose columns must be the model's parameters, gives a frame on its own index.

        Raises
        ------
        ValueError
            If the estimator has no model, or the parameters are not the model's.
        """
        check_is_fitted(self)
        self._check_has_model()
        names = getattr(self, "feature_names_in_", self.columns_.names())
        return frame_like(X, self.columns_.of_parameters(X), names)

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the parameters.

        Parameters
        ----------
        input_features : array-like of str, optional
            Ignored.

        Returns
        -------
        ndarray of str
            The model's parameter names, else y's columns, else theta1, theta2, ...
        """
        check_is_fitted(self)
        numbered = [f"theta{i + 1}" for i in range(self.n_parameters_)]
        return np.array(self.parameter_names_ or numbered, dtype=object)

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
        self._check_has_model()
        state = np.ones((1, self.n_parameters_))
        nominal = self.columns_.of_parameters(state if self.box_ is None else np.clip(state, *self.box_.bounds.T))
        theta = self._estimate(nominal)[0]
        if self.n_steps_:
            theta = self.refinement_.refined(nominal, theta, self.scatter_).theta
        return (evaluate(self.model, theta) / nominal[:, : self.model.n_modes] - 1)[0]

    def _check_has_model(self) -> None:
        if self.model is None:
            raise ValueError("InverseSurrogate has no model; expected an FE model to turn parameters into frequencies")

    @property
    def _stated_noise(self) -> ArrayLike:
        """The noise of the simulations: what is stated, which is nothing where it is estimated."""
        return 0.0 if isinstance(self.noise, str) else self.noise

    def steps_on(self, model: FEModel) -> int:
        """Largest number of steps that refine an estimate on a model: 0 if estimates are not refined.

        Parameters
        ----------
        model : FE model
            The one that this inverse has, or gets in a chain.

        Returns
        -------
        int
            ``refine`` or, where it is None, 100 on a model that gives exact derivatives.
        """
        is_differentiable = hasattr(model, "linearised") or hasattr(model, "jacobian")
        if self.dofs is not None:
            is_differentiable = hasattr(model, "linearised_modes")
        return (DEFAULT_STEPS if is_differentiable else 0) if self.refine is None else int(self.refine)

    def _learn_pairs(
        self, X: ArrayLike | None, y: ArrayLike | None, seed: np.random.RandomState | None, stages: Stages
    ) -> None:
        """Learn from given frequencies and parameters."""
        inputs, theta = self._read_xy(X, y, ("frequencies", "theta"))
        if self.model is not None:
            check_theta(theta, self.model.parameter_names, allow_nan=True)
            self.parameter_names_ = list(self.model.parameter_names)
            self.simulator_ = Simulator(self.model)
            if self.shape_inputs_ is not None:
                self.columns_.check(self, X)
        self.box_, self.samples_ = None, Bunch(theta=theta, frequencies=inputs)
        with stages.stage("regressor"):
            self._learn_inverse(inputs, theta, seed)

    def _learn_simulations(
        self, X: ArrayLike | None, random: np.random.RandomState, seed: np.random.RandomState | None, stages: Stages
    ) -> None:
        """Learn from simulations, and once more from a narrower box if that is asked for."""
        check_model(self.model)
        self.columns_.check(self, X)
        self.parameter_names_, self.y_is_vector_ = list(self.model.parameter_names), False
        with stages.stage("simulations"):
            n_refined = 0 if X is None or not self.n_steps_ else len(X)
            training = SimulatedTraining.of(self, random, n_refined)
        with stages.stage("regressor"):
            self._learn_samples(training.samples, random, seed)
        if self.narrow_bounds:
            with stages.stage("narrower simulations"):
                estimates = np.empty((0, 1)) if X is None else self._estimate(self.columns_.read(self, X))[0]
                training = training.narrower(self, random, estimates)
            with stages.stage("regressor again"):
                self._learn_samples(training.samples, random, seed)
        self.box_, self.samples_, self.simulator_ = training.box, training.samples, training.simulator

    def _learn_samples(self, samples: Bunch, random: np.random.RandomState, seed: np.random.RandomState | None) -> None:
        """Fit the regressor to simulated samples with noise."""
        self._learn_inverse(self.columns_.noisy(samples, self.noise_, random), samples.theta, seed)

    def _learn_inverse(self, inputs: Array, theta: Array, seed: np.random.RandomState | None) -> None:
        """Fit the regressor, which sees scores in place of the components of shapes."""
        if self.shape_inputs_ is not None:
            inputs = self.shape_inputs_.normalised(inputs)
            self.scores_ = ShapeScores(self.shape_inputs_.n_modes, inputs, theta)
            inputs = self.scores_.transform(inputs)
        self._learn(inputs, theta, seed, log_inputs=True, memory=self.memory)

    def _estimate(self, inputs: Array, return_std: bool = False) -> tuple[Array, Array]:
        """What the regressor gives for columns that have been read."""
        return self._regress(inputs if self.shape_inputs_ is None else self.scores_.transform(inputs), return_std)

    def _predict_arrays(self, X: ArrayLike, return_std: bool = False) -> tuple[Array, Array]:
        check_is_fitted(self)
        if not self.n_steps_:
            return self._estimate(self.columns_.read(self, X), return_std)
        found = self.invert(X)
        self.warn_of(found)
        return as_floats(found.theta), as_floats(found.std)

    def _warn_of_box(self, theta: Array, far: NDArray[np.bool_], tested: str) -> None:
        message = "" if self.box_ is None else self.box_.warning(theta, far, tested)
        if message and self.prior is not None:
            message += ", or a wider prior"
        warn_user(message, ModelWarning, "outside-prior")
