"""Gaps and offsets."""

import numpy as np
import pandas as pd
import pytest
from sklearn.impute import KNNImputer

from skthermo.datasets import make_truss
from skthermo.preprocessing import BiasAligner, KNNGapImputer

RNG = np.random.default_rng(0)
HOURS = pd.date_range("2025-01-01", periods=80, freq="h")
F = pd.DataFrame(RNG.normal([4.0, 9.0, 12.0], 0.1, (80, 3)), index=HOURS, columns=["f1", "f2", "f3"])
GAPPY = F.mask(RNG.random(F.shape) < 0.2)


@pytest.mark.parametrize("weights", ["uniform", "distance"])
def test_imputer_gives_scikit_learns_values_on_a_frame_of_its_own(weights):
    filled = KNNGapImputer(weights=weights).fit_transform(GAPPY)
    assert list(BiasAligner().fit(GAPPY).get_feature_names_out()) == list(GAPPY)
    expected = KNNImputer(n_neighbors=10, weights=weights).fit_transform(GAPPY)
    np.testing.assert_array_equal(filled.to_numpy(), expected)
    assert filled.index.equals(GAPPY.index)
    assert list(filled.columns) == list(GAPPY.columns)
    present = GAPPY.notna()
    pd.testing.assert_frame_equal(filled[present], GAPPY[present])


def imputed_by_definition(donors, row, column, n_neighbors, weigh):
    """One value, from all distances, directly."""
    shared = ~np.isnan(donors) & ~np.isnan(row)
    squares = np.where(shared, donors - row, 0) ** 2
    usable = shared.any(axis=1) & ~np.isnan(donors[:, column])
    distances = np.sqrt(squares.sum(axis=1)[usable] * len(row) / shared.sum(axis=1)[usable])
    nearest = np.argsort(distances)[:n_neighbors]
    return np.average(donors[usable, column][nearest], weights=weigh(distances[nearest]))


def scattered(share, n_donors=5000, n_new=4500):
    """Records with gaps in few patterns, as many as make trees faster than all distances."""
    rng = np.random.default_rng(1)
    full = rng.normal(size=(n_donors, 4)) @ rng.normal(size=(4, 4))
    new = np.where(rng.random((n_new, 4)) < share, np.nan, full[:n_new] + 0.1)
    return np.where(rng.random(full.shape) < share, np.nan, full), new[~np.isnan(new).all(axis=1)]


@pytest.mark.parametrize(
    ("weights", "weigh", "share"),
    [
        ("uniform", np.ones_like, 0.2),
        ("distance", np.reciprocal, 0.5),
        (lambda d: np.exp(-d), lambda d: np.exp(-d), 0.5),
    ],
    ids=["uniform", "distance", "callable"],
)
def test_many_records_have_the_weighted_mean_of_the_nearest(weights, weigh, share):
    gappy, new = scattered(share)
    filled = KNNGapImputer(weights=weights).fit(gappy).transform(new)
    for row, column in np.argwhere(np.isnan(new))[::50]:
        expected = imputed_by_definition(gappy, new[row], column, 10, weigh)
        assert filled[row, column] == pytest.approx(expected, rel=1e-10, abs=1e-12)


def test_neighbours_are_the_same_far_from_zero():
    gappy, new = scattered(0.1, 8000, 7500)
    near, far = (KNNGapImputer().fit(gappy + shift).transform(new + shift) - shift for shift in (0.0, 1e7))
    np.testing.assert_allclose(far, near, rtol=0, atol=1e-7)


def test_rows_without_any_value_indicators_and_empty_columns():
    holed = GAPPY.copy()
    holed += 1e-3 * np.random.default_rng(2).standard_normal(holed.shape)
    holed.iloc[5] = np.nan
    filled = KNNGapImputer().fit_transform(holed)
    np.testing.assert_allclose(filled.iloc[5], holed.mean(), rtol=1e-12)
    for options in ({"add_indicator": True}, {"keep_empty_features": True}):
        data = holed.assign(f4=np.nan) if "keep_empty_features" in options else holed
        ours, theirs = (
            KNNGapImputer(**options).fit_transform(data),
            KNNImputer(n_neighbors=10, **options).fit_transform(data),
        )
        np.testing.assert_allclose(ours, theirs, rtol=1e-10)


def test_a_row_without_any_value_among_many_has_the_means_and_donors_are_a_copy():
    gappy, new = scattered(0.3)
    gappy[5] = np.nan
    imputer, row = KNNGapImputer().fit(gappy), gappy[5:6].copy()
    np.testing.assert_allclose(imputer.transform(row), [np.nanmean(gappy, axis=0)], rtol=1e-12)
    expected = imputer.transform(new)
    gappy[:] = 99.0
    np.testing.assert_array_equal(imputer.transform(new), expected)


def test_imputer_refuses_an_empty_column_by_name():
    empty = GAPPY.assign(f2=np.nan)
    with pytest.raises(ValueError, match="'f2'"):
        KNNGapImputer().fit(empty)
    filled = KNNGapImputer(keep_empty_features=True).fit_transform(empty)
    assert (filled["f2"] == 0).all()


@pytest.mark.parametrize("method", ["shift", "scale"])
def test_aligned_means_are_the_reference_and_the_way_back_is_exact(method):
    reference = np.array([4.2, 8.7, 12.5])
    aligner = BiasAligner(reference, method=method).fit(GAPPY)
    aligned = aligner.transform(GAPPY)
    np.testing.assert_allclose(aligned.mean(), reference, rtol=1e-12)
    pd.testing.assert_frame_equal(aligner.inverse_transform(aligned), GAPPY)
    assert aligned.index.equals(GAPPY.index)


def test_methods_keep_differences_or_ratios():
    aligned = {m: BiasAligner([8.0, 18.0, 24.0], method=m).fit_transform(F) for m in ("shift", "scale")}
    np.testing.assert_allclose(aligned["shift"] - aligned["shift"].mean(), F - F.mean(), atol=1e-12)
    np.testing.assert_allclose(aligned["scale"] / aligned["scale"].mean(), F / F.mean(), rtol=1e-12)


def test_reference_may_be_a_model_or_nothing():
    truss = make_truss(n_modes=3)
    nominal = truss.frequencies(np.ones((1, 4)))[0]
    np.testing.assert_array_equal(BiasAligner(truss).fit(F).reference_, nominal)
    np.testing.assert_array_equal(BiasAligner().fit(F).reference_, 0)
    np.testing.assert_array_equal(BiasAligner(method="scale").fit(F).reference_, 1)
