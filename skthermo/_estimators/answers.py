"""Answers of fitted estimators that are asked the same again and again."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from pickle import PicklingError
from typing import Any, TypeVar

import joblib
import numpy as np

Answer = TypeVar("Answer")

MOST_KEPT = 12_500_000  # numbers, of 8 bytes, in the answers that are kept


def content_of(inputs: Any) -> str:
    """Hash of one input or a tuple; of tables, values and labels count, and not what pandas caches of an index."""
    return joblib.hash([_content(one) for one in (inputs if isinstance(inputs, tuple) else (inputs,))])


def _content(one: Any) -> Any:
    if not hasattr(one, "columns"):
        return one
    return np.asarray(one), list(one.columns), getattr(one.index, "asi8", one.index), str(one.index.dtype)


class KeptAnswers:
    """The last answers, by estimator and content of what it was asked, as many as have `MOST_KEPT` numbers."""

    def __init__(self) -> None:
        self._answers: dict[tuple[int, str], tuple[Any, int, Any]] = {}  # with the estimator, whose id nobody else gets
        self._size = 0

    def of(self, asked: Any, inputs: Any, size: int, answer: Callable[[], Answer]) -> Answer:
        """The answer, of so many numbers, given now or before."""
        try:
            key = id(asked), content_of(inputs)
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


def answer_once(asked: Any, inputs: Any, size: int, answer: Callable[[], Answer]) -> Answer:
    """What ``answer`` gives, about so many numbers, or has given in this context for equal inputs of an estimator."""
    kept = _kept.get()
    return answer() if kept is None else kept.of(asked, inputs, size, answer)
