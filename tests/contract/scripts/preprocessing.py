import tempfile
from pathlib import Path

import numpy as np
import pandas as pd
from sklearn.linear_model import LinearRegression
from sklearn.pipeline import make_pipeline

from skthermo import preprocessing
from skthermo.datasets import make_truss
from tests.contract.truss import campaign, records_of


def preprocessing_alignment():
    """Frequencies moved to those of a model, by differences or by factors."""
    F = campaign(0, samples_per_year=60).frequencies
    shift, scale = (
        preprocessing.BiasAligner(make_truss()).fit(F),
        preprocessing.BiasAligner(F.mean() * 1.01, method="scale").fit(F),
    )
    return {
        "shifted": shift.transform(F).mean(),
        "scaled": scale.transform(F).mean(),
        "back": bool(np.allclose(shift.inverse_transform(shift.transform(F)), F)),
        "by values": preprocessing.BiasAligner([4.0, 9.0]).fit([[3.9, 9.3], [4.3, 9.5]]).transform([[4.1, 9.5]]),
    }


def preprocessing_check_records():
    """Defects of records are found: stuck sensors, kelvin, shifted clocks, markers."""
    year = campaign()
    T, F = year.temperatures, year.frequencies
    stuck = T.copy()
    stuck.loc["2025-12":, "T1"] = 20.0
    marked = T.copy()
    marked.loc["2025-03", "T1"] = -999.0
    high = F.copy()
    high.iloc[7, 2] *= 100
    aside = preprocessing.check_records(marked, high)
    return {
        "nothing": len(preprocessing.check_records(T, F).table),
        "stuck": preprocessing.check_records(stuck, F).table[["what", "column", "n_rows"]],
        "kelvin": list(preprocessing.check_records(T[["T1"]] + 273.15).table["what"]),
        "late": list(preprocessing.check_records(T, F.shift(60)).table["what"]),
        "set aside": sorted(aside.table["column"]),
        "missing": [aside.temperatures.isna().sum(), aside.frequencies.isna().sum()],
    }


def preprocessing_folds():
    """Blocks of records, dealt in turn to the folds."""
    days = pd.DataFrame({"T": np.zeros(60)}, pd.date_range("2025-01-01", periods=60))
    return {
        "rows": [[train, test] for train, test in preprocessing.BlockedKFold(2, block=3).split(np.zeros((10, 1)))],
        "weeks": preprocessing.BlockedKFold(5, block="7D").fold_of(days),
        "n_splits": preprocessing.BlockedKFold(4).get_n_splits(),
    }


def preprocessing_gaps():
    """Missing values: neighbours fill them as scikit-learn's imputer does, or sensors of one role."""
    F = campaign(0, samples_per_year=60).frequencies
    F.iloc[3, 1] = F.iloc[10, 4] = np.nan
    T = pd.DataFrame({"T1": [4.0, 8.0, np.nan], "T2": [6.0, 10.0, 3.0], "slab": [5.0, 7.0, 6.0]})
    return {
        "filled": preprocessing.KNNGapImputer().fit_transform(F).iloc[[3, 10]],
        "nearest": preprocessing.KNNGapImputer(n_neighbors=1, weights="distance").fit(F).transform(F).iloc[[3, 10]],
        "means": preprocessing.SensorMeans({"T1": "air", "T2": "air", "slab": "deck"}).fit_transform(T),
    }


def preprocessing_hinges():
    """Piecewise-linear features go on straight outside the records."""
    T = np.linspace(-10.0, 10.0, 41)[:, np.newaxis]
    frequency = 4.0 + 0.05 * np.maximum(-T[:, 0], 0.0)
    lines = make_pipeline(preprocessing.HingeFeatures(n_knots=1), LinearRegression()).fit(T, frequency)
    return {"outside": lines.predict([[-20.0], [20.0]]), "knots": preprocessing.HingeFeatures(4).fit(T).knots_}


def preprocessing_lags():
    """Earlier temperatures as further columns; records of fit are the history of transform."""
    hours = pd.to_datetime(["2025-01-01 00:00", "2025-01-01 01:00", "2025-01-01 03:00"])
    T = pd.DataFrame({"T1": [4.0, 5.0, 7.0]}, index=hours)
    later = pd.DataFrame({"T1": [8.0]}, index=[pd.Timestamp("2025-01-01 04:00")])
    return {
        "rows": preprocessing.LagFeatures(3).fit_transform([[1.0], [2.0], [3.0], [4.0]]),
        "hours": preprocessing.LagFeatures(lags=2, freq="1h").fit_transform(T),
        "history": preprocessing.LagFeatures(lags=2, freq="1h").fit(T).transform(later),
        "names": list(preprocessing.LagFeatures(lags=2, freq="1h").fit(T).get_feature_names_out()),
        "chosen, missing": preprocessing.LagFeatures([0, 2], padding="nan").fit_transform([[1.0], [2.0], [3.0]]),
    }


def preprocessing_mode_tracker():
    """Two modes swap order, and a spurious pole comes."""
    first, second, spurious = [1.0, 2.0, 1.0], [1.0, 0.0, -1.0], [1.0, -1.0, 1.0]
    records = [
        {"frequencies": [2.0, 2.2], "shapes": [first, second]},
        {"frequencies": [2.1, 2.15], "shapes": [second, first]},
        {"frequencies": [2.01, 2.05], "shapes": [spurious, first]},
    ]
    modes = preprocessing.ModeTracker(([2.0, 2.2], np.column_stack([first, second]))).fit_transform(records)
    return {"frequencies": modes.frequencies, "left over": modes.left_over}


def preprocessing_outliers():
    """Outliers of frequencies become missing, alone and beside the weather."""
    year = campaign(0, samples_per_year=120, noise=0.002)
    records = records_of(year)
    records.iloc[50, 4] *= 1.2
    F = np.random.default_rng(0).normal(4.0, 0.02, (200, 2))
    F[50, 1] = 4.8
    alone = preprocessing.HampelFilter().fit(F)
    beside = preprocessing.HampelFilter(targets=list(year.frequencies)).fit(records)
    return {
        "removed": alone.n_removed_,
        "missing": np.isnan(alone.transform(F)).sum(axis=0),
        "beside the weather": bool(np.isnan(beside.transform(records).iloc[50, 4])),
        "temperatures": int(beside.transform(records)[list(year.temperatures)].isna().to_numpy().sum()),
    }


def preprocessing_read_records():
    """Files of loggers: German decimals and dates, units, markers, two files, Excel's comma file."""
    lines = ["Zeit;Luft [°C];f1 [Hz]", "13.01.2026 22:00;-1,5;4,012", "13.01.2026 23:00;-999;4,015", ""]
    year = campaign(0, samples_per_year=40)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "log.csv").write_text("\n".join(lines), encoding="utf-8")
        german = preprocessing.read_records(folder / "log.csv")
        year.temperatures.to_csv(folder / "T.csv")
        year.frequencies.to_csv(folder / "F.csv", sep="\t")
        two = preprocessing.read_records(folder / "T.csv", folder / "F.csv")
    return {
        "columns": [list(table) for table in german],
        "values": [table.to_numpy() for table in german],
        "stamps": [str(stamp) for stamp in german[0].index],
        "two files": [bool(((two[0] - year.temperatures).abs() < 1e-9).all(axis=None)), list(two[1])],
        "same stamps": bool((pd.DatetimeIndex(two[0].index) == year.temperatures.index).all()),
    }
