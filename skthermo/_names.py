"""Values that carry names are read by name: mappings, and Series and frames of pandas with labels."""

from collections.abc import Mapping, Sequence
from typing import Any


def by_name(values: Any, names: Sequence[Any], what: str, kind: str = "parameters") -> Any:
    """Values of a mapping, or of a Series with labels, in the order of the names; anything else unchanged.

    The labels must be exactly the names. Labels 0, 1, 2, ... are no names.
    """
    if isinstance(values, Mapping):
        labels = list(values)
    elif is_labelled(values):
        labels = list(values.index)
    else:
        return values
    check_labels(labels, names, what, kind)
    return [values[name] for name in names]


def rows_by_name(table: Any, names: Sequence[Any], what: str, kind: str = "parameters") -> Any:
    """A frame with labelled rows in the order of the names; anything else unchanged."""
    if not hasattr(table, "iloc") or table.ndim != 2 or is_numbered(table.index):
        return table
    check_labels(list(table.index), names, what, kind)
    return table.loc[list(names)]


def columns_by_name(table: Any, names: Sequence[Any], what: str, kind: str = "parameters") -> Any:
    """A frame with labelled columns in the order of the names; anything else unchanged."""
    if not hasattr(table, "columns") or is_numbered(table.columns):
        return table
    check_labels(list(table.columns), names, what, kind)
    return table[list(names)]


def check_labels(labels: Sequence[Any], names: Sequence[Any], what: str, kind: str) -> None:
    """Raise an error unless labels are the names, in any order."""
    unknown = [label for label in labels if label not in names]
    missing = [name for name in names if name not in labels]
    repeated = [label for place, label in enumerate(labels) if label in labels[:place]]
    for wrong, problem in ((unknown, "unknown"), (missing, "missing"), (repeated, "repeated")):
        if wrong:
            raise ValueError(f"{what}: {wrong} are {problem}; expected each of the {kind} {list(names)}")


def is_labelled(values: Any) -> bool:
    """Whether values are a Series of pandas whose labels are not just 0, 1, 2, ..."""
    return hasattr(values, "iloc") and values.ndim == 1 and not is_numbered(values.index)


def is_numbered(labels: Any) -> bool:
    """Whether labels are just 0, 1, 2, ..., which name nothing."""
    return list(labels) == list(range(len(labels)))


def as_mapping(values: Any) -> Any:
    """A Series with different labels as a mapping; anything else unchanged."""
    return dict(values.items()) if is_labelled(values) and values.index.is_unique else values
