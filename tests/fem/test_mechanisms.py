"""A mechanism is distinguished from a fine mesh."""

import numpy as np
import pytest

from skthermo.fem import AffineModel, Beam, Structure
from tests.fem.test_beams import SECTION

MESHES = [((1.0, 0.0, 0.0), 250), pytest.param((1.0, 2.0, 3.0), 2000, marks=pytest.mark.nightly)]


def cantilever(n_beams, supports, *, direction=(1.0, 2.0, 3.0)):
    """A line of beams, 10 m long."""
    along = np.array(direction) / np.linalg.norm(direction)
    nodes = {i: tuple(along * 10 * i / n_beams) for i in range(n_beams + 1)}
    beams = {f"beam {i}": Beam(i, i + 1, **SECTION) for i in range(n_beams)}
    return Structure(nodes, beams, supports, {"all": list(beams)}).assemble(["all"], n_modes=2)


@pytest.mark.parametrize(("direction", "n_beams"), MESHES)
def test_a_fine_mesh_is_no_mechanism(direction, n_beams):
    exact = 1.875104068711961**2 / (2 * np.pi) * np.sqrt(210e9 * 1e-5 / (7850 * 0.02)) / 10**2
    frequencies = cantilever(n_beams, {0: "xyz rx ry rz"}, direction=direction).frequencies([[1.0]])
    np.testing.assert_allclose(frequencies[0, 0], exact, rtol=2e-3)


@pytest.mark.parametrize(("direction", "finest"), MESHES)
def test_a_mechanism_is_one_in_every_mesh(direction, finest):
    for n_beams in (5, 50):
        for ends in ({}, {0: "xyz"}, {0: "xyz", n_beams: "xyz"}):
            with pytest.raises(ValueError, match="the structure is a mechanism"):
                cantilever(n_beams, ends, direction=direction)
    with pytest.raises(ValueError, match="the structure is a mechanism"):
        cantilever(finest, {0: "xyz", finest: "xyz"}, direction=direction)


@pytest.mark.parametrize("n_springs", [5, 300])
def test_constraints_by_multipliers_are_no_mechanism(n_springs):
    springs = 2 * np.eye(n_springs + 1) - np.eye(n_springs + 1, k=1) - np.eye(n_springs + 1, k=-1)
    springs[-1], springs[:, -1] = 0.0, 0.0
    springs[-1, 2] = springs[2, -1] = 1.0  # the third mass does not move
    with pytest.raises(ValueError, match=f"Lagrange.*|degree of freedom {n_springs}") as refused:
        AffineModel({"k": springs}, np.diag([*np.ones(n_springs), 0.0]))
    assert "mechanism" not in str(refused.value)
