"""Detectors on Z24: measured rates beside simulated ones, and the choice that simulation makes."""

import pandas as pd
from detector_recipes import field_detectors
from z24_recipes import FREQUENCIES, Records, bridge_model, chain, compensated

from skthermo.detection import DirectionalDetector
from skthermo.studies import DetectabilityStudy, Scenario, sweep

ASSUMED = {"soil": 0.18}  # damage that one may have expected of a pier that is to be lowered
DAMAGED = "pier lowered"
STATES = {"PFA": "false alarms", "POD": "damage found"}
FIRST = 12  # damaged records that another publication counts as healthy


def detectors():
    """The field's detectors by name, and directional ones of piecewise-linear residuals."""
    model = bridge_model()
    found = field_detectors(FREQUENCIES, chain(model), block="1D")
    for name, directions in {"softening": "softening", "directions of the model": model}.items():
        for label, regimes in {"": None, ", regimes": "auto"}.items():
            found[f"{name}{label}"] = compensated(DirectionalDetector(directions), regimes=regimes)
    return found


def columns_of(name):
    """Columns that a detector of the field sees: raw ones the frequencies, the others temperatures beside them."""
    return FREQUENCIES if name.startswith("raw") else slice(None)


def measured_table(records, candidates):
    """Alarms on measured records in percent, with the first damaged ones counted as damaged, and as healthy."""
    rows = {}
    for name, detector in candidates.items():
        seen = records.each(lambda frame, name=name: frame.loc[:, columns_of(name)])
        detector.fit(seen.baseline)
        later, damaged = (detector.predict(part) == -1 for part in (seen.later, seen.damaged))
        rows[name] = {
            "false alarms": later.mean(),
            "found of 130": damaged.mean(),
            "alarms in the first 12": damaged[:FIRST].mean(),
            "found of the other 118": damaged[FIRST:].mean(),
        }
    return 100 * pd.DataFrame(rows).T


def short_baselines(records, candidates, shares=(0.4, 0.5, 0.6, 0.8)):
    """False alarms on the fifth of the healthy records after a shorter baseline, and damage found, in percent."""
    healthy = pd.concat([records.baseline, records.later])
    rows = {}
    for share in shares:
        n = round(share * len(healthy))
        part = Records(healthy[:n], healthy[n : n + len(healthy) // 5], records.damaged)
        table = measured_table(part, candidates)
        for state, column in (("false alarms", "false alarms"), ("damage found", "found of 130")):
            rows[state, f"first {share:.0%}"] = table[column]
    return pd.DataFrame(rows).sort_index(axis=1, ascending=[False, True])


def compare(bridge, fem, damage, candidates=None, n_repeats=40, memory=None):
    """Rates of alarms that a chain simulates beside the measured ones: later healthy records, and the damaged month.

    A folder as the memory keeps what the detectors have learned, so that one study after the other need not.
    """
    records, later = Records.of(bridge), bridge.split()[2]
    results = []
    for weather, scenario, measured in (
        (later, Scenario("healthy"), records.later),
        (bridge.T_damaged, damage, records.damaged),
    ):
        study = DetectabilityStudy(
            fem,
            candidates or detectors(),
            [scenario],
            n_repeats=n_repeats,
            uncertainty="noise",
            random_state=0,
            memory=memory,
        )
        results.append(study.run(weather, records.baseline, reference={scenario.name: measured}))
    return pd.concat(results, ignore_index=True)


def compare_before_damage(bridge, **options):
    """The same for a chain that has learned the baseline alone and an assumed damage, as before the first alarm."""
    fem = chain(bridge_model()).fit(*bridge.split()[:2])
    return compare(bridge, fem, Scenario(DAMAGED, ASSUMED), **options)


def side_by_side(results):
    """Measured and simulated rates by detector, and the band of simulated campaigns, in percent."""
    rates = results[results["error"] == ""].pivot(index="detector", columns=["measure", "source"])
    order = [name for name in results["detector"].unique() if name in rates.index]
    columns = {}
    for measure, state in STATES.items():
        columns[state, "measured"] = rates["rate", measure, "reference"]
        simulated = {"simulated": "rate", "lowest": "pi_low", "highest": "pi_high"}
        columns |= {(state, key): rates[value, measure, "simulated"] for key, value in simulated.items()}
    return 100 * pd.DataFrame(columns).loc[order].astype(float)


def agreement(table):
    """Spearman's correlation of measured and simulated rates, and the share of measured ones in the band."""
    rows = {}
    for state in STATES.values():
        rates = table[state]
        inside = rates["measured"].between(rates["lowest"], rates["highest"])
        correlation = rates["measured"].rank().corr(rates["simulated"].rank())
        rows[state] = {"rank correlation": correlation, "in the band": inside.mean(), "detectors": len(rates)}
    return pd.DataFrame(rows).T


def choose(bridge, candidates=None, n_repeats=10, ahead=True, memory=None):
    """A study of all damage groups, from training rows and simulation alone, to choose a detector by.

    The chain has learned all training rows. Detectors learn the first three quarters of them, and evaluate the weather
    of the last, which is ahead of them as it will be in service; or they learn all, and evaluate every fourth row's
    weather.
    """
    T, F = bridge.split()[:2]
    n = 3 * len(T) // 4 if ahead else len(T)
    fem = chain(bridge_model()).fit(T, F)
    study = DetectabilityStudy(
        fem,
        candidates or detectors(),
        sweep(fem),
        n_repeats=n_repeats,
        uncertainty="noise",
        random_state=0,
        memory=memory,
    )
    study.run(T[n:] if ahead else T[::4], T.join(F)[:n])
    return study
