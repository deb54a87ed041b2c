"""Damping ratios beside frequencies: compensated for temperature, and evaluated together."""

import numpy as np
import pandas as pd
import pytest

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


def test_residuals_of_damping_do_not_depend_on_temperature():
    compensator = TemperatureCompensator(TemperatureMapper(), targets=FREQUENCIES + DAMPING)
    residuals = compensator.fit_transform(BASELINE)
    assert list(residuals) == FREQUENCIES + DAMPING
    warmth = BASELINE["T2"]
    assert (BASELINE[DAMPING].corrwith(warmth) < -0.4).all()
    assert (residuals[DAMPING].corrwith(warmth).abs() < 0.1).all()


@pytest.mark.nightly
def test_missing_and_negative_ratios_are_taken():
    """Identification loses modes, and gives ratios just below zero now and then."""
    holed = BASELINE.copy()
    holed.loc[holed.index[::5], "xi1"] = np.nan
    holed.iloc[3, -1] = -0.001
    residuals = TemperatureCompensator(TemperatureMapper(), targets=FREQUENCIES + DAMPING).fit_transform(holed)
    pd.testing.assert_frame_equal(residuals.isna(), holed[FREQUENCIES + DAMPING].isna())
    assert np.isfinite(MahalanobisDetector().fit(residuals).damage_index(residuals)).all()
