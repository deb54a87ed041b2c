import numpy as np
from Pynite import FEModel3D

from skthermo.fem import CallableModel, probe


def frame(theta):
    frame = FEModel3D()
    frame.add_section("box", A=0.12, Iy=1.6e-3, Iz=9e-4, J=2e-3)
    for material, multiplier in zip(("columns", "beam"), theta):
        frame.add_material(material, E=30e9 * multiplier, G=12.5e9 * multiplier, nu=0.2, rho=2500.0)
    for name, place in {"a": (0, 0, 0), "b": (0, 4, 0), "c": (6, 4, 0), "d": (6, 0, 0)}.items():
        frame.add_node(name, *place)
    for name, ends, material in (("left", "ab", "columns"), ("top", "bc", "beam"), ("right", "cd", "columns")):
        frame.add_member(name, *ends, material, "box")
    for foot in "ad":
        frame.def_support(foot, *[True] * 6)
    frame.add_member_self_weight("FY", -1.0, "weight")  # PyNite takes mass from loads: with gravity=1
    frame.add_load_combo("mass", {"weight": 1.0})
    return frame


def matrices(theta):
    model = frame(theta)
    model.analyze_linear()  # numbers the nodes
    free = [6 * model.nodes[name].ID + i for name in "bc" for i in range(6)]
    K, M = model.Ke("mass").tocsc(), model.M("mass", gravity=1.0).tocsc()
    return K[free][:, free], M[free][:, free]


def frequencies(theta):
    model = frame(theta)
    model.analyze_modal(num_modes=6, mass_combo_name="mass", gravity=1.0)
    return np.sort(model.frequencies)


fast = probe(matrices, ["columns", "beam"], n_modes=6)
slow = CallableModel(frequencies, ["columns", "beam"], 6, cache="frame.solved")
