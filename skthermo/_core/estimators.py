"""Wrappers of scikit-learn's private functions, which are imported only here, and types of its public ones; FE models,
seeds and default parts inside estimators; regressors, their weights and what they offer; stages of a fit; packages that
may be missing."""

from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from importlib import import_module
from numbers import Integral
from types import ModuleType
from typing import TYPE_CHECKING, Any, Literal, Self, TypeVar, overload

import numpy as np
import pandas as pd
import sklearn.utils
import sklearn.utils._param_validation
import sklearn.utils.validation
from numpy.typing import ArrayLike, NDArray
from sklearn import config_context
from sklearn.base import BaseEstimator, clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.impute._base import _BaseImputer
from sklearn.linear_model import LinearRegression
from sklearn.model_selection._search import BaseSearchCV
from sklearn.multioutput import MultiOutputRegressor
from sklearn.neighbors._base import _get_weights
from sklearn.pipeline import Pipeline
from sklearn.utils import _safe_indexing, check_random_state
from sklearn.utils._metadata_requests import _routing_enabled
from sklearn.utils._param_validation import HasMethods, InvalidParameterError, StrOptions
from sklearn.utils._user_interface import _print_elapsed_time
from sklearn.utils.metadata_routing import get_routing_for_object
from sklearn.utils.validation import _check_feature_names_in, _num_samples, check_is_fitted, has_fit_parameter

from skthermo._core.arrays import (
    HUGE,
    Array,
    as_columns,
    as_floats,
    is_model,
    is_numbered,
    refuse_huge,
    refuse_no_table,
)
from skthermo.exceptions import WeatherWarning

if TYPE_CHECKING:  # scikit-learn has no types: without these, a decorated fit and every fit_transform would be Any
    Method = TypeVar("Method", bound=Callable[..., Any])

    def _fit_context(*, prefer_skip_nested_validation: bool) -> Callable[[Method], Method]: ...

    class TransformerMixin:
        """Transformers that give frames for frames, and arrays for arrays."""

        @overload
        def fit_transform(self, X: pd.DataFrame, y: Any = None) -> pd.DataFrame: ...
        @overload
        def fit_transform(self, X: ArrayLike, y: Any = None) -> NDArray[np.float64]: ...
        def fit_transform(self, X: Any, y: Any = None) -> Any: ...
        def set_output(self, *, transform: Literal["default", "pandas", "polars"] | None = None) -> Self: ...
else:
    from sklearn.base import TransformerMixin, _fit_context

try:  # scikit-learn from 1.9
    from sklearn.callback import CallbackSupportMixin as CallbackSupport
except ImportError:

    class CallbackSupport:  # type: ignore[no-redef]
        """Stands for scikit-learn's mixin where there are no callbacks yet."""


class Estimator(BaseEstimator):
    """Base of estimators that accept NaN in X, and whose clones share FE models."""

    def _validate_params(self) -> None:
        if isinstance(getattr(self, "random_state", None), bool):
            raise InvalidParameterError(
                f"The 'random_state' parameter of {type(self).__name__} is {self.random_state!r}; expected an integer, "
                "a RandomState or None"
            )
        for name, value in self.get_params(deep=False).items():
            if isinstance(value, type):
                raise InvalidParameterError(f"{name} is the class {value.__name__}; expected an instance of it")
        super()._validate_params()

    def __sklearn_clone__(self) -> Self:
        parameters = self.get_params(deep=False)
        twin = type(self)(**{k: v if is_model(v) else clone(v, safe=False) for k, v in parameters.items()})
        for name in ("_metadata_request", "_sklearn_output_config"):
            if hasattr(self, name):
                setattr(twin, name, clone(getattr(self, name), safe=False))
        if hasattr(self, "_skl_callbacks"):
            twin._skl_callbacks = self._skl_callbacks  # as scikit-learn does: clones share callbacks
        return twin

    def _default_part(self, name: str) -> BaseEstimator | None:
        """Hook: the estimator that a parameter stands for where it is None or "auto"; None where there is none."""
        return None

    def set_params(self, **params: Any) -> Self:
        """Set parameters, also of parts, as in ``set_params(part__parameter=value)``.

        Where a part is None or "auto" and stands for a default, that default takes its place and gets the parameters.

        Parameters
        ----------
        **params : dict
            Names and values.

        Returns
        -------
        object
            This estimator.

        Raises
        ------
        ValueError
            If there is no such parameter, or it has no parameters of its own.
        """
        own = {name: value for name, value in params.items() if "__" not in name}
        nested: dict[str, dict[str, Any]] = {}
        for name, value in params.items():
            part, parts, parameter = name.partition("__")
            if parts:
                nested.setdefault(part, {})[parameter] = value
        super().set_params(**own)
        for name, values in nested.items():
            part = self.get_params(deep=False).get(name, self)
            is_default = part is None or (isinstance(part, str) and part == "auto")
            default = self._default_part(name) if is_default else None
            if default is not None:
                super().set_params(**{name: default.set_params(**values)})
            elif hasattr(part, "set_params"):  # of an unknown part, scikit-learn says so
                super().set_params(**{f"{name}__{parameter}": value for parameter, value in values.items()})
            else:
                raise ValueError(
                    f"{name} is {part!r:.100}, without parameters such as {min(values)!r}; expected an estimator"
                )
        return self

    def _validated(self, X: ArrayLike, *, reset: bool, **options: Any) -> NDArray[np.float64]:
        return validate_data(self, X, reset=reset, **options)

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.allow_nan = True
        return tags


class Interval(sklearn.utils._param_validation.Interval):
    """scikit-learn's interval without True and False, which would count as 1 and 0."""

    def is_satisfied_by(self, val: Any) -> bool:
        """Whether a value is a number within the interval."""
        return not isinstance(val, bool | np.timedelta64) and super().is_satisfied_by(val)


def validate_data(estimator: BaseEstimator, X: Any, *, reset: bool = True, **options: Any) -> Array:
    """scikit-learn's `validate_data` of a table of numbers, as `check_array` reads it."""
    values = check_array(X, input_name="X", estimator=estimator, **options)
    sklearn.utils.validation.validate_data(estimator, X, reset=reset, skip_check_array=True)
    return values


def check_array(values: Any, *, input_name: str = "y", allow_infinite: bool = False, **options: Any) -> Array:
    """A C-ordered copy of a table of numbers as floats of 64 bits; masked and missing values are NaN.

    scikit-learn's `check_array` takes the options. With ``allow_infinite``, infinite values stay, because the caller
    lists them among other errors.
    """
    is_frame = isinstance(values, pd.DataFrame) and set(values.dtypes) == {np.dtype(float)}
    if is_frame and values.columns.is_unique and values.columns.inferred_type == "string":
        numbers = values.to_numpy()
    elif type(values) is np.ndarray and values.ndim == 2 and values.dtype == float:
        numbers = values
    else:
        refuse_no_table(values, input_name, or_vector=not options.get("ensure_2d", True))
        numbers = as_floats(values)
    options |= {"dtype": np.float64, "order": "C", "copy": False, "ensure_all_finite": False}
    array = sklearn.utils.check_array(np.array(numbers, order="C"), input_name=input_name, **options)
    if allow_infinite or not (np.abs(array) > HUGE).any():
        return array
    infinite = np.isinf(array)
    if infinite.any():
        place = tuple(np.argwhere(infinite)[0])
        index, columns = getattr(values, "index", None), getattr(values, "columns", None)
        row = f"row {place[0]}" + (
            f" ({index[place[0]]})" if hasattr(values, "iloc") and not is_numbered(index) else ""
        )
        column = "" if len(place) < 2 else f" of column {int(place[1]) if columns is None else columns[place[1]]!r}"
        raise ValueError(
            f"{input_name} is infinite in {infinite.sum()} of {infinite.size} values, the first in {row}{column}; "
            "expected finite numbers, and NaN where a value is missing"
        )
    refuse_huge(array, input_name)
    return array


def seeded(random_state: Any) -> np.random.RandomState | None:
    """A RandomState, or None; with None, parts draw from numpy's global state."""
    return None if random_state is None else check_random_state(random_state)


def seed_parts(estimator: BaseEstimator, random_state: np.random.RandomState | None) -> None:
    """Seed every ``random_state`` of an estimator and its parts that is None, but not of FE models; None seeds nothing.
    A seed is drawn for every part, so that giving one its own does not change the seeds of the others."""
    if random_state is None:
        return
    parameters = estimator.get_params(deep=True)
    seeds = {}
    for name in sorted(parameters):
        if name == "random_state" or name.endswith("__random_state"):
            *parts, _ = name.split("__")
            if any(is_model(parameters.get("__".join(parts[: depth + 1]))) for depth in range(len(parts))):
                continue
            seed = random_state.randint(np.iinfo(np.int32).max)
            owners = ("__".join([*parts[:depth], "random_state"]) for depth in range(len(parts) + 1))
            if all(parameters.get(owner) is None for owner in owners):
                seeds[name] = seed
    estimator.set_params(**seeds)


def last_step(estimator: Any) -> Any:
    """The estimator at the end of a pipeline, the best one of a fitted search, or the estimator itself."""
    if isinstance(estimator, Pipeline):
        return last_step(estimator.steps[-1][1])
    if isinstance(estimator, BaseSearchCV):
        return last_step(getattr(estimator, "best_estimator_", estimator.estimator))
    return estimator


def with_means(estimator: Any, X: Any, y: Any) -> Any:
    """An estimator whose last step, a mapper that chooses means of earlier inputs, has them in a step before it."""
    last = last_step(estimator)
    if not hasattr(last, "behind_means") or isinstance(estimator, BaseSearchCV):
        return estimator
    return last.behind_means(X, y, estimator.steps[:-1] if isinstance(estimator, Pipeline) else ())


class Stages:
    """Announces one after the other of an estimator's stages.

    If the estimator is ``verbose``, a line with the elapsed time follows each of them. The callbacks of
    scikit-learn 1.9 and later, where the estimator supports them, see each stage as a task; those that are meant for
    parts reach them.
    """

    def __init__(self, estimator: Any, number: int, X: Any = None, y: Any = None):
        if not isinstance(estimator.verbose, Integral) or estimator.verbose < 0:
            raise ValueError(f"verbose is {estimator.verbose!r}; expected a boolean or an integer from 0")
        self._estimator, self._number, self._begun = estimator, number, 0
        begin = getattr(estimator, "_init_callback_context", None)
        self._task = None if begin is None else begin(max_subtasks=number)
        if self._task is not None:
            self._task.call_on_fit_task_begin(estimator=estimator, X=X, y=y)

    @contextmanager
    def stage(self, name: str, part: Any = None) -> Iterator[None]:
        """What runs inside is one stage, in which the part, if there is one, is fitted."""
        self._begun += 1
        line = f"({self._begun} of {self._number}) {name}" if self._estimator.verbose else None
        with ExitStack() as within:
            within.enter_context(_print_elapsed_time(type(self._estimator).__name__, line))
            if self._task is None:
                yield
                return
            task = self._task.subcontext(task_name=name)
            if hasattr(part, "set_callbacks"):
                within.enter_context(task.propagate_callback_context(part))
            task.call_on_fit_task_begin(estimator=self._estimator)
            yield
            task.call_on_fit_task_end(estimator=self._estimator)

    def end(self) -> None:
        """Say that all stages are done."""
        if self._task is not None:
            self._task.call_on_fit_task_end(estimator=self._estimator)


def routes_weights(estimator: Any) -> bool | None:
    """Whether a user has asked by metadata routing that ``fit`` hands on weights; None if routing is off or unasked."""
    parts = (estimator, *estimator.get_params().values())
    if not _routing_enabled() or not any(hasattr(part, "_metadata_request") for part in parts):
        return None
    router = get_routing_for_object(estimator)
    names = router._get_param_names(method="fit", return_alias=True, ignore_self_request=False)
    return "sample_weight" in names


def import_optional(module: str, *, extra: str) -> ModuleType:
    """Import ``module``; if it is missing, the error names the extra of skthermo that installs it.

    Raises
    ------
    ImportError
        If the module is not installed.

    Examples
    --------
    >>> import_optional("no_such_plotter", extra="plot")
    Traceback (most recent call last):
    ...
    ImportError: 'no_such_plotter' is not installed; get it with: pip install ".[plot]" in a copy of the repository
    """
    try:
        return import_module(module)
    except ImportError as error:
        command = f'pip install ".[{extra}]"'
        raise ImportError(f"{module!r} is not installed; get it with: {command} in a copy of the repository") from error


def fit_outputs(regressor: BaseEstimator, X: Any, y: Any, sample_weight: Array | None = None) -> BaseEstimator:
    """A clone of the regressor fitted to all outputs, or one clone for each output if it takes only one. Several
    outputs are tried: scikit-learn's tag is not reliable (False for ``MLPRegressor``)."""
    try:
        return fit_checked(clone(regressor), X, y, sample_weight)
    except InvalidParameterError:
        raise
    except Exception as error:
        if y.ndim == 1:
            raise
        try:
            return fit_checked(MultiOutputRegressor(regressor), X, y, sample_weight)
        except Exception:
            raise error from None


def fit_checked(regressor: BaseEstimator, X: Any, y: Any, sample_weight: Array | None = None) -> BaseEstimator:
    """Fit a regressor to records that were checked before, with weights if it takes them.

    The last part of a pipeline, or of a search, gets the arguments. A mapper there does not check its inputs again, as
    the steps before it may make features that are no temperatures. With metadata routing, where a user has requested or
    refused weights for some part, scikit-learn routes them.
    """
    last, steps = regressor, list[str]()
    while (part := inside(last)) is not None:
        steps += [last.steps[-1][0]] if isinstance(last, Pipeline) else []
        last = part
    options: dict[str, Any] = {}
    if hasattr(last, "behind_means") and (last is regressor or not _routing_enabled()):
        options["check_input"] = False
    if sample_weight is not None and takes_weights(regressor):
        if last is not regressor and routes_weights(regressor):
            return regressor.fit(X, y, sample_weight=sample_weight)
        options["sample_weight"] = sample_weight
    if last is regressor or not options:
        return regressor.fit(X, y, **options)
    with config_context(enable_metadata_routing=False):  # nobody has said which step gets them
        return regressor.fit(X, y, **{"__".join([*steps, name]): value for name, value in options.items()})


def takes_weights(estimator: Any) -> bool:
    """Whether ``fit`` of an estimator, and of the regressor that it hands weights on to, takes ``sample_weight``."""
    part = inside(estimator)
    if part is not None:
        routed = routes_weights(estimator)
        return takes_weights(part) if routed is None else routed
    regressor = getattr(estimator, "regressor", None)  # of a TemperatureMapper; its default one takes weights
    return has_fit_parameter(estimator, "sample_weight") and (regressor is None or takes_weights(regressor))


def check_takes_weights(estimator: Any) -> None:
    """Raise an error for an estimator whose ``fit`` takes no weights."""
    if not takes_weights(estimator):
        routed = ", by set_fit_request(sample_weight=True) with metadata routing" if _routing_enabled() else ""
        raise ValueError(
            f"sample_weight is given, but fit of {estimator!r:.200} takes no weights; expected an estimator that takes "
            f"them{routed}"
        )


def inside(estimator: Any) -> BaseEstimator | None:
    """The estimator that one of scikit-learn's wrappers hands arguments of ``fit`` on to; None for others."""
    if isinstance(estimator, Pipeline):
        return estimator.steps[-1][1]
    if isinstance(estimator, TransformedTargetRegressor):
        return LinearRegression() if estimator.regressor is None else estimator.regressor
    return estimator.estimator if isinstance(estimator, MultiOutputRegressor | BaseSearchCV) else None


def predict_with_std(regressor: Any, X: Any) -> tuple[Array, Array | None]:
    """Means of all outputs and, where ``predict`` takes ``return_std``, their standard deviations; else None."""
    if isinstance(regressor, MultiOutputRegressor):
        parts = [predict_with_std(part, X) for part in regressor.estimators_]
        means, deviations = zip(*parts, strict=True)
        return np.hstack(means), None if any(one is None for one in deviations) else np.hstack(deviations)
    try:
        means, deviations = regressor.predict(X, return_std=True)
    except (TypeError, ValueError):  # of a regressor that knows none, or of a router that hands none on
        return as_columns(regressor.predict(X)), None
    return as_columns(means), as_columns(deviations)


def inputs_of_last_step(estimator: Any, X: Any) -> Any:
    """What the last step of a fitted pipeline, or of a search over pipelines, is given, such as lagged temperatures."""
    estimator = getattr(estimator, "best_estimator_", estimator)
    if not isinstance(estimator, Pipeline):
        return X
    return inputs_of_last_step(estimator.steps[-1][1], estimator[:-1].transform(X) if len(estimator) > 1 else X)
