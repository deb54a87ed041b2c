"""How many warnings a plain fit gives on raw records, and of which kinds.

    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/warnings_given.py
    OMP_NUM_THREADS=1 SKTHERMO_DATA=... python tests/benchmarks/warnings_given.py --against 43ba4fa4

Five structures: the truss, a bridge of ``make_fleet`` and KW51, simulated; Z24 and a tower, measured, whose data are in
the folder that SKTHERMO_DATA names. Of the simulated records, 3 % are missing and a few are what loggers write in
their place. A chain, a detector behind a regression on temperatures, a study and a monitor get no settings but a seed.
Every warning counts, whatever Python's filters would show.
"""

import warnings
from collections import Counter

import numpy as np
import pandas as pd
from harness import DATA, arguments, compensated, shown, tower_records, z24_records

from skthermo.datasets import make_fleet, make_kw51, make_kw51_campaign, make_truss, make_truss_campaign, make_z24
from skthermo.detection import DirectionalDetector
from skthermo.fem import AffineModel
from skthermo.monitoring import Monitor
from skthermo.studies import DetectabilityStudy, sweep
from skthermo.surrogate import DataInformedFEM

SHOWN = 500  # records whose weather a study simulates


def with_defects(T, F, seed=0):
    """Records with 3 % of the frequencies missing, with codes of loggers, and with single outliers."""
    random = np.random.default_rng(seed)
    T, F = T.copy(), F.mask(random.random(F.shape) < 0.03)
    rows = random.choice(len(F), 9, replace=False)
    T.iloc[rows[:3], 0] = -999.0
    F.iloc[rows[3:6], 0] = 0.0
    F.iloc[rows[6:], 1] *= 1.3
    return T, F


def truss():
    year = make_truss_campaign(random_state=0)
    return make_truss(), *with_defects(year.temperatures, year.frequencies)


def bridge():
    one = next(iter(make_fleet(1, random_state=0).values()))
    year = one.records(365)
    return one.model, *with_defects(year.temperatures, year.frequencies)


def kw51():
    campaign = make_kw51_campaign(random_state=0)
    return make_kw51(), *with_defects(campaign.temperatures[::4], campaign.frequencies[::4])


def z24():
    T, F = z24_records()[0]
    return make_z24().with_modes(range(F.shape[1])), T, F


def tower():
    """With a model of two springs a mode, as stiff as the mean frequencies say."""
    T, F = tower_records()
    squares, in_bending = (2 * np.pi * F.mean().to_numpy()) ** 2, np.arange(F.shape[1]) < 4
    stiffness = {("bending",): np.diag(squares * in_bending), ("torsion",): np.diag(squares * ~in_bending)}
    return AffineModel(stiffness, np.eye(F.shape[1]), n_modes=F.shape[1]), T, F


STRUCTURES = {"truss": truss, "bridge": bridge, "KW51": kw51} | ({"Z24": z24, "tower": tower} if DATA else {})


def given(call):
    """The kinds of the warnings of a call, others by their class, and what it returns."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        found = call()
    return Counter(getattr(one.message, "kind", one.category.__name__) for one in caught), found


def fits(model, T, F):
    """Kinds of the warnings of each fit."""
    counts = {}
    detector = compensated(F, DirectionalDetector())
    counts["chain"], chain = given(lambda: DataInformedFEM(model, random_state=0).fit(T, F))
    counts["detector"], _ = given(lambda: detector.fit(T.join(F)))
    scenarios = sweep(chain, (0.1,), groups=[next(iter(model.groups))])
    study = DetectabilityStudy(chain, detector, scenarios, random_state=0)
    counts["study"], _ = given(lambda: study.run(T[:SHOWN], baseline=T.join(F)))
    counts["monitor"], _ = given(lambda: Monitor(targets=list(F), random_state=0).fit(T.join(F)))
    return counts


def main():
    options = arguments(__doc__, structures=STRUCTURES)
    rows = {}
    for structure in options.structures:
        for fit, kinds in fits(*STRUCTURES[structure]()).items():
            rows[structure, fit] = {
                "warnings": sum(kinds.values()),
                "kinds": ", ".join(f"{n} {kind}" if n > 1 else kind for kind, n in sorted(kinds.items())),
            }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis(["structure", "fit"])
    shown("Warnings of a plain fit on raw records", table)
    total = table["warnings"].groupby(level="fit", sort=False).agg(["mean", "max"])
    shown("Warnings of a plain fit on raw records, over the structures", total.astype(float), 1)


if __name__ == "__main__":
    main()
