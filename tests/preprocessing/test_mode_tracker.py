"""Assignment of poles to reference modes."""

import itertools
import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sklearn.base import clone
from sklearn.utils import Bunch

from skthermo.exceptions import RecordsWarning, UnevaluatedRowsWarning
from skthermo.fem import mac
from skthermo.preprocessing import ModeTracker
from tests.benchmarks.mode_tracker import right, simulated_poles
from tests.nights import by_day

RNG = np.random.default_rng(0)
F0, PHI = np.array([2.0, 2.3, 4.0]), RNG.normal(size=(6, 3))
HOURS = pd.date_range("2025-01-01", periods=50, freq="h", name="time")
N = len(HOURS)


def padded(frequencies=F0, n_records=N, extra=0, noise=0.0, seed=0):
    """Records of the reference's modes, and of ``extra`` random poles before them, in padded arrays."""
    random = np.random.default_rng(seed)
    F = np.hstack([random.uniform(1, 6, (n_records, extra)), np.broadcast_to(frequencies, (n_records, 3))])
    S = np.concatenate([random.normal(size=(n_records, extra, 6)), np.broadcast_to(PHI.T, (n_records, 3, 6))], axis=1)
    S = S * np.exp(1j * random.uniform(0, 7, F.shape))[:, :, np.newaxis] * random.uniform(0.1, 9, F.shape + (1,))
    S = S + noise * (random.normal(size=S.shape) + 1j * random.normal(size=S.shape))
    return Bunch(frequencies=F, shapes=S, damping=0.01 * np.arange(F.size).reshape(F.shape))


@pytest.mark.parametrize("follow", [None, 200])
def test_shapes_find_nearly_all_modes_among_spurious_poles(follow):
    records, true, reference = simulated_poles(700)
    assert right(ModeTracker(reference, follow=follow).fit_transform(records).poles, true) > 99.8


def test_tables_are_on_the_index_and_hold_the_assigned_poles():
    raw = padded(extra=2)
    columns = [f"p{i}" for i in range(5)]
    raw.frequencies, raw.damping = (pd.DataFrame(raw[k], HOURS, columns) for k in ("frequencies", "damping"))
    modes = ModeTracker((F0, PHI)).fit_transform(raw)
    assert all(modes[name].index.equals(HOURS) for name in ("frequencies", "damping", "mac", "poles", "left_over"))
    assert list(modes.frequencies.columns) == ["f1", "f2", "f3"]
    assert list(modes.damping.columns) == ["xi1", "xi2", "xi3"]
    np.testing.assert_array_equal(modes.frequencies, np.broadcast_to(F0, (N, 3)))
    np.testing.assert_array_equal(modes.damping, raw.damping.iloc[:, 2:])
    np.testing.assert_array_equal(modes.poles, np.broadcast_to([2, 3, 4], (N, 3)))
    np.testing.assert_array_equal(modes.left_over, 2)
    np.testing.assert_allclose(modes.mac, 1)
    assert modes.summary["n_records"].tolist() == [N, N, N]
    assert modes.summary["frequency"].tolist() == list(F0)


@pytest.mark.parametrize("reference", [PHI, PHI * np.exp(1j * np.array([0.3, 2.0, 4.0])) * [1, -5, 0.1]])
def test_shapes_have_the_phase_of_the_reference_and_their_own_scale(reference):
    raw = padded(noise=0.05)
    modes = ModeTracker((F0, reference)).fit_transform(raw)
    products = np.einsum("ijs,sj->ij", modes.shapes, reference.conj())
    np.testing.assert_allclose(products.imag, 0, atol=1e-12 * np.abs(products).max())
    assert (products.real > 0).all()
    np.testing.assert_allclose(np.abs(modes.shapes), np.abs(raw.shapes))


def test_all_forms_of_input_give_the_same():
    raw = padded(extra=3, n_records=8)
    raw.frequencies[2, :4] = raw.frequencies[5] = np.nan
    tracker = ModeTracker((F0, PHI)).fit()
    expected = tracker.transform(raw)
    some = [~np.isnan(row) for row in raw.frequencies]
    lists = {name: [row[k] for row, k in zip(raw[name], some, strict=True)] for name in raw}
    records = [{name: lists[name][i] for name in raw} for i in range(8)]
    series = pd.Series(records)
    for X in (lists, records, series):
        modes = tracker.transform(X)
        for name in ("frequencies", "damping", "mac"):
            np.testing.assert_array_equal(modes[name], expected[name])
        np.testing.assert_array_equal(modes.shapes, expected.shapes)
        np.testing.assert_array_equal(modes.left_over, expected.left_over)
    assert expected.frequencies.loc[5].isna().all()
    assert expected.poles.loc[5].tolist() == [-1, -1, -1]


def test_order_of_poles_and_of_modes_does_not_matter():
    raw = padded(extra=3, noise=0.3)
    modes = ModeTracker((F0, PHI)).fit_transform(raw)
    turned = Bunch(frequencies=raw.frequencies[:, ::-1], shapes=raw.shapes[:, ::-1])
    order = [2, 0, 1]
    other = ModeTracker((F0[order], PHI[:, order])).fit_transform(turned)
    np.testing.assert_array_equal(other.frequencies, modes.frequencies.to_numpy()[:, order])


def lowest_cost(cost):
    """Lowest cost of one record, from all assignments; rows are modes, and one without a pole costs 3."""
    n_modes, n_poles = cost.shape
    return min(
        sum(3.0 if pole < 0 else cost[mode, pole] for mode, pole in enumerate(choice))
        for choice in itertools.product(range(-1, n_poles), repeat=n_modes)
        if len({pole for pole in choice if pole >= 0}) == sum(pole >= 0 for pole in choice)
    )


@settings(max_examples=by_day(20, at_night=60))
@given(st.integers(0, 2**31), st.integers(1, 4), st.integers(1, 4), st.sampled_from([0.05, 0.2, 0.6]))
def test_the_assignment_is_optimal_and_one_to_one(seed, n_modes, n_poles, max_shift):
    random = np.random.default_rng(seed)
    reference, shapes = random.uniform(2, 3, n_modes), random.normal(size=(3, n_modes))
    F, S = random.uniform(2, 3, (5, n_poles)), random.normal(size=(5, n_poles, 3))
    tracker = ModeTracker((reference, shapes), max_shift=max_shift, min_mac=0.1, close=0.0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # of modes that are alike or not found
        poles = tracker.fit_transform({"frequencies": F, "shapes": S}).poles.to_numpy()
    for chosen, f, phi in zip(poles, F, S, strict=True):
        shift, agreement = np.abs(f / reference[:, np.newaxis] - 1), mac(shapes, phi.T)
        cost = (1 - agreement) / (1 - 0.1) + shift / max_shift
        cost[(shift > max_shift) | (agreement < 0.1)] = np.inf
        found = chosen >= 0
        assert len(set(chosen[found])) == found.sum()
        total = cost[np.flatnonzero(found), chosen[found]].sum() + 3 * (~found).sum()
        assert total == pytest.approx(lowest_cost(cost))


def test_mac_is_that_of_fem_and_ignores_failed_sensors():
    shapes = RNG.normal(size=(20, 6)) + 1j * RNG.normal(size=(20, 6))
    tracker = ModeTracker((F0[:1], PHI[:, :1]), min_mac=0.0)

    def found():
        raw = {"frequencies": np.full((20, 1), F0[0]), "shapes": shapes[:, np.newaxis]}
        return tracker.fit_transform(raw).mac["f1"]

    np.testing.assert_allclose(found(), mac(shapes.T, PHI)[:, 0], rtol=1e-12)
    shapes[:7, 4] = np.nan
    few = mac(np.delete(shapes[:7], 4, 1).T, np.delete(PHI, 4, 0))[:, 0]
    np.testing.assert_allclose(found(), [*few, *mac(shapes[7:].T, PHI)[:, 0]], rtol=1e-12)


def test_shapes_of_close_modes_may_mix():
    frequencies, angle = np.array([2.0, 2.004, 4.0]), np.radians(40)
    basis = np.linalg.qr(PHI)[0]
    mixed = basis.copy()
    mixed[:, 0] = np.cos(angle) * basis[:, 0] + np.sin(angle) * basis[:, 1]
    mixed[:, 1] = np.cos(angle) * basis[:, 1] - np.sin(angle) * basis[:, 0]
    raw = {"frequencies": [frequencies], "shapes": [mixed.T]}
    modes = ModeTracker((frequencies, basis)).fit_transform(raw)
    np.testing.assert_array_equal(modes.frequencies, [frequencies])
    np.testing.assert_allclose(modes.mac.iloc[0, :2], np.cos(angle) ** 2)
    apart = ModeTracker((frequencies, basis), close=0.001).fit_transform(raw)
    assert apart.frequencies.notna().to_numpy().tolist() == [[False, False, True]]


def test_with_two_sensors_close_modes_are_distinct():
    raw = {"frequencies": [[2.0, 2.01]], "shapes": [np.array([[0.1, 1.0], [1.0, 1.0]])]}
    modes = ModeTracker(([2.0, 2.01], np.eye(2))).fit_transform(raw)
    assert modes.poles.to_numpy().tolist() == [[-1, 0]]


def test_a_drift_beyond_max_shift_is_followed():
    drift = np.linspace(1, 1.25, 1000)
    raw = padded(F0 * drift[:, np.newaxis], n_records=1000, extra=3)
    with pytest.warns(UnevaluatedRowsWarning, match="modes-not-found"):
        fixed = ModeTracker((F0, PHI), max_shift=0.05).fit_transform(raw)
    followed = ModeTracker((F0, PHI), max_shift=0.05, follow=20).fit_transform(raw)
    assert fixed.frequencies.isna().mean().max() > 0.7
    np.testing.assert_array_equal(followed.frequencies, F0 * drift[:, np.newaxis])
    steady = 20 * 0.25 / 999  # lag of an exponential mean behind a ramp: slope times time constant
    np.testing.assert_allclose(1.25 - followed.followed.iloc[-1] / F0, steady, rtol=0.05)


def test_no_drift_beyond_max_drift_is_followed():
    raw = padded(F0 * np.linspace(1, 1.25, 1000)[:, np.newaxis], n_records=1000)
    with pytest.warns(UnevaluatedRowsWarning, match="modes-not-found"):
        modes = ModeTracker((F0, PHI), max_shift=0.05, follow=20, max_drift=0.1).fit_transform(raw)
    assert (modes.followed.max() / F0 <= 1.1 + 1e-12).all()
    assert (modes.frequencies.max() / F0 <= 1.1 * 1.05).all()


def test_a_missing_mode_is_not_captured_by_spurious_poles():
    raw = padded(n_records=1000, extra=6)
    raw.frequencies[100:900, 6] = np.nan
    modes = ModeTracker((F0, PHI), follow=10).fit_transform(raw)
    assert (np.abs(modes.followed["f1"] / F0[0] - 1) < 0.1).all()
    np.testing.assert_array_equal(modes.poles["f1"].iloc[900:], 6)


def test_following_goes_by_time():
    stamps = pd.date_range("2025-01-01", periods=300, freq="h")
    raw = padded(F0 * np.linspace(1, 1.2, 300)[:, np.newaxis], n_records=300)
    shuffle = np.random.default_rng(3).permutation(300)
    frame = pd.DataFrame(raw.frequencies, stamps)
    tracker = ModeTracker((F0, PHI), max_shift=0.05, follow="20h")
    ordered = tracker.fit_transform({"frequencies": frame, "shapes": raw.shapes})
    mixed = tracker.fit_transform({"frequencies": frame.iloc[shuffle], "shapes": raw.shapes[shuffle]})
    pd.testing.assert_frame_equal(mixed.frequencies, ordered.frequencies.iloc[shuffle])
    by_count = clone(tracker).set_params(follow=20).fit_transform({"frequencies": frame, "shapes": raw.shapes})
    pd.testing.assert_frame_equal(by_count.followed, ordered.followed)


def test_frequency_alone_assigns_in_order():
    with pytest.warns(RecordsWarning, match="f1/f2"):
        tracker = ModeTracker((F0, None)).fit()
    modes = tracker.transform(pd.DataFrame([[2.1, 2.25, 3.9], [np.nan, 2.28, 5.0]]))
    np.testing.assert_array_equal(modes.frequencies, [[2.1, 2.25, 3.9], [np.nan, 2.28, np.nan]])
    assert modes.shapes is None
    assert modes.mac is None
    assert modes.summary["ambiguous"].tolist()[:2] == [1.0, 1.0]


def test_sensors_are_chosen_by_name():
    raw = padded()
    raw.sensors = list("abcdef")
    reference = {
        "frequencies": pd.Series(F0, ["sway", "f7", "torsion"]),
        "shapes": PHI[[4, 0, 3, 1]],
        "sensors": "eadb",
    }
    modes = ModeTracker(reference).fit_transform(raw)
    np.testing.assert_allclose(modes.mac, 1)
    assert modes.shapes.shape == (N, 3, 4)
    assert list(modes.damping.columns) == ["xi_sway", "xi7", "xi_torsion"]
    with pytest.raises(ValueError, match="'z'"):
        ModeTracker({**reference, "sensors": "eadz"}).fit_transform(raw)


def test_no_records_and_empty_records():
    tracker = ModeTracker((F0, PHI)).fit()
    empty = {"frequencies": [[], F0], "shapes": [[], PHI.T], "damping": [[], [0.1, 0.2, 0.3]]}
    assert tracker.transform(empty).frequencies.notna().sum(axis=1).tolist() == [0, 3]
    assert tracker.transform({"frequencies": [], "shapes": []}).frequencies.shape == (0, 3)
    none = {"frequencies": np.full((4, 2), np.nan), "shapes": np.zeros((4, 2, 6))}
    assert tracker.transform(none).summary["n_records"].tolist() == [0, 0, 0]
    assert tracker.set_params(follow=5).fit().transform(none).frequencies.shape == (4, 3)


def test_modes_never_found_and_modes_found_elsewhere_give_one_warning():
    raw = padded(F0 * [1, 1.3, 1], extra=1)
    raw.frequencies[:, 3] = np.nan
    with pytest.warns(UnevaluatedRowsWarning, match="modes-not-found") as caught:
        ModeTracker((F0, PHI)).fit_transform(raw)
    assert len(caught) == 1
    assert "['f2', 'f3'] are found in no record" in str(caught[0].message)
    assert "records without 'f2' have a pole of its shape at about 1.3 times" in str(caught[0].message)


def test_poles_without_shape_are_left_over_with_a_warning():
    raw = padded()
    raw.shapes[:5, 0] = np.nan
    raw.shapes[5:7, 1] = 0
    with pytest.warns(UnevaluatedRowsWarning, match="poles have no shape"):
        modes = ModeTracker((F0, PHI)).fit_transform(raw)
    assert modes.left_over.sum() == 7


@pytest.mark.parametrize("change", [np.flip, lambda S: S * np.array([1, 1, 1, -1, -1, 1])], ids=["order", "sign"])
def test_modes_lost_by_their_shapes_are_named(change):
    raw = padded()
    raw.shapes = change(raw.shapes)
    with pytest.warns(UserWarning, match=r"records without \['f1'.* have a pole of another shape.*signs"):
        ModeTracker((F0, PHI)).fit_transform(raw)
