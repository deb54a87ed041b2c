"""Nastran's files as pyyeti, an independent program, writes and reads them, and the files that it comes with."""

import warnings
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import scipy.sparse

from skthermo.fem.external import read_named_matrices
from tests.fem.exported_files import DOFS, TOTAL, M

with np.printoptions():  # which pyyeti changes
    nastran = pytest.importorskip("pyyeti.nastran", reason="pyyeti is not installed: the extra 'drop-ins' brings it")
pytestmark = pytest.mark.filterwarnings("ignore::DeprecationWarning")

SHIPPED = Path(nastran.__file__).parents[1] / "tests"
NO_NAMES = "double_bigmat_ascii_badname.op4"  # names of zero bytes
OUTPUT4 = sorted(path.relative_to(SHIPPED).as_posix() for path in SHIPPED.rglob("*.op4") if path.name != NO_NAMES)
PUNCHED = sorted(path.relative_to(SHIPPED).as_posix() for path in SHIPPED.glob("nastran_dmig_data/*.pch"))


def read_all(file):
    return read_named_matrices(file, lambda name: True)


@pytest.mark.parametrize("sparse", ["dense", "bigmat", "nonbigmat"])
@pytest.mark.parametrize("form", [{"binary": False}, {"endian": "<"}, {"endian": ">"}])
def test_output4_that_pyyeti_writes(tmp_path, sparse, form):
    nastran.op4.write(str(tmp_path / "bridge.op4"), ["KAA", "MAA"], [TOTAL, M], sparse=sparse, **form)
    for found, expected in zip(read_all(tmp_path / "bridge.op4").matrices.values(), (TOTAL, M), strict=True):
        np.testing.assert_allclose(found.toarray(), expected, rtol=1e-14)


@pytest.mark.parametrize("name", OUTPUT4)
def test_output4_is_read_as_pyyeti_reads_it(name):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        names, matrices, _, kinds = nastran.op4.load(str(SHIPPED / name), into="list", sparse=True)
    found = read_all(SHIPPED / name).matrices
    for key, (expected, kind) in dict(zip(names, zip(matrices, kinds, strict=True), strict=True)).items():
        if expected.shape[0] == expected.shape[1] and kind <= 2:
            assert found[key.upper()].shape == expected.shape
            assert not (found[key.upper()] - scipy.sparse.csc_array(expected)).count_nonzero()
        else:
            assert found[key.upper()] is None


@pytest.mark.parametrize("name", PUNCHED)
def test_dmig_is_read_as_pyyeti_reads_it(name):
    found = read_all(SHIPPED / name)
    for key, expected in nastran.rddmig(str(SHIPPED / name), square=True).items():
        matrix = found.matrices[key.upper()]
        if matrix is not None:
            places = [found.dofs.index(tuple(map(int, label))) for label in expected.index]
            np.testing.assert_array_equal(matrix.toarray()[np.ix_(places, places)], expected.to_numpy())


def test_dmig_that_pyyeti_writes(tmp_path):
    labels = pd.MultiIndex.from_tuples(DOFS, names=["id", "dof"])
    with open(tmp_path / "bridge.pch", "w") as file:
        nastran.wtdmig(file, {"kaax": pd.DataFrame(TOTAL, index=labels, columns=labels)})
    found = read_all(tmp_path / "bridge.pch")
    assert found.dofs == tuple(DOFS)
    np.testing.assert_allclose(scipy.sparse.csc_array(found.matrices["KAAX"]).toarray(), TOTAL, rtol=1e-9)
