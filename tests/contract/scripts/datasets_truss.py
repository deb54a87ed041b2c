"""The truss of the paper: nominal frequencies, a damaged chord, the modulus of steel."""

from skthermo.datasets import make_truss, steel_modulus, truss_structure

truss = make_truss()
RESULTS = {
    "parameters": list(truss.parameter_names),
    "nominal": truss.frequencies([[1.0] * 4]),
    "SB-50": truss.damaged({"bottom": 0.5}).frequencies([[1.0] * 4]),
    "modulus": steel_modulus([-10.0, 20.0, 40.0]),
    "bottom chord": sorted(truss_structure().groups["bottom"], key=int),
    "degrees of freedom": len(truss_structure().dofs),
}
TOLERANCES = {"*": {"rtol": 1e-8}}
