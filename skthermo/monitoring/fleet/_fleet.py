"""Many bridges: fitted side by side, with their monitors, in memory or in a folder."""

from __future__ import annotations

import os
import pickle
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from datetime import timedelta
from functools import partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from joblib import delayed
from sklearn.base import BaseEstimator

from skthermo._core.arrays import as_random_state, check_jobs, check_path
from skthermo._core.files import ReadWhenAsked, alone_with, write_when_complete
from skthermo._core.parallel import as_they_come, with_progress
from skthermo._core.text import counted
from skthermo._core.warnings import warn_each
from skthermo.exceptions import SkthermoWarning
from skthermo.monitoring._monitor import Monitor
from skthermo.monitoring._status import MonitorStatus
from skthermo.monitoring.fleet._bridge import (
    Fitted,
    KnownBridge,
    by_value,
    file_of,
    fit_bridge,
    given,
    monitor_in,
    part_of,
    read_fitted,
    read_known,
    update_bridge,
)
from skthermo.monitoring.fleet._discoveries import Discoveries, discover, without_zone


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
        If the names of estimators and records differ.
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
    skthermo.surrogate.FleetMapper : Learns from the mappers of a fleet, for a bridge with few records.

    Notes
    -----
    The result is the same, bit for bit, whatever the number of jobs, the back end of joblib (its own processes, Dask,
    Ray) and the other bridges are. Parallel parts within a bridge run one after another.

    If a process is killed, for lack of memory, say, joblib ends the call with an error. With ``folder``, the bridges
    that are finished are kept, and the same call goes on with the others (:ref:`fleet-cluster`).

    Changes are found by content: records, the estimator with its model, versions, and the code of ``monitor``. Code
    that other modules hold is not looked into: use another folder when it has changed. Files are read with ``pickle``,
    which can run any code: use only folders of your own.

    Examples
    --------
    >>> from sklearn.linear_model import LinearRegression
    >>> from skthermo.datasets import make_truss_campaign
    >>> from skthermo.monitoring import fit_fleet
    >>> years = {name: make_truss_campaign(random_state=seed) for seed, name in enumerate(["north", "south"])}
    >>> records = {name: (year.temperatures, year.frequencies) for name, year in years.items()}
    >>> fleet = fit_fleet(dict.fromkeys(records, LinearRegression()), records)
    >>> fleet
    Fleet(2 bridges, 2 fitted)
    >>> fleet.table["n_records"].to_dict()
    {'north': 365, 'south': 365}
    """
    check_jobs(n_jobs)
    for what, given_ in (("estimators", estimators), ("records", records)):
        if not isinstance(given_, Mapping) or not given_:
            raise ValueError(f"{what} are {given_!r:.100}; expected a mapping of at least one name of a bridge")
    if set(estimators) != set(records):
        missing, unknown = [n for n in estimators if n not in records], [n for n in records if n not in estimators]
        raise ValueError(
            f"{len(missing)} bridges have no records ({missing!r:.200}) and {len(unknown)} have no estimator "
            f"({unknown!r:.200}); expected the same names in both"
        )
    if monitor is not None and not callable(monitor):
        raise ValueError(
            f"monitor is {type(monitor).__name__!r}; expected a function of a fitted estimator that gives a Monitor"
        )
    is_seed = isinstance(random_state, int | np.integer)
    base = random_state if is_seed else as_random_state(random_state).randint(np.iinfo(np.int32).max)
    path, restarted = None if folder is None else check_path(folder, "folder"), []
    with only_user(path):
        fleet = Fleet._in(path)
        before = {name: fleet._known.get(name, KnownBridge(name)) for name in estimators}
        fleet._known = {name: one for name, one in fleet._known.items() if name in before}
        jobs = (
            delayed(fit_bridge)(before[name], maker, records[name], monitor, seed_of(base, name), path is not None)
            for name, maker in estimators.items()
        )
        work = as_they_come(jobs, n_jobs=n_jobs, pre_dispatch="n_jobs", max_nbytes=None)
        for known, fitted in with_progress(work, len(before), progress, count=lambda _: 1, unit="bridges"):
            old = before[known.name]
            if old.facts.get("n_evaluated") and fitted is not None:
                file = file_of(path, known.name)
                file.replace(file.with_suffix(".replaced"))
                restarted.append(known.name)
            if known is not old:
                fleet._put(known, fitted)
    fleet._known = {name: fleet._known[name] for name in estimators}
    findings = list(fleet._findings(list(estimators), "fit"))
    if restarted:
        text = (
            f"bridges were fitted anew, because their records, estimator or monitor have changed ({named(restarted)}). "
            "Their monitors restart without earlier records and events, which files ending in .replaced keep. To "
            "continue with monitors as they were, use Fleet(folder)"
        )
        findings.append(SkthermoWarning(text, "monitors-restarted"))
    warn_each(findings)
    return fleet


def seed_of(base: int, name: Hashable) -> int:
    """The seed of a bridge, whatever the others are."""
    return int.from_bytes(sha256(f"{base} {name!r}".encode()).digest()[:4], "big")


class Fleet:
    """Fitted bridges, their monitors, and what became of each.

    Parameters
    ----------
    folder : str or path
        That of an earlier `fit_fleet`.

    Attributes
    ----------
    chains, monitors : mapping of name to estimator and to Monitor
        Those that are fitted, read when asked for.
    table : DataFrame
        A row for each bridge, with the columns below.
    events : DataFrame
        Events of all monitors: ``bridge``, ``event`` (its number) and the columns of a monitor's ``events_``.
    warnings : DataFrame
        The package's warnings of the fits and of the last update: ``bridge``, ``stage`` ("fit" or "update"), ``kind``,
        ``message`` and ``times``, how often it came.
    errors : DataFrame
        What failed: ``bridge``, ``stage`` ("records", "maker", "fit", "monitor", or "new records" and "update" of the
        last update), ``error`` (type and text) and ``where``, the line of code.

    Raises
    ------
    ValueError
        If there is no such folder, or it holds no bridge.

    See Also
    --------
    fit_fleet : Fits the bridges.
    skthermo.surrogate.FleetMapper : Learns from the mappers of a fleet, for a bridge with few records.

    Notes
    -----
    Columns of ``table``: ``is_fitted``; ``error``, "" where there is none; ``n_records`` of the fit;
    ``gaps``, the share of their values that are missing; ``mape``, mean absolute error of the training frequencies in
    percent, in-sample; ``n_warnings``, and a column ``warnings KIND`` for each kind; ``state`` of the monitor
    ("healthy", "watch", "alarm", "not evaluated", "" without one); ``last`` record since the fit; ``days_silent``, days
    from it to the newest record of all bridges; ``n_evaluated`` records, and the share ``not_evaluated``;
    ``alarm_rate``, the share of evaluated records in an event; ``n_events`` of damage, and those that are open,
    ``n_open``; ``drift``, the largest change of stiffness beyond its error, of ``drift_group``; ``seconds`` of the fit;
    ``megabytes`` of its file, NaN in memory.

    A bridge whose new records could not be evaluated is "not evaluated", or "alarm" while an event is open.

    Examples
    --------
    >>> from skthermo.monitoring import Fleet
    >>> Fleet("no such folder")
    Traceback (most recent call last):
    ...
    ValueError: there is no folder 'no such folder'; expected that of a fit_fleet
    """

    def __init__(self, folder: str | os.PathLike[str]):
        path = check_path(folder, "folder")
        if not path.is_dir():
            raise ValueError(f"there is no folder {str(path)!r}; expected that of a fit_fleet")
        self._folder: Path | None = path
        self._known: dict[Hashable, KnownBridge] = {}
        self._fitted: dict[Hashable, Callable[[], Fitted]] = {}
        self._read()
        if not self._known:
            raise ValueError(f"the folder {str(path)!r} holds no bridge; expected that of a fit_fleet")

    @classmethod
    def _in(cls, folder: Path | None) -> Fleet:
        """A fleet in memory, or in a folder that may be empty."""
        fleet = cls.__new__(cls)
        fleet._folder, fleet._known, fleet._fitted = folder, {}, {}
        fleet._read()
        return fleet

    def _read(self) -> None:
        """Read what the folder holds."""
        for file in sorted(self._folder.glob("*.bridge")) if self._folder else ():
            known = read_known(file)
            self._known[known.name], self._fitted[known.name] = known, partial(read_fitted, file)

    def _put(self, known: KnownBridge, fitted: Fitted | None) -> None:
        """Keep what is known of a bridge; without fitted objects, they stay what they are."""
        name = known.name
        self._known[name] = known
        if self._folder is None:
            if fitted is not None:
                self._fitted[name] = partial(given, fitted)
            return
        if fitted is None and known.is_fitted:
            fitted = self._fitted[name]()
        file = file_of(self._folder, name)
        write_when_complete(file, pickle.dumps(known) + by_value(fitted))
        self._fitted[name] = partial(read_fitted, file)

    @classmethod
    def of_monitors(
        cls, monitors: Mapping[Hashable, Monitor], errors: Mapping[Hashable, Exception] | None = None
    ) -> Fleet:
        """A fleet, in memory, of monitors that were fitted one by one.

        Parameters
        ----------
        monitors : mapping of name to Monitor
            Fitted monitors. The mapping is asked for one each time that it is needed, so that it may read it from its
            file.
        errors : mapping of name to exception, optional
            Bridges whose newest records, or whose monitor, could not be used, and why.

        Returns
        -------
        Fleet
            Its ``chains`` are None.

        Raises
        ------
        ValueError
            If there is no bridge.
        NotFittedError
            If a monitor is not fitted.
        """
        fleet = cls._in(None)
        for name in monitors:
            facts = {"n_records": len(monitors[name].baseline_)}
            known = KnownBridge(name, is_fitted=True, facts=facts).after(monitors[name])
            fleet._known[name], fleet._fitted[name] = known, partial(monitor_in, monitors, name)
        for name, error in (errors or {}).items():
            fleet._known[name] = fleet._known.get(name, KnownBridge(name)).failed("update", error)
        if not fleet._known:
            raise ValueError("there are no monitors; expected at least one")
        return fleet

    def __len__(self) -> int:
        return len(self._known)

    def __repr__(self) -> str:
        states = Counter(one.state for one in self._known.values())
        watched = [f"{counted(len(self.monitors), 'monitor')}"] if len(self.monitors) else []
        words = {"alarm": "in alarm", "watch": "to be watched", "not evaluated": "not evaluated"}
        watched += [f"{states[state]} {text}" for state, text in words.items() if states[state]]
        parts = [counted(len(self), "bridge"), f"{len(self.chains)} fitted", *watched]
        return f"Fleet({', '.join(parts)})".replace("\N{NO-BREAK SPACE}", " ")

    @property
    def chains(self) -> Mapping[Hashable, BaseEstimator]:
        """Fitted estimators by name, read when asked for."""
        return self._objects(0, [name for name, one in self._known.items() if one.is_fitted])

    @property
    def monitors(self) -> Mapping[Hashable, Monitor]:
        """Monitors by name, read when asked for."""
        return self._objects(1, [name for name, one in self._known.items() if one.is_watched])

    def _objects(self, part: int, names: Iterable[Hashable]) -> Mapping[Hashable, Any]:
        return ReadWhenAsked({name: partial(part_of, self._fitted[name], part) for name in names})

    @property
    def table(self) -> pd.DataFrame:
        """A row for each bridge."""
        rows = [self._row(one) for one in self._known.values()]
        names = pd.Index(list(self._known), name="bridge", tupleize_cols=False)
        table = pd.DataFrame(rows, index=names)
        last = pd.Series([without_zone(stamp) for stamp in table["last"]], index=names, dtype="datetime64[ns]")
        table.insert(table.columns.get_loc("last") + 1, "days_silent", (last.max() - last) / pd.Timedelta("1D"))
        counts = self.warnings.groupby(["bridge", "kind"], sort=False)["times"].sum().unstack(fill_value=0)
        place = table.columns.get_loc("n_warnings") + 1
        for kind in sorted(counts.columns, reverse=True):
            table.insert(place, f"warnings {kind}", counts[kind].reindex(names, fill_value=0))
        return table

    def _row(self, known: KnownBridge) -> dict[str, Any]:
        file = None if self._folder is None else file_of(self._folder, known.name)
        row = {"is_fitted": known.is_fitted, "error": known.error, "n_records": 0, "gaps": np.nan, "mape": np.nan}
        row |= {"n_warnings": sum(times for *_, times in known.warnings), "state": known.state, "last": pd.NaT}
        row |= {"n_evaluated": 0, "not_evaluated": np.nan, "alarm_rate": np.nan, "n_events": 0, "n_open": 0}
        row |= {"drift": np.nan, "drift_group": "", "seconds": np.nan}
        size = file.stat().st_size / 1e6 if file is not None and file.exists() else np.nan
        return row | known.facts | {"megabytes": size}

    @property
    def events(self) -> pd.DataFrame:
        """Events of all monitors."""
        known = [one for one in self._known.values() if one.events is not None]
        tables = []
        for one in [one for one in known if len(one.events)] or known[:1]:
            table = one.events.reset_index()
            table.insert(0, "bridge", pd.Series([one.name] * len(table), dtype=object))
            tables.append(table)
        return pd.concat(tables, ignore_index=True) if tables else pd.DataFrame(columns=["bridge", "event"])

    @property
    def warnings(self) -> pd.DataFrame:
        """Warnings of the fits and of the last update."""
        rows = [(name, *one) for name, known in self._known.items() for one in known.warnings]
        return pd.DataFrame(rows, columns=["bridge", "stage", "kind", "message", "times"])

    @property
    def errors(self) -> pd.DataFrame:
        """What failed."""
        rows = [(name, *one) for name, known in self._known.items() for one in known.errors]
        return pd.DataFrame(rows, columns=["bridge", "stage", "error", "where"])

    def update(
        self, records: Mapping[Hashable, Any], n_jobs: int | None = None, *, progress: bool | None = None
    ) -> pd.DataFrame:
        """Evaluate records that came since, each bridge by its own monitor; each fails alone.

        Parameters
        ----------
        records : mapping of name to DataFrame, (T, F) or function
            New records of some bridges: a frame in the columns of the monitor's baseline, temperatures and frequencies
            as two frames, or a function without arguments that loads one of these in the worker.
        n_jobs : int, optional
            Number of bridges that are worked on at once.
        progress : bool, optional
            Whether to show a progress bar on stderr. By default it appears on a terminal after one second.

        Returns
        -------
        DataFrame
            A row for each record that was evaluated: ``bridge``, ``time`` and the columns of
            `~skthermo.monitoring.Monitor.update`. A bridge whose records could not be evaluated has one row without a
            time: "not evaluated", and the error as the reason.

        Raises
        ------
        ValueError
            If there is no bridge of a name.
        TimeoutError
            If another process works on the same folder.

        Warns
        -----
        UserWarning
            If bridges could not be updated: how many and why; and one that counts the warnings of all bridges by kind.

        Notes
        -----
        Monitors that were fitted in a folder are kept there as soon as they have evaluated their records. Records that
        come again are known: an update that was stopped, or whose process was killed, is simply called again.
        """
        check_jobs(n_jobs)
        if not isinstance(records, Mapping):
            raise ValueError(f"records are {records!r:.100}; expected a mapping of the names of bridges to new records")
        unknown = [name for name in records if name not in self._known]
        if unknown:
            raise ValueError(
                f"{len(unknown)} names of records are those of no bridge ({unknown!r:.200}); expected some of the "
                f"{len(self)} bridges"
            )
        answers: dict[Hashable, pd.DataFrame] = {}
        with only_user(self._folder):
            self._read()  # another process may have updated the folder since
            jobs = (
                delayed(update_bridge)(self._known[name], self._fitted.get(name, partial(given, (None, None))), new)
                for name, new in records.items()
            )
            work = as_they_come(jobs, n_jobs=n_jobs, pre_dispatch="n_jobs", max_nbytes=None)
            for known, fitted, one in with_progress(work, len(records), progress, count=lambda _: 1, unit="bridges"):
                self._put(known, fitted)
                answers[known.name] = one
        warn_each(self._findings(list(records), "update"))
        tables = [answers[name] for name in records if len(answers[name])]
        columns = ["bridge", "time", "state", "index", "threshold", "modes", "groups", "reason", "event", "revised"]
        return (pd.concat(tables, ignore_index=True) if tables else pd.DataFrame()).reindex(columns=columns)

    def acknowledge(self, bridge: Hashable, event: int, *, harmless: bool, note: str = "") -> None:
        """Record what the owner has found out about an event, and keep it.

        Parameters
        ----------
        bridge : str
            Name of the bridge.
        event : int
            Number of the event, as in ``events``.
        harmless : bool
            Whether the bridge is as before. Harmless events are not among `discoveries`.
        note : str, default=""
            What was found.

        Raises
        ------
        ValueError
            If there is no monitor of that name, or no such event.
        TimeoutError
            If another process works on the same folder.
        """
        if not isinstance(bridge, Hashable) or bridge not in self.monitors:
            raise ValueError(
                f"{bridge!r:.100} is no bridge with a monitor; expected one of {list(self.monitors)!r:.200}"
            )
        with only_user(self._folder):
            self._read()
            chain, monitor = self._fitted[bridge]()
            monitor.acknowledge(event, harmless=harmless, note=note)
            self._put(self._known[bridge].after(monitor), (chain, monitor))

    def status(self, now: Any = None, *, max_age: str | timedelta | None = None) -> dict[Hashable, MonitorStatus]:
        """The state of each bridge at a time, and the facts behind it, for machines.

        Parameters
        ----------
        now : str or datetime, optional
            The time. By default that of the computer's clock; if records have no time zone, the local time.
        max_age : str or timedelta, optional
            Age of a newest record beyond which nothing is healthy. By default the usual time between the records of
            the bridge, and two days more.

        Returns
        -------
        dict of name to MonitorStatus
            As `~skthermo.monitoring.Monitor.status` gives it. A bridge without a monitor, or whose newest records could
            not be used, is "not evaluated", with the reason.

        Raises
        ------
        ValueError
            If ``now`` is no time, or has a time zone where records have none; if ``max_age`` is no duration.
        """
        return {name: one.status_at(now, max_age) for name, one in self._known.items()}

    def discoveries(self, fdr: float = 0.1, *, days: float = 365.25) -> Discoveries:
        """Which open events are significant after correction for many bridges.

        Parameters
        ----------
        fdr : float, default=0.1
            False discovery rate: share of healthy ones among the significant bridges, on average.
        days : float, default=365.25
            Events that are open, or ended within so many days before the newest record of all bridges, are compared.

        Returns
        -------
        Discoveries
            Events with their p values, and which bridges are significant.

        Raises
        ------
        ValueError
            If no bridge has a monitor, or ``fdr`` is not between 0 and 1.
        """
        if not len(self.monitors):
            raise ValueError("no bridge has a monitor; expected fit_fleet(..., monitor=function of a chain)")
        blind = {name for name, one in self._known.items() if one.state == "not evaluated"}
        newest = [without_zone(one.facts["last"]) for one in self._known.values() if not pd.isna(one.facts.get("last"))]
        return discover(self.monitors, blind, max(newest, default=pd.NaT), fdr, days)

    def summary(self) -> str:
        """How many bridges were fitted, failed, and are in which state, in a few lines.

        Returns
        -------
        str
            Plain sentences.
        """
        return "\n".join(self._sentences())

    def _sentences(self) -> Iterator[str]:
        table = self.table
        fitted, broken = table[table["is_fitted"]], table.index[~table["is_fitted"]]
        yield f"{len(fitted)} of {len(table)} bridges are fitted."
        if len(broken):
            yield f"Not fitted: {named(broken)}."
        watched = fitted[fitted["state"] != ""]
        if len(watched) < len(fitted):
            yield f"{len(fitted) - len(watched)} fitted bridges have no monitor; their state is not known."
        begun = watched[watched["last"].notna()]
        if len(begun) < len(watched):
            yield (
                f"{len(watched) - len(begun)} of {len(watched)} monitors have had no record since they were fitted; "
                "the state of their bridges is not known."
            )
        if len(watched):
            states = {"alarm": "in alarm", "healthy": "healthy", "not evaluated": "not evaluated"}
            counts = ", ".join(f"{(begun['state'] == state).sum()} {words}" for state, words in states.items())
            yield f"Newest records of {len(begun)} monitors: {counts}."
        said = {"alarm": "In alarm", "watch": "Raised damage index without an alarm (watch)"}
        for state, words in (said | {"not evaluated": "Not evaluated, state not known"}).items():
            if (begun["state"] == state).any():
                yield f"{words}: {named(begun.index[begun['state'] == state])}."
        silent = begun.index[(begun["state"] != "not evaluated") & (begun["days_silent"] > 7)]
        if len(silent):
            yield f"Without a record for more than 7 days before the newest of all: {named(silent)}."
        failed = fitted.index[fitted["error"] != ""]
        if len(failed):
            yield f"Fitted, but with an error since: {named(failed)}."
        if len(self.warnings):
            yield f"Warnings: {kinds(self.warnings)}."

    def _findings(self, asked: list[Hashable], stage: str) -> Iterator[SkthermoWarning]:
        """One finding of all bridges that failed, and one of all of their warnings."""
        failed = [name for name in asked if self._known[name].errors]
        if failed:
            yield SkthermoWarning(
                f"bridges have failed ({named(failed)}), the first with {self._known[failed[0]].error:.300}. Nothing "
                "is known of their state. See fleet.errors",
                "bridges-failed",
            )
        warned = self.warnings
        warned = warned[warned["bridge"].isin(asked) & (warned["stage"] == stage)]
        if len(warned):
            yield SkthermoWarning(f"bridges gave warnings: {kinds(warned)}. See fleet.warnings", "bridges-warned")


@contextmanager
def only_user(folder: Path | None) -> Iterator[None]:
    """Be the only process that works on a folder."""
    if folder is None:
        yield
        return
    folder.mkdir(parents=True, exist_ok=True)
    with alone_with(folder / "fleet", 60.0):
        for left in folder.glob(".*.bridge.*"):
            left.unlink(missing_ok=True)
        yield


def named(names: Iterable[Any]) -> str:
    """The first names, and how many there are besides."""
    first, rest = list(map(str, names))[:5], len(list(names)) - 5
    return ", ".join(first) + (f" and {rest} more" if rest > 0 else "")


def kinds(warned: pd.DataFrame) -> str:
    """Kinds of warnings by how many bridges gave them."""
    numbers = warned.groupby("kind")["bridge"].nunique().sort_values(ascending=False, kind="stable")
    shown = [f"{kind} ({counted(number, 'bridge')})" for kind, number in numbers.items()]
    return named(shown).replace("\N{NO-BREAK SPACE}", " ")
