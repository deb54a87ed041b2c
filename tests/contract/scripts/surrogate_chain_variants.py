"""The same chain with other records, another model, resampled records; arrays in, arrays out; pickled."""

import pickle

import numpy as np
from sklearn.base import clone

from skthermo.datasets import make_truss, make_truss_campaign
from skthermo.surrogate import DataInformedFEM, refitted, resampled, with_model

year, later = (make_truss_campaign(random_state=seed) for seed in (0, 1))
truss, T = make_truss(), year.temperatures
fem = DataInformedFEM(truss, random_state=0).fit(T, year.frequencies)
arrays = clone(fem).fit(T.to_numpy(), year.frequencies.to_numpy())
others = {
    "refitted": refitted(fem, later.temperatures, later.frequencies),
    "resampled": resampled(fem, random_state=1),
    "damaged": with_model(fem, truss.damaged({"bottom": 0.1})),
}
RESULTS = {name: (other.predict(T) / fem.predict(T)).mean() for name, other in others.items()}
RESULTS |= {
    "pickled": bool(pickle.loads(pickle.dumps(fem)).predict(T).equals(fem.predict(T))),
    "arrays": bool(np.allclose(arrays.predict(T.to_numpy()), fem.predict(T), rtol=2e-3)),
    "type": type(arrays.predict(T.to_numpy())).__name__,
}
TOLERANCES = {"*": {"rtol": 0.003}}
