"""Results that are kept in a folder, so that a search does not compute them again."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from pickle import PicklingError
from typing import Any, TypeVar
from warnings import WarningMessage

import joblib
import numpy as np
import sklearn
from joblib import Memory
from sklearn.utils.validation import check_memory

import skthermo
from skthermo._estimators.warnings import give_again, recorded
from skthermo._io import lock

Result = TypeVar("Result")


def content_of(*parts: Any) -> str:
    """A text that is the same for equal contents in every process, and another one for other contents or versions.

    Each part counts by itself, whether or not others hold the same objects.
    """
    try:
        hashes = [joblib.hash(_in_order(part), coerce_mmap=True) for part in parts]
    except PicklingError as error:
        raise ValueError(
            f"memory cannot recognise {parts[0]!r:.200}; expected one that can be pickled, with functions and classes "
            "from a module that can be imported (no lambda, nothing from a script, a notebook or a function), or "
            "memory=None"
        ) from error
    return joblib.hash((skthermo.__version__, sklearn.__version__, *hashes))


def _in_order(part: Any) -> Any:
    """An array with its values row by row, as it is when read from a file."""
    return np.ascontiguousarray(part) if isinstance(part, np.ndarray) else part


def folder_of(memory: str | Memory | None) -> Path | None:
    """Where results are kept; None where they are not."""
    location = getattr(memory, "location", memory)
    return None if location is None else Path(location)


def remembered(
    memory: str | Memory | None, kind: str, make: Callable[[], Result], content: Callable[[], tuple[Any, ...]]
) -> Result:
    """What ``make`` returns, which depends on the content alone: read from the memory if it is there.

    Warnings come again with it. If several processes need the same, one makes it and the others wait.
    """
    try:
        memory = check_memory(memory)
    except OSError as error:
        raise ValueError(f"memory is {memory!r}; expected a folder that can be written to ({error})") from error
    folder = folder_of(memory)
    if folder is None:
        return make()
    identity = content_of(*content())
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / f"{kind}-{identity}.lock", "w") as file:
        lock(file)
        known = memory.cache(made, ignore=["make"])
        if not known.check_call_in_cache(kind, identity, make):
            known(kind, identity, make)
        result, told = known(kind, identity, make)  # what is read has the same layout, and bits, each time
    give_again(told)
    return result


def made(kind: str, identity: str, make: Callable[[], Any]) -> tuple[Any, list[WarningMessage]]:
    """A result, and the warnings that came with it."""
    with recorded() as told:
        result = make()
    return result, told
