"""Bands of a study: other noise, weather, training records and models, and which of them is how large."""

import pickle

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from sklearn.base import clone

from skthermo.datasets import make_truss
from skthermo.detection import MahalanobisDetector
from skthermo.studies import Scenario, UncertainDamage, sweep
from skthermo.surrogate import refitted, resampled
from tests.studies import studies as shared
from tests.studies.studies import LATER, WEATHER, YEAR

PARTS = ("noise", "weather", "baseline", "model")
MODELS = [make_truss().damaged({"bottom": loss}) for loss in (-0.03, 0.04, 0.0)]


def study_of(fem, uncertainty, **options):
    options = {"uncertainty": uncertainty, "n_replicates": 2, "noise": "fitted"} | options
    return shared.study_of(fem, MahalanobisDetector(), sweep(fem, (0.1, 0.2), groups=["bottom"]), **options)


@pytest.fixture(scope="module")
def study(fem_of_few):
    study = study_of(fem_of_few, PARTS, models=MODELS)
    study.run(WEATHER)
    return study


@pytest.mark.nightly
def test_repeats_do_not_depend_on_the_replicates(fem_of_few, study):
    alone = study_of(fem_of_few, "noise")
    results = alone.run(WEATHER)
    left = study.results_.drop(columns=["pi_low", "pi_high"])
    pd.testing.assert_frame_equal(results.drop(columns=["pi_low", "pi_high"]), left)
    for key, decisions in alone.decisions_.items():
        np.testing.assert_array_equal(decisions, study.decisions_[key])
    assert alone.replicates_ is None
    assert alone.uncertainty_ is None
    rates = (alone.decisions_["MahalanobisDetector", "bottom 10 %", "simulated"] < 0).mean(axis=1)
    row = results.set_index("scenario").loc["bottom 10 %"]
    assert (row["pi_low"], row["pi_high"]) == (rates.min(), rates.max())


@pytest.mark.nightly
def test_results_do_not_depend_on_the_number_of_jobs(fem):
    study = study_of(fem, ("noise", "baseline", "weather"))
    twin = clone(study).set_params(n_jobs=2)
    results = study.run(WEATHER)
    pd.testing.assert_frame_equal(twin.run(WEATHER), results)
    with parallel_config("threading"):
        pd.testing.assert_frame_equal(twin.run(WEATHER), results)
    pd.testing.assert_frame_equal(pickle.loads(pickle.dumps(twin)).uncertainty_, study.uncertainty_)


def test_bands_of_a_study(study):
    table = study.uncertainty_
    assert list(table.columns[:5]) == ["noise", "weather", "baseline", "model", "together"]
    np.testing.assert_allclose((table[list(PARTS)] ** 2).sum(axis=1), table["together"] ** 2)
    assert (table["together"] > 0).all()
    smallest = study.minimum_detectable_damage(method="curve")
    assert (smallest["pi_low"] < smallest["pi_high"]).all()
    curve = study.pod_curve("bottom")
    low, high = curve.prediction_interval([0.1, 0.2])
    curves = np.array([one.predict([0.1, 0.2])[0] for one in curve.replicates])
    assert ((curves.min(axis=0) <= low) & (low < high) & (high <= curves.max(axis=0))).all()
    assert curve.a90_prediction_interval[0] < curve.a90_prediction_interval[1]
    summary = study.summary()
    assert "95% prediction intervals include the uncertainty of noise, the weather, the training records and" in summary
    damaged = study.results_.set_index("scenario").drop("healthy")
    widest = (damaged["pi_high"] - damaged["pi_low"]).idxmax()
    assert f"The widest is that of {widest!r}: " in summary
    assert "2 replicates" in summary


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"uncertainty": ["noise", "wind"]}, "uncertainty is .*; expected 'auto', 'all', or some of"),
        ({"n_replicates": 1}, "n_replicates is 1; expected at least 2"),
        ({"models": []}, "models is .*; expected a list of FE models"),
        ({"models": [make_truss(n_modes=4)]}, "model 0 of models is .* and 4 modes; expected the chain's"),
        ({"models": MODELS[:1]}, "models came, but uncertainty is 'noise'; expected 'model' among it, 'auto' or 'all'"),
    ],
)
def test_wrong_options_are_refused(fem, options, message):
    with pytest.raises(ValueError, match=message):
        study_of(fem, **({"uncertainty": "noise"} | options)).run(WEATHER)


class Failing(Scenario):
    """A scenario that fails in weather whose first record is warmer than a limit."""

    limit = np.inf

    def _changes(self, T, repeat):
        if T.iloc[0, 0] > self.limit:
            raise ValueError("too warm")
        return super()._changes(T, repeat)


def test_replicates_that_fail_are_counted(fem, monkeypatch):
    years = [WEATHER, WEATHER + 0.1, WEATHER + 0.2, WEATHER + 0.3]
    damage = [Failing("damage", {"bottom": 0.2})]
    study = shared.study_of(fem, MahalanobisDetector(), damage, uncertainty="weather", n_replicates=4)
    monkeypatch.setattr(Failing, "limit", WEATHER.iloc[0, 0] + 0.25)
    with pytest.warns(UserWarning, match="1 of 4 .*too warm.*no-solution"):
        study.run(years)
    assert len(study.replicates_.rates["MahalanobisDetector", "damage"]) == 3
    monkeypatch.setattr(Failing, "limit", WEATHER.iloc[0, 0] + 0.05)
    with pytest.raises(ValueError, match="3 of 4 replicates failed"):
        study.run(years)


def test_other_years_are_matched_by_the_season(fem):
    daily, rates = LATER.temperatures, []
    study = shared.study_of(fem, MahalanobisDetector(), [{"bottom": 0.2}], uncertainty="weather", n_replicates=2)
    for other in (WEATHER, daily.set_axis(daily.index + pd.Timedelta(days=365))):
        study.run([WEATHER, other])
        rates += study.replicates_.rates.values()
    np.testing.assert_array_equal(*rates)
    with pytest.raises(ValueError, match="year 1 of T has no record within a day of the season"):
        study.run([WEATHER, daily.set_axis(daily.index + pd.Timedelta(days=100))])


def test_uncertain_damage_differs_from_replicate_to_replicate(fem):
    uncertain = UncertainDamage("some", pd.DataFrame({"bottom": np.linspace(0.05, 0.3, 6)}))
    study = shared.ran(fem, [uncertain], uncertainty="weather", n_replicates=4)
    rates = study.replicates_.rates["MahalanobisDetector", "some"][:, -1]
    assert len(np.unique(rates.round(2))) == 4


@pytest.mark.nightly
def test_other_training_records_change_a_chain_as_its_error(fem):
    year, chains = YEAR.temperatures, [resampled(fem, seed) for seed in range(4)]
    predicted = fem.predict(year)
    changes = np.array([(chain.predict(year) / predicted - 1).to_numpy() for chain in chains])
    again = refitted(fem, year, fem.simulate(year, noise="fitted", random_state=0))
    by_refitting = (again.predict(year) / predicted - 1).to_numpy()
    ratio = np.sqrt((changes**2).mean() / (by_refitting**2).mean())
    assert 0.75 < ratio < 1.33
    spread = [np.nanstd(chain.recorder_.residuals.values, axis=0).mean() for chain in (fem, *chains)]
    np.testing.assert_allclose(spread[1:], spread[0], rtol=0.06)
    pd.testing.assert_frame_equal(resampled(fem, 3).predict(year), chains[3].predict(year))
    pd.testing.assert_frame_equal(fem.predict(year), predicted)


@pytest.mark.nightly
def test_a_refitted_chain_finds_the_same_parameters(fem):
    pd.testing.assert_frame_equal(refitted(fem).parameters_, fem.parameters_)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*uncalibrated-model")
def test_a_chain_with_another_model_is_that_of_the_other_model(fem):
    plain = clone(fem).set_params(aligner="passthrough", inverse__prior=0.3).fit(YEAR.temperatures, YEAR.frequencies)
    other = refitted(plain, model=MODELS[0])
    assert other.model is MODELS[0]
    bottom = other.parameters_["bottom"] / plain.parameters_["bottom"]
    np.testing.assert_allclose(bottom.median(), 1 / 1.03, rtol=3e-3)
