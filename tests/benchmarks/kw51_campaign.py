"""The synthetic campaigns of KW51 beside what is known of the real one.

python tests/benchmarks/kw51_campaign.py --seeds 10
"""

import time

import numpy as np
import pandas as pd
from harness import arguments

from skthermo.datasets import make_kw51_campaign

MODES = ["f2", "f3", "f4", "f5", "f6"]
CORRELATION = pd.Series([-0.428, -0.553, -0.310, -0.644], MODES[:4])
COVERAGE = pd.Series([0.344, 0.950, 0.503, 0.879, 0.965], MODES)
SHIFT = pd.Series([-1.13, -0.58, -1.18, -0.34, 2.07], MODES)
OTHERS = {
    "temperature present": 0.880,
    "temperature missing, first 4000 hours": 0.31,
    "all six modes present": 0.13,
    "lowest temperature (C)": -3.0,
    "highest temperature (C)": 37.9,
}


def statistics(campaign, healthy):
    """What one campaign would tell, and its noise-free shifts beside the bridge without retrofit."""
    frequencies, temperature = campaign.frequencies[MODES], campaign.temperatures["tBD31A"]
    before, after = campaign.state == "before", campaign.state == "after"
    clean = campaign.clean_frequencies[MODES]
    others = pd.Series(
        [
            temperature.notna().mean(),
            temperature[:4000].isna().mean(),
            campaign.frequencies.notna().all(axis=1).mean(),
            temperature.min(),
            temperature.max(),
        ],
        list(OTHERS),
    )
    found = {
        "correlation before the retrofit": frequencies[before].corrwith(temperature[before])[MODES],
        "coverage": frequencies.notna().mean(),
        "shift in %, same weather, no noise": 100 * (clean / healthy.clean_frequencies[MODES] - 1)[after].mean(),
        "shift in %, means as measured": 100 * (frequencies[after].mean() / frequencies[before].mean() - 1),
        "other": others,
    }
    return pd.concat(found)


def side_by_side(real, runs):
    """The real value, and mean, lowest and highest over campaigns."""
    table = pd.DataFrame({"real": real, "mean": runs.mean(), "lowest": runs.min(), "highest": runs.max()})
    table["mean - real"] = table["mean"] - table["real"]
    return table.reindex(runs.columns)


def main():
    options = arguments(__doc__, seeds=10)
    runs, seconds = [], []
    for seed in range(options.seeds):
        started = time.perf_counter()
        campaign = make_kw51_campaign(random_state=seed)
        seconds.append(time.perf_counter() - started)
        runs.append(statistics(campaign, make_kw51_campaign(retrofit=False, random_state=seed)))
    real = pd.concat(
        {
            "correlation before the retrofit": CORRELATION,
            "coverage": COVERAGE,
            "shift in %, same weather, no noise": SHIFT,
            "shift in %, means as measured": SHIFT,
            "other": pd.Series(OTHERS),
        }
    )
    print(
        f"{options.seeds} campaigns; the first took {seconds[0]:.1f} s, the others {np.mean(seconds[1:]):.1f} s each\n"
    )
    print(side_by_side(real, pd.DataFrame(runs)).round(3).to_string())


if __name__ == "__main__":
    main()
