"""FE models from other programs, through exported matrices or functions that return matrices or frequencies."""

from skthermo.fem.external._callable import CallableModel
from skthermo.fem.external._differences import difference_terms, probe
from skthermo.fem.external._exported import load_affine, read_triplets
from skthermo.fem.external._files import read_named_matrices

__all__ = ["CallableModel", "difference_terms", "load_affine", "probe", "read_named_matrices", "read_triplets"]
