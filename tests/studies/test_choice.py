"""A ranking by simulated records is that by true ones, in years with weather of their own."""

from itertools import combinations

import pytest
from sklearn.linear_model import LinearRegression
from sklearn.neighbors import KNeighborsRegressor
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_truss_campaign
from skthermo.detection import MahalanobisDetector, TemperatureCompensator
from skthermo.studies import sweep
from tests.studies.studies import study_of

TARGETS = [f"f{mode}" for mode in range(1, 7)]


class InSample(TemperatureCompensator):
    """Residuals of the baseline by the regression that was fitted on it, too small for a threshold."""

    def fit_transform(self, X, y=None):
        return self.fit(X).transform(X)


def compensated(kind, regressor):
    return make_pipeline(kind(regressor, targets=TARGETS), MahalanobisDetector())


@pytest.fixture(scope="module")
def study(fem):
    detectors = {
        "raw": MahalanobisDetector(),
        "linear": compensated(TemperatureCompensator, LinearRegression()),
        "neighbours": compensated(TemperatureCompensator, KNeighborsRegressor(30)),
        "in-sample": compensated(InSample, KNeighborsRegressor(4)),
    }
    scenarios = sweep(fem, (0.1, 0.2), ["bottom", "top"])
    study = study_of(fem, detectors, scenarios, n_repeats=3)

    def later_year(scenario, seed):
        year = make_truss_campaign(damage=scenario.damage, random_state=seed)
        return year.temperatures.join(year.frequencies)

    study.run(make_truss_campaign(random_state=1).temperatures, reference=later_year)
    return study


@pytest.mark.nightly
def test_a_detector_that_finds_far_less_in_truth_ranks_below(study):
    simulated, true = study.ranking(), study.ranking(source="reference")
    kept = true.index[true["within_limit"]]
    clear = [(one, other) for one, other in combinations(kept, 2) if true["pod"][one] - true["pod"][other] > 0.05]
    assert ("neighbours", "raw") in clear
    order = simulated.index.tolist()
    assert all(order.index(one) < order.index(other) for one, other in clear)


@pytest.mark.nightly
def test_a_detector_that_keeps_no_limit_in_truth_is_not_chosen_for_what_it_finds(study):
    simulated, true = study.ranking(), study.ranking(source="reference")
    assert simulated["pod"].idxmax() == true["pod"].idxmax() == "in-sample"
    for table in (simulated, true):
        assert not table.loc["in-sample", "within_limit"]
        assert table.index[-1] == "in-sample"
