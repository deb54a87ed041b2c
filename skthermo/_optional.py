"""Optional dependencies."""

from importlib import import_module
from types import ModuleType


def import_optional(module: str, *, extra: str) -> ModuleType:
    """Import ``module``; if it is missing, the error names the extra of skthermo that installs it.

    Raises
    ------
    ImportError
        If the module is not installed.

    Examples
    --------
    >>> import_optional("no_such_plotter", extra="plot")
    Traceback (most recent call last):
    ...
    ImportError: 'no_such_plotter' is not installed; get it with: pip install ".[plot]" in a copy of the repository
    """
    try:
        return import_module(module)
    except ImportError as error:
        command = f'pip install ".[{extra}]"'
        raise ImportError(f"{module!r} is not installed; get it with: {command} in a copy of the repository") from error
