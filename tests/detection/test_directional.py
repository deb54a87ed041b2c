"""The detector that knows directions of damage: invariances, models, gaps, what it finds, and what it refuses."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import DirectionalDetector, MahalanobisDetector, TemperatureCompensator
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

GROUPS = ["bottom", "top", "diagonal", "vertical"]
YEAR = make_truss_campaign(random_state=0)
F, T = YEAR.frequencies, YEAR.temperatures


def together(**options):
    campaign = make_truss_campaign(**{"random_state": 1} | options)
    return campaign.temperatures.join(campaign.frequencies)


def compensated(last, seed=0):
    compensator = TemperatureCompensator(TemperatureMapper(LinearRegression()), targets=list(F))
    return make_pipeline(compensator, last).fit(together(random_state=seed))


@pytest.fixture(scope="module")
def fem():
    return DataInformedFEM(make_truss(), random_state=0).fit(T, F)


class WithoutDerivatives:
    """A model that gives frequencies only, and can be damaged."""

    def __init__(self, model):
        self.model_ = model
        self.parameter_names, self.n_modes, self.groups = model.parameter_names, model.n_modes, model.groups

    def frequencies(self, theta):
        return self.model_.frequencies(theta)

    def damaged(self, severities):
        return WithoutDerivatives(self.model_.damaged(severities))


def test_the_omnibus_alone_is_the_mahalanobis_distance():
    one, other = DirectionalDetector(contamination=0.03, omnibus=1.0).fit(F), MahalanobisDetector(0.03).fit(F)
    assert one.damage_index(F).to_numpy() == pytest.approx(other.damage_index(F).to_numpy(), rel=1e-12)
    assert one.threshold_ == pytest.approx(other.threshold_, rel=1e-12)


def test_a_cone_of_all_directions_is_the_mahalanobis_distance():
    everything = np.vstack([np.eye(6), -np.eye(6)])
    one = DirectionalDetector(everything, omnibus=0.0, threshold="quantile").fit(F)
    other = MahalanobisDetector(threshold="quantile").fit(F)
    assert one.damage_index(F).to_numpy() == pytest.approx(other.damage_index(F).to_numpy(), rel=1e-6)


def test_lengths_of_directions_and_units_of_frequencies_do_not_matter():
    falls = -np.diag([1.0, 2.0, 0.5, 1.0, 3.0, 1.0])
    one, other = DirectionalDetector(omnibus=0.0).fit(F), DirectionalDetector(falls, omnibus=0.0).fit(1000 * F)
    np.testing.assert_allclose(other.damage_index(1000 * F), one.damage_index(F), atol=1e-6)
    losses = one.severities(F[:9]) / np.abs(falls).sum(axis=1)
    np.testing.assert_allclose(other.severities(1000 * F[:9]), losses, rtol=1e-6, atol=1e-9)
    alike = pd.DataFrame([[-1.0] * 6, [-2.0] * 6, falls[0]], ["deck", "girder", "bearing"], list(F))
    assert DirectionalDetector(alike).fit(F).indistinguishable_ == [("deck", "girder")]


def test_directions_of_a_model_are_its_derivatives(fem):
    model, step = make_truss(), 1e-4
    exact = DirectionalDetector(model).fit(F).directions_
    nominal = np.ones((1, 4))
    for group in GROUPS:
        for name, kind in ((group, "stiffness"), (f"{group}, section", "section")):
            softer, stiffer = (model.damaged({group: s}, kind=kind).frequencies(nominal)[0] for s in (step, -step))
            assert exact.loc[name].to_numpy() == pytest.approx(np.log(softer / stiffer) / (2 * step), abs=1e-6)
    differences = DirectionalDetector(WithoutDerivatives(model)).fit(F).directions_
    assert differences.to_numpy() == pytest.approx(exact.loc[GROUPS].to_numpy(), abs=1e-5)
    of_chain = DirectionalDetector(fem).fit(F).directions_
    assert list(of_chain.columns) == list(F)
    assert of_chain.to_numpy() == pytest.approx(exact.to_numpy(), abs=0.05)


@pytest.mark.nightly
def test_it_finds_more_than_the_mahalanobis_distance_at_no_more_false_alarms():
    rates, directions = {}, make_truss().damage_directions(kind="stiffness")
    detectors = {"any": MahalanobisDetector(0.02), "model": DirectionalDetector(directions, contamination=0.02)}
    for name, last in detectors.items():
        rates[name] = []
        for seed in range(2):
            detector = compensated(last, seed=seed)
            later = together(random_state=10 + seed), together(damage={"bottom": 0.08}, random_state=20 + seed)
            rates[name].append([(detector.predict(records) == -1).mean() for records in later])
    (healthy, damaged), (any_healthy, any_damaged) = (np.mean(rates[name], axis=0) for name in ("model", "any"))
    assert healthy < any_healthy + 0.01
    assert damaged > any_damaged + 0.2


def test_columns_of_a_frame_are_matched_by_name():
    table = pd.DataFrame(np.random.RandomState(0).standard_normal((3, 6)), list("abc"), list(F))
    one, other = DirectionalDetector(table).fit(F), DirectionalDetector(table[table.columns[::-1]]).fit(F)
    assert one.directions_.equals(other.directions_)
    with pytest.raises(ValueError, match="g1"):
        DirectionalDetector(table.rename(columns={"f1": "g1"})).fit(F)


@pytest.mark.parametrize(
    ("directions", "named"),
    [
        ("stiffening", "stiffening"),
        (np.ones((2, 5)), r"\(2, 5\)"),
        (np.zeros((2, 6)), "direction 1"),
        ([[np.nan] * 6], "nan|direction 1"),
        (np.ones(6), r"\(6,|6, 1"),
    ],
)
def test_what_are_no_directions_is_refused(directions, named):
    with pytest.raises(ValueError, match=named):
        DirectionalDetector(directions).fit(F)


def test_columns_that_are_no_relative_residuals_are_refused():
    residuals = TemperatureCompensator(LinearRegression(), targets=list(F)).fit_transform(T.join(F))
    for between in (StandardScaler(), PCA(), PCA(whiten=True)):
        for directions in ("softening", make_truss()):
            with pytest.raises(ValueError, match="neither frequencies nor relative residuals"):
                make_pipeline(between, DirectionalDetector(directions)).fit(residuals)


@pytest.mark.nightly
def test_frequencies_in_any_unit_and_relative_residuals_find_the_same_losses():
    level = make_truss().frequencies(np.ones((1, 4)))[0]
    rows = 0.01 * np.random.RandomState(0).standard_normal((500, 6))
    tables = level * (1 + rows), 2 * np.pi * level * (1 + rows), rows
    losses = [DirectionalDetector(make_truss()).fit(table).minimum_detectable_damage() for table in tables]
    np.testing.assert_allclose(losses[1], losses[0], rtol=1e-9)
    np.testing.assert_allclose(losses[2], losses[0], rtol=0.05)


def test_more_damage_is_never_less_alarm():
    detector = compensated(DirectionalDetector(make_truss()))
    records = pd.concat([together(noise=1e-9)[:1]] * 5).set_axis(F.index[:5])
    sizes = np.array([[0.0], [0.05], [0.1], [0.3], [0.8]])
    falls = detector[-1].directions_.to_numpy()
    for effect in [*falls, -falls[0], np.eye(6)[2], np.ones(6)]:
        indices = -np.asarray(detector.score_samples(records.assign(**records[list(F)] * np.exp(sizes * effect))))
        in_alarm = indices > detector[-1].threshold_
        assert (in_alarm[1:] >= in_alarm[:-1]).all()
        assert (np.diff(indices)[in_alarm[:-1]] > 0).all()
        assert in_alarm[-1] or np.abs(effect).max() < 0.01


def test_rates_that_are_expected_are_those_of_shifted_normal_records():
    random = np.random.RandomState(0)
    level = 1.1 * make_truss().frequencies(np.ones((1, 4)))[0]
    root = 0.01 * (np.eye(6) + 0.3 * random.standard_normal((6, 6)))

    def normal(n):
        return level * (1 + random.standard_normal((n, 6)) @ root)

    detector = DirectionalDetector(make_truss()).fit(normal(3000))
    losses = [0.0, 0.03, 0.06]
    expected = detector.pod(losses).join(detector.pod(losses, kind="section"))
    assert list(expected) == [*GROUPS, *(f"{group}, section" for group in GROUPS)]
    for name in ("bottom", "diagonal", "diagonal, section"):
        for loss, rate in zip(losses, expected[name], strict=True):
            moved = normal(4000) + loss * level * detector.directions_.loc[name].to_numpy()
            assert rate == pytest.approx((detector.predict(moved) == -1).mean(), abs=0.03)
    smallest = detector.minimum_detectable_damage(0.8)
    assert np.isfinite(smallest).tolist() == [True, True, True, False]  # of verticals, no loss is found often enough
    for group, loss in smallest[["bottom", "diagonal"]].items():
        below, at = detector.pod([0.97 * loss, loss])[group]
        assert below < at
        assert at >= 0.8 > below - 0.02
    with pytest.raises(ValueError, match=r"1\.5"):
        detector.pod([1.5])
    with pytest.raises(ValueError, match="none of a loss of section"):
        DirectionalDetector().fit(F).minimum_detectable_damage(kind="section")
    with pytest.raises(ValueError, match="kind is 'area'"):
        detector.pod([0.1], kind="area")


def test_copies_share_a_fitted_chain_and_decide_alike(fem):
    detector = DirectionalDetector(fem)
    assert clone(make_pipeline(detector))[0].directions is fem
    fitted = detector.fit(F)
    assert (pickle.loads(pickle.dumps(fitted)).predict(F) == fitted.predict(F)).all()


def test_losses_that_explain_records_are_those_that_have_moved_them():
    level = make_truss().frequencies(np.ones((1, 4)))[0]
    random = np.random.RandomState(0)
    baseline = level * (1 + 0.01 * random.standard_normal((2000, 6)))
    single = DirectionalDetector(make_truss()).fit(baseline)
    losses, effects = np.array([0.08, 0.0, 0.05, 0.0]), single.directions_.to_numpy()
    moved = np.tile(baseline.mean(axis=0) + level * (losses @ effects[:4]), (7, 1))
    lighter = np.tile(baseline.mean(axis=0) + level * (losses @ effects[4:]), (7, 1))
    np.testing.assert_allclose(single.severities(lighter, kind="section").iloc[-1], losses, atol=2e-3)
    assert single.explained(lighter, kind="section")[-1] == pytest.approx(1, abs=1e-3)
    assert single.explained(lighter)[-1] < 0.99
    moved[0, 5] = np.nan
    np.testing.assert_allclose(single.severities(moved), losses + np.zeros((7, 1)), atol=2e-3)
    raised = np.tile(baseline.mean(axis=0) * 1.02, (7, 1))
    assert single.explained(moved)[-1] == pytest.approx(1, abs=1e-3)
    assert single.explained(raised)[-1] < 0.02
    assert (single.severities(raised).iloc[-1] < 1e-6).all()
    white = single.directions_.to_numpy() * baseline.mean(axis=0) / 0.01 / level
    np.testing.assert_allclose(single.sensitivities_, np.linalg.norm(white, axis=1), rtol=0.05)
    nothing = np.full((7, 6), np.nan)
    with pytest.warns(UserWarning, match="not-evaluated"):
        assert single.predict(nothing).tolist() == [0] * 7
    assert np.isnan(single.explained(nothing)).all()
    assert single.severities(nothing).isna().all(axis=None)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*(few-records|not-evaluated)")  # of a winter, records count as few
@pytest.mark.parametrize("kind", ["gaps", "winter", "tails"])
def test_smallest_changes_hold_with_the_gaps_and_the_scatter_of_the_baseline(kind):
    def records(n, seed):
        random = np.random.default_rng(seed)
        rows = 0.01 * (random.standard_t(4, (n, 4)) if kind == "tails" else random.standard_normal((n, 4)))
        if kind == "winter":
            rows[: n // 3] *= 3
        return np.where(random.random(rows.shape) < 0.3, np.nan, rows) if kind == "gaps" else rows

    found, directions = [], -0.3 - np.eye(4)
    for seed in range(3):
        detector = DirectionalDetector(directions).fit(records(1000, seed))
        smallest, later = detector.minimum_detectable_damage(0.9), records(4000, 100 + seed)
        for direction, size in zip(directions, smallest, strict=True):
            decisions = detector.predict(later + size * direction)
            found.append((decisions[~np.isnan(later).all(axis=1)] == -1).mean())
    assert np.mean(found) == pytest.approx(0.9, abs=0.02)
