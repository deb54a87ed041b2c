"""Findings become Python's warnings, at the user's line, where a public method ends."""

import sys
import threading
import warnings
from collections.abc import Iterable, Iterator
from contextlib import contextmanager

from skthermo.exceptions import SkthermoWarning


def one_of_each_kind(findings: Iterable[SkthermoWarning], *, most: int = 3) -> list[SkthermoWarning]:
    """Findings of one kind as one, whose text names at most three of them, and how many more there are."""
    by_kind: dict[str, dict[str, SkthermoWarning]] = {}
    for finding in findings:
        by_kind.setdefault(finding.kind, {}).setdefault(finding.args[0], finding)
    joined = []
    for kind, by_text in by_kind.items():
        rest = f" (and {len(by_text) - most} more)" if len(by_text) > most else ""
        category = type(next(iter(by_text.values())))
        joined.append(category(". Also: ".join([*by_text][:most]) + rest, kind))
    return joined


def warn_each(findings: Iterable[SkthermoWarning]) -> None:
    """Give one warning of each kind that was found, at the nearest line outside skthermo, scikit-learn and joblib."""
    of_each_kind = one_of_each_kind(findings)
    if not of_each_kind:
        return
    frame, level = sys._getframe(1), 2
    while frame.f_back is not None and frame.f_globals.get("__name__", "").partition(".")[0] in (
        *("skthermo", "sklearn", "joblib"),
        *("contextlib", "functools"),  # which call what is decorated
    ):
        frame, level = frame.f_back, level + 1
    for finding in of_each_kind:
        warnings.warn(finding, stacklevel=level)


@contextmanager
def collected(*, drop_others: bool = False) -> Iterator[list[SkthermoWarning]]:
    """Warnings of the parts within become findings of the estimator that calls them.

    Warnings of other packages pass, unless they are dropped. Outside the main thread all pass as they are, because
    filters belong to the whole process.
    """
    findings: list[SkthermoWarning] = []
    if threading.current_thread() is not threading.main_thread():
        yield findings
        return
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", Warning if drop_others else SkthermoWarning)
        yield findings
    for one in caught:
        if isinstance(one.message, SkthermoWarning):
            findings.append(one.message)
        elif not drop_others:
            warnings.warn_explicit(one.message, one.category, one.filename, one.lineno)
