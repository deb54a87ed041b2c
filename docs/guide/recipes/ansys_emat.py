import numpy as np
from ansys.mapdl import reader
from scipy.sparse import csc_array

from skthermo.fem import AffineModel

emat = reader.read_binary("bridge.emat")
n = emat.n_nodes * emat.n_dof
directions = "x", "y", "z", "rx", "ry", "rz"
labels = [(node, direction) for node in emat.neqv.tolist() for direction in directions[: emat.n_dof]]
free = [i for i, label in enumerate(labels) if label not in held]


def whole(element, kind):
    rows, data = emat.read_element(element)
    values = np.zeros((len(rows), len(rows)))
    values[np.tril_indices(len(rows))] = data[kind]
    values += np.tril(values, -1).T
    grid = np.repeat(rows, len(rows)), np.tile(rows, len(rows))
    return csc_array((values.ravel(), grid), shape=(n, n))[free][:, free]


numbers = emat.eeqv.tolist()  # of the elements, in the order of the file
inside = {name: [numbers.index(element) for element in elements] for name, elements in components.items()}
terms = {(name,): sum(whole(i, "stress") for i in elements) for name, elements in inside.items()}
others = set(range(emat.n_elements)).difference(*inside.values())
terms[()] = sum((whole(i, "stress") for i in others), csc_array((len(free), len(free))))
mass = sum(whole(i, "mass") for i in range(emat.n_elements))
model = AffineModel(terms, mass, n_modes=4, dofs=[labels[i] for i in free])
