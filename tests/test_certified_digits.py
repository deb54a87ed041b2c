"""How many digits agree with published values, as statistical software is held against certified regressions."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo.datasets import make_kw51
from skthermo.fem import Beam, PointMass, Structure
from skthermo.preprocessing import HingeFeatures

STEEL = {"E": 200e9, "G": 200e9 / 2.6}
CLAMPED = "xyz rx ry rz"
IN_PLANE = "z rx ry"


def digits(values, certified):
    """Agreeing significant digits of each value, -log10 of its relative error; 15 at most."""
    error = np.abs(np.asarray(values, dtype=float) / certified - 1)
    return -np.log10(np.maximum(error, 1e-15))


def frequencies(structure, n_modes):
    return structure.assemble(["all"], n_modes=n_modes).frequencies([[1.0]])[0]


def beams_along(points, section):
    return {f"beam {i}": Beam(i, i + 1, **section) for i in range(len(points) - 1)}


def test_pinned_double_cross():
    """NAFEMS FV2: eight arms of 5 m, pinned at their ends, move within their plane."""
    side, n = 0.125, 8
    inertia = side**4 / 12
    section = STEEL | {"A": side**2, "I_yy": inertia, "I_zz": inertia, "J": 2 * inertia, "density": 8000.0}
    nodes, supports, beams = {"centre": (0.0, 0.0, 0.0)}, {"centre": IN_PLANE}, {}
    for arm in range(8):
        direction = np.array([np.cos(arm * np.pi / 4), np.sin(arm * np.pi / 4), 0])
        path = ["centre", *((arm, i) for i in range(1, n + 1))]
        nodes |= {point: tuple(5.0 * point[1] / n * direction) for point in path[1:]}
        supports |= {point: IN_PLANE if point[1] < n else "xyz rx ry" for point in path[1:]}
        beams |= {f"{arm} {i}": Beam(path[i], path[i + 1], **section) for i in range(n)}
    found = frequencies(Structure(nodes, beams, supports, {"all": list(beams)}), 16)
    target = np.repeat([11.336, 17.709, 45.345, 57.390], [1, 7, 1, 7])
    moves_centre = np.isin(np.arange(16), [1, 2, 9, 10])  # these also stretch arms, which the target leaves out
    assert (digits(found, target) > np.where(moves_centre, 2.2, 3.3)).all()


def test_cantilever_with_masses_beside_its_axis():
    """NAFEMS FV4: 10 m, masses of 10 and 1 tonnes on rigid arms of 2 m; its target has shear, `Beam` none."""
    diameter, points = 0.5, np.linspace(0, 10, 11)
    inertia = np.pi * diameter**4 / 64
    section = STEEL | {"A": np.pi * diameter**2 / 4, "I_yy": inertia, "I_zz": inertia, "J": 2 * inertia}
    section["density"] = 7800.0
    rigid = section | {"E": 1e4 * STEEL["E"], "G": 1e4 * STEEL["G"], "density": 0.0}
    beams = beams_along(points, section)
    structure = Structure(
        {i: (x, 0, 0) for i, x in enumerate(points)} | {"left": (10, 2, 0), "right": (10, -2, 0)},
        beams
        | {"to left": Beam(10, "left", **rigid), "to right": Beam(10, "right", **rigid)}
        | {"heavy": PointMass("left", 10e3), "light": PointMass("right", 1e3)},
        {0: CLAMPED},
        {"all": list(beams)},
    )
    agreeing = digits(frequencies(structure, 6), [1.723, 1.727, 7.413, 9.972, 18.155, 26.957])
    assert (agreeing > [2.4, 2.4, 2.3, 2.3, 1.9, 1.9]).all()


def test_the_railway_bridge_before_updating():
    """Kamali, Ceravolo and Marzani (2026), Table A.5; drawings of the bridge are not published in full."""
    model = make_kw51()
    found = model.frequencies(np.ones((1, len(model.parameter_names))))[0]
    assert digits(found, [0.4735, 1.1080, 1.7190, 2.3450, 2.4870, 2.7810]).min() > 1.7


@pytest.mark.skipif("SKTHERMO_DATA" not in os.environ, reason="SKTHERMO_DATA does not name a folder with the real data")
def test_slopes_and_scatter_of_daily_medians():
    """The sixth mode of KW51 before its retrofit: two lines that meet at the median temperature."""
    table = pd.read_csv(Path(os.environ["SKTHERMO_DATA"]) / "kw51" / "kw51_mode6_daily.csv", index_col=0)
    table = table[table.index < "2019-05-15"].dropna()
    assert len(table) == 174
    T, f = table[["T"]].to_numpy(), table["f"].to_numpy()
    lines = make_pipeline(HingeFeatures(n_knots=1), LinearRegression()).fit(T, f)
    cold, change = lines[-1].coef_
    residuals = f - lines.predict(T)

    centred = np.longdouble(T[:, 0]) - np.longdouble(np.median(T))
    below, above = np.minimum(centred, 0), np.maximum(centred, 0)
    below, above, right = (x - x.mean() for x in (below, above, np.longdouble(f)))
    (a, b, c), (u, v) = (below @ below, below @ above, above @ above), (below @ right, above @ right)
    slopes = np.array([c * u - b * v, a * v - b * u]) / (a * c - b * b)
    scatter = np.sqrt(np.mean((right - slopes[0] * below - slopes[1] * above) ** 2))
    found = [cold, cold + change, residuals.std()]
    assert digits(found, np.array([*slopes, scatter], dtype=float)).min() > 10
