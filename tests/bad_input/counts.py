"""How bad values of arguments are answered, by callable, and those that are not refused or warned of.

    python -m tests.bad_input.counts [ROOM ...] [--every 1]

ROOM, such as ``detection`` or ``monitoring.Monitor``, is what the names of the callables begin with; by default all are
tried, which takes minutes. "legal" are values of which the answer is that of good ones: columns are read by name, or
rows without their times.
"""

import argparse

import pandas as pd

from tests.bad_input.test_bad_input import KINDS, Tried, tried


def table_of(results):
    """Counts by callable and kind of answer."""
    frame = pd.DataFrame(results, columns=Tried._fields)
    counts = pd.crosstab(frame["callable"], frame["kind"]).reindex(columns=KINDS, fill_value=0)
    counts.insert(0, "tried", counts.sum(axis=1))
    counts.loc["all"] = counts.sum()
    return counts


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("rooms", nargs="*", help="beginnings of the names of callables")
    parser.add_argument("--every", type=int, default=1, help="try every so many bad values")
    options = parser.parse_args()
    results = list(tried(options.every, tuple(options.rooms)))
    print(table_of(results).to_string())
    for kind in ("silent", "unclear"):
        of_kind = [one for one in results if one.kind == kind]
        print(f"\n{kind}: {len(of_kind)} of {len(results)}, {len(of_kind) / max(len(results), 1):.2%}")
        for one in of_kind:
            print(f"  {one.callable}({one.argument}: {one.cause}) {one.said:.300}")


if __name__ == "__main__":
    main()
