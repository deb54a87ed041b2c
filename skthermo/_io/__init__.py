"""Files that may be damaged or shared: MATLAB, Matrix Market and NumPy matrices; locks."""

from skthermo._io._locks import lock
from skthermo._io._matlab import read_matlab
from skthermo._io._matrix_files import read_named_matrices
from skthermo._io._matrix_market import read_matrix_market
from skthermo._io._memory_limit import MemoryLimit

__all__ = ["MemoryLimit", "lock", "read_matlab", "read_matrix_market", "read_named_matrices"]
