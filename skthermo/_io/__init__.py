"""Files that may be damaged or shared: MATLAB, Matrix Market and NumPy files, text; locks; a progress bar."""

from skthermo._io._damaged import read_half, read_matlab
from skthermo._io._matrix_files import read_named_matrices
from skthermo._io._progress import with_progress, without_bars
from skthermo._io._shared_files import alone_with, lock, write_when_complete

__all__ = [
    "alone_with",
    "lock",
    "read_half",
    "read_matlab",
    "read_named_matrices",
    "with_progress",
    "without_bars",
    "write_when_complete",
]
