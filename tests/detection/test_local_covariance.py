"""Which records tell the covariance in some weather, and how much."""

import pickle
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from skthermo.residuals.gaussian import Gaussian
from skthermo.residuals.spread import CANDIDATES, History, LocalCovariance, Smoothing, whitened
from skthermo.residuals.weather import NearestPlaces, mean_of_nearest, nearest
from tests.detection.test_whitening import FROZEN, THAWED, X, compensator


@pytest.fixture(scope="module")
def history():
    residuals, places = compensator(None).fit_transform(X).to_numpy(), X[["T1"]].to_numpy()
    return History(np.arange(len(X)), places, residuals, Gaussian.fitted(residuals))


def test_neighbours_are_the_nearest_in_weather_that_are_not_near_in_time(history):
    row, size = 700, 60
    far = np.flatnonzero(np.abs(history.order - row) >= 24)
    expected = far[np.argsort(np.abs(history.places[far, 0] - history.places[row, 0]), kind="stable")[:size]]
    found = history.neighbours(size, history.places[[row]], order=history.order[[row]])
    assert set(found.rows[found.counted]) == set(expected)
    anywhere = history.neighbours(size, history.places[[row]])
    assert row in anywhere.rows[anywhere.counted]
    assert anywhere.counted.sum() == size
    own = history.neighbours(size, order=history.order)
    assert set(own.rows[row, own.counted[row]]) == set(expected)


def test_standard_deviations_are_those_of_the_neighbours_drawn_to_those_of_all(history):
    row, size, pseudo = 700, 60, 7
    covariance = LocalCovariance(history, Smoothing(size, pseudo))
    near = history.neighbours(size, history.places[[row]])
    squares = (history.residuals[near.rows[0]] - history.overall.mean) ** 2
    expected = (squares.sum(axis=0) + pseudo * np.diag(history.overall.covariance)) / (size + pseudo)
    np.testing.assert_allclose(np.diag(covariance(near)[0]), expected, rtol=1e-10)


@pytest.mark.parametrize("size", [50, 100])
def test_correlations_follow_the_weather_too(history, size):
    at = history.neighbours(size, np.array([[-8.0], [8.0]]))
    for found, spread in zip(LocalCovariance(history, Smoothing(size, 5))(at), (FROZEN, THAWED), strict=True):
        true = spread @ spread.T
        correlations = [c[0, 1] / np.sqrt(c[0, 0] * c[1, 1]) for c in (found, true)]
        assert correlations[0] == pytest.approx(correlations[1], abs=0.25)


def test_a_burst_of_wild_records_does_not_whiten_itself(history):
    burst = np.arange(700, 724)
    wild = replace(history, residuals=history.residuals.copy())
    wild.residuals[burst] += [20.0, -20.0]
    near = history.neighbours(100, history.places[burst], order=burst)
    covariances = [LocalCovariance(one, Smoothing(100, 5))(near) for one in (wild, history)]
    deviations = [np.sqrt(np.einsum("ijj->ij", covariance)) for covariance in covariances]
    np.testing.assert_allclose(*deviations, rtol=1e-10)
    white = whitened(wild.residuals[burst], wild.overall, covariances[0])[0]
    assert (np.linalg.norm(white, axis=1) > 50).all()


def test_the_smoothing_is_the_likeliest_for_records_that_were_left_out(history):
    def likelihood(smoothing):
        covariances = history.overall.covariance[np.newaxis].repeat(len(X), axis=0)
        if smoothing:
            covariances = LocalCovariance(history, smoothing).at(history.places, history.order)
        centred = history.residuals - history.overall.mean
        pairs = zip(centred[:200], covariances[:200], strict=True)
        densities = sum(multivariate_normal.logpdf(row, [0, 0], covariance) for row, covariance in pairs)
        found = whitened(history.residuals[:200], history.overall, covariances[:200])[1]
        assert found == pytest.approx(densities + 200 * np.log(2 * np.pi), rel=1e-10)
        return whitened(history.residuals, history.overall, covariances)[1]

    assert history.likeliest().smoothing == max([None, *CANDIDATES], key=likelihood)


@pytest.mark.parametrize("n_dimensions", [1, 3, 20])
def test_no_place_is_searched_for_twice(n_dimensions, monkeypatch):
    random = np.random.default_rng(0)
    places, wanted = random.normal(size=(300, n_dimensions)), random.normal(size=(200, n_dimensions))
    searched = NearestPlaces(places, 7)
    counts, search = [], type(searched._tree).kneighbors
    monkeypatch.setattr(type(searched._tree), "kneighbors", lambda tree, X: counts.append(len(X)) or search(tree, X))
    tables = [wanted[:100], wanted, wanted[::-1], np.vstack([wanted[:3], random.normal(size=(2, n_dimensions))])]
    for table, n_new in zip(tables, [100, 100, 0, 2], strict=True):
        counts.clear()
        found = searched.of(table)
        assert sum(counts) == n_new
        distances, near = nearest(places, table, 7)
        np.testing.assert_allclose(found[0], distances.mean(axis=1), rtol=1e-12)
        np.testing.assert_array_equal(found[1], near)
    assert len(pickle.dumps(searched)) < places.nbytes + 1000
    counts.clear()
    np.testing.assert_array_equal(pickle.loads(pickle.dumps(searched)).of(wanted)[1], searched.of(wanted)[1])
    assert counts == [len(wanted)]


def test_what_is_kept_of_searches_is_bounded(monkeypatch):
    monkeypatch.setattr("skthermo.residuals.weather.MOST_KEPT", 50)
    places = np.arange(20.0)[:, np.newaxis]
    searched = NearestPlaces(places, 5)
    for first in (0.1, 0.2, 0.3):
        wanted = places[:8] + first
        for _ in range(2):
            np.testing.assert_array_equal(searched.of(wanted)[1], nearest(places, wanted, 5)[1])
    assert searched._kept[2].size == 40


@pytest.mark.parametrize("number", [1, 7, 200])
def test_means_of_the_nearest_places_are_those_of_all_distances_whatever_is_missing(number):
    random = np.random.default_rng(0)
    places, wanted, values = (random.normal(size=shape) for shape in ((150, 2), (40, 2), (150, 5)))
    used = random.random(values.shape) < [1, 0.9, 0.5, 0.1, 0]
    used[:, 2] &= places[:, 0] > 0  # missing in all the weather on one side
    found = mean_of_nearest(places, np.where(used, values, np.nan), used, wanted, number)
    assert np.isnan(found[:, 4]).all()
    for row, place in enumerate(wanted):
        order = np.argsort(((places - place) ** 2).sum(axis=1))
        for column in range(4):
            nearest_used = order[used[order, column]][:number]
            np.testing.assert_allclose(found[row, column], values[nearest_used, column].mean(), rtol=1e-12)
