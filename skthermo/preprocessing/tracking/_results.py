"""What `ModeTracker.transform` returns, and warnings of what is doubtful in it."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.utils import Bunch

from skthermo._estimators.warnings import warn_user
from skthermo._tables.arrays import Array
from skthermo.exceptions import RecordsWarning, UnevaluatedRowsWarning
from skthermo.preprocessing.tracking._assignment import Pairs
from skthermo.preprocessing.tracking._poles import Poles
from skthermo.preprocessing.tracking._reference import ReferenceModes, shape_agreement

FEW_RECORDS = 20  # too few for a warning that a mode is missing
NEAR_FREQUENCY = 0.02  # relative difference in frequency of a pole that is probably the mode's own


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
        damping = table(poles.damping[chosen.pole], columns=[damping_name(name) for name in names])
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


def damping_name(mode: str) -> str:
    """Name of a mode's damping ratio: xi3 for f3, xi_sway for sway."""
    return f"xi{mode[1:]}" if mode[:1] == "f" and mode[1:].isdigit() else f"xi_{mode}"


def aligned(shapes: NDArray, reference: NDArray) -> NDArray:
    """Shapes (n, n_sensors), each times a number of modulus 1 that makes its product with the reference positive."""
    products = np.nansum(shapes * reference.conj(), axis=1, keepdims=True)
    sizes = np.abs(products)
    return shapes * np.divide(products.conj(), sizes, out=np.ones_like(products), where=sizes > 0)


def warn_of_doubts(
    poles: Poles,
    pairs: Pairs,
    chosen: NDArray[np.intp],
    followed: Array,
    found: NDArray[np.bool_],
    modes: ReferenceModes,
) -> None:
    """Warn of what is doubtful about an assignment: modes not found, modes of other shapes, poles without shape."""
    is_free = ~np.isin(np.arange(len(poles.record)), pairs.pole[chosen])
    left = pairs.at(is_free[pairs.pole])
    _warn_of_losses(left, left.frequency / followed[left.record, left.mode], found, modes.names)
    _warn_of_other_shapes(poles, is_free, followed, found, modes)
    n_present = (~np.isnan(poles.shapes)).sum(axis=1)
    is_zero = ~np.nan_to_num(poles.shapes).any(axis=1)
    n_without = (is_zero | (n_present < min(2, poles.shapes.shape[1]))).sum()
    if n_without:
        warn_user(
            f"{n_without} of {len(poles.record)} poles have a frequency but no shape: zero, or NaN at all sensors but "
            "one; they are left over",
            UnevaluatedRowsWarning,
            "poles without shape",
        )


def _warn_of_losses(pairs: Pairs, ratio: Array, found: NDArray[np.bool_], names: list[str]) -> None:
    """One warning for modes that no record has, and modes whose shapes are found at frequencies too far away.

    Pairs are poles that were left over and modes of their shapes; ratios are those of their frequencies. Poles that are
    2 pi times as high or as low as the reference are an error.
    """
    lost = ~found[pairs.record, pairs.mode]
    mode, record, ratio = pairs.mode[lost], pairs.record[lost], ratio[lost]
    in_rad = np.maximum(ratio, 1 / ratio) / (2 * np.pi)
    n_in_rad = (np.abs(in_rad - 1) < 0.15).sum()
    if n_in_rad > max(FEW_RECORDS / 2, 10 * found.sum(), len(ratio) / 2):
        raise ValueError(
            f"{n_in_rad} poles have the shapes of reference modes and about {np.median(ratio):.3g} times their "
            f"frequencies, and {found.sum()} have their frequencies: rad/s? expected Hz in both"
        )
    problems = []
    never = [name for name, some in zip(names, found.any(axis=0), strict=True) if not some]
    if never and len(found) >= FEW_RECORDS:
        problems.append(f"the modes {never} are found in none of {len(found)} records")
    for j, name in enumerate(names):
        n_missing, ratios = (~found[:, j]).sum(), ratio[mode == j]
        if not ratios.size:
            continue
        is_similar = np.abs(ratios / np.median(ratios) - 1) < 0.1
        n_similar = len(np.unique(record[mode == j][is_similar]))
        if n_similar >= FEW_RECORDS / 2 and n_similar > 0.1 * n_missing and is_similar.mean() > 0.5:
            problems.append(
                f"{n_similar} of {n_missing} records without {name!r} have a pole of its shape at about "
                f"{np.median(ratios):.3g} times its frequency: is max_shift too small, or the reference wrong?"
            )
    if problems:
        more = f" ({len(problems) - 3} more like these)" if len(problems) > 3 else ""
        warn_user("; ".join(problems[:3]) + more, UnevaluatedRowsWarning, "modes not found")


def _warn_of_other_shapes(
    poles: Poles, is_free: NDArray[np.bool_], followed: Array, found: NDArray[np.bool_], modes: ReferenceModes
) -> None:
    """One warning for modes that most records lack although they have a pole at the frequency: its shape differs."""
    free = np.flatnonzero(is_free)
    record = poles.record[free]
    is_near = np.abs(poles.frequencies[free, np.newaxis] / followed[record] - 1) < NEAR_FREQUENCY
    problems = []
    for j, name in enumerate(modes.names):
        near, n_missing = free[is_near[:, j] & ~found[record, j]], (~found[:, j]).sum()
        n_near = len(np.unique(poles.record[near]))
        mac = shape_agreement(poles.shapes[near], modes.shapes[:, [j]], [])[0]
        if n_near >= FEW_RECORDS / 2 and n_near > n_missing / 2 and np.isfinite(mac).any():
            problems.append(
                f"{n_near} of {n_missing} records without {name!r} have a pole within {NEAR_FREQUENCY:.0%} of its "
                f"frequency, whose MAC with the reference is about {np.nanmedian(mac):.2f}"
            )
    if problems:
        more = f" ({len(problems) - 3} more like these)" if len(problems) > 3 else ""
        warn_user(
            "; ".join(problems[:3]) + f"{more}: expected the sensors of the reference in their order, with their signs "
            "and gains, or a lower min_mac for noisy shapes",
            RecordsWarning,
            "modes of other shapes",
        )
