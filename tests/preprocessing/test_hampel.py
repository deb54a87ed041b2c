"""Values that are far from their neighbours are removed, and nothing else."""

import numpy as np
import pandas as pd
import pytest

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import HampelFilter

YEAR = make_truss_campaign(random_state=0)
T, F = YEAR.temperatures, YEAR.frequencies
X = T.join(F)


def spoiled(F, seed=0, share=0.01):
    """Frequencies with some of another pole, and which."""
    random = np.random.default_rng(seed)
    wrong = random.random(F.shape) < share
    return F.where(~wrong, F * random.choice([0.8, 1.25], F.shape)), wrong


@pytest.mark.parametrize("window", [25, "25D"])
def test_outliers_go_and_other_values_stay(window):
    raw, wrong = spoiled(F)
    hampel = HampelFilter(window, targets=list(F)).fit(T.join(raw))
    cleaned = hampel.transform(T.join(raw))
    assert cleaned.index.equals(F.index)
    assert list(cleaned) == list(X)
    pd.testing.assert_frame_equal(cleaned[list(T)], T)
    np.testing.assert_array_equal(cleaned[list(F)].isna(), wrong)
    np.testing.assert_array_equal(cleaned[list(F)].to_numpy()[~wrong], F.to_numpy()[~wrong])
    assert hampel.n_removed_.tolist() == [0, 0, 0, *wrong.sum(axis=0)]


def test_the_definition_one_value_at_a_time():
    values = np.random.default_rng(0).standard_t(2, (80, 1))
    hampel = HampelFilter(7, n_deviations=4).fit(values)

    def around(table, row):
        return table[max(row - 3, 0) : row + 4]

    distances = np.array([values[row] - np.median(around(values, row)) for row in range(80)])
    everywhere = 1.4826 * np.median(np.abs(distances - np.median(distances)))
    local = np.array([1.4826 * np.median(np.abs(around(distances, row))) for row in range(80)])
    expected = np.abs(distances[:, 0]) > 4 * np.maximum(local, everywhere)
    np.testing.assert_array_equal(np.isnan(hampel.transform(values))[:, 0], expected)
    assert 0 < hampel.n_removed_[0] < 20


def test_damage_that_lasts_and_frost_stay():
    below = np.maximum(T["T1"].quantile(0.2) - T["T1"], 0.0)
    frost = F.mul(1 + 0.02 * below, axis=0)
    assert (frost / F).max().max() > 1.1
    hampel = HampelFilter(targets=list(F)).fit(T.join(frost))
    damaged = T.join(frost * np.where(np.arange(len(F)) < 200, 1.0, 0.85)[:, np.newaxis])
    assert hampel.transform(damaged).isna().to_numpy().mean() < 0.002


def test_rows_go_by_time_and_gaps_are_no_neighbours():
    raw, _ = spoiled(F)
    gappy = raw.mask(np.random.default_rng(1).random(F.shape) < 0.3)
    order = np.random.default_rng(2).permutation(len(F))
    hampel = HampelFilter().fit(gappy)
    shuffled = hampel.transform(gappy.iloc[order])
    pd.testing.assert_frame_equal(shuffled, hampel.transform(gappy).iloc[order])
    assert (hampel.transform(gappy).notna() <= gappy.notna()).all(axis=None)


def test_a_row_without_any_temperature_is_compared_with_its_neighbours():
    raw = X.copy()
    raw.iloc[100, :3] = np.nan
    raw.iloc[100, 4] *= 1.5
    cleaned = HampelFilter(targets=list(F)).fit(X).transform(raw)
    assert cleaned.isna().iloc[100].tolist() == [True, True, True, False, True, False, False, False, False]
