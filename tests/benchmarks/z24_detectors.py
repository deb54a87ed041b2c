"""Does simulation rank detectors as real damage does? Detectors on the bridge Z24, simulated and measured.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/z24_detectors.py

Detectors learn the first four fifths of the healthy records. Rates of alarms on the last fifth, and on the records
after damage began, are compared with those that the FE model simulates in the same weather: in hindsight by a chain of
all healthy records, with the damage that was identified, drawn with its uncertainty; in foresight by a chain of the
detectors' own baseline, with an assumed damage of the soil of 18 %. Bands of 95 % include noise and, in hindsight,
uncertain severities. Then simulation chooses a detector from the baseline alone, by damage of every group, and the
choice is checked against the measured records. The exit code is 1 if a target is missed.
"""

import sys
import tempfile
from pathlib import Path

import pandas as pd
from harness import arguments, is_missed, recipes, shown

damage, comparison, z24 = map(recipes, ("z24_damage", "z24_detector", "z24"))

FALSE, FOUND = "false alarms", "damage found"
HINDSIGHT, FORESIGHT, NEARER = "hindsight", "foresight", "assumed damage, chain of all healthy records"
KNOWN = (HINDSIGHT, FORESIGHT)
TARGETS = [  # of rank correlations and shares in the band
    (HINDSIGHT, FOUND, ">= 0.95", ">= 0.8"),
    (HINDSIGHT, FALSE, ">= 0.9", ">= 0.7"),
    (FORESIGHT, FOUND, ">= 0.9", None),
    (FORESIGHT, FALSE, ">= 0.85", None),
]
LIMIT = 0.02
COMPETITOR, REGIMES = "raw, 20 neighbours", ("piecewise-linear, regimes", "boosted trees, regimes")


def beside_each_other(tables):
    """Measured and simulated rates of every detector, in percent."""
    columns = {(state, "measured"): tables[HINDSIGHT][state, "measured"] for state in (FALSE, FOUND)}
    columns |= {(state, kind): tables[kind][state, "simulated"] for state in (FALSE, FOUND) for kind in KNOWN}
    table = pd.DataFrame(columns)[[(state, name) for state in (FALSE, FOUND) for name in ("measured", *KNOWN)]]
    return table.set_axis([name if name in KNOWN else f"{state}, {name}" for state, name in table], axis=1)


def agreements(tables):
    """Rank correlations of simulated and measured rates, and measured rates in the simulated band."""
    rows = {}
    for kind, table in tables.items():
        both = comparison.agreement(table)
        rows[kind] = {f"rank correlation, {state}": both.loc[state, "rank correlation"] for state in (FOUND, FALSE)}
        for state in (FOUND, FALSE):
            rows[kind][f"in band, {state}"] = round(both.loc[state, "in the band"] * len(table))
        rows[kind]["detectors"] = len(table)
    return pd.DataFrame(rows).T.astype(dict.fromkeys(list(rows[HINDSIGHT])[2:], int))


def choices(study, learned, measured):
    """Detectors that simulation or hindsight would have chosen, with what they find, in percent."""
    ahead, in_learned = (one.ranking(max_false_alarms=LIMIT) for one in (study, learned))
    allowed = measured[measured[FALSE] <= 100 * LIMIT]
    names = {
        "chosen by simulation": ahead.index[0],
        "chosen at equal false alarms": study.ranking(max_false_alarms=LIMIT, by="pod_at_equal_pfa").index[0],
        "chosen in weather that detectors have learned": in_learned.index[0],
        "best of those with at most 2 % measured false alarms": allowed[FOUND].idxmax(),
        "without simulation": COMPETITOR,
    }
    rows = {why: {"detector": name, **measured.loc[name]} for why, name in names.items()}
    first = 100 * ahead.loc[ahead["within_limit"].astype(bool), ["false_alarms", "pod", "pod_at_equal_pfa"]][:8]
    first = first.astype(float).set_axis([f"{FALSE}, simulated", f"{FOUND}, simulated", "at 2 % false alarms"], axis=1)
    first = first.join(measured.set_axis([f"{FALSE}, measured", f"{FOUND}, measured"], axis=1))
    return pd.DataFrame(rows).T.astype({FALSE: float, FOUND: float}), first


def main():
    options = arguments(__doc__, folder=Path, repeats=(40, "simulated campaigns"))
    bridge = z24.Bridge(z24.find(options.folder))
    with tempfile.TemporaryDirectory() as memory:
        candidates, kept = comparison.detectors(), {"n_repeats": options.repeats, "memory": memory}
        fem, found = damage.identify(bridge)
        assumed = comparison.Scenario(comparison.DAMAGED, comparison.ASSUMED)
        results = {
            HINDSIGHT: comparison.compare(bridge, fem, found.scenario(comparison.DAMAGED), candidates, **kept),
            FORESIGHT: comparison.compare_before_damage(bridge, candidates=candidates, **kept),
            NEARER: comparison.compare(bridge, fem, assumed, candidates, **kept),
        }
        ways = (True, False)
        study, learned = (comparison.choose(bridge, candidates, ahead=ahead, memory=memory) for ahead in ways)
    tables = {kind: comparison.side_by_side(one) for kind, one in results.items()}
    rows, campaigns = agreements(tables), f"{options.repeats} simulated campaigns"
    shown(f"Z24, {campaigns}: how well simulated and measured rates of alarms agree", rows, 3)
    shown(f"Z24: percent of records in alarm, measured and mean of {campaigns}", beside_each_other(tables), 1)
    measured = tables[HINDSIGHT].xs("measured", axis=1, level=1)
    chosen, first = choices(study, learned, measured)
    shown("Z24: detectors chosen, and measured percent of records in alarm", chosen, 1)
    shown("Z24: the first eight by simulation, of those with at most 2 % false alarms; percent of records", first, 1)

    missed = 0
    for kind, state, correlation, share in TARGETS:
        row = rows.loc[kind]
        missed += is_missed(f"{kind}, {state}, rank correlation", row[f"rank correlation, {state}"], correlation)
        if share is not None:
            missed += is_missed(f"{kind}, {state}, in the band", row[f"in band, {state}"] / row["detectors"], share)
    by_simulation = chosen.loc["chosen by simulation"]
    missed += is_missed("found by the detector chosen, %", by_simulation[FOUND], ">= 90")
    missed += is_missed("its false alarms, %", by_simulation[FALSE], "<= 3")
    missed += is_missed("false alarms, regimes, %, larger of two", measured.loc[[*REGIMES], FALSE].max(), "<= 3")
    missed += is_missed("found, regimes, %, smaller of two", measured.loc[[*REGIMES], FOUND].min(), ">= 80")
    days = z24.found_by_day(z24.Records.of(bridge), z24.compensated()).loc["found"]
    missed += is_missed("found from the third day, %, smallest", days.iloc[2:].min(), ">= 100")
    unexplained = 100 * (found.shifts["measured"] - found.shifts["explained"]).abs().max()
    missed += is_missed("unexplained shift of a mode, %, largest", unexplained, "<= 1")
    missed += is_missed("probability of damaged soil, %", 100 * found.table.loc["soil", "probability"], ">= 80")
    return int(missed > 0)


if __name__ == "__main__":
    sys.exit(main())
