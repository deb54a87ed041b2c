"""The bridge Z24: its monitoring records, and a calibrated FE model."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from math import ceil
from os import PathLike
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import check_path, positive_integer
from skthermo._core.matlab import read_matlab
from skthermo.datasets._results import Z24Monitoring
from skthermo.fem import AffineModel, Beam, Spring, Structure

Z24_MODES = ["f1", "f2", "f3", "f4"]
Z24_SENSORS = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
Place = tuple[float, float, float]
Z24_CONSTANTS: dict[str, dict[str, float]] = {
    "girder": {"E": 37.5e9, "G": 16e9, "density": 2700.0, "A": 4.4, "I_yy": 0.609, "I_zz": 17.0, "J": 1.27},
    "pier": {"E": 37.5e9, "G": 16e9, "density": 2500.0, "A": 2.4, "I_yy": 0.072, "I_zz": 3.2, "J": 0.26},
    "soil": {"x": 1.5e9, "y": 2e9, "z": 3e9, "rx": 9.95e9, "ry": 5e9, "rz": 5e9},
    "abutment": {"x": 3e9, "y": 3e9, "z": 5.39e8, "rx": 3e9},
}
Z24_PARAMETERS: dict[str, str | tuple[str, str]] = {
    "girder_bending": ("E", "girder"),
    "piers_soil": "piers_soil",
    "girder_torsion": ("G", "girder"),
    "abutments": "abutments",
}


def load_z24(path: str | PathLike) -> Z24Monitoring:
    """Read the monitoring of the Z24 highway bridge, with its progressive damage.

    Z24 in Switzerland was a post-tensioned concrete box girder of 14 + 30 + 14 m, monitored for a
    year, damaged step by step in its last month, and demolished in 1998 (KU Leuven) [PD01]_. The data are not
    part of this package: their use is non-commercial.

    Parameters
    ----------
    path : str or path-like
        A CSV file with the columns ``record``, ``f1`` to ``f4``, ``TP``, ``TWN``, ``TWC``, ``TDS``, ``TDT``,
        ``TS``, ``Tair`` and ``state`` ("undamaged" or "damaged"), or the MATLAB v5 file in which the data are usually
        shared: ``data`` (n x 4), ``Z24_TP``, ``Z24_TWN``, ... (n x 1) and, optionally, ``idx`` (mask over the hours)
        and ``nc`` (number of undamaged rows).

    Returns
    -------
    Bunch
        With these attributes:

        temperatures : DataFrame of shape (n_records, 7)
            In degrees Celsius: pavement (TP), web (TWN, TWC), deck (TDS, TDT), soffit (TS) and air.
        frequencies : DataFrame of shape (n_records, 4)
            ``f1`` to ``f4`` in Hz.
        state : Series of shape (n_records,)
            "undamaged", "damaged", or "unknown" where a MATLAB file has no ``nc``.

        All three have the rows of the file in their order and the same DatetimeIndex.

    Raises
    ------
    ValueError
        If a field is missing, or a value is repeated, not a number, or impossible (frequencies outside 0.1 to 100 Hz,
        temperatures outside -60 to 80 C). The error names the file, field and row.

    Notes
    -----
    The time stamp is ``record``, in hours, added to 1997-11-11 00:00, the day on which monitoring began; the
    hour of the first record is not documented, so that times of day are nominal. Without ``idx``, rows of a MATLAB file
    are taken as consecutive hours.

    Examples
    --------
    >>> from skthermo.datasets import load_z24
    >>> load_z24("no_such_folder/z24.csv")
    Traceback (most recent call last):
    ...
    FileNotFoundError: no_such_folder/z24.csv is not a file; expected the Z24 data as CSV or MATLAB v5 file
    """
    file = check_path(path)
    if not file.is_file():
        raise FileNotFoundError(f"{file} is not a file; expected the Z24 data as CSV or MATLAB v5 file")
    with open(file, "rb") as stream:
        is_matlab = file.suffix.lower() == ".mat" or stream.read(6) == b"MATLAB"
    table, state = _read_matlab(file) if is_matlab else _read_csv(file)
    possible = {"record": (0, 20_000), "frequency": (0.1, 100.0), "temperature": (-60.0, 80.0)}
    for name in table:
        kind = "record" if name == "record" else "frequency" if name in Z24_MODES else "temperature"
        lowest, highest = possible[kind]
        if (wrong := np.isinf(table[name]) | (table[name] < lowest) | (table[name] > highest)).any():
            got = f"{file}: field {name!r}, row {wrong.argmax()} is {table[name][wrong.argmax()]}"
            raise ValueError(f"{got}; expected {lowest:g} to {highest:g}")
    record = table["record"].to_numpy()
    if (wrong := record % 1 != 0).any():  # NaN too
        row = wrong.argmax()
        raise ValueError(f"{file}: field 'record', row {row} is {record[row]}; expected a whole number of hours")
    index = pd.DatetimeIndex(pd.Timestamp("1997-11-11") + pd.to_timedelta(record, unit="h"), name="time")
    if index.has_duplicates:
        row = index.duplicated().argmax()
        raise ValueError(f"{file}: field 'record', row {row} repeats {record[row]:.0f}; expected each hour once")
    table = table.set_index(index)
    return Z24Monitoring(
        temperatures=table[Z24_SENSORS], frequencies=table[Z24_MODES], state=pd.Series(state, index=index, name="state")
    )


def _read_csv(file: Path) -> tuple[pd.DataFrame, list[str]]:
    try:
        rows = pd.read_csv(file, dtype=object, header=None, encoding="utf-8-sig")  # Python reads numbers exactly
    except ValueError as error:
        raise ValueError(f"{file}: not a readable CSV file ({error})") from error
    numeric = ["record", *Z24_MODES, *Z24_SENSORS]
    header = rows.iloc[0].tolist()
    missing = [name for name in (*numeric, "state") if header.count(name) != 1]
    if missing or len(rows) == 1:
        raise ValueError(f"{file}: the header has the fields {header[:20]}; expected {missing} once each, and records")
    table = rows[1:].set_axis(header, axis=1).reset_index(drop=True)
    wrong = {name: pd.to_numeric(table[name], errors="coerce").isna() & table[name].notna() for name in numeric}
    wrong["state"] = ~table["state"].isin(["undamaged", "damaged"])
    for name, is_wrong in wrong.items():
        if is_wrong.any():
            expected = "'undamaged' or 'damaged'" if name == "state" else "a number or nothing"
            found = f"{file}: field {name!r}, row {is_wrong.argmax()} is {table[name][is_wrong.argmax()]!r}"
            raise ValueError(f"{found}; expected {expected}")
    return table[numeric].astype(float), table["state"].tolist()


def _read_matlab(file: Path) -> tuple[pd.DataFrame, list[str]]:
    content = read_matlab(file)
    data = _matlab_field(content, "data", file)
    if data.ndim != 2 or data.shape[1] != len(Z24_MODES) or not len(data):
        raise ValueError(f"{file}: field 'data' has shape {data.shape}; expected (n, {len(Z24_MODES)})")
    columns = {"record": np.arange(float(len(data)))} | dict(zip(Z24_MODES, data.T, strict=True))
    if "idx" in content:
        mask = _matlab_field(content, "idx", file).ravel()
        if not np.isin(mask, (0, 1)).all() or mask.sum() != len(data):
            raise ValueError(
                f"{file}: field 'idx' marks {np.count_nonzero(mask == 1)} of {mask.size} hours; "
                f"expected a mask of zeros and ones that marks the {len(data)} rows of 'data'"
            )
        columns["record"] = np.flatnonzero(mask).astype(float)
    for sensor in Z24_SENSORS:
        values = _matlab_field(content, f"Z24_{sensor}", file)
        if values.size != len(data):
            raise ValueError(f"{file}: field 'Z24_{sensor}' has shape {values.shape}; expected ({len(data)}, 1)")
        columns[sensor] = values.ravel()
    if "nc" not in content:
        return pd.DataFrame(columns), ["unknown"] * len(data)
    n_undamaged = _matlab_field(content, "nc", file)
    if n_undamaged.size != 1 or not 0 <= n_undamaged.item() <= len(data) or n_undamaged.item() % 1:
        raise ValueError(f"{file}: field 'nc' is {n_undamaged.tolist()}; expected a number of rows up to {len(data)}")
    count = int(n_undamaged.item())
    return pd.DataFrame(columns), ["undamaged"] * count + ["damaged"] * (len(data) - count)


def _matlab_field(content: dict[str, object], name: str, file: Path) -> NDArray[np.float64]:
    if name not in content:
        raise ValueError(f"{file}: no field {name!r}; found {sorted(content)}")
    matrix = content[name]
    if not isinstance(matrix, np.ndarray) or np.iscomplexobj(matrix):
        raise ValueError(f"{file}: field {name!r} is not a full matrix of real numbers")
    return matrix


def make_z24(n_modes: int = 4, *, track: bool = True) -> AffineModel:
    """FE model of the Z24 highway bridge: a stick of 3-D beams on springs.

    A girder over three spans, clamped to two pier walls; springs under the piers and at the abutments
    stand for the soil. Its first four modes were monitored, as `load_z24` reads them: vertical bending (symmetric),
    lateral, vertical bending (antisymmetric) and torsion.

    Parameters
    ----------
    n_modes : int, default=4
        Number of modes.
    track : bool, default=True
        Whether a column follows its mode by shape; False sorts columns by frequency.

    Returns
    -------
    AffineModel
        With 426 degrees of freedom and four parameters: ``girder_bending`` (E of
        the girder: vertical and lateral bending and the axial stiffness), ``piers_soil`` (the pier walls
        and the springs under them), ``girder_torsion`` (G of the girder) and ``abutments`` (all springs
        there). Each is also a damage group, and so are ``piers`` and ``soil``, the two parts of ``piers_soil``.

    See Also
    --------
    load_z24 : The monitoring of this bridge.

    Notes
    -----
    Axes: x along the bridge from one abutment, y across, z upwards; the girder's axis is at z = 0.
    :ref:`structure-of-z24` lists dimensions [PD01]_ and constants [TD04]_; ``tools/fit_z24_constants.py`` fitted four
    of the constants to the healthy records above 5 C. Torsion (f4) has vertical modes close below and above it, so that
    modes change their order in most of the box of +-30 %; columns therefore follow shapes.

    Examples
    --------
    >>> from skthermo.datasets import make_z24
    >>> model = make_z24()
    >>> model.frequencies([[1.0, 1.0, 1.0, 1.0]]).round(1)
    array([[ 3.9,  5.2, 10. , 10.7]])
    >>> model.damaged({"soil": 0.3}).frequencies([[1.0, 1.0, 1.0, 1.0]]).round(1)
    array([[ 3.9,  4.8, 10. , 10.6]])
    """
    n_modes = positive_integer(n_modes, "n_modes")
    groups = Z24_PARAMETERS | {"piers": "piers", "soil": "soil"}
    return z24_structure().assemble(Z24_PARAMETERS, groups=groups, n_modes=n_modes, track=track)


def z24_structure(
    constants: Mapping[str, Mapping[str, float]] = Z24_CONSTANTS, *, element_length: float = 1.0
) -> Structure:
    """Girder, piers, soil and abutments; nodes are named by their coordinates."""
    axes = [0.0, *np.cumsum((14.0, 30.0, 14.0)).tolist()]
    spans = [divided(start, end, element_length) for start, end in pairwise(axes)]
    girder: list[Place] = [(x, 0.0, 0.0) for x in dict.fromkeys(x for span in spans for x in span)]
    heights = divided(-5.5, 0.0, element_length)
    piers: list[list[Place]] = [[(x, 0.0, z) for z in heights] for x in axes[1:-1]]
    parts = {
        "girder": [Beam(*ends, **constants["girder"]) for ends in pairwise(girder)],
        "piers": [Beam(*ends, **constants["pier"]) for pier in piers for ends in pairwise(pier)],
        "soil": [Spring(pier[0], along, k) for pier in piers for along, k in constants["soil"].items()],
        "abutments": [
            Spring(end, along, k) for end in (girder[0], girder[-1]) for along, k in constants["abutment"].items()
        ],
    }
    members = {(part, i): element for part, elements in parts.items() for i, element in enumerate(elements)}
    groups = {part: [name for name in members if name[0] == part] for part in parts}
    return Structure(
        nodes={place: place for line in (girder, *piers) for place in line},
        members=members,
        supports={},
        groups=groups | {"piers_soil": groups["piers"] + groups["soil"]},
    )


def divided(start: float, end: float, element_length: float) -> list[float]:
    """Ends of equal elements of at most the given length."""
    return np.linspace(start, end, 1 + ceil((end - start) / element_length)).tolist()
