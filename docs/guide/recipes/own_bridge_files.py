"""Writes a log of temperatures, one of frequencies and the matrices of an FE model into a new folder."""

import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.io import savemat

from skthermo.fem import AffineModel, add_noise

folder, random = Path(tempfile.mkdtemp()), np.random.default_rng(0)
L, EI, mass = 4.0, 2.7e10, 1e4  # m, N m2, kg/m; 16 beams along the bridge
k = (
    EI
    / L**3
    * np.array(
        [
            [12, 6 * L, -12, 6 * L],
            [6 * L, 4 * L**2, -6 * L, 2 * L**2],
            [-12, -6 * L, 12, -6 * L],
            [6 * L, 2 * L**2, -6 * L, 4 * L**2],
        ]
    )
)
m = (
    mass
    * L
    / 420
    * np.array(
        [
            [156, 22 * L, 54, -13 * L],
            [22 * L, 4 * L**2, 13 * L, -3 * L**2],
            [54, 13 * L, 156, -22 * L],
            [-13 * L, -3 * L**2, -22 * L, 4 * L**2],
        ]
    )
)


def beams(matrix, numbers):
    total = np.zeros((34, 34))
    for i in numbers:
        total[2 * i : 2 * i + 4, 2 * i : 2 * i + 4] += matrix
    return total


def springs(stiffness, nodes):
    return np.diag(np.isin(np.arange(34), 2 * np.array(nodes)) * stiffness)


terms = {
    "E_side": beams(k, [*range(5), *range(11, 16)]),
    "E_main": beams(k, range(5, 11)),
    "k_bearings": springs(6e8, [0, 16]),
    "k_piers": springs(2e9, [5, 11]),
}
M = beams(m, range(16))
savemat(folder / "bridge.mat", {"K0": sum(terms.values()), "M0": M} | terms)
hours = pd.date_range("2023-03-01", "2024-04-30 23:00", freq="h")
h = np.arange(len(hours))
fronts = 12 * pd.Series(random.normal(0, 1, len(h))).ewm(halflife=36).mean().to_numpy()
air = 10 - 11 * np.cos(2 * np.pi * (h / 24 + 44) / 365) + 4 * np.sin(2 * np.pi * (h - 9) / 24) + fronts
deck = 1 + pd.Series(air).ewm(halflife=5).mean().to_numpy()
T = pd.DataFrame({"T_air": air, "T_deck": deck}, hours.rename("time")).round(1)
T.loc["2023-07-10":"2023-07-12", "T_deck"] = -999  # a sensor fails
core = pd.Series(air).ewm(halflife=10).mean().to_numpy()  # not measured
theta = 1 - np.column_stack([0.003 * (core - 10), 0.0035 * (core - 10), 0.01 * (air - 10), 0 * air])
bridge = AffineModel({(name,): matrix for name, matrix in terms.items()}, M, n_modes=5)
clean = bridge.frequencies(theta[::6] * [0.96, 0.96, 0.9, 1.05])
names = [f"mode {i}" for i in range(1, 6)]
F = pd.DataFrame(add_noise(clean, 0.004, random_state=0).round(4), T.index[::6], names)
F = F.mask(random.random(F.shape) < [0.02, 0.05, 0.1, 0.1, 0.25])  # modes that were not identified
F = F[random.random(len(F)) < 0.9]
T = T.loc[F.index].mask(F.index.to_series().between("2023-11-02", "2023-11-05"))  # the logger fails
for name, table in {"temperatures": T, "frequencies": F}.items():
    table.to_csv(folder / f"{name}.csv", date_format="%Y-%m-%d %H:%M")
