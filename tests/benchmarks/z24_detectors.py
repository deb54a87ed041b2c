"""Does simulation rank detectors as real damage does? The field's detectors on the Z24 bridge, simulated and measured.

    OMP_NUM_THREADS=1 python tests/benchmarks/z24_detectors.py [DATA]

DATA is the file or folder of Z24, by default the folder that SKTHERMO_DATA names. Detectors learn the first four fifths
of the healthy records. Rates of alarms on the last fifth and on the records after damage began stand beside those that
the FE model simulates in the same weather: (a) by a chain of all healthy records, with the damage that was identified,
drawn with its uncertainty; (b) by a chain of the detectors' own baseline, with an assumed damage of the soil of 18 %.
The band covers 95 % of simulated campaigns: it includes noise and, in (a), uncertain severities; another baseline or an
error of the model is not. Then simulation chooses a detector from the baseline alone, by damage of every group, and the
choice is checked against the measured records. The exit code is 1 if a target is missed, as two are: the chain of (b)
has to go on into weather that is warmer than all that it learned, and the choice is between detectors that are nearly
equal.
"""

import sys
import tempfile
import time
from pathlib import Path

from harness import arguments, recipes

z24_damage, comparison, z24 = map(recipes, ("z24_damage", "z24_detector", "z24"))

TARGETS = {  # rank correlation, share in the band
    ("a", "damage found"): (0.95, 0.8),
    ("a", "false alarms"): (0.9, 0.7),
    ("b", "damage found"): (0.9, None),
    ("b", "false alarms"): (0.85, None),
}
LIMIT, LEAST_FOUND, MOST_FALSE = 0.02, 90.0, 3.0
SHOWN = [
    "false_alarms",
    "within_limit",
    "pod",
    "pod_at_equal_pfa",
    "pod_deficit",
    "pod_deficit_ci_low",
    "pod_deficit_ci_high",
    "significantly_worse",
]


def print_agreement(name, results):
    """Rates of all detectors, and how well they agree; the number of missed targets."""
    table = comparison.side_by_side(results)
    print(table.round(1).to_string(), end="\n\n")
    missed = 0
    for state, row in comparison.agreement(table).iterrows():
        for what, value, target in zip(("rank correlation", "in the band"), row, TARGETS[name, state], strict=False):
            verdict = "" if target is None else f", target {target}: {'met' if value >= target else 'MISSED'}"
            missed += target is not None and value < target
            print(f"({name}) {state}, {what} ({row['detectors']:.0f} detectors): {value:.3f}{verdict}")
    for failed in results.loc[results["error"] != "", ["detector", "error"]].drop_duplicates().to_numpy():
        print("failed:", *failed)
    print(flush=True)
    return missed, table


def print_choice(study, measured):
    """The ranking, what those that are not significantly worse find on measured records, and whether the first does."""
    ranking = study.ranking(max_false_alarms=LIMIT)
    equal = study.ranking(max_false_alarms=LIMIT, by="pod_at_equal_pfa").index[0]
    print((ranking[SHOWN].astype(float)).round(3).to_string(), end="\n\n")
    first = ranking.index[0]
    tied = ranking.index[ranking["within_limit"].eq(True) & ~ranking["significantly_worse"].eq(True)]
    false, found = (measured[state, "measured"] for state in ("false alarms", "damage found"))
    met = found[first] >= LEAST_FOUND and false[first] <= MOST_FALSE
    print(f"chosen: {first}; measured: {false[first]:.1f} % false alarms, {found[first]:.1f} % found; target at most")
    print(f"{MOST_FALSE:g} and at least {LEAST_FOUND:g} %: {'met' if met else 'MISSED'}")
    others = [f"{name} {false[name]:.1f} / {found[name]:.1f}" for name in tied if name != first]
    print(f"not significantly worse, measured false alarms / found, %: {', '.join(others) or 'none'}")
    print(f"first at equal false alarms: {equal} {false[equal]:.1f} / {found[equal]:.1f}\n", flush=True)
    return not met


def main():
    options = arguments(__doc__, folder=Path, repeats=(40, "simulated campaigns"))
    bridge, began = z24.Bridge(z24.find(options.folder)), time.perf_counter()
    with tempfile.TemporaryDirectory() as memory:
        candidates, kept = comparison.detectors(), {"n_repeats": options.repeats, "memory": memory}
        print("(a) chain of all healthy records, identified damage\n")
        fem, found = z24_damage.identify(bridge)
        results = comparison.compare(bridge, fem, found.scenario(comparison.DAMAGED), candidates, **kept)
        missed, measured = print_agreement("a", results)
        print("(b) chain of the first four fifths, soil -18 %\n")
        results = comparison.compare_before_damage(bridge, candidates=candidates, **kept)
        missed += print_agreement("b", results)[0]
        print("The assumed damage by the chain of all healthy records, which knows the warm weather\n")
        scenario = comparison.Scenario(comparison.DAMAGED, comparison.ASSUMED)
        results = comparison.compare(bridge, fem, scenario, candidates, **kept)
        print(comparison.agreement(comparison.side_by_side(results)).round(3).to_string(), end="\n\n", flush=True)
        print("Choice, in the last quarter of the baseline's weather, of detectors that have learned the others\n")
        missed += print_choice(comparison.choose(bridge, candidates), measured)
        print("For comparison: the weather that the detectors have learned\n")
        print_choice(comparison.choose(bridge, candidates, ahead=False), measured)
    print(f"{missed} targets missed; {time.perf_counter() - began:.0f} s")
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
