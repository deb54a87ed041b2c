"""Records of the KW51 study; tests/benchmarks/kw51_study.py holds its chain to limits."""

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_kw51_campaign
from tests.examples.pages import recipes

pytestmark = pytest.mark.nightly
study = recipes("kw51")


N_AFTER = 300


@pytest.fixture(scope="module")
def records():
    """The records of the study's baseline, and some in which a retrofit shifts each mode by its mean."""
    campaign = make_kw51_campaign(n_hours=study.BASELINE + N_AFTER, retrofit=False, random_state=1)
    theta, model = campaign.theta[-N_AFTER::50], campaign.model
    strengthened = model.damaged(campaign.retrofit["damage"]).with_added(mass=campaign.retrofit["mass"])
    ratio = (strengthened.frequencies(theta) / model.frequencies(theta)).mean(axis=0)
    after = np.arange(len(campaign.theta)) >= study.BASELINE
    shift = np.where(after[:, np.newaxis], ratio, 1.0)
    return study.Records(
        "KW51, synthetic",
        campaign.temperatures,
        campaign.frequencies * shift,
        campaign.state.mask(after, "after"),
        campaign.retrofit,
        campaign.clean_frequencies * shift,
    )


def test_imputed_records_have_no_gaps_and_keep_what_was_measured(records):
    filled = records.imputed()
    assert filled.frequencies.notna().all(axis=None)
    assert filled.temperatures.notna().all(axis=None)
    pd.testing.assert_frame_equal(
        filled.frequencies.where(records.frequencies.notna()), records.frequencies, check_freq=False
    )


def test_a_part_of_the_retrofit_is_a_part_of_each_change(records):
    whole, part = records.changes["retrofit"], records.changes["part"]
    assert part["damage"] == {group: pytest.approx(study.PART * s) for group, s in whole["damage"].items()}
    np.testing.assert_allclose(part["mass"], study.PART * whole["mass"])
