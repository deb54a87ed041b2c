"""Readers of files that may be damaged: mutated copies of small valid files of every format.

    OMP_NUM_THREADS=1 python tests/benchmarks/fuzz_loaders.py

Bytes are flipped, cut off, inserted or exchanged, and numbers that state lengths are changed; of compressed files also
the content, which is then compressed again with right checksums. Files are read by `load_affine`, `load_z24` or
`load_kw51`, 250 of them in one process, which starts a child for each. A file passes if it is read, or refused by a
ValueError or OSError that names it, and that process takes at most 256 MB; the child has a limit of its own. Texts of
matrices that are read are also compared with what slow readers, line by line, find in them. The exit code is 1 if one
fails. A thousand files take some 10 minutes.

    OMP_NUM_THREADS=1 python tests/benchmarks/fuzz_loaders.py --files 700 --formats Abaqus CalculiX RSA RUA ANSYS \\
        Rutherford DMIG OP4

reads only formats whose names have one of these words.
"""

import argparse
import collections
import contextlib
import io
import multiprocessing
import re
import resource
import struct
import sys
import tempfile
import warnings
import zipfile
import zlib
from pathlib import Path

import numpy as np
import scipy.io
import scipy.sparse

from skthermo._io import read_named_matrices
from skthermo.datasets import load_kw51, load_z24
from skthermo.fem import load_affine

sys.path.append(str(Path(__file__).parents[2]))  # which Python does not do itself for a file that it runs
from tests.fem.exported_files import TEXTS
from tests.fem.slow_readers import agrees

MOST_MEGABYTES = 256
FILES_IN_A_PROCESS = 250
N = 6
NUMBERS = [0, 1, 2, 3, 7, 8, 127, 255, 65535, 10**6, 2**24, 2**27, 2**31 - 1, 2**31, 2**32 - 1, 2**62, 2**63 - 1]
WORDS = [b"-1", b"0", b"1", b"7", b"1000000", b"100000000", b"2147483648", b"99999999999", b"1e300", b"nan", b"inf"]
HEADER_OF_MAT = 128
MILLION = 10**6
MOST_ZEROS = 500 * MILLION
OF_DATA = {"z24": load_z24, "kw51": load_kw51}
BEGINNING = 200  # bytes in which most lengths stand


def matrices():
    """A chain of masses and springs."""
    chain = 2 * np.eye(N) - np.eye(N, k=1) - np.eye(N, k=-1)
    ground = np.diag(np.eye(N)[0])
    return {"K0": 1000 * chain + ground, "E_1": 1000 * chain, "k_base": ground, "M": np.eye(N)}


def z24_fields():
    random = np.random.default_rng(0)
    fields = {"data": random.normal([4.0, 5.2, 10.1, 10.8], 0.05, (12, 4)), "nc": 9, "idx": np.ones((12, 1))}
    return fields | {
        f"Z24_{name}": random.normal(10, 8, (12, 1)) for name in ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
    }


def z24_text():
    fields = z24_fields()
    names = ["TP", "TWN", "TWC", "TDS", "TDT", "TS", "Tair"]
    table = np.hstack([np.arange(12)[:, np.newaxis], fields["data"], *(fields[f"Z24_{name}"] for name in names)])
    header = ",".join(["record", "f1", "f2", "f3", "f4", *names, "state"])
    return "\n".join([header, *(",".join(f"{value:.6g}" for value in row) + ",undamaged" for row in table)]) + "\n"


def kw51_file(*, compressed=False, zipped=False):
    """A struct of numbers, three-dimensional complex ones among them, texts in cells, and a matrix of characters."""
    random = np.random.default_rng(0)
    shapes = random.normal(size=(2, 5, 3, 2))
    sensors = np.empty((1, 2), dtype=object)
    sensors[0, :] = ["aBD17Az", "aAR1516Ay"]
    modes = {
        "sdn": 737334 + np.arange(5)[:, np.newaxis] / 24,
        "f": random.normal([1.9, 2.6, 4.1], 0.01, (5, 3)),
        "xi": random.uniform(0.001, 0.05, (5, 3)),
        "m": shapes[0] + 1j * shapes[1],
        "labels_m": sensors,
        "env": random.integers(0, 30, (5, 4)),
        "labels_env": np.array(["tBD31A", "rhBD31A", "tVL", "grVL"]),
    }
    content = written(lambda stream: scipy.io.savemat(stream, {"modes": modes}, do_compression=compressed))
    if not zipped:
        return content
    stream = io.BytesIO()
    with zipfile.ZipFile(stream, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("trackedmodes.mat", content)
    return stream.getvalue()


def written(write):
    stream = io.BytesIO()
    write(stream)
    return stream.getvalue()


def mat(fields, *, sparse=False, compressed=False):
    form = scipy.sparse.csc_array if sparse else np.asarray
    fields = {name: form(field) for name, field in fields.items()}
    return written(lambda stream: scipy.io.savemat(stream, fields, do_compression=compressed))


def mtx(matrix, **options):
    return written(lambda stream: scipy.io.mmwrite(stream, matrix, **options))


def triplets(matrix):
    half = np.triu(matrix)
    lines = [f"{i + 1} {j + 1}  {half[i, j]:.13e}" for i, j in zip(*np.nonzero(half), strict=True)]
    return "\n".join(lines).encode()


def sparse_npz(form):
    matrix = getattr(scipy.sparse, f"{form}_array")(matrices()["E_1"])
    return written(lambda stream: scipy.sparse.save_npz(stream, matrix))


def valid_files():
    """Format -> loader, name of the file, its bytes; a folder holds the other matrices beside it."""
    fields, E_1 = matrices(), matrices()["E_1"]
    files = {
        "mat": ("affine", "model.mat", mat(fields)),
        "mat, sparse": ("affine", "model.mat", mat(fields, sparse=True)),
        "mat, compressed": ("affine", "model.mat", mat(fields, sparse=True, compressed=True)),
        "npz": ("affine", "model.npz", written(lambda stream: np.savez(stream, **fields))),
        "npz, compressed": ("affine", "model.npz", written(lambda stream: np.savez_compressed(stream, **fields))),
        "mtx, dense": ("folder", "E_1.mtx", mtx(E_1, symmetry="general")),
        "mtx, symmetric": ("folder", "E_1.mtx", mtx(E_1, symmetry="symmetric")),
        "mtx, sparse": ("folder", "E_1.mtx", mtx(scipy.sparse.coo_array(E_1), symmetry="general")),
        "mtx, complex": ("folder", "E_1.mtx", mtx(scipy.sparse.coo_array(E_1 + 0j), symmetry="hermitian")),
        "sti": ("folder", "E_1.sti", triplets(E_1)),
        "z24, csv": ("z24", "z24.csv", z24_text().encode()),
        "z24, mat": ("z24", "z24.mat", mat(z24_fields())),
        "z24, mat compressed": ("z24", "z24.mat", mat(z24_fields(), compressed=True)),
        "kw51, mat": ("kw51", "trackedmodes.mat", kw51_file()),
        "kw51, mat compressed": ("kw51", "trackedmodes.mat", kw51_file(compressed=True)),
        "kw51, zip": ("kw51", "trackedmodes.zip", kw51_file(zipped=True)),
    }
    for form in ("csr", "csc", "coo", "bsr", "dia"):
        files[f"sparse npz, {form}"] = ("folder", "E_1.npz", sparse_npz(form))
    for kind, (suffix, _, text) in TEXTS.items():
        files[kind] = ("text", f"E_1{suffix}", text(E_1).encode())
    return files


def mutated(content, random):
    """A copy with one or two of: bytes flipped, cut off, inserted, exchanged, or a length changed."""
    content = bytearray(content)
    for _ in range(random.integers(1, 3)):
        within = len(content) if random.integers(2) else min(len(content), BEGINNING)
        place = int(random.integers(within or 1))
        kind = random.integers(6)
        if kind == 0 and content:
            content[place] ^= 1 << int(random.integers(8))
        elif kind == 1:
            del content[place:]
        elif kind == 2:
            content[place:place] = random.bytes(int(random.integers(1, 40)))
        elif kind == 3:
            content[place : place + int(random.integers(1, 40))] = b""
        elif kind == 4:
            form = "<>"[random.integers(2)] + "IQ"[random.integers(2)]
            width = struct.calcsize(form)
            number = NUMBERS[random.integers(len(NUMBERS))] % 2 ** (8 * width)
            content[place // 4 * 4 : place // 4 * 4 + width] = struct.pack(form, number)
        else:
            tokens = list(re.finditer(rb"\d+", content)) or [re.match(rb"", content)]
            token = tokens[int(random.integers(len(tokens) if random.integers(2) else min(len(tokens), 6)))]
            content[token.start() : token.end()] = WORDS[random.integers(len(WORDS))]
    return bytes(content)


def mutated_inside(content, random):
    """Mutated content of a compressed file, sometimes with many zeros behind it, and right checksums."""
    zeros = int(random.integers(MOST_ZEROS)) if random.integers(30) == 0 else 0
    if content[:2] == b"PK":
        out = io.BytesIO()
        with zipfile.ZipFile(io.BytesIO(content)) as old, zipfile.ZipFile(out, "w", zipfile.ZIP_DEFLATED) as new:
            chosen = random.choice(old.namelist())
            for name in old.namelist():
                with new.open(name, "w") as stream:
                    stream.write(mutated(old.read(name), random) if name == chosen else old.read(name))
                    for _ in range(zeros // MILLION if name == chosen else 0):
                        stream.write(bytes(MILLION))
        return out.getvalue()
    if content[HEADER_OF_MAT : HEADER_OF_MAT + 1] != b"\x0f":
        return mutated(content, random)
    elements, place = [], HEADER_OF_MAT
    while place < len(content):
        length = struct.unpack_from("<I", content, place + 4)[0]
        elements.append(content[place + 8 : place + 8 + length])
        place += 8 + length
    chosen = random.integers(len(elements))
    element = bytearray(mutated(zlib.decompress(elements[chosen]), random))
    if random.integers(2):
        element[4:8] = struct.pack("<I", max(len(element) - 8, 0) + zeros // MILLION * MILLION)
    packer = zlib.compressobj(1)
    pieces = [packer.compress(element), *(packer.compress(bytes(MILLION)) for _ in range(zeros // MILLION))]
    elements[chosen] = b"".join([*pieces, packer.flush()])
    return content[:HEADER_OF_MAT] + b"".join(struct.pack("<II", 15, len(element)) + element for element in elements)


def read(loader, file, kind):
    """What became of one file: "read", "refused", or what was wrong."""
    try:
        if loader == "text":
            found = read_named_matrices(file, lambda name: True)
            return "read" if agrees(kind, file.read_bytes(), found) else "another matrix than its text holds"
        if loader in OF_DATA:
            OF_DATA[loader](file)
        else:
            load_affine(file.parent if loader == "folder" else file, n_modes=2)
    except (ValueError, OSError) as error:
        names_it = file.name in str(error) or str(file.parent) in str(error)
        return "refused" if names_it else f"an error that does not name the file: {type(error).__name__}: {error}"
    except MemoryError:
        return "out of memory"
    except BaseException as error:
        return f"{type(error).__name__}: {error}"
    return "read"


def written_to(folder, jobs):
    """Mutated files of some formats and seeds; without a seed the valid file."""
    files = valid_files()
    for format_name, seed in jobs:
        loader, name, content = files[format_name]
        file = Path(folder) / f"{format_name} {seed}" / name
        file.parent.mkdir()
        if loader == "folder":
            for other, matrix in matrices().items():
                if other != file.stem:
                    scipy.io.mmwrite(file.parent / f"{other}.mtx", matrix)
        if seed is not None:
            random = np.random.default_rng(seed)
            content = (mutated_inside if random.integers(2) else mutated)(content, random)
        file.write_bytes(content)
        yield loader, file, format_name


def reset_peak():
    """Let Linux forget this process's peak memory."""
    with contextlib.suppress(OSError):
        Path("/proc/self/clear_refs").write_text("5")


def peak_megabytes():
    try:
        status = Path("/proc/self/status").read_text()
        return int(status.partition("VmHWM:")[2].split()[0]) / 1024
    except OSError:  # not on Linux: the peak since the process began
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024


def read_all(files, pipe):
    """Read files, and send for each what became of it and how much memory it took at most."""
    warnings.simplefilter("ignore")
    for loader, file, kind in files:
        reset_peak()
        before = peak_megabytes()
        pipe.send(None)
        outcome = read(loader, file, kind)
        pipe.send((outcome, peak_megabytes() - before))
    pipe.close()


def outcomes(files):
    """What became of files in a process of their own; where one ends it, another process goes on with the next."""
    done = 0
    while done < len(files):
        context = multiprocessing.get_context("spawn")
        receiver, sender = context.Pipe(duplex=False)
        process = context.Process(target=read_all, args=(files[done:], sender))
        process.start()
        sender.close()
        with contextlib.suppress(EOFError):
            while True:
                if (result := receiver.recv()) is not None:
                    done += 1
                    yield result
        process.join()
        if process.exitcode:
            done += 1
            yield f"the interpreter ended with exit code {process.exitcode}", 0.0


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--files", type=int, default=1000, help="mutated files, of all formats together")
    parser.add_argument("--seed", type=int, default=0, help="of the first file")
    parser.add_argument("--formats", nargs="*", default=[""], help="words of which names of formats have one")
    options = parser.parse_args()
    names = [name for name in valid_files() if any(word in name for word in options.formats)]
    jobs = [(name, None) for name in names]
    jobs += [(names[seed % len(names)], seed) for seed in range(options.seed, options.seed + options.files)]
    counts, wrong, largest = collections.Counter(), [], (0.0, "no file")
    for start in range(0, len(jobs), FILES_IN_A_PROCESS):
        some = jobs[start : start + FILES_IN_A_PROCESS]
        with tempfile.TemporaryDirectory() as folder:
            results = list(outcomes(list(written_to(folder, some))))
        for (name, seed), (outcome, peak) in zip(some, results, strict=True):
            largest = max(largest, (peak, f"{name}, seed {seed}"))
            if seed is not None:
                counts[outcome] += 1
            if outcome not in ("read", "refused") or (seed is None and outcome != "read") or peak > MOST_MEGABYTES:
                wrong.append(f"{name}, seed {seed}: {outcome}, {peak:.0f} MB")
    print("\n".join(wrong[:50]))
    print(
        f"{sum(counts.values())} mutated files of {len(names)} formats: {counts['read']} read, {counts['refused']} "
        f"refused, {len(wrong)} wrong; at most {largest[0]:.0f} MB ({largest[1]})"
    )
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
