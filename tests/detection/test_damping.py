"""Damping ratios beside frequencies: compensated for temperature, and evaluated together."""

import numpy as np
import pandas as pd
import pytest
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.surrogate import TemperatureMapper

SCATTER = 0.15


def records(seed, factor=1.0, damage=None):
    """Temperatures, frequencies, and damping ratios that fall by 14 % with every 10 degrees and scatter by 15 %."""
    campaign = make_truss_campaign(2, damage=damage, random_state=seed)
    rng = np.random.default_rng(seed)
    warmth = campaign.temperatures.mean(axis=1).to_numpy()[:, np.newaxis] / 10
    ratios = factor * 0.008 * np.exp(-0.15 * warmth + SCATTER * rng.standard_normal((len(warmth), 6)))
    damping = pd.DataFrame(ratios, campaign.temperatures.index, [f"xi{i + 1}" for i in range(6)])
    return campaign.temperatures.join(campaign.frequencies).join(damping)


BASELINE = records(0)
FREQUENCIES, DAMPING = ([name for name in BASELINE if name.startswith(first)] for first in ("f", "xi"))


def detector(targets, last=None):
    compensator = TemperatureCompensator(TemperatureMapper(), targets=targets)
    others = [name for name in FREQUENCIES + DAMPING if name not in targets]
    fitted = make_pipeline(compensator, last or MahalanobisDetector()).fit(BASELINE.drop(columns=others))
    return lambda X: (fitted.predict(X.drop(columns=others)) == -1).mean()


def test_residuals_of_damping_do_not_depend_on_temperature():
    compensator = TemperatureCompensator(TemperatureMapper(), targets=FREQUENCIES + DAMPING)
    residuals = compensator.fit_transform(BASELINE)
    assert list(residuals) == FREQUENCIES + DAMPING
    warmth = BASELINE["T2"]
    assert (BASELINE[DAMPING].corrwith(warmth) < -0.4).all()
    assert (residuals[DAMPING].corrwith(warmth).abs() < 0.1).all()


@pytest.mark.nightly
def test_alarms_are_as_rare_as_asked_and_changes_of_either_are_found():
    both, frequencies, damping = (detector(targets) for targets in (FREQUENCIES + DAMPING, FREQUENCIES, DAMPING))
    for rate in (both, frequencies, damping):
        assert rate(records(1)) < 0.04
    more_damping, less_stiffness = records(2, factor=1.15), records(3, damage={"bottom": 0.1})
    assert min(damping(more_damping), both(more_damping)) > 0.2 > 5 * frequencies(more_damping)
    assert min(frequencies(less_stiffness), both(less_stiffness)) > 0.4 > 5 * damping(less_stiffness)


def test_missing_and_negative_ratios_are_taken():
    """Identification loses modes, and gives ratios just below zero now and then."""
    holed = BASELINE.copy()
    holed.loc[holed.index[::5], "xi1"] = np.nan
    holed.iloc[3, -1] = -0.001
    residuals = TemperatureCompensator(TemperatureMapper(), targets=FREQUENCIES + DAMPING).fit_transform(holed)
    pd.testing.assert_frame_equal(residuals.isna(), holed[FREQUENCIES + DAMPING].isna())
    assert np.isfinite(MahalanobisDetector().fit(residuals).damage_index(residuals)).all()
