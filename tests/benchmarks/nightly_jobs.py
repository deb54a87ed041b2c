"""A year of nightly jobs for five bridges, with faults: are the decisions those of one pass over all records?

    python tests/benchmarks/nightly_jobs.py [--nights 365] [--bridges 5]

Each night a file of each bridge's records comes into its folder, and ``skthermo update`` is run on it. In between:
files that come days late, files that are half written or have wrong columns until they are mended, records that come
twice, disks that are full, and jobs that are killed at some write. At the end, evaluations, events, daily summaries,
failed sensors and transitions are compared with those of a monitor that sees all records at once, and the CPU time and
memory of a nightly call in a process of its own are measured.
"""

import contextlib
import io
import json
import multiprocessing
import os
import re
import resource
import shutil
import signal
import subprocess
import sys
import tempfile
from collections import Counter
from pathlib import Path

import numpy as np
import pandas as pd
from harness import arguments, joined

from skthermo.commands.main import main as skthermo
from skthermo.datasets import make_truss_campaign
from skthermo.monitoring import load_monitor

PER_DAY = 4
DAMAGES = (None, {"bottom": 0.2}, None, {"top": 0.3}, None)
LATE, TWICE, HALF, WRONG, KILLED, FULL = (
    "file late",
    "records twice",
    "half written",
    "wrong columns",
    "killed",
    "full disk",
)
SHARES = {LATE: 0.08, TWICE: 0.05, HALF: 0.04, WRONG: 0.03, KILLED: 0.06, FULL: 0.02}


def records_of(seed):
    """Two years of records, of which the first is the baseline; the thermometers of some bridges fail."""
    options = {"samples_per_day": PER_DAY, "samples_per_year": 365 * PER_DAY, "random_state": seed}
    damage = DAMAGES[seed % len(DAMAGES)]
    options |= {"damage": damage, "damage_from": "2026-08-01"} if damage else {}
    campaign = make_truss_campaign(2, **options)
    records = joined(campaign)
    if seed % 2 == 0:
        records.loc["2026-05-01":"2026-05-20", "T2"] = np.nan
    return records


def command(*arguments):
    """Run a command in this process: its exit code and output."""
    with contextlib.redirect_stdout(io.StringIO()) as out, contextlib.redirect_stderr(io.StringIO()) as err:
        code = skthermo([str(one) for one in arguments])
    return code, out.getvalue() + err.getvalue()


def disturbed(kind, write, arguments):
    """Run a command in a process that is killed, or has no space left, at some write."""

    def job():
        calls, fsync = [], os.fsync

        def fails(file):
            calls.append(file)
            if len(calls) > write:
                if kind == KILLED:
                    os.kill(os.getpid(), signal.SIGKILL)
                raise OSError(28, os.strerror(28))
            fsync(file)

        os.fsync = fails
        os._exit(command(*arguments)[0])

    process = multiprocessing.get_context("fork").Process(target=job)
    process.start()
    process.join()


class Feed:
    """Files that come into a bridge's folder, with their faults."""

    def __init__(self, records, folder, random, counts):
        self.records, self.folder, self.random, self.counts = records, folder, random, counts
        self.coming = {}  # files by the night in which they come or are mended

    def night(self, number, day):
        """Put the files of a night into the folder; the fault of its job, if there is one. No day: no new file."""
        for name, text in self.coming.pop(number, []):
            (self.folder / name).write_text(text)
        if day is None:
            return None
        table = self.records[self.records.index.normalize() == day]
        name, text = f"{day:%Y-%m-%d}.csv", table.to_csv()
        faults = [kind for kind, share in SHARES.items() if self.random.random() < share]
        fault = faults[0] if faults else None
        self.counts.update([fault] if fault else [])
        later = number + int(self.random.integers(1, 6))
        if fault == TWICE:
            before = self.records[self.records.index.normalize() == day - pd.Timedelta("1D")]
            text = pd.concat([before, table]).to_csv()
        if fault in (LATE, HALF, WRONG):
            self.coming.setdefault(later, []).append((name, text))
            text = {HALF: text[: len(text) * 2 // 3], WRONG: table.rename(columns={"T1": "T01"}).to_csv()}.get(fault)
        if text is not None:
            (self.folder / name).write_text(text)
        return fault


def differences(left, right):
    """Which results of two monitors differ."""
    found = []
    for name in ("evaluations_", "events_", "days_", "faults_", "records_"):
        try:
            one, other = getattr(left, name), getattr(right, name)
            pd.testing.assert_frame_equal(one, other, check_exact=True, check_freq=False, check_names=False)
        except AssertionError as error:
            found.append(f"{name}: {str(error).splitlines()[0]}")
    return found


def cost(settings, now):
    """CPU seconds and megabytes of a call in a process of its own."""
    code = (
        "import gc, resource, sys\n"
        "from skthermo.__main__ import MANY\n"
        "gc.set_threshold(MANY)\n"
        "def used(): return resource.getrusage(resource.RUSAGE_SELF)\n"
        "from skthermo.commands.main import main\n"
        "imported = used().ru_utime + used().ru_stime\n"
        "main(sys.argv[1:])\n"
        "peak = next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM'))\n"
        "print(imported, used().ru_utime + used().ru_stime, int(peak) / 1024, file=sys.stderr)"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, "update", *map(str, settings), "--now", now],
        capture_output=True,
        text=True,
        check=True,
    )
    return tuple(map(float, done.stderr.splitlines()[-1].split()))


def main():
    options = arguments(__doc__, nights=365, bridges=5)
    random, counts, codes, missed = np.random.default_rng(0), Counter(), Counter(), 0
    with tempfile.TemporaryDirectory() as place:
        os.chdir(place)
        bridges = {}
        for seed in range(options.bridges):
            records, name = records_of(seed), f"bridge{seed}"
            records[:"2025"].to_csv("all.csv")
            for words in (("init", "all.csv", "--into", name), ("fit", f"{name}/monitor.toml")):
                code, text = command(*words)
                assert code == 0, text
            settings = Path(name) / "monitor.toml"
            text = settings.read_text()
            settings.write_text(text.replace('# page = "status.html"', 'page = ""'))
            shutil.copy(f"{name}/monitor.joblib", f"{name}/fitted.joblib")
            bridges[name] = Feed(records["2026":], Path(name) / "new", random, counts)
        days = pd.date_range("2026-01-01", periods=options.nights)
        for number, day in enumerate([*days, *(days[-1] + pd.to_timedelta(range(1, 8), "D"))]):
            for name, feed in bridges.items():
                words = ("update", Path(name) / "monitor.toml", "--now", f"{day:%Y-%m-%d} 23:59")
                fault = feed.night(number, day if number < options.nights else None)
                if fault in (KILLED, FULL):
                    disturbed(fault, int(random.integers(0, 5)), words)
                else:
                    code, _ = command(*words)
                    codes[code] += 1
        print(f"{options.nights} nights of {options.bridges} bridges; faults: {dict(counts)}")
        print(f"exit codes of calls that were not disturbed: {dict(sorted(codes.items()))}")
        for name, feed in bridges.items():
            whole, left = load_monitor(f"{name}/fitted.joblib"), load_monitor(f"{name}/monitor.joblib")
            with contextlib.redirect_stderr(io.StringIO()):
                whole.update(feed.records[: f"{days[-1]:%Y-%m-%d}"])
            found = differences(left, whole)
            file = Path(name, "transitions.jsonl")
            lines = [json.loads(one) for one in file.read_text().splitlines()] if file.exists() else []
            if [one["id"] for one in lines] != [one["id"] for one in left.transitions()]:
                found.append("transitions of the file and of the monitor")
            events = len(left.events_)
            print(f"{name}: {len(left.evaluations_)} records, {events} events; ", end="")
            print("; ".join(found) if found else "all as in one pass")
            missed += len(found) > 0
        last = f"{days[-1] + pd.Timedelta('1D'):%Y-%m-%d}"
        for text, page in (("without a page", '""'), ("with a page", '"status.html"')):
            settings = [Path(name) / "monitor.toml" for name in bridges]
            for one in settings:
                one.write_text(re.sub('page = "[^"]*"', f"page = {page}", one.read_text()))
            for files in (settings[:1], settings):
                for name in files:
                    feed = bridges[name.parent.name]
                    day = feed.records.index[feed.records.index.normalize() > days[-1]][:PER_DAY]
                    feed.records.loc[day].to_csv(feed.folder / f"{text}{len(files)}.csv")
                imported, seconds, megabytes = cost(files, last)
                each = f"{seconds / len(files):.2f} s a bridge" if len(files) > 1 else ""
                print(f"a call {text}, {len(files)} bridges: CPU {seconds:.2f} s (imports {imported:.2f}), {each} "
                      f"{megabytes:.0f} MB")  # fmt: skip
    used = resource.getrusage(resource.RUSAGE_SELF)
    print(f"this benchmark: {used.ru_utime + used.ru_stime:.0f} s of CPU")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
