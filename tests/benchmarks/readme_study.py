"""The study of README beside the truth: what its detectors find in simulated records, and in true ones.

    OMP_NUM_THREADS=1 python tests/benchmarks/readme_study.py

Runs README's lines. Then the same detectors learn the same year, and true later years are evaluated, healthy and with
each of the damages of the study.
"""

import contextlib
import io
import re
from pathlib import Path

import pandas as pd
from harness import arguments, joined, shown

from skthermo.datasets import make_truss_campaign

README = Path(__file__).parents[2] / "README.md"


def main():
    options = arguments(__doc__, years=(5, "later ones of each state"))
    names = {}
    with contextlib.redirect_stdout(io.StringIO()):
        exec(re.search(r"```python\n(.*?)```", README.read_text(), re.DOTALL).group(1), names)
    study, found = names["study"], []
    simulated = study.ranking()[["false_alarms", "pod"]]
    for seed in range(1, options.years + 1):
        damages = {scenario.name: scenario.damage or None for scenario in study.scenarios_}
        true = {name: make_truss_campaign(damage=one, random_state=seed) for name, one in damages.items()}
        records = {name: joined(campaign) for name, campaign in true.items()}
        results = study.run(next(iter(true.values())).temperatures, reference=records)
        found.append(results[results["source"] == "reference"])
    rates = pd.concat(found).groupby(["detector", "measure"])["rate"].mean().unstack()[["PFA", "POD"]]
    columns = ["false alarms, simulated", "found, simulated", "false alarms, true", "found, true"]
    table = (100 * simulated.join(rates)).set_axis(columns, axis=1)
    shown(f"Study of README: percent of records in alarm, true ones of {options.years} years", table, 1)


if __name__ == "__main__":
    main()
