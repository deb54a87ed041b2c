"""The ranking of several detectors: what is significant, and at equal false alarms."""

import numpy as np
import pandas as pd
import pytest
from scipy.stats import ttest_1samp
from sklearn.base import BaseEstimator, OutlierMixin
from sklearn.metrics import roc_auc_score

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.studies import ProgressiveDamage, Scenario, sweep
from tests.studies.studies import WEATHER, compensated, ran, study_of

SIMULATED = "simulated"


class Dice(OutlierMixin, BaseEstimator):
    """Alarms in a share of the records, at random."""

    def __init__(self, share=0.02, fails=False):
        self.share = share
        self.fails = fails

    def fit(self, X, y=None):
        if self.fails:
            raise OSError("no dice")
        self.random_ = np.random.default_rng(0)
        return self

    def score_samples(self, X):
        return self.random_.uniform(size=len(X))

    def decision_function(self, X):
        return self.score_samples(X) - self.share


class Deaf(MahalanobisDetector):
    """Such as a one-class SVM, whose index saturates far from its records."""

    def decision_function(self, X):
        return np.ones(len(X))


def detectors():
    return {
        "raw": MahalanobisDetector(),
        "twin": MahalanobisDetector(),
        "dice": Dice(),
        "deaf": Deaf(),
        "loud": MahalanobisDetector(0.1),
        "lines": compensated(),
        "broken": Dice(fails=True),
    }


@pytest.fixture(scope="module")
def study(fem):
    scenarios = [*sweep(fem, (0.1, 0.2), ["bottom"]), ProgressiveDamage("crack", {"top": 0.3}, 33, 100)]
    study = ran(fem, scenarios, detectors(), n_repeats=6)
    return study


@pytest.fixture(scope="module")
def table(study):
    return study.ranking()


def damaged(study, name):
    """Decisions on damaged records from the onset on, by scenario."""
    found = [study.decisions_[name, one.name, SIMULATED] for one in study.scenarios_ if not one.is_healthy]
    return [*found[:-1], found[-1][:, 33:]]


@pytest.mark.nightly
def test_best_first_then_those_with_too_many_false_alarms_then_failures(table):
    assert table.index.tolist() == ["lines", "raw", "twin", "dice", "deaf", "loud", "broken"]
    assert table["within_limit"].tolist() == [True] * 5 + [False] * 2
    assert table.loc["loud", "false_alarms_ci_low"] > 0.02
    assert table["error"].tolist() == [""] * 6 + ["OSError: no dice"]
    assert table.loc["broken"].drop(["within_limit", "significantly_worse", "error"]).isna().all()
    assert table["within_limit"].dtype == table["significantly_worse"].dtype == bool
    ranked = table["pod"][:5]
    assert ranked.is_monotonic_decreasing
    assert table.loc["loud", "pod"] > table.loc["raw", "pod"]


def test_rates_are_means_of_those_of_the_results(study, table):
    results = study.results_.set_index(["detector", "scenario"])
    for name, row in table.drop(index="broken").iterrows():
        rates = results.loc[name]
        np.testing.assert_array_equal(
            row[["false_alarms", "false_alarms_ci_low", "false_alarms_ci_high"]].astype(float),
            rates.loc["healthy", ["rate", "ci_low", "ci_high"]].astype(float),
        )
        assert row["pod"] == pytest.approx(rates["rate"].iloc[1:].mean())
        assert row["pod bottom"] == pytest.approx(rates["rate"].iloc[1:3].mean())
        assert row["not_evaluated"] == 0
        smallest = study.minimum_detectable_damage(detector=name)["mdd"].iloc[0]
        wait = rates["time_to_detection"].iloc[1:].mean()
        for found, expected in ((row["mdd bottom"], smallest), (row["time_to_detection"], wait)):
            assert found == expected or pd.isna([found, expected]).all()


def test_equal_false_alarms_move_the_threshold_on_the_calibration_records(study, table):
    for name in table.index[:-1]:
        calibration = np.sort(study.calibration_[name, SIMULATED].ravel())
        threshold = calibration[int(0.02 * calibration.size)]
        n_tied = (calibration == threshold).sum()
        assert 0 <= int(0.02 * calibration.size) - (calibration < threshold).sum() < n_tied
        pod = np.mean([(decisions < threshold).mean() for decisions in damaged(study, name)])
        assert table.loc[name, "pod_at_equal_pfa"] == pytest.approx(pod)


def test_differences_of_the_rates_have_t_intervals_over_the_repeats(study, table):
    shares = {name: np.mean([(d < 0).mean(axis=1) for d in damaged(study, name)], axis=0) for name in table.index[:-1]}
    for name in table.index[1:-1]:
        confidence = 1 - 0.05 / 5  # Bonferroni, five comparisons with the best
        difference = shares["lines"] - shares[name]
        lowest, highest = ttest_1samp(difference, 0).confidence_interval(confidence)
        assert table.loc[name, "pod_deficit"] == pytest.approx(difference.mean())
        np.testing.assert_allclose(
            table.loc[name, ["pod_deficit_ci_low", "pod_deficit_ci_high"]].astype(float), [lowest, highest], atol=1e-9
        )
        assert table.loc[name, "significantly_worse"] == (lowest > 0)
    assert table.loc["deaf", ["significantly_worse", "pod"]].tolist() == [True, 0.0]
    assert table.loc["lines", ["pod_deficit", "pod_deficit_ci_low", "pod_deficit_ci_high"]].tolist() == [0, 0, 0]


def test_equal_detectors_tie(study):
    for by in ("pod", "pod_at_equal_pfa"):
        table = study.ranking(by=by).drop(index=["lines", "loud"])
        columns = [name for name in table if not name.startswith("pod_deficit")]
        assert table.loc["raw", columns].tolist() == table.loc["twin", columns].tolist()
        assert table.loc["raw", "pod_deficit"] == table.loc["twin", "pod_deficit"]
    twins = {"b": MahalanobisDetector(), "a": MahalanobisDetector()}
    table = ran(study.fem, [{}, {"top": 0.2}], twins, n_repeats=3).ranking()
    assert table.index.tolist() == ["a", "b"]
    assert (table[["pod_deficit", "pod_deficit_ci_low", "pod_deficit_ci_high"]] == 0).all(axis=None)
    assert not table["significantly_worse"].any()


def test_bounds_at_equal_false_alarms_hold_the_error_of_the_moved_thresholds(study):
    def found(name, kept):
        calibration = np.sort(study.calibration_[name, SIMULATED][kept].ravel())
        threshold = calibration[int(0.02 * calibration.size)]
        return np.mean([(decisions[kept] < threshold).mean() for decisions in damaged(study, name)])

    table, repeats = study.ranking(by="pod_at_equal_pfa"), np.arange(6)
    for name in ("raw", "dice"):
        without = np.array([found("lines", repeats != r) - found(name, repeats != r) for r in repeats])
        pseudo = 6 * table.loc[name, "pod_deficit"] - 5 * without
        lowest, highest = ttest_1samp(pseudo, 0).confidence_interval(1 - 0.05 / 5)
        assert table.loc[name, "pod_deficit_ci_high"] - table.loc[name, "pod_deficit_ci_low"] == pytest.approx(
            highest - lowest
        )


def test_area_under_the_curve(study, table):
    assert table.loc["dice", "auc"] == pytest.approx(0.5, abs=0.02)
    for name in ("raw", "lines"):
        healthy = study.decisions_[name, "healthy", SIMULATED].ravel()
        areas = [
            roc_auc_score(np.repeat([0, 1], [healthy.size, d.size]), -np.concatenate([healthy, d.ravel()]))
            for d in damaged(study, name)
        ]
        assert table.loc[name, "auc"] == pytest.approx(np.mean(areas))


def test_in_sentences(study, table):
    said = study.summary().splitlines()
    best = table.iloc[0]
    rates = f"{best['pod']:.1%} of the damaged records at a false-alarm rate of {best['false_alarms']:.1%}"
    for words, line in zip(([rates, "'lines'"], ["'raw'", "'deaf'"], [], ["'loud'"], ["OSError"]), said, strict=True):
        assert all(word in line for word in words)


@pytest.mark.one_case
@pytest.mark.parametrize("options", [{"n_repeats": 2}, {"n_repeats": 3, "noise": 0.0}], ids=["two repeats", "no noise"])
def test_without_other_noise_in_three_repeats_nothing_is_significant(fem, options):
    some = {"raw": MahalanobisDetector(), "lines": compensated()}
    study = ran(fem, [{}, {"top": 0.2}], some, **options)
    for by in ("pod", "pod_at_equal_pfa"):
        table = study.ranking(by=by)
        assert table[["pod_deficit_ci_low", "pod_deficit_ci_high"]].isna().all(axis=None)
        assert not table["significantly_worse"].any()
    assert "not show which detectors" in study.summary()


def test_measured_records_rank_by_what_was_found(fem):
    some, damage = {"raw": MahalanobisDetector(), "lines": compensated()}, {"healthy": {}, "top": {"top": 0.2}}
    study = study_of(fem, some, [Scenario(name, lost) for name, lost in damage.items()])
    campaigns = {name: make_truss_campaign(damage=lost, random_state=1) for name, lost in damage.items()}
    study.run(WEATHER, reference={name: one.temperatures.join(one.frequencies) for name, one in campaigns.items()})
    table = study.ranking(source="reference")
    results = study.results_[study.results_["source"] == "reference"].set_index(["detector", "scenario"])["rate"]
    for name, row in table.iterrows():
        assert (row["false_alarms"], row["pod"]) == (results[name, "healthy"], results[name, "top"])
    assert table["pod"][table["within_limit"]].is_monotonic_decreasing
    assert table[["pod_at_equal_pfa", "pod_deficit_ci_low"]].isna().all(axis=None)
    assert not table["significantly_worse"].any()
    with pytest.raises(ValueError, match="no healthy records to move thresholds by; expected by='pod'"):
        study.ranking(source="reference", by="pod_at_equal_pfa")


def test_what_cannot_be_ranked_is_an_error(fem, study):
    for options, message in (
        ({"max_false_alarms": 2}, "max_false_alarms is 2"),
        ({"source": "reference"}, r"source is 'reference'; expected one of \['simulated'\]"),
        ({"by": "auc"}, "by is 'auc'; expected 'pod' or 'pod_at_equal_pfa'"),
        ({"confidence": 95}, "confidence is 95"),
    ):
        with pytest.raises(ValueError, match=message):
            study.ranking(**options)
    for scenario, message in (({}, "none of them damaged"), ({"top": 0.1}, "none of them healthy")):
        single = study_of(fem, MahalanobisDetector(), [scenario], n_repeats=1)
        with pytest.raises(ValueError, match="expected a call of run before"):
            single.ranking()
        single.run(WEATHER)
        with pytest.raises(ValueError, match=message):
            single.ranking()
