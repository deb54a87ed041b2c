"""Files of a monitor: written beside and renamed, read as a whole or refused."""

from __future__ import annotations

import io
import os
import pickle
import zlib
from importlib import import_module
from pathlib import Path
from typing import Any

import joblib
import pandas as pd
import sklearn
from joblib.numpy_pickle import NumpyUnpickler
from sklearn.utils.validation import check_is_fitted

import skthermo
from skthermo._core.arrays import check_path
from skthermo._core.estimators import import_optional
from skthermo._core.files import write_when_complete

ENDINGS = (".joblib", ".skops")
TRUSTED = ("skthermo", "sklearn")  # packages whose classes are read from skops' files
PLAIN = {"zoneinfo.ZoneInfo", "datetime.timezone", "datetime.timedelta", "builtins.frozenset"}


def versions() -> dict[str, str]:
    """Versions of the programs on which a monitor's decisions depend."""
    return {"skthermo": skthermo.__version__, "scikit-learn": sklearn.__version__}


def write_monitor(monitor: Any, path: str | os.PathLike[str]) -> None:
    """Replace a file by one that holds a monitor, once that is complete and could be read again."""
    check_is_fitted(monitor)
    file = _checked(path)
    if not file.parent.is_dir():
        raise ValueError(
            f"path is {str(file)!r}, and there is no folder {str(file.parent)!r}; expected one that exists"
        )
    content = _by_skops(monitor, file) if file.suffix == ".skops" else _by_joblib(monitor)
    try:
        write_when_complete(file, content)
    except OSError as error:
        raise OSError(f"{file} was not written and is as it was before: {error}") from error


def load_monitor(path: str | os.PathLike[str]) -> Any:
    """Read a monitor that was saved; it goes on where it stopped.

    Parameters
    ----------
    path : str or path
        A file of `Monitor.save`, which ends with ``.skops`` or ``.joblib``.

    Returns
    -------
    Monitor
        As it was saved, with its events, the memory of its lags and windows, and the records that it keeps.

    Raises
    ------
    FileNotFoundError
        If there is no such file.
    ValueError
        If the file has another ending, is damaged, holds something else than a monitor, or, ending with ``.skops``,
        holds classes that are not part of skthermo or scikit-learn.
    ImportError
        If the file ends with ``.skops``, and skops is not installed.

    See Also
    --------
    Monitor.save : Writes the file.

    Notes
    -----
    Reading a ``.joblib`` file can run any code: read only your own. A ``.skops`` file runs none. Only classes that
    skthermo and scikit-learn define are read from it, beside arrays, numbers, texts and time zones, and never
    functions. Where a detector holds a class of another package, such as a regressor of its own, save the monitor as
    ``.joblib``.

    Examples
    --------
    >>> from skthermo.monitoring import load_monitor
    >>> load_monitor("bridge.pkl")
    Traceback (most recent call last):
    ...
    ValueError: path is 'bridge.pkl'; expected a file that ends with .joblib or .skops
    """
    file = _checked(path)
    if not file.is_file():
        raise FileNotFoundError(f"there is no file {str(file)!r}; expected one that Monitor.save has written")
    content = file.read_bytes()
    if file.suffix == ".skops":
        import_optional("skops.io", extra="drop-ins")
    try:
        monitor = _from_skops(content) if file.suffix == ".skops" else _from_joblib(content)
    except (ImportError, AttributeError) as error:  # of classes that there were in 0.2
        raise ValueError(
            f"{file} was saved by another version of skthermo; expected a monitor that is fitted anew, as by skthermo "
            "fit FOLDER --replace, which keeps settings, records and acknowledgements"
        ) from error
    except Exception as error:  # damaged files raise errors of every type
        raise ValueError(
            f"{file} cannot be read: {type(error).__name__}: {error}; expected the whole file of a monitor, saved with "
            f"versions like {_listed(versions())}"
        ) from error
    if not all(hasattr(monitor, name) for name in ("update", "events_", "versions_")):
        raise ValueError(f"{file} holds {type(monitor).__name__!r}; expected a fitted Monitor")
    return monitor


def acknowledgements_in(path: str | os.PathLike[str]) -> pd.DataFrame:
    """What the owner has said of events, from the file of a monitor, also from a joblib file of version 0.2."""
    file = _checked(path)
    try:
        return load_monitor(file).acknowledgements_
    except ValueError as refused:
        try:
            content = io.BytesIO(zlib.decompress(file.read_bytes()))
            monitor = _SomeMonitor(str(file), content, ensure_native_byte_order=True).load()
            said = [vars(one) for one in vars(monitor.history_)["acknowledgements"]]
        except Exception:  # damaged files raise errors of every type
            raise refused from None
    names = {"kind": "kind", "peak_time": "time", "time": "at", "harmless": "harmless", "note": "note"}
    return pd.DataFrame(said, columns=list(names)).rename(columns=names)


class _OfOtherVersion:
    """An object of skthermo in the file of another version: its attributes alone."""

    def __setstate__(self, state: Any) -> None:
        vars(self).update(state if isinstance(state, dict) else {})


class _SomeMonitor(NumpyUnpickler):
    """Reads a file of joblib without the classes of skthermo."""

    def find_class(self, module: str, name: str) -> Any:
        return type(name, (_OfOtherVersion,), {}) if module.startswith("skthermo") else super().find_class(module, name)


def _checked(path: Any) -> Path:
    file = check_path(path)
    if file.suffix not in ENDINGS:
        raise ValueError(f"path is {str(file)!r}; expected a file that ends with {' or '.join(ENDINGS)}")
    return file


def _listed(numbers: dict[str, str]) -> str:
    return ", ".join(f"{name} {number}" for name, number in numbers.items())


def _by_joblib(monitor: Any) -> bytes:
    """A compressed file of joblib, which ends with a checksum."""
    stream = io.BytesIO()
    try:
        joblib.dump(monitor, stream)
    except pickle.PicklingError as error:
        raise ValueError(
            f"the monitor cannot be saved: {error}; expected a model from matrices, or functions of a module that is "
            "installed, not of a file that was run"
        ) from error
    compressor = zlib.compressobj(level=1, strategy=zlib.Z_RLE)  # the fastest, which adds a checksum
    return compressor.compress(stream.getbuffer()) + compressor.flush()


def _from_joblib(content: bytes) -> Any:
    """What joblib wrote, compressed as here or plain."""
    is_compressed = content[:1] == zlib.compress(b"")[:1]
    return joblib.load(io.BytesIO(zlib.decompress(content) if is_compressed else content))


def _by_skops(monitor: Any, file: Path) -> bytes:
    skops = import_optional("skops.io", extra="drop-ins")
    try:
        content: bytes = skops.dumps(monitor)
        foreign = _foreign(skops.get_untrusted_types(data=content))
    except Exception as error:  # of what it cannot save
        raise ValueError(f"skops cannot save this monitor: {error}; expected a path that ends with .joblib") from error
    if foreign:
        raise ValueError(
            f"{file} would hold {foreign}, which are no classes of skthermo or scikit-learn and would not be read "
            "again; expected a path that ends with .joblib"
        )
    return content


def _from_skops(content: bytes) -> Any:
    skops = import_optional("skops.io", extra="drop-ins")
    types = skops.get_untrusted_types(data=content)
    if foreign := _foreign(types):
        raise ValueError(f"{foreign} are no classes of this skthermo or scikit-learn, and are not read")
    return skops.loads(content, trusted=types)


def _foreign(types: list[str]) -> list[str]:
    """Names that are not of classes which trusted packages define: what these import, and functions, are foreign."""
    return [name for name in types if name not in PLAIN and not _is_own_class(*name.rpartition(".")[::2])]


def _is_own_class(module: str, name: str) -> bool:
    if module.partition(".")[0] not in TRUSTED:
        return False
    try:
        found = getattr(import_module(module), name, None)
    except ImportError:
        return False
    return isinstance(found, type) and found.__module__ == module
