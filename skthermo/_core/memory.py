"""Results that are kept in a folder, so that no search computes them again."""

from collections.abc import Callable
from pathlib import Path
from pickle import PicklingError
from typing import Any, TypeVar
from warnings import WarningMessage

import sklearn
from joblib import Memory
from sklearn.utils.validation import check_memory

import skthermo
from skthermo._core.answers import content_of
from skthermo._core.files import lock
from skthermo._core.warnings import give_again, recorded

Result = TypeVar("Result")


def identity_of(*parts: Any) -> str:
    """`content_of` some parts, which is another one in other versions."""
    try:
        return content_of(skthermo.__version__, sklearn.__version__, *parts)
    except PicklingError as error:
        raise ValueError(
            f"memory cannot recognise {parts[0]!r:.200}; expected an object that can be pickled, or memory=None. Its "
            "functions and classes have to come from a module, not from a script, notebook, function or lambda"
        ) from error


def folder_of(memory: str | Memory | None) -> Path | None:
    """Where results are kept; None where they are not."""
    location = getattr(memory, "location", memory)
    return None if location is None else Path(location)


def remembered(memory: str | Memory | None, kind: str, make: Callable[[], Result], content: tuple[Any, ...]) -> Result:
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
    identity = identity_of(*content)
    folder.mkdir(parents=True, exist_ok=True)
    with open(folder / f"{kind}-{identity}.lock", "w") as file:
        lock(file)
        known = memory.cache(made, ignore=["make"])
        if not known.check_call_in_cache(kind, identity, make):
            known(kind, identity, make)
        result, caught = known(kind, identity, make)  # what is read has the same layout, and bits, each time
    give_again(caught)
    return result


def made(kind: str, identity: str, make: Callable[[], Any]) -> tuple[Any, list[WarningMessage]]:
    """A result, and the warnings that came with it."""
    with recorded() as caught:
        result = make()
    return result, caught
