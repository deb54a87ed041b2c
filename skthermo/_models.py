"""What counts as an FE model, for rooms that may not import ``fem``."""

from typing import Any

MEMBERS = ("parameter_names", "n_modes", "frequencies")


def is_model(candidate: Any) -> bool:
    """Whether an object is an FE model, judged by its attributes."""
    return not isinstance(candidate, type) and all(hasattr(candidate, name) for name in MEMBERS)


def check_model(candidate: Any) -> None:
    """Raise an error for an object that is not an FE model.

    Raises
    ------
    ValueError
        Says what was given.
    """
    if not is_model(candidate):
        raise ValueError(
            f"model is {candidate!r:.200}; expected an FE model, an object with parameter_names, n_modes and "
            "frequencies"
        )
