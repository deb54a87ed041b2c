"""Effects of causes: damage, stiffening, parameters and added mass, on frequencies."""

import numpy as np
import pytest

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.studies.identification._causes import read_causes
from skthermo.surrogate.effects import FrequencyEffects, StructuralChanges, typical_rows

YEAR = make_truss_campaign(random_state=1).temperatures
WEATHER = YEAR[::150]  # so few records that they are solved one by one
TRUSS = make_truss()
ASPHALT = np.full(TRUSS.n_dof, 300.0)
CAUSES, CHANGES = read_causes(TRUSS, None, ["top"], ["diagonal"], {"asphalt": ASPHALT})
AT = np.array([0.1, 0.05, 0.0, 0.2, -0.15, -0.1, 0.0, 0.4])


def differences(function, at, step=1e-4):
    steps = step * np.eye(len(at))
    return np.stack([(function(at + h) - function(at - h)) / (2 * step) for h in steps], axis=-1)


def effects_of(fem, changes=CHANGES):
    theta = fem.predict_parameters(WEATHER).to_numpy()
    return FrequencyEffects.over_records(fem, theta, fem.predict(WEATHER).to_numpy(), changes)


def test_causes_have_plain_names_bounds_and_one_sign():
    assert [cause.name for cause in CAUSES] == [
        *("bottom", "top", "diagonal", "vertical", "top stiffer", "diagonal lower", "diagonal higher", "asphalt")
    ]
    assert all(cause.lowest * cause.highest == 0 != cause.highest - cause.lowest for cause in CAUSES)
    opposed = {(a.name, b.name) for a in CAUSES for b in CAUSES if a.excludes(b) and a.name < b.name}
    assert opposed == {("top", "top stiffer"), ("diagonal higher", "diagonal lower")}


@pytest.mark.filterwarnings("ignore:.*outside-reduced-model")
@pytest.mark.parametrize("which", ["full", "reduced"])
def test_effects_are_those_of_simulated_records(fem, reduced_fem, which):
    fem = fem if which == "full" else reduced_fem
    effects = effects_of(fem)
    change, slopes = effects(AT)
    changed = fem.simulate(
        WEATHER,
        damage={"bottom": 0.1, "top": 1 - 0.95 * 1.15, "vertical": 0.2},
        parameters={"diagonal": 0.9},
        mass=0.4 * ASPHALT,
    )
    tolerance = 1e-9 if which == "full" else 3e-5
    np.testing.assert_allclose(change, np.log(changed / fem.predict(WEATHER)).mean(axis=0), atol=tolerance)
    np.testing.assert_allclose(slopes, differences(lambda at: effects(at)[0], AT), rtol=1e-4, atol=1e-6)
    np.testing.assert_allclose(effects(np.zeros(8))[0], 0, atol=1e-12)


def test_means_over_a_year_need_few_rows(fem):
    """Modes that were measured in parts of the year, or never, which then counts as always."""
    theta, F = fem.predict_parameters(YEAR).to_numpy(copy=True), fem.predict(YEAR).to_numpy(copy=True)
    damaged = fem.simulate(YEAR, damage={"bottom": 0.2, "top": 0.1})
    ratios = np.log(damaged / fem.predict(YEAR)).to_numpy(copy=True)
    F[ratios[:, 1] > np.quantile(ratios[:, 1], 0.1), 1], F[::3, 2], F[:, 4] = np.nan, np.nan, np.nan
    theta[7], ratios[7] = np.nan, np.nan
    found = FrequencyEffects.over_records(fem, theta, F, CHANGES)
    assert len(found.theta) == 9
    expected = np.nanmean(np.where(np.isnan(F) & ~np.isnan(F).all(axis=0), np.nan, ratios), axis=0)
    amounts = np.array([0.2, 0.1, 0, 0, 0, 0, 0, 0])
    np.testing.assert_allclose(found(amounts)[0], expected, rtol=1e-3)
    assert abs(np.nanmean(ratios, axis=0)[1] / expected[1] - 1) > 3e-3  # gaps matter


def test_typical_rows_have_the_moments_of_all_rows():
    random = np.random.RandomState(0)
    theta = np.exp(random.standard_normal((200, 3)) @ random.uniform(-0.1, 0.1, (3, 5)))
    present = random.uniform(size=(200, 4)) > np.linspace(0, 0.9, 4)
    rows, weights = typical_rows(theta, present)
    assert rows.shape == (7, 5)
    shares, centre = present / present.sum(axis=0), np.log(theta).mean(axis=0)
    axes = np.linalg.svd(np.log(theta) - centre)[2][:3]
    few, all_rows = ((np.log(table) - centre) @ axes.T for table in (rows, theta))
    for power in (0, 1, 2):
        np.testing.assert_allclose((few**power).T @ weights, (all_rows**power).T @ shares, atol=1e-12)
    assert typical_rows(np.tile(theta[:1], (9, 1)), present[:9])[0] == pytest.approx(theta[:1])


def test_many_sets_of_amounts_at_once(fem):
    effects, sets = effects_of(fem), np.random.RandomState(0).uniform(0, 0.4, (30, 8)) * np.sign(CHANGES.bounds.sum(1))
    change, slopes = effects(sets)
    assert slopes.shape == (30, 6, 8)
    for row in (0, 13, 29):
        for found, alone in zip((change[row], slopes[row]), effects(sets[row]), strict=True):
            np.testing.assert_allclose(found, alone, rtol=1e-9, atol=1e-12)


def test_mass_in_proportion_lowers_all_frequencies_alike(fem):
    """K phi = lambda (1 + a) M phi: every ln f changes by -ln(1 + a) / 2."""
    mass = TRUSS.matrices(np.ones(4))[1]
    _, changes = read_causes(TRUSS, ["top"], added_mass={"twice as heavy": mass})
    nominal = effects_of(fem, changes).nominal()
    healthy = TRUSS.frequencies([[1, 1, 1, 1]])
    factors = fem.aligner_.inverse_transform(healthy) / healthy
    change, slopes = nominal(np.array([0.0, 0.5]))
    np.testing.assert_allclose(np.exp(change), 1.5**-0.5, rtol=1e-9)
    np.testing.assert_allclose(slopes[:, 1], -0.5 / 1.5, rtol=1e-6)
    assert (factors != 1).all()


class OnlyDamaged:
    """A third-party model with damage and added mass, but without parameters for them."""

    parameter_names, n_modes, groups = TRUSS.parameter_names, TRUSS.n_modes, TRUSS.groups

    def __init__(self, model=TRUSS):
        self.model = model

    def frequencies(self, theta):
        return self.model.frequencies(theta)

    def damaged(self, damage):
        return OnlyDamaged(self.model.damaged(damage))

    def with_added(self, stiffness=None, mass=None):
        return OnlyDamaged(self.model.with_added(stiffness, mass))


def test_models_without_parameters_for_amounts(fem):
    class Chain:
        model, n_jobs, aligner_ = OnlyDamaged(), None, fem.aligner_
        simulator_ = type(fem.simulator_)(OnlyDamaged())

    theta = fem.predict_parameters(WEATHER[:3]).to_numpy()
    records = theta, np.ones((3, 6)), CHANGES
    for found, exact in zip(
        FrequencyEffects.over_records(Chain, *records)(AT),
        FrequencyEffects.over_records(fem, *records)(AT),
        strict=True,
    ):
        np.testing.assert_allclose(found, exact, rtol=1e-4, atol=1e-7)


def test_factors_and_their_slopes():
    changes = StructuralChanges.of_damage(TRUSS, ["top", "diagonal"])
    at = np.array([0.3, -0.1])
    np.testing.assert_allclose(changes.factors(at), [1, 1, 1, 1, 0.7, 1.1])
    slopes = differences(lambda a: np.log(changes.factors(a)), at)
    np.testing.assert_allclose(changes.slopes(at), slopes, atol=1e-7)
    np.testing.assert_allclose(changes.near(), [[1, 1]] * 4 + [[1 - 0.95 / 3 - 0.02, 1.02]] * 2)
    assert changes.are_near(np.array([[0.3, 0.0], [0.3, 0.4], [-0.2, 0.1]])).tolist() == [True, False, True]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"stiffening": ["deck"]}, r"stiffening names \['deck'\]; expected some of"),
        ({"parameters": ["E_deck"]}, r"parameters names \['E_deck'\]; expected some of"),
        ({"parameters": True}, "parameters is True; expected a list of names"),
        ({"added_mass": ASPHALT}, "expected a mapping of name to masses in kg"),
        ({"added_mass": {"snow": ASPHALT[:3]}}, r"added_mass 'snow': .*has shape \(3,\)"),
        ({"added_mass": {"snow": 0 * ASPHALT}}, "'snow' is 0 everywhere"),
        ({"added_mass": {"top": ASPHALT}}, r"the causes \['top'\] have the same names"),
        (
            {"added_mass": {"something else": ASPHALT}},
            r"the names \['something else'\]; expected other names",
        ),
        (
            {"added_mass": {"nothing left": np.full(23, -1e6)}},
            "'nothing left': the mass, with what is added, has a negative eigenvalue",
        ),
    ],
)
def test_errors_of_arguments(arguments, message):
    with pytest.raises(ValueError, match=message):
        read_causes(TRUSS, None, **arguments)
