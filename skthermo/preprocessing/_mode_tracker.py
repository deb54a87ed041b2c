"""Assigns the poles that operational modal analysis finds in each record to reference modes."""

from __future__ import annotations

import re
from datetime import timedelta
from numbers import Real
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import ArrayLike, NDArray
from sklearn.base import TransformerMixin
from sklearn.utils import Bunch

from skthermo._core.arrays import Array
from skthermo._core.estimators import Estimator, Interval, _fit_context, check_is_fitted
from skthermo._core.frames import as_stamps, check_duration
from skthermo._core.warnings import warn_each
from skthermo.exceptions import UnevaluatedRowsWarning
from skthermo.preprocessing._poles import (
    Pairs,
    Poles,
    ReferenceModes,
    assign_near,
    assign_while_following,
    fitting_pairs,
    read_poles,
    read_reference,
)


class ModeTracker(TransformerMixin, Estimator, auto_wrap_output_keys=None):
    """Assign the poles of each record to the modes of a reference, by mode shape and frequency.

    Operational modal analysis finds in each record any number of poles, in the order of their frequencies. Some are
    spurious, and some modes are missing. The tracker puts every mode into a column of its own, with NaN where no pole
    fits.

    Parameters
    ----------
    reference : tuple or mapping
        Frequencies in Hz, (n_modes,), and shapes at the sensors, (n_sensors, n_modes), real or complex, of any scale
        and phase; from an FE model, ``(f[0], phi[0][dofs])`` after ``f, phi = model.modes(theta)``. A mapping has
        ``frequencies``, ``shapes`` and, optionally, ``sensors``, names by which the sensors of the records are chosen.
        Where shapes are None, frequency alone decides. If frequencies are a Series, its index names the modes.
    max_shift : float, default=0.15
        Largest relative difference of a pole's frequency from its mode's frequency.
    min_mac : float, default=0.8
        Lowest modal assurance criterion (MAC) [AB82]_ of a pole's shape and its mode's shape.
    follow : float, str, timedelta or None, default=None
        Time constant of exponential means of the assigned frequencies, which replace the reference's frequencies: a
        number of records, or a duration such as "30D" for records on a DatetimeIndex. None keeps the reference. Shapes
        are always compared with the reference's shapes.
    max_drift : float, default=0.3
        Largest relative difference of a followed frequency from the reference's frequency.
    close : float, default=0.02
        Reference modes closer than this share of their frequency count as close modes, whose shapes may mix:
        ``min_mac`` then applies to the MAC of a pole with the space that their shapes span.

    Attributes
    ----------
    frequencies_ : ndarray of shape (n_modes,)
        Frequencies of the reference in Hz.
    shapes_ : ndarray of shape (n_sensors, n_modes) or None
        Shapes of the reference.
    sensors_ : list or None
        Names of the reference's sensors.
    mode_names_ : list of str
        Names of the modes.
    findings_ : list of SkthermoWarning
        Doubts about the reference, which `fit` also gives as warnings.

    See Also
    --------
    skthermo.fem.match_modes : Pairs measured modes with the modes of an FE model.

    Notes
    -----
    A pole is a candidate for a mode if both tolerances hold. Candidates are assigned one-to-one in every record, at the
    lowest sum of ``(1 - MAC) / (1 - min_mac) + |f / f_reference - 1| / max_shift``; a mode without a pole costs 3, more
    than any candidate. For close modes, the MAC in this sum is the pole's MAC with their space, and the amount by which
    the mode's own MAC is lower is added. NaN components of a shape, from sensors that failed, are left out of its MAC.

    With ``follow``, records are taken in the order of time, and every call of `transform` starts at the reference. A
    mode that is missing keeps its mean. :doc:`/guide/modes` says how to set the tolerances. The tracker comes before a
    pipeline, not into it: the other estimators take its ``frequencies``.

    Examples
    --------
    Two modes at three sensors. They swap order in the second record, and the third has a spurious pole.

    >>> import numpy as np
    >>> from skthermo.preprocessing import ModeTracker
    >>> first, second, spurious = [1.0, 2.0, 1.0], [1.0, 0.0, -1.0], [1.0, -1.0, 1.0]
    >>> records = [
    ...     {"frequencies": [2.0, 2.2], "shapes": [first, second]},
    ...     {"frequencies": [2.1, 2.15], "shapes": [second, first]},
    ...     {"frequencies": [2.01, 2.05], "shapes": [spurious, first]},
    ... ]
    >>> tracker = ModeTracker(([2.0, 2.2], np.column_stack([first, second])))
    >>> modes = tracker.fit_transform(records)
    >>> modes.frequencies
         f1   f2
    0  2.00  2.2
    1  2.15  2.1
    2  2.05  NaN
    >>> modes.left_over.to_list()
    [0, 0, 1]
    """

    _parameter_constraints: dict = {
        "reference": [tuple, list, dict],
        "max_shift": [Interval(Real, 0, 1, closed="neither")],
        "min_mac": [Interval(Real, 0, 1, closed="left")],
        "follow": [Interval(Real, 1, None, closed="left"), str, timedelta, np.timedelta64, None],
        "max_drift": [Interval(Real, 0, 1, closed="left")],
        "close": [Interval(Real, 0, 1, closed="left")],
    }

    def __init__(
        self,
        reference: Any,
        *,
        max_shift: float = 0.15,
        min_mac: float = 0.8,
        follow: float | str | timedelta | None = None,
        max_drift: float = 0.3,
        close: float = 0.02,
    ):
        self.reference = reference
        self.max_shift = max_shift
        self.min_mac = min_mac
        self.follow = follow
        self.max_drift = max_drift
        self.close = close

    @_fit_context(prefer_skip_nested_validation=True)
    def fit(self, X: Any = None, y: None = None) -> ModeTracker:
        """Read the reference.

        Parameters
        ----------
        X : object, optional
            Ignored.
        y : None
            Ignored.

        Returns
        -------
        ModeTracker
            The fitted tracker.

        Raises
        ------
        ValueError
            If frequencies and shapes of the reference do not fit each other, or have impossible values.

        Warns
        -----
        UserWarning
            If two reference modes are so near to each other, in frequency and shape, that they cannot be distinguished.
        """
        modes = read_reference(self.reference)
        self.frequencies_, self.shapes_, self.mode_names_, self.sensors_ = modes
        self.findings_ = modes.similar(self.max_shift, self.min_mac)
        warn_each(self.findings_)
        return self

    def transform(self, X: Any) -> TrackedModes:
        """Assign poles to modes.

        Parameters
        ----------
        X : mapping, sequence of mappings, DataFrame or ndarray
            The poles. A mapping has, for all records, ``frequencies`` in Hz (n_records, n_poles) with NaN where there
            is no pole, ``shapes`` (n_records, n_poles, n_sensors), and, optionally, ``damping`` (n_records, n_poles)
            and ``sensors``; or lists of arrays, one a record, of different numbers of poles: (n_poles,), (n_poles,
            n_sensors) and (n_poles,). A sequence has such a mapping for each record. A table holds frequencies
            alone. Other fields are ignored, except ``index``, which gives the index of records that are not pandas
            objects.

        Returns
        -------
        Bunch
            With these attributes:

            frequencies : DataFrame of shape (n_records, n_modes)
                In Hz; NaN where no pole fits.
            damping : DataFrame of shape (n_records, n_modes) or None
                Damping ratios, in columns ``xi1``, ``xi2``, ...
            shapes : ndarray of shape (n_records, n_modes, n_sensors) or None
                In their own scale, rotated to the phase, or sign, of the reference.
            mac : DataFrame of shape (n_records, n_modes) or None
                MAC of each pole with the shape of its mode.
            poles : DataFrame of int of shape (n_records, n_modes)
                Position of each pole in its record; -1 where no pole fits.
            left_over : Series of int of shape (n_records,)
                Number of poles that were not assigned.
            followed : DataFrame of shape (n_records, n_modes)
                Frequencies of the reference, or their means with ``follow``, with which each record was compared.
            summary : DataFrame
                For each mode, the reference's frequency and the median of those assigned in Hz, the number and
                share of records that have it, the share of these that are ambiguous because another pole fits the mode
                or the pole fits another mode, and the median MAC.

        Raises
        ------
        ValueError
            If fields are missing or do not fit each other, sensors differ from those of the reference, or frequencies
            are not positive or in rad/s.

        Warns
        -----
        UserWarning
            One, if a mode is found in no record; if many records without a mode have poles of its shape at another
            frequency, or of other shapes at its frequency; if poles have no shape.
        """
        check_is_fitted(self)
        modes = ReferenceModes(self.frequencies_, self.shapes_, self.mode_names_, self.sensors_)
        poles = read_poles(X, self.sensors_, None if self.shapes_ is None else len(self.shapes_))
        pairs = fitting_pairs(poles, modes, self.min_mac, self.close)
        followed = np.tile(self.frequencies_, (len(poles.index), 1))
        if self.follow is None:
            chosen, near = assign_near(pairs, self.frequencies_, self.max_shift)
        else:
            order, n_records = self._pace(poles.index)
            chosen, near, followed = assign_while_following(
                pairs, self.frequencies_, self.max_shift, order=order, n_records=n_records, max_drift=self.max_drift
            )
        result = tracked_modes(poles, pairs.at(chosen), pairs.at(near), followed, modes)
        if poles.shapes is not None:
            found = result.frequencies.notna().to_numpy()
            warn_each(doubts_of_assignment(poles, pairs, chosen, followed, found, modes.names))
        return result

    def get_feature_names_out(self, input_features: ArrayLike | None = None) -> NDArray[np.object_]:
        """Names of the modes.

        Parameters
        ----------
        input_features : array-like of str, optional
            Ignored: poles have no names.

        Returns
        -------
        ndarray of str
            Names of the modes.
        """
        check_is_fitted(self)
        return np.array(self.mode_names_, dtype=object)

    def _pace(self, index: pd.Index) -> tuple[NDArray[np.intp], float]:
        """Rows in the order of time, and the number of records of the time constant."""
        stamps = as_stamps(index)
        order = np.arange(len(index)) if stamps is None else np.argsort(stamps.asi8, kind="stable")
        if isinstance(self.follow, Real):
            return order, float(self.follow)
        if stamps is None or stamps.hasnans or len(stamps) < 2:
            has = "no DatetimeIndex" if stamps is None else f"{len(stamps)} stamps, some of them missing or alone"
            raise ValueError(f"follow is {self.follow!r}, but X has {has}; expected two, or a number of records")
        duration = check_duration(self.follow, "follow", may_be_zero=False).to_timedelta64()
        step = np.median(np.diff(stamps.as_unit("ns").asi8[order]))
        n_records = duration.astype(np.int64) / max(step, 1)
        if n_records < 1:
            raise ValueError(f"follow is {self.follow!r}, shorter than the records' median step; expected more")
        return order, n_records

    def __sklearn_tags__(self):
        tags = super().__sklearn_tags__()
        tags.input_tags.two_d_array = False
        return tags


class TrackedModes(Bunch):
    """What `ModeTracker.transform` returns."""

    frequencies: pd.DataFrame
    damping: pd.DataFrame | None
    shapes: NDArray | None
    mac: pd.DataFrame | None
    poles: pd.DataFrame
    left_over: pd.Series
    followed: pd.DataFrame
    summary: pd.DataFrame


def tracked_modes(
    poles: Poles, chosen: Pairs, near: Pairs, followed: NDArray, reference: ReferenceModes
) -> TrackedModes:
    """Frequencies, damping ratios, shapes and counts of the chosen pairs of poles and modes."""
    names, n_records, n_modes = reference.names, len(poles.index), len(reference.names)
    record, mode = chosen.record, chosen.mode

    def table(values: NDArray, missing: float = np.nan, columns: list[str] = names) -> pd.DataFrame:
        cells = np.full((n_records, n_modes), missing, dtype=values.dtype)
        cells[record, mode] = values
        return pd.DataFrame(cells, poles.index, columns)

    damping = shapes = mac = None
    if poles.damping is not None:
        ratios = [f"xi{name[1:]}" if re.fullmatch(r"f\d+", name) else f"xi_{name}" for name in names]
        damping = table(poles.damping[chosen.pole], columns=ratios)
    if poles.shapes is not None and reference.shapes is not None:
        mac = table(chosen.mac)
        in_phase = aligned(poles.shapes[chosen.pole], reference.shapes.T[mode])
        shapes = np.full((n_records, n_modes, len(reference.shapes)), np.nan, dtype=in_phase.dtype)
        shapes[record, mode] = in_phase
    frequencies = table(chosen.frequency)
    n_found = frequencies.notna().sum().to_numpy()
    ambiguous = np.bincount(mode, is_ambiguous(poles, chosen, near, n_modes), minlength=n_modes)
    summary = pd.DataFrame(
        {
            "reference": reference.frequencies,
            "frequency": frequencies.median().to_numpy(),
            "n_records": n_found,
            "share": n_found / max(n_records, 1),
            "ambiguous": ambiguous / np.where(n_found, n_found, np.nan),
            "mac": np.nan if mac is None else mac.median().to_numpy(),
        },
        index=pd.Index(names, name="mode"),
    )
    n_left = np.bincount(poles.record, minlength=n_records) - np.bincount(record, minlength=n_records)
    return TrackedModes(
        frequencies=frequencies,
        damping=damping,
        shapes=shapes,
        mac=mac,
        poles=table(poles.column[chosen.pole], -1),
        left_over=pd.Series(n_left, poles.index, name="left_over"),
        followed=pd.DataFrame(followed, poles.index, names),
        summary=summary,
    )


def is_ambiguous(poles: Poles, chosen: Pairs, near: Pairs, n_modes: int) -> NDArray[np.bool_]:
    """Whether another pole fits the mode of a chosen pair, or its pole fits another mode."""
    n_cells = len(poles.index) * n_modes
    fitting_poles = np.bincount(near.record * n_modes + near.mode, minlength=n_cells)
    fitting_modes = np.bincount(near.pole, minlength=len(poles.record))
    return (fitting_poles[chosen.record * n_modes + chosen.mode] > 1) | (fitting_modes[chosen.pole] > 1)


def aligned(shapes: NDArray, reference: NDArray) -> NDArray:
    """Shapes (n, n_sensors), each times a number of modulus 1 that makes its product with the reference positive."""
    products = np.nansum(shapes * reference.conj(), axis=1, keepdims=True)
    sizes = np.abs(products)
    return shapes * np.divide(products.conj(), sizes, out=np.ones_like(products), where=sizes > 0)


def doubts_of_assignment(
    poles: Poles, pairs: Pairs, chosen: NDArray[np.intp], followed: Array, found: NDArray[np.bool_], names: list[str]
) -> list[UnevaluatedRowsWarning]:
    """One finding of modes that are not found, of poles of their shapes at other frequencies or of other shapes at
    their frequencies, each in more than a few records, and of poles without a shape. Poles that are 2 pi times as high
    or as low as the reference are an error."""
    is_free = ~np.isin(np.arange(len(poles.record)), pairs.pole[chosen])
    left = pairs.at(is_free[pairs.pole] & ~found[pairs.record, pairs.mode])
    ratio = left.frequency / followed[left.record, left.mode]
    n_in_rad = (np.abs(np.maximum(ratio, 1 / ratio) / (2 * np.pi) - 1) < 0.15).sum()
    if n_in_rad > max(10, 10 * found.sum(), len(ratio) / 2):
        raise ValueError(
            f"{n_in_rad} poles have the shapes of reference modes and about {np.median(ratio):.3g} times their "
            f"frequencies, and {found.sum()} have their frequencies: rad/s? expected Hz in both"
        )
    has_shape = np.nan_to_num(poles.shapes).any(axis=1)
    has_shape &= (~np.isnan(poles.shapes)).sum(axis=1) >= min(2, poles.shapes.shape[1])
    is_near = np.abs(poles.frequencies[:, np.newaxis] / followed[poles.record] - 1) < 0.02
    is_near &= is_free[:, np.newaxis] & ~found[poles.record]
    never = [name for name, some in zip(names, found.any(axis=0), strict=True) if not some]
    lost = [f"the modes {never} are found in no record"] if never and len(found) >= 20 else []
    others = []
    for j, name in enumerate(names):
        n_missing, records, ratios = (~found[:, j]).sum(), left.record[left.mode == j], ratio[left.mode == j]
        middle = np.median(ratios) if ratios.size else np.nan
        is_similar = np.abs(ratios / middle - 1) < 0.1
        n_similar = len(np.unique(records[is_similar]))
        if n_similar >= 10 and n_similar > 0.1 * n_missing and is_similar.mean() > 0.5:
            lost.append(f"records without {name!r} have a pole of its shape at about {middle:.2g} times its frequency")
        n_near = len(np.unique(poles.record[is_near[:, j]]))
        if n_near >= 10 and n_near > n_missing / 2 and has_shape[is_near[:, j]].any():
            others.append(name)
    problems = [f"{', and '.join(lost)}: widen max_shift, or correct the reference"] if lost else []
    if others:
        problems.append(
            f"most records without {others} have a pole of another shape at the frequency: give the sensors in the "
            "order of the reference, with its signs and gains, or a lower min_mac for noisy shapes"
        )
    if not has_shape.all():
        problems.append(
            "poles have no shape, zero or NaN at all sensors but one, and no mode takes them: give shapes at two "
            "sensors or more"
        )
    return [UnevaluatedRowsWarning("; ".join(problems), "modes-not-found")] if problems else []
