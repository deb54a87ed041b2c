"""Damaged texts of matrices: read as matrices of finite size, or refused with an error that names the file."""

import re
import warnings

import numpy as np
import pytest

from skthermo.fem.external import read_named_matrices
from tests.fem.exported_files import TEXTS, TOTAL

WORDS = [b"-1", b"0", b"1", b"7", b"1000000", b"100000000", b"2147483648", b"99999999999", b"1e300", b"nan", b"inf"]
BEGINNING = 200  # bytes in which most lengths stand


def mutated(content, random):
    """A copy with one or two of: bytes flipped, cut off, inserted or left out, or a length changed."""
    content = bytearray(content)
    for _ in range(random.integers(1, 3)):
        within = len(content) if random.integers(2) else min(len(content), BEGINNING)
        place, n_bytes = int(random.integers(within or 1)), int(random.integers(1, 40))
        kind = random.integers(5)
        if kind == 0 and content:
            content[place] ^= 1 << int(random.integers(8))
        elif kind == 1:
            del content[place:]
        elif kind == 2:
            content[place:place] = random.bytes(n_bytes)
        elif kind == 3:
            del content[place : place + n_bytes]
        else:
            tokens = list(re.finditer(rb"\d+", content)) or [re.match(rb"", content)]
            token = tokens[int(random.integers(len(tokens) if random.integers(2) else min(len(tokens), 6)))]
            content[token.start() : token.end()] = WORDS[random.integers(len(WORDS))]
    return bytes(content)


@pytest.mark.parametrize("n_files", [200, pytest.param(4000, marks=pytest.mark.nightly)])
def test_a_damaged_text_is_read_or_refused_by_name(tmp_path, n_files, limited_memory):
    kinds, n_read, nameless = list(TEXTS), 0, []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # numbers beyond the largest
        for seed in range(n_files):
            suffix, _, text = TEXTS[kinds[seed % len(kinds)]]
            file = tmp_path / f"K{suffix}"
            file.write_bytes(mutated(text(TOTAL).encode(), np.random.default_rng(seed)))
            try:
                n_read += len(read_named_matrices(file, lambda name: True).matrices) > 0
            except ValueError as error:
                nameless += [] if file.name in str(error) else [f"{kinds[seed % len(kinds)]}, seed {seed}: {error}"]
    assert not nameless
    assert 0 < n_read < n_files


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
