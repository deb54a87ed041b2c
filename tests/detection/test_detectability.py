"""How tests are joined, and which damage they find."""

import numpy as np
import pytest
from scipy.stats import norm

from skthermo.detection._directional import Detectability, JoinedTests, Tail


def test_each_test_has_its_share_of_the_false_alarms():
    random = np.random.RandomState(0)
    cone, omnibus = np.sqrt(random.chisquare(2, 400_000)), np.sqrt(random.chisquare(8, 400_000))
    tests = JoinedTests.of(cone, omnibus, 0.2)
    joined = tests(cone, omnibus)
    threshold = np.quantile(joined, 0.98)
    by_cone, by_omnibus = (cone > threshold).mean(), (tests(np.zeros_like(cone), omnibus) > threshold).mean()
    assert by_cone == pytest.approx(0.016, rel=0.15)
    assert by_omnibus == pytest.approx(0.004, rel=0.4)
    assert tests(cone[:5], omnibus[:5] + 3) == pytest.approx(np.maximum(tests(cone[:5], omnibus[:5] + 3), joined[:5]))
    assert JoinedTests.of(cone, omnibus, 0.0)(cone, omnibus) is cone
    assert JoinedTests.of(cone, omnibus, 1.0)(cone, omnibus) is omnibus


def test_one_direction_is_found_as_a_one_sided_normal_test_says():
    only = JoinedTests(Tail(0.0, 1.0), Tail(0.0, 1.0), 0.0)
    found = Detectability(only, np.array([[20.0], [0.0]]), ["one"], threshold=2.0, largest=1.0)
    losses = np.array([0.0, 0.05, 0.1, 0.2])
    assert found.pod(losses)["one"].to_numpy() == pytest.approx(norm.cdf(20 * losses - 2), abs=0.03)
    assert found.smallest(0.9)["one"] == pytest.approx((2 + norm.ppf(0.9)) / 20, abs=0.005)
    assert Detectability(only, np.array([[0.1], [0.0]]), ["one"], 2.0, 1.0).smallest(0.9)["one"] == np.inf
    given = Detectability(only, np.array([[0.1], [0.0]]), ["one"], 2.0, np.inf)
    assert given.smallest(0.9)["one"] == pytest.approx((2 + norm.ppf(0.9)) / 0.1, rel=0.02)
