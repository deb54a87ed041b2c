"""Evidence of explanations: closed forms, numerical integration, and invariances."""

from dataclasses import replace
from functools import partial
from itertools import combinations

import numpy as np
import pytest
from scipy import integrate, stats
from scipy.special import logsumexp
from scipy.stats import multivariate_normal, multivariate_t

from skthermo.studies import DamagePrior
from skthermo.studies.identification._causes import Cause
from skthermo.studies.identification._curves import Observed, student_scales
from skthermo.studies.identification._evidence import (
    Posterior,
    Scale,
    all_sets,
    draws,
    explanations,
    log_probability,
    refine,
    screen,
    total,
)

ONLY = DamagePrior(model_error=0, something_else=0)


def linear(slopes):
    """Effects that are proportional to the amounts."""
    return lambda amounts: (amounts @ slopes.T, np.broadcast_to(slopes, (*np.shape(amounts)[:-1], *slopes.shape)))


def bent(slopes):
    """Effects that grow faster than the amounts, with products of two."""

    def effects(amounts):
        change = amounts @ slopes.T
        return change - change**2, slopes * (1 - 2 * change)[..., np.newaxis]

    return effects


def scale_of(effects, measured, covariance, prior=ONLY, freedom=np.inf, names="abc"):
    causes = [Cause(name) for name in names]
    return Scale.of(Observed.of([(measured, covariance, freedom)], prior.model_error), effects, causes, prior)


@pytest.fixture
def problem():
    random = np.random.RandomState(0)
    slopes, root = random.standard_normal((5, 3)), random.standard_normal((5, 5))
    covariance = 0.05**2 * (root @ root.T + np.eye(5))
    return slopes, slopes @ [0.15, 0.0, 0.05] + 0.05 * random.standard_normal(5), covariance


def weigh(scale, sets):
    log_priors = [0.0] * len(sets)
    return refine(scale, screen(scale, sets, log_priors), log_priors)


def log_evidence(scale, causes):
    """Of what was measured in its own units."""
    return total(scale, weigh(scale, [causes])[0]) + np.linalg.slogdet(scale.observed.rotation)[1]


def of(problem, **options):
    slopes, measured, covariance = problem
    return scale_of(linear(slopes), measured, covariance, **options)


@pytest.mark.parametrize("size", [1, 2, 3])
def test_probability_of_bounds(size):
    random, below = np.random.RandomState(size), partial(multivariate_normal.cdf, abseps=1e-7, releps=1e-7)
    for _ in range(3):
        root, mean = random.standard_normal((size, size)), random.standard_normal(size)
        covariance, ends = root @ root.T + 0.3 * np.eye(size), np.array([-0.3, 2.0])
        corners = np.array(np.meshgrid(*[ends] * size)).reshape(size, -1).T
        expected = sum((-1) ** (corner == ends[0]).sum() * below(corner, mean, covariance) for corner in corners)
        arrays = mean, covariance, np.full(size, ends[0]), np.full(size, ends[1])
        found = log_probability(*(array[np.newaxis] for array in arrays))[0]
        assert found == pytest.approx(np.log(expected), abs=2e-3)
        values, logs = draws(*(np.repeat(a[np.newaxis], 20_000, axis=0) for a in arrays), random)
        assert ((values >= ends[0]) & (values <= ends[1])).all()
        assert logsumexp(logs) - np.log(len(logs)) == pytest.approx(np.log(expected), abs=0.03)


def test_bounds_far_in_the_tail():
    arrays = np.array([[-30.0]]), np.array([[[1.0]]]), np.array([[0.0]]), np.array([[1.0]])
    assert log_probability(*arrays)[0] == pytest.approx(stats.norm.logsf(30.0), rel=1e-6)


@pytest.mark.parametrize("freedom", [1.0, 3.0, 30.0, 1e4])
def test_normal_laws_mix_to_students(freedom):
    scales, logs = student_scales(freedom, 4)
    points = np.array([[0.0, 0, 0, 0], [1, -1, 0.5, 2], [3, 1, 0, -2]])
    normal = [multivariate_normal(np.zeros(4), np.eye(4) / scale).logpdf(points) for scale in scales]
    expected = multivariate_t(np.zeros(4), np.eye(4), freedom).logpdf(points)
    np.testing.assert_allclose(logsumexp(np.array(normal) + logs[:, np.newaxis], axis=0), expected, atol=5e-3)


@pytest.mark.parametrize("freedom", [np.inf, 5.0])
@pytest.mark.parametrize("law", ["half-normal", "uniform"])
def test_evidence_is_the_integral_over_amounts(problem, law, freedom):
    """Brute force in one and two dimensions."""
    slopes, measured, covariance = problem
    scale = of(problem, prior=replace(ONLY, law=law), freedom=freedom)
    known = (
        multivariate_normal(np.zeros(5), covariance)
        if np.isinf(freedom)
        else multivariate_t(np.zeros(5), covariance, freedom)
    )
    nodes, weights = np.polynomial.legendre.leggauss(120)
    end = 0.95 if law == "half-normal" else 0.2
    nodes, weights = end * (nodes + 1) / 2, end * weights / 2
    density = stats.norm(0, 0.2).pdf(nodes) / (stats.norm(0, 0.2).cdf(0.95) - 0.5) if law == "half-normal" else 1 / end
    weights = weights * density
    for causes in [(0,), (1,), (2,), (0, 1), (0, 2), (1, 2)]:
        grids = np.stack(np.meshgrid(*[nodes] * len(causes), indexing="ij"), axis=-1)
        likelihood = known.pdf(measured - grids @ slopes[:, list(causes)].T)
        for _ in causes:
            likelihood = likelihood @ weights
        assert log_evidence(scale, causes) == pytest.approx(np.log(likelihood), abs=2e-3)
    assert log_evidence(scale, ()) == pytest.approx(known.logpdf(measured), abs=5e-3)


def test_evidence_of_bent_effects(problem):
    slopes, _, covariance = problem
    effects = bent(slopes)
    scale = scale_of(effects, effects(np.array([0.15, 0.0, 0.05]))[0], covariance, names="abc")
    known, prior = multivariate_normal(np.zeros(5), covariance), stats.norm(0, 0.2)

    def integrand(amount):
        at = effects(np.array([amount, 0.0, 0.0]))[0]
        return known.pdf(effects(np.array([0.15, 0.0, 0.05]))[0] - at) * prior.pdf(amount) / (prior.cdf(0.95) - 0.5)

    expected = integrate.quad(integrand, 0, 0.95, limit=200)[0]
    assert log_evidence(scale, (0,)) == pytest.approx(np.log(expected), abs=0.05)


def test_bayes_factor_of_a_nested_model(problem):
    """Far from the bounds: the Savage-Dickey ratio of a normal law."""
    slopes, _, covariance = problem
    measured = slopes[:, 0] * 0.4
    scale = scale_of(linear(slopes), measured, 1e-2 * covariance, names="abc")
    with_it, without = (total(scale, weight) for weight in weigh(scale, [(0,), ()]))
    precision = slopes[:, 0] @ np.linalg.solve(1e-2 * covariance, slopes[:, 0]) + 0.2**-2
    mean = slopes[:, 0] @ np.linalg.solve(1e-2 * covariance, measured) / precision
    at_zero = stats.norm(mean, precision**-0.5).logpdf(0), stats.norm(0, 0.2).logpdf(0)
    inside = np.log(stats.norm.cdf(0.95 / 0.2) - 0.5)
    assert with_it - without == pytest.approx(at_zero[1] - at_zero[0] - inside, abs=1e-3)


def posterior_of(scale, seed=0):
    return Posterior.of(scale, *explanations(scale), np.random.RandomState(seed))


def by_causes(posterior):
    return {frozenset(one.causes): one.probability for one in posterior.explanations}


def test_probabilities_do_not_depend_on_order_or_units(problem):
    slopes, measured, covariance = problem
    prior = DamagePrior(model_error=0.03)
    expected = by_causes(posterior_of(of(problem, prior=prior)))
    assert sum(expected.values()) == pytest.approx(1, abs=1e-3)
    modes, order = [3, 0, 4, 1, 2], [2, 0, 1]
    turned = scale_of(
        linear(slopes[np.ix_(modes, order)]), measured[modes], covariance[np.ix_(modes, modes)], prior, names="cab"
    )
    for causes, probability in by_causes(posterior_of(turned)).items():
        assert probability == pytest.approx(expected[causes], rel=1e-3, abs=1e-5)


def test_an_unobservable_cause_keeps_its_prior_probability():
    slopes = np.array([[1.0, 0.0], [0.5, 0.0], [-0.3, 0.0]])
    posterior = posterior_of(scale_of(linear(slopes), 0.2 * slopes[:, 0], 1e-4 * np.eye(3), names="ab"))
    one, two = (ONLY.numbers[number] for number in (1, 2))
    assert posterior.probability_of("a") == pytest.approx(1, abs=1e-6)
    assert posterior.probability_of("b") == pytest.approx(two / (one / 2 + two), abs=1e-3)
    alone = next(one for one in posterior.explanations if one.causes == ("a", "b"))
    assert alone.draws[:, 1].mean() == pytest.approx(0.2 * np.sqrt(2 / np.pi), rel=0.1)


def test_draws_follow_the_law_of_the_amounts(problem):
    slopes, measured, covariance = problem
    posterior = posterior_of(of(problem, prior=replace(ONLY, numbers=(0.0, 1.0))))
    one = next(one for one in posterior.explanations if one.causes == ("c",))
    precision = slopes[:, 2] @ np.linalg.solve(covariance, slopes[:, 2]) + 0.2**-2
    mean = slopes[:, 2] @ np.linalg.solve(covariance, measured) / precision
    law = stats.truncnorm((0 - mean) * precision**0.5, (0.95 - mean) * precision**0.5, mean, precision**-0.5)
    assert one.draws.mean() == pytest.approx(law.mean(), abs=5 * law.std() / np.sqrt(len(one.draws)))
    assert one.draws.std() == pytest.approx(law.std(), rel=0.15)
    table = posterior.table([Cause(name) for name in "abc"])
    assert table["probability"].sum() == pytest.approx(1)
    assert (table["ci_low"] <= table["severity"]).all()
    drawn = posterior.drawn(["a", "b", "c"], 2000, np.random.RandomState(0))
    np.testing.assert_allclose((drawn > 0).mean(axis=0), table["probability"], atol=0.04)


def test_posteriors_average_over_models(problem):
    slopes, measured, covariance = problem
    both = [posterior_of(scale_of(linear(factor * slopes), measured, covariance, names="abc")) for factor in (1, 2)]
    mean = Posterior.mean(both)
    for cause in "abc":
        expected = np.mean([one.probability_of(cause) for one in both])
        assert mean.probability_of(cause) == pytest.approx(expected)
    severities = np.mean([one.table([Cause(name) for name in "abc"])["severity"] for one in both], axis=0)
    np.testing.assert_allclose(
        mean.table([Cause(name) for name in "abc"])["severity"], severities, rtol=0.05, atol=1e-3
    )


def test_the_best_sets_of_many_causes_are_found():
    """40 causes: triples are 9,880, and only those that extend good pairs are weighed."""
    random = np.random.RandomState(0)
    slopes = random.standard_normal((10, 40))
    slopes /= np.linalg.norm(slopes, axis=0)
    truth = [3, 17, 31]
    names = [f"g{i}" for i in range(40)]
    scale = scale_of(linear(slopes), slopes[:, truth] @ [0.2, 0.15, 0.3], 1e-6 * np.eye(10), names=names)
    found, log_priors = all_sets(scale)
    assert len(found) < 1 + 40 + 780 + 5000
    assert len({weight.causes for weight in found}) == len(found)
    best = found[int(np.argmax([total(scale, weight) + p for weight, p in zip(found, log_priors, strict=True)]))]
    assert list(best.causes) == truth
    assert {weight.causes for weight in found} >= set(combinations(range(40), 2))


def test_the_model_error_lowers_what_a_misfit_says():
    """Effects 10 % wrong: with the model's error the true cause stays the explanation."""
    random = np.random.RandomState(0)
    slopes = -np.abs(random.standard_normal((6, 5)))
    wrong = slopes * np.exp(0.1 * random.standard_normal(slopes.shape))
    measured = wrong[:, 0] * 0.15
    exact, allowing = (
        posterior_of(scale_of(linear(slopes), measured, 1e-7 * np.eye(6), prior, names="abcde"))
        for prior in (ONLY, DamagePrior(model_error=0.05))
    )
    assert exact.probability_of("a") > 0.9
    assert by_causes(exact).get(frozenset("a"), 0.0) < 0.01
    assert by_causes(allowing)[frozenset("a")] > 0.5
