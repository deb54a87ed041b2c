import numpy as np
import openseespy.opensees as ops

from skthermo.fem import ImportedStructure, probe

nodes = {1: (0.0, 0.0), 2: (0.0, 4.0), 3: (6.0, 4.0), 4: (6.0, 0.0)}
members = {"left": (1, 2), "top": (2, 3), "right": (3, 4)}


def build(theta):
    ops.wipe()
    ops.model("basic", "-ndm", 2, "-ndf", 3)
    for node, place in nodes.items():
        ops.node(node, *place)
    for foot in (1, 4):
        ops.fix(foot, 1, 1, 1)
    ops.geomTransf("Linear", 1)
    for number, (ends, multiplier) in enumerate(zip(members.values(), theta), start=1):
        section = 0.12, float(30e9 * multiplier), 9e-4  # area, modulus, second moment of area
        ops.element("elasticBeamColumn", number, *ends, *section, 1, "-mass", 300.0, "-cMass")


def assembled(m, k):
    ops.wipeAnalysis()
    ops.constraints("Plain")
    ops.numberer("Plain")
    ops.system("FullGeneral")
    ops.algorithm("Linear")
    ops.integrator("GimmeMCK", m, 0.0, k)  # m M + k K
    ops.analysis("Transient")
    ops.analyze(1, 0.0)
    n = ops.systemSize()
    return np.reshape(ops.printA("-ret"), (n, n))


def matrices(theta):
    build(theta)
    return assembled(0.0, 1.0), assembled(1.0, 0.0)


each = probe(matrices, list(members), n_modes=4)
frame = ImportedStructure(each, nodes, members, {"columns": ["left", "right"], "beam": ["top"]})
model = frame.assemble(["columns", "beam"], n_modes=4)
