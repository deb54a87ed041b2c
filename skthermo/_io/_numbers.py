"""Numbers in a text."""

import re
import warnings

import numpy as np

from skthermo._arrays import Array


def read_numbers(text: bytes) -> Array:
    """All numbers of a text in a row, shape (n_numbers,).

    Raises
    ------
    ValueError
        Names the first word that is no number.
    """
    with warnings.catch_warnings():
        warnings.simplefilter("error", DeprecationWarning)  # of older versions of NumPy, about what is no number
        try:
            return np.fromstring(text, sep=" ") if text.strip() else np.empty(0)
        except (DeprecationWarning, ValueError) as error:
            raise ValueError(f"{_first_that_is_no_number(text)!r} is no number") from error


def _first_that_is_no_number(text: bytes) -> str:
    for match in re.finditer(rb"\S+", text):
        try:
            np.fromstring(match[0], sep=" ")
        except (DeprecationWarning, ValueError):
            return match[0][:30].decode("latin-1")
    return ""
