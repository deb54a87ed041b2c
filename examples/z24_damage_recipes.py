"""Parameters in place of frequencies, identified damage, and simulated alarms; for ``plot_z24_damage.py``."""

import pandas as pd
from sklearn.compose import ColumnTransformer
from sklearn.pipeline import Pipeline, make_pipeline
from z24_recipes import FREQUENCIES, SCALES, Records, boosting, bridge_model, chain, compensate

from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.preprocessing import BiasAligner
from skthermo.studies import DetectabilityStudy, Scenario, identify_damage
from skthermo.surrogate import InverseSurrogate, TemperatureMapper

FROST = 2.0  # pavement below this, in degrees Celsius, may hold ice


def in_parameters(records):
    """The records with multipliers of the FE model in place of frequencies, and the names of these."""
    model = bridge_model()
    inverse = InverseSurrogate(model, bounds=0.5, noise=0.005, random_state=0)
    others = [column for column in records.baseline if column not in FREQUENCIES]
    to_parameters = ColumnTransformer(
        [
            ("temperatures", "passthrough", others),
            ("parameters", make_pipeline(BiasAligner(model, method="scale"), inverse), FREQUENCIES),
        ],
        verbose_feature_names_out=False,
    ).set_output(transform="pandas")
    return records.each(to_parameters.fit(records.baseline).transform), list(model.parameter_names)


def changes(measured, names):
    """Change of every parameter from the compensator's prediction, in percent: means of days."""
    residuals, _ = compensate(measured, TemperatureMapper(), targets=names)
    relative = (100 * r / (m[names] - r) for m, r in zip(measured, residuals, strict=True))
    return Records(*(frame.groupby(frame.index.floor("D")).mean() for frame in relative))


def identify(bridge):
    """Chain of all healthy records, as it stands for the bridge here, and the damage that explains its last month."""
    fem = chain(bridge_model()).fit(bridge.T, bridge.F)
    return fem, identify_damage(fem, bridge.T_damaged, bridge.F_damaged, random_state=0)


def detectors():
    """Detectors by what they see: raw frequencies, as in the paper, or residuals of two compensators."""
    found = {"raw frequencies": MahalanobisDetector()}
    for name, estimator in (("broken lines", TemperatureMapper()), ("boosted trees", boosting())):
        for label, scale in SCALES.items():
            compensator = TemperatureCompensator(estimator, targets=FREQUENCIES, scale=scale)
            found[f"{name}, {label}"] = make_pipeline(compensator, MahalanobisDetector())
    return found


def simulation_table(bridge, records, fem, found, names=None, n_repeats=40):
    """Alarms on measured records, and the band of simulated ones, in percent; the baseline is measured in both."""
    later = bridge.split()[2]
    states = {
        "false alarms": (later, Scenario("healthy"), records.later),
        "damage found": (bridge.T_damaged, found.scenario("damaged"), records.damaged),
    }
    rows = {}
    for name in names or detectors():
        detector = detectors()[name]
        for state, (weather, scenario, measured) in states.items():
            study = DetectabilityStudy(fem, detector, [scenario], n_repeats=n_repeats, random_state=0)
            sees = list(records.baseline) if isinstance(detector, Pipeline) else FREQUENCIES
            results = study.run(weather, records.baseline[sees], reference={scenario.name: measured[sees]})
            simulated, true = (
                row for _, row in results.set_index("source").loc[["data-informed", "reference"]].iterrows()
            )
            rows[state, name] = {
                "measured": true["rate"],
                "simulated": simulated["rate"],
                "lowest": simulated["band_lowest"],
                "highest": simulated["band_highest"],
            }
    return 100 * pd.DataFrame(rows).T
