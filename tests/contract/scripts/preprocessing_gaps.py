"""Missing values: neighbours fill them as scikit-learn's imputer does, or sensors of one role."""

import numpy as np
import pandas as pd

from skthermo.datasets import make_truss_campaign
from skthermo.preprocessing import KNNGapImputer, SensorMeans

F = make_truss_campaign(samples_per_year=60, random_state=0).frequencies
F.iloc[3, 1] = F.iloc[10, 4] = np.nan
T = pd.DataFrame({"T1": [4.0, 8.0, np.nan], "T2": [6.0, 10.0, 3.0], "slab": [5.0, 7.0, 6.0]})
RESULTS = {
    "filled": KNNGapImputer().fit_transform(F).iloc[[3, 10]],
    "nearest": KNNGapImputer(n_neighbors=1, weights="distance").fit(F).transform(F).iloc[[3, 10]],
    "means": SensorMeans({"T1": "air", "T2": "air", "slab": "deck"}).fit_transform(T),
}
