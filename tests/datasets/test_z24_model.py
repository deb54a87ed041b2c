"""The FE model of Z24: its modes, what its parameters do, and the measured bridge where the data are."""

import importlib.util
import os
from pathlib import Path

import numpy as np
import pytest

from skthermo.datasets import load_z24, make_z24
from skthermo.datasets._z24 import Z24_CONSTANTS, Z24_PARAMETERS, z24_structure
from skthermo.updating import sensitivity

TOOL = Path(__file__).parents[2] / "tools" / "fit_z24_constants.py"
NOMINAL = np.ones((1, 4))
BRIDGE = z24_structure()
MODEL = make_z24()
FREQUENCIES = MODEL.frequencies(NOMINAL)[0]


def load_tool():
    spec = importlib.util.spec_from_file_location(TOOL.stem, TOOL)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


FIT = load_tool()


@pytest.fixture(scope="module")
def box():
    """Twenty points of the box of +-30 %."""
    return np.random.default_rng(0).uniform(0.7, 1.3, (20, 4))


@pytest.fixture(scope="module")
def monitoring():
    if "SKTHERMO_DATA" not in os.environ:
        pytest.skip("SKTHERMO_DATA does not name a folder that holds z24/z24_monitoring.csv")
    return load_z24(Path(os.environ["SKTHERMO_DATA"]) / "z24" / "z24_monitoring.csv")


def test_the_model_is_as_documented():
    assert MODEL.parameter_names == ("girder_bending", "piers_soil", "girder_torsion", "abutments")
    assert set(MODEL.groups) == {*MODEL.parameter_names, "piers", "soil"}
    assert (MODEL.n_dof, MODEL.n_modes, MODEL.track) == (426, 4, True)
    np.testing.assert_allclose(make_z24(n_modes=2).frequencies(NOMINAL)[0], FREQUENCIES[:2], rtol=1e-9)


def test_mass_is_the_structures_own():
    """A rigid translation moves the whole mass of girder and piers."""
    mass, along = MODEL.matrices(NOMINAL)[1], np.array([direction for _, direction in BRIDGE.dofs])
    girder, pier = Z24_CONSTANTS["girder"], Z24_CONSTANTS["pier"]
    total = girder["density"] * girder["A"] * sum((14.0, 30.0, 14.0)) + 2 * pier["density"] * pier["A"] * 5.5
    for direction in "xyz":
        rigid = (along == direction).astype(float)
        assert rigid @ (mass @ rigid) == pytest.approx(total, rel=1e-12)


def test_each_mode_moves_mass_in_one_direction():
    shares = FIT.mass_shares(BRIDGE, MODEL)
    for mode, direction in enumerate(("z", "y", "z", "rx")):
        assert shares[direction][mode] > 0.85
    np.testing.assert_allclose(sum(shares.values()), 1, rtol=1e-9)


def test_nothing_intrudes_below_the_fifth_mode():
    model = make_z24(n_modes=8)
    assert FIT.mode_kinds(BRIDGE, model)[:4] == list(FIT.KINDS)
    frequencies = model.frequencies(NOMINAL)[0]
    assert (np.diff(frequencies) > 0).all()
    assert frequencies[4] > 1.03 * frequencies[3]


def test_modes_are_symmetric_or_antisymmetric():
    """Turned about the vertical line at mid-span, the bridge is the same: every shape keeps or changes its sign."""
    middle = sum((14.0, 30.0, 14.0)) / 2
    turned = {"x": -1, "y": -1, "z": 1, "rx": -1, "ry": -1, "rz": 1}
    position = {dof: i for i, dof in enumerate(BRIDGE.dofs)}
    image = [position[(2 * middle - x, y, z), direction] for (x, y, z), direction in BRIDGE.dofs]
    sign = np.array([turned[direction] for _, direction in BRIDGE.dofs])
    shapes = MODEL.modes(NOMINAL)[1][0]
    for mode, parity in enumerate((1, -1, -1, -1)):  # a lateral or twisting shape that is alike in both halves turns
        difference = sign * shapes[image, mode] - parity * shapes[:, mode]
        assert np.abs(difference).max() < 1e-6 * np.abs(shapes[:, mode]).max()


def test_frequencies_do_not_depend_on_the_mesh():
    finer = z24_structure(element_length=0.5).assemble(Z24_PARAMETERS, n_modes=4).frequencies(NOMINAL)[0]
    np.testing.assert_allclose(finer, FREQUENCIES, rtol=1e-3)


def test_all_stiffness_is_in_the_four_parameters():
    """f is homogeneous of degree 1/2 in stiffness (Euler's theorem)."""
    np.testing.assert_allclose(sensitivity(MODEL).sum(axis=1), 0.5, rtol=1e-6)


def test_parameters_can_be_distinguished():
    slopes = sensitivity(MODEL).to_numpy()
    assert np.linalg.cond(slopes) < 15
    f1_against_f3 = dict(zip(MODEL.parameter_names, slopes[0] - slopes[2], strict=True))
    assert max(f1_against_f3, key=lambda name: abs(f1_against_f3[name])) == "abutments"
    assert f1_against_f3["girder_torsion"] == pytest.approx(0, abs=1e-6)


@pytest.mark.parametrize("name", Z24_PARAMETERS)
def test_damage_of_a_parameters_group_is_that_parameter_smaller(name):
    theta = np.where(np.array(MODEL.parameter_names) == name, 0.7, 1.0)
    np.testing.assert_allclose(MODEL.damaged({name: 0.3}).frequencies(NOMINAL), MODEL.frequencies([theta]), rtol=1e-8)


def test_piers_and_soil_are_parts_of_one_group():
    parts, whole = MODEL.damaged({"piers": 0.3, "soil": 0.3}), MODEL.damaged({"piers_soil": 0.3})
    np.testing.assert_allclose(parts.frequencies(NOMINAL), whole.frequencies(NOMINAL), rtol=1e-8)
    for part in ("piers", "soil"):
        less = MODEL.damaged({part: 0.3}).frequencies(NOMINAL)[0] / FREQUENCIES
        assert (less < 1).all()
        assert (less > whole.frequencies(NOMINAL)[0] / FREQUENCIES).all()


def test_a_weaker_foundation_lowers_the_lateral_mode():
    damaged = MODEL.damaged({"piers_soil": 0.265})
    change = damaged.frequencies(NOMINAL)[0] / FREQUENCIES - 1
    assert change[1] == pytest.approx(-0.077, abs=0.003)
    assert (np.abs(change[[0, 2, 3]]) < 0.025).all()


def test_columns_of_the_damaged_bridge_are_the_healthy_modes(box):
    damaged = MODEL.damaged({"piers_soil": 0.265})
    kept = np.diagonal(MODEL.nominal_mac(damaged.modes(box)[1]), axis1=1, axis2=2)
    assert (kept > 0.5).all()


@pytest.mark.nightly
def test_modes_swap_within_thirty_percent_so_that_columns_follow_shapes(box):
    by_rank = BRIDGE.assemble(Z24_PARAMETERS, groups=(Z24_PARAMETERS | {"piers": "piers", "soil": "soil"}), n_modes=4)
    best = [model.nominal_mac(model.modes(box)[1]).argmax(axis=2) for model in (by_rank, MODEL)]
    reordered = [(columns != np.arange(4)).any(axis=1).mean() for columns in best]
    assert reordered[0] > 0.2
    assert reordered[1] == 0
    assert (np.diff(MODEL.frequencies(box)[:, 2:], axis=1) < 0).any()


@pytest.mark.parametrize("sensors", [slice(None), ["Tair"]], ids=["all sensors", "air"])
def test_frequencies_are_within_one_percent_of_the_measured_ones(monitoring, sensors):
    warm = (monitoring.temperatures.loc[:, sensors] > 5).all(axis=1) & (monitoring.state == "undamaged")
    np.testing.assert_allclose(FREQUENCIES, monitoring.frequencies[warm].mean(), rtol=0.01)


def test_the_fit_ends_at_the_constants(monitoring):
    measured, n_records = FIT.warm_means(monitoring)
    assert n_records > 500
    assert FIT.fit(measured) == Z24_CONSTANTS


def test_the_fit_finds_constants_that_are_known():
    """From the frequencies of another bridge, of which the starts know nothing."""
    truth = FIT.frequencies(FIT.with_multipliers([1.1, 0.9, 1.2, 0.75]))
    np.testing.assert_allclose(FIT.frequencies(FIT.fit(truth)), truth, rtol=2e-3)
