import numpy as np
from skfem import Basis, BilinearForm, ElementQuad2, ElementVector, MeshQuad
from skfem.helpers import dot
from skfem.models.elasticity import lame_parameters, linear_elasticity

from skthermo.fem import AffineModel

mesh = MeshQuad.init_tensor(np.linspace(0, 6, 13), np.linspace(0, 0.4, 3))
mesh = mesh.with_subdomains({"E_root": lambda x: x[0] < 3, "E_tip": lambda x: x[0] > 3})
element = ElementVector(ElementQuad2())
whole = Basis(mesh, element)
free = whole.complement_dofs(whole.get_dofs(lambda x: x[0] == 0))  # a wall holds the left end
form = linear_elasticity(*lame_parameters(30e9, 0.2))
parts = {name: form.assemble(Basis(mesh, element, elements=name)) for name in mesh.subdomains}
mass = BilinearForm(lambda u, v, w: 2500.0 * dot(u, v)).assemble(whole)
terms = {(name,): K[free][:, free] for name, K in parts.items()}
model = AffineModel(terms, mass[free][:, free], n_modes=4)
