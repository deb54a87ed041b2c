"""What is doubtful about an assignment of poles to modes."""

import numpy as np
from numpy.typing import NDArray

from skthermo._warnings import warn_user
from skthermo.preprocessing._assignment import Array, Pairs, shape_agreement
from skthermo.preprocessing._poles import Poles

FEW_RECORDS = 20  # too few for a warning that a mode is missing
NEAR = 0.02  # relative difference in frequency of a pole that is probably the mode's own


def warn_of_losses(
    pairs: Pairs, record: NDArray[np.intp], ratio: NDArray[np.float64], found: NDArray[np.bool_], names: list[str]
) -> None:
    """One warning for modes that no record has, and modes whose shapes are found at frequencies too far away.

    Parameters
    ----------
    pairs : Pairs
        Poles that were left over, and modes that their shapes fit.
    record : ndarray of shape (n_pairs,)
        Records of the poles.
    ratio : ndarray of shape (n_pairs,)
        Frequency of the pole over that of the reference.
    found : ndarray of shape (n_records, n_modes)
        Whether a mode has a pole.
    names : list of str
        Names of the modes.

    Raises
    ------
    ValueError
        If most poles are 2 pi times as high or as low as the reference.
    """
    lost = ~found[record, pairs.mode]
    mode, record, ratio = pairs.mode[lost], record[lost], ratio[lost]
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
        is_alike = np.abs(ratios / np.median(ratios) - 1) < 0.1
        n_alike = len(np.unique(record[mode == j][is_alike]))
        if n_alike >= FEW_RECORDS / 2 and n_alike > 0.1 * n_missing and is_alike.mean() > 0.5:
            problems.append(
                f"{n_alike} of {n_missing} records without {name!r} have a pole of its shape at about "
                f"{np.median(ratios):.3g} times its frequency: is max_shift too small, or the reference wrong?"
            )
    if problems:
        more = f" ({len(problems) - 3} more like these)" if len(problems) > 3 else ""
        warn_user("; ".join(problems[:3]) + more, "modes not found")


def warn_of_unlike_shapes(
    poles: Poles, is_free: NDArray[np.bool_], followed: Array, found: NDArray[np.bool_], reference: NDArray, names: list
) -> None:
    """One warning for modes that most records lack although they have a pole at the frequency: its shape differs."""
    free = np.flatnonzero(is_free)
    record = poles.record[free]
    is_near = np.abs(poles.frequencies[free, np.newaxis] / followed[record] - 1) < NEAR
    problems = []
    for j, name in enumerate(names):
        near, n_missing = free[is_near[:, j] & ~found[record, j]], (~found[:, j]).sum()
        n_near = len(np.unique(poles.record[near]))
        mac = shape_agreement(poles.shapes[near], reference[:, [j]], [])[0]
        if n_near >= FEW_RECORDS / 2 and n_near > n_missing / 2 and np.isfinite(mac).any():
            problems.append(
                f"{n_near} of {n_missing} records without {name!r} have a pole within {NEAR:.0%} of its frequency, "
                f"whose MAC with the reference is about {np.nanmedian(mac):.2f}"
            )
    if problems:
        more = f" ({len(problems) - 3} more like these)" if len(problems) > 3 else ""
        warn_user(
            "; ".join(problems[:3]) + f"{more}: expected the sensors of the reference in their order, with their signs "
            "and gains, or a lower min_mac for noisy shapes",
            "modes of other shapes",
        )


def warn_of_unknown_shapes(n_without: int, n_poles: int) -> None:
    """Warn of poles that have a frequency but no shape."""
    if n_without:
        warn_user(
            f"{n_without} of {n_poles} poles have a frequency but no shape: zero, or NaN at all sensors but one; they "
            "are left over",
            "poles without shape",
        )
