"""Answers of fitted estimators that are asked the same again and again."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from hashlib import sha256
from pickle import PicklingError
from typing import Any, TypeVar

import joblib
import numpy as np

Answer = TypeVar("Answer")

MOST_KEPT = 12_500_000  # numbers, of 8 bytes, in the answers that are kept


def content_of(*parts: Any) -> str:
    """A text that is the same in every process for equal contents of all parts, whether or not they share objects.

    Values and labels of tables count, and not what pandas caches of an index.
    """
    return sha256(b"".join(_digest(part) for part in parts)).hexdigest()


def _digest(part: Any) -> bytes:
    """Hash of one part; arrays, which are the most of what is asked, are hashed as their bytes row by row."""
    if hasattr(part, "columns") and hasattr(part, "index"):
        index = getattr(part.index, "asi8", part.index)
        labels = f"{list(part.columns)!r} {part.index.dtype}".encode()
        return sha256(_digest(np.asarray(part)) + _digest(np.asarray(index)) + labels).digest()
    if isinstance(part, np.ndarray) and not part.dtype.hasobject:
        kind = f"{part.dtype.str} {part.shape}".encode()
        return sha256(kind + np.ascontiguousarray(part).tobytes()).digest()
    return str(joblib.hash(part, coerce_mmap=True)).encode()


class KeptAnswers:
    """The last answers, by estimator and content of what it was asked, as many as have `MOST_KEPT` numbers."""

    def __init__(self) -> None:
        self._answers: dict[tuple[int, str], tuple[Any, int, Any]] = {}  # with the estimator, whose id nobody else gets
        self._size = 0

    def of(self, asked: Any, inputs: tuple[Any, ...], size: int, answer: Callable[[], Answer]) -> Answer:
        """The answer, of so many numbers, given now or before."""
        try:
            key = id(asked), content_of(*inputs)
        except PicklingError:  # of a part that somebody wrote in a notebook, say
            return answer()
        if key in self._answers:
            return self._answers[key][-1]
        found = answer()
        self._answers[key] = asked, size, found
        self._size += size
        while self._size > MOST_KEPT:
            self._size -= self._answers.pop(next(iter(self._answers)))[1]
        return found


_kept: ContextVar[KeptAnswers | None] = ContextVar("answers that are kept", default=None)


@contextmanager
def answers_kept() -> Iterator[None]:
    """Within, estimators keep their last answers to `answer_once`; a warning is not repeated with an answer."""
    token = _kept.set(_kept.get() or KeptAnswers())
    try:
        yield
    finally:
        _kept.reset(token)


def answer_once(asked: Any, inputs: tuple[Any, ...], size: int, answer: Callable[[], Answer]) -> Answer:
    """What ``answer`` gives, about so many numbers, or has given in this context for equal inputs of an estimator."""
    kept = _kept.get()
    return answer() if kept is None else kept.of(asked, inputs, size, answer)
