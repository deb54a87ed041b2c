"""Files that may be damaged or shared: MATLAB, Matrix Market and NumPy files, text; locks."""

from skthermo._io._damaged import read_half, read_matlab
from skthermo._io._locks import lock
from skthermo._io._matrix_files import read_named_matrices

__all__ = ["lock", "read_half", "read_matlab", "read_named_matrices"]
