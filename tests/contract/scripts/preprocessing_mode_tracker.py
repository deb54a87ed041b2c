"""Two modes swap order, and a spurious pole comes."""

import numpy as np

from skthermo.preprocessing import ModeTracker

first, second, spurious = [1.0, 2.0, 1.0], [1.0, 0.0, -1.0], [1.0, -1.0, 1.0]
records = [
    {"frequencies": [2.0, 2.2], "shapes": [first, second]},
    {"frequencies": [2.1, 2.15], "shapes": [second, first]},
    {"frequencies": [2.01, 2.05], "shapes": [spurious, first]},
]
modes = ModeTracker(([2.0, 2.2], np.column_stack([first, second]))).fit_transform(records)
RESULTS = {"frequencies": modes.frequencies, "left over": modes.left_over}
