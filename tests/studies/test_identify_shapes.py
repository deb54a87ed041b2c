"""Mode shapes as data for explanations: effects, records, and noise."""

import warnings

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.fem import mac
from skthermo.studies import identify_damage
from skthermo.studies.identification._causes import Cause, read_causes
from skthermo.studies.identification._identified import precision
from skthermo.studies.identification._shapes import ShapeEffects, shape_shift
from skthermo.surrogate.effects import ChangedStructure
from tests.studies.test_identify_causes import OnlyDamaged, differences

TRUSS, DOFS, MODES = make_truss(), [1, 3, 5, 10, 16, 22], [f"f{i}" for i in range(1, 7)]
MASS = np.zeros(TRUSS.n_dof)
MASS[[4, 5]] = 2000.0
CAUSES, CHANGES = read_causes(TRUSS, None, ["top"], ["diagonal"], {"machine": MASS})
AT = np.array([0.1, 0.35, 0.0, 0.2, -0.15, 0.0, 0.1, 0.4])
THETA = np.array([[1.0, 1.02, 0.98, 1.0]])
random = np.random.RandomState(0)


@pytest.fixture(scope="module")
def effects(fem):
    return ShapeEffects.of(ChangedStructure(fem, CHANGES), THETA, DOFS)


def shapes_at(amounts=None):
    """Shapes of the truss at the sensors, with damage, stiffening, a parameter and mass."""
    a = np.zeros(8) if amounts is None else amounts
    model = TRUSS.damaged({"bottom": a[0], "top": 1 - (1 - a[1]) * (1 - a[4]), "vertical": a[3]})
    model = model.with_added(mass=a[7] * MASS)
    return model.modes(THETA * [1, 1, 1 + a[6], 1])[1][0][DOFS]


def test_derivatives_are_those_of_differences_for_all_causes(effects):
    change, slopes = effects(AT)
    np.testing.assert_allclose(change, effects.components(shapes_at(AT)), atol=1e-9)
    np.testing.assert_allclose(slopes, differences(lambda at: effects(at)[0], AT, 1e-5), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(effects(np.zeros(8))[0], 0, atol=1e-9)
    together = effects(np.array([AT, np.zeros(8), AT / 2]))
    for found, alone in zip(together, effects(AT / 2), strict=True):
        np.testing.assert_allclose(found[2], alone, atol=1e-10)


def test_scale_sign_and_phase_of_shapes_mean_nothing(effects):
    shapes = shapes_at(AT)
    turned = shapes * np.array([1j, -2, 3, 0.1 - 0.2j, 1, -1e-6])
    np.testing.assert_allclose(effects.components(turned), effects.components(shapes), atol=1e-9)


def test_components_are_what_mac_leaves(effects):
    """The sum of their squares relative to the reference's is 1 - MAC."""
    shapes = shapes_at(AT)
    squares = np.bincount(effects.modes, effects.components(shapes) ** 2)
    expected = 1 - np.diag(mac(shapes, effects.reference))
    np.testing.assert_allclose(squares / (effects.reference**2).sum(axis=0), expected, rtol=1e-6, atol=1e-9)


def test_models_without_exact_derivatives(fem, effects):
    class Model(OnlyDamaged):
        def modes(self, theta):
            return self.model.modes(theta)

        def damaged(self, damage):
            return Model(self.model.damaged(damage))

        def with_added(self, stiffness=None, mass=None):
            return Model(self.model.with_added(stiffness, mass))

    class Chain:
        model, n_jobs = Model(), None
        simulator_ = type(fem.simulator_)(Model())

    other = ShapeEffects.of(ChangedStructure(Chain, CHANGES), THETA, DOFS)
    exact = effects(AT)
    turned = [np.sign((a * b).sum(axis=0)) for a, b in zip(other.across, effects.across, strict=True)]
    signs = np.concatenate(turned)
    np.testing.assert_allclose(other(AT)[0] * signs, exact[0], atol=1e-9)
    np.testing.assert_allclose(other(AT)[1] * signs[:, np.newaxis], exact[1], rtol=1e-4, atol=1e-4)


def noisy(shapes, n_records, deviation=0.01, random=random):
    largest = np.abs(shapes).max(axis=0)
    return shapes + deviation * largest * random.standard_normal((n_records, *shapes.shape))


def test_change_and_variance_of_records(effects):
    """Means of many records: errors are of unit variance, and the noise is found."""
    healthy, changed = shapes_at(), shapes_at(AT)
    exact = shape_shift([effects], (healthy, -2j * changed), 0.02, MODES)
    np.testing.assert_allclose(exact.measured, effects(AT)[0], atol=1e-9)
    np.testing.assert_allclose(np.diag(exact.covariance), 2 * 0.02**2)
    found = shape_shift([effects], (noisy(healthy, 40), noisy(changed, 10)), "fitted", MODES)
    np.testing.assert_allclose(np.diag(found.covariance), 0.01**2 * (1 / 40 + 1 / 10), rtol=0.3)
    errors = [
        (shift.measured - exact.measured) / np.sqrt(np.diag(shift.covariance))
        for shift in (shape_shift([effects], (noisy(healthy, 4), noisy(changed, 2)), 0.001, MODES) for _ in range(60))
    ]
    assert np.var(errors) == pytest.approx(1, abs=0.15)


def test_sensors_and_modes_that_were_not_measured(effects):
    healthy, changed = noisy(shapes_at(), 6, 1e-6), noisy(shapes_at(AT), 3, 1e-6)
    healthy[:, 0, 2], changed[0, :, 1], changed[:, 1:, 4] = np.nan, np.nan, np.nan
    healthy[:4, 3, 0] = np.nan
    shift = shape_shift([effects], (healthy, changed), 0.01, MODES)
    assert np.bincount(shift.effects.modes, minlength=6).tolist() == [4, 5, 4, 5, 0, 5]
    np.testing.assert_allclose(shift.measured, shift.effects(AT)[0], atol=1e-5)
    per_mode = dict(zip(shift.effects.modes.tolist(), np.diag(shift.covariance).tolist(), strict=True))
    assert per_mode[3] == pytest.approx(0.01**2 * (1 / 6 + 1 / 3))
    assert per_mode[1] == pytest.approx(0.01**2 * (1 / 6 + 1 / 2))


def test_shapes_of_another_mode_are_left_out_with_a_warning(effects):
    healthy, changed = shapes_at(), shapes_at(AT)
    healthy[:, 2] = healthy[:, 3]
    with pytest.warns(UserWarning, match="1 of 6 .*0.5.*f3.*foreign-shapes"):
        shift = shape_shift([effects], (healthy, changed), 0.01, MODES)
    assert 2 not in shift.effects.modes
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        shape_shift([effects], (shapes_at(), changed), 0.01, MODES)


@pytest.mark.parametrize(
    ("shapes", "noise", "message"),
    [
        (shapes_at(), 0.01, "shapes is not a pair"),
        ((shapes_at(), shapes_at()[:3]), 0.01, r"damaged shapes have shape \(3, 6\); expected a row for each of 6"),
        ((shapes_at(), shapes_at()), "fitted", "expected a standard deviation, such as 0.01"),
        ((shapes_at(), shapes_at()), "much", "shape_noise is 'much'"),
        ((shapes_at(), shapes_at()), 0.0, "expected standard deviations above 0"),
        ((shapes_at(), 0 * shapes_at()), 0.01, "damaged shape of mode 0 is zero"),
        ((shapes_at(), np.nan * shapes_at()), 0.01, "no mode has shapes that can be compared"),
    ],
)
def test_errors_of_shapes(effects, shapes, noise, message):
    with pytest.raises(ValueError, match=message):
        shape_shift([effects], shapes, noise, MODES)


def test_effects_at_the_parameters_whose_shapes_are_measured(effects, fem):
    other = ShapeEffects.of(effects.structure, THETA * [1, 1, 1, 2.0], DOFS)
    for both in ([other, effects], [effects, other]):
        shift = shape_shift(both, (noisy(shapes_at(), 2), noisy(shapes_at(AT), 2)), 0.01, MODES)
        np.testing.assert_array_equal(shift.effects.theta, THETA)


@pytest.fixture(scope="module")
def later():
    return make_truss_campaign(damage={"vertical": 0.3}, samples_per_year=120, random_state=1)


def test_shapes_find_what_frequencies_hardly_show(fem, later):
    """The vertical members of the truss: their damage moves no frequency by as much as the noise."""
    records, seed = (later.temperatures, later.frequencies), np.random.RandomState(2)
    states = (TRUSS, TRUSS.damaged({"vertical": 0.3}))
    shapes = tuple(noisy(model.modes(np.ones((1, 4)))[1][0][DOFS], 8, random=seed) for model in states)
    with pytest.warns(UserWarning, match="vertical"):
        without = identify_damage(fem, *records, random_state=0)
    found = identify_damage(fem, *records, shapes=shapes, dofs=DOFS, shape_noise="fitted", random_state=0)
    assert found.most_probable == ("vertical",)
    assert found.table.loc["vertical", "probability"] > max(0.95, without.table.loc["vertical", "probability"])
    bands = [table.loc["vertical", ["ci_low", "ci_high"]] for table in (found.table, without.table)]
    assert bands[0]["ci_low"] < 0.3 < bands[0]["ci_high"]
    assert np.diff(bands[0]) < 0.5 * np.diff(bands[1])
    precision = found.separability.precision
    alone = without.separability.precision
    np.testing.assert_allclose(precision["together_without_shapes"], alone["together"], rtol=1e-9)
    assert list(alone.columns) == ["alone", "together"]
    for name in ("alone", "together"):
        assert (precision[name] < precision[f"{name}_without_shapes"]).all()
    assert precision.loc["vertical", "alone"] < 0.5 * precision.loc["vertical", "alone_without_shapes"]


def test_least_errors_are_those_of_the_information():
    slopes, causes = random.standard_normal((5, 3)), [Cause("a"), Cause("b", of=("b",)), Cause("c", scale=5.0)]
    stiffer = Cause("b stiffer", "stiffening", -1.0, 0.0, of=("b",))
    least = precision(slopes, 5, causes, 0.2)
    np.testing.assert_allclose(least["alone"], 1 / np.linalg.norm(slopes, axis=0))
    covariance = np.linalg.inv(slopes.T @ slopes + np.diag([25.0, 25.0, 1.0]))
    np.testing.assert_allclose(least["together"], np.sqrt(np.diag(covariance)))
    more = precision(slopes[:, [0, 1, 2, 1]], 3, [*causes, stiffer], 0.2)
    assert more.loc["b stiffer", "together"] == pytest.approx(least.loc["b", "together"])
    assert more.columns.tolist() == ["alone", "alone_without_shapes", "together", "together_without_shapes"]
