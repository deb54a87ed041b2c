"""FE models from other programs: exported matrices, programs that return matrices, programs that return
frequencies."""

from skthermo.fem.external._callable import CallableModel
from skthermo.fem.external._exported import load_affine
from skthermo.fem.external._probe import probe

__all__ = ["CallableModel", "load_affine", "probe"]
