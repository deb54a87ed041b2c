"""Results that a memory keeps where a user gives one."""

from collections.abc import Callable, Sequence
from pickle import PicklingError
from typing import Any, TypeVar

from joblib import Memory
from sklearn.utils.validation import check_memory

Result = TypeVar("Result")


def remembered(
    memory: str | Memory | None, function: Callable[..., Result], *arguments: Any, ignore: Sequence[str] = ()
) -> Result:
    """What a function gives, read from the memory if it was given the same arguments, but those to ignore, before."""
    try:
        known = check_memory(memory).cache(function, ignore=list(ignore))
    except OSError as error:
        raise ValueError(f"memory is {memory!r}; expected a folder that can be written to ({error})") from error
    try:
        return known(*arguments)
    except PicklingError as error:
        raise ValueError(
            f"memory cannot recognise {arguments[0]!r:.200}; expected an object that can be pickled, or memory=None. "
            "Its functions and classes have to come from a module, not from a script, notebook, function or lambda"
        ) from error
