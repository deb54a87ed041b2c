"""Frequencies moved to those of a model, by differences or by factors."""

import numpy as np

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.preprocessing import BiasAligner

F = make_truss_campaign(samples_per_year=60, random_state=0).frequencies
shift, scale = BiasAligner(make_truss()).fit(F), BiasAligner(F.mean() * 1.01, method="scale").fit(F)
RESULTS = {
    "shifted": shift.transform(F).mean(),
    "scaled": scale.transform(F).mean(),
    "back": bool(np.allclose(shift.inverse_transform(shift.transform(F)), F)),
    "by values": BiasAligner([4.0, 9.0]).fit([[3.9, 9.3], [4.3, 9.5]]).transform([[4.1, 9.5]]),
}
