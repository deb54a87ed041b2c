"""Bands of a study: other noise, weather, training records and models, and which of them is how large."""

import pickle
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from joblib import parallel_config
from scipy.special import logit
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.residuals.baseline import BaselineResiduals
from skthermo.studies import DetectabilityStudy, Scenario, UncertainDamage, sweep
from skthermo.studies.detectability._replicates import (
    PARTS,
    ReplicateRates,
    Replicates,
    other_years,
    resampled_days,
    variances_of,
)
from skthermo.studies.detectability._simulation import Measurement
from skthermo.surrogate import refitted, resampled

YEAR = make_truss_campaign(random_state=0)
WEATHER = make_truss_campaign(random_state=1).temperatures
MODELS = [make_truss().damaged({"bottom": loss}) for loss in (-0.03, 0.04, 0.0)]


def study_of(fem, uncertainty, **options):
    scenarios = sweep(fem, (0.1, 0.2), groups=["bottom"])
    settings = {"n_repeats": 2, "n_replicates": 2, "random_state": 0} | options
    return DetectabilityStudy(fem, MahalanobisDetector(), scenarios, uncertainty=uncertainty, **settings)


@pytest.fixture(scope="module")
def study(fem):
    study = study_of(fem, PARTS, models=MODELS)
    study.run(WEATHER)
    return study


def stamped(stamps):
    """Temperatures that tell of which day and hour they are."""
    days = (stamps - stamps[0].normalize()) / pd.Timedelta(days=1)
    return pd.DataFrame({"day": np.floor(days), "hour": stamps.hour.astype(float)}, stamps)


@pytest.mark.parametrize("years", [1, 2])
def test_other_days_are_of_the_same_season_and_the_same_hour(years):
    T = stamped(pd.date_range("2024-01-01", periods=years * 365 * 6, freq="4h"))
    other = resampled_days(T, np.random.RandomState(0))
    assert other.index.equals(T.index)
    assert (other["hour"] == T["hour"]).all()
    apart = (other["day"] - T["day"]) % 365
    assert np.minimum(apart, 365 - apart).max() <= 15
    assert (other["day"] != T["day"]).mean() > 0.8
    assert (np.diff(other["day"]) % 365 > 1).sum() <= len(T) / 6 / 7 + 2  # whole weeks in a row


def test_rows_without_stamps_count_as_a_year():
    T = np.arange(730.0)[:, np.newaxis]
    other = resampled_days(T, np.random.RandomState(0))
    assert other.shape == T.shape
    apart = np.abs(other - T)
    assert 0 < np.minimum(apart, len(T) - apart).max() <= 34  # fifteen days of two records, and the end of the year
    assert len(resampled_days(T[:1], np.random.RandomState(0))) == 1


def test_gaps_in_the_stamps_keep_their_own_weather():
    T = stamped(pd.date_range("2024-01-01", periods=365, freq="D"))
    gappy = T.drop(T.index[100:140])
    other = resampled_days(gappy, np.random.RandomState(0))
    assert other.index.equals(gappy.index)
    assert set(other["day"]) <= set(gappy["day"])


def test_years_are_matched_by_season():
    first = stamped(pd.date_range("2024-01-01", periods=300, freq="D"))
    second = stamped(pd.date_range("2025-01-01", periods=365, freq="D"))
    same, matched = other_years([first, second])
    assert same is first
    assert matched.index.equals(first.index)
    assert (matched["day"] - first["day"]).abs().max() <= 1
    with pytest.raises(ValueError, match=r"year 1 of T has no record within a day of the season of 2\d\d of 300 rows"):
        other_years([first, second[:60]])
    with pytest.raises(ValueError, match="year 1 of T has the sensors"):
        other_years([first, second.rename(columns={"day": "T9"})])
    for other in (3, "next year", first[:0], first * np.nan):
        with pytest.raises(ValueError, match=r"(?s)year 1 of T is .*; expected a table of temperatures"):
            other_years([first, other])
    with pytest.raises(ValueError, match="year 1 of T has 2 rows, the first 3"):
        other_years([np.zeros((3, 1)), np.zeros((2, 1))])


def test_repeats_do_not_depend_on_the_replicates(fem, study):
    alone = study_of(fem, "noise")
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
def test_replicates_do_not_depend_on_the_number_of_jobs(fem):
    study = study_of(fem, ("noise", "baseline", "weather"))
    twin = clone(study).set_params(n_jobs=2)
    results = study.run(WEATHER)
    with parallel_config("threading"):
        pd.testing.assert_frame_equal(twin.run(WEATHER), results)
    pd.testing.assert_frame_equal(pickle.loads(pickle.dumps(twin)).uncertainty_, study.uncertainty_)


def test_a_replicate_is_drawn_from_its_seed_alone(fem):
    few, many = (Replicates.of(fem, ("baseline", "weather"), WEATHER, None, number, [1, 2]) for number in (2, 4))
    for number in (0, 1):
        for (part, chain, T), (again, other, T_again) in zip(
            few.replicate(number), many.replicate(number), strict=True
        ):
            assert part == again
            pd.testing.assert_frame_equal(T, T_again)
            pd.testing.assert_frame_equal(chain.predict(T), other.predict(T))


@pytest.mark.filterwarnings("ignore:.*hidden-offsets")
def test_parts_come_one_after_the_other(fem):
    replicates = Replicates.of(fem, ("model", "noise", "baseline", "weather"), WEATHER, MODELS, 3, [1, 2])
    (weather, chain, T), (baseline, other, _), (model, third, _) = replicates.replicate(1)
    assert (weather, baseline, model) == ("weather", "baseline", "model")
    assert replicates.with_noise
    assert chain is fem
    assert not T.equals(WEATHER)
    assert other.model is fem.model
    assert third.model is MODELS[1]
    assert not other.predict(WEATHER).equals(fem.predict(WEATHER))


def test_several_years_take_turns(fem):
    years = [make_truss_campaign(random_state=seed).temperatures for seed in (1, 2, 3)]
    replicates = Replicates.of(fem, "weather", years, None, 4, [1, 2])
    for number, expected in enumerate([0, 1, 2, 0]):
        ((_, _, T),) = replicates.replicate(number)
        pd.testing.assert_frame_equal(T, years[expected])


def rates_of(steps, with_noise=True, parts=("weather", "baseline"), own=0.5):
    key = "detector", "scenario"
    return ReplicateRates({key: steps}, {key: np.array([own, own])}, {key: 1e9}, parts, with_noise, []), key


def test_variances_of_the_parts_add_up():
    random = np.random.RandomState(0)
    deviations = {"noise": 0.02, "weather": 0.01, "baseline": 0.03}
    n_replicates, n_draws = 4000, 3
    weather, baseline = (
        deviations[part] * random.standard_normal((n_replicates, 1)) for part in ("weather", "baseline")
    )
    noise = deviations["noise"] * random.standard_normal((2, n_replicates, n_draws))
    steps = 0.5 + np.stack([weather + noise[0], weather + baseline + noise[1]], axis=1)
    replicates, key = rates_of(steps)
    table = replicates.table().loc[key]
    np.testing.assert_allclose(table[list(deviations)], list(deviations.values()), rtol=0.08)
    assert table["together"] == pytest.approx(np.sqrt(14) / 100, rel=0.05)
    assert table[[f"{part} share" for part in deviations]].sum() == pytest.approx(1)
    lowest, highest = replicates.prediction_interval(key, 0.9)
    assert (highest - lowest) / 2 == pytest.approx(1.645 * np.sqrt(14) / 100, rel=0.05)


def test_a_band_holds_the_rate_of_one_more_campaign():
    random = np.random.RandomState(1)
    held = []
    for _ in range(1500):
        centres = logit(0.8) + 0.3 * random.standard_normal((9, 1))
        rates = 1 / (1 + np.exp(-centres[:8] - 0.2 * random.standard_normal((8, 3))))
        replicates, key = rates_of(rates[:, np.newaxis], parts=("model",))
        lowest, highest = replicates.prediction_interval(key, 0.9)
        truth = 1 / (1 + np.exp(-centres[8, 0] - 0.2 * random.standard_normal()))
        held.append(lowest <= truth <= highest)
    assert 0.87 < np.mean(held) < 0.94


@pytest.mark.parametrize(("is_counted_anew", "shares"), [(True, (0.9, 0.96)), (False, (0.8, 0.88))])
def test_a_band_holds_the_few_false_alarms_of_one_more_year(is_counted_anew, shares):
    random, n_records, expected, held = np.random.RandomState(4), 365, 6, []
    for _ in range(800):
        counted = random.poisson(expected)  # in the training records, which replicates may draw anew
        weather, own = random.poisson(counted, (10, 2)), random.poisson(counted, 3)
        other = random.poisson(counted, (10, 1)) if is_counted_anew else np.full((10, 1), counted)
        steps, key = np.stack([weather, random.poisson(other, (10, 2))], axis=1) / n_records, ("detector", "healthy")
        parts = ("weather", "baseline")
        replicates = ReplicateRates({key: steps}, {key: own / n_records}, {key: n_records}, parts, True, [])
        lowest, highest = replicates.prediction_interval(key, 0.9)
        held.append(lowest - 1e-9 <= random.poisson(expected) / n_records <= highest + 1e-9)
    assert shares[0] < np.mean(held) < shares[1]


def test_more_parts_do_not_narrow_a_band():
    random = np.random.RandomState(2)
    noise, other = 0.02 * random.standard_normal((300, 3)), 0.03 * random.standard_normal((300, 1))
    widths = []
    for steps, with_noise in ((noise, False), (noise, True), (noise + other, True)):
        replicates, key = rates_of(0.5 + steps[:, np.newaxis], with_noise, parts=("baseline",))
        lowest, highest = replicates.prediction_interval(key, 0.9)
        widths.append(highest - lowest)
    assert widths[0] < widths[1] < widths[2]


@pytest.mark.parametrize(("parts", "centre"), [(("baseline",), 0.3), (("weather",), 0.5), (("weather", "model"), 0.6)])
def test_a_band_moves_with_weather_and_model_but_not_with_the_training_records(parts, centre):
    scatter = 0.01 * np.random.RandomState(3).standard_normal((50, 1, 3))
    steps = np.concatenate([0.5 + scatter, 0.6 + scatter], axis=1)[:, : len(parts)]
    replicates, key = rates_of(steps, parts=parts, own=0.3)
    assert np.mean(replicates.prediction_interval(key, 0.9)) == pytest.approx(centre, abs=0.005)
    assert np.mean(replicates.single(key)) == pytest.approx(centre, abs=0.005)


def test_all_replicates_alike_have_no_spread():
    assert variances_of(np.full((5, 3), 0.25)) == (0.0, 0.0)


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


def test_models_that_cannot_be_drawn(monkeypatch, fem):
    def fails(*args, **options):
        raise ValueError("no derivative")

    monkeypatch.setattr("skthermo.studies.detectability._replicates.ModelUpdater.fit", fails)
    with pytest.raises(ValueError, match=r"cannot be drawn from the training records \(no derivative\)"):
        Replicates.of(fem, ("noise", "model"), WEATHER, None, 3, [1, 2])
    with pytest.warns(UserWarning, match="bands-without-models"):
        replicates = Replicates.of(fem, "all", WEATHER, None, 3, [1, 2])
    assert replicates.parts == ["weather", "baseline"]


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
    study = DetectabilityStudy(
        fem,
        MahalanobisDetector(),
        [Failing("damage", {"bottom": 0.2})],
        n_repeats=2,
        uncertainty="weather",
        n_replicates=4,
    )
    monkeypatch.setattr(Failing, "limit", WEATHER.iloc[0, 0] + 0.25)
    with pytest.warns(UserWarning, match="1 of 4 .*too warm.*failed-replicates"):
        study.run(years)
    assert len(study.replicates_.rates["MahalanobisDetector", "damage"]) == 3
    monkeypatch.setattr(Failing, "limit", WEATHER.iloc[0, 0] + 0.05)
    with pytest.raises(ValueError, match="3 of 4 replicates failed"):
        study.run(years)


def test_uncertain_damage_differs_from_replicate_to_replicate(fem):
    uncertain = UncertainDamage("some", pd.DataFrame({"bottom": np.linspace(0.05, 0.3, 6)}))
    options = {"n_repeats": 2, "noise": 0.01, "uncertainty": "weather", "n_replicates": 2, "random_state": 0}
    study = DetectabilityStudy(fem, MahalanobisDetector(), [uncertain], **options)
    study.run(WEATHER)
    rates = study.replicates_.rates["MahalanobisDetector", "some"][:, -1]
    assert len(np.unique(rates.round(2))) > 3


def test_replicates_have_the_outliers_of_other_training_records(fem):
    service, seeds = fem.recorder_.service, range(20)
    outliers = np.full_like(service.outliers, np.nan)
    outliers[np.random.default_rng(0).choice(len(outliers), 20, replace=False), 0] = 0.2
    given = Measurement("fitted", "fitted", replace(service, outliers=outliers))
    others = [given.resampled(fem, np.random.RandomState(seed)) for seed in seeds]
    weather = fem.weather(WEATHER)
    same, other = (
        [(one.of(fem, weather, seed)[0] > 0.1).sum() for one, seed in zip(some, seeds, strict=True)]
        for some in ([given] * len(seeds), others)
    )
    np.testing.assert_allclose([np.mean(same), np.mean(other)], 20, atol=5)
    assert np.var(other) > np.var(same)
    for known in (None, 0.01):
        stated = replace(given, outliers=known)
        assert stated.resampled(fem, np.random.RandomState(0)) is stated


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


def test_a_refitted_chain_finds_the_same_parameters(fem):
    pd.testing.assert_frame_equal(refitted(fem).parameters_, fem.parameters_)


@pytest.mark.filterwarnings("ignore:.*hidden-offsets")
def test_a_chain_with_another_model_is_that_of_the_other_model(fem):
    plain = clone(fem).set_params(aligner="passthrough", inverse__prior=0.3).fit(YEAR.temperatures, YEAR.frequencies)
    other = refitted(plain, model=MODELS[0])
    assert other.model is MODELS[0]
    bottom = other.parameters_["bottom"] / plain.parameters_["bottom"]
    np.testing.assert_allclose(bottom.median(), 1 / 1.03, rtol=3e-3)


def test_by_default_all_but_the_model_varies(fem):
    assert Replicates.of(fem, "auto", WEATHER, None, 2, [1, 2]).parts == ["weather", "baseline"]
    assert Replicates.of(fem, "auto", WEATHER, MODELS, 2, [1, 2]).parts == ["weather", "baseline", "model"]
    assert Replicates.of(fem, "auto", WEATHER, None, 2, [1, 2]).with_noise


def test_the_noise_of_replicates_is_as_uncertain_as_that_of_so_many_records(fem):
    random = np.random.default_rng(0)
    n_records, deviations = 400, []
    for _ in range(40):
        values = random.standard_normal((n_records, 3)) * [1e-3, 2e-3, 5e-3]
        weather = random.normal(size=(n_records, 2))
        residuals = BaselineResiduals(weather, values, values, np.zeros(n_records, dtype=int))
        deviations.append(residuals.level_errors)
    assert np.mean(deviations) == pytest.approx(1 / np.sqrt(2 * n_records), rel=0.15)
    replicates = Replicates.of(fem, ("baseline",), WEATHER, None, 400, [1, 2])
    levels = np.log([replicates.noise_levels(number) for number in range(400)])
    np.testing.assert_allclose(levels.std(axis=0), fem.recorder_.residuals.level_errors, rtol=0.15)
    assert np.abs(levels.mean(axis=0)).max() < 4 * levels.std() / np.sqrt(400)
    np.testing.assert_allclose(np.exp(levels[3]), replicates.noise_levels(3), rtol=1e-14)
