"""Records of the KW51 study; tests/benchmarks/kw51_study.py holds its chain to limits."""

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import load_kw51, make_kw51_campaign
from tests.datasets.kw51_file import write_kw51
from tests.examples.pages import recipes

study = recipes("kw51")
INDEX = {"check_freq": False, "check_index_type": False}  # a file's time stamps have no frequency
FOURTEEN = [f"f{mode}" for mode in range(1, 15)]


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


@pytest.mark.nightly
def test_a_campaign_in_the_format_of_the_file_is_read_back_equal(tmp_path):
    campaign = make_kw51_campaign(n_hours=200, shapes=True, random_state=0)
    padded = [table.reindex(columns=[*table, *range(8)]) for table in (campaign.frequencies, campaign.damping)]
    shapes = np.concatenate([campaign.shapes, np.full((200, 8, 12), np.nan)], axis=1)
    file = tmp_path / "trackedmodes.mat"
    write_kw51(file, *padded, shapes, campaign.temperatures, times=campaign.frequencies.index)
    data = load_kw51(file)
    pd.testing.assert_frame_equal(data.frequencies.iloc[:, :6], campaign.frequencies, **INDEX)
    pd.testing.assert_frame_equal(data.damping.iloc[:, :6], campaign.damping, **INDEX)
    pd.testing.assert_frame_equal(data.temperatures, campaign.temperatures, **INDEX)
    np.testing.assert_array_equal(data.shapes[:, :6], campaign.shapes)
    assert data.sensors == campaign.sensors
    assert (data.state == campaign.state).all()
    assert list(data.frequencies) == FOURTEEN
    assert data.frequencies.iloc[:, 6:].isna().all(axis=None)
    from_file = study.Records.read(file)
    assert from_file.title == "KW51, trackedmodes.mat"
    pd.testing.assert_frame_equal(from_file.frequencies, campaign.frequencies, **INDEX)


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
