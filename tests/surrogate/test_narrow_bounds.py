"""Samples drawn again where the records are, and the round trip of the nominal frequencies."""

import numpy as np
import pytest
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import PolynomialFeatures

from skthermo.datasets import make_truss
from skthermo.surrogate import DataInformedFEM, InverseSurrogate, TemperatureMapper

TRUSS = make_truss()
THETA = 1 + np.random.default_rng(0).uniform(-0.03, 0.03, (200, 4))
MEASURED = TRUSS.frequencies(THETA)
QUADRATIC = make_pipeline(PolynomialFeatures(2), Ridge(1e-6))
SETTINGS = {"refine": 0, "n_samples": 400, "random_state": 0}


def inverse(**settings):
    return InverseSurrogate(TRUSS, QUADRATIC, **(SETTINGS | settings))


def error(fitted):
    return np.abs(fitted.transform(MEASURED) / THETA - 1).mean()


class TestNarrowBounds:
    def test_samples_are_where_the_records_are(self):
        fitted = inverse(narrow_bounds=True).fit(MEASURED)
        lowest, highest = fitted.box_.bounds.T
        assert (lowest < THETA.min(axis=0)).all()
        assert (highest > THETA.max(axis=0)).all()
        assert (highest - lowest < 0.2).all()
        assert ((fitted.samples_.theta >= lowest) & (fitted.samples_.theta <= highest)).all()
        assert len(fitted.samples_.theta) == 400

    def test_estimates_and_round_trip_become_more_accurate(self):
        wide, narrow = inverse().fit(MEASURED), inverse(narrow_bounds=True).fit(MEASURED)
        assert error(narrow) < 0.1 * error(wide)
        assert np.abs(narrow.round_trip()).max() < 0.1 * np.abs(wide.round_trip()).max()

    def test_it_stays_within_the_bounds(self):
        fitted = inverse(bounds=0.02, narrow_bounds=True).fit(MEASURED)
        assert (np.abs(fitted.samples_.theta - 1) <= 0.02).all()

    def test_gaps_and_a_few_wrong_records_do_not_matter(self):
        damaged = MEASURED.copy()
        damaged[::7, 2] = np.nan
        damaged[3] *= 1.3
        kept = ~np.isnan(damaged).any(axis=1)
        expected = inverse(narrow_bounds=True).fit(damaged[kept][1:]).box_.bounds
        np.testing.assert_allclose(inverse(narrow_bounds=True).fit(damaged).box_.bounds, expected, atol=0.03)

    def test_refined_estimates_do_not_depend_on_it(self):
        settings = {"refine": None, "noise": 0.005}
        wide, narrow = (inverse(narrow_bounds=n, **settings).fit(MEASURED).transform(MEASURED) for n in (False, True))
        np.testing.assert_allclose(narrow, wide, rtol=1e-5)

    @pytest.mark.parametrize("records", [None, MEASURED[:1], np.full((5, 6), np.nan)])
    def test_it_needs_records(self, records):
        with pytest.raises(ValueError, match=r"fit got [01] records with all modes; expected at least 2"):
            inverse(narrow_bounds=True).fit(records)


class TestRoundTrip:
    def test_it_is_what_inversion_and_solution_leave(self):
        fitted = inverse().fit()
        nominal = TRUSS.frequencies(np.ones((1, 4)))
        expected = TRUSS.frequencies(fitted.transform(nominal)) / nominal - 1
        np.testing.assert_allclose(fitted.round_trip(), expected[0])
        assert np.abs(fitted.round_trip()).max() > 1e-6

    def test_refined_it_vanishes(self):
        assert np.abs(inverse(refine=None).fit().round_trip()).max() < 1e-8

    def test_a_box_without_the_nominal_state_has_its_nearest_one(self):
        fitted = inverse(bounds=[[1.1, 1.3]] * 4).fit()
        nearest = TRUSS.frequencies(np.full((1, 4), 1.1))
        expected = TRUSS.frequencies(fitted.transform(nearest)) / nearest - 1
        np.testing.assert_allclose(fitted.round_trip(), expected[0])

    def test_without_a_model_there_is_none(self):
        fitted = InverseSurrogate(regressor=LinearRegression()).fit(MEASURED, THETA)
        with pytest.raises(ValueError, match="has no model"):
            fitted.round_trip()

    def test_the_chain_reports_it_and_warns_where_records_scatter_less(self):
        air = np.random.default_rng(1).uniform(-5, 30, (300, 1))
        healthy = TRUSS.frequencies(1 - 0.002 * (air - 10) * np.ones(4))
        linear = TemperatureMapper(LinearRegression())
        bad = InverseSurrogate(regressor=KNeighborsRegressor(), n_samples=100, refine=0, bounds=0.2)
        with pytest.warns(UserWarning, match=r"'f\d' .*round-trip-error"):
            rough = DataInformedFEM(TRUSS, inverse=bad, mapper=linear, random_state=0).fit(air, healthy)
        np.testing.assert_allclose(rough.report_.round_trip, 100 * rough.inverse_.round_trip())
        fine = DataInformedFEM(TRUSS, mapper=linear, random_state=0).fit(air, healthy)
        assert fine.report_.round_trip.abs().max() < 1e-4
        assert "round trip (%)" in repr(fine.report_)
