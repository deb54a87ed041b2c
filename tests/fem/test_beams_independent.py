"""Beams against an independent program, PyNiteFEA.

Its stiffness agrees in full, releases and springs included. Its mass does not: the inertia of twist
is made from the torsion constant instead of the polar moment of area, and releases are condensed
by the mass matrix's own partition instead of the stiffness's. So frequencies are compared without
releases, and with ``I_p`` set to the torsion constant.
"""

import numpy as np
import pytest

from skthermo.fem import Beam, Spring, Structure
from tests.fem.test_beams import SECTION

pynite = pytest.importorskip("Pynite", reason="PyNiteFEA is not installed: the extra 'oracle' brings it")

NODES = {"a": (0, 0, 0), "b": (0.5, 4, 0.3), "c": (5, 4.5, 1), "d": (5.5, 0, 1.5)}
MEMBERS = {"left": ("a", "b"), "beam": ("b", "c"), "right": ("c", "d")}


def theirs(released=()):
    model = pynite.FEModel3D()
    model.add_material("steel", E=SECTION["E"], G=SECTION["G"], nu=0.3, rho=SECTION["density"])
    model.add_section("section", SECTION["A"], SECTION["I_yy"], SECTION["I_zz"], SECTION["J"])
    for name, (x, y, z) in NODES.items():
        model.add_node(name, float(x), float(y), float(z))
    for name, (start, end) in MEMBERS.items():
        model.add_member(name, start, end, "steel", "section")
    model.def_releases("beam", **dict.fromkeys(released, True))
    model.def_support_spring("b", "DX", 3e6)
    model.def_support_spring("c", "RY", 5e6)
    for foot in ("a", "d"):
        model.def_support(foot, *[True] * 6)
    model.add_member_self_weight("FY", -1.0, "weight")
    model.add_load_combo("mass", {"weight": 1.0})
    return model


def ours(**releases):
    """Its local z is level: the second vector below, which our orientation is."""
    beams = {}
    for name, (start, end) in MEMBERS.items():
        x = np.subtract(NODES[end], NODES[start])
        level = np.cross([x[0], 0, x[2]], x) if x[1] > 0 else np.cross(x, [x[0], 0, x[2]])
        options = releases if name == "beam" else {}
        beams[name] = Beam(start, end, **SECTION, I_p=SECTION["J"], orientation=tuple(level), **options)
    springs = {"push": Spring("b", "x", 3e6), "turn": Spring("c", "ry", 5e6)}
    fixed = dict.fromkeys(("a", "d"), "xyz rx ry rz")
    return Structure(NODES, beams | springs, fixed, {"all": list(MEMBERS)}).assemble(["all"])


@pytest.mark.parametrize(
    ("released", "releases"),
    [
        ((), {}),
        (("Rzi", "Ryj"), {"release_start": ("rz",), "release_end": ("ry",)}),
        (("Dxi",), {"release_start": "x"}),
    ],
    ids=["rigid", "hinged", "sliding"],
)
def test_stiffness_agrees_releases_and_springs_included(released, releases):
    model = theirs(released)
    model.analyze_linear(check_statics=False)
    whole = np.asarray(model.Ke("mass", sparse=True).todense())
    free = [6 * model.nodes[name].ID + i for name in ("b", "c") for i in range(6)]
    stiffness = ours(**releases).matrices([1.0])[0].toarray()
    np.testing.assert_allclose(stiffness, whole[np.ix_(free, free)], atol=1e-9 * np.abs(stiffness).max())


def test_frequencies_agree_without_releases():
    model = theirs()
    model.analyze_modal(num_modes=6, mass_combo_name="mass", gravity=1.0)
    np.testing.assert_allclose(ours().frequencies([[1.0]])[0], np.sort(model.frequencies), rtol=1e-6)
