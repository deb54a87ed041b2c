"""Earlier temperatures as further columns; records of fit are the history of transform."""

import pandas as pd

from skthermo.preprocessing import LagFeatures

hours = pd.to_datetime(["2025-01-01 00:00", "2025-01-01 01:00", "2025-01-01 03:00"])
T = pd.DataFrame({"T1": [4.0, 5.0, 7.0]}, index=hours)
later = pd.DataFrame({"T1": [8.0]}, index=[pd.Timestamp("2025-01-01 04:00")])
RESULTS = {
    "rows": LagFeatures(3).fit_transform([[1.0], [2.0], [3.0], [4.0]]),
    "hours": LagFeatures(lags=2, freq="1h").fit_transform(T),
    "history": LagFeatures(lags=2, freq="1h").fit(T).transform(later),
    "names": list(LagFeatures(lags=2, freq="1h").fit(T).get_feature_names_out()),
    "chosen, missing": LagFeatures([0, 2], padding="nan").fit_transform([[1.0], [2.0], [3.0]]),
}
