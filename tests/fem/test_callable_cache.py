"""Solved samples on disk: nothing is lost, nothing is solved twice, and nobody else's file is touched."""

import multiprocessing
import os
import pickle
import signal
import time

import joblib
import numpy as np
import pytest
from sklearn.base import clone

from skthermo.fem import CallableModel, sample

NAMES = ["E", "k"]
THETA = np.random.default_rng(0).uniform(0.5, 1.5, (10, 2))


def three_modes(row):
    return np.sqrt(row[0] + row[1] * np.arange(1.0, 4.0)) / 3


class Counted:
    def __init__(self):
        self.rows = []

    def __call__(self, row):
        self.rows.append(row.copy())
        return three_modes(row)


PLAIN = CallableModel(three_modes, NAMES, 3).frequencies(THETA)


def asked_again(folder, theta=THETA):
    """What a model with this cache gives, and the rows that it solves for that."""
    counted = Counted()
    return CallableModel(counted, NAMES, 3, cache=folder).frequencies(theta), np.array(counted.rows)


@pytest.fixture
def folder(tmp_path):
    return tmp_path / "folder" / "solved"


def test_the_second_model_solves_only_what_is_new(folder):
    for theta, cache, new in ((THETA[:6], folder, THETA[:6]), (THETA[::-1], str(folder), THETA[:5:-1])):
        frequencies, rows = asked_again(cache, theta)
        np.testing.assert_array_equal(frequencies, CallableModel(three_modes, NAMES, 3).frequencies(theta))
        np.testing.assert_array_equal(rows, new)


@pytest.mark.parametrize(("cached", "vectorized"), [(False, False), (True, True)])
def test_repeated_rows_are_solved_once(folder, cached, vectorized):
    seen = []

    def function(theta):
        seen.append(len(np.atleast_2d(theta)))
        result = np.stack([three_modes(row) for row in np.atleast_2d(theta)])
        theta[:] = np.nan
        return result if vectorized else result[0]

    model = CallableModel(function, NAMES, 3, vectorized=vectorized, cache=folder if cached else None)
    theta = THETA[[0, 1, 0, 2, 1]]
    np.testing.assert_array_equal(model.frequencies(theta), PLAIN[[0, 1, 0, 2, 1]])
    assert sum(seen) == 3
    np.testing.assert_array_equal(theta, THETA[[0, 1, 0, 2, 1]])
    assert model.frequencies(np.empty((0, 2))).shape == (0, 3)
    np.testing.assert_array_equal(model.frequencies(THETA), PLAIN)
    assert sum(seen) == 3 + (10 - 3 if cached else 10)


def test_what_is_not_a_number_is_kept_bit_by_bit(folder):
    model = CallableModel(lambda row: [-np.nan, np.nan, 5e-324], NAMES, 3, cache=folder)
    first, second = model.frequencies(THETA), model.frequencies(THETA)
    assert first.tobytes() == second.tobytes()
    assert np.isnan(second[:, :2]).all()


@pytest.mark.parametrize(
    ("value", "vectorized", "what"),
    [
        (-1.0, False, "-1.0 Hz.*{}"),
        (0.0, True, "0.0 Hz.*{}"),
        (np.inf, False, "inf Hz.*{}"),
        (None, False, "{}.*Arithm"),
    ],
)
def test_a_failing_row_is_nan_and_reported_and_what_was_solved_stays(folder, value, vectorized, what):
    def wrong_at_the_eighth(theta):
        result = np.array([three_modes(row) for row in np.atleast_2d(theta)])
        is_eighth = (np.atleast_2d(theta) == THETA[7]).all(axis=1)
        if value is None and is_eighth.any():
            raise ArithmeticError("no convergence")
        result[is_eighth, 1] = value
        return result if vectorized else result[0]

    model = CallableModel(wrong_at_the_eighth, NAMES, 3, vectorized=vectorized, cache=folder)
    with pytest.warns(UserWarning, match="some rows .*" + what.format(THETA[7, 0])):
        frequencies = model.frequencies(THETA)
    expected = PLAIN.copy()
    expected[7] = np.nan
    np.testing.assert_array_equal(frequencies, expected)
    again, rows = asked_again(folder)
    np.testing.assert_array_equal(again, PLAIN)
    np.testing.assert_array_equal(rows, THETA[[7]])
    if value is not None:
        with pytest.raises(RuntimeError, match=what.format(THETA[7, 0])):
            CallableModel(lambda row: [1.0, value, 2.0], NAMES, 3).frequencies(THETA[7:])


def test_a_function_that_fails_everywhere_is_an_error(folder):
    CallableModel(three_modes, NAMES, 3, cache=folder).frequencies(THETA[:4])
    model = CallableModel(lambda theta: 1 / 0, NAMES, 3, vectorized=True, cache=folder)
    with pytest.raises(RuntimeError, match=f"6 rows .*{THETA[4, 0]}") as error:
        model.frequencies(THETA)
    assert isinstance(error.value.__cause__, ZeroDivisionError)
    np.testing.assert_array_equal(asked_again(folder)[1], THETA[4:])


def test_somebody_elses_file_is_refused_and_kept(tmp_path):
    thesis = tmp_path / "thesis"
    thesis.write_text("my thesis")
    with pytest.raises(ValueError, match="thesis: the cache is a file; expected a folder"):
        CallableModel(three_modes, NAMES, 3, cache=thesis)
    assert thesis.read_text() == "my thesis"


def test_clone_and_pickle_keep_the_path_wherever_the_process_goes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    model = CallableModel(three_modes, NAMES, 3, cache="here")
    monkeypatch.chdir("/")
    assert model.cache == clone(model).cache == pickle.loads(pickle.dumps(model)).cache == tmp_path / "here"
    model.frequencies(THETA)
    assert (tmp_path / "here").is_dir()
    assert CallableModel(three_modes, NAMES, 3).cache is None


@pytest.mark.filterwarnings("ignore:.*Exception while loading results")  # of joblib
def test_a_damaged_row_is_solved_again(folder):
    asked_again(folder)
    damaged = sorted(folder.rglob("output.pkl"))[0]
    damaged.write_bytes(damaged.read_bytes()[:20])
    for n_solved in (1, 0):
        frequencies, rows = asked_again(folder)
        np.testing.assert_array_equal(frequencies, PLAIN)
        assert len(rows) == n_solved


@pytest.mark.parametrize(("names", "n_modes"), [(["k", "E"], 3), (NAMES, 2)])
def test_other_parameters_and_modes_have_rows_of_their_own(folder, names, n_modes):
    CallableModel(lambda row: three_modes(row)[:n_modes], names, n_modes, cache=folder).frequencies(THETA)
    frequencies, rows = asked_again(folder)
    np.testing.assert_array_equal(frequencies, PLAIN)
    assert len(rows) == len(THETA)


@pytest.mark.nightly
def test_workers_share_one_folder(folder):
    model, counted = CallableModel(three_modes, NAMES, 3, cache=folder), Counted()
    with joblib.parallel_config("loky"):
        spread = sample(model, 0.3, 300, n_jobs=2, random_state=0).frequencies
    for other in (CallableModel(three_modes, NAMES, 3), CallableModel(counted, NAMES, 3, cache=folder)):
        np.testing.assert_array_equal(sample(other, 0.3, 300, random_state=0).frequencies, spread)
    assert not counted.rows


MANY = np.random.default_rng(1).uniform(0.5, 1.5, (100, 2))
PROCESSES = multiprocessing.get_context("fork" if "fork" in multiprocessing.get_all_start_methods() else "spawn")


def program(folder, log, stall):
    begun = os.open(log, os.O_WRONLY | os.O_APPEND | os.O_CREAT)

    def slow(row):
        os.write(begun, row.tobytes())
        time.sleep(60 if os.fstat(begun).st_size == 16 * stall else 0.001)
        return three_modes(row)

    CallableModel(slow, NAMES, 3, cache=folder).frequencies(MANY)


def begun(log):
    return np.frombuffer(log.read_bytes() if log.exists() else b"").reshape(-1, 2)


@pytest.mark.nightly
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")  # of multiprocessing, from Python 3.12 on
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="the system has no SIGKILL")
def test_killed_in_the_middle_of_solves(folder, tmp_path):
    log = tmp_path / "log"
    for solved, stall in ((30, 30), (70, 0), (None, 0)):  # within a solve, wherever it is, not at all
        process = PROCESSES.Process(target=program, args=(folder, log, stall))
        process.start()
        while solved and process.is_alive() and len(begun(log)) < solved:
            time.sleep(0.005)
        if solved:
            process.kill()
        process.join()
        assert process.exitcode == (-signal.SIGKILL if solved else 0) or solved == 70
    assert len(np.unique(begun(log), axis=0)) == 100
    assert 100 < len(begun(log)) <= 102  # again only what was under way
    result, rows = asked_again(folder, MANY)
    assert not len(rows)
    np.testing.assert_array_equal(result, CallableModel(three_modes, NAMES, 3).frequencies(MANY))
