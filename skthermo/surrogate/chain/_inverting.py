"""M1 of a chain: its settings, the parameters that it finds in records, and how mode shapes are read."""

from __future__ import annotations

from typing import Any

import numpy as np
from joblib import Memory
from numpy.typing import ArrayLike
from sklearn.base import BaseEstimator
from sklearn.utils import Bunch

from skthermo._core.arrays import Array, Reduce, as_floats, is_auto, median, spread_evenly
from skthermo._core.estimators import inputs_of_last_step, last_step
from skthermo._core.frames import Table, column_names, frame_like
from skthermo._core.warnings import collected
from skthermo.exceptions import FewRecordsWarning, ModelWarning, RecordsWarning, SkthermoWarning
from skthermo.fem import FEModel, shape_components
from skthermo.surrogate.inverse import InverseSurrogate, PosteriorInverse, ShapeInputs


def prepare(
    inverse: BaseEstimator, model: FEModel, memory: str | Memory | None, reduce: Reduce, *, has_shapes: bool
) -> None:
    """Give every inverse of an FE model the chain's model, memory and choice of a reduced model where it has none."""
    names = list(model.parameter_names)
    for part in (inverse, *inverse.get_params().values()):
        if not isinstance(part, PosteriorInverse | InverseSurrogate):
            continue
        if part.model is None:
            part.set_params(model=model)
        if part.memory is None:
            part.set_params(memory=memory)
        if list(part.model.parameter_names) != names:
            raise ValueError(
                f"the inverse's model has the parameters {list(part.model.parameter_names)}; expected {names}, as "
                f"{model!r} has"
            )
        may_reduce = isinstance(part, PosteriorInverse) and is_auto(part.reduce)
        if may_reduce and (not reduce or hasattr(part.model, "reduced")):
            part.set_params(reduce=reduce)
    if shape_inputs(inverse) is not None and not has_shapes:
        raise ValueError("the inverse has dofs, but there are no shapes; expected fit(T, F, shapes=shapes)")


def take_noise(inverse: BaseEstimator, noise: Array) -> None:
    """Give an `InverseSurrogate` with ``noise="auto"`` the noise of the records."""
    for part in (inverse, *inverse.get_params().values()):
        if isinstance(part, InverseSurrogate) and isinstance(part.noise, str):
            part.set_params(noise=noise)


def invert(inverse: BaseEstimator, aligned: Table, names: list[str]) -> Bunch:
    """``theta`` of aligned records and ``findings`` and, of a `PosteriorInverse`, all that its ``invert`` gives."""
    last = last_step(inverse)
    if not isinstance(last, PosteriorInverse):
        with collected() as findings:
            theta = as_floats(inverse.transform(aligned))
        if theta.shape[1] != len(names):
            raise ValueError(f"the inverse gave {theta.shape[1]} columns; expected {names}")
        return Bunch(theta=theta, findings=findings)
    found = last.invert(inputs_of_last_step(inverse, aligned))
    known = found.weight[found.weight > 0]
    if len(known) and known.mean() < 0.25:  # with four of six modes missing in each, say
        found.findings.append(
            FewRecordsWarning(
                "because of gaps, records carry on average less than a quarter of the parameter precision of complete "
                "ones. Estimates are drawn towards the model's nominal state. Track more modes, or use "
                "imputer=KNNGapImputer()",
                "sparse-modes",
            )
        )
    return Bunch(**{**found, "theta": as_floats(found.theta)})


def shape_inputs(inverse: BaseEstimator) -> ShapeInputs | None:
    """How an inverse reads shapes; None without ``dofs``."""
    part: Any = last_step(inverse)
    if not isinstance(part, PosteriorInverse) or part.dofs is None:
        return None
    return ShapeInputs.read(part.model, part.dofs, part.shape_noise)


def with_shapes(inverse: BaseEstimator, F: Table, shapes: ArrayLike | None) -> Table:
    """Frequencies with the columns of shapes that the inverse expects; NaN there without shapes."""
    inputs = shape_inputs(inverse)
    if inputs is None:
        if shapes is not None:
            raise ValueError("shapes are given, but the inverse has no dofs; expected PosteriorInverse(dofs=...)")
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


def doubts_of_shapes(
    inverse: PosteriorInverse, aligned: Table, theta: Array, *, few: float = 0.5, unlike: float = 5.0
) -> list[SkthermoWarning]:
    """Findings about measured shapes, beside the parameters of the records.

    Complete shapes of a share of ``few`` modes are few. Measured and modelled shapes are ``unlike`` if a median
    component is so many standard deviations of the noise from all shapes of the model at the parameters of 100 records.
    """
    inputs, values, findings = inverse.shape_inputs_, as_floats(aligned), []
    n_modes, n_sensors = inputs.n_modes, inputs.n_sensors
    components = values[:, n_modes:].reshape(len(values), n_modes, n_sensors)
    found = ~np.isnan(values[:, :n_modes])
    n_shapes = (found & ~np.isnan(components).any(axis=2)).sum()
    names = column_names(aligned, "f")[:n_modes]
    if n_shapes < few * found.sum():
        findings.append(
            RecordsWarning(
                "most measured modes lack a component of their shape at some sensor. Their shapes are not used. Leave "
                "sensors that failed out of dofs",
                "few-shapes",
            )
        )
    rows = spread_evenly(np.flatnonzero(~np.isnan(theta).any(axis=1)), 100)
    if not n_shapes or not len(rows):
        return findings
    simulated = inputs.simulated(inverse.model, theta[rows])[:, n_modes:].reshape(-1, n_modes, n_sensors)
    lowest, highest = simulated.min(axis=0), simulated.max(axis=0)
    middle = median(values[:, n_modes:]).reshape(n_modes, n_sensors)
    excess = np.nan_to_num(np.maximum(lowest - middle, middle - highest) / inputs.noise[:, np.newaxis])
    mode, sensor = np.unravel_index(excess.argmax(), excess.shape)
    if excess[mode, sensor] > unlike:
        findings.append(
            ModelWarning(
                f"measured shapes of {names[mode]!r} are unlike those of the model at the parameters of the records, "
                f"the most at sensor {sensor}. They distort the parameters. Check the modes, and order, signs and "
                "gains of the sensors (dofs), or raise shape_noise",
                "foreign-shapes",
            )
        )
    return findings
