"""The inverse of a chain, which may be a pipeline or hold several, and what it finds for each record."""

import re
import sys
import warnings
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

import numpy as np
from joblib import Memory
from numpy.typing import ArrayLike, NDArray
from sklearn.base import BaseEstimator

from skthermo._estimators.arguments import Reduce, is_auto
from skthermo._estimators.regressors import inputs_of_last_step
from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, as_floats
from skthermo._tables.frames import Table, column_names, frame_like
from skthermo._validation import last_step
from skthermo.exceptions import FewRecordsWarning, ModelWarning, RecordsWarning, ResultWarning, SkthermoWarning
from skthermo.fem import FEModel, shape_components
from skthermo.surrogate.inverse import InverseSurrogate
from skthermo.surrogate.refinement import ShapeInputs, unconverged

SCARCE = 0.25  # mean weight of records with gaps below which a warning is given: four of six modes missing in each, say
FEW_SHAPES = 0.5  # share of measured modes with a complete shape below which a warning is given
UNLIKE = 5.0  # distance of median components from those of the model, in deviations of the noise, that gives a warning


@dataclass(frozen=True)
class Estimates:
    """What M1 finds for each training record: parameters and, where it refines, how the steps ended, and how often the
    full model was solved because they left the box of the reduced one."""

    theta: Array
    n_unconverged: int | None = None
    full_solves: NDArray[np.intp] | None = None


@dataclass(frozen=True)
class ChainInverse:
    """M1 of a chain: an `InverseSurrogate`, a pipeline that ends with one, or any other transformer."""

    estimator: BaseEstimator

    @property
    def surrogates(self) -> list[InverseSurrogate]:
        """Every `InverseSurrogate` that it is or holds."""
        parts = (self.estimator, *self.estimator.get_params().values())
        return [part for part in parts if isinstance(part, InverseSurrogate)]

    @property
    def refining(self) -> InverseSurrogate | None:
        """The fitted `InverseSurrogate` that it is or ends with, if that refines its estimates."""
        last = last_step(self.estimator)
        return last if isinstance(last, InverseSurrogate) and last.n_steps_ else None

    @property
    def shape_inputs(self) -> ShapeInputs | None:
        """How shapes are read; None without ``dofs``."""
        part = next((part for part in self.surrogates if part.dofs is not None), None)
        return None if part is None else ShapeInputs.of(part.model, part.dofs, part.shape_noise)

    def prepare(self, model: FEModel, memory: str | Memory | None, reduce: Reduce) -> None:
        """Give every surrogate inside what it has not: the chain's model, memory and choice of a reduced model."""
        names = list(model.parameter_names)
        for part in self.surrogates:
            if part.model is None:
                part.set_params(model=model)
            if part.memory is None:
                part.set_params(memory=memory)
            if list(part.model.parameter_names) != names:
                raise ValueError(
                    f"the inverse's model has the parameters {list(part.model.parameter_names)}; expected {names}, as "
                    f"{model!r} has"
                )
            if is_auto(part.reduce) and (not reduce or hasattr(part.model, "reduced")):
                part.set_params(reduce=reduce)

    def estimates(self, aligned: Table, parameter_names: list[str]) -> Estimates:
        """What the fitted inverse finds for aligned records, with warnings where they determine little."""
        last = self.refining
        if last is None:
            theta = as_floats(self.estimator.transform(aligned))
            if theta.shape[1] != len(parameter_names):
                raise ValueError(f"the inverse gave {theta.shape[1]} columns; expected {parameter_names}")
            return Estimates(theta)
        found = last.invert(inputs_of_last_step(self.estimator, aligned))
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
        return Estimates(as_floats(found.theta), int(unconverged(found).sum()), found.full_solves)

    def with_shapes(self, F: Table, shapes: ArrayLike | None) -> Table:
        """Frequencies with the columns of shapes that the inverse expects; NaN there without shapes."""
        inputs = self.shape_inputs
        if inputs is None:
            if shapes is not None:
                raise ValueError("shapes are given, but the inverse has no dofs; expected InverseSurrogate(dofs=...)")
            return F
        components = np.full((len(F), inputs.n_columns - inputs.n_modes), np.nan)
        if shapes is not None:
            components = shape_components(shapes, inputs.reference)
            if len(components) != len(F):
                raise ValueError(
                    f"shapes have {len(components)} rows and frequencies {len(F)}; expected the same number"
                )
        modes = [str(name) for name in column_names(F, "f")]
        if hasattr(F, "columns"):
            F = F.set_axis(modes, axis=1)
        names = [*modes, *(f"{mode}_dof{dof}" for mode in modes for dof in inputs.dofs)]
        return frame_like(F, np.hstack([as_floats(F), components]), names)

    def shape_warnings(self, aligned: Table) -> Iterator[SkthermoWarning]:
        """Warnings about measured shapes, which stand beside the frequencies: kind and text of each."""
        inverse = self.refining
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
                f"{n_shapes} of {found.sum()} measured modes have a component of their shape at each of the "
                f"{n_sensors} sensors; the other shapes are not used: expected dofs without sensors that failed",
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
                f"{sensor} the median component is {median[mode, sensor]:.2f}, by the model {lowest[mode, sensor]:.2f} "
                f"to {highest[mode, sensor]:.2f}; expected the modes of the model, and sensors in the order of dofs, "
                "with the signs and gains of the model's axes, or a shape_noise that covers the model's error",
                "shapes unlike the model's",
            )

    def warn_of_inert(self, model: FEModel, names: Iterable[str]) -> None:
        """Warn if a search of scikit-learn sets the regressor of an inverse that refines: no score depends on it."""
        frame = sys._getframe(2)
        while frame.f_code.co_name in ("set_params", "_set_params") and frame.f_back is not None:
            frame = frame.f_back  # past the estimators around the chain
        if not frame.f_globals.get("__name__", "").startswith("sklearn.model_selection"):
            return
        params = self.estimator.get_params().items()
        parts = {"inverse": self.estimator} | {f"inverse__{name}": part for name, part in params}
        for name, part in parts.items():
            searched = [
                one for one in names if re.fullmatch(f"{name}__(regressor|n_samples|narrow_bounds)(__.*)?", one)
            ]
            if searched and isinstance(part, InverseSurrogate) and part.steps_on(model):
                warn_user(
                    f"{searched[0]!r} is searched, but estimates are refined on the FE model, and do not depend on the "
                    "regressor and its simulations: all settings score alike; expected refine=0 in the inverse, or a "
                    "search over the InverseSurrogate itself, whose score is that of its regressor",
                    ResultWarning,
                    "inert settings searched",
                )
