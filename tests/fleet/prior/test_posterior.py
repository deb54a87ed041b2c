"""Posterior, evidence and expectation maximisation against dense computations and simulated bridges."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.stats import multivariate_normal

from skthermo.fleet.prior._families import Member, learn_families
from skthermo.fleet.prior._information import FleetBasis, Information, RowNoise
from skthermo.fleet.prior._posterior import CoefficientPosterior, CoefficientPrior, OwnPrior, mixture
from skthermo.fleet.prior._prior import left_out
from skthermo.fleet.prior._records import BridgeRecords

FUNCTIONS = 3


def random_prior(random, n_outputs=2):
    roots = np.tril(random.normal(size=(n_outputs, FUNCTIONS, FUNCTIONS)))
    return CoefficientPrior(random.normal(size=(n_outputs, FUNCTIONS)), roots)


def dense(prior):
    """Mean and covariance of all coefficients."""
    n_outputs = len(prior.mean)
    covariance = np.zeros((n_outputs, FUNCTIONS, n_outputs, FUNCTIONS))
    for i, root in enumerate(prior.root):
        covariance[i, :, i] = root @ root.T
    return prior.mean.ravel(), covariance.reshape(2 * (n_outputs * FUNCTIONS,))


def linear_data(random, n_rows=40, gaps=0.0):
    """Rows X (a constant first), outputs with noise of full covariance, and their records."""
    X = np.column_stack([np.ones(n_rows), random.normal(size=(n_rows, FUNCTIONS))])
    root = np.array([[0.5, 0.0], [0.3, 0.4]])
    y = X @ random.normal(size=(1 + FUNCTIONS, 2)) + random.normal(size=(n_rows, 2)) @ root.T
    y[random.random(y.shape) < gaps] = np.nan
    weights = random.uniform(0.5, 2, n_rows)
    return X, y, root @ root.T, BridgeRecords(X[:, 1:], y, ["a", "b"], weights)


@pytest.mark.parametrize("gaps", [0.0, 0.3])
def test_posterior_is_that_of_all_rows_at_once(gaps):
    random = np.random.default_rng(0)
    X, y, S, records = linear_data(random, gaps=gaps)
    prior, memory = random_prior(random), 1.7
    noise = RowNoise(S, memory, np.ones(len(y)))
    centre = X[:, 1:].mean(axis=0)
    found = Information.given(noise, records, X - np.append(0, centre), y, np.zeros(2), centre)
    state = CoefficientPosterior(found.J, found.h, *prior)

    mean, covariance = dense(prior)  # now the same with levels of huge variance, as one regression on all values
    whole = np.zeros((2, 1 + FUNCTIONS, 2, 1 + FUNCTIONS))
    whole[:, 0, :, 0] = 1e8 * np.eye(2)
    whole[:, 1:, :, 1:] = covariance.reshape(2, FUNCTIONS, 2, FUNCTIONS)
    size = 2 * (1 + FUNCTIONS)
    prior_precision = np.linalg.inv(whole.reshape(size, size))
    prior_mean = np.column_stack([np.zeros(2), mean.reshape(2, -1)]).ravel()
    precision, right = prior_precision.copy(), prior_precision @ prior_mean
    for x, row, weight in zip(X, y, records.weights, strict=True):
        known = ~np.isnan(row)
        design = np.kron(np.eye(2), x)[known]
        P = np.linalg.inv(S[np.ix_(known, known)]) * weight / memory
        precision += design.T @ P @ design
        right += design.T @ P @ row[known]
    expected = np.linalg.inv(precision)
    slopes = np.ones((2, 1 + FUNCTIONS), dtype=bool)
    slopes[:, 0] = False
    slopes = slopes.ravel()
    assert_allclose(state.mean, (expected @ right)[slopes], rtol=1e-5)
    assert_allclose(state.covariance, expected[np.ix_(slopes, slopes)], rtol=1e-5, atol=1e-9)
    level = found.level - found.gain @ state.mean - state.mean.reshape(2, -1) @ centre
    assert_allclose(level, (expected @ right)[~slopes], rtol=1e-5)


def test_evidences_differ_as_likelihoods_of_the_rows():
    """Up to a constant of the records, and where no level is free."""
    random = np.random.default_rng(1)
    X = random.normal(size=(9, 2 * FUNCTIONS))
    y = random.normal(size=9)
    logs, expected = [], []
    for _ in range(3):
        prior = random_prior(random)
        logs.append(CoefficientPosterior(X.T @ X, X.T @ y, *prior).evidence)
        mean, covariance = dense(prior)
        expected.append(multivariate_normal(X @ mean, X @ covariance @ X.T + np.eye(9)).logpdf(y))
    assert_allclose(np.diff(logs), np.diff(expected))


def test_a_mixture_averages_over_what_is_followed():
    random = np.random.default_rng(2)
    fleet, own = random_prior(random), random_prior(random)
    A = random.normal(size=(12, 2 * FUNCTIONS))
    J, h = A.T @ A, A.T @ random.normal(size=12)
    found = mixture(J, h, ["a", "b"], fleet, own, {"a": 0.9, "b": 0.6})
    parts = []
    for a in (True, False):
        for b in (True, False):
            rows = np.array([a, b])[:, np.newaxis]
            usual, atypical = (0.9 if a else 0.1) * (0.6 if b else 0.4), (0.2 if a else 0.8) * (0.2 if b else 0.8)
            chance = 0.95 * usual + 0.05 * atypical
            mean = np.where(rows, fleet.mean, own.mean)
            state = CoefficientPosterior(J, h, mean, np.where(rows[..., np.newaxis], fleet.root, own.root))
            parts.append((chance * np.exp(state.evidence - found.evidence), state, a))
    shares = np.array([share for share, _, _ in parts])
    assert_allclose(shares.sum(), 1)
    mean = sum(share * state.mean for share, state, _ in parts)
    second = sum(share * (state.covariance + np.outer(state.mean, state.mean)) for share, state, _ in parts)
    assert_allclose(found.mean, mean)
    assert_allclose(found.covariance, second - np.outer(mean, mean), atol=1e-12)
    assert_allclose(found.follows["a"], sum(share for share, _, a in parts if a))


def simulated(random, n_bridges, mu, Sigma, information=50.0):
    """Members of one family that know their coefficients differently well."""
    own = CoefficientPrior(np.zeros((1, FUNCTIONS)), 3 * np.eye(FUNCTIONS)[np.newaxis])
    members, truth = [], random.multivariate_normal(mu, Sigma, n_bridges)
    for b in truth:
        J = np.diag(information * random.uniform(0.1, 2, FUNCTIONS))
        h = J @ (b + random.normal(size=FUNCTIONS) / np.sqrt(np.diag(J)))
        zero = np.zeros(1)
        found = Information(
            J, h, zero, zero, np.zeros((1, FUNCTIONS)), np.ones((1, 1)), RowNoise(np.eye(1), 1.0, zero), zero
        )
        members.append(Member(found, ["g"], np.ones(1), np.zeros((1, 1)), own))
    return members


def test_expectation_maximisation_finds_mean_and_covariance():
    random = np.random.default_rng(3)
    mu = np.array([1.0, -2.0, 0.5])
    Sigma = np.array([[0.5, 0.2, 0.0], [0.2, 0.3, -0.1], [0.0, -0.1, 0.2]])
    family = learn_families(simulated(random, 800, mu, Sigma), ["g"], {})["g"]
    assert_allclose(family.M[0], mu, atol=0.1)
    assert_allclose(family.Sigma, Sigma, atol=0.05)


@pytest.mark.one_case
@pytest.mark.parametrize("n_bridges", [4, 12])
def test_other_bridges_of_the_family_are_within_its_bands(n_bridges):
    random = np.random.default_rng(4)
    mu, Sigma = np.zeros(FUNCTIONS), np.diag([1.0, 0.1, 0.01])
    inside = []
    for _ in range(80):
        family = learn_families(simulated(random, n_bridges, mu, Sigma), ["g"], {})["g"]
        mean, covariance = family.predictive(np.ones(1), np.zeros((1, 1)))
        directions = random.normal(size=(30, FUNCTIONS))
        errors = np.einsum("ij,ij->i", directions, random.multivariate_normal(mu, Sigma, 30) - mean)
        deviations = np.sqrt(np.einsum("ij,jk,ik->i", directions, covariance, directions))
        inside.append(np.abs(errors) < 1.645 * deviations)
    assert 0.85 <= np.mean(inside) <= 0.97


def test_a_fleet_of_atypical_bridges_by_weight_is_left_out():
    random = np.random.default_rng(5)
    members = simulated(random, 40, np.zeros(FUNCTIONS), 0.1 * np.eye(FUNCTIONS))
    atypical = simulated(random, 5, np.full(FUNCTIONS, 50.0), np.eye(FUNCTIONS))
    follows = {(i, "g"): 0.0 for i in range(40, 45)}
    family = learn_families([*members, *atypical], ["g"], follows)["g"]
    assert_allclose(family.M, learn_families(members, ["g"], {})["g"].M, atol=0.01)


def test_a_shape_is_learned_and_not_the_response():
    random = np.random.default_rng(6)
    shape = np.array([1.0, 1e-2, 1e-4])
    b = random.normal(size=(60, FUNCTIONS)) * np.sqrt(shape) * random.choice([0.5, 2], (60, 1))
    J = [1e6 * np.eye(FUNCTIONS)] * 60
    own = OwnPrior.of(J, list(1e6 * b), [["g"]] * 60, FUNCTIONS)
    found = own.shape / own.shape[0]
    assert 0.003 < found[1] < 0.03
    assert found[2] < found[1]


def test_basis_goes_on_straight_beyond_the_fleet():
    T = np.random.default_rng(7).normal(10, 8, (500, 2))
    basis = FleetBasis.of(T, 4)
    far = basis.steady(np.array([80.0, 90.0, 100.0]))
    assert_allclose(np.diff(far, n=2, axis=0), 0, atol=1e-9)
    assert np.abs(np.diff(far, axis=0)).max() > 0


def test_a_bridge_that_is_left_out_has_no_say():
    random = np.random.default_rng(8)
    members = simulated(random, 4, np.zeros(FUNCTIONS), 0.01 * np.eye(FUNCTIONS), information=1e4)
    odd = simulated(random, 1, np.full(FUNCTIONS, 2.0), 1e-6 * np.eye(FUNCTIONS), information=1e4)
    everybody = [*members, *odd]
    found = left_out(everybody, ["g"], {}, learn_families(everybody, ["g"], {}), {"g": 0.5})[-1]
    prior = odd[0].prior(learn_families(members, ["g"], {}), predictive=True)
    expected = CoefficientPosterior(odd[0].information.J, odd[0].information.h, *prior).evidence
    assert_allclose(found.with_family["g"], expected, atol=3)
