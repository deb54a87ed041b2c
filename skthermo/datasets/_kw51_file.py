"""Monitoring of the railway bridge KW51."""

import hashlib
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from skthermo._io import read_matlab
from skthermo._warnings import warn_user
from skthermo.datasets._kw51_fields import (
    check_finite,
    check_possible,
    check_shape,
    labels_of,
    numbers_of,
    time_of,
)
from skthermo.datasets._results import KW51Monitoring

PUBLISHED_MD5 = "5cdb446519d1150228fab51b3a002239"
LARGEST_FILE = 1_000_000_000  # bytes; the published zip file has 13 million
MOST_MODES = 1000
TEMPERATURES = ("tBD31A", "tVL")
FIELDS = ["sdn", "f", "xi", "m", "labels_m", "env", "labels_env"]
RETROFIT_BEGINS = pd.Timestamp("2019-05-15 00:00")
AFTER_RETROFIT = pd.Timestamp("2019-09-27 01:00")


def load_kw51(path: str | PathLike) -> KW51Monitoring:
    """Read the monitoring of the railway bridge KW51 before, during and after its retrofit.

    KW51 in Leuven is a steel bowstring bridge of 115 m. KU Leuven tracked its modes every hour from October 2018 to
    January 2020; in between, the connections of its diagonals were strengthened. The data are not part of this
    package; they are published at doi:10.5281/zenodo.3745914 for non-commercial use (CC BY-NC-SA 4.0).

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
            ``tVL`` (air) are temperatures, in degrees Celsius, so that ``data.temperatures[["tBD31A"]]`` is what a
            temperature mapper should learn from. The others are relative humidity beside the steel (``rhBD31A``), and
            from the weather station relative humidity (``rhVL``), vapour pressure (``vpVL``), global, diffuse and
            direct normal radiation (``grVL``, ``drVL``, ``dnrVL``), rain (``raVL``), and speed and direction of the
            wind (``wsVL``, ``wdVL``), in the units of the file, which it does not state.
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

        All have the rows of the file in their order, which need not be that of time. The tables have the same
        DatetimeIndex "time", the file's time stamps rounded to seconds, without a time zone. Nothing is filled in or
        left out.

    Raises
    ------
    FileNotFoundError
        If there is no file at the path.
    ValueError
        If the file is damaged, a field is missing or does not fit the others, a time stamp is repeated, or a value is
        impossible: frequencies outside 0.1 to 100 Hz, damping ratios outside -1 to 1, temperatures outside -60 to 80 C,
        or a number in their place that stands for a missing one, such as -999. The error names the file, field, row
        (counted from zero) and column.

    Warns
    -----
    UserWarning
        If a zip file is not the published one, or another weather channel has numbers that stand for missing ones.

    See Also
    --------
    make_kw51 : An FE model of this bridge.

    References
    ----------
    Maes & Lombaert, Monitoring railway bridge KW51 before, during, and after retrofitting, Journal of Bridge
    Engineering 26 (3) (2021) 04721001 [ML21]_.

    Maes & Lombaert, Monitoring data for railway bridge KW51 in Leuven, Belgium, before, during, and after retrofitting,
    Zenodo, 2020 [ML20]_.

    Examples
    --------
    >>> from skthermo.datasets import load_kw51
    >>> load_kw51("no_such_folder/trackedmodes.zip")
    Traceback (most recent call last):
    ...
    FileNotFoundError: no_such_folder/trackedmodes.zip is not a file; expected trackedmodes.zip or trackedmodes.mat
    """
    file = Path(path)
    if not file.is_file():
        raise FileNotFoundError(f"{file} is not a file; expected trackedmodes.zip or trackedmodes.mat")
    if (size := file.stat().st_size) > LARGEST_FILE:
        raise ValueError(f"{file}: {size / 1e6:.0f} MB; expected at most {LARGEST_FILE / 1e6:.0f} MB")
    data = _data(read_matlab(file), file)
    stored = file.read_bytes()
    if stored[126:128] in (b"IM", b"MI"):
        return KW51Monitoring(**data, is_published=None)
    md5 = hashlib.md5(stored, usedforsecurity=False).hexdigest()
    if md5 != PUBLISHED_MD5:
        warn_user(
            f"{file} has the MD5 checksum {md5}; expected {PUBLISHED_MD5}, that of the published trackedmodes.zip: its "
            "content may differ from what was published",
            kind="another KW51 file",
        )
    return KW51Monitoring(**data, is_published=md5 == PUBLISHED_MD5)


def _data(content: dict[str, Any], file: Path) -> dict[str, Any]:
    """Tables and shapes from the struct `modes`, whose fields must agree."""
    modes = content.get("modes")
    if not isinstance(modes, dict):
        found = "'modes' is no single struct" if "modes" in content else f"the variables are {sorted(content)[:50]}"
        raise ValueError(f"{file}: {found}; expected a struct 'modes' with the fields {FIELDS}")
    missing = [name for name in FIELDS if name not in modes]
    if missing:
        raise ValueError(f"{file}: no field {missing} in 'modes'; found {sorted(modes)[:50]}")
    sdn, f, xi, env = (numbers_of(modes[name], f"{file}: field {name!r}") for name in ("sdn", "f", "xi", "env"))
    m = numbers_of(modes["m"], f"{file}: field 'm'", complex_too=True)
    sensors, channels = (labels_of(modes[name], f"{file}: field {name!r}") for name in ("labels_m", "labels_env"))
    if f.ndim != 2 or not f.size or f.shape[1] > MOST_MODES:
        raise ValueError(f"{file}: field 'f' has shape {f.shape}; expected records times at most {MOST_MODES} modes")
    n_records, n_modes = f.shape
    check_shape(sdn.T if len(sdn) == 1 else sdn, (n_records, 1), f"{file}: field 'sdn'")
    check_shape(xi, f.shape, f"{file}: field 'xi'")
    check_shape(env, (n_records, len(channels)), f"{file}: field 'env'")
    check_shape(m, (n_records, n_modes, len(sensors)), f"{file}: field 'm'")
    f_names, xi_names = ([f"{name}{number}" for number in range(1, n_modes + 1)] for name in ("f", "xi"))
    check_possible(f, f_names, ["f"] * n_modes, f"{file}: field 'f'")
    check_possible(xi, xi_names, ["xi"] * n_modes, f"{file}: field 'xi'")
    is_temperature = np.isin(channels, TEMPERATURES)
    thermal, other = ([channels[i] for i in np.flatnonzero(chosen)] for chosen in (is_temperature, ~is_temperature))
    check_possible(env[:, is_temperature], thermal, thermal, f"{file}: field 'env'")
    check_finite(env[:, ~is_temperature], other, f"{file}: field 'env'")
    shapes = m.reshape(n_records, n_modes, len(sensors)).astype(complex, copy=False)
    for number, sensor in enumerate(sensors):
        for part in (shapes.real, shapes.imag):
            check_possible(part[:, :, number], f_names, ["m"] * n_modes, f"{file}: field 'm', sensor {sensor!r}")
    time = time_of(sdn.ravel(), f"{file}: field 'sdn'")
    state = np.select([time < RETROFIT_BEGINS, time < AFTER_RETROFIT], ["before", "during"], "after")
    return {
        "temperatures": pd.DataFrame(env, index=time, columns=channels),
        "frequencies": pd.DataFrame(f, index=time, columns=f_names),
        "damping": pd.DataFrame(xi, index=time, columns=xi_names),
        "shapes": shapes,
        "sensors": sensors,
        "state": pd.Series(state.tolist(), index=time, name="state"),
    }
