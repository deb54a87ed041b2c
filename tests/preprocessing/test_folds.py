"""Laws of folds of blocks that are dealt in turn."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from skthermo.preprocessing import BlockedKFold


@given(n_rows=st.integers(2, 400), n_splits=st.integers(2, 6), block=st.one_of(st.none(), st.integers(1, 500)))
def test_every_row_is_tested_once_and_no_fold_is_empty(n_rows, n_splits, block):
    if n_rows < n_splits:
        with pytest.raises(ValueError, match=f"{n_rows} rows"):
            list(BlockedKFold(n_splits, block=block).split(np.zeros((n_rows, 1))))
        return
    folds = list(BlockedKFold(n_splits, block=block).split(np.zeros((n_rows, 1))))
    assert len(folds) == n_splits
    assert all(len(train) and len(test) for train, test in folds)
    assert sorted(np.concatenate([test for _, test in folds])) == list(range(n_rows))


def test_each_fold_of_a_year_holds_each_season():
    hours = pd.date_range("2023-01-01", periods=365 * 24, freq="h")
    folds = BlockedKFold().fold_of(pd.DataFrame(index=hours))
    assert (pd.crosstab(folds, hours.quarter) > 300).all(axis=None)
    assert (np.bincount(folds[: 5 * 168]) == 168).all()


def test_stamps_tell_the_block_whatever_the_order_of_the_rows():
    stamps = pd.date_range("2023-01-01", periods=1000, freq="3h").delete(slice(100, 160))
    frame, shuffled = pd.DataFrame(index=stamps), np.random.default_rng(0).permutation(len(stamps))
    for block in (None, "2D", np.timedelta64(2, "D"), 17):
        folds = BlockedKFold(4, block=block)
        assert block in (None, 17) or folds.length(frame) == pd.Timedelta("2D")
        assert (folds.fold_of(frame)[shuffled] == folds.fold_of(frame.iloc[shuffled])).all()
