"""Files that may be damaged or shared: MATLAB, Matrix Market, NumPy and zip files, text; locks."""

from skthermo._io._locks import lock
from skthermo._io._matlab import read_matlab
from skthermo._io._matlab_values import read_matlab_values
from skthermo._io._matrix_files import read_named_matrices
from skthermo._io._matrix_market import read_matrix_market
from skthermo._io._memory_limit import MemoryLimit
from skthermo._io._triplets import read_half
from skthermo._io._zip import read_only_member

__all__ = [
    "MemoryLimit",
    "lock",
    "read_half",
    "read_matlab",
    "read_matlab_values",
    "read_matrix_market",
    "read_named_matrices",
    "read_only_member",
]
