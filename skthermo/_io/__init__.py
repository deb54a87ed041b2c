"""Files that may be damaged or shared: matrices of MATLAB, NumPy and FE programs; locks.

It uses NumPy and SciPy alone. Start with ``_matrix_files.py``, which recognises a file by its content.
"""

from skthermo._io._matrix_files import MASS, read_half, read_matlab, read_named_matrices
from skthermo._io._shared_files import ReadWhenAsked, alone_with, lock, write_when_complete

__all__ = [
    "MASS",
    "ReadWhenAsked",
    "alone_with",
    "lock",
    "read_half",
    "read_matlab",
    "read_named_matrices",
    "write_when_complete",
]
