"""Piecewise-linear regression: what hinges append, and what linear regression makes of them."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.preprocessing import HingeFeatures

AIR = pd.DataFrame({"air": np.linspace(-10, 30, 81), "deck": np.linspace(-5, 40, 81) ** 2}, index=range(100, 181))


def test_hinges_are_what_is_above_each_knot():
    hinges = HingeFeatures(n_knots=3).fit(AIR)
    np.testing.assert_allclose(hinges.knots_, AIR.quantile([0.25, 0.5, 0.75]))
    features = hinges.transform(AIR)
    pd.testing.assert_frame_equal(features[["air", "deck"]], AIR)
    for number, knots in enumerate(hinges.knots_, 1):
        for name, knot in zip(AIR, knots, strict=True):
            np.testing.assert_array_equal(features[f"{name}_above{number}"], (AIR[name] - knot).clip(lower=0))
    assert features.shape == (81, 8)
    assert features.index.equals(AIR.index)


def test_frames_in_frames_out_arrays_in_arrays_out():
    hinges = HingeFeatures(n_knots=2).fit(AIR)
    names = ["air", "deck", "air_above1", "deck_above1", "air_above2", "deck_above2"]
    assert list(hinges.get_feature_names_out()) == list(hinges.transform(AIR)) == names
    plain = HingeFeatures(n_knots=2).fit(AIR.to_numpy())
    np.testing.assert_array_equal(plain.transform(AIR.to_numpy()), hinges.transform(AIR))
    assert isinstance(plain.transform(AIR.to_numpy()), np.ndarray)
    assert list(plain.get_feature_names_out(["a", "b"]))[2:] == ["a_above1", "b_above1", "a_above2", "b_above2"]
    assert isinstance(plain.set_output(transform="pandas").transform(AIR.to_numpy()), pd.DataFrame)


def test_missing_values_are_ignored_and_stay_missing():
    holed = AIR.mask(np.random.default_rng(0).random(AIR.shape) < 0.2)
    hinges = HingeFeatures().fit(holed)
    np.testing.assert_allclose(hinges.knots_, [holed.quantile(q) for q in (0.2, 0.4, 0.6, 0.8)])
    features = hinges.transform(holed)
    for name in AIR:
        own = features.filter(like=name)
        assert (own.isna().sum(axis=1).isin([0, 5])).all()
        np.testing.assert_array_equal(own.isna().all(axis=1), holed[name].isna())


@settings(max_examples=20)
@given(st.integers(1, 6), st.integers(0, 10_000))
def test_linear_regression_on_hinges_gives_any_piecewise_linear_function(n_knots, seed):
    """Any continuous function with straight pieces between the knots, and beyond the data."""
    rng = np.random.default_rng(seed)
    x = np.sort(rng.uniform(-15, 35, 200))
    knots = np.quantile(x, np.linspace(0, 1, n_knots + 2)[1:-1])
    slopes, start = rng.uniform(-1, 1, n_knots + 1), rng.uniform(-5, 5)

    def broken(t):
        """The integral of the slope, which changes at each knot."""
        ends = np.concatenate([[-1e3], knots, [1e3]])
        return start + sum(
            slope * (np.clip(t, low, high) - low) for slope, low, high in zip(slopes, ends[:-1], ends[1:], strict=True)
        )

    model = make_pipeline(HingeFeatures(n_knots), LinearRegression()).fit(x[:, np.newaxis], broken(x))
    beyond = np.linspace(-60, 80, 300)
    np.testing.assert_allclose(model.predict(beyond[:, np.newaxis]), broken(beyond), atol=1e-7)


@settings(max_examples=20)
@given(st.integers(1, 6), st.integers(0, 10_000))
def test_the_weight_of_a_row_is_how_often_it_counts(n_knots, seed):
    rng = np.random.default_rng(seed)
    X, weights = rng.normal(size=(30, 2)), rng.integers(0, 4, 30)
    X[rng.random(30) < 0.2, 1] = np.nan
    weighted = HingeFeatures(n_knots).fit(X, sample_weight=weights)
    np.testing.assert_allclose(weighted.knots_, HingeFeatures(n_knots).fit(X.repeat(weights, axis=0)).knots_)
    small = HingeFeatures(n_knots).fit(X, sample_weight=np.full(30, 1e-3)).knots_
    assert ((small >= np.nanmin(X, axis=0)) & (small <= np.nanmax(X, axis=0))).all()


def test_columns_without_values_are_errors():
    with pytest.raises(ValueError, match="'deck'"):
        HingeFeatures().fit(AIR.assign(deck=np.nan))
    with pytest.raises(ValueError, match="'deck'"):
        HingeFeatures().fit(
            AIR.assign(deck=AIR["deck"].where(AIR["air"] > 0)), sample_weight=(AIR["air"] <= 0).astype(float)
        )
