"""Blocks of records, dealt in turn to the folds."""

import numpy as np
import pandas as pd

from skthermo.preprocessing import BlockedKFold

days = pd.DataFrame({"T": np.zeros(60)}, pd.date_range("2025-01-01", periods=60))
RESULTS = {
    "rows": [[train, test] for train, test in BlockedKFold(2, block=3).split(np.zeros((10, 1)))],
    "weeks": BlockedKFold(5, block="7D").fold_of(days),
    "n_splits": BlockedKFold(4).get_n_splits(),
}
