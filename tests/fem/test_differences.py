"""Terms from whole matrices: recovered exactly where the stiffness is linear, refused where it is not."""

import warnings

import numpy as np
import pytest
import scipy.sparse
from hypothesis import given, settings
from hypothesis import strategies as st

from skthermo.exceptions import ModelWarning
from skthermo.fem import AffineModel, Beam, Structure, difference_terms, probe
from tests.fem.exported_files import TERMS, TOTAL, M, assert_same, spring

REST = spring(3, 3, 500.0) + spring(0, 5, 20.0)
NAMES = list(TERMS)
FACTORS = st.sampled_from([0.5, 0.9, 1.1, 2.0, 3.0, 10.0])


def whole(multipliers, rest=REST):
    """The stiffness at some multipliers, the others being 1."""
    return rest + sum(multipliers.get(name, 1.0) * term for name, term in TERMS.items())


def changed(factors):
    return {name: whole({name: factor}) for name, factor in factors.items()}


@settings(max_examples=10)
@given(factors=st.fixed_dictionaries(dict.fromkeys(NAMES, FACTORS)), sparse=st.booleans(), check=FACTORS)
def test_a_linear_stiffness_is_recovered_at_any_factors(factors, sparse, check):
    form = scipy.sparse.csr_array if sparse else np.asarray
    others = {name: form(matrix) for name, matrix in changed(factors).items()}
    at = dict.fromkeys(NAMES, check)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        terms = difference_terms(form(whole({})), others, factor=factors, check=(at, form(whole(at))))
    assert list(terms) == [*((name,) for name in factors), ()]
    for key, term in terms.items():
        np.testing.assert_allclose(term.toarray(), TERMS[key[0]] if key else REST, rtol=1e-11, atol=1e-9)


def test_without_a_rest_there_is_no_constant_term():
    terms = difference_terms(TOTAL, {name: TOTAL + term for name, term in TERMS.items()})
    assert list(terms) == [(name,) for name in NAMES]


def test_the_terms_are_those_of_probe():
    terms = difference_terms(whole({}), changed(dict.fromkeys(NAMES, 2.0)))
    probed = probe(lambda theta: (whole(dict(zip(NAMES, theta, strict=True))), M), NAMES, n_modes=4, random_state=0)
    assert_same(AffineModel(terms, M, n_modes=4), probed)


def cantilever(depth=1.0, modulus=1.0, n=4):
    nodes = {i: (1.0 * i, 0.0, 0.0) for i in range(n + 1)}
    moments = {"I_yy": 0.025 * depth**3, "I_zz": 0.025 * depth, "J": 0.04 * depth}
    section = {"E": 30e9 * modulus, "G": 12e9 * modulus, "A": 0.3 * depth, "density": 2500.0} | moments
    members = {i: Beam(i, i + 1, **section) for i in range(n)}
    structure = Structure(nodes, members, {0: ["x", "y", "z", "rx", "ry", "rz"]}, {"all": list(members)})
    return structure.assemble("all", n_modes=1).matrices([1.0])[0]


def test_a_thickness_is_not_a_modulus():
    with pytest.raises(ValueError, match=r"'deck' is more than the whole .*not a thickness"):
        difference_terms(cantilever(), {"deck": cantilever(depth=2.0)})
    assert list(difference_terms(cantilever(), {"deck": cantilever(modulus=2.0)})) == [("deck",)]


@pytest.mark.parametrize(("factor", "stated"), [(2.0, 1.5), (0.25, 0.5)])
def test_a_change_larger_than_stated_names_the_parameter_and_a_smaller_one_is_doubted(factor, stated):
    with pytest.raises(ValueError, match=r"'E_10'.*factor"):
        difference_terms(whole({}), {"E_10": whole({"E_10": factor})}, factor=stated)
    with pytest.warns(ModelWarning, match=f"'deck'.* {stated:g} .*{factor:g}.*doubtful-factor"):
        difference_terms(cantilever(), {"deck": cantilever(modulus=stated)}, factor=factor)


def test_groups_that_share_members_are_named():
    matrices = {"left": whole({"E_2": 2, "k_base": 2}), "right": whole({"E_2": 2}), "far": whole({"E_10": 2})}
    with pytest.raises(ValueError, match=r"\['left', 'right'\] are together more than the whole .*share no members"):
        difference_terms(whole({}), matrices)


@pytest.mark.parametrize(
    ("matrices", "options", "message"),
    [
        ({"E_2": whole({})}, {}, "'E_2' changes nothing"),
        ({"E_2": whole({"E_2": 0.5})}, {}, "'E_2' takes stiffness away"),
        ({"E_2": np.eye(3)}, {}, r"changed\['E_2'\] has shape \(3, 3\)"),
        ({"E_2": np.triu(TOTAL)}, {}, r"changed\['E_2'\] is not symmetric"),
        ({"E_2": whole({"E_2": 2})}, {"factor": 1.0}, "factor of 'E_2' is 1.0"),
        ({"E_2": whole({"E_2": 2})}, {"factor": -2.0}, "factor of 'E_2' is -2.0"),
        ({"E_2": whole({"E_2": 2})}, {"factor": {"E": 2.0}}, "factor names"),
        ({}, {}, "changed is"),
        ([TOTAL], {}, "changed is"),
    ],
)
def test_errors_name_the_parameter(matrices, options, message):
    with pytest.raises(ValueError, match=message):
        difference_terms(whole({}), matrices, **options)


def test_parameters_that_act_together_fail_the_check():
    at = {"E_2": 1.5, "E_10": 1.5}
    terms = difference_terms(whole({}), changed({"E_2": 2.0, "E_10": 2.0}), check=(at, whole(at)))
    assert ("E_2",) in terms
    product = whole(at) + 0.25 * spring(2, 2, 900.0)
    with pytest.raises(ValueError, match=r"differs from the sum .*most in row 2.*linear in \['E_2', 'E_10'\]"):
        difference_terms(whole({}), changed({"E_2": 2.0, "E_10": 2.0}), check=(at, product))
    for wrong in ({"E": 2.0}, {"E_2": "2"}, 3):
        with pytest.raises(ValueError, match="check"):
            difference_terms(whole({}), changed({"E_2": 2.0}), check=(wrong, TOTAL))


@pytest.mark.parametrize("digits", [9, 16])
def test_rounded_files_leave_no_doubt(digits):
    def rounded(matrix):
        return np.vectorize(lambda value: float(f"{value:.{digits - 1}e}"))(matrix)

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        terms = difference_terms(rounded(whole({})), {n: rounded(whole({n: 2.0})) for n in NAMES})
    np.testing.assert_allclose(sum(term.toarray() for term in terms.values()), rounded(whole({})), rtol=1e-14)
    for name in NAMES:
        np.testing.assert_allclose(terms[name,].toarray(), TERMS[name], rtol=10.0 ** (2 - digits), atol=1e-5)
