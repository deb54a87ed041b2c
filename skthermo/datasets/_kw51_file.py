"""Monitoring of the railway bridge KW51, with limits of possible values."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from skthermo._core.arrays import Array, check_path
from skthermo._core.matlab import read_matlab
from skthermo._core.warnings import warn_each
from skthermo.datasets._results import KW51Monitoring
from skthermo.exceptions import RecordsWarning, SkthermoWarning

CELSIUS = (-60.0, 80.0)  # what temperatures may be
PUBLISHED_MD5 = "5cdb446519d1150228fab51b3a002239"
NO_VALUES = (-99, -999, -9999, -99999, 9999, 99999, 999999)  # codes for missing values


def load_kw51(path: str | PathLike) -> KW51Monitoring:
    """Read the monitoring of the railway bridge KW51 before, during and after its retrofit.

    KW51 in Leuven is a steel bowstring bridge of 115 m. KU Leuven tracked its modes every hour from October 2018 to
    January 2020 [ML21]_; in between, the connections of its diagonals were strengthened. The data are not part of this
    package; they are published [ML20]_ at doi:10.5281/zenodo.3745914 for non-commercial use (CC BY-NC-SA 4.0).

    Parameters
    ----------
    path : str or path-like
        The file ``trackedmodes.zip`` as downloaded, or ``trackedmodes.mat`` in it: MATLAB v5, with a struct ``modes``
        of the fields ``sdn``, ``f``, ``xi``, ``m``, ``labels_m``, ``env`` and ``labels_env``. A file with only some
        of the records, modes, sensors or weather channels is read, too.

    Returns
    -------
    Bunch
        With these attributes:

        temperatures : DataFrame of shape (n_records, 11)
            Temperature and weather, with the columns of ``labels_env``. Only ``tBD31A`` (steel below the deck) and
            ``tVL`` (air) are temperatures, in degrees Celsius, so that a temperature mapper should learn from
            ``data.temperatures[["tBD31A"]]``. The others are relative humidity beside the steel (``rhBD31A``), and from
            the weather station relative humidity (``rhVL``), vapour pressure (``vpVL``), global, diffuse and direct
            normal radiation (``grVL``, ``drVL``, ``dnrVL``), rain (``raVL``), and speed and direction of the wind
            (``wsVL``, ``wdVL``), in the units of the file, which it does not state.
        frequencies : DataFrame of shape (n_records, 14)
            ``f1`` to ``f14`` in Hz, NaN where a mode was not identified.
        damping : DataFrame of shape (n_records, 14)
            ``xi1`` to ``xi14``, damping ratios as fractions of critical damping.
        shapes : complex ndarray of shape (n_records, 14, 12)
            Mode shapes at the sensors.
        sensors : list of str
            Names of the sensors, the last axis of ``shapes``.
        state : Series of shape (n_records,)
            "before", "during" (from 2019-05-15 00:00) or "after" (from 2019-09-27 01:00) the retrofit.
        is_published : bool or None
            Whether a zip file is, to the byte, the published one (by its MD5 checksum); None for a bare MATLAB file,
            whose checksum is not published.

        All have the rows of the file in their order, which may not be chronological. The tables have the same
        DatetimeIndex "time", the file's time stamps rounded to seconds, without a time zone. Nothing is filled in or
        left out.

    Raises
    ------
    FileNotFoundError
        If there is no file at the path.
    ValueError
        If the file is damaged, a field is missing or does not fit the others, a time stamp is repeated, or a value is
        impossible: frequencies outside 0.1 to 100 Hz, damping ratios outside -1 to 1, temperatures outside -60 to 80 C,
        or a number that stands for a missing one, such as -999. The error names the file, field, row (counted from
        zero) and column. Such numbers in other weather channels give a warning.

    See Also
    --------
    make_kw51 : An FE model of this bridge.

    Examples
    --------
    >>> from skthermo.datasets import load_kw51
    >>> load_kw51("no_such_folder/trackedmodes.zip")
    Traceback (most recent call last):
    ...
    FileNotFoundError: no_such_folder/trackedmodes.zip is not a file; expected trackedmodes.zip or trackedmodes.mat
    """
    file = check_path(path)
    if not file.is_file():
        raise FileNotFoundError(f"{file} is not a file; expected trackedmodes.zip or trackedmodes.mat")
    data, findings = _data(read_matlab(file), file)
    stored = file.read_bytes()
    md5, is_unpacked = hashlib.md5(stored, usedforsecurity=False).hexdigest(), stored[126:128] in (b"IM", b"MI")
    is_published = None if is_unpacked else md5 == PUBLISHED_MD5  # of the unpacked file there is no checksum
    if is_published is False:
        text = (
            f"{file} has the MD5 checksum {md5}, the published trackedmodes.zip has {PUBLISHED_MD5}. Its content may "
            "differ from what was published. Download it again, unless you changed it"
        )
        findings.append(RecordsWarning(text, "read-as"))
    warn_each(findings)
    return KW51Monitoring(**data, is_published=is_published)


def _data(content: dict[str, object], file: Path) -> tuple[dict[str, Any], list[SkthermoWarning]]:
    """Tables and shapes from the struct `modes`, whose fields must agree, and findings about its numbers."""
    modes, fields = content.get("modes"), ["sdn", "f", "xi", "m", "labels_m", "env", "labels_env"]
    if not isinstance(modes, dict):
        found = "'modes' is no single struct" if "modes" in content else f"the variables are {sorted(content)[:50]}"
        raise ValueError(f"{file}: {found}; expected a struct 'modes' with the fields {fields}")
    missing = [name for name in fields if name not in modes]
    if missing:
        raise ValueError(f"{file}: no field {missing} in 'modes'; found {sorted(modes)[:50]}")
    sdn, f, xi, env = (_numbers_of(modes[name], f"{file}: field {name!r}") for name in ("sdn", "f", "xi", "env"))
    m = _numbers_of(modes["m"], f"{file}: field 'm'", complex_too=True)
    sensors, channels = (_labels_of(modes[name], f"{file}: field {name!r}") for name in ("labels_m", "labels_env"))
    if f.ndim != 2 or not f.size or f.shape[1] > 1000:
        raise ValueError(f"{file}: field 'f' has shape {f.shape}; expected records times at most 1000 modes")
    n_records, n_modes = f.shape
    _check_shape(sdn.T if len(sdn) == 1 else sdn, (n_records, 1), f"{file}: field 'sdn'")
    _check_shape(xi, f.shape, f"{file}: field 'xi'")
    _check_shape(env, (n_records, len(channels)), f"{file}: field 'env'")
    _check_shape(m, (n_records, n_modes, len(sensors)), f"{file}: field 'm'")
    f_names, xi_names = ([f"{name}{number}" for number in range(1, n_modes + 1)] for name in ("f", "xi"))
    _check_possible(f, f_names, [(0.1, 100.0)] * n_modes, f"{file}: field 'f'")
    _check_possible(xi, xi_names, [(-1.0, 1.0)] * n_modes, f"{file}: field 'xi'")
    thermometers = ("tBD31A", "tVL")
    doubtful = np.isin(env, NO_VALUES) & ~np.isin(channels, thermometers)
    limits = [CELSIUS if channel in thermometers else None for channel in channels]
    _check_possible(np.where(doubtful, np.nan, env), channels, limits, f"{file}: field 'env'")
    findings: list[SkthermoWarning] = []
    if doubtful.any():
        row, column = np.argwhere(doubtful)[0]
        text = (
            f"{file}: field 'env' has {doubtful.sum()} values that look like codes for missing values, the first in "
            f"row {row}, column {channels[column]!r}: {env[row, column]:g}. They are used as measured. Compare the "
            "file with the published one, or put NaN there"
        )
        findings.append(RecordsWarning(text, "doubtful-values"))
    shapes = m.reshape(n_records, n_modes, len(sensors)).astype(complex, copy=False)
    for number, sensor in enumerate(sensors):
        for part in (shapes.real, shapes.imag):
            _check_possible(part[:, :, number], f_names, [None] * n_modes, f"{file}: field 'm', sensor {sensor!r}")
    time = _time_of(sdn.ravel(), f"{file}: field 'sdn'")
    tables = {"temperatures": (env, channels), "frequencies": (f, f_names), "damping": (xi, xi_names)}
    frames = {name: pd.DataFrame(values, index=time, columns=columns) for name, (values, columns) in tables.items()}
    return frames | {"shapes": shapes, "sensors": sensors, "state": state_of(time)}, findings


def _numbers_of(value: object, what: str, *, complex_too: bool = False) -> NDArray:
    if not isinstance(value, np.ndarray):
        raise ValueError(f"{what} is text, a cell array, a struct or sparse; expected a full array of numbers")
    if np.iscomplexobj(value) and not complex_too:
        raise ValueError(f"{what} has complex numbers; expected real ones")
    return value


def _labels_of(value: object, what: str) -> list[str]:
    """Texts of a cell array, nested or not, or of the rows of a matrix of characters."""
    labels = [text.strip() for text in _texts(value, what)]
    are_names = all(label and label.isprintable() for label in labels)
    if not are_names or len(set(labels)) != len(labels) or not 0 < len(labels) <= 1000:
        found = [label[:50] for label in labels[:50]]
        raise ValueError(f"{what} has {len(labels)} names, {found}; expected 1 to 1000 that differ")
    return labels


def _texts(value: object, what: str) -> Iterator[str]:
    if isinstance(value, str):
        yield value
    elif isinstance(value, list):
        for part in value or [""]:  # MATLAB's empty text has no rows
            yield from _texts(part, what)
    else:
        raise ValueError(f"{what} holds something else than texts; expected a cell array of names")


def _check_shape(values: NDArray, shape: tuple[int, ...], what: str) -> None:
    """Raise an error for another shape than expected; MATLAB leaves out last axes of length one."""
    if values.shape + (1,) * (len(shape) - values.ndim) != shape:
        raise ValueError(
            f"{what} has shape {values.shape}; expected {shape}, the records and modes of 'f' and the names in "
            "'labels_m' and 'labels_env'"
        )


def _check_possible(values: Array, columns: list[str], limits: list[tuple[float, float] | None], what: str) -> None:
    """Raise an error for the first value that cannot be measured, such as -999; a column may have limits."""
    wrong = np.isinf(values) | np.isin(values, NO_VALUES)
    for column, limit in enumerate(limits):
        if limit:
            wrong[:, column] |= (values[:, column] < limit[0]) | (values[:, column] > limit[1])
    if wrong.any():
        row, column = np.argwhere(wrong)[0]
        expected = "{:g} to {:g}".format(*limits[column]) if limits[column] else "a measured value"
        raise ValueError(
            f"{what}, row {row}, column {columns[column]!r} is {values[row, column]:g}; expected {expected}, or NaN "
            "where it is missing"
        )


def _time_of(numbers: Array, what: str) -> pd.DatetimeIndex:
    """MATLAB date numbers as time stamps to the second; each may stand there once."""
    wrong = ~((numbers >= 730486) & (numbers < 767011))
    if wrong.any():
        row = np.flatnonzero(wrong)[0]
        raise ValueError(
            f"{what}, row {row} is {numbers[row]}; expected a MATLAB date number from 730486 (year 2000) to "
            "767011 (2100)"
        )
    seconds = np.rint((numbers - 719529) * 86400).astype("datetime64[s]")
    time = pd.DatetimeIndex(seconds.astype("datetime64[ns]"), name="time")
    if time.has_duplicates:
        row = np.flatnonzero(time.duplicated())[0]
        raise ValueError(f"{what}, row {row} repeats {time[row]}; expected each time stamp once")
    return time


def state_of(time: pd.DatetimeIndex) -> pd.Series:
    """ "before", "during" or "after" the retrofit."""
    begins, ended = pd.Timestamp("2019-05-15 00:00"), pd.Timestamp("2019-09-27 01:00")
    state = np.select([time < begins, time < ended], ["before", "during"], "after")
    return pd.Series(state.tolist(), index=time, name="state")
