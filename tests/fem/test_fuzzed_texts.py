"""Damaged texts of matrices: refused, or read as slow readers that go through them line by line read them."""

import warnings

import numpy as np
import pytest

from skthermo._io import read_named_matrices
from tests.benchmarks.fuzz_loaders import mutated
from tests.fem.exported_files import TEXTS, TOTAL
from tests.fem.slow_readers import agrees

pytestmark = pytest.mark.usefixtures("in_process")


def outcome(folder, kind, seed):
    """One of "refused", "read" and "read wrongly"."""
    suffix, _, text = TEXTS[kind]
    content = mutated(text(TOTAL).encode(), np.random.default_rng(seed))
    file = folder / f"K{suffix}"
    file.write_bytes(content)
    try:
        found = read_named_matrices(file, lambda name: True)
    except ValueError as error:
        return "refused" if file.name in str(error) else f"refused without its name: {error}"
    return "read" if agrees(kind, content, found) else "read wrongly"


@pytest.mark.parametrize("kind", TEXTS)
def test_a_sound_text_is_read_by_both(tmp_path, kind):
    suffix, _, text = TEXTS[kind]
    (tmp_path / f"K{suffix}").write_text(text(TOTAL))
    assert agrees(kind, text(TOTAL).encode(), read_named_matrices(tmp_path / f"K{suffix}", lambda name: True))


@pytest.mark.parametrize("n_files", [200, pytest.param(4000, marks=pytest.mark.nightly)])
def test_no_damaged_text_is_read_wrongly(tmp_path, n_files, limited_memory):
    kinds = list(TEXTS)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # numbers beyond the largest
        outcomes = {
            (kinds[seed % len(kinds)], seed): outcome(tmp_path, kinds[seed % len(kinds)], seed)
            for seed in range(n_files)
        }
    assert {*outcomes.values()} == {"read", "refused"}, [
        case for case, one in outcomes.items() if one not in ("read", "refused")
    ]


@pytest.fixture
def limited_memory():
    """No more memory than a child process would have, where the platform has limits."""
    resource = pytest.importorskip("resource")
    before = resource.getrlimit(resource.RLIMIT_DATA)
    with open("/proc/self/statm") as stream:
        taken = int(stream.read().split()[5]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_DATA, (taken + 256_000_000, before[1]))
    yield
    resource.setrlimit(resource.RLIMIT_DATA, before)
