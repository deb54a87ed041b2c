"""Files in the format of KW51's monitoring, with random content or a given one."""

import io
import zipfile

import numpy as np
import pandas as pd
import scipy.io

SENSORS = ["aBD11Az", "aBD17Ay", "aBD17Az", "aBD17Cz", "aBD23Ay", "aBD23Az"]
SENSORS += [f"aAR{panel}{side}y" for panel in ("0910", "1516", "2122") for side in "AC"]
CHANNELS = ["tBD31A", "rhBD31A", "tVL", "rhVL", "vpVL", "grVL", "drVL", "dnrVL", "raVL", "wsVL", "wdVL"]
N_MODES = 14


def date_numbers(times):
    """MATLAB date numbers of time stamps, (n, 1)."""
    days = (pd.DatetimeIndex(times) - pd.Timestamp("1970-01-01")) / pd.Timedelta("1D")
    return days.to_numpy()[:, np.newaxis] + 719529


def cell(texts, *, is_column=False):
    cells = np.empty((len(texts), 1) if is_column else (1, len(texts)), dtype=object)
    cells.ravel()[:] = texts
    return cells


def kw51_fields(
    frequencies=None,
    damping=None,
    shapes=None,
    temperatures=None,
    *,
    n_records=12,
    times=None,
    channels=CHANNELS,
    seed=0,
):
    """Fields of the struct `modes`.

    What is not given is random, with some modes that were not identified, and hourly from 2018-10-01; without shapes
    there are twelve sensors.
    """
    random = np.random.default_rng(seed)
    given = [field for field in (frequencies, damping, shapes, temperatures) if field is not None]
    n_records = len(given[0]) if given else n_records
    n_modes = N_MODES if frequencies is None else np.shape(frequencies)[1]
    n_sensors = len(SENSORS) if shapes is None else np.shape(shapes)[2]
    missing = random.random((n_records, n_modes)) < 0.3
    if frequencies is None:
        frequencies = np.where(missing, np.nan, random.normal(np.linspace(0.5, 7, n_modes), 0.01, missing.shape))
    if damping is None:
        damping = np.where(missing, np.nan, random.uniform(0.001, 0.05, missing.shape))
    if shapes is None:
        parts = random.normal(size=(2, n_records, n_modes, n_sensors))
        shapes = np.where(missing[..., np.newaxis], np.nan, parts[0] + 1j * parts[1])
    if temperatures is None:
        temperatures = random.uniform(0, 30, (n_records, len(channels)))
    return {
        "sdn": date_numbers(pd.date_range("2018-10-01", periods=n_records, freq="h") if times is None else times),
        "f": np.asarray(frequencies),
        "xi": np.asarray(damping),
        "m": np.asarray(shapes),
        "labels_m": cell(SENSORS[:n_sensors]),
        "env": np.asarray(temperatures),
        "labels_env": cell(list(channels)[: np.shape(temperatures)[1]]),
    }


def kw51_bytes(fields, *, compressed=True, zipped=False):
    stream = io.BytesIO()
    scipy.io.savemat(stream, {"modes": fields}, do_compression=compressed)
    if not zipped:
        return stream.getvalue()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("trackedmodes.mat", stream.getvalue())
    return packed.getvalue()


def write_kw51(path, *args, compressed=True, **fields):
    """Write a file, zipped if its name ends so, and return its fields; arguments as those of `kw51_fields`."""
    written = kw51_fields(*args, **fields)
    path.write_bytes(kw51_bytes(written, compressed=compressed, zipped=path.suffix == ".zip"))
    return written
