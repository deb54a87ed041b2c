"""Sections against numerical integration and closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from skthermo.datasets._sections import box, channel, pipe, rectangle, tee, times

STEPS = (np.arange(2000) + 0.5) / 2000


def integrated(width, depth, steel):
    """Area and second moments of the steel inside a rectangle of cells."""
    y, z = np.meshgrid(width * STEPS, depth * STEPS)
    cells = steel(y, z)
    cell = width * depth / STEPS.size**2
    y, z = y[cells] - y[cells].mean(), z[cells] - z[cells].mean()
    return {"A": cells.sum() * cell, "I_yy": (z**2).sum() * cell, "I_zz": (y**2).sum() * cell}


CASES = {
    "box": (box(1.25, 0.8, 0.05), 0.8, 1.25, lambda y, z: (abs(y - 0.4) > 0.35) | (abs(z - 0.625) > 0.575)),
    "tee": (tee(1.0, 0.5, 0.1), 0.5, 1.0, lambda y, z: (z > 0.9) | (abs(y - 0.25) < 0.05)),
    "channel": (channel(0.25, 0.2, 0.01), 0.2, 0.25, lambda y, z: (y < 0.01) | (abs(z - 0.125) > 0.115)),
    "rectangle": (rectangle(0.31, 0.05), 0.05, 0.31, lambda y, z: y > 0),
    "pipe": (pipe(0.75, 0.05), 0.75, 0.75, lambda y, z: abs(np.hypot(y - 0.375, z - 0.375) - 0.35) < 0.025),
}


@pytest.mark.parametrize("case", CASES)
def test_area_and_second_moments(case):
    section, width, depth, steel = CASES[case]
    found = integrated(width, depth, steel)
    assert_allclose([section[name] for name in found], list(found.values()), rtol=1e-4)


def test_torsion_constants():
    assert_allclose(rectangle(1.0, 1.0)["J"], 0.1408, rtol=2e-3)  # Timoshenko: 0.1406 b^4
    assert_allclose(rectangle(10.0, 0.1)["J"], 10 * 0.1**3 / 3, rtol=0.01)
    ring = pipe(1.0, 0.01)
    assert_allclose(ring["J"], ring["I_yy"] + ring["I_zz"])
    assert_allclose(box(1.0, 1.0, 0.01)["J"], 0.99**3 * 0.01)  # Bredt, 4 A^2 t / perimeter
    assert_allclose(tee(1.2, 0.6, 0.08)["J"], (0.6 + 1.12) * 0.08**3 / 3)
    assert_allclose(channel(0.3, 0.2, 0.01)["J"], (0.3 + 2 * 0.19) * 0.01**3 / 3)
    assert times(3, ring)["A"] == 3 * ring["A"]
