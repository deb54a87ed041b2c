"""Results that a memory keeps where a user gives one."""

from collections.abc import Callable, Sequence
from pickle import PicklingError
from typing import Any, TypeVar

import pandas as pd
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
        return known(*arguments) if memory is None else known(*map(as_new, arguments))
    except PicklingError as error:
        raise ValueError(
            f"memory cannot recognise {arguments[0]!r:.200}; expected an object that can be pickled, or memory=None. "
            "Its functions and classes have to come from a module, not from a script, notebook, function or lambda"
        ) from error


def as_new(argument: Any) -> Any:
    """A frame as if it had just been read: joblib tells frames apart by what pandas has cached in their index."""
    if not isinstance(argument, pd.DataFrame):
        return argument
    index = pd.Index(argument.index.array.copy(), name=argument.index.name)
    return pd.DataFrame(argument.to_numpy(copy=True), index, list(argument.columns))
