"""Tables of tracked modes: what `ModeTracker.transform` returns."""

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from sklearn.utils import Bunch

from skthermo.preprocessing._assignment import Pairs
from skthermo.preprocessing._poles import Poles
from skthermo.preprocessing._reference_modes import ReferenceModes


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
    """Frequencies, damping ratios, shapes and counts of the chosen pairs of poles and modes.

    Parameters
    ----------
    poles : Poles
        Those of all records.
    chosen : Pairs
        The assignment.
    near : Pairs
        All pairs within both tolerances.
    followed : ndarray of shape (n_records, n_modes)
        Frequencies that records were compared with.
    reference : ReferenceModes
        The modes.

    Returns
    -------
    Bunch
        As in `ModeTracker.transform`.
    """
    names, n_records, n_modes = reference.names, len(poles.index), len(reference.names)
    record, mode = poles.record[chosen.pole], chosen.mode

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
    frequencies = table(poles.frequencies[chosen.pole])
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
    fitting_poles = np.bincount(poles.record[near.pole] * n_modes + near.mode, minlength=n_cells)
    fitting_modes = np.bincount(near.pole, minlength=len(poles.record))
    return (fitting_poles[poles.record[chosen.pole] * n_modes + chosen.mode] > 1) | (fitting_modes[chosen.pole] > 1)


def damping_name(mode: str) -> str:
    """Name of a mode's damping ratio: xi3 for f3, xi_sway for sway."""
    return f"xi{mode[1:]}" if mode[:1] == "f" and mode[1:].isdigit() else f"xi_{mode}"


def aligned(shapes: NDArray, reference: NDArray) -> NDArray:
    """Shapes (n, n_sensors), each times a number of modulus 1 that makes its product with the reference positive."""
    products = np.nansum(shapes * reference.conj(), axis=1, keepdims=True)
    sizes = np.abs(products)
    return shapes * np.divide(products.conj(), sizes, out=np.ones_like(products), where=sizes > 0)
