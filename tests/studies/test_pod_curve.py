"""Curves of the probability of detection, against statsmodels and closed forms, and intervals of rates."""

import warnings

import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.special import expit, logit
from scipy.stats import beta, norm

from skthermo.studies import pod_curve
from skthermo.studies._rates import clopper_pearson, rate_of

SEVERITIES = np.array([0.1, 0.15, 0.2, 0.25, 0.3])
DETECTED = np.array([9.0, 21.0, 33.0, 38.0, 40.0])
RECORDS = np.full(5, 40.0)


@pytest.mark.nightly
@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize("records", [RECORDS, RECORDS * [0.31, 0.7, 0.55, 1.0, 0.93]])
def test_agrees_with_a_generalised_linear_model(log, records):
    api = pytest.importorskip("statsmodels.api")
    x = np.log(SEVERITIES) if log else SEVERITIES
    detected = DETECTED / RECORDS * records
    fitted = api.GLM(
        np.column_stack([detected, records - detected]), api.add_constant(x), family=api.families.Binomial()
    )
    fitted = fitted.fit(tol=1e-12)
    curve = pod_curve(SEVERITIES, detected, records, log=log)
    np.testing.assert_allclose([curve.intercept, curve.slope], fitted.params, rtol=1e-6)
    np.testing.assert_allclose(curve.covariance, fitted.cov_params(), rtol=1e-5)
    grid = np.linspace(0.1, 0.5, 400_001)
    design = api.add_constant(np.log(grid) if log else grid)
    lower = design @ fitted.params - norm.ppf(0.95) * np.sqrt(
        np.einsum("ij,jk,ik->i", design, fitted.cov_params(), design)
    )
    assert curve.a90 == pytest.approx(grid[np.argmax(design @ fitted.params >= logit(0.9))], abs=1e-5)
    assert curve.a90_95 == pytest.approx(grid[np.argmax(lower >= logit(0.9))], abs=1e-5)


@pytest.mark.parametrize("log", [False, True])
def test_a_bound_reaches_the_level_where_severity_at_says(log):
    curve = pod_curve(SEVERITIES, DETECTED, RECORDS, log=log, confidence=0.9)
    pod, lowest, highest = curve.predict([curve.a90, curve.a90_95, curve.severity_at(0.9, confidence=0.05)])
    assert pod[0] == pytest.approx(0.9)
    assert lowest[1] == pytest.approx(0.9)  # two-sided 90 % bounds are one-sided 95 % bounds
    assert highest[2] == pytest.approx(0.9)
    assert curve.a50 < curve.a90 < curve.a90_95


def test_two_severities_are_fitted_exactly():
    curve = pod_curve([0.1, 0.3], [10, 90], [100, 100])
    assert curve.a50 == pytest.approx(np.sqrt(0.1 * 0.3))
    np.testing.assert_allclose(curve.predict([0.1, 0.3])[0], [0.1, 0.9])
    variances = 1 / (100 * 0.09) + np.zeros(2)  # of both logits
    assert curve.covariance[1, 1] == pytest.approx(variances.sum() / np.log(3) ** 2)


def test_strengthening_is_the_mirror_image_of_damage():
    curve, mirrored = (pod_curve(sign * SEVERITIES, DETECTED, RECORDS) for sign in (1, -1))
    assert mirrored.a90_95 == -curve.a90_95
    np.testing.assert_array_equal(mirrored.predict(-SEVERITIES), curve.predict(SEVERITIES))


def test_order_scale_and_severities_without_records_do_not_matter():
    curve = pod_curve(SEVERITIES, DETECTED, RECORDS)
    shuffled = pod_curve([0.9, *SEVERITIES[::-1]], [0, *DETECTED[::-1]], [0, *RECORDS[::-1]])
    assert (shuffled.a90, shuffled.a90_95) == pytest.approx((curve.a90, curve.a90_95))
    more = pod_curve(SEVERITIES, 4 * DETECTED, 4 * RECORDS)
    assert more.a90 == pytest.approx(curve.a90)
    np.testing.assert_allclose(4 * more.covariance, curve.covariance)


@pytest.mark.parametrize(
    ("detected", "between"),
    [
        ([0, 0, 40, 40, 40], (0.15, 0.2)),
        ([0, 0, 20, 40, 40], (0.2, 0.25)),
        ([40, 40, 40, 40, 40], (0.0, 0.1)),
    ],
)
def test_separated_severities_give_a_bracket(detected, between):
    with pytest.warns(UserWarning, match="between .*no-curve"):
        curve = pod_curve(SEVERITIES, detected, RECORDS)
    assert np.isnan([curve.slope, curve.a90, curve.a90_95]).all()
    assert curve.bracket == between


def test_nothing_detected_has_no_upper_end():
    with pytest.warns(UserWarning, match="above 0.3.*outliers.*no-curve"):
        curve = pod_curve(SEVERITIES, np.zeros(5), RECORDS)
    assert curve.bracket[0] == 0.3
    assert np.isnan(curve.bracket[1])


def test_a_bound_that_never_reaches_the_level_is_infinite():
    curve = pod_curve([0.1, 0.2], [1, 2], [3, 3])
    assert np.isfinite(curve.a90)
    assert curve.a90_95 == np.inf


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (([0.1, 0.2], [9, 3], [10, 10]), "does not increase"),
        (([0.1, 0.2], [5, 5], [10, 10]), "does not increase"),
        (([0.1, 0.2], [1, 3], [10, 0]), "0 <= n_detected <= n_records"),
        (([0.1, 0.2], [1, 0], [10, 0]), "expected at least two severities"),
        (([0.1, 0.1], [1, 3], [10, 10]), "expected at least two severities"),
        (([0.1, 0.2], [1, np.nan], [10, 10]), "0 <= n_detected <= n_records"),
        (([0.0, 0.2], [1, 3], [10, 10]), "all above 0"),
        (([10, 20], [1, 3], [10, 10]), "below 1"),
        (([0.1, 0.2, 0.3], [1, 3], [10, 10]), "vectors of one length"),
    ],
)
def test_impossible_data_are_errors(arguments, message):
    with pytest.raises(ValueError, match=message):
        pod_curve(*arguments)


@pytest.mark.filterwarnings("ignore:.*no-curve")
@pytest.mark.parametrize("n_records", [pytest.param(20, marks=pytest.mark.nightly), 200])
@pytest.mark.parametrize("is_log", [True, False])
def test_the_bound_of_the_likelier_law_holds_a90_under_either_law(is_log, n_records):
    """95 % asked, of 150 draws of five severities; 92 to 98 % where the law has to be chosen."""
    random, severities = np.random.RandomState(0), np.array([0.05, 0.1, 0.15, 0.2, 0.3])
    x = np.log(severities) if is_log else severities
    slope = logit(0.9) / (x[3] - x[2] + (x[2] - x[1]) / 2)
    pod, truth = expit(logit(0.9) + slope * (x - x[3])), severities[3]
    draws = random.binomial(n_records, pod, (150, 5))
    curves = [pod_curve(severities, draw, np.full(5, n_records)) for draw in draws]
    bounds = np.array([curve.a90_95 for curve in curves if np.isfinite(curve.slope)])
    assert np.mean(bounds >= truth) >= 0.9
    assert np.median([curve.a90 for curve in curves]) == pytest.approx(truth, rel=0.05)
    if n_records == 200:
        assert np.mean([curve.log == is_log for curve in curves]) > 0.9


def warned_share(pod, n_records, n_draws=100):
    """Share of binomial data of which the curve is said to miss the points."""
    random, n_warned = np.random.RandomState(0), 0
    for _ in range(n_draws):
        with warnings.catch_warnings(record=True) as caught:
            warnings.simplefilter("always")
            curve = pod_curve(SEVERITIES, random.binomial(n_records, pod), np.full(5, n_records))
        texts = [str(warning.message) for warning in caught if "no-curve" in str(warning.message)]
        assert len(texts) == (curve.n_missed > 0)
        n_warned += len(texts)
    return n_warned / n_draws


@pytest.mark.one_case
@pytest.mark.parametrize("n_records", [300, 30, 3000])
def test_a_curve_that_fits_gives_no_warning(n_records):
    assert warned_share(expit(8 + 5 * np.log(SEVERITIES)), n_records) <= 0.01


@pytest.mark.one_case
@pytest.mark.parametrize("pod", [[0.05, 0.6, 0.65, 0.7, 0.98], [0.3, 0.35, 0.4, 0.97, 0.98]])
def test_a_curve_beside_its_points_is_said(pod):
    assert warned_share(pod, 500, 40) == 1


def decisions(random, rate, correlation, n_repeats, n_records):
    """Serially correlated Gaussian decisions, negative at a rate that varies over the year, and that rate."""
    shocks = random.standard_normal((n_repeats, n_records + 200))
    noise = lfilter([np.sqrt(1 - correlation**2)], [1, -correlation], shocks, axis=1)[:, 200:]
    season = 0.5 * np.sin(2 * np.pi * np.arange(n_records) / n_records) if n_repeats > 1 else np.zeros(n_records)
    limits = norm.ppf(rate) + season
    return noise - limits, norm.cdf(limits).mean()


@pytest.mark.one_case
@pytest.mark.parametrize(("n_repeats", "correlation", "rate"), [(3, 0.5, 0.95), (20, 0.8, 0.02), (1, 0.8, 0.3)])
def test_bounds_hold_the_rate_as_often_as_they_say(n_repeats, correlation, rate):
    random, held = np.random.RandomState(0), []
    for _ in range(150):
        values, truth = decisions(random, rate, correlation, n_repeats, 365)
        found = rate_of(values)
        held.append(found["ci_low"] <= truth <= found["ci_high"])
    assert np.mean(held) > 0.9  # 95 % asked, of 150: 2.8 standard errors


@pytest.mark.parametrize("n_repeats", [20, 1])
def test_effective_number_is_that_of_the_correlation_of_the_alarms(n_repeats):
    random = np.random.RandomState(0)
    ratios = []
    for _ in range(30):
        values, _ = decisions(random, 0.5, 0.8, n_repeats, 3650 // n_repeats + 365)
        found = rate_of(values)
        ratios.append(found["n_records"] / found["n_effective"])
    lags = np.arange(1, 60)  # correlation of the signs of a Gaussian process: 2/pi arcsin(rho)
    expected = 1 + 2 * (2 / np.pi * np.arcsin(0.8**lags)).sum()
    assert np.median(ratios) == pytest.approx(expected, rel=0.25)


def test_bounds_are_quantiles_of_the_beta_distribution():
    assert clopper_pearson(0, 50, 0.95) == (0.0, pytest.approx(1 - 0.025 ** (1 / 50)))
    assert clopper_pearson(50, 50, 0.95) == (pytest.approx(0.025 ** (1 / 50)), 1.0)
    lowest, highest = clopper_pearson(7.5, 30.2, 0.9)
    assert beta.cdf(lowest, 7.5, 23.7) == pytest.approx(0.05)
    assert beta.sf(highest, 8.5, 22.7) == pytest.approx(0.05)


@pytest.mark.parametrize("sign", [-1, 1])
def test_rates_of_0_and_1_of_correlated_records_have_wide_bounds(sign):
    random = np.random.RandomState(0)
    independent, correlated = (decisions(random, 0.5, rho, 20, 365)[0] + sign * 20 for rho in (0.0, 0.9))
    first, second = rate_of(independent), rate_of(correlated)
    assert first["rate"] == second["rate"] == (sign < 0)
    assert first["n_effective"] > 0.9 * 7300
    assert second["n_effective"] == pytest.approx(7300 / 19, rel=0.3)  # (1 + 0.9) / (1 - 0.9)
    assert second["ci_high"] - second["ci_low"] > 10 * (first["ci_high"] - first["ci_low"])


def test_records_without_a_decision_do_not_count():
    values, _ = decisions(np.random.RandomState(0), 0.3, 0.5, 4, 300)
    gaps = np.random.RandomState(1).uniform(size=values.shape) < 0.2
    gaps[:, 40:90] = True
    found = rate_of(np.where(gaps, np.nan, values))
    assert found["n_records"] == np.count_nonzero(~gaps)
    assert found["rate"] == np.mean(values[~gaps] < 0)
    assert found["ci_low"] < found["rate"] < found["ci_high"]
    nothing = rate_of(np.full((2, 10), np.nan))
    assert nothing["n_records"] == 0
    assert np.isnan(nothing["rate"])


def test_repeats_that_are_all_alike_count_once():
    once, _ = decisions(np.random.RandomState(0), 0.3, 0.5, 1, 365)
    single, repeated = rate_of(once), rate_of(np.repeat(once, 20, axis=0))
    assert repeated["n_effective"] == pytest.approx(single["n_effective"])
    assert (repeated["ci_low"], repeated["ci_high"]) == pytest.approx((single["ci_low"], single["ci_high"]))


def test_repeats_with_other_damage_count_as_one_record_each():
    """Half of the repeats have alarms throughout, half have none: 20 coins, whatever the number of records."""
    decisions = np.repeat(np.where(np.arange(20) % 2, 1.0, -1.0)[:, np.newaxis], 400, axis=1)
    whole = rate_of(decisions, whole_repeats=True)
    assert whole["rate"] == 0.5
    assert 10 < whole["n_effective"] <= 20
    assert whole["ci_low"] < 0.3
    assert whole["ci_high"] > 0.7
