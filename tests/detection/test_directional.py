"""The detector that knows directions of damage: invariances, models, gaps, what it finds, and what it refuses."""

import pickle

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.decomposition import PCA
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import MinMaxScaler, StandardScaler

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.detection import DirectionalDetector, MahalanobisDetector, TemperatureCompensator, WindowedAlarm
from skthermo.surrogate import DataInformedFEM, TemperatureMapper

GROUPS = ["bottom", "top", "diagonal", "vertical"]
YEAR = make_truss_campaign(random_state=0)
F, T = YEAR.frequencies, YEAR.temperatures


def together(**options):
    campaign = make_truss_campaign(**{"random_state": 1} | options)
    return campaign.temperatures.join(campaign.frequencies)


def compensated(last, whiten="auto", n_years=1):
    compensator = TemperatureCompensator(TemperatureMapper(), targets=list(F), whiten=whiten)
    return make_pipeline(compensator, last).fit(together(random_state=0, n_years=n_years))


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
    one, other = DirectionalDetector(omnibus=1.0).fit(F), MahalanobisDetector().fit(F)
    assert one.damage_index(F).to_numpy() == pytest.approx(other.damage_index(F).to_numpy(), rel=1e-12)
    assert one.threshold_ == pytest.approx(other.threshold_, rel=1e-12)


def test_a_cone_of_all_directions_is_the_mahalanobis_distance():
    everything = np.vstack([np.eye(6), -np.eye(6)])
    one = DirectionalDetector(everything, omnibus=0.0, threshold="quantile").fit(F)
    other = MahalanobisDetector(threshold="quantile").fit(F)
    assert one.damage_index(F).to_numpy() == pytest.approx(other.damage_index(F).to_numpy(), rel=1e-6)


def test_lengths_of_directions_and_units_of_frequencies_do_not_matter():
    falls = -np.diag([1.0, 2.0, 0.5, 1.0, 3.0, 1.0])
    one = DirectionalDetector(omnibus=0.0).fit(F).damage_index(F)
    other = DirectionalDetector(falls, omnibus=0.0).fit(1000 * F).damage_index(1000 * F)
    assert one.to_numpy() == pytest.approx(other.to_numpy(), abs=1e-6)


def test_directions_of_a_model_are_its_derivatives(fem):
    model, step = make_truss(), 1e-4
    exact = DirectionalDetector(model).fit(F).directions_
    nominal = np.ones((1, 4))
    for group in GROUPS:
        softer, stiffer = (model.damaged({group: size}).frequencies(nominal)[0] for size in (step, -step))
        assert exact.loc[group].to_numpy() == pytest.approx(np.log(softer / stiffer) / (2 * step), abs=1e-6)
    differences = DirectionalDetector(WithoutDerivatives(model)).fit(F).directions_
    assert differences.to_numpy() == pytest.approx(exact.to_numpy(), abs=1e-5)
    of_chain = DirectionalDetector(fem).fit(F).directions_
    assert list(of_chain.columns) == list(F)
    assert of_chain.to_numpy() == pytest.approx(exact.to_numpy(), abs=0.05)


def test_all_ways_to_whiten_agree_where_the_covariance_is_one():
    records = together(damage={"bottom": 0.1})
    indices, losses = [], []
    for whiten in (None, "global", "auto"):
        detector = compensated(DirectionalDetector(make_truss(), omnibus=0.0), whiten)
        indices.append(-detector.score_samples(records))
        losses.append(detector[-1].severities(detector[0].transform(records))["bottom"].mean())
    assert indices[1] == pytest.approx(indices[0], rel=0.05, abs=0.05)
    assert losses == pytest.approx([0.1] * 3, abs=0.025)
    assert indices[2].mean() == pytest.approx(indices[0].mean(), rel=0.1)


def test_it_finds_more_than_the_mahalanobis_distance_at_no_more_false_alarms():
    healthy, damaged = together(random_state=5, n_years=2), together(damage={"bottom": 0.08})
    rates = {}
    for name, last in {"any": MahalanobisDetector(), "model": DirectionalDetector(make_truss())}.items():
        detector = compensated(last)
        rates[name] = [(detector.predict(records) == -1).mean() for records in (healthy, damaged)]
    assert rates["model"][0] < rates["any"][0] + 0.02
    assert rates["model"][1] > rates["any"][1] + 0.2


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


@pytest.mark.parametrize("between", [PCA(), PCA(3), StandardScaler()])
def test_steps_that_do_not_say_what_they_do_are_refused(between):
    compensator = TemperatureCompensator(TemperatureMapper(), targets=list(F))
    with pytest.raises(ValueError, match="TemperatureCompensator"):
        make_pipeline(compensator, between, DirectionalDetector(-np.ones((1, PCA(3) is between or 6)))).fit(T.join(F))
    if isinstance(between, PCA):  # which frequency falls is not known of components
        with pytest.raises(ValueError, match="TemperatureCompensator"):
            make_pipeline(between, DirectionalDetector()).fit(F)


@pytest.mark.parametrize("change", [np.log, lambda F: MinMaxScaler((1, 2)).fit_transform(F)])
def test_columns_that_are_no_frequencies_of_the_model_are_refused(change):
    with pytest.raises(ValueError, match=r"7\.4|7\.5"):
        DirectionalDetector(make_truss()).fit(change(F))
    softening = DirectionalDetector().fit(change(F))
    assert (softening.predict(change(F)) == -1).mean() < 0.05


def test_the_unit_of_given_directions_does_not_matter():
    few = F[::3]
    effects = DirectionalDetector(make_truss()).fit(few).directions_
    whole, per_mille = (DirectionalDetector(effects * size).fit(few) for size in (1.0, 1e-3))
    smallest = whole.minimum_detectable_damage()
    np.testing.assert_allclose(per_mille.minimum_detectable_damage(), 1e3 * smallest, rtol=1e-6)
    np.testing.assert_allclose(per_mille.pod(1e3 * smallest), whole.pod(smallest), rtol=1e-12)
    np.testing.assert_allclose(per_mille.severities(few), 1e3 * whole.severities(few), rtol=1e-6, atol=1e-9)


def test_an_index_means_the_same_whichever_modes_are_there():
    random = np.random.RandomState(0)
    baseline, later = (
        table.assign(**table[list(F)].mask(random.random_sample((len(table), 6)) < 0.2))
        for table in (together(random_state=0, n_years=2), together(random_state=3, n_years=4))
    )
    later.iloc[:5, 3:] = np.nan
    compensator = TemperatureCompensator(TemperatureMapper(), targets=list(F))
    detector = make_pipeline(compensator, DirectionalDetector(make_truss())).fit(baseline)
    with pytest.warns(UserWarning, match="not-evaluated"):
        decisions = detector.predict(later)
    n_there = later[list(F)].notna().sum(axis=1).to_numpy()
    assert (decisions[:5] == 0).all()
    assert (decisions[n_there > 0] != 0).all()
    rates = [(decisions[few] == -1).mean() for few in (n_there == 6, (n_there > 0) & (n_there < 5))]
    assert max(rates) < 0.05
    losses = detector[-1].severities(detector[0].transform(later))
    assert losses.iloc[:5].isna().all(axis=None)
    assert (losses.iloc[5:][n_there[5:] > 0] >= 0).all(axis=None)
    assert losses.index.equals(later.index)


def test_more_damage_is_never_less_alarm():
    detector = compensated(DirectionalDetector(make_truss()))
    record = together(noise=1e-9)[:1]
    falls = detector[-1].directions_.to_numpy()
    for effect in [*falls, -falls[0], np.eye(6)[2], np.ones(6)]:
        sizes = [0.0, 0.05, 0.1, 0.3, 0.8]
        changed = (record.assign(**(record[list(F)] * np.exp(size * effect))) for size in sizes)
        indices = [-detector.score_samples(one)[0] for one in changed]
        in_alarm = np.array(indices) > detector[-1].threshold_
        assert (in_alarm[1:] >= in_alarm[:-1]).all()
        assert (np.diff(indices)[in_alarm[:-1]] > 0).all()
        assert in_alarm[-1] or np.abs(effect).max() < 0.01


def test_rates_that_are_expected_are_those_of_shifted_normal_records():
    random = np.random.RandomState(0)
    level, root = (
        1.1 * make_truss().frequencies(np.ones((1, 4)))[0],
        0.01 * (np.eye(6) + 0.3 * random.standard_normal((6, 6))),
    )

    def normal(n):
        return level * (1 + random.standard_normal((n, 6)) @ root)

    detector = DirectionalDetector(make_truss()).fit(normal(3000))
    for group in ("bottom", "diagonal"):
        effect = detector.directions_.loc[group].to_numpy()
        for loss in (0.0, 0.03, 0.06):
            true = (detector.predict(normal(4000) + loss * level * effect) == -1).mean()
            assert detector.pod([loss])[group].iloc[0] == pytest.approx(true, abs=0.03)
    smallest = detector.minimum_detectable_damage()
    for group, loss in smallest[np.isfinite(smallest)].items():
        below, at = detector.pod([0.97 * loss, loss])[group]
        assert below < at
        assert at >= 0.9 > below - 0.02
    assert (detector.minimum_detectable_damage(0.5) <= smallest).all()
    with pytest.raises(ValueError, match=r"1\.5"):
        detector.pod([1.5])


def test_groups_that_look_alike_are_named():
    alike = pd.DataFrame([[-1.0] * 6, [-2.0] * 6, [-1.0, 0, 0, 0, 0, 0]], ["deck", "girder", "bearing"], list(F))
    assert DirectionalDetector(alike).fit(F).indistinguishable_ == [("deck", "girder")]


def test_copies_share_a_fitted_chain_and_decide_alike(fem):
    detector = DirectionalDetector(fem)
    assert clone(make_pipeline(detector))[0].directions is fem
    fitted = detector.fit(F)
    assert (pickle.loads(pickle.dumps(fitted)).predict(F) == fitted.predict(F)).all()


@pytest.mark.one_case
@pytest.mark.filterwarnings("ignore:.*not-evaluated")  # the first windows
@pytest.mark.parametrize("rule", ["mean", "m-of-n"])
def test_windows_find_more_with_directions(rule):
    healthy, damaged = together(random_state=5, n_years=2), together(damage={"bottom": 0.04})
    rates = {}
    for name, inner in {"any": None, "model": DirectionalDetector(make_truss())}.items():
        detector = compensated(WindowedAlarm(5, rule=rule, detector=inner), n_years=3)
        rates[name] = [(detector.predict(records)[4:] == -1).mean() for records in (healthy, damaged)]
    assert rates["model"][0] < rates["any"][0] + 0.03
    assert rates["model"][1] > rates["any"][1] + 0.1
    if rule == "mean":
        expected = detector[-1].pod([0.0, 0.04])["bottom"].to_numpy()
        assert expected == pytest.approx(rates["model"], abs=0.12)
        assert detector[-1].minimum_detectable_damage()["bottom"] < 0.08
    assert hasattr(detector[-1], "pod") == (rule == "mean")


def test_losses_that_explain_records_are_those_that_have_moved_them():
    level = make_truss().frequencies(np.ones((1, 4)))[0]
    random = np.random.RandomState(0)
    baseline = level * (1 + 0.01 * random.standard_normal((2000, 6)))
    single, week = (
        make().fit(baseline)
        for make in (
            lambda: DirectionalDetector(make_truss()),
            lambda: WindowedAlarm(7, detector=DirectionalDetector(make_truss())),
        )
    )
    losses = np.array([0.08, 0.0, 0.05, 0.0])
    moved = np.tile(baseline.mean(axis=0) + level * (losses @ single.directions_.to_numpy()), (7, 1))
    raised = np.tile(baseline.mean(axis=0) * 1.02, (7, 1))
    for detector in (single, week):
        np.testing.assert_allclose(detector.severities(moved).iloc[-1], losses, atol=2e-3)
        assert detector.explained(moved)[-1] == pytest.approx(1, abs=1e-3)
        assert detector.explained(raised)[-1] < 0.02
        assert (detector.severities(raised).iloc[-1] < 1e-6).all()
    white = single.directions_.to_numpy() * baseline.mean(axis=0) / 0.01 / level
    np.testing.assert_allclose(single.sensitivities_, np.linalg.norm(white, axis=1), rtol=0.05)
    nothing = np.full((7, 6), np.nan)
    with pytest.warns(UserWarning, match="not-evaluated"):
        assert single.predict(nothing).tolist() == [0] * 7
    assert np.isnan(single.explained(nothing)).all()
    assert week.severities(nothing).isna().all(axis=None)
