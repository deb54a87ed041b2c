"""Records that `DataInformedFEM` is fitted to, its parts, and what the inverse among them finds for each record."""

import re
import sys
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import FunctionTransformer

from skthermo._estimators.arguments import check_model, is_auto
from skthermo._estimators.regressors import inputs_of_last_step
from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import check_columns, check_same_rows, check_temperatures, column_names, frame_like
from skthermo._validation import check_array, last_step, seed_parts, seeded, validate_data
from skthermo.exceptions import FewRecordsWarning, ModelWarning, RecordsWarning, ResultWarning, SkthermoWarning
from skthermo.fem import shape_components
from skthermo.preprocessing import BiasAligner, RecordFindings, check_records
from skthermo.surrogate._mapper import TemperatureMapper
from skthermo.surrogate._memory import remembered
from skthermo.surrogate._simulator import Simulator
from skthermo.surrogate.chain._discrepancy import ratio_regressor
from skthermo.surrogate.inverse import InverseSurrogate
from skthermo.surrogate.refinement import ShapeInputs, unconverged

START_SAMPLES, START_PENALTY = 200, 1e-3
"""Simulations and ridge penalty of a regressor that merely gives the start of a refined estimate."""


def read_records(chain: Any, X: Any, y: Any) -> tuple[Any, Any]:
    """Copies of temperatures and frequencies, checked; frames stay frames."""
    model = chain.model
    check_model(model)
    if y is None:
        raise ValueError("This DataInformedFEM estimator requires y to be passed, but the target y is None")
    options = {"dtype": np.float64, "ensure_all_finite": "allow-nan", "copy": True}
    temperatures = validate_data(chain, X, ensure_min_samples=2, **options)
    chain.y_is_vector_ = np.ndim(y) == 1
    if chain.y_is_vector_:
        y = y.to_frame("f1" if y.name is None else y.name) if isinstance(y, pd.Series) else np.reshape(y, (-1, 1))
    T, F = frame_like(X, temperatures), frame_like(y, check_array(y, **options))
    check_same_rows(X, y, ("temperatures", "frequencies"))
    if F.shape[1] != model.n_modes:
        raise ValueError(f"frequencies have {F.shape[1]} columns; expected the {model.n_modes} modes of {model!r}")
    values = as_floats(F)
    wrong = ~np.isnan(values) & ~(values > 0)
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        raise ValueError(
            f"frequency {column_names(F, 'f')[column]!r} in row {row} is {values[row, column]:g}; expected positive "
            "numbers in Hz, and NaN where a mode is missing"
        )
    check_temperatures(T)
    check_columns(T, "temperature", varying=True)
    check_columns(F, "frequency")
    return T, F


def known_findings(memory: Any, T: Any, F: Any) -> RecordFindings:
    """What `check_records` finds, read from the memory if these records were checked before."""
    return remembered(memory, "checks", lambda: check_records(T, F), lambda: (T, F))


def without_outliers(findings: RecordFindings, F: Any) -> Any:
    """Frequencies without the outliers among them; findings may be of longer tables, of which these are rows."""
    far = findings.outliers
    if isinstance(F, pd.DataFrame) and far.index.is_unique:
        far = far.reindex(index=F.index, columns=F.columns, fill_value=False)
    if far.shape != F.shape or not far.to_numpy().any():
        return F
    return frame_like(F, np.where(far, np.nan, as_floats(F)), column_names(F, "f"))


def with_means(chain: Any, mapper: Any, findings: RecordFindings, T: Any) -> Any:
    """The default mapper with the means of earlier temperatures that the frequencies remember; any other unchanged."""
    features = getattr(findings.memory, "features", None)
    if chain.mapper is not None or features is None or not set(features.sensors) <= set(column_names(T, "T")):
        return mapper
    return make_pipeline(features, mapper)


def default_part(chain: Any, name: str) -> Any:
    """What inverse, mapper, aligner and discrepancy are by default; None for other parameters, and no discrepancy."""
    if name == "inverse":
        return InverseSurrogate(reduce=chain.reduce, n_jobs=chain.n_jobs)
    if name == "aligner":
        return BiasAligner(method="scale")
    if name == "mapper":
        return TemperatureMapper()
    return ratio_regressor() if is_auto(getattr(chain, name)) else None


def part_of(chain: Any, name: str) -> Any:
    """A clone of a part, or what it is by default."""
    part = getattr(chain, name)
    return default_part(chain, name) if part is None or is_auto(part) else clone(part)


def clone_parts(chain: Any) -> tuple[Any, Any, Any, Any]:
    """Clones of inverse, mapper, aligner and imputer, with the chain's model, and seeds where they have none."""
    unchanged = FunctionTransformer().set_output(transform="default")
    inverse, mapper = part_of(chain, "inverse"), part_of(chain, "mapper")
    aligner = unchanged if chain.aligner == "passthrough" else part_of(chain, "aligner")
    imputer = None if chain.imputer == "passthrough" else clone(chain.imputer)
    for part in (aligner, *aligner.get_params().values()):
        if isinstance(part, BiasAligner) and part.reference is None:
            part.set_params(reference=chain.model)
    names = list(chain.model.parameter_names)
    for part in surrogates_in(inverse):
        if part.model is None:
            part.set_params(model=chain.model)
        if part.memory is None:
            part.set_params(memory=chain.memory)
        if list(part.model.parameter_names) != names:
            raise ValueError(
                f"the inverse's model has the parameters {list(part.model.parameter_names)}; expected {names}, as "
                f"{chain.model!r} has"
            )
        if is_auto(part.reduce) and (not chain.reduce or hasattr(part.model, "reduced")):
            part.set_params(reduce=chain.reduce)
    random_state = seeded(chain.random_state)
    for part in (inverse, mapper, aligner, imputer):
        if part is not None:
            seed_parts(part, random_state)
    return inverse, mapper, aligner, imputer


def warn_of_inert(chain: Any, names: Iterable[str]) -> None:
    """Warn if a search of scikit-learn sets the regressor of an inverse that refines: no score depends on it."""
    frame = sys._getframe(2)
    while frame.f_code.co_name in ("set_params", "_set_params") and frame.f_back is not None:
        frame = frame.f_back  # past the estimators around the chain
    if not frame.f_globals.get("__name__", "").startswith("sklearn.model_selection"):
        return
    parts = {"inverse": chain.inverse} | {f"inverse__{name}": part for name, part in chain.inverse.get_params().items()}
    for name, part in parts.items():
        searched = [one for one in names if re.fullmatch(f"{name}__(regressor|n_samples|narrow_bounds)(__.*)?", one)]
        if searched and isinstance(part, InverseSurrogate) and part.steps_on(chain.model):
            warn_user(
                f"{searched[0]!r} is searched, but estimates are refined on the FE model, and do not depend on the "
                "regressor and its simulations: all settings score alike; expected refine=0 in the inverse, or a "
                "search over the InverseSurrogate itself, whose score is that of its regressor",
                ResultWarning,
                "inert settings searched",
            )


def with_quick_start(chain: Any, model: Any) -> Any:
    """An unfitted twin of a fitted chain, with another model, whose refining inverse learns a mere start quickly."""
    twin = clone(chain)
    parts = twin.get_params()
    twin.set_params(**{name: model for name, part in parts.items() if part is chain.model}, verbose=0, memory=None)
    inverse = chain.inverse_
    if isinstance(inverse, InverseSurrogate) and inverse.n_steps_:
        most = min(inverse.n_samples, START_SAMPLES)
        start = {"regressor": Ridge(START_PENALTY), "n_samples": most, "narrow_bounds": False, "dofs": None}
        start["memory"] = None  # others than the chain's own inversions are hardly asked for again
        twin.set_params(**{f"inverse__{name}": value for name, value in start.items()})
    return twin


def surrogates_in(inverse: Any) -> Iterator[InverseSurrogate]:
    """Every `InverseSurrogate` that an inverse is or holds."""
    return (part for part in (inverse, *inverse.get_params().values()) if isinstance(part, InverseSurrogate))


def simulator_of(chain: Any, theta: Array) -> Simulator:
    """What a fitted chain simulates with; where it is reduced, by M1's reduced model if that covers what M2 gives."""
    inverse = next(surrogates_in(chain.inverse_), None)
    return Simulator.around(chain.model, theta, chain.reduce, getattr(inverse, "simulator_", None))


SCARCE = 0.25  # mean weight of records with gaps below which a warning is given: four of six modes missing in each, say
FEW_SHAPES = 0.5  # share of measured modes with a complete shape below which a warning is given
UNLIKE = 5.0  # distance of median components from those of the model, in deviations of the noise, that gives a warning


@dataclass(frozen=True)
class Estimates:
    """What M1 finds for each training record: parameters and, where it refines, how the steps ended.

    ``full_solves`` tells how often the full model was solved for each because its steps left the box of the reduced
    model.
    """

    theta: Array
    n_unconverged: int | None = None
    full_solves: NDArray[np.intp] | None = None

    @classmethod
    def of(cls, inverse: Any, aligned: Any, parameter_names: list[str]) -> "Estimates":
        """What a fitted inverse finds for aligned records, with warnings where they tell little."""
        last = refining_step(inverse)
        if last is None:
            theta = as_floats(inverse.transform(aligned))
            if theta.shape[1] != len(parameter_names):
                raise ValueError(f"the inverse gave {theta.shape[1]} columns; expected {parameter_names}")
            return cls(theta)
        found = last.invert(inputs_of_last_step(inverse, aligned))
        last.warn_of(found)
        weight = found.weight[found.weight > 0].mean() if found.weight.any() else 1.0
        if weight < SCARCE:
            warn_user(
                f"because of gaps, a record carries on average {weight:.0%} of the parameter precision of a complete "
                "one, and estimates are drawn towards the model's nominal state; expected more modes a record, or "
                "imputer=KNNGapImputer()",
                FewRecordsWarning,
                "scarce modes",
            )
        return cls(as_floats(found.theta), int(unconverged(found).sum()), found.full_solves)


def refining_step(inverse: Any) -> InverseSurrogate | None:
    """The fitted `InverseSurrogate` that an inverse is or ends with, if it refines its estimates."""
    last = last_step(inverse)
    return last if isinstance(last, InverseSurrogate) and last.n_steps_ else None


def shape_inputs_of(inverse: Any) -> ShapeInputs | None:
    """How an inverse reads shapes; None for one without ``dofs``."""
    part = next((part for part in surrogates_in(inverse) if part.dofs is not None), None)
    return None if part is None else ShapeInputs.of(part.model, part.dofs, part.shape_noise)


def with_shapes(inverse: Any, F: Any, shapes: ArrayLike | None) -> Any:
    """Frequencies with the columns of shapes that an inverse expects; NaN there without shapes."""
    inputs = shape_inputs_of(inverse)
    if inputs is None:
        if shapes is not None:
            raise ValueError("shapes are given, but the inverse has no dofs; expected InverseSurrogate(dofs=...)")
        return F
    components = np.full((len(F), inputs.n_columns - inputs.n_modes), np.nan)
    if shapes is not None:
        components = shape_components(shapes, inputs.reference)
        if len(components) != len(F):
            raise ValueError(f"shapes have {len(components)} rows and frequencies {len(F)}; expected the same number")
    modes = [str(name) for name in column_names(F, "f")]
    if hasattr(F, "columns"):
        F = F.set_axis(modes, axis=1)
    names = [*modes, *(f"{mode}_dof{dof}" for mode in modes for dof in inputs.dofs)]
    return frame_like(F, np.hstack([as_floats(F), components]), names)


def shape_warnings(inverse: Any, aligned: Any) -> Iterator[SkthermoWarning]:
    """Warnings about measured shapes, which stand beside the frequencies."""
    inverse = refining_step(inverse)
    if inverse is None:
        return
    inputs, values = inverse.shape_inputs_, as_floats(aligned)
    n_modes, n_sensors = inputs.n_modes, inputs.n_sensors
    components = values[:, n_modes:].reshape(len(values), n_modes, n_sensors)
    found = ~np.isnan(values[:, :n_modes])
    n_shapes = (found & ~np.isnan(components).any(axis=2)).sum()
    names = column_names(aligned, "f")[:n_modes]
    if n_shapes < FEW_SHAPES * found.sum():
        yield RecordsWarning(
            f"{n_shapes} of {found.sum()} measured modes have a component of their shape at each of the {n_sensors} "
            "sensors; the other shapes are not used: expected dofs without sensors that failed",
            "few shapes",
        )
    if not n_shapes or "shapes" not in inverse.samples_:
        return
    possible = shape_components(inverse.samples_.shapes.swapaxes(1, 2), inputs.reference).reshape(
        -1, n_modes, n_sensors
    )
    lowest, highest = possible.min(axis=0), possible.max(axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # a mode without any shape
        median = np.nanmedian(components, axis=0)
    excess = np.nan_to_num(np.maximum(lowest - median, median - highest) / inputs.noise[:, np.newaxis])
    mode, sensor = np.unravel_index(excess.argmax(), excess.shape)
    if excess[mode, sensor] > UNLIKE:
        yield ModelWarning(
            f"measured shapes of {names[mode]!r} are unlike those of the model anywhere in its bounds: at sensor "
            f"{sensor} the median component is {median[mode, sensor]:.2f}, by the model {lowest[mode, sensor]:.2f} to "
            f"{highest[mode, sensor]:.2f}; expected the modes of the model, and sensors in the order of dofs, with the "
            "signs and gains of the model's axes, or a shape_noise that covers the model's error",
            "shapes unlike the model's",
        )
