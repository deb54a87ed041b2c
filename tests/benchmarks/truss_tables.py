"""Tables 2 and 3 of the paper over many seeds, beside their targets.

    python tests/benchmarks/truss_tables.py

The study itself is examples/plot_truss_study.py, without its figures.
"""

import argparse
import importlib.util
from pathlib import Path

import pandas as pd

EXAMPLE = Path(__file__).parents[2] / "examples" / "plot_truss_study.py"
SEEDS_40 = pd.DataFrame(
    {
        "mean": [2.7, 23.9, 93.6, 100, 10.6, 57.2, 97.5, 65.5, 100],
        "std": [1.3, 6.7, 2.9, 0, 3.5, 7.3, 1.4, 6.7, 0],
    },
    index=["SH-0", "SB-10", "SB-20", "SB-30", "ST-10", "ST-20", "ST-30", "SD-10", "SD-20"],
)  # thermo-mechanical reference rates over 40 seeds, in percent


def load_study():
    spec = importlib.util.spec_from_file_location("plot_truss_study", EXAMPLE)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def summary(study, mapes, rates):
    """What is measured, by target."""
    reference = rates["thermo"].groupby("scenario").mean().loc[SEEDS_40.index]
    distance = (reference - SEEDS_40["mean"]).abs() / SEEDS_40["std"].where(SEEDS_40["std"] > 0, 1.0)
    gaps = rates["informed"] - rates["thermo"]
    return {
        "Table 2, mean MAPE (%), at most 1.25": study.table_2(mapes).loc["Average", "average"],
        "Table 3, mean absolute difference (points), at most 1.8": gaps.abs().mean(),
        "Table 3, mean PFA difference (points), at most 5": gaps.xs(study.HEALTHY, level="scenario").abs().mean(),
        "thermo-mechanical rates, largest distance (standard deviations), at most 2": distance.max(),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--noise", type=float, default=0.0, help="noise while the inverse surrogate learns")
    parser.add_argument("--bounds", type=float, default=0.2, help="half-width of the sampled box")
    options = parser.parse_args()
    study = load_study()
    mapes, rates = study.run(range(options.seeds), noise=options.noise, bounds=options.bounds)
    with pd.option_context("display.width", 200):
        print(study.table_2(mapes), end="\n\n")
        print(study.table_3(rates).to_string(na_rep=""), end="\n\n")
    for name, value in summary(study, mapes, rates).items():
        print(f"{name}: {value:.3f}")


if __name__ == "__main__":
    main()
