"""Equal inputs give equal results: every public estimator, whatever holds the numbers that it is given."""

import functools
import io
import os
import pickle
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.linear_model import Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler
from sklearn.svm import OneClassSVM

from skthermo.datasets import make_truss_campaign
from skthermo.detection import DirectionalDetector, MahalanobisDetector, OutlierDetector, TemperatureCompensator
from skthermo.preprocessing import check_records
from tests.estimators import BOTH, CASES, COMPENSATOR, FEW, GAPPED, TRUSS, T, assert_same

pytestmark = pytest.mark.filterwarnings("ignore")
ROOT = Path(__file__).parents[1]


def within(table, order="C"):
    """Values in a part of a larger array."""
    rows, columns = table.shape
    larger = np.full((rows + 7, columns + 3), 777.0, order=order)
    larger[4:-3, 1:-2] = table
    return larger[4:-3, 1:-2]


def framed(values, table):
    """A frame on these very numbers, with a table's names and index."""
    return pd.DataFrame(values, table.index, table.columns, copy=False)


def from_csv(table):
    text = table.to_csv()
    stamps = isinstance(table.index, pd.DatetimeIndex)
    return pd.read_csv(io.StringIO(text), index_col=0, float_precision="round_trip", parse_dates=stamps)


def from_parquet(table):
    pytest.importorskip("pyarrow")
    file = io.BytesIO()
    table.to_parquet(file)
    return pd.read_parquet(file)


def in_polars(table):
    polars = pytest.importorskip("polars")
    return polars.DataFrame({name: table[name].to_numpy() for name in table})


def in_float32(table):
    return table.to_numpy().astype(np.float32)


def in_rows(table):
    """A copy in C order."""
    return table.to_numpy().copy(order="C")


def frame_in_rows(table):
    return framed(in_rows(table), table)


ARRAYS = {  # equal to an array in C order
    "Fortran order": lambda table: np.asfortranarray(table.to_numpy()),
    "part of a larger array": within,
    "lists": lambda table: table.to_numpy().tolist(),
    "frame": frame_in_rows,
    "backwards in memory": lambda table: table.to_numpy()[::-1].copy()[::-1],
}
FRAMES = {  # equal to a frame in C order
    "columns of their own": lambda table: pd.DataFrame({name: table[name].copy() for name in table}),
    "CSV": from_csv,
    "Fortran": lambda table: framed(np.asfortranarray(table.to_numpy()), table),
    "part of an array": lambda table: framed(within(table), table),
    "pickled": lambda table: pickle.loads(pickle.dumps(frame_in_rows(table))),
    "Parquet": from_parquet,
}
AT_NIGHT = {"backwards in memory", "CSV", "Fortran", "part of an array", "pickled", "Parquet"}
MADE_OF_OTHERS = {"pipeline", "compensated"}


def marked(case, form):
    """Of cases that are slow, one form is tried each time."""
    in_short = "columns of their own" if CASES[case].needs_frames else "Fortran order"
    is_nightly = form in AT_NIGHT or case in MADE_OF_OTHERS or (CASES[case].is_slow and form != in_short)
    return pytest.param(case, form, id=f"{case}, {form}", marks=[pytest.mark.nightly] * is_nightly)


def by_form(forms):
    return [pytest.param(form, marks=[pytest.mark.nightly] * (form in AT_NIGHT)) for form in forms]


def each(forms, needs_frames=False):
    """A test of each case that takes what has no names, or of each in whose settings names may stand."""
    cases = [name for name, case in CASES.items() if needs_frames or not case.needs_frames]
    return pytest.mark.parametrize(("case", "form"), [marked(case, form) for case in cases for form in forms])


@functools.cache
def of_arrays(case):
    return CASES[case].results(in_rows)


@functools.cache
def of_frames(case):
    return CASES[case].results(frame_in_rows)


@each(ARRAYS)
def test_equal_arrays_give_equal_results(case, form):
    assert_same(CASES[case].results(ARRAYS[form]), of_arrays(case))


@each(FRAMES, needs_frames=True)
def test_equal_frames_give_equal_results(case, form):
    assert_same(CASES[case].results(FRAMES[form]), of_frames(case))


@each(["float32"])
def test_float32_is_read_as_its_float64_copy(case, form):
    expected = CASES[case].results(lambda table: in_float32(table).astype(float))
    assert_same(CASES[case].results(in_float32), expected)


@each(["polars"], needs_frames=True)
def test_polars_frames_give_equal_results(case, form):
    if case in ("monitor", "modes"):
        pytest.skip("stamps are pandas'; poles are arrays and pandas frames")
    assert_same(CASES[case].results(in_polars), of_frames(case), rtol=1e-9)


@each(["in a thread"], needs_frames=True)
def test_another_thread_gives_equal_results(case, form):
    found = []
    thread = threading.Thread(target=lambda: found.append(CASES[case].results(frame_in_rows)))
    thread.start()
    thread.join()
    assert_same(found[0], of_frames(case))


PROGRAM = """
import pickle, sys, warnings
warnings.simplefilter("ignore")
from tests.estimators import CASES
from tests.test_equal_inputs import frame_in_rows
found = {name: CASES[name].results(frame_in_rows) for name in CASES}
sys.stdout.buffer.write(pickle.dumps(found))
"""


@pytest.mark.nightly
def test_another_process_gives_equal_results():
    paths = os.pathsep.join([str(ROOT), *filter(None, sys.path)])
    command, env = [sys.executable, "-c", PROGRAM], os.environ | {"PYTHONPATH": paths}
    found = pickle.loads(subprocess.run(command, env=env, capture_output=True, check=True).stdout)
    for case in CASES:
        assert_same(found[case], of_frames(case))


@pytest.mark.parametrize("form", by_form([*FRAMES, "polars"]))
def test_checks_of_equal_records_find_the_same(form):
    convert = in_polars if form == "polars" else FRAMES[form]
    found, expected = (check_records(*map(one, (T, GAPPED))) for one in (convert, frame_in_rows))
    pd.testing.assert_frame_equal(found.table, expected.table)
    np.testing.assert_array_equal(found.outliers, expected.outliers)
    pd.testing.assert_frame_equal(found.frequencies, expected.frequencies, check_freq=False)


# Residuals


@functools.cache
def residuals():
    """Of the records of a fit, and of later ones: what the compensator gives, which may know more than its numbers."""
    compensator = clone(COMPENSATOR)
    later = make_truss_campaign(samples_per_year=90, random_state=1)
    return compensator.fit_transform(BOTH), compensator.transform(later.temperatures.join(later.frequencies))


COPIES = {"loaded": lambda R: pickle.loads(pickle.dumps(R)), "CSV": from_csv, "array": lambda R: R.to_numpy(copy=True)}
DETECTORS = {
    "Mahalanobis": MahalanobisDetector(),
    "softening": DirectionalDetector(),
    "directions": DirectionalDetector(TRUSS),
    "novelty": OutlierDetector(OneClassSVM()),
}


def evaluated_residuals(name, form):
    R, later = (form(table) for table in residuals())
    detector = clone(DETECTORS[name]).fit(R)
    scores = {"score": detector.score(later)} if hasattr(detector, "score") else {}
    return scores | {
        method: getattr(detector, method)(later) for method in ("predict", "score_samples", "damage_index")
    }


@functools.cache
def of_residuals(name):
    return evaluated_residuals(name, lambda R: R)


@pytest.mark.parametrize("form", by_form(COPIES))
@pytest.mark.parametrize("name", DETECTORS)
def test_copies_of_residuals_give_equal_results(name, form):
    assert_same(evaluated_residuals(name, COPIES[form]), of_residuals(name))


def test_a_step_that_writes_into_residuals_changes_no_result():
    records = T.join(FEW)

    def indices(copy):
        step = StandardScaler(with_std=False, copy=copy)
        compensator = TemperatureCompensator(Ridge(), targets=list(FEW))
        return make_pipeline(compensator, step, DirectionalDetector()).fit(records).score_samples(records)

    np.testing.assert_array_equal(indices(copy=False), indices(copy=True))
