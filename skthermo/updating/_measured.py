"""Checks of measured frequencies and shapes."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from skthermo._estimators.arguments import by_name, check_dofs
from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array, real_array, shape_array
from skthermo.exceptions import RecordsWarning


@dataclass
class Measured:
    """Modes that were measured, each with a frequency, a shape or both."""

    names: list[str]
    columns: NDArray[np.intp]  # of these modes in F
    frequencies: Array  # means over records in Hz; NaN where only the shape was measured
    deviations: Array  # standard deviations in Hz by which residuals are divided
    shapes: Array  # (n_dofs, n_measured), of unit length; NaN where only the frequency was measured
    dofs: NDArray[np.intp]  # empty where no shapes were measured
    shape_weights: Array  # 0 where no shape was measured

    @property
    def has_frequency(self) -> NDArray[np.bool_]:
        """Modes with a measured frequency."""
        return np.isfinite(self.frequencies)

    @property
    def has_shape(self) -> NDArray[np.bool_]:
        """Modes with a measured shape."""
        return _given(self.shapes)

    @property
    def n_residuals(self) -> int:
        """Number of independent residuals: a shape has one less than degrees of freedom, since its scale is free."""
        weighted = self.has_shape & (self.shape_weights > 0)
        return int(self.has_frequency.sum() + weighted.sum() * max(len(self.dofs) - 1, 0))


def read_measured(
    F: Array,
    names: list[str],
    shapes: ArrayLike | None,
    dofs: ArrayLike | None,
    frequency_std: ArrayLike | None,
    shape_weight: ArrayLike,
    n_dof: int,
) -> Measured:
    """Means over records, with shapes and weights, of the modes that were measured."""
    n_modes = F.shape[1]
    wrong = np.argwhere(~(np.isnan(F) | ((F > 0) & np.isfinite(F))))
    if wrong.size:
        row, column = wrong[0]
        raise ValueError(
            f"frequency {names[column]!r} of record {row} is {F[row, column]}; expected Hz above 0, or NaN"
        )
    counts = np.isfinite(F).sum(axis=0)
    means = np.where(counts > 0, np.nansum(F, axis=0) / np.maximum(counts, 1), np.nan)
    places, unit = _read_shapes(shapes, dofs, n_modes, n_dof, names)
    weights = _per_mode(shape_weight, names, "shape_weight")
    if (weights < 0).any() or not np.isfinite(weights).all():
        raise ValueError(f"shape_weight is {shape_weight!r}; expected finite numbers, none negative")
    if not places.size and weights.any():
        raise ValueError(
            f"shape_weight is {shape_weight!r} but no shapes were given; expected shapes, or a weight of 0"
        )
    with_shape = _given(unit)
    columns = np.flatnonzero((counts > 0) | with_shape)
    if not columns.size:
        raise ValueError(f"F is NaN in all {len(F)} records of all {n_modes} modes; expected a measured frequency")
    return Measured(
        names=[names[i] for i in columns],
        columns=columns,
        frequencies=means[columns],
        deviations=_read_deviations(frequency_std, means, names)[columns],
        shapes=unit[:, columns],
        dofs=places,
        shape_weights=np.where(with_shape, weights, 0.0)[columns],
    )


def _real_shapes(shapes: NDArray) -> Array:
    """Real parts of complex shapes, each rotated by the phase that makes its real part largest."""
    squares = np.nansum(shapes**2, axis=0)
    turned = shapes * np.exp(-0.5j * np.angle(squares))
    lengths = np.sqrt(np.nansum(np.abs(shapes) ** 2, axis=0))
    lost = np.sqrt(np.nansum(turned.imag**2, axis=0)) / np.where(lengths > 0, lengths, 1)
    warn_user(
        f"shapes are complex: each is rotated to its largest real part, and the rest, up to {lost.max():.1%} of a "
        "shape's length, is dropped",
        RecordsWarning,
        "complex shapes",
    )
    return np.where(np.isnan(shapes), np.nan, turned.real)


def _given(shapes: Array) -> NDArray[np.bool_]:
    """Which columns hold a measured shape: not those that are NaN throughout, and none if there are no rows."""
    return np.asarray(np.isfinite(shapes).any(axis=0))


def _read_shapes(shapes, dofs, n_modes: int, n_dof: int, names: list[str]) -> tuple[NDArray[np.intp], Array]:
    if (shapes is None) != (dofs is None):
        given, missing = ("shapes", "dofs") if dofs is None else ("dofs", "shapes")
        raise ValueError(f"{given} were given without {missing}; expected both, or neither")
    if shapes is None:
        return np.empty(0, dtype=np.intp), np.empty((0, n_modes))
    places = check_dofs(dofs, n_dof)
    array = shape_array(shapes, "shapes")
    if array.shape != (len(places), n_modes):
        raise ValueError(
            f"shapes have shape {array.shape}; expected ({len(places)}, {n_modes}): a row for each of dofs and a "
            "column for each mode of F"
        )
    array = _real_shapes(array) if np.iscomplexobj(array) else array
    for name, column in zip(names, array.T, strict=True):
        if np.isnan(column).any() and not np.isnan(column).all():
            row = np.flatnonzero(np.isnan(column))[0]
            raise ValueError(f"the shape of {name!r} is NaN in row {row} but not in all; expected all rows or none")
        if np.isinf(column).any() or not column.any():
            raise ValueError(f"the shape of {name!r} is zero throughout or infinite; expected a mode shape")
    return places, array / np.linalg.norm(array, axis=0)


def _read_deviations(frequency_std: ArrayLike | None, means: Array, names: list[str]) -> Array:
    """Standard deviations in Hz; without any, the frequencies themselves, for a weight of 1."""
    if frequency_std is None:
        return means
    deviations = _per_mode(frequency_std, names, "frequency_std")
    wrong = np.flatnonzero(np.isfinite(means) & ~((deviations > 0) & np.isfinite(deviations)))
    if wrong.size:
        raise ValueError(
            f"frequency_std of {names[wrong[0]]!r} is {deviations[wrong[0]]}; expected a positive number in Hz"
        )
    return deviations


def _per_mode(values: ArrayLike, names: list[str], what: str) -> Array:
    n_modes = len(names)
    array = real_array(by_name(values, names, what, "modes"), what)
    if array.shape not in ((), (n_modes,)):
        raise ValueError(f"{what} has shape {array.shape}; expected a number, or one for each of the {n_modes} modes")
    return np.broadcast_to(array, (n_modes,)).copy()
