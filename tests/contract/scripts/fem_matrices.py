"""Terms from matrices of a program: differences, calls, and exported files."""

import tempfile

import numpy as np

from skthermo.fem import AffineModel, CallableModel, difference_terms, load_affine, probe


def tower(theta=(1.0, 1.0)):
    base, top = 400.0 * theta[0], 400.0 * theta[1]
    return np.array([[base + top + 100, -top], [-top, top]])


terms = difference_terms(tower(), {"base": tower((2, 1)), "top": tower((1, 2))})
probed = probe(lambda theta: (tower(theta), np.eye(2)), ["base", "top"], n_modes=2, random_state=0)
called = CallableModel(lambda row: np.sqrt(row[0]) * np.array([1.0, 2.0]), ["E"], 2)
with tempfile.TemporaryDirectory() as folder:
    matrices = {"".join(name) or "rest": term.toarray() for name, term in terms.items()}
    np.savez(f"{folder}/tower.npz", K0=tower(), k_base=matrices["base"], k_top=matrices["top"], M0=np.eye(2))
    loaded = load_affine(f"{folder}/tower.npz", n_modes=2)
theta = [[1.0, 1.0], [0.8, 1.1]]
RESULTS = {
    "terms": matrices,
    "affine": AffineModel(terms, np.eye(2), n_modes=2).frequencies(theta),
    "probed": probed.frequencies(theta),
    "loaded": [list(loaded.parameter_names), loaded.frequencies(theta)],
    "called": called.frequencies([[1.0], [4.0]]),
    "called, damaged": called.damaged({"E": 0.19}).frequencies([[1.0]]),
}
TOLERANCES = {"*": {"rtol": 1e-7, "atol": 1e-9}}
