"""Work over joblib's workers, of which processes may be killed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Generator, Hashable, Iterable, Iterator, Mapping
from contextlib import closing
from itertools import islice
from typing import Any

from joblib import Parallel, delayed, effective_n_jobs

from skthermo.fleet._bridge import Failure, by_value

MOST_LOST = 2  # processes that were killed while a task may have run in them, before it is run alone
KILLED = ("TerminatedWorkerError", "BrokenProcessPool", "KilledWorker", "WorkerCrashedError", "OutOfMemoryError")
WAVE = 4  # tasks for each worker of a back end that gives all results at the end


def run_tasks(tasks: Mapping[Hashable, Any], n_jobs: int | None) -> Iterator[tuple[Hashable, Any]]:
    """Names and results of tasks, as they come; each task is a function without arguments.

    If a process is killed, most back ends end all others. Tasks that may have run in it are begun again together with
    the rest, and after another time alone; one that is alone with a killed process is lost, and its ``lost(failure)``
    is the result.
    """
    left, n_lost = dict(tasks), Counter[Hashable]()
    while left:
        together = {name: task for name, task in left.items() if n_lost[name] < MOST_LOST}
        batch = together or dict(islice(left.items(), 1))
        begun: list[Hashable] = []
        try:
            with closing(_results(batch, begun, n_jobs)) as results:
                for name, result in results:
                    del left[name]
                    yield name, result
        except Exception as error:  # of the back end: tasks keep their own
            suspects = [name for name in begun if name in left]
            if not suspects:
                raise
            _refuse_what_cannot_travel({name: left[name] for name in suspects}, error)
            n_lost.update(suspects)
            for name in suspects:
                if n_lost[name] > MOST_LOST:
                    yield name, left.pop(name).lost(_killed(error))


def _results(
    tasks: Mapping[Hashable, Any], begun: list[Hashable], n_jobs: int | None
) -> Generator[tuple[Hashable, Any], None, None]:
    """Names and results; only tasks that have a worker are listed as begun."""

    def jobs(some: Iterable[tuple[Hashable, Any]]) -> Iterator[Any]:
        for name, task in some:
            begun.append(name)
            yield delayed(_run)(name, task)

    options: dict[str, Any] = {"n_jobs": n_jobs, "batch_size": 1, "pre_dispatch": "n_jobs", "max_nbytes": None}
    waiting = iter(tasks.items())
    try:
        parallel = Parallel(return_as="generator_unordered", **options)
    except ValueError:  # some back ends, such as Ray's, return all results at the end
        parallel = Parallel(**options)
        while wave := list(islice(waiting, WAVE * effective_n_jobs(n_jobs))):
            yield from parallel(jobs(wave))
    else:
        yield from parallel(jobs(waiting))


def _run(name: Hashable, task: Any) -> tuple[Hashable, Any]:
    return name, task()


def _refuse_what_cannot_travel(tasks: Mapping[Hashable, Any], error: Exception) -> None:
    """Raise an error for tasks that cannot be sent to another process."""
    for name, task in tasks.items():
        for what, part in vars(task).items():
            try:
                by_value(part)
            except Exception as problem:  # pickling fails with errors of every type
                raise ValueError(
                    f"{what} of bridge {name!r} cannot be pickled, so that no other process can get it ({problem}); "
                    "expected what can be, such as a function that makes it, or n_jobs=1"
                ) from error


def _killed(error: Exception) -> Failure:
    """What is said of a task whose process was killed each time."""
    first = str(error).strip().partition("\n")[0].partition(". ")[0]
    kind = type(error).__name__
    text = "its process was killed each time, also when it was alone: was it out of memory?"
    if kind not in KILLED:
        text = "the back end failed each time, also when it was alone"
    return Failure("process", kind, f"{text} ({first})", "")
