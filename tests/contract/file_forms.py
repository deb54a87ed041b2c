"""Forms of files that are read: a small file of each is written, and read."""

import sys
import tempfile
import warnings
from importlib.util import find_spec
from pathlib import Path
from unittest.mock import patch

import numpy as np
import pandas as pd
import scipy.io

from skthermo.datasets import load_kw51, load_z24, make_truss_campaign
from skthermo.detection import MahalanobisDetector
from skthermo.fem import load_affine, read_triplets
from skthermo.monitoring import Monitor, load_monitor
from skthermo.preprocessing import read_records
from tests.datasets.kw51_file import write_kw51
from tests.fem.exported_files import DOFS, MATRICES, TEXTS, WRITERS, write_texts


def file_forms():
    with warnings.catch_warnings(), patch.object(sys, "frozen", True, create=True):  # all is read in this process
        warnings.simplefilter("ignore")
        for reads, form, work in (*exports(), *records(), *campaigns()):
            if is_read(work):
                yield f"{reads} {form}"


def is_read(work):
    """Whether a file is read, or would be with a package that the error names."""
    with tempfile.TemporaryDirectory() as folder:
        try:
            work(Path(folder))
        except (ImportError, ValueError) as error:
            return "pip install" in str(error)
    return True


def exports():
    """Matrices of FE programs."""

    def loads(write):
        def work(folder):
            assert load_affine(write(folder, MATRICES), n_modes=4).frequencies([[1.0] * 3]).shape == (1, 4)

        return work

    def labelled(folder, matrices):
        (folder / "bridge.dof").write_text("".join(f"{node}.{direction}\n" for node, direction in DOFS))
        return write_texts("CalculiX")(folder, matrices)

    def triplets(folder):
        (folder / "K.txt").write_text("1 1 2.0\n2 1 -1.0\n2 2 2.0\n")
        assert read_triplets(folder / "K.txt").shape == (2, 2)

    writers = WRITERS | {kind: write_texts(kind) for kind in TEXTS} | {"CalculiX, .dof": labelled}
    yield from (("load_affine", form, loads(write)) for form, write in writers.items())
    yield "read_triplets", "text", triplets


def records():
    """Records of loggers."""
    year = make_truss_campaign(samples_per_year=60, random_state=0)
    table = year.temperatures.add_suffix(" [°C]").join(year.frequencies.add_suffix(" [Hz]")).round(3)

    def reads(name, write):
        def work(folder):
            write(folder / name)
            T, F = read_records(folder / name)
            assert (T.shape, F.shape) == ((60, 3), (60, 6))
            assert np.allclose(T.join(F), table)

        return work

    def csv(**options):
        return lambda file: table.to_csv(file, **options)

    german = {"sep": ";", "decimal": ",", "date_format": "%d.%m.%Y %H:%M"}
    yield "read_records", "csv", reads("log.csv", csv())
    yield "read_records", "csv, semicolons and decimal commas", reads("log.csv", csv(**german))
    yield "read_records", "csv, tabs", reads("log.txt", csv(sep="\t"))
    yield "read_records", "csv, UTF-16", reads("log.csv", csv(encoding="utf-16"))
    yield "read_records", "xlsx", reads("log.xlsx", table.to_excel)
    written = table.to_parquet if find_spec("pyarrow") else Path.touch
    yield "read_records", "parquet", reads("log.parquet", written)


def campaigns():
    """Published records, and a saved monitor."""
    sensors, modes = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"], ["f1", "f2", "f3", "f4"]
    table = pd.DataFrame([[0, *[4.0, 5.0, 10.0, 11.0], *[10.0] * 7]] * 2, columns=["record", *modes, *sensors])
    table["record"], table["state"] = [0, 1], ["undamaged", "damaged"]

    def z24_csv(folder):
        table.to_csv(folder / "z24.csv", index=False)
        assert len(load_z24(folder / "z24.csv").frequencies) == 2

    def z24_mat(folder):
        fields = {f"Z24_{name}": table[[name]].to_numpy() for name in sensors}
        scipy.io.savemat(folder / "z24.mat", fields | {"data": table[modes].to_numpy(), "nc": 1})
        assert len(load_z24(folder / "z24.mat").frequencies) == 2

    def kw51(name):
        def work(folder):
            write_kw51(folder / name, n_records=2)
            assert len(load_kw51(folder / name).frequencies) == 2

        return work

    def monitor(folder):
        year = make_truss_campaign(samples_per_year=60, random_state=0)
        monitor = Monitor(MahalanobisDetector(), targets=list(year.frequencies), watch_per_year=12)
        monitor.fit(year.frequencies).save(folder / "monitor.joblib")
        assert load_monitor(folder / "monitor.joblib").threshold_ > 0

    yield "load_z24", "csv", z24_csv
    yield "load_z24", "mat", z24_mat
    yield "load_kw51", "mat", kw51("trackedmodes.mat")
    yield "load_kw51", "zip", kw51("trackedmodes.zip")
    yield "load_monitor", "joblib", monitor
