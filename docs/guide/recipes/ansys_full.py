from ansys.mapdl import reader
from scipy.sparse import triu

directions = "x", "y", "z", "rx", "ry", "rz"


def matrices(file):
    full = reader.read_binary(file)
    dofs, *halves = full.load_km(sort=True)  # node and direction, from 0; stiffness and mass
    held = set(map(tuple, full.const.tolist()))
    free = [i for i, dof in enumerate(map(tuple, dofs.tolist())) if dof not in held]
    K, M = ((half + triu(half, 1).T).tocsc()[free][:, free] for half in halves)
    return K, M, [(node, directions[direction]) for node, direction in dofs[free].tolist()]
