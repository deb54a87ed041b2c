"""Gaps and offsets."""

import numpy as np
import pandas as pd
import pytest
from sklearn.impute import KNNImputer

from skthermo.datasets import make_truss
from skthermo.preprocessing import BiasAligner, KNNGapImputer, _impute

RNG = np.random.default_rng(0)
HOURS = pd.date_range("2025-01-01", periods=80, freq="h")
F = pd.DataFrame(RNG.normal([4.0, 9.0, 12.0], 0.1, (80, 3)), index=HOURS, columns=["f1", "f2", "f3"])
GAPPY = F.mask(RNG.random(F.shape) < 0.2)


@pytest.mark.parametrize("weights", ["uniform", "distance"])
def test_imputer_gives_scikit_learns_values_on_a_frame_of_its_own(weights):
    filled = KNNGapImputer(weights=weights).fit_transform(GAPPY)
    expected = KNNImputer(n_neighbors=10, weights=weights).fit_transform(GAPPY)
    np.testing.assert_array_equal(filled.to_numpy(), expected)
    assert filled.index.equals(GAPPY.index)
    assert list(filled.columns) == list(GAPPY.columns)
    present = GAPPY.notna()
    pd.testing.assert_frame_equal(filled[present], GAPPY[present])


@pytest.fixture
def trees(monkeypatch):
    """Trees even for few rows and small pools."""
    monkeypatch.setattr(_impute, "FEW_PAIRS", 0)
    monkeypatch.setattr(_impute, "PAIRS_PER_POOL", 0.0)
    monkeypatch.setattr(_impute, "PAIRS_PER_TREE", 30)
    monkeypatch.setattr(_impute, "PAIRS_AT_ONCE", 50)


def imputed_by_definition(donors, row, column, n_neighbors, weigh):
    """One value, from all distances, directly."""
    shared = ~np.isnan(donors) & ~np.isnan(row)
    squares = np.where(shared, donors - row, 0) ** 2
    usable = shared.any(axis=1) & ~np.isnan(donors[:, column])
    distances = np.sqrt(squares.sum(axis=1)[usable] * len(row) / shared.sum(axis=1)[usable])
    nearest = np.argsort(distances)[:n_neighbors]
    return np.average(donors[usable, column][nearest], weights=weigh(distances[nearest]))


def scattered(share):
    rng = np.random.default_rng(1)
    full = rng.normal(size=(500, 5)) @ rng.normal(size=(5, 5))
    new = np.where(rng.random((60, 5)) < share, np.nan, full[:60] + 0.1)
    return np.where(rng.random(full.shape) < share, np.nan, full), new[~np.isnan(new).all(axis=1)]


@pytest.mark.nightly
@pytest.mark.usefixtures("trees")
@pytest.mark.parametrize("share", [0.1, 0.5])
@pytest.mark.parametrize("n_neighbors", [1, 10, 300])
def test_trees_give_scikit_learns_values(share, n_neighbors):
    gappy, new = scattered(share)
    ours, theirs = (imputer(n_neighbors=n_neighbors).fit(gappy) for imputer in (KNNGapImputer, KNNImputer))
    np.testing.assert_allclose(ours.transform(gappy), theirs.transform(gappy), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(ours.transform(new), theirs.transform(new), rtol=1e-10, atol=1e-10)


@pytest.mark.usefixtures("trees")
@pytest.mark.parametrize("share", [0.1, 0.5])
@pytest.mark.parametrize(
    ("weights", "weigh"),
    [("uniform", np.ones_like), ("distance", np.reciprocal), (lambda d: np.exp(-d), lambda d: np.exp(-d))],
    ids=["uniform", "distance", "callable"],
)
def test_trees_give_the_weighted_mean_of_the_nearest(weights, weigh, share):
    gappy, new = scattered(share)
    filled = KNNGapImputer(weights=weights).fit(gappy).transform(new)
    for row, column in np.argwhere(np.isnan(new)):
        expected = imputed_by_definition(gappy, new[row], column, 10, weigh)
        assert filled[row, column] == pytest.approx(expected, rel=1e-10, abs=1e-12)


@pytest.mark.usefixtures("trees")
@pytest.mark.parametrize("pairs", [0, 30, 10_000_000])
def test_neighbours_are_the_same_far_from_zero(pairs, monkeypatch):
    monkeypatch.setattr(_impute, "PAIRS_PER_TREE", pairs)
    gappy, new = scattered(0.3)
    near, far = (KNNGapImputer().fit(gappy + shift).transform(new + shift) - shift for shift in (0.0, 1e7))
    np.testing.assert_allclose(far, near, rtol=0, atol=1e-7)


@pytest.mark.usefixtures("trees")
def test_trees_serve_rows_without_any_value_indicators_and_empty_columns():
    holed = GAPPY.copy()
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


@pytest.mark.usefixtures("trees")
def test_donors_are_a_copy():
    values = GAPPY.to_numpy(copy=True)
    imputer = KNNGapImputer().fit(values)
    expected = imputer.transform(GAPPY.to_numpy())
    values[:] = 99.0
    np.testing.assert_array_equal(imputer.transform(GAPPY.to_numpy()), expected)


def test_trees_are_for_many_rows_of_few_patterns():
    rng = np.random.default_rng(0)
    few_patterns, many_patterns = (np.where(rng.random((9000, p)) < 0.1, np.nan, 1.0) for p in (6, 20))
    assert _impute.Donors(few_patterns).trees_are_faster(np.isnan(few_patterns))
    assert not _impute.Donors(few_patterns[:2000]).trees_are_faster(np.isnan(few_patterns[:2000]))
    assert not _impute.Donors(many_patterns).trees_are_faster(np.isnan(many_patterns))


def test_imputer_keeps_arrays():
    assert isinstance(KNNGapImputer().fit_transform(GAPPY.to_numpy()), np.ndarray)


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
