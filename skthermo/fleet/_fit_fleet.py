"""Many bridges fitted side by side."""

from __future__ import annotations

import os
from collections.abc import Callable, Hashable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from sklearn.base import BaseEstimator

from skthermo._core.arrays import check_jobs, check_path
from skthermo._core.parallel import with_progress
from skthermo._core.warnings import warn_user
from skthermo.exceptions import SkthermoWarning
from skthermo.fleet._fleet import Fleet, Storage, named, warn_of_bridges
from skthermo.fleet._workers import BridgeFit, run_tasks, seed_of, standing_of
from skthermo.monitoring import Monitor


def fit_fleet(
    estimators: Mapping[Hashable, BaseEstimator | Callable[[], BaseEstimator]],
    records: Mapping[Hashable, Any],
    *,
    monitor: Callable[[BaseEstimator], Monitor] | None = None,
    folder: str | os.PathLike[str] | None = None,
    n_jobs: int | None = None,
    random_state: int | np.random.RandomState | None = 0,
    progress: bool | None = None,
) -> Fleet:
    """Fit many bridges, and their monitors, side by side; each fails alone.

    Parameters
    ----------
    estimators : mapping of name to estimator or function
        An unfitted estimator for each bridge, such as a `~skthermo.surrogate.DataInformedFEM`, or a function without
        arguments that makes one; a worker calls it, so that its model never is in this process.
    records : mapping of name to (T, F) or function
        Temperatures in degrees Celsius and frequencies in Hz of the healthy bridge, or a function without arguments
        that loads them in the worker.
    monitor : function, optional
        Takes a fitted estimator and gives an unfitted `~skthermo.monitoring.Monitor`, which is fitted to the same
        records. By default there are no monitors.
    folder : str or path, optional
        Where each bridge is kept as soon as it is fitted, a file for each. The same call goes on where the first was
        stopped, and fits anew what has changed. By default all is kept in memory.
    n_jobs : int, optional
        Number of bridges that are worked on at once; each has one core. By default that of the active
        ``joblib.parallel_config``, else 1.
    random_state : int, RandomState or None, default=0
        With the name of a bridge, the seed of all its parts that have none. With None, each call fits all anew.
    progress : bool, optional
        Whether to show a progress bar on stderr. By default it appears on a terminal after one second.

    Returns
    -------
    Fleet
        Fitted bridges, their monitors, and a row for each bridge that says what became of it.

    Raises
    ------
    ValueError
        If the names of estimators and records differ; if an estimator, records or the monitor cannot be sent to another
        process.
    TimeoutError
        If another process works on the same folder.

    Warns
    -----
    UserWarning
        If bridges could not be fitted: how many and why; one that counts the warnings of all bridges by kind; if a
        monitor that has evaluated records is replaced, because its bridge has changed.

    See Also
    --------
    Fleet : What is known of the bridges afterwards, and new records for their monitors.

    Notes
    -----
    The result is the same, bit for bit, whatever the number of jobs, the back end of joblib (its own processes, Dask,
    Ray) and the other bridges are. Parallel parts within a bridge run one after another.

    If a process is killed, for lack of memory, say, the rest is begun again in new processes; a bridge that kills its
    process repeatedly is given up (:ref:`fleet-cluster`). With one job and no such back end, all runs in this process,
    which nothing protects. The back end "multiprocessing" of joblib hangs when a process is killed.

    Changes are found by content: records, the estimator with its model, versions, and the code of ``monitor``. Code
    that other modules hold is not looked into: use another folder when it has changed. Files are read with ``pickle``,
    which can run any code: use only folders of your own.

    Examples
    --------
    >>> from sklearn.linear_model import LinearRegression
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.fleet import fit_fleet
    >>> years = {name: make_truss_campaign(random_state=seed) for seed, name in enumerate(["north", "south"])}
    >>> records = {name: (year.temperatures, year.frequencies) for name, year in years.items()}
    >>> fleet = fit_fleet(dict.fromkeys(records, LinearRegression()), records)
    >>> fleet
    Fleet(2 bridges, 2 fitted)
    >>> fleet.table["n_records"].to_dict()
    {'north': 365, 'south': 365}
    """
    _check_names(estimators, records)
    check_jobs(n_jobs)
    if monitor is not None and not callable(monitor):
        raise ValueError(
            f"monitor is {type(monitor).__name__!r}; expected a function of a fitted estimator that gives a Monitor"
        )
    base = _base(random_state)
    storage = Storage(None if folder is None else check_path(folder, "folder"))
    with storage.alone():
        storage.read()
        known = {name: storage.outcomes[name] for name in estimators if name in storage.outcomes}
        tasks = {
            name: BridgeFit(name, estimators[name], records[name], monitor, seed_of(base, name), known.get(name))
            for name in estimators
        }
        storage.outcomes = known
        begun_again = _work(tasks, storage, n_jobs, progress)
    storage.outcomes = {name: storage.outcomes[name] for name in estimators}
    fleet = Fleet._of(storage)
    warn_of_bridges(fleet)
    if begun_again:
        warn_user(
            f"{len(begun_again)} of {len(estimators)} bridges were fitted anew, because their records, estimator or "
            f"monitor have changed ({named(begun_again)}). Their monitors restart without earlier records and events, "
            "which files ending in .replaced keep. To continue with monitors as they were, use Fleet(folder)",
            SkthermoWarning,
            "monitors-restarted",
        )
    return fleet


def _work(
    tasks: Mapping[Hashable, BridgeFit], storage: Storage, n_jobs: int | None, progress: bool | None
) -> list[Hashable]:
    """Fit bridges, and keep each as soon as it is fitted; those whose monitor was replaced."""
    n_done, begun_again = 0, []
    try:
        work = run_tasks(tasks, n_jobs)
        for name, result in with_progress(work, len(tasks), progress, count=lambda _: 1, unit="bridges"):
            if not result.is_as_before:
                before = tasks[name].known
                is_watched = before is not None and before.standing["n_evaluated"]
                if is_watched and before.content != result.outcome.content:
                    storage.set_aside(name)
                    begun_again.append(name)
                storage.put(result.outcome, result.fitted)
            elif result.outcome.failures and result.outcome.failures[0].stage not in ("new records", "update"):
                _restore(storage, name)
            n_done += 1
    except KeyboardInterrupt as interrupt:
        left = f"are finished and kept in {storage.folder}; the same call goes on there"
        if storage.folder is None:
            left = "were finished, and are lost; expected folder=... to keep them"
        interrupt.add_note(f"{n_done} of {len(tasks)} bridges {left}")
        raise
    return begun_again


def _restore(storage: Storage, name: Hashable) -> None:
    """Take back what was said of a bridge while its records could not be had."""
    watch = storage.objects(name)[1]
    standing = {} if watch is None else {"standing": standing_of(watch)}
    storage.put(replace(storage.outcomes[name], failures=(), **standing), None)


def _base(random_state: Any) -> int:
    """A number from which all seeds come."""
    if isinstance(random_state, int | np.integer) and not isinstance(random_state, bool):
        if not 0 <= random_state < 2**32:
            raise ValueError(f"random_state is {random_state}; expected a number from 0 to 2**32 - 1")
        return int(random_state)
    source = np.random.RandomState() if random_state is None else random_state
    if not isinstance(source, np.random.RandomState):
        raise ValueError(f"random_state is {random_state!r:.100}; expected an integer, a RandomState or None")
    return int(source.randint(np.iinfo(np.int32).max))


def _check_names(estimators: Any, records: Any) -> None:
    for what, given in (("estimators", estimators), ("records", records)):
        if not isinstance(given, Mapping):
            raise ValueError(f"{what} are {type(given).__name__!r}; expected a mapping of names of bridges")
    missing, unknown = [n for n in estimators if n not in records], [n for n in records if n not in estimators]
    if missing or unknown:
        raise ValueError(
            f"{len(missing)} bridges have no records ({missing!r:.200}) and {len(unknown)} have no estimator "
            f"({unknown!r:.200}); expected the same names in both"
        )
    if not estimators:
        raise ValueError("estimators are empty; expected at least one bridge")
